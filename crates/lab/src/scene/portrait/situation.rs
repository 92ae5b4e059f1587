//! Situations that are hard for depth from a single picture: worn and held objects, furniture, other people, lighting.

use glam::{Mat3, Vec3};

use super::materials;
use super::sdf::linear_from_hex;
use super::{HEAD, head, nod_pose, torso};
use crate::scene::light::Light;
use crate::scene::part::{Material, Part};
use crate::scene::ray::Pose;
use crate::scene::shape::Shape;

/// What a person in front of a webcam does or has, besides glasses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    /// Just sits.
    Sits,
    /// Wears a headset with a microphone.
    Headset,
    /// Raises a hand.
    Hand,
    /// Holds a mug towards the camera.
    Mug,
    /// Sits in an office chair whose back is wider than the person.
    Chair,
    /// Another person stands farther back.
    Visitor,
    /// A lamp in the background was switched on after the empty room was captured.
    Lamp,
}

impl Situation {
    /// All situations.
    pub const ALL: [Self; 7] =
        [Self::Sits, Self::Headset, Self::Hand, Self::Mug, Self::Chair, Self::Visitor, Self::Lamp];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sits => "sits",
            Self::Headset => "headset",
            Self::Hand => "hand",
            Self::Mug => "mug",
            Self::Chair => "chair",
            Self::Visitor => "visitor",
            Self::Lamp => "lamp on",
        }
    }

    /// Returns the parts that belong to the person.
    pub(super) fn worn_parts(self) -> Vec<Part> {
        match self {
            Self::Headset => vec![create_headset()],
            Self::Hand => vec![create_hand()],
            Self::Mug => vec![create_mug()],
            Self::Sits | Self::Chair | Self::Visitor | Self::Lamp => Vec::new(),
        }
    }

    /// Returns the parts that come and go with the person, but are not part of them.
    pub(super) fn other_people(self) -> Vec<Part> {
        match self {
            Self::Visitor => vec![head::create_part(visitor_pose), torso::create_part(visitor_pose)],
            _ => Vec::new(),
        }
    }

    /// Returns the parts that are also in the empty room.
    pub(super) fn furniture(self) -> Vec<Part> {
        if self == Self::Chair { vec![create_chair()] } else { Vec::new() }
    }

    /// Returns the additional lights while the person is present.
    pub(super) fn lights(self) -> Vec<Light> {
        let lamp = Light {
            position: Vec3::new(-1.1, 0.9, 3.4),
            power: Vec3::new(1.5, 1.15, 0.75),
            softness: 0.25,
            self_shadow_range_m: 0.0,
        };
        if self == Self::Lamp { vec![lamp] } else { Vec::new() }
    }
}

const SKIN: u32 = 0xe3ab8c;
const WOOL: u32 = 0xd99a2b;

/// Creates a headset of two cups, a bow over the hair and a microphone on an arm, in the frame of the head.
fn create_headset() -> Part {
    let mut part = Part::new_moving(nod_pose);
    let dark = Material::new(materials::shade_metal, linear_from_hex(0x202226));
    let bow: Vec<_> = (0..=20)
        .map(|k| {
            let angle = std::f32::consts::PI * k as f32 / 20.0;
            (Vec3::new(0.108 * angle.cos(), 0.005 + 0.142 * angle.sin(), 0.03), 0.008)
        })
        .collect();
    part.add_chain(&bow, dark);
    for side in [-1.0, 1.0] {
        let centre = Vec3::new(0.104 * side, -0.005, 0.022);
        part.add(Shape::ellipsoid(centre, Mat3::IDENTITY, Vec3::new(0.02, 0.042, 0.038)), dark);
    }
    let arm = [[0.107, -0.03, 0.01], [0.1, -0.075, -0.045], [0.06, -0.1, -0.1]].map(|at| (Vec3::from(at), 0.004));
    part.add_chain(&arm, dark);
    part.add(Shape::Sphere { centre: Vec3::new(0.055, -0.1, -0.104), radius: 0.012 }, dark);
    part
}

