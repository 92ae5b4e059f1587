//! The laws of the blur on random settings, sizes and fields, on both executors.
//!
//! `BOKEHCAM_TEST_CASES=5000` runs that number of cases of each law, `BOKEHCAM_TEST_SEED=7` begins with that seed; the
//! message of a failed test says how to run that one case again.
#![allow(missing_docs)]

mod cases;
use crate::common;
mod slopes;

use bokehcam::bokeh::aperture::Aperture;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Method, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::color::srgb_to_linear;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc};
use cases::each_case;
use common::{COC_KINDS, codes_apart, color, depth};
use slopes::{SIZE as SLOPE, Slope};

/// An executor that blurs a sequence of frames.
trait Blurs {
    fn blur(&mut self, quality: Quality, image: &ColorImage, map: &DepthMap, field: &CocField) -> ColorImage;
}

impl Blurs for CpuBokeh {
    fn blur(&mut self, quality: Quality, image: &ColorImage, map: &DepthMap, field: &CocField) -> ColorImage {
        let mut out = ColorImage::default();
        self.set_quality(quality);
        CpuBokeh::blur(self, image, Some(map), field, &mut out).expect("a blur of fitting input");
        out
    }
}

fn cpu(settings: &Settings, (width, height): (u32, u32), threads: usize) -> Box<dyn Blurs> {
    Box::new(CpuBokeh::new(Plan::new(settings, width, height), Some(threads)))
}

type Make<'a> = &'a dyn Fn(&Settings, (u32, u32)) -> Box<dyn Blurs>;

fn a_constant_picture_stays_constant(make: Make) {
    each_case(|random| {
        let (effect, size) = (random.of(&COC_KINDS), random.size());
        let settings = random.settings(effect);
        let mut executor = make(&settings, size);
        for frame in 0..1 + random.below(3) {
            let constant = [random.code(), random.code(), random.code()];
            let (field, map) = random.field(&settings, size);
            let quality = random.of(&Quality::ALL);
            let out = executor.blur(quality, &color(size.0, size.1, |_, _| constant), &map, &field);
            let off = |pixel: &[u8]| pixel.iter().zip(constant).map(|(a, b)| a.abs_diff(b)).max();
            let worst = out.rgb.chunks_exact(3).map(off).max().flatten();
            assert!(
                worst <= Some(1),
                "frame {frame}: {constant:?} is off by {worst:?}: {size:?} {quality} {settings:?} {field:?}, \
                 depth of {:?}, such as {:?}",
                (map.width, map.height),
                &map.metres[..map.metres.len().min(8)]
            );
        }
    });
}

#[test]
fn a_constant_picture_stays_constant_on_the_cpu() {
    a_constant_picture_stays_constant(&|settings, size| cpu(settings, size, 2));
}

/// Grey pictures, because highlights are recovered by their luminance, not channel by channel.
fn nothing_is_darker_or_brighter_than_all_there_was(make: Make) {
    each_case(|random| {
        let (effect, size) = (random.of(&COC_KINDS), random.size());
        let settings = random.settings(effect);
        let mut executor = make(&settings, size);
        let (low, high) = (random.code() / 2, 128 + random.code() / 2);
        let lit = 0.5 * random.share() * random.share();
        let image = color(size.0, size.1, |_, _| [if random.share() < lit { high } else { low }; 3]);
        let (field, map) = random.field(&settings, size);
        let out = executor.blur(settings.quality, &image, &map, &field);
        let light = |code: u8| srgb_to_linear(f32::from(code) / 255.0);
        // Half a code value is lost in rounding.
        let range = 0.98 * light(low) - 0.5 / 255.0..=1.02 * light(high) + 0.5 / 255.0;
        let beyond = out.rgb.iter().find(|&&code| !range.contains(&light(code)));
        assert!(beyond.is_none(), "{beyond:?} of {low} to {high}: {size:?} {settings:?} {field:?}");
    });
}

#[test]
fn nothing_is_darker_or_brighter_than_all_there_was_on_the_cpu() {
    nothing_is_darker_or_brighter_than_all_there_was(&|settings, size| cpu(settings, size, 2));
}

