use super::*;
use crate::state::sample;
use bokehcam::bokeh::Picture;
use bokehcam::bokeh::plan::Plan;
use bokehcam::budget::Quality;
use bokehcam::frame::DepthMap;
use bokehcam::link::pool::Pool;
use bokehcam::optics::{CocField, DepthCoc, Ramp};
use bokehcam::pipeline::Trace;

const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 16.0, focus_m: 2.0, range_m: 0.0, max_coc_px: 43.0 };

/// Creates a view of `size` pixels with a depth map of `map` pixels whose depth grows from left to right.
fn view(size: (u32, u32), map: (u32, u32), coc: CocField) -> View {
    let pictures = Pool::new(1, || ColorImage::new(size.0, size.1));
    let maps = Pool::new(1, || {
        let mut depth = DepthMap::new(map.0, map.1);
        for (k, metres) in depth.metres.iter_mut().enumerate() {
            *metres = 0.5 + 9.5 * (k as u32 % map.0) as f32 / map.0 as f32;
        }
        depth
    });
    View {
        depth: Some(maps.take()),
        trace: Trace { quality: Some(Quality::Balanced), ..Trace::default() },
        ..View::new(Picture::from_memory(pictures.take()), coc)
    }
}

fn settings(size: (u32, u32)) -> Settings {
    sample::look().blur_settings(size, true).unwrap()
}

fn pixel(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
    image.rgb.as_chunks::<3>().0[(y * image.width + x) as usize]
}

fn lightness([r, g, b]: [u8; 3]) -> f32 {
    0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)
}

#[test]
fn the_colours_of_depth_grow_lighter_evenly() {
    let steps: Vec<f32> = viridis().iter().map(|&color| lightness(color)).collect();
    assert!(steps.windows(2).all(|pair| pair[1] > pair[0] - 0.6), "{steps:?}");
    let (first, last) = (steps[0], steps[255]);
    for (k, &step) in steps.iter().enumerate() {
        let even = first + (last - first) * k as f32 / 255.0;
        assert!((step - even).abs() < 0.12 * (last - first), "at {k}: {step}, not {even}");
    }
}

#[test]
fn near_is_light_and_the_legend_says_how_near() {
    let mut views = Views::default();
    let view = view((64, 8), (32, 4), CocField::Depth(LENS));
    let image = views.draw(ViewMode::Depth, &view, None).unwrap();
    assert_eq!(image.size(), (64, 8));
    let row: Vec<f32> = (0..64).map(|x| lightness(pixel(image, x, 3))).collect();
    assert!(row.windows(2).all(|pair| pair[1] <= pair[0] + 0.6), "{row:?}");
    let Some(Legend::Depth { near_m, far_m }) = views.legend() else { panic!("{:?}", views.legend()) };
    assert!((near_m - 0.5).abs() < 0.02 && (8.0..12.0).contains(&far_m), "{near_m} to {far_m}");
    let fraction = |depth_m| depth_fraction(depth_m, near_m, far_m);
    assert!((fraction(near_m) - 1.0).abs() < 1e-6 && fraction(far_m).abs() < 1e-6);
}

#[test]
fn unknown_depth_is_grey() {
    let mut views = Views::default();
    let mut view = view((16, 16), (16, 16), CocField::Depth(LENS));
    for metres in [0.0, f32::NAN, f32::INFINITY, -1.0] {
        view.depth.as_mut().unwrap().metres.fill(metres);
        let image = views.draw(ViewMode::Depth, &view, None).unwrap();
        assert!(image.rgb.as_chunks::<3>().0.iter().all(|[r, g, b]| r == g && g == b), "{metres}");
    }
}

#[test]
fn sharp_is_white_and_front_and_back_are_told_apart_without_colour() {
    let mut views = Views::default();
    let view = view((640, 360), (640, 360), CocField::Depth(LENS));
    let settings = settings((640, 360));
    let image = views.draw(ViewMode::Coc, &view, Some(&settings)).unwrap();
    let column = |metres: f32| ((metres - 0.5) / 9.5 * 640.0) as u32;
    let sharp = pixel(image, column(2.0), 100);
    assert!(lightness(sharp) > 235.0, "{sharp:?}");
    // In front, lightness varies along a column because of the hatching. Behind, it does not.
    let changes = |metres: f32| {
        let greys: Vec<_> = (0..360).map(|y| lightness(pixel(image, column(metres), y))).collect();
        greys.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 20.0).count()
    };
    assert!(changes(0.8) > 40 && changes(6.0) == 0, "{} and {}", changes(0.8), changes(6.0));
    assert!(lightness(pixel(image, column(9.9), 100)) < lightness(pixel(image, column(3.0), 100)));
    assert!(matches!(views.legend(), Some(Legend::Coc { max_px }) if max_px == settings.near_max_px));
}

