//! Measured depth aligned to its picture: edges, noise, size, and temporal stability.

use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::refine::Refiner;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{CocAtInfinity, CocRule};

use crate::common::{color, depth as map};
use crate::portrait;

const WALL_M: f32 = 3.0;
const PERSON_M: f32 = 1.2;
const FRAME_NS: u64 = 33_000_000;
const SIZE: (u32, u32) = (120, 90);

/// Returns a picture of a textured dark person before a textured light wall.
fn picture(is_person: impl Fn(u32, u32) -> bool) -> ColorImage {
    color(SIZE.0, SIZE.1, |x, y| {
        let grain = ((x * 7 + y * 13) % 5) as u8 * 3;
        if is_person(x, y) { [50 + grain, 40, 30 + grain] } else { [180, 190 - grain, 200] }
    })
}

/// Returns a picture without any detail.
fn flat() -> ColorImage {
    ColorImage::new(SIZE.0, SIZE.1)
}

fn is_person(x: u32, y: u32) -> bool {
    (40..80).contains(&x) && y >= 30
}

/// Returns its depth, with all edges of the person `wider` pixels further out (or in, if negative).
fn depth(wider: i32) -> DepthMap {
    map(SIZE.0, SIZE.1, |x, y| {
        let (x, y) = (x as i32, y as i32);
        if (40 - wider..80 + wider).contains(&x) && y >= 30 - wider { PERSON_M } else { WALL_M }
    })
}

fn refined(mut map: DepthMap, color: &ColorImage) -> DepthMap {
    Refiner::new().refine(&mut map, color, 0);
    map
}

/// Counts the pixels that differ from the truth.
fn wrong(map: &DepthMap, truth: &DepthMap) -> usize {
    assert_eq!(map.size(), truth.size());
    let is_off =
        |pair: &(&f32, &f32)| (pair.0 / pair.1 - 1.0).abs().partial_cmp(&1e-3) != Some(std::cmp::Ordering::Less);
    map.metres.iter().zip(&truth.metres).filter(is_off).count()
}

/// Returns noise from -1 to 1 that depends on pixel and frame; its variance is 1/3.
fn noise(k: u32, frame: u32) -> f32 {
    let mut bits = k.wrapping_mul(0x9E37_79B9) ^ frame.wrapping_mul(0x85EB_CA6B);
    for _ in 0..2 {
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2C1B_3C6D);
        bits ^= bits >> 12;
    }
    bits as f32 / u32::MAX as f32 * 2.0 - 1.0
}

#[test]
fn constant_depth_stays() {
    let constant = map(SIZE.0, SIZE.1, |_, _| 2.0);
    let mut refiner = Refiner::new();
    for frame in 0..5 {
        let mut frame_map = constant.clone();
        refiner.refine(&mut frame_map, &picture(is_person), frame * FRAME_NS);
        assert!(frame_map.metres.iter().all(|z_m| (z_m - 2.0).abs() < 1e-5));
    }
}

#[test]
fn exact_edges_are_not_moved() {
    assert_eq!(wrong(&refined(depth(0), &picture(is_person)), &depth(0)), 0);
    // Nor where the colours carry no information.
    assert_eq!(wrong(&refined(depth(0), &flat()), &depth(0)), 0);
    // A fence of bars two pixels wide.
    let bar = |x: u32, _: u32| x % 12 < 2;
    let fence = map(SIZE.0, SIZE.1, |x, y| if bar(x, y) { PERSON_M } else { WALL_M });
    assert_eq!(wrong(&refined(fence.clone(), &picture(bar)), &fence), 0);
}

#[test]
fn edges_beside_the_colours_edges_are_moved_onto_them() {
    for wider in [-3, 3] {
        let out = refined(depth(wider), &picture(is_person));
        let (before, after) = (wrong(&depth(wider), &depth(0)), wrong(&out, &depth(0)));
        assert!(after * 50 <= before, "{wider} px: {before} pixels wrong before, {after} after");
        let two_sided = |z_m: &f32| [PERSON_M, WALL_M].iter().any(|side_m| (z_m / side_m - 1.0).abs() < 1e-3);
        assert!(out.metres.iter().all(two_sided), "{wider} px: no depth between the two sides");
    }
}

