//! Random settings, sizes and fields, from seeds.

use super::common::{Numbers, depth};
use bokehcam::bokeh::aperture::{Aperture, Picture, Shape};
use bokehcam::bokeh::{Method, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::frame::DepthMap;
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc, Ramp};

/// Default number of cases of each law.
const CASES: u64 = 40;

fn number(variable: &str, default: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")),
        Err(_) => default,
    }
}

/// Prints how to run a case again if it panics.
struct Again(u64);

impl Drop for Again {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("again: BOKEHCAM_TEST_SEED={} BOKEHCAM_TEST_CASES=1", self.0);
        }
    }
}

/// Runs the cases of a law.
pub fn each_case(law: impl Fn(&mut Random)) {
    let first = number("BOKEHCAM_TEST_SEED", 1);
    for seed in first..first + number("BOKEHCAM_TEST_CASES", CASES) {
        let again = Again(seed);
        law(&mut Random::new(seed));
        drop(again);
    }
}

pub struct Random(Numbers);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut numbers = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        (0..4).for_each(|_| _ = numbers.next());
        Self(numbers)
    }
    /// From 0 to below 1.
    pub fn share(&mut self) -> f32 {
        self.0.next()
    }
    pub fn below(&mut self, count: usize) -> usize {
        (self.share() * count as f32) as usize
    }
    pub fn of<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())].clone()
    }
    pub fn code(&mut self) -> u8 {
        self.below(256) as u8
    }

    pub fn size(&mut self) -> (u32, u32) {
        let (width, height) = match self.below(6) {
            0 => (self.below(8), self.below(8)),
            1 => (self.below(900), self.below(3)),
            2 => (self.below(3), self.below(500)),
            _ => (self.below(160), self.below(120)),
        };
        (width as u32 + 1, height as u32 + 1)
    }

    /// The aperture of a lens: its blades, or a disc.
    pub fn blades(&mut self) -> Shape {
        match self.below(2) {
            0 => Shape::Disc,
            _ => Shape::Polygon {
                blades: 3 + self.below(14) as u32,
                rotation_deg: 360.0 * self.share(),
                curvature: self.share(),
            },
        }
    }

    /// Any aperture; `even` ones look the same turned by 180 degrees.
    pub fn shape(&mut self, even: bool) -> Shape {
        let corners = if even { 4 + 2 * self.below(7) as u32 } else { 3 + self.below(14) as u32 };
        match self.below(if even { 4 } else { 6 }) {
            0 => Shape::Disc,
            1 => Shape::Ring { inner: self.share() * 0.99 },
            2 => {
                Shape::Polygon { blades: corners, rotation_deg: 720.0 * self.share() - 360.0, curvature: self.share() }
            }
            3 => Shape::Star { points: corners },
            4 => Shape::Heart,
            _ => {
                let (width, height) = (1 + self.below(12) as u32, 1 + self.below(12) as u32);
                let grey = (0..width * height).map(|_| self.share()).collect();
                Shape::Picture(std::sync::Arc::new(Picture { file: None, width, height, grey }))
            }
        }
    }

    fn intensity(&mut self) -> f32 {
        let intensity = 2.0 * self.share() - 1.0;
        if intensity.abs() < 0.5 { 0.0 } else { intensity }
    }

    pub fn settings(&mut self, coc: CocKind) -> Settings {
        let near_max_px = if coc == CocKind::Depth { self.radius_px() } else { 0.0 };
        let far_max_px = if coc == CocKind::Depth && self.below(2) == 0 { near_max_px } else { self.radius_px() };
        Settings {
            coc,
            method: if self.below(6) == 0 { Method::Gather } else { Method::Layered },
            aperture: Aperture { shape: self.shape(false), intensity: self.intensity() },
            rim: self.share(),
            rank: match self.below(4) {
                0 => Some(Rank::Terms(1 + self.below(16) as u32)),
                1 if far_max_px.max(near_max_px) < 15.0 => Some(Rank::Full),
                _ => None,
            },
            highlights: if self.below(2) == 0 { 0.0 } else { self.of(&[1.0, 8.0, 100.0]) * self.share() },
            quality: self.of(&Quality::ALL),
            adaptive: self.below(2) == 0,
            reuse: false,
            privacy: false,
            far_max_px,
            near_max_px,
        }
    }

    pub fn radius_px(&mut self) -> f32 {
        match self.below(6) {
            0 => 0.0,
            1 => 1e-6,
            2 => 100.0 * self.share(),
            _ => 20.0 * self.share(),
        }
    }

    /// Returns a field of an effect, within the limits of the settings, and a depth map for it.
    pub fn field(&mut self, settings: &Settings, (width, height): (u32, u32)) -> (CocField, DepthMap) {
        let (far_px, base_m) = (settings.far_max_px, 0.3 + 3.0 * self.share());
        let map = self.depth(base_m, (width, height));
        let field = match settings.coc {
            CocKind::Uniform => CocField::Uniform { radius_px: far_px * self.share() },
            CocKind::Ramp => CocField::Ramp(Ramp {
                normal: glam::Vec2::from_angle(7.0 * self.share()),
                offset_px: 200.0 * self.share() - 50.0,
                half_band_px: 40.0 * self.share(),
                slope: self.share(),
                max_px: far_px,
            }),
            CocKind::Depth => CocField::Depth(DepthCoc {
                // Any lens, where the largest radius is the same on both sides.
                coc_at_infinity_px: if far_px >= settings.near_max_px { self.of(&[far_px, 1e30]) } else { far_px },
                focus_m: self.of(&[base_m, 1e-3, 1e6, 1.0]),
                range_m: self.of(&[0.0, 0.5, 1e9]),
                max_coc_px: settings.near_max_px,
            }),
        };
        (field, map)
    }

    pub fn depth(&mut self, base_m: f32, (width, height): (u32, u32)) -> DepthMap {
        let (width, height) = (1 + self.below(width as usize) as u32, 1 + self.below(height as usize) as u32);
        let (kind, step) = (self.below(5), 1 + self.below(30) as u32);
        let odd = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e-45, 3e38, f32::NEG_INFINITY, 1e-20];
        depth(width, height, |x, y| match kind {
            0 => base_m,
            1 => base_m + self.share(),
            2 if self.below(2) == 0 => self.of(&odd),
            2 => 0.2 + 5.0 * self.share(),
            3 => self.of(&[0.5, 1.0, 4.0, 0.0]),
            // Surfaces with edges between them.
            _ => base_m * [1.0, 0.6, 2.0, 1e3, 0.0][((x / step * 7 + y / step * 3) % 5) as usize],
        })
    }
}
