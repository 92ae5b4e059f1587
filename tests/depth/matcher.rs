//! The stereo matcher: laws on synthetic pairs.

use bokehcam::compute::Backend;
use bokehcam::depth::stereo::{Effort, MatchError, Matcher, Pair, Settings, create};
use bokehcam::frame::{DisparityMap, GrayImage};

const EFFORTS: [Effort; 2] = [Effort::Fast, Effort::Full];

/// Pseudorandom numbers, 0 to 255.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> u8 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 24) as u8
    }
}

/// Creates a texture of blots of two pixels, whose column `x` of the left picture is column `x + disparity` of the
/// right one.
fn pair((width, height): (u32, u32), disparity: impl Fn(usize, usize) -> usize) -> [GrayImage; 2] {
    let (columns, rows) = (width as usize, height as usize);
    let stride = columns + 256;
    let mut noise = Noise(7);
    let blots: Vec<u8> = (0..stride * rows).map(|_| noise.next()).collect();
    let texture = |x: usize, y: usize| blots[y / 2 * stride + x / 2];
    let picture = |luma| GrayImage { width, height, luma };
    let places = || (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    let left = places().map(|(x, y)| texture(x, y)).collect();
    let right = places().map(|(x, y)| texture(x + disparity(x, y), y)).collect();
    [picture(left), picture(right)]
}

fn matcher(size: (u32, u32), disparities: u32, effort: Effort, threads: usize) -> Box<dyn Matcher> {
    create(&Settings { size, disparities, effort, threads }, Backend::Cpu, None).expect("the CPU can be had")
}

fn matched([left, right]: &[GrayImage; 2], disparities: u32, effort: Effort, threads: usize) -> DisparityMap {
    let mut map = DisparityMap::default();
    matcher(left.size(), disparities, effort, threads)
        .compute_disparity(Pair { left, color: None, right }, &mut map)
        .expect("a pair of one size");
    assert_eq!(map.size(), left.size());
    assert!(map.px.iter().all(|&d| d > 0.0 && d <= Settings::MAX_DISPARITIES as f32), "every pixel has an answer");
    map
}

#[test]
fn a_shifted_texture_has_its_shift() {
    for (shift, disparities) in [(0, 16), (5, 16), (22, 64), (90, 96), (120, 128), (200, 256)] {
        let pair = pair((400, 60), |_, _| shift);
        for effort in EFFORTS {
            let map = matched(&pair, disparities, effort, 2);
            let off = map.px.iter().map(|d| (d - shift as f32).abs());
            // At lower effort, blots of two pixels are at the limit of the resolution.
            let most = if effort == Effort::Full { 0.3 } else { 1.1 };
            let wrong = off.filter(|&off| off > most).count();
            assert!(wrong * 50 < map.px.len(), "{shift} of {disparities}, {effort:?}: {wrong} of {}", map.px.len());
        }
    }
}

#[test]
fn something_near_stands_out_with_its_outline() {
    // The square's right image hides its surroundings there: it is at columns 160 to 240.
    let pair = pair((360, 120), |x, y| if (130..210).contains(&x) && (30..90).contains(&y) { 30 } else { 8 });
    let map = matched(&pair, 64, Effort::Full, 2);
    let at = |x: usize, y: usize| map.px[y * 360 + x];
    for (x, y, expected) in
        [(200, 60, 30.0), (170, 40, 30.0), (212, 80, 30.0), (60, 60, 8.0), (300, 60, 8.0), (200, 10, 8.0)]
    {
        assert!((at(x, y) - expected).abs() < 0.2, "{x},{y}: {}", at(x, y));
    }
    // The gap to its left is filled from the background.
    assert!((at(148, 60) - 8.0).abs() < 0.5, "{}", at(148, 60));
}

#[test]
fn the_exposure_of_an_eye_does_not_matter() {
    let mut pair = pair((200, 50), |x, _| 4 + x / 40);
    let before = matched(&pair, 32, Effort::Full, 1);
    // The right picture is darker and has less contrast.
    pair[1].luma.iter_mut().for_each(|luma| *luma = 10 + *luma / 2);
    let mut coarse = pair.clone();
    coarse[0].luma.iter_mut().for_each(|luma| *luma &= !1);
    let after = matched(&pair, 32, Effort::Full, 1);
    let same = before.px.iter().zip(&after.px).filter(|(a, b)| (*a - *b).abs() < 0.3).count();
    assert!(same * 100 > 97 * before.px.len(), "{same} of {}", before.px.len());
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let pair = pair((150, 77), |x, y| 3 + x / 20 + y / 11);
    for effort in EFFORTS {
        let one = matched(&pair, 64, effort, 1);
        for threads in [2, 3, 8] {
            assert_eq!(one, matched(&pair, 64, effort, threads), "{threads} threads, {effort:?}");
        }
    }
}

#[test]
fn any_size_and_range_are_answered() {
    for size in [(1, 1), (1, 40), (2, 3), (17, 13), (700, 2), (33, 100)] {
        for disparities in [1, 16, 40, 100, 256] {
            for effort in EFFORTS {
                matched(&pair(size, |_, _| 1), disparities, effort, 2);
            }
        }
    }
}

#[test]
fn a_blank_pair_is_answered_alike_everywhere() {
    let blank = GrayImage { width: 64, height: 48, luma: vec![90; 64 * 48] };
    let map = matched(&[blank.clone(), blank], 32, Effort::Full, 1);
    let (least, most) = map.px.iter().fold((f32::MAX, 0.0f32), |(a, b), &d| (a.min(d), b.max(d)));
    assert!(most - least < 1.0, "{least} to {most}");
}

#[test]
fn what_rests_is_steady_and_what_moves_is_new() {
    let (width, height) = (240, 80);
    // The texture is weaker than the noise, so the disparity is ambiguous; with memory it shall not flicker.
    let noisy = |seed: u32, near: usize| {
        let mut pair = pair((width, height), |x, _| if (100..160).contains(&x) { near } else { 6 });
        let mut noise = Noise(seed);
        for (k, luma) in pair.iter_mut().flat_map(|eye| eye.luma.iter_mut()).enumerate() {
            let strength = if k % width as usize >= 180 { 60 } else { 2 };
            *luma = 100 + *luma / strength + noise.next() / 100;
        }
        pair
    };
    let frames: Vec<_> = (1..=6).map(|seed| noisy(seed, 20)).collect();
    let changes = |keep: bool| {
        let mut matcher_ = matcher((width, height), 32, Effort::Full, 1);
        let (mut last, mut map, mut sum) = (None::<Vec<f32>>, DisparityMap::default(), 0.0);
        for [left, right] in &frames {
            if !keep {
                matcher_ = matcher((width, height), 32, Effort::Full, 1);
            }
            matcher_.compute_disparity(Pair { left, color: None, right }, &mut map).unwrap();
            if let Some(last) = last.replace(map.px.clone()) {
                sum += last.iter().zip(&map.px).map(|(a, b)| (a - b).abs()).sum::<f32>();
            }
        }
        sum
    };
    let (with, without) = (changes(true), changes(false));
    assert!(with < 0.7 * without, "{with} against {without}");

    // A surface that comes nearer is followed without lag.
    let mut matcher = matcher((width, height), 32, Effort::Full, 1);
    let mut map = DisparityMap::default();
    for (seed, near) in [(1, 12), (2, 12), (3, 24)] {
        let [left, right] = pair((width, height), |x, _| if (100..160).contains(&x) { near } else { 6 });
        let _ = seed;
        matcher.compute_disparity(Pair { left: &left, color: None, right: &right }, &mut map).unwrap();
    }
    let at = map.px[40 * width as usize + 150];
    assert!((at - 24.0).abs() < 0.5, "{at}");
}

#[test]
fn unequal_and_unexpected_sizes_are_named() {
    let picture = |width, height| GrayImage { width, height, luma: vec![0; (width * height) as usize] };
    let mut matcher = matcher((20, 10), 16, Effort::Full, 1);
    let mut map = DisparityMap::default();
    let error = matcher
        .compute_disparity(Pair { left: &picture(20, 10), color: None, right: &picture(19, 10) }, &mut map)
        .unwrap_err();
    assert!(matches!(error, MatchError::Sizes { .. }) && error.to_string().contains("19x10"), "{error}");
    let error = matcher
        .compute_disparity(Pair { left: &picture(20, 12), color: None, right: &picture(20, 12) }, &mut map)
        .unwrap_err();
    assert!(matches!(error, MatchError::Size { .. }) && error.to_string().contains("20x12"), "{error}");
}