#[test]
fn a_ramp_between_two_depths_becomes_a_step() {
    // A bilinear filter turns the edge into five pixels of depths that do not exist in the scene.
    let side = |x: i32| ((x - 37) as f32 / 6.0).clamp(0.0, 1.0);
    let ramp = map(SIZE.0, SIZE.1, |x, _| 1.0 / (1.0 / WALL_M + (1.0 / PERSON_M - 1.0 / WALL_M) * side(x as i32)));
    let step = map(SIZE.0, SIZE.1, |x, _| if x < 40 { WALL_M } else { PERSON_M });
    assert_eq!(wrong(&refined(ramp, &picture(|x, _| x >= 40)), &step), 0);
}

#[test]
fn a_smaller_map_takes_the_pictures_size_and_edges() {
    for share in [2, 3, 4] {
        let truth = depth(0);
        let coarse =
            map(SIZE.0 / share, SIZE.1 / share, |x, y| truth.metres[(y * share * SIZE.0 + x * share) as usize]);
        let out = refined(coarse, &picture(is_person));
        assert!(wrong(&out, &truth) <= 12, "1/{share}: {} pixels wrong", wrong(&out, &truth));
    }
    // A larger map, too.
    let large = map(2 * SIZE.0, 2 * SIZE.1, |x, y| if is_person(x / 2, y / 2) { PERSON_M } else { WALL_M });
    assert_eq!(wrong(&refined(large, &picture(is_person)), &depth(0)), 0);
    // A slanted plane is interpolated without steps; the border has no neighbours to interpolate with.
    let slanted = |x: f32| 1.0 / (0.4 + 0.002 * x);
    let coarse = map(SIZE.0 / 4, SIZE.1 / 4, |x, _| slanted(x as f32 * 4.0 + 1.5));
    let out = refined(coarse, &picture(|_, _| false));
    for (k, z_m) in out.metres.iter().enumerate().filter(|(k, _)| (2..118).contains(&(k % 120))) {
        assert!((z_m / slanted((k % 120) as f32) - 1.0).abs() < 1e-3, "column {}: {z_m}", k % 120);
    }
}

#[test]
fn holes_take_the_far_side() {
    let mut holed = depth(0);
    for (k, z_m) in holed.metres.iter_mut().enumerate() {
        let (x, y) = (k % 120, k / 120);
        if (80..92).contains(&x) && y >= 30 || (5..9).contains(&x) && (5..9).contains(&y) {
            *z_m = [0.0, f32::NAN, -1.0, f32::INFINITY][x % 4];
        }
    }
    assert_eq!(wrong(&refined(holed, &picture(is_person)), &depth(0)), 0);
}

#[test]
fn a_slanted_plane_stays_where_it_is() {
    let inverse = |x: u32, y: u32| 0.4 + 0.002 * x as f32 + 0.001 * y as f32;
    let plane = map(SIZE.0, SIZE.1, |x, y| 1.0 / inverse(x, y));
    assert_eq!(wrong(&refined(plane, &picture(is_person)), &map(SIZE.0, SIZE.1, |x, y| 1.0 / inverse(x, y))), 0);
    // Under noise: no bias, in the middle or at the borders, and less noise.
    let noisy = map(SIZE.0, SIZE.1, |x, y| 1.0 / (inverse(x, y) + 0.01 * noise(y * SIZE.0 + x, 0)));
    let out = refined(noisy, &picture(|_, _| false));
    for columns in [0..12, 50..70, 108..120] {
        let off: Vec<f32> = (0..SIZE.0 * SIZE.1)
            .filter(|k| columns.contains(&(k % SIZE.0)))
            .map(|k| 1.0 / out.metres[k as usize] - inverse(k % SIZE.0, k / SIZE.0))
            .collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32;
        let variance = off.iter().map(|off| off * off).sum::<f32>() / off.len() as f32;
        assert!(mean.abs() < 6e-4, "columns {columns:?}: {mean}");
        assert!(variance < 0.25 * 0.01 * 0.01 / 3.0, "columns {columns:?}: {variance}");
    }
}