fn a_blurred_point_does_not_shift(max_px: f64, make: Make) {
    const SIDE: u32 = 141;
    each_case(|random| {
        let kind = random.of(&[CocKind::Uniform, CocKind::Depth]);
        let far_max_px = 1.0 + 19.0 * random.share();
        let settings = Settings {
            aperture: Aperture { shape: random.shape(true), intensity: 2.0 * random.share() - 1.0 },
            highlights: 0.0,
            far_max_px,
            rank: random.of(&[None, Some(Rank::Terms(2)), Some(Rank::Terms(5))]),
            ..random.settings(kind)
        };
        let field = match kind {
            CocKind::Uniform => CocField::Uniform { radius_px: far_max_px },
            _ => CocField::Depth(DepthCoc {
                coc_at_infinity_px: far_max_px,
                focus_m: 1.0,
                range_m: 0.0,
                max_coc_px: 100.0,
            }),
        };
        let side = 5 + random.below(8) as u32;
        let (left, top) = (60 + random.below(8) as u32, 60 + random.below(8) as u32);
        let inside = |x: u32, y: u32| (left..left + side).contains(&x) && (top..top + side).contains(&y);
        let image = color(SIDE, SIDE, |x, y| [if inside(x, y) { 255 } else { 0 }; 3]);
        let out = make(&settings, (SIDE, SIDE)).blur(settings.quality, &image, &depth(1, 1, |_, _| 1e9), &field);
        let (mut sum, mut sum_x, mut sum_y) = (0.0, 0.0, 0.0);
        for (k, pixel) in out.rgb.chunks_exact(3).enumerate() {
            let light = f64::from(srgb_to_linear(f32::from(pixel[1]) / 255.0));
            sum += light;
            sum_x += light * f64::from(k as u32 % SIDE);
            sum_y += light * f64::from(k as u32 / SIDE);
        }
        let middle = f64::from(side - 1) / 2.0;
        let off = [sum_x / sum - f64::from(left) - middle, sum_y / sum - f64::from(top) - middle];
        assert!(off.iter().all(|px| px.abs() < max_px), "off by {off:?} px: square of {side} {settings:?} {field:?}");
    });
}

#[test]
fn a_blurred_point_does_not_shift_on_the_cpu() {
    a_blurred_point_does_not_shift(0.05, &|settings, size| cpu(settings, size, 2));
}

/// Returns an executor with privacy.
fn private(settings: &Settings, size: (u32, u32)) -> Box<dyn Blurs> {
    cpu(&Settings { privacy: true, ..settings.clone() }, size, 2)
}

#[test]
fn a_private_blur_of_a_constant_picture_is_constant() {
    a_constant_picture_stays_constant(&private);
}

#[test]
fn a_private_blur_is_no_darker_or_brighter_than_all_there_was() {
    nothing_is_darker_or_brighter_than_all_there_was(&private);
}

#[test]
fn a_private_blur_of_a_point_shifts_by_less_than_a_tenth_of_a_cell() {
    a_blurred_point_does_not_shift(0.8, &private);
}

#[test]
fn frames_before_and_the_number_of_threads_change_nothing() {
    each_case(|random| {
        let (effect, size) = (random.of(&COC_KINDS), random.size());
        let settings = random.settings(effect);
        let mut executor = cpu(&settings, size, 1 + random.below(4));
        for frame in 0..3 {
            let image = color(size.0, size.1, |_, _| [random.code(), random.code(), random.code()]);
            let (field, map) = random.field(&settings, size);
            let quality = random.of(&Quality::ALL);
            let out = executor.blur(quality, &image, &map, &field);
            let alone = cpu(&settings, size, 1).blur(quality, &image, &map, &field);
            assert!(out == alone, "frame {frame}: {size:?} {quality} {settings:?} {field:?}");
        }
    });
}

