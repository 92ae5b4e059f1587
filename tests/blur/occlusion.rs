//! The appearance of near objects, and of the background through their rims, at every quality level.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::Settings;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::budget::Quality;
use bokehcam::color::srgb_to_linear;
use bokehcam::frame::{ColorImage, DepthMap, MixedPixel};
use bokehcam::optics::{CocField, CocKind, DepthCoc};
use common::{color, depth, settings};

const SIZE: (u32, u32) = (320, 200);
/// Focus is on the farthest depth.
const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 5.0, focus_m: 10.0, range_m: 0.0, max_coc_px: 30.0 };

fn blur(quality: Quality, color: &ColorImage, map: &DepthMap) -> ColorImage {
    let settings = Settings { quality, far_max_px: 5.0, near_max_px: 30.0, ..settings(CocKind::Depth) };
    let mut out = ColorImage::default();
    CpuBokeh::new(Plan::new(&settings, SIZE.0, SIZE.1), Some(2))
        .blur(color, Some(map), &CocField::Depth(LENS), &mut out)
        .expect("a blur of fitting input");
    out
}

/// Returns the CoC at a depth, in pixels.
fn coc_px(metres: f32) -> f32 {
    LENS.coc_px(metres)
}

fn light(image: &ColorImage, x: u32, y: u32) -> [f32; 3] {
    let at = 3 * (y * image.width + x) as usize;
    [0, 1, 2].map(|p| srgb_to_linear(f32::from(image.rgb[at + p]) / 255.0))
}

#[test]
fn the_edge_of_a_near_thing_is_soft_inside_and_outside_at_every_quality() {
    // A uniform white object on uniform black: along a row, light rises over the diameter of the CoC, without a step.
    let near_m = 2.2;
    let radius_px = -coc_px(near_m);
    let inside = |x: u32| (110..210).contains(&x);
    let image = color(SIZE.0, SIZE.1, |x, _| if inside(x) { [230; 3] } else { [10; 3] });
    let map = depth(SIZE.0, SIZE.1, |x, _| if inside(x) { near_m } else { 10.0 });
    for quality in Quality::ALL {
        let out = blur(quality, &image, &map);
        let row: Vec<f32> = (0..SIZE.0).map(|x| light(&out, x, 100)[1]).collect();
        let span = row[160] - row[20];
        // A half plane through a disc is steepest in its middle: 2 / (pi R) a pixel.
        let steepest = 2.0 / (std::f32::consts::PI * radius_px) * span;
        let worst = row.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        assert!(worst < 1.6 * steepest, "{quality}: a step of {worst}, at most {steepest} of light");
        // Coverage lost inside the outline equals coverage gained outside.
        let [out_there, in_here] = [110 - 6, 110 + 6].map(|x| (row[x] - row[20]) / span);
        assert!((out_there + in_here - 1.0).abs() < 0.12, "{quality}: {out_there} outside, {in_here} inside");
        assert!((0.1..0.4).contains(&out_there), "{quality}: {out_there} outside");
    }
}

#[test]
fn behind_a_near_thing_lies_what_is_just_behind_it() {
    // Red before a large green object before the blue background, which is in focus; a bright white object far from
    // both.
    let (near_m, middle_m) = (1.6, 4.0);
    assert!(coc_px(near_m) < 3.0 * coc_px(middle_m), "they are in different bins");
    let is_near = |x: u32, y: u32| (120..200).contains(&x) && (70..140).contains(&y);
    let is_middle = |x: u32, y: u32| (50..270).contains(&x) && (20..190).contains(&y);
    let image = color(SIZE.0, SIZE.1, |x, y| match () {
        () if is_near(x, y) => [220, 0, 0],
        () if is_middle(x, y) => [0, 150, 0],
        () if x >= 300 && y < 20 => [255; 3],
        () => [0, 0, 230],
    });
    let map = depth(SIZE.0, SIZE.1, |x, y| match () {
        () if is_near(x, y) => near_m,
        () if is_middle(x, y) => middle_m,
        () => 10.0,
    });
    for quality in Quality::ALL {
        let out = blur(quality, &image, &map);
        for (x, y) in (70..250).flat_map(|x| (40..170).map(move |y| (x, y))) {
            let [red, green, blue] = light(&out, x, y);
            assert!(blue < 0.01, "{quality}: the background is seen through the near thing at {x}, {y}: {blue}");
            // The scene here has only red and green, and their coverages add up to one.
            let whole = red / srgb_to_linear(220.0 / 255.0) + green / srgb_to_linear(150.0 / 255.0);
            assert!((whole - 1.0).abs() < 0.06, "{quality}: {whole} at {x}, {y}");
        }
    }
}