#[test]
fn a_still_picture_gets_steady_depth() {
    let (truth, color) = (depth(0), picture(is_person));
    let mut refiner = Refiner::new();
    let mut variance = [0.0, 0.0];
    let mut flicker = [0.0, 0.0];
    let mut last: Option<[DepthMap; 2]> = None;
    for frame in 0..20 {
        let noisy = map(SIZE.0, SIZE.1, |x, y| {
            let k = y * SIZE.0 + x;
            1.0 / (1.0 / truth.metres[k as usize] + 0.004 * noise(k, frame))
        });
        let mut out = noisy.clone();
        refiner.refine(&mut out, &color, u64::from(frame) * FRAME_NS);
        let maps = [noisy, out];
        if let (Some(last), true) = (&last, frame >= 12) {
            for side in 0..2 {
                for ((now_m, before_m), truth_m) in maps[side].metres.iter().zip(&last[side].metres).zip(&truth.metres)
                {
                    variance[side] += (1.0 / now_m - 1.0 / truth_m).powi(2);
                    flicker[side] += (1.0 / now_m - 1.0 / before_m).powi(2);
                }
            }
        }
        last = Some(maps);
    }
    assert!(variance[1] * 4.0 < variance[0], "{variance:?}");
    assert!(flicker[1] * 30.0 < flicker[0], "{flicker:?}");
}

#[test]
fn an_edge_that_flickers_under_resting_colours_is_held() {
    // The sensor's edge jumps by two pixels in every third frame; the colours give no hint of where it is.
    let color = flat();
    let mut refiner = Refiner::new();
    for frame in 0..12 {
        let mut out = depth(if frame % 3 == 2 { 2 } else { 0 });
        refiner.refine(&mut out, &color, frame * FRAME_NS);
        assert_eq!(wrong(&out, &depth(0)), 0, "frame {frame}");
    }
}

#[test]
fn a_moving_edge_is_followed_at_once() {
    let mut refiner = Refiner::new();
    for frame in 0..12_u32 {
        let is_here = |x: u32, y: u32| (20 + 5 * frame..50 + 5 * frame).contains(&x) && y >= 30;
        let truth = map(SIZE.0, SIZE.1, |x, y| if is_here(x, y) { PERSON_M } else { WALL_M });
        let mut out = truth.clone();
        refiner.refine(&mut out, &picture(is_here), u64::from(frame) * FRAME_NS);
        assert_eq!(wrong(&out, &truth), 0, "frame {frame}");
    }
    // A surface that approaches while its colours stay constant: no lag above the noise (0.01/m).
    let mut refiner = Refiner::new();
    for frame in 0..12_u32 {
        let inverse = 0.5 + 0.008 * frame as f32;
        let mut out = map(SIZE.0, SIZE.1, |_, _| 1.0 / inverse);
        refiner.refine(&mut out, &picture(is_person), u64::from(frame) * FRAME_NS);
        assert!(out.metres.iter().all(|z_m| (1.0 / z_m - inverse).abs() < 0.01), "frame {frame}");
    }
}

#[test]
fn a_seek_or_another_size_starts_anew() {
    let color = flat();
    let far = map(SIZE.0, SIZE.1, |_, _| WALL_M);
    for then_ns in [0, 10 * FRAME_NS + 900_000_000] {
        let mut refiner = Refiner::new();
        for frame in 1..=10 {
            refiner.refine(&mut far.clone(), &color, frame * FRAME_NS);
        }
        let mut out = depth(0);
        refiner.refine(&mut out, &color, then_ns);
        assert_eq!(wrong(&out, &depth(0)), 0, "{then_ns}");
        let mut small = map(60, 45, |_, _| PERSON_M);
        refiner.refine(&mut small, &ColorImage::new(60, 45), then_ns + FRAME_NS);
        assert_eq!(wrong(&small, &map(60, 45, |_, _| PERSON_M)), 0);
    }
}

