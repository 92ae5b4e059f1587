//! Mixed pixels are found where outlines are soft, and each of their two surfaces is blurred by its own CoC.
#![allow(missing_docs)]

use crate::common;

use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::budget::Quality;
use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::depth::matting::Matting;
use bokehcam::frame::{ColorImage, DepthMap, MixedPixel};
use bokehcam::optics::{CocField, CocKind, DepthCoc};
use common::{Numbers, coc, codes_apart, color, depth, noise, settings, three_depths};

const SIZE: (u32, u32) = (96, 80);
const NEAR_M: f32 = 1.0;
const FAR_M: f32 = 5.0;
/// Half a pixel of CoC under the lens of these tests, in 1/m.
const JUMP: f32 = 0.05;

type Light = [f32; 3];

fn light(codes: [u8; 3]) -> Light {
    codes.map(|code| srgb_to_linear(f32::from(code) / 255.0))
}

fn codes(light: Light) -> [u8; 3] {
    light.map(|light| (linear_to_srgb(light) * 255.0).round() as u8)
}

/// Returns the fraction of a pixel inside an outline.
fn coverage(x: u32, y: u32, inside: impl Fn(f32, f32) -> bool) -> f32 {
    const SAMPLES: u32 = 16;
    let at = |pixel: u32, k: u32| pixel as f32 + (k as f32 + 0.5) / SAMPLES as f32;
    let hits = (0..SAMPLES * SAMPLES).filter(|k| inside(at(x, k % SAMPLES), at(y, k / SAMPLES))).count();
    hits as f32 / (SAMPLES * SAMPLES) as f32
}

fn disc(x: f32, y: f32) -> bool {
    (x - 44.3).hypot(y - 38.6) < 21.7
}

/// Mixes both surfaces in every pixel by coverage; the depth is that of each pixel's centre.
fn scene(near: impl Fn(u32, u32) -> Light, far: impl Fn(u32, u32) -> Light) -> (ColorImage, DepthMap) {
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let (share, near, far) = (coverage(x, y, disc), near(x, y), far(x, y));
        codes(std::array::from_fn(|p| share * near[p] + (1.0 - share) * far[p]))
    });
    (picture, depth(SIZE.0, SIZE.1, |x, y| if disc(x as f32 + 0.5, y as f32 + 0.5) { NEAR_M } else { FAR_M }))
}

fn place(pixel: &MixedPixel) -> (u32, u32) {
    (pixel.at % SIZE.0, pixel.at / SIZE.0)
}

const RED: [u8; 3] = [210, 70, 50];
const BLUE: [u8; 3] = [30, 80, 150];

#[test]
fn shares_and_colours_of_a_soft_outline_are_found() {
    let (picture, mut map) = scene(|_, _| light(RED), |_, _| light(BLUE));
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    let mut found = vec![None; (SIZE.0 * SIZE.1) as usize];
    for pixel in &map.matte.pixels {
        assert_eq!((pixel.near_m, pixel.far_m), (NEAR_M, FAR_M));
        let own = light(std::array::from_fn(|p| picture.rgb[3 * pixel.at as usize + p]));
        for p in 0..3 {
            let near = own[p] + (1.0 - pixel.alpha) * pixel.difference[p];
            let far = own[p] - pixel.alpha * pixel.difference[p];
            assert!((pixel.alpha * near + (1.0 - pixel.alpha) * far - own[p]).abs() < 1e-5, "both add up to the pixel");
            // A small alpha determines the surface's colour poorly.
            let tolerance = 0.01 / pixel.alpha;
            assert!(
                (near - light(RED)[p]).abs() < 0.06 + tolerance
                    && (far - light(BLUE)[p]).abs() < 0.06 + 0.01 / (1.0 - pixel.alpha),
                "{pixel:?}: {own:?}, plane {p}, {near}, {far}"
            );
        }
        found[pixel.at as usize] = Some(pixel.alpha);
    }
    assert!(map.matte.pixels.is_sorted_by(|a, b| a.at < b.at));
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let (share, inside) = (coverage(x, y, disc), disc(x as f32 + 0.5, y as f32 + 0.5));
            let believed = found[(y * SIZE.0 + x) as usize].unwrap_or(f32::from(u8::from(inside)));
            assert!((believed - share).abs() < 0.06, "{x}, {y}: {believed} is {share}");
        }
    }
}