/// A subject in focus before a wall that is known behind it (from a background plate or the background memory), and a
/// blurred object before the subject: the object's rim shows the subject.
#[test]
fn a_near_thing_before_the_subject_shows_the_subject_and_not_the_wall_behind_it() {
    let near_m = 2.2;
    let is_near = |x: u32, y: u32| (140..180).contains(&x) && (80..120).contains(&y);
    let image = color(SIZE.0, SIZE.1, |x, y| if is_near(x, y) { [60; 3] } else { [200, 90, 60] });
    let mut map = depth(SIZE.0, SIZE.1, |x, y| if is_near(x, y) { near_m } else { 10.0 });
    let alone = blur(Quality::Balanced, &image, &map);
    let subject = light(&image, 0, 0);
    let wall = [0.02, 0.7, 0.9];
    let known = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))).filter(|&(x, y)| {
        // All around the near object, but within the capacity of a frame's matte.
        !is_near(x, y) && (110..210).contains(&x) && (60..140).contains(&y)
    });
    map.matte.pixels = known
        .map(|(x, y)| MixedPixel {
            at: y * SIZE.0 + x,
            near_m: 10.0,
            far_m: 1e6,
            alpha: 1.0,
            background_alpha: 1.0,
            difference: [0, 1, 2].map(|p| subject[p] - wall[p]),
        })
        .collect();
    let with_wall = blur(Quality::Balanced, &image, &map);
    for y in 64..136 {
        for x in 114..206 {
            let [a, b] = [&alone, &with_wall].map(|out| light(out, x, y));
            let off = (0..3).map(|p| (a[p] - b[p]).abs()).fold(0.0, f32::max);
            assert!(off < 0.03, "({x}, {y}): {a:?} without a wall, {b:?} with one");
        }
    }
}

/// A blurred thing whose weight is shared between the bin of its radius and that of the wall: what it is known to hide
/// shows at its rim, and nowhere else.
#[test]
fn a_wall_known_behind_a_blurred_thing_shows_no_farther_than_the_rim() {
    let lens = DepthCoc { coc_at_infinity_px: 12.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 12.0 };
    let metres = |radius_px: f32| 1.0 / (1.0 - radius_px / 12.0);
    let (wall_px, edge) = (9.5, 160);
    let settings = Settings { far_max_px: 12.0, near_max_px: 12.0, ..settings(CocKind::Depth) };
    let image = color(SIZE.0, SIZE.1, |x, _| if x < edge { [230; 3] } else { [10; 3] });
    let [thing, wall] = [230.0, 10.0].map(|code: f32| srgb_to_linear(code / 255.0));
    for radius_px in (0..12).map(|step| 6.4 + 0.2 * step as f32) {
        let mut map = depth(SIZE.0, SIZE.1, |x, _| metres(if x < edge { radius_px } else { wall_px }));
        let hiding = (0..SIZE.1).flat_map(|y| (edge - 12..edge).map(move |x| y * SIZE.0 + x));
        map.matte.pixels = hiding
            .map(|at| MixedPixel {
                at,
                near_m: metres(radius_px),
                far_m: metres(wall_px),
                alpha: 1.0,
                background_alpha: 1.0,
                difference: [thing - wall; 3],
            })
            .collect();
        let mut out = ColorImage::default();
        CpuBokeh::new(Plan::new(&settings, SIZE.0, SIZE.1), Some(1))
            .blur(&image, Some(&map), &CocField::Depth(lens), &mut out)
            .expect("a blur of fitting input");
        let row = &out.rgb[(100 * SIZE.0 * 3) as usize..];
        // The aperture ends at its radius, and its rim is soft.
        for x in 100..edge - (1.2 * radius_px) as u32 - 3 {
            let code = row[3 * x as usize];
            assert!(code.abs_diff(230) <= 1, "{radius_px} px: {code} at {} px inside", edge - x);
        }
    }
}