#[test]
fn any_size_and_any_value_is_handled() {
    for (width, height) in [(0, 0), (1, 1), (1, 40), (40, 1), (2, 3), (17, 13), (33, 65)] {
        let color = ColorImage::new(width, height);
        let mut refiner = Refiner::new();
        for frame in 0..3 {
            let mut wild = map(width, height, |x, y| match (x * 3 + y * 5 + frame) % 7 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => 0.0,
                3 => -2.0,
                4 => 1e-6,
                5 => 1e6,
                _ => 1.0,
            });
            wild.metres.iter_mut().take(1).for_each(|z_m| *z_m = 1.5);
            refiner.refine(&mut wild, &color, u64::from(frame) * FRAME_NS);
            assert!(wild.metres.iter().all(|&z_m| DepthMap::is_known(z_m)), "{width} x {height}");
            assert_eq!(wild.size(), (width, height));
        }
        let mut unknown = map(width, height, |_, _| f32::NAN);
        Refiner::new().refine(&mut unknown, &color, 0);
        assert!(unknown.metres.iter().all(|&z_m| z_m == 0.0), "nothing known stays unknown");
    }
    // An empty map for a picture with pixels.
    let mut empty = DepthMap::default();
    Refiner::new().refine(&mut empty, &ColorImage::new(4, 3), 0);
    assert_eq!(empty.metres, vec![0.0; 12]);
}

/// Returns a recording of a real camera, and a synthetic stress case: edges all over, in noise, with holes.
fn takes() -> [Vec<(ColorImage, DepthMap)>; 2] {
    let real = |index| {
        let (color, map, _) = portrait::frame(index);
        (color, map)
    };
    let made = |frame: u32| {
        let (width, height) = (331, 257);
        let (mut color, mut map) = (ColorImage::new(width, height), DepthMap::new(width, height));
        for (k, (pixel, z_m)) in (0..).zip(color.rgb.chunks_exact_mut(3).zip(&mut map.metres)) {
            let (x, y) = (k % width + 3 * frame, k / width);
            let is_near = |x: u32, y: u32| (x / 61 + y / 83).is_multiple_of(3);
            let near = is_near(x, y);
            // A soft picture, in which mixed pixels are found.
            let seen = (0..9u32).filter(|k| is_near((x + k % 3).saturating_sub(1), (y + k / 3).saturating_sub(1)));
            let (share, grain) = (seen.count() as f32 / 9.0, 8.0 * noise(k, frame));
            let mix = |near: f32, far: f32| (far + share * (near - far) + grain) as u8;
            pixel.copy_from_slice(&[mix(60.0, 170.0), mix(50.0, 180.0), mix(40.0, 200.0)]);
            let off = 0.004 * noise(k, frame + 100);
            let is_hole = (x + 2) / 9 % 7 == 0 && y / 11 % 2 == 0;
            *z_m = if is_hole { 0.0 } else { off + if near { 1.0 + 0.001 * y as f32 } else { WALL_M } };
        }
        (color, map)
    };
    [(0..9).map(real).collect(), (0..5).map(made).collect()]
}

#[test]
fn any_number_of_threads_makes_the_same_depth_and_the_same_matte() {
    for frames in takes() {
        let made_by = |threads: usize| {
            let lens = CocAtInfinity::Px(14.0);
            let rule = CocRule::Depth { focus: FocusRule::Auto, lens, range_m: 0.0, max_coc_px: 20.0 };
            let mut coc = CocCalculator::new(rule, Postprocess::Refine).with_threads(threads);
            coc.set_background_memory(true);
            let mut made = Vec::new();
            for ((color, measured), time_ns) in frames.iter().zip((0..).step_by(FRAME_NS as usize)) {
                let mut map = measured.clone();
                let field = coc.compute(&mut map, color, time_ns);
                let mut shared = DepthMap { metres: map.metres.clone(), ..DepthMap::new(map.width, map.height) };
                coc.adapt_reused_map(&mut shared, color, &field);
                made.extend([map, shared]);
            }
            made
        };
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let alone = made_by(1);
        let mixed: Vec<usize> = alone.iter().map(|map| map.matte.pixels.len()).collect();
        assert!(mixed.iter().all(|&mixed| mixed > 100), "there are mattes: {mixed:?}");
        for threads in [2, 3, 7] {
            for (k, (map, other)) in alone.iter().zip(made_by(threads)).enumerate() {
                assert!(bits(&map.metres) == bits(&other.metres), "the map of frame {k} by {threads} threads");
                assert!(map.matte == other.matte, "the matte of frame {k} by {threads} threads");
            }
        }
    }
}