#[test]
fn each_pixel_has_the_colour_of_its_bin() {
    let size = (640, 360);
    let (mut views, view, settings) = (Views::default(), view(size, size, CocField::Depth(LENS)), settings(size));
    let image = views.draw(ViewMode::Bins, &view, Some(&settings)).unwrap().clone();
    let mut plan = Plan::new(&settings, size.0, size.1);
    plan.set_quality(Quality::Balanced);
    plan.split_by_depth(view.depth.as_deref(), &view.coc);
    assert!(plan.bins.len() > 2);
    for x in 0..size.0 {
        let coc_px = LENS.coc_px(view.depth.as_ref().unwrap().metres[x as usize]);
        let bin = plan.bins.iter().position(|bin| coc_px < bin.high_px).unwrap();
        assert_eq!(pixel(&image, x, 9), BIN_COLORS[bin], "{coc_px} px");
    }
    let Some(Legend::Bins { count, high_px }) = views.legend() else { panic!() };
    assert_eq!(count, plan.bins.len());
    assert!(plan.bins.iter().zip(high_px).all(|(bin, high_px)| bin.high_px == high_px));
}

#[test]
fn neighbouring_bins_differ_in_lightness_too() {
    for pair in BIN_COLORS.windows(2) {
        assert!((lightness(pair[0]) - lightness(pair[1])).abs() > 20.0, "{pair:?}");
    }
}

#[test]
fn every_field_can_be_shown_at_any_size() {
    let ramp = Ramp { normal: glam::Vec2::Y, offset_px: 3.0, half_band_px: 1.0, slope: 0.5, max_px: 9.0 };
    let mut views = Views::default();
    for size in [(1, 1), (17, 13), (640, 360)] {
        for map in [(1, 1), (8, 30), (640, 360)] {
            for coc in [CocField::Uniform { radius_px: 4.0 }, CocField::Ramp(ramp), CocField::Depth(LENS)] {
                let view = view(size, map, coc);
                for shown in [ViewMode::Depth, ViewMode::Coc, ViewMode::Bins] {
                    let image = views.draw(shown, &view, Some(&settings(size))).unwrap();
                    assert_eq!((image.size(), image.rgb.len()), (size, (size.0 * size.1 * 3) as usize));
                }
            }
        }
    }
}

#[test]
fn the_picture_keeps_its_memory() {
    let size = (640, 360);
    let (mut views, view, settings) = (Views::default(), view(size, (320, 180), CocField::Depth(LENS)), settings(size));
    let place = |views: &mut Views, shown: ViewMode| views.draw(shown, &view, Some(&settings)).unwrap().rgb.as_ptr();
    let first = place(&mut views, ViewMode::Depth);
    for shown in [ViewMode::Coc, ViewMode::Bins, ViewMode::Depth] {
        assert_eq!(place(&mut views, shown), first);
    }
}

#[test]
fn what_cannot_be_shown_is_not() {
    let mut views = Views::default();
    let mut view = view((16, 16), (16, 16), CocField::Depth(LENS));
    assert!(views.draw(ViewMode::Picture, &view, None).is_none());
    assert!(views.draw(ViewMode::Bins, &view, None).is_none(), "nothing is blurred");
    view.depth = None;
    let settings = settings((16, 16));
    for shown in [ViewMode::Depth, ViewMode::Coc, ViewMode::Bins] {
        assert!(views.draw(shown, &view, Some(&settings)).is_none() && views.legend().is_none());
    }
}

#[test]
fn a_probe_is_the_value_of_its_pixel_whatever_the_size_of_the_map() {
    for map in [(40, 30), (20, 15)] {
        let mut view = view((40, 30), map, CocField::Depth(LENS));
        for x in [0.0, 0.3, 0.62, 1.0] {
            let column = ((x * 40.0) as u32).min(39) * map.0 / 40;
            let expected_m = 0.5 + 9.5 * column as f32 / map.0 as f32;
            let probe = Probe::read(&view, [x, 0.5]);
            assert!((probe.depth_m.unwrap() - expected_m).abs() < 1e-5, "{probe:?} at {x}");
            assert!((probe.coc_px - LENS.coc_px(expected_m)).abs() < 1e-5);
            assert_eq!(probe.coc_px < 0.0, expected_m < LENS.focus_m, "negative in front");
        }
        view.depth = None;
        assert_eq!(Probe::read(&view, [0.5; 2]).depth_m, None);
    }
    let even = view((8, 8), (8, 8), CocField::Uniform { radius_px: 3.0 });
    assert_eq!(Probe::read(&even, [0.9; 2]).coc_px, 3.0);
    let ramp = Ramp { normal: glam::vec2(0.0, 1.0), offset_px: 4.0, half_band_px: 1.0, slope: 0.5, max_px: 9.0 };
    let view = view((8, 8), (8, 8), CocField::Ramp(ramp));
    assert_eq!(Probe::read(&view, [0.1, 0.95]).coc_px, ramp.coc_px(0.5, 7.5));
}
