//! What is behind is steadied from frame to frame: noise is averaged, changes show at once.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocKind;
use common::{DOF, codes_apart, color, depth, settings};

const SIZE: (u32, u32) = (512, 256);

/// Two executors over the same frames: one steadies, one makes every frame on its own.
struct Both([CpuBokeh; 2]);

impl Both {
    fn new() -> Self {
        Self([true, false].map(|reuse| {
            CpuBokeh::new(Plan::new(&Settings { reuse, ..settings(CocKind::Depth) }, SIZE.0, SIZE.1), Some(2))
        }))
    }

    /// Returns the steadied result and the other.
    fn blur(&mut self, color: &ColorImage, map: &DepthMap) -> [ColorImage; 2] {
        self.0.each_mut().map(|executor| {
            let mut out = ColorImage::default();
            executor.blur(color, Some(map), &DOF, &mut out).expect("a fitting frame");
            out
        })
    }
}

/// A subject 100 columns wide from `subject_x` on before a patterned wall, both with `light` codes more, and noise.
fn scene(subject_x: u32, light: f32, noise: impl Fn(u32, u32) -> f32) -> (ColorImage, DepthMap) {
    let is_subject = |x: u32, y: u32| (subject_x..subject_x + 100).contains(&x) && y > 90;
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let wall = if (x / 40 + y / 30) % 2 == 0 { 70.0 } else { 150.0 + 0.1 * x as f32 };
        let value = if is_subject(x, y) { 110.0 + 60.0 * f32::from((x / 3 + y / 3) % 2 == 0) } else { wall };
        let code = |offset: f32| (value + light + offset + noise(x, y)).round().clamp(0.0, 255.0) as u8;
        [code(0.0), code(8.0), code(-15.0)]
    });
    (picture, depth(SIZE.0, SIZE.1, |x, y| if is_subject(x, y) { 1.0 } else { 3.5 }))
}

fn none(_: u32, _: u32) -> f32 {
    0.0
}

/// Noise of a frame that is alike in blocks of 16 x 16 pixels, as that of a compressed video is.
fn block_noise(frame: u32, amplitude: f32) -> impl Fn(u32, u32) -> f32 {
    move |x, y| {
        let mut hash = ((x / 16).wrapping_mul(0x9E37_79B1) ^ (y / 16).wrapping_mul(0x85EB_CA77))
            ^ frame.wrapping_mul(0xC2B2_AE3D).wrapping_mul(0x27D4_EB2F);
        hash = (hash ^ hash >> 15).wrapping_mul(0x2C1B_3C6D);
        hash ^= hash >> 13;
        amplitude * ((hash >> 8) as f32 / 8_388_608.0 - 1.0)
    }
}

/// Returns the mean difference of two pictures over the wall on the right, in codes.
fn wall_apart(a: &ColorImage, b: &ColorImage) -> f64 {
    let samples = |image: &ColorImage| {
        let rows: Vec<Vec<u8>> =
            image.rgb.chunks_exact(SIZE.0 as usize * 3).map(|row| row[400 * 3..].to_vec()).collect();
        rows.concat()
    };
    let (a, b) = (samples(a), samples(b));
    a.iter().zip(&b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

#[test]
fn noise_behind_is_averaged_over_time() {
    let mut both = Both::new();
    let mut before: Option<[ColorImage; 2]> = None;
    let mut flicker = [0.0; 2];
    for frame in 0..40 {
        let (picture, map) = scene(150, 0.0, block_noise(frame, 1.5));
        let made = both.blur(&picture, &map);
        if let Some(before) = before.filter(|_| frame > 20) {
            (0..2).for_each(|k| flicker[k] += wall_apart(&before[k], &made[k]));
        }
        before = Some(made);
    }
    assert!(flicker[1] > 2.0 && flicker[0] < 0.35 * flicker[1], "{flicker:?}");
}

#[test]
fn a_still_scene_is_the_same_steadied_or_not() {
    let mut both = Both::new();
    let (picture, map) = scene(150, 0.0, none);
    for _ in 0..5 {
        let [steady, fresh] = both.blur(&picture, &map);
        assert!(codes_apart(&steady, &fresh) <= 1);
    }
}

/// Nothing was there before the first frame, and that is no content to start from.
#[test]
fn the_first_frame_is_the_same_to_the_bit() {
    for light in [-60.0, 0.0, 90.0] {
        let (picture, map) = scene(150, light, none);
        let [steady, fresh] = Both::new().blur(&picture, &map);
        assert_eq!(codes_apart(&steady, &fresh), 0, "{light}");
    }
}

#[test]
fn what_changes_shows_at_once() {
    let mut both = Both::new();
    for frame in 0..12 {
        // The subject moves by 3 pixels a frame; in the end the light goes on.
        let light = if frame > 8 { 20.0 } else { 0.0 };
        let (picture, map) = scene(60 + 3 * frame, light, none);
        let [steady, fresh] = both.blur(&picture, &map);
        assert!(codes_apart(&steady, &fresh) <= 3, "frame {frame}: {}", codes_apart(&steady, &fresh));
    }
}

#[test]
fn a_slow_change_is_followed_within_a_few_codes() {
    let mut both = Both::new();
    for frame in 0..200 {
        let (picture, map) = scene(150, frame as f32 * 0.1, none);
        let [steady, fresh] = both.blur(&picture, &map);
        assert!(codes_apart(&steady, &fresh) <= 4, "frame {frame}: {}", codes_apart(&steady, &fresh));
    }
}

#[test]
fn what_is_in_focus_is_never_steadied() {
    let mut both = Both::new();
    for frame in 0..5 {
        let (picture, map) = scene(150, 0.0, block_noise(frame, 1.5));
        let [steady, _] = both.blur(&picture, &map);
        for y in 130..256 {
            let row = (y * SIZE.0 as usize + 170) * 3..(y * SIZE.0 as usize + 230) * 3;
            assert_eq!(steady.rgb[row.clone()], picture.rgb[row], "row {y}");
        }
    }
}
