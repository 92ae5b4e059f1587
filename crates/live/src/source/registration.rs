//! The calibration file of a depth camera relative to the colour camera, and recordings that are opened with it.

use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;
use toml::Spanned;

use super::options::Depth;
use super::{Options, SourceError};
use bokehcam::calibration::registration::{AnySizeRegistration, RgbdCalibration, RgbdCalibrationError};
use bokehcam::calibration::{CameraIntrinsics, Distortion};
use bokehcam_files::input;
use bokehcam_media::recording::{Options as Reading, Recording};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    depth: Spanned<Camera>,
    color: Spanned<Camera>,
    #[serde(rename = "depth-to-color")]
    pose: Spanned<Pose>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Camera {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default)]
    distortion: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    rotation: [f64; 9],
    translation_m: [f64; 3],
}

impl Camera {
    /// Returns the camera, or the reason why it cannot be one.
    fn to_intrinsics(&self) -> Result<CameraIntrinsics, &'static str> {
        let &Self { width, height, fx, fy, cx, cy, ref distortion } = self;
        let distortion = Distortion::from_model("plumb_bob", distortion).map_err(
            |_| "distortion must have 4, 5, 8, 12 or 14 numbers, in the order of OpenCV: k1 k2 p1 p2 k3 ...",
        )?;
        Ok(CameraIntrinsics {
            size: Some((width, height)),
            focal_px: DVec2::new(fx, fy),
            center_px: DVec2::new(cx, cy),
            distortion,
        })
    }
}

/// Opens a recording. If its depth `is_used`, it is registered by the calibration that the options name.
///
/// # Errors
/// The recording cannot be opened, or the calibration does not belong to it.
pub(super) fn open_recording(folder: &Path, is_used: bool, options: &Options) -> Result<Recording, SourceError> {
    let file = options.depth.depth_calibration.as_deref().filter(|_| is_used);
    let depth_calibration = file.map(load_calibration).transpose()?;
    Ok(Recording::open(folder, &Reading { depth_calibration, ..options.recording_options() })?)
}

/// Returns the registration by the calibration of the options, for pictures of `size` (columns, rows) if it is known.
///
/// # Errors
/// The file is no calibration, or for pictures of another aspect.
pub(super) fn open(options: &Depth, size: Option<(u32, u32)>) -> Result<Option<AnySizeRegistration>, SourceError> {
    let Some(path) = options.depth_calibration.as_deref() else { return Ok(None) };
    let refuse = |what: String| SourceError::Usage(format!("{}: {what}", path.display()));
    let mut calibration = load_calibration(path)?;
    if let Some(size) = size {
        calibration.color = calibration.color.scaled_to(size).map_err(|error| refuse(error.to_string()))?;
    }
    AnySizeRegistration::new(calibration).map(Some).map_err(|error| refuse(error.to_string()))
}

/// Reads the calibration file `path`.
///
/// # Errors
/// The file is unreadable, has a wrong or missing key, or invalid numbers.
pub fn load_calibration(path: &Path) -> Result<RgbdCalibration, SourceError> {
    parse_calibration(
        path,
        &input::read_text(path, input::MAX_CALIBRATION_BYTES)
            .map_err(|source| SourceError::Io { path: path.to_owned(), source })?,
    )
}

/// Parses the text of the calibration file `path`.
///
/// # Errors
/// The text is not a depth calibration.
pub fn parse_calibration(path: &Path, text: &str) -> Result<RgbdCalibration, SourceError> {
    let refuse = |at: usize, what: String| SourceError::Registration {
        path: path.to_owned(),
        line: text[..at.min(text.len())].matches('\n').count() + 1,
        what,
    };
    let file: File = toml::from_str(text).map_err(|error| {
        refuse(error.span().map_or(0, |span| span.start), error.message().trim().replace('\n', ", "))
    })?;
    let pose = file.pose.get_ref();
    let camera = |table: &Spanned<Camera>| {
        table.get_ref().to_intrinsics().map_err(|what| refuse(table.span().start, what.to_owned()))
    };
    let calibration = RgbdCalibration {
        depth: camera(&file.depth)?,
        color: camera(&file.color)?,
        rotation: DMat3::from_cols_array(&pose.rotation).transpose(),
        translation_m: DVec3::from_array(pose.translation_m),
    };
    calibration.validate().map(|()| calibration).map_err(|error| {
        let table = match error {
            RgbdCalibrationError::Depth(_) => file.depth.span(),
            RgbdCalibrationError::Color(_) => file.color.span(),
            RgbdCalibrationError::Pose(_) => file.pose.span(),
        };
        refuse(table.start, error.to_string())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::calibration::registration::Registration;
    use bokehcam::frame::DepthMap;

    const GOOD: &str = "\
# measured
[depth]
width = 4
height = 2
fx = 4
fy = 4.0
cx = 1.5
cy = 0.5
[color]
width = 4
height = 2
fx = 4.0
fy = 4.0
cx = 1.5
cy = 0.5
[depth-to-color]
rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]
translation_m = [0.5, 0, 0]
";

    fn registration(text: &str) -> Registration {
        Registration::new(parse_calibration(Path::new("c.toml"), text).unwrap(), (4, 2)).unwrap()
    }

    fn refusal(text: &str) -> String {
        parse_calibration(Path::new("c.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn a_calibration_is_read() {
        let from = DepthMap { width: 4, height: 2, metres: vec![1.0; 8], ..DepthMap::default() };
        let (mut scratch, mut into) = (DepthMap::default(), DepthMap::default());
        registration(GOOD).register(&from, &mut scratch, &mut into);
        assert_eq!(into.metres, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0], "half a metre to the right is two pixels");
        // Row by row: a quarter turn about the optical axis maps x to y.
        let turned = GOOD.replace("1, 0, 0, 0, 1, 0, 0, 0, 1", "0, -1, 0, 1, 0, 0, 0, 0, 1").replace("[0.5", "[0");
        let from = DepthMap {
            width: 4,
            height: 2,
            metres: vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..DepthMap::default()
        };
        registration(&turned).register(&from, &mut scratch, &mut into);
        assert_eq!(into.metres, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, line, what) in [
            (GOOD.replace("cx = 1.5\ncy = 0.5\n[color]", "cx = 1.5\n[color]"), 2, "cy"),
            (GOOD.replacen("fy = 4.0\ncx", "fyy = 4.0\ncx", 1), 6, "fyy"),
            (GOOD.replace("[depth-to-color]", "[pose]"), 16, "pose"),
            (GOOD.replace("fx = 4\n", "fx = 0\n"), 2, "fx and fy"),
            (GOOD.replace("fx = 4\n", "fx = \"wide\"\n"), 5, "wide"),
            (GOOD.replace("[1, 0, 0,", "[2, 0, 0,"), 16, "rotation"),
            (GOOD.replace("[1, 0, 0,", "["), 17, "9"),
            (GOOD.replace("[0.5,", "[500,"), 16, "metres"),
            (GOOD.replacen("width = 4\n", "width = -4\n", 1), 3, "-4"),
            ("fx = ".to_string(), 1, ""),
            (String::new(), 1, "depth"),
        ] {
            let refusal = refusal(&text);
            assert!(refusal.starts_with(&format!("c.toml:{line}: ")), "{refusal}");
            assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}");
        }
    }
}
