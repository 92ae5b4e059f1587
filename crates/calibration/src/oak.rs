//! Reads the calibration that Luxonis' DepthAI stores in OAK cameras, as JSON (`CalibrationHandler::eepromToJsonFile`):
//! each camera's pose leads to another camera's axes, with a translation in centimetres.

use glam::{DMat3, DVec3};

use super::entries;
use super::tree::{File, Value};
use bokehcam::calibration::{CalibrationError, Fault};
use bokehcam::calibration::{CameraIntrinsics, Distortion, LengthUnit, StereoCalibration};

/// Remedy for a missing key.
const HINT: &str = "save the calibration of the camera again";
const CM_PER_M: f64 = 100.0;
/// Sockets of the left and of the right camera, if the file does not state them.
const USUAL_SOCKETS: [u32; 2] = [1, 2];
/// Maximum number of cameras of a device; there are at most a dozen sockets.
const MAX_CAMERAS: usize = 16;

/// A pose `x -> rotation x + translation`, in metres.
type Pose = (DMat3, DVec3);

/// Reads the two cameras that measure depth.
pub(super) fn from_file(file: &File) -> Result<StereoCalibration, CalibrationError> {
    let data = file.root().require("cameraData", HINT)?;
    let stated = file.root().get("stereoRectificationData").and_then(|pair| {
        let socket = |key| pair.get(key)?.parse_count().ok();
        Some([socket("leftCameraSocket")?, socket("rightCameraSocket")?])
    });
    let [left, right] = stated.unwrap_or(USUAL_SOCKETS);
    let (to_right, to_left) = (follow_poses(data, left)?, follow_poses(data, right)?);
    // Both paths lead to a common camera: there, and back from it.
    let common = to_right.iter().find_map(|(socket, there)| {
        let (_, back) = to_left.iter().find(|(other, _)| other == socket)?;
        let rotation = back.0.transpose() * there.0;
        Some((rotation, back.0.transpose() * (there.1 - back.1)))
    });
    let no_pose = "has no pose between the left and the right camera";
    let (rotation, translation_m) =
        common.ok_or_else(|| data.to_error(Fault::Impossible { key: data.key(), what: no_pose }))?;
    Ok(StereoCalibration {
        cameras: [read_camera(require_camera(data, left)?)?, read_camera(require_camera(data, right)?)?],
        rotation,
        translation_m: entries::require_baseline(data, translation_m)?,
        stored_rectification: None,
        unit: LengthUnit::Stated,
    })
}

/// Returns the camera of a socket, from pairs of a socket and a camera.
fn require_camera(data: Value<'_>, socket: u32) -> Result<Value<'_>, CalibrationError> {
    let cameras = data.items().into_iter().flatten().take(MAX_CAMERAS);
    let camera = cameras.filter_map(|pair| {
        let mut pair = pair.items()?;
        let is_it = pair.next()?.parse_count().is_ok_and(|found| found == socket);
        pair.next().filter(|_| is_it)
    });
    let missing = || data.to_error(Fault::Missing { key: format!("camera {socket} of cameraData"), hint: HINT });
    camera.into_iter().next().ok_or_else(missing)
}

/// Returns the sockets on the way from a camera, with the poses from its axes to theirs: first its own.
fn follow_poses(data: Value<'_>, socket: u32) -> Result<Vec<(u32, Pose)>, CalibrationError> {
    let mut path = vec![(socket, (DMat3::IDENTITY, DVec3::ZERO))];
    while let Some(&(socket, (rotation, translation_m))) = path.last().filter(|_| path.len() <= MAX_CAMERAS) {
        let extrinsics = require_camera(data, socket)?.require("extrinsics", HINT)?;
        // -1 is the end of the path.
        let Ok(next) = extrinsics.require("toCameraSocket", HINT)?.parse_count() else { break };
        let rows = extrinsics.require("rotationMatrix", HINT)?;
        let turn = entries::parse_rotation(rows, &rows.parse_numbers::<9>(3, "3x3")?)?;
        let place = extrinsics.require("translation", HINT)?;
        let along = |axis| place.require(axis, HINT)?.number();
        let shift_m = DVec3::new(along("x")?, along("y")?, along("z")?) / CM_PER_M;
        path.push((next, (turn * rotation, turn * translation_m + shift_m)));
    }
    Ok(path)
}

fn read_camera(camera: Value<'_>) -> Result<CameraIntrinsics, CalibrationError> {
    let (focal_px, center_px) = entries::parse_camera_matrix(camera.require("intrinsicMatrix", HINT)?)?;
    let side = |key| {
        let value = camera.require(key, HINT)?;
        entries::parse_side(value, value.parse_count()?.into())
    };
    let lens = camera.require("distortionCoeff", HINT)?;
    let model = camera.get("cameraType").map_or(Ok(0), |model| model.parse_count())?;
    let distortion = match (model, lens.parse_matrix()?.data.as_slice()) {
        // A fisheye's four coefficients, in a list for fourteen.
        (1, &[k1, k2, k3, k4, ..]) => Distortion::Equidistant([k1, k2, k3, k4]),
        (0, _) => entries::parse_distortion(None, lens)?,
        _ => {
            let known = "0 (perspective) or 1 (fisheye)";
            return Err(camera.to_error(Fault::Model { key: "cameraType".into(), found: model.to_string(), known }));
        }
    };
    Ok(CameraIntrinsics { size: Some((side("width")?, side("height")?)), focal_px, center_px, distortion })
}
