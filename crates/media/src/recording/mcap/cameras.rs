//! The cameras of a recording, to register depth of another camera's view: the intrinsics in `sensor_msgs/CameraInfo`
//! (ROS REP 104), and the poses in the `tf2_msgs/TFMessage` of `/tf_static`.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, UVec2};

use super::fields::Fields;
use super::message::{self, Encoding};
use super::topic::Topic;
use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam::calibration::{CameraIntrinsics, Distortion};

/// Largest message that is read.
pub(super) const MAX_BYTES: u64 = 1 << 20;
/// Number of transforms that are kept: robots have some hundred.
const MAX_TRANSFORMS: usize = 4096;
/// Number of coefficients of a lens, at most.
const MAX_COEFFICIENTS: u32 = 14;

/// The kind of a message that describes cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Info,
    Transforms,
}

impl Kind {
    /// Returns the kind of a topic with this name and type.
    pub fn of_topic(name: &str, kind: &str) -> Option<Self> {
        match kind {
            "sensor_msgs/msg/CameraInfo" | "sensor_msgs/CameraInfo" => Some(Self::Info),
            // Other transforms change from frame to frame.
            "tf2_msgs/msg/TFMessage" | "tf2_msgs/TFMessage" if name.ends_with("tf_static") => Some(Self::Transforms),
            _ => None,
        }
    }
}

/// A `CameraInfo`.
#[derive(Clone, Debug, PartialEq)]
struct Info {
    topic: String,
    frame_id: String,
    /// Of pictures as the lens makes them, or the name of a lens model that is not read; and of rectified ones.
    raw: Result<CameraIntrinsics, String>,
    rectified: CameraIntrinsics,
}

/// A coordinate frame, and the pose in it of another: `x_parent = pose * x_child`.
type Parent = (String, DAffine3);

/// What the messages state.
#[derive(Debug, Default)]
pub(super) struct Cameras {
    infos: Vec<Info>,
    /// By the child.
    parents: HashMap<String, Parent>,
}

impl Cameras {
    /// Returns whether another message of this topic would tell nothing new.
    pub fn knows(&self, topic: &str, kind: Kind) -> bool {
        kind == Kind::Info && self.infos.iter().any(|info| info.topic == topic)
    }

    /// Adds a message; `None` if it is damaged.
    pub fn add(&mut self, topic: &str, kind: Kind, encoding: Encoding, bytes: &[u8]) -> Option<()> {
        let mut fields = message::start(bytes, encoding)?;
        match kind {
            Kind::Info => self.infos.push(read_info(topic, &mut fields, encoding)?),
            Kind::Transforms => {
                for _ in 0..fields.u32()? {
                    let Some((child, parent)) = read_transform(&mut fields, encoding)? else { continue };
                    // The last one counts.
                    if self.parents.len() < MAX_TRANSFORMS || self.parents.contains_key(&child) {
                        self.parents.insert(child, parent);
                    }
                }
            }
        }
        Some(())
    }

    /// Returns the calibration for depth of another camera's view, or what is missing.
    pub fn find_calibration(&self, depth: &Topic, color: &Topic) -> Result<RgbdCalibration, String> {
        let [depth_camera, color_camera] = [depth, color].map(|topic| self.find_intrinsics(topic));
        let (from_depth, depth_root) = self.find_pose(&depth.frame_id);
        let (from_color, color_root) = self.find_pose(&color.frame_id);
        if depth_root != color_root {
            return Err("/tf_static has no transform between them".to_owned());
        }
        let pose = from_color.inverse() * from_depth;
        let calibration = RgbdCalibration {
            depth: depth_camera?,
            color: color_camera?,
            rotation: pose.matrix3,
            translation_m: pose.translation,
        };
        calibration.validate().map(|()| calibration).map_err(|error| error.to_string())
    }