#[test]
fn a_hard_outline_of_textures_stays_hard() {
    let texture = noise(SIZE.0, SIZE.1);
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let grain = texture.rgb[3 * (y * SIZE.0 + x) as usize] / 4;
        let base = if disc(x as f32 + 0.5, y as f32 + 0.5) { RED } else { BLUE };
        base.map(|code| code.saturating_add(grain))
    });
    let mut map = depth(SIZE.0, SIZE.1, |x, y| if disc(x as f32 + 0.5, y as f32 + 0.5) { NEAR_M } else { FAR_M });
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    let shifted = |pixel: &&MixedPixel| {
        let (x, y) = place(pixel);
        (pixel.alpha - f32::from(u8::from(disc(x as f32 + 0.5, y as f32 + 0.5)))).abs() > 0.1
    };
    let count = map.matte.pixels.iter().filter(shifted).count();
    assert!(count <= 3, "{count} pixels of a hard outline are taken for mixed ones");
}

/// A hair covers a third of each of its pixels, and the depth map has one in five of them.
#[test]
fn hair_is_followed_where_the_depth_map_has_none_of_it() {
    let hair = |x: u32, y: u32| y == 20 && (60..84).contains(&x);
    let body = |x: u32| x < 60;
    let (near, far) = (light(RED), light(BLUE));
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let share = if body(x) { 1.0 } else { f32::from(u8::from(hair(x, y))) / 3.0 };
        // The outline is soft elsewhere: hard masks have no hair.
        let share = if x == 60 && y > 30 { 0.5 } else { share };
        codes(std::array::from_fn(|p| share * near[p] + (1.0 - share) * far[p]))
    });
    let seen = |x: u32, y: u32| body(x) || (hair(x, y) && x.is_multiple_of(5));
    let mut map = depth(SIZE.0, SIZE.1, |x, y| if seen(x, y) { NEAR_M } else { FAR_M });
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    let share_at =
        |x: u32, y: u32| map.matte.pixels.iter().find(|pixel| place(pixel) == (x, y)).map(|pixel| pixel.alpha);
    for x in 61..84 {
        let share = share_at(x, 20).unwrap_or(0.0);
        assert!((share - 1.0 / 3.0).abs() < 0.1, "at {x}: {share}");
    }
    let beside = map.matte.pixels.iter().filter(|pixel| place(pixel).0 > 61 && place(pixel).1 != 20);
    assert!(beside.clone().all(|pixel| pixel.alpha < 0.1), "the wall beside a hair is no hair");
}

/// A bar on the wall has the colour of a hair's pixels, and continues from the outline.
#[test]
fn what_is_wider_than_hair_and_far_is_none() {
    let bar = |x: u32, y: u32| (40..45).contains(&y) && (60..84).contains(&x);
    let (near, far) = (light(RED), light(BLUE));
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let share = match x {
            0..60 => 1.0,
            60 => 0.5,
            _ => f32::from(u8::from(bar(x, y))) / 3.0,
        };
        codes(std::array::from_fn(|p| share * near[p] + (1.0 - share) * far[p]))
    });
    let mut map = depth(SIZE.0, SIZE.1, |x, _| if x < 60 { NEAR_M } else { FAR_M });
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    let on_outline = map.matte.pixels.iter().filter(|pixel| place(pixel).0 == 60).count();
    assert_eq!(on_outline, SIZE.1 as usize);
    for pixel in map.matte.pixels.iter().filter(|pixel| place(pixel).0 > 61) {
        assert!(pixel.alpha < 0.1, "{pixel:?} at {:?}", place(pixel));
    }
}

#[test]
fn what_cannot_have_a_matte_has_none() {
    let picture = noise(SIZE.0, SIZE.1);
    let mut small = depth(SIZE.0 / 2, SIZE.1 / 2, |x, _| if x < 20 { NEAR_M } else { FAR_M });
    let mut flat = depth(SIZE.0, SIZE.1, |x, _| 1.0 + 0.001 * x as f32);
    let mut stepped = three_depths(SIZE.0, SIZE.1);
    for (map, jump) in [(&mut small, JUMP), (&mut flat, JUMP), (&mut stepped, f32::INFINITY)] {
        map.matte.pixels.push(MixedPixel {
            at: 3,
            near_m: 1.0,
            far_m: 2.0,
            alpha: 0.5,
            background_alpha: 0.5,
            difference: [0.1; 3],
        });
        Matting::default().find_mixed_pixels(map, &picture, jump);
        assert!(map.matte.pixels.is_empty());
    }
}

#[test]
fn of_more_edges_than_a_picture_has_those_of_the_largest_jumps_stay() {
    // Steps of 0.1 in 1/m between all columns, and one of more than 0.5.
    let inverse = |x: u32| if x < SIZE.0 / 2 { 1.0 } else { 0.2 } + 0.1 * (x % 2) as f32;
    let mut map = depth(SIZE.0, SIZE.1, |x, _| inverse(x).recip());
    let picture = color(SIZE.0, SIZE.1, |x, _| {
        if x < SIZE.0 / 2 {
            [200, 60, 40]
        } else if x > SIZE.0 / 2 {
            [30, 60, 90]
        } else {
            [110, 60, 66]
        }
    });
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    assert!(map.matte.pixels.len() >= SIZE.1 as usize, "{}", map.matte.pixels.len());
    for pixel in &map.matte.pixels {
        assert!(place(pixel).0.abs_diff(SIZE.0 / 2) < 3, "{pixel:?}");
    }
}