#[test]
fn what_is_in_focus_stays_as_it_is() {
    each_case(|random| {
        let size = random.size();
        let settings = Settings { method: Method::Layered, ..random.settings(CocKind::Depth) };
        let lens = DepthCoc {
            coc_at_infinity_px: settings.far_max_px,
            focus_m: 0.1 + 5.0 * random.share(),
            range_m: random.share(),
            max_coc_px: settings.far_max_px.max(settings.near_max_px),
        };
        let map = depth(size.0, size.1, |_, _| lens.near_m() + (lens.far_m() - lens.near_m()) * random.share());
        let image = color(size.0, size.1, |_, _| [random.code(), random.code(), random.code()]);
        let out = cpu(&settings, size, 2).blur(settings.quality, &image, &map, &CocField::Depth(lens));
        let worst = codes_apart(&out, &image);
        assert!(worst <= 1, "{worst}: {size:?} {settings:?} {lens:?}");
    });
}

/// A surface is opaque: away from its edge, the wall behind it may be black or white. (Nearly all cases differ by no code.)
fn nothing_shines_through_a_slope(make: Make) {
    each_case(|random| {
        let slope = Slope::new(random);
        let max_px = slope.lens.max_coc_px;
        let settings = Settings {
            method: Method::Layered,
            // Only apertures without overshoot: that of a ring or a picture (few terms) is clamped to the surrounding
            // colours, which include the wall's.
            aperture: Aperture { shape: random.blades(), intensity: 2.0 * random.share() - 1.0 },
            rank: None,
            // `draft` has two bins behind the focal plane, where a slope would share one with the wall.
            quality: random.of(if slope.is_in_front { &Quality::ALL } else { &Quality::ALL[1..] }),
            far_max_px: max_px,
            near_max_px: max_px,
            ..random.settings(CocKind::Depth)
        };
        let mut executor = make(&settings, SLOPE);
        let field = CocField::Depth(slope.lens);
        let [black, white] =
            [0, 255].map(|wall| executor.blur(settings.quality, &slope.image(wall), &slope.map, &field));
        let (worst, at) = slope.differ(&black, &white);
        let coc_px = slope.lens.coc_px(slope.map.metres[at]);
        assert!(worst <= 3, "{worst} codes shine through at {at} (CoC {coc_px} px): {settings:?} {field:?}");
    });
}

#[test]
fn nothing_shines_through_a_slope_on_the_cpu() {
    nothing_shines_through_a_slope(&|settings, size| cpu(settings, size, 2));
}

#[cfg(feature = "gpu")]
mod on_the_gpu {
    use super::*;
    use bokehcam::bokeh::gpu::GpuBokeh;
    use bokehcam::bokeh::{Bokeh, Job};

    use bokehcam::link::pool::Pooled;
    use std::sync::Arc;

    impl Blurs for GpuBokeh {
        fn blur(&mut self, quality: Quality, image: &ColorImage, map: &DepthMap, field: &CocField) -> ColorImage {
            let job = Job::new(Pooled::detached(image.clone()), Some(Pooled::detached(map.clone())), *field);
            self.submit(Job { quality, ..job }).expect("the GPU takes a frame");
            let finished = self.collect(true).expect("the GPU blurs").expect("a frame comes back");
            finished.picture.memory().unwrap().clone()
        }
    }

    /// Executors on one device.
    fn gpu() -> impl Fn(&Settings, (u32, u32)) -> Box<dyn Blurs> {
        let device = crate::on_gpu::device();
        move |settings, (width, height)| {
            let plan = Plan::new(settings, width, height);
            Box::new(GpuBokeh::with_device(&plan, Arc::clone(&device)).expect("such a picture fits"))
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter (software will do)"]
    fn a_constant_picture_stays_constant_on_the_gpu() {
        a_constant_picture_stays_constant(&gpu());
    }

    #[test]
    #[ignore = "needs a Vulkan adapter (software will do)"]
    fn nothing_is_darker_or_brighter_than_all_there_was_on_the_gpu() {
        nothing_is_darker_or_brighter_than_all_there_was(&gpu());
    }

    #[test]
    #[ignore = "needs a Vulkan adapter (software will do)"]
    fn a_blurred_point_does_not_shift_on_the_gpu() {
        a_blurred_point_does_not_shift(0.05, &gpu());
    }

    #[test]
    #[ignore = "needs a Vulkan adapter (software will do)"]
    fn nothing_shines_through_a_slope_on_the_gpu() {
        nothing_shines_through_a_slope(&gpu());
    }
}
