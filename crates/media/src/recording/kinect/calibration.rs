//! The device's calibration: `calibration.json`, as the sensor has it in its memory.
//!
//! Its numbers are relative to the sensor's width and height, and count from the corner of the first pixel. Modes use a
//! part of the sensor (`mode_specific_calibration.c` of the SDK).

use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;

use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam::calibration::{CameraIntrinsics, Distortion};

/// The name of the attached file, unless the tag `K4A_CALIBRATION_FILE` names another.
pub(super) const FILE: &str = "calibration.json";

/// Modes of the depth camera: the size of its maps, that of the sensor's pixels after binning, and where the map begins
/// in these.
const DEPTH_MODES: [((u32, u32), f64, [f64; 2]); 4] = [
    ((320, 288), 512.0, [96.0, 90.0]),
    ((640, 576), 1024.0, [192.0, 180.0]),
    ((512, 512), 512.0, [0.0; 2]),
    ((1024, 1024), 1024.0, [0.0; 2]),
];

/// The lens model that devices have.
const LENS_MODEL: &str = "CALIBRATION_LensDistortionModelBrownConrady";

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Content {
    calibration_information: Information,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Information {
    cameras: Vec<Camera>,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Camera {
    location: String,
    intrinsics: Intrinsics,
    rt: Pose,
    sensor_width: f64,
    sensor_height: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Intrinsics {
    model_type: String,
    model_parameters: Vec<f64>,
}

/// The pose of the device's axes in those of the camera; the rotation row by row.
#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Pose {
    rotation: [f64; 9],
    translation: [f64; 3],
}

impl Camera {
    /// Returns the intrinsics for pictures of `size`, where the sensor has `sensor` pixels, and the picture begins at
    /// `offset` of these.
    fn intrinsics(&self, size: (u32, u32), sensor: DVec2, offset: DVec2) -> Result<CameraIntrinsics, String> {
        let model = &self.intrinsics.model_type;
        let parameters = self.intrinsics.model_parameters.first_chunk().filter(|_| model == LENS_MODEL);
        let &[cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1] =
            parameters.ok_or_else(|| format!("the lens model {} is not read", model.escape_debug()))?;
        Ok(CameraIntrinsics {
            size: Some(size),
            focal_px: DVec2::new(fx, fy) * sensor,
            center_px: DVec2::new(cx, cy) * sensor - offset - 0.5,
            distortion: Distortion::RadialTangential([k1, k2, p1, p2, k3, k4, k5, k6]),
        })
    }
}

impl Pose {
    fn rotation(&self) -> DMat3 {
        DMat3::from_cols_array(&self.rotation).transpose()
    }
}

/// Parses the calibration for depth maps and colour pictures of these sizes.
///
/// # Errors
/// The reason in one line.
pub(super) fn parse(json: &[u8], depth_size: (u32, u32), color_size: (u32, u32)) -> Result<RgbdCalibration, String> {
    let json = json.trim_ascii_end();
    let json = json.strip_suffix(&[0]).unwrap_or(json);
    let content: Content = serde_json::from_slice(json).map_err(|error| error.to_string().replace('\n', " "))?;
    let camera = |location: &str| {
        let cameras = &content.calibration_information.cameras;
        let found = cameras.iter().find(|camera| camera.location == format!("CALIBRATION_CameraLocation{location}"));
        found.ok_or_else(|| format!("it lacks the camera {location}"))
    };
    let (depth, color) = (camera("D0")?, camera("PV0")?);
    let (width, height) = depth_size;
    let &(_, binned, offset) = (DEPTH_MODES.iter().find(|(size, ..)| *size == depth_size))
        .ok_or_else(|| format!("no mode of the camera has depth maps of {width}x{height}"))?;
    // Colour pictures have the width of the sensor, and the middle of its height.
    let (width, height) = (f64::from(color_size.0), f64::from(color_size.1));
    let sensor = DVec2::new(width, width * color.sensor_height / color.sensor_width);
    let rotation = color.rt.rotation() * depth.rt.rotation().transpose();
    Ok(RgbdCalibration {
        depth: depth.intrinsics(depth_size, DVec2::splat(binned), offset.into())?,
        color: color.intrinsics(color_size, sensor, (sensor - DVec2::new(width, height)) / 2.0)?,
        rotation,
        translation_m: DVec3::from(color.rt.translation) - rotation * DVec3::from(depth.rt.translation),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A calibration with numbers like a real device's. The device's axes are those of the depth camera turned by 90
    /// degrees about z.
    fn json(sensor: (u32, u32)) -> String {
        let camera = |location: &str, (width, height): (u32, u32), parameters: &str, rotation: &str, at: &str| {
            format!(
                r#"{{"Intrinsics": {{"ModelParameterCount": 14, "ModelParameters": [{parameters}],
                "ModelType": "{LENS_MODEL}"}}, "Location": "CALIBRATION_CameraLocation{location}",
                "MetricRadius": 1.74, "Rt": {{"Rotation": [{rotation}], "Translation": [{at}]}},
                "SensorHeight": {height}, "SensorWidth": {width}}}"#
            )
        };
        let depth = "0.5123, 0.4945, 0.4921, 0.4922, 3.1, 2.3, 0.1, 3.4, 3.3, 0.6, 0, 0, -5e-5, 8e-5";
        let color = "0.49676, 0.51086, 0.47091, 0.62745, 0.7, -2.8, 1.6, 0.6, -2.7, 1.5, 0, 0, -1e-4, 7e-4";
        format!(
            r#"{{"CalibrationInformation": {{"Cameras": [{}, {}], "InertialSensors": []}}}}"#,
            camera("D0", (1024, 1024), depth, "0, -1, 0, 1, 0, 0, 0, 0, 1", "0, 0, 0.5"),
            camera("PV0", sensor, color, "0, -1, 0, 1, 0, 0, 0, 0, 1", "-0.032, -0.002, 0.504"),
        )
    }

    #[test]
    fn the_depth_camera_is_that_of_the_mode() {
        let camera = |size| parse(json((4096, 3072)).as_bytes(), size, (1280, 720)).unwrap().depth;
        let near = |found: DVec2, x: f64, y: f64| assert!((found - DVec2::new(x, y)).length() < 1e-9, "{found}");
        let unbinned = camera((640, 576));
        near(unbinned.focal_px, 0.4921 * 1024.0, 0.4922 * 1024.0);
        near(unbinned.center_px, 0.5123 * 1024.0 - 192.5, 0.4945 * 1024.0 - 180.5);
        assert_eq!(unbinned.distortion, Distortion::RadialTangential([3.1, 2.3, 8e-5, -5e-5, 0.1, 3.4, 3.3, 0.6]));
        near(camera((320, 288)).center_px, 0.5123 * 512.0 - 96.5, 0.4945 * 512.0 - 90.5);
        near(camera((512, 512)).center_px, 0.5123 * 512.0 - 0.5, 0.4945 * 512.0 - 0.5);
        near(camera((1024, 1024)).focal_px, 0.4921 * 1024.0, 0.4922 * 1024.0);
    }

    #[test]
    fn wide_colour_pictures_are_the_middle_of_the_sensor() {
        // Offsets and heights as the SDK lists them.
        for (size, height, offset) in [
            ((1280, 720), 960.0, 120.0),
            ((1920, 1080), 1440.0, 180.0),
            ((3840, 2160), 2880.0, 360.0),
            ((2048, 1536), 1536.0, 0.0),
            ((4096, 3072), 3072.0, 0.0),
        ] {
            let color = parse(json((4096, 3072)).as_bytes(), (640, 576), size).unwrap().color;
            let center = DVec2::new(0.49676 * f64::from(size.0), 0.51086 * height - offset) - 0.5;
            assert!((color.center_px - center).length() < 1e-9 && color.size == Some(size));
            assert!((color.focal_px - DVec2::new(0.47091 * f64::from(size.0), 0.62745 * height)).length() < 1e-9);
        }
        // Early devices were calibrated for 16:9: pictures of 4:3 then have 384 more rows of 3072 above.
        let early = |size| parse(json((4096, 2304)).as_bytes(), (640, 576), size).unwrap().color;
        let center = early((4096, 3072)).center_px;
        assert!((center.y - (0.51086 * 2304.0 + 384.0 - 0.5)).abs() < 1e-9);
        assert!((early((1280, 720)).center_px.y - (0.51086 * 720.0 - 0.5)).abs() < 1e-9);
    }

    #[test]
    fn the_pose_is_from_depth_to_colour() {
        // Both cameras are turned alike, and 32 mm apart in the axes of either.
        let found = parse(json((4096, 3072)).as_bytes(), (640, 576), (1280, 720)).unwrap();
        assert_eq!(found.rotation, DMat3::IDENTITY);
        assert!((found.translation_m - DVec3::new(-0.032, -0.002, 0.004)).length() < 1e-12);
        // Row by row: the colour camera turned about x sees what is in front of the depth camera higher or lower.
        let turned = json((4096, 3072)).replacen("0, -1, 0, 1, 0, 0, 0, 0, 1", "1, 0, 0, 0, 1, 0, 0, 0, 1", 1);
        let turned = turned.replace("0, -1, 0, 1, 0, 0, 0, 0, 1", "1, 0, 0, 0, 0.8, 0.6, 0, -0.6, 0.8");
        let found = parse(turned.as_bytes(), (640, 576), (1280, 720)).unwrap();
        assert!((found.rotation * DVec3::Z - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-12);
        let translation_m = DVec3::new(-0.032, -0.002, 0.504) - DVec3::new(0.0, 0.3, 0.4);
        assert!((found.translation_m - translation_m).length() < 1e-12);
    }

    #[test]
    fn what_is_wrong_is_one_line() {
        let json = json((4096, 3072));
        let padded = format!("{json}\n\0");
        assert!(parse(padded.as_bytes(), (640, 576), (1280, 720)).is_ok());
        let fault = |json: &str, depth_size| parse(json.as_bytes(), depth_size, (1280, 720)).unwrap_err();
        for (fault, part) in [
            (fault(&json, (641, 576)), "641x576"),
            (fault(&json.replace("LocationD0", "LocationD1"), (640, 576)), "camera D0"),
            (fault(&json.replace("BrownConrady", "Theta"), (640, 576)), "ModelTheta"),
            (fault(&json.replace("-5e-5, 8e-5", "1"), (640, 576)), "BrownConrady"),
            (fault(&json.replace("SensorWidth", "Width"), (640, 576)), "SensorWidth"),
            (fault(&json[..100], (640, 576)), "line"),
            (fault("", (640, 576)), "line"),
        ] {
            assert!(fault.contains(part) && !fault.contains('\n'), "{fault}");
        }
    }
}
