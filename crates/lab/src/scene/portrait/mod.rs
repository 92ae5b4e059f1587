//! Assembles the portrait scene.

mod face;
mod front;
mod hair;
mod head;
mod materials;
mod outside;
mod room;
mod sdf;
mod seats;
mod situation;
mod torso;

pub use situation::Situation;

use std::f32::consts::TAU;

use glam::{Mat3, Vec3};

use super::Scene;
use super::light::{Ambient, Light};
use super::part::Part;
use super::ray::Pose;

/// Depth of the eyes, in metres.
const FOCUS_M: f32 = 1.2;
/// The middle of the head at rest; the face is 7 cm nearer.
const HEAD: Vec3 = Vec3::new(0.035, 0.045, FOCUS_M + 0.072);
/// Pivot of the head on the neck, in its own frame.
const NAPE: Vec3 = Vec3::new(0.0, -0.15, 0.04);
/// Pivot of the swaying body, in its own frame.
const HIP: Vec3 = Vec3::new(0.0, -0.75, 0.06);

/// Returns a person with objects in front.
pub fn create_portrait() -> Scene {
    let mut scene = create_scene(Some(Situation::Sits), Situation::Sits);
    scene.parts.extend([front::create_desk(), front::create_twig()].map(Part::with_bvh));
    scene
}

/// Returns a person in a situation, or the empty room of a situation.
pub fn create_scene(person: Option<Situation>, room: Situation) -> Scene {
    let own = person
        .map(|person| [vec![head::create_part(nod_pose), torso::create_part(sway_pose)], person.worn_parts()].concat());
    let own: Vec<Part> = own.unwrap_or_default().into_iter().map(|part| Part { is_subject: true, ..part }).collect();
    let others = person.map(Situation::other_people).unwrap_or_default();
    let fixed = [room.furniture(), vec![room::create_part(), outside::create_part()]].concat();
    Scene {
        parts: [own, others, fixed].concat().into_iter().map(Part::with_bvh).collect(),
        lights: [room_lights(), person.map(Situation::lights).unwrap_or_default()].concat(),
        ambient: Ambient { above: Vec3::new(0.155, 0.165, 0.20), below: Vec3::new(0.105, 0.080, 0.066) },
        background: Vec3::ZERO,
        focus_m: FOCUS_M,
        period_s: 2.0,
    }
}

fn room_lights() -> Vec<Light> {
    let lamp = |position: [f32; 3], power: [f32; 3], softness, self_shadow_range_m| Light {
        position: position.into(),
        power: power.into(),
        softness,
        self_shadow_range_m,
    };
    vec![
        // Key light, high on the left in front: a large warm lamp.
        lamp([-0.75, 0.75, 0.25], [1.55, 1.34, 1.10], 0.22, 1.9),
        // Fill light, from a screen low on the right.
        lamp([0.55, -0.05, 0.15], [0.16, 0.18, 0.22], 0.5, 0.0),
        // Rim lights: the room's lamp on the right, dusk on the left.
        lamp([0.95, 0.75, 2.05], [1.5, 0.95, 0.50], 0.15, 0.0),
        lamp([-1.05, 0.60, 2.3], [0.75, 0.95, 1.45], 0.15, 0.0),
        // The lamp on the sideboard, and a ceiling light outside the picture.
        lamp([1.42, 0.02, 3.72], [0.42, 0.25, 0.11], 0.25, 1.3),
        lamp([0.3, 1.25, 2.9], [0.95, 0.76, 0.54], 0.25, 2.1),
    ]
}

/// Returns the pose of the body, which sways once per loop.
fn sway_pose(phase: f32) -> Pose {
    let turn =
        Mat3::from_rotation_z(0.012 * (TAU * phase).sin()) * Mat3::from_rotation_y(0.06 + 0.02 * (TAU * phase).cos());
    Pose { rotation: Mat3::IDENTITY, translation: HEAD }.compose(Pose::rotation_about(HIP, turn))
}

/// Returns the pose of the head, which turns and tilts on the swaying body.
fn nod_pose(phase: f32) -> Pose {
    let yaw = 0.11 + 0.10 * (TAU * phase + 0.6).sin();
    let pitch = 0.02 + 0.018 * (2.0 * TAU * phase).sin();
    let roll = -0.035 + 0.022 * (TAU * phase - 0.5).sin();
    let turn = Mat3::from_rotation_z(roll) * Mat3::from_rotation_y(yaw) * Mat3::from_rotation_x(pitch);
    // The head sits a little lower than it was modelled.
    let seat = Pose { rotation: Mat3::IDENTITY, translation: Vec3::new(0.0, -0.014, 0.0) };
    sway_pose(phase).compose(Pose::rotation_about(NAPE, turn)).compose(seat)
}
