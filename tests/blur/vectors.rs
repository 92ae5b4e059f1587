//! The widths of vectors.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::budget::Quality;
use bokehcam::depth::matting::{self, Matting};
use bokehcam::frame::ColorImage;
use bokehcam::optics::{CocField, CocKind};
use common::{coc, codes_apart, noise, settings, three_depths};
use pulp::Arch;

/// Processors differ in the width of their vectors, and in whether they round between a product and a sum.
#[test]
fn the_width_of_vectors_changes_nothing_but_the_rounding() {
    let (width, height) = (150, 110);
    let (image, mut map) = (noise(width, height), three_depths(width, height));
    let field = coc(CocKind::Depth, height);
    let CocField::Depth(lens) = field else { unreachable!("it is of a lens") };
    Matting::default().find_mixed_pixels(&mut map, &image, lens.inverse_depth_step(matting::MIN_STEP_PX));
    for (quality, privacy) in Quality::ALL.into_iter().flat_map(|quality| [(quality, false), (quality, true)]) {
        let settings = Settings { quality, privacy, far_max_px: 24.0, highlights: 8.0, ..settings(CocKind::Depth) };
        let [widest, none] = [Arch::new(), Arch::Scalar].map(|arch| {
            let mut out = ColorImage::default();
            let mut cpu = CpuBokeh::new(Plan::new(&settings, width, height), Some(2)).with_arch(arch);
            cpu.blur(&image, Some(&map), &field, &mut out).expect("a blur");
            out
        });
        let worst = codes_apart(&widest, &none);
        assert!(worst <= 2, "{quality}, privacy {privacy}: {worst} codes");
    }
}
