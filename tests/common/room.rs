//! Pictures of a room without and with a person, under changes of light and camera position.
#![allow(dead_code, missing_docs)]

use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::frame::ColorImage;

const SIZE: (u32, u32) = (640, 360);

/// Hashes three integers to a number from 0 to 1.
fn random(x: u32, y: u32, seed: u32) -> f32 {
    let mut bits = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    for _ in 0..3 {
        bits = (bits ^ bits >> 15).wrapping_mul(0x2c1b_3c6d);
    }
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

/// A synthetic camera picture of a room.
#[derive(Clone, Copy)]
pub struct Shown {
    /// Centre of the person's head: column and row, in pixels.
    pub person: Option<(f32, f32)>,
    /// Factor of the light, per channel.
    pub light: [f32; 3],
    /// Displacement of the camera, in pixels.
    pub nudge_px: (f32, f32),
    /// Light in the person's shadow, as a fraction; 1 disables the shadow.
    pub shadow: f32,
    /// Brightness of a warm lamp that lights the wall on the left, relative to the room.
    pub lamp: f32,
    /// Whether a vase is on the sideboard.
    pub vase: bool,
    /// Seed of the noise.
    pub frame: u32,
}

pub const ROOM: Shown =
    Shown { person: None, light: [1.0; 3], nudge_px: (0.0, 0.0), shadow: 1.0, lamp: 0.0, vase: false, frame: 0 };

pub const PERSON: Shown = Shown { person: Some((300.0, 150.0)), ..ROOM };

impl Shown {
    /// Returns the room's colour codes at a point: a wall with a pattern, a shelf, a bright window.
    fn room(x: f32, y: f32) -> [f32; 3] {
        let wave = (x * 0.045).sin() * (y * 0.06).cos() + 0.4 * (x * 0.21 + y * 0.13).sin();
        let wall = [120.0 + 22.0 * wave, 105.0 + 20.0 * wave, 90.0 + 15.0 * wave];
        match (x, y) {
            (x, y) if (430.0..560.0).contains(&x) && (40.0..150.0).contains(&y) => [225.0, 232.0, 240.0],
            (x, y) if y > 230.0 && y < 242.0 && x < 300.0 => [70.0, 45.0, 30.0],
            _ => wall,
        }
    }

    /// Whether the person, a head on shoulders, covers a point.
    fn covers((head_x, head_y): (f32, f32), x: f32, y: f32) -> bool {
        let head = ((x - head_x) / 48.0).hypot((y - head_y) / 62.0) < 1.0;
        head || ((x - head_x) / 120.0).powi(2) + ((y - head_y - 190.0) / 130.0).powi(2) < 1.0
    }

    /// Returns the picture, and for each pixel whether the person covers it.
    pub fn picture(&self) -> (ColorImage, Vec<bool>) {
        let mut picture = ColorImage::new(SIZE.0, SIZE.1);
        let mut covered = Vec::new();
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let (fx, fy) = (x as f32, y as f32);
                let is_person = self.person.is_some_and(|middle| Self::covers(middle, fx, fy));
                let vase = self.vase && (90.0..130.0).contains(&fx) && (170.0..230.0).contains(&fy);
                let mut codes = match () {
                    () if is_person && fy < self.person.unwrap().1 + 70.0 => [190.0, 140.0, 115.0],
                    () if is_person => [45.0, 60.0 + 10.0 * (fx * 0.3).sin(), 95.0],
                    () if vase => [60.0, 120.0, 70.0],
                    () => Self::room(fx - self.nudge_px.0, fy - self.nudge_px.1),
                };
                // A soft-edged shadow on the wall beside the person.
                let beside =
                    self.person.map_or(9.0, |(px, py)| ((fx - px - 110.0) / 90.0).hypot((fy - py - 60.0) / 120.0));
                let depth = ((1.6 - beside) / 1.2).clamp(0.0, 1.0);
                let shade = if is_person { 1.0 } else { 1.0 - (1.0 - self.shadow) * depth };
                let lit =
                    if is_person { 0.0 } else { self.lamp / (1.0 + ((fx - 90.0).hypot(fy - 60.0) / 110.0).powi(2)) };
                for ((code, light), warm) in codes.iter_mut().zip(self.light).zip([1.0, 0.8, 0.6]) {
                    let linear = srgb_to_linear(*code / 255.0) * (light * shade + warm * lit);
                    let noise = 5.0 * (random(x, y, self.frame * 3 + 1) + random(x, y, self.frame * 3 + 2) - 1.0);
                    *code = 255.0 * linear_to_srgb(linear.min(1.0)) + noise;
                }
                let at = 3 * (y * SIZE.0 + x) as usize;
                picture.rgb[at..at + 3].copy_from_slice(&codes.map(|code| code.round().clamp(0.0, 255.0) as u8));
                covered.push(is_person);
            }
        }
        (picture, covered)
    }
}