/// A mesh of wires before everything, whose edges are two pixels of three, and a person behind it.
#[test]
fn behind_a_wire_mesh_a_soft_outline_stays_soft() {
    let is_wire = |x: u32| x % 6 < 2;
    let (picture, mut map) =
        scene(|x, _| light(if is_wire(x) { BLUE } else { RED }), |x, _| light(if is_wire(x) { RED } else { BLUE }));
    let places = || (0..SIZE.0 * SIZE.1).map(|at| (at, at % SIZE.0, at / SIZE.0));
    places().filter(|(_, x, _)| is_wire(*x)).for_each(|(at, ..)| map.metres[at as usize] = 0.5 * NEAR_M);
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    for (at, x, y) in places().filter(|(_, x, _)| (3..5).contains(&(x % 6))) {
        let found = map.matte.pixels.iter().find(|pixel| pixel.at == at).map(|pixel| pixel.alpha);
        let believed = found.unwrap_or(f32::from(u8::from(disc(x as f32 + 0.5, y as f32 + 0.5))));
        assert!((believed - coverage(x, y, disc)).abs() < 0.1, "{x}, {y}: {believed}");
    }
}

/// A wall of stripes in two colours: a pixel of one of them is that wall, though not their mean.
#[test]
fn a_pixel_of_a_striped_wall_is_no_mixture() {
    let stripes = |x: u32, y: u32| light(if ((x + y) / 5).is_multiple_of(2) { [200, 170, 60] } else { [40, 34, 12] });
    let (picture, mut map) = scene(|_, _| light([60, 70, 190]), stripes);
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    for pixel in &map.matte.pixels {
        let ((x, y), alpha) = (place(pixel), pixel.alpha);
        let share = coverage(x, y, disc);
        assert!((alpha - share).abs() < 0.2 && (share > 0.0 || alpha < 0.1), "{x}, {y}: {alpha} is {share}");
    }
}

fn blur(map: &DepthMap, picture: &ColorImage, field: &CocField, quality: Quality) -> ColorImage {
    let settings = bokehcam::bokeh::Settings { quality, ..settings(CocKind::Depth) };
    let mut out = ColorImage::default();
    CpuBokeh::new(Plan::new(&settings, picture.width, picture.height), Some(1))
        .blur(picture, Some(map), field, &mut out)
        .expect("a blur");
    out
}

/// A subject in focus before a wall that changes from row to row: by the thin-lens model each pixel is the subject,
/// weighted by its coverage, over the blurred wall.
#[test]
fn the_blurred_background_shows_through_a_soft_outline() {
    let wall = |_: u32, y: u32| light(if (y / 4).is_multiple_of(2) { [240, 220, 160] } else { [10, 30, 70] });
    let straight = |x: u32| (44.0 - x as f32).clamp(0.0, 1.0) * 0.4 + if x < 43 { 0.6 } else { 0.0 };
    let share = |x: u32| straight(x).min(1.0);
    let near = light(RED);
    let picture = color(SIZE.0, SIZE.1, |x, y| {
        let far = wall(x, y);
        codes(std::array::from_fn(|p| share(x) * near[p] + (1.0 - share(x)) * far[p]))
    });
    let field = coc(CocKind::Depth, SIZE.1);
    let hard = depth(SIZE.0, SIZE.1, |x, _| if share(x) > 0.5 { NEAR_M } else { FAR_M });
    let mut map = hard.clone();
    Matting::default().find_mixed_pixels(&mut map, &picture, JUMP);
    let only_wall = color(SIZE.0, SIZE.1, |x, y| codes(wall(x, y)));
    for quality in Quality::ALL {
        let behind = blur(&depth(SIZE.0, SIZE.1, |_, _| FAR_M), &only_wall, &field, quality);
        let error = |out: &ColorImage| {
            let mut worst = 0;
            for y in 20..60u32 {
                for x in 42..46u32 {
                    let at = 3 * (y * SIZE.0 + x) as usize;
                    let far = light(std::array::from_fn(|p| behind.rgb[at + p]));
                    let truth = codes(std::array::from_fn(|p| share(x) * near[p] + (1.0 - share(x)) * far[p]));
                    for (p, truth) in truth.into_iter().enumerate() {
                        worst = worst.max(out.rgb[at + p].abs_diff(truth));
                    }
                }
            }
            worst
        };
        let (with, without) =
            (error(&blur(&map, &picture, &field, quality)), error(&blur(&hard, &picture, &field, quality)));
        assert!(with <= 4 && without >= 4 * with, "{quality}: {with} codes off, {without} without a matte");
    }
}