/// Creates a lower arm with an open hand beside the face, slightly nearer than the face.
fn create_hand() -> Part {
    let mut part = Part::new_static();
    let (wool, skin) = (
        Material::new(materials::shade_cloth, linear_from_hex(WOOL)),
        Material::new(materials::shade_diffuse, linear_from_hex(SKIN)),
    );
    let wrist = Vec3::new(0.245, -0.075, 1.09);
    part.add_chain(&[(Vec3::new(0.30, -0.42, 1.2), 0.052), (wrist - 0.02 * Vec3::Y, 0.037)], wool);
    let palm = wrist + Vec3::new(0.0, 0.06, -0.01);
    part.add_chain(&[(wrist - 0.03 * Vec3::Y, 0.028), (wrist, 0.026)], skin);
    part.add(Shape::ellipsoid(palm, Mat3::IDENTITY, Vec3::new(0.042, 0.05, 0.017)), skin);
    for (k, length) in [0.062, 0.072, 0.066, 0.052].into_iter().enumerate() {
        let aside = (k as f32 - 1.5) * 0.021;
        let root = palm + Vec3::new(aside, 0.036, -0.002);
        let tip = root + Vec3::new(0.35 * aside, length, -0.012);
        part.add_chain(&[(root, 0.0095), (0.5 * (root + tip), 0.009), (tip, 0.007)], skin);
    }
    let thumb = palm + Vec3::new(-0.036, -0.01, -0.004);
    part.add_chain(&[(thumb, 0.012), (thumb + Vec3::new(-0.032, 0.034, -0.01), 0.009)], skin);
    part
}

/// Creates a mug in a hand, held out towards the camera.
fn create_mug() -> Part {
    let mut part = Part::new_static();
    let (wool, skin) = (
        Material::new(materials::shade_cloth, linear_from_hex(WOOL)),
        Material::new(materials::shade_diffuse, linear_from_hex(SKIN)),
    );
    let at = Vec3::new(-0.115, -0.155, 0.8);
    let mug = Material::new(materials::shade_ceramic, linear_from_hex(0x2f6f93));
    part.add(Shape::Frustum { base: at, height: 0.095, low_radius: 0.038, high_radius: 0.041 }, mug);
    part.add(Shape::ellipsoid(at + 0.002 * Vec3::Y, Mat3::IDENTITY, Vec3::new(0.038, 0.006, 0.038)), mug);
    part.add_chain(&[(Vec3::new(-0.25, -0.47, 1.2), 0.052), (at + Vec3::new(-0.05, -0.02, 0.1), 0.036)], wool);
    part.add_chain(&[(at + Vec3::new(-0.05, -0.02, 0.1), 0.028), (at + Vec3::new(-0.045, 0.03, 0.035), 0.03)], skin);
    for k in 0..4 {
        let root = at + Vec3::new(-0.044, 0.018 + 0.019 * k as f32, 0.02);
        let over = [Vec3::ZERO, Vec3::new(-0.002, 0.0, -0.045), Vec3::new(0.03, 0.0, -0.064)];
        part.add_chain(&over.map(|off| (root + off, 0.0095)), skin);
    }
    part
}

/// Creates the back of an office chair, a hand's breadth behind the person.
fn create_chair() -> Part {
    let mut part = Part::new_static();
    let dark = Material::new(materials::shade_cloth, linear_from_hex(0x25282c));
    let axes = Mat3::from_rotation_y(0.25);
    let centre = Vec3::new(HEAD.x + 0.02, -0.2, 1.52);
    part.add(Shape::Cuboid { centre, axes, half: Vec3::new(0.27, 0.24, 0.02) }, dark);
    let rest = centre + Vec3::new(0.0, 0.31, 0.01);
    part.add(Shape::Cuboid { centre: rest, axes, half: Vec3::new(0.15, 0.06, 0.025) }, dark);
    part
}

/// Returns the pose of the other person.
fn visitor_pose(_: f32) -> Pose {
    Pose { rotation: Mat3::from_rotation_y(-0.3), translation: Vec3::new(-0.80, 0.12, 2.85) }
}