    /// Returns the intrinsics of the pictures of a topic: of its `camera_info`, or else of any of its coordinate frame.
    fn find_intrinsics(&self, topic: &Topic) -> Result<CameraIntrinsics, String> {
        let picture = topic.base_name();
        let beside =
            picture.rsplit_once('/').map_or(String::new(), |(namespace, _)| format!("{namespace}/camera_info"));
        let is_beside = |info: &&Info| info.topic == beside;
        let is_of_frame = |info: &&Info| !info.frame_id.is_empty() && info.frame_id == topic.frame_id;
        let found = self.infos.iter().find(is_beside).or_else(|| self.infos.iter().find(is_of_frame));
        let info = found.ok_or_else(|| format!("there is no {}", beside.escape_debug()))?;
        // REP 104 and image_proc: the names of rectified pictures say so.
        let is_rectified = picture.rsplit('/').next().is_some_and(|name| name.contains("rect"));
        let camera = if is_rectified { Ok(info.rectified) } else { info.raw.clone() };
        let camera = camera.map_err(|model| {
            format!("{} has the lens model {:?}, which is not read", info.topic.escape_debug(), model)
        })?;
        match camera.focal_px.min_element() > 0.0 {
            true => Ok(camera),
            false => Err(format!("{} states no calibration", info.topic.escape_debug())),
        }
    }

    /// Returns the pose of a coordinate frame in that of its farthest ancestor, and the name of that.
    fn find_pose<'a>(&'a self, frame_id: &'a str) -> (DAffine3, &'a str) {
        let (mut pose, mut at) = (DAffine3::IDENTITY, frame_id);
        // A loop has no root.
        for _ in 0..=self.parents.len() {
            let Some((parent, from_child)) = self.parents.get(at) else { break };
            (pose, at) = (*from_child * pose, parent);
        }
        (pose, at)
    }
}

/// Reads the calibration of a camera; `None` if the message is too short.
fn read_info(topic: &str, fields: &mut Fields, encoding: Encoding) -> Option<Info> {
    let (_, frame_id) = message::read_header(fields, encoding)?;
    let (height, width, model) = (fields.u32()?, fields.u32()?, fields.text()?);
    let count = fields.u32().filter(|&count| count <= MAX_COEFFICIENTS)?;
    let coefficients = (0..count).map(|_| fields.f64()).collect::<Option<Vec<_>>>()?;
    let camera: [f64; 9] = fields.f64s()?;
    let _rotation: [f64; 9] = fields.f64s()?;
    let projection: [f64; 12] = fields.f64s()?;
    // The matrices are those of the whole sensor, and pictures a part of it, binned (REP 104); 0 is the whole, or 1.
    let [bin_x, bin_y, left, top, rows, columns] = [(); 6].map(|()| fields.u32().unwrap_or(0));
    let part = UVec2::new(if columns == 0 { width } else { columns }, if rows == 0 { height } else { rows });
    let (bin, offset) = (UVec2::new(bin_x.max(1), bin_y.max(1)), UVec2::new(left, top).as_dvec2());
    let pinhole = |focal_px: DVec2, center_px: DVec2| CameraIntrinsics {
        size: Some((part / bin).into()),
        focal_px: focal_px / bin.as_dvec2(),
        center_px: (center_px - offset + 0.5) / bin.as_dvec2() - 0.5,
        distortion: Distortion::RadialTangential([0.0; 8]),
    };
    let [fx, _, cx, _, fy, cy, ..] = camera;
    let raw = pinhole(DVec2::new(fx, fy), DVec2::new(cx, cy));
    let is_pinhole = coefficients.iter().all(|&coefficient| coefficient == 0.0);
    let distortion = match Distortion::from_model(model, &coefficients) {
        Ok(distortion) => Ok(distortion),
        // Whatever the model, it does nothing.
        Err(_) if is_pinhole => Ok(raw.distortion),
        Err(_) => Err(model.to_owned()),
    };
    let [fx, _, cx, _, _, fy, cy, ..] = projection;
    Some(Info {
        topic: topic.to_owned(),
        frame_id: frame_id.to_owned(),
        raw: distortion.map(|distortion| CameraIntrinsics { distortion, ..raw }),
        // Drivers of rectified cameras may leave the projection at 0.
        rectified: if fx > 0.0 { pinhole(DVec2::new(fx, fy), DVec2::new(cx, cy)) } else { raw },
    })
}

/// Returns the child of a transform, and its parent; neither if its rotation is not set.
fn read_transform(fields: &mut Fields, encoding: Encoding) -> Option<Option<(String, Parent)>> {
    let (_, parent) = message::read_header(fields, encoding)?;
    let child = fields.text()?;
    let (translation_m, rotation) = (DVec3::from_array(fields.f64s()?), DQuat::from_array(fields.f64s()?));
    let pose = DAffine3::from_mat3_translation(DMat3::from_quat(rotation.normalize()), translation_m);
    Some(pose.is_finite().then(|| (child.trim_start_matches('/').to_owned(), (parent.to_owned(), pose))))
}