/// A light on the wall behind an in-focus subject: through a lens, its disc is still seen beside the subject.
#[test]
fn what_is_known_to_be_behind_a_subject_shows_beside_it() {
    let wall =
        |x: u32, y: u32| light(if (36..42).contains(&x) && (34..46).contains(&y) { [250, 240, 210] } else { BLUE });
    let is_near = |x: u32| x < 44;
    let picture = color(SIZE.0, SIZE.1, |x, y| if is_near(x) { RED } else { codes(wall(x, y)) });
    let field = coc(CocKind::Depth, SIZE.1);
    let unknown = depth(SIZE.0, SIZE.1, |x, _| if is_near(x) { NEAR_M } else { FAR_M });
    let mut map = unknown.clone();
    let known = |at: u32| {
        let (near, far) = (light(RED), wall(at % SIZE.0, at / SIZE.0));
        let difference = std::array::from_fn(|p| near[p] - far[p]);
        MixedPixel { at, near_m: NEAR_M, far_m: FAR_M, alpha: 1.0, background_alpha: 1.0, difference }
    };
    map.matte.pixels = (0..SIZE.0 * SIZE.1).filter(|at| (20..44).contains(&(at % SIZE.0))).map(known).collect();
    let only_wall = color(SIZE.0, SIZE.1, |x, y| codes(wall(x, y)));
    for quality in Quality::ALL {
        let behind = blur(&depth(SIZE.0, SIZE.1, |_, _| FAR_M), &only_wall, &field, quality);
        let error = |out: &ColorImage, columns: std::ops::Range<u32>, truth: &ColorImage| {
            let at = (30..50u32).flat_map(|y| columns.clone().map(move |x| 3 * (y * SIZE.0 + x) as usize));
            at.map(|at| out.rgb[at].abs_diff(truth.rgb[at])).max().unwrap()
        };
        let (with, without) = (blur(&map, &picture, &field, quality), blur(&unknown, &picture, &field, quality));
        assert!(error(&with, 0..43, &picture) <= 3, "{quality}: the subject stays as it is");
        let (known, filled) = (error(&with, 45..56, &behind), error(&without, 45..56, &behind));
        assert!(
            known <= 6 && filled >= 3 * known.max(1),
            "{quality}: {known} codes off, {filled} where it is not known"
        );
    }
}

/// However close the surface behind is: bins that hold both surfaces of a pixel show the nearer one.
#[test]
fn what_is_hidden_everywhere_is_never_seen() {
    let picture = color(SIZE.0, SIZE.1, |_, _| RED);
    let field = coc(CocKind::Depth, SIZE.1);
    let (own, far) = (light(RED), light([240, 250, 20]));
    let hiding = (0..SIZE.0 * SIZE.1).filter(|at| (40..60).contains(&(at % SIZE.0)));
    for near_m in [0.45, 0.8, 1.0, 1.2] {
        for factor in [1.03, 1.1, 1.3, 4.0] {
            let mut map = depth(SIZE.0, SIZE.1, |_, _| near_m);
            let difference = std::array::from_fn(|p| own[p] - far[p]);
            let pixel =
                |at| MixedPixel { at, near_m, far_m: factor * near_m, alpha: 1.0, background_alpha: 1.0, difference };
            map.matte.pixels = hiding.clone().map(pixel).collect();
            for quality in Quality::ALL {
                let out = blur(&map, &picture, &field, quality);
                let off = codes_apart(&out, &picture);
                assert!(off <= 2, "{quality}, {near_m} m before {} m: {off} codes", factor * near_m);
            }
        }
    }
}

#[test]
fn in_focus_a_mixed_pixel_is_the_pixel() {
    let picture = noise(SIZE.0, SIZE.1);
    let mut map = three_depths(SIZE.0, SIZE.1);
    let field = CocField::Depth(DepthCoc { coc_at_infinity_px: 0.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 18.0 });
    let before = blur(&map, &picture, &field, Quality::default());
    let mut numbers = Numbers(9);
    map.matte.pixels = (0..SIZE.0 * SIZE.1).step_by(7).map(|at| mixed(&picture, at, &mut numbers)).collect();
    let after = blur(&map, &picture, &field, Quality::default());
    assert!(codes_apart(&before, &after) <= 1);
}

/// Returns two random surfaces that add up to a pixel.
fn mixed(picture: &ColorImage, at: u32, numbers: &mut Numbers) -> MixedPixel {
    let share = 0.05 + 0.9 * numbers.next();
    let own = light(std::array::from_fn(|p| picture.rgb[3 * at as usize + p]));
    let difference = own.map(|own| (2.0 * numbers.next() - 1.0) * own.min(1.0 - own));
    MixedPixel { at, near_m: 0.8, far_m: 3.0, alpha: share, background_alpha: 1.0 - share, difference }
}
