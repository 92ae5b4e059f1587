use super::*;

/// CoC of 10 px at infinity; -20 px at a third of the focal distance.
const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 40.0 };
const NEAR_M: f32 = 1.0 / 2.2;
const FAR_M: f32 = 10.0;
/// Pixels beyond the radius that are told.
const BEYOND: f32 = 2.0;
/// Surfaces: something near, something at a middle distance, and a wall.
const NEAR: (f32, [u8; 3]) = (NEAR_M, [255, 0, 0]);
const MIDDLE: (f32, [u8; 3]) = (1.6, [0, 255, 0]);
const WALL: (f32, [u8; 3]) = (FAR_M, [0, 0, 255]);

/// Draws a surface at each pixel.
fn draw(width: u32, height: u32, surface: impl Fn(u32, u32) -> (f32, [u8; 3])) -> (DepthMap, ColorImage) {
    let (mut map, mut color) = (DepthMap::default(), ColorImage::new(width, height));
    map.resize(width, height);
    for at in 0..width * height {
        let (metres, rgb) = surface(at % width, at / width);
        map.metres[at as usize] = metres;
        color.rgb[3 * at as usize..][..3].copy_from_slice(&rgb);
    }
    (map, color)
}

fn add_to_matte(map: &mut DepthMap, color: &ColorImage, threads: usize) {
    add_behind(Hiding::NEAR, map, color, threads);
}

fn add_behind(hiding: Hiding, map: &mut DepthMap, color: &ColorImage, threads: usize) {
    HiddenSurfaces::default().add_to_matte(&mut ThreadPool::new("test", threads), map, color, &LENS, hiding);
}

/// Returns the colour that a pixel says is behind it.
fn color_behind(pixel: &MixedPixel, color: &ColorImage) -> [u8; 3] {
    let (light, at) = (srgb_to_linear_table(), 3 * pixel.at as usize);
    std::array::from_fn(|p| {
        crate::color::encode_srgb(light[usize::from(color.rgb[at + p])] - pixel.alpha * pixel.difference[p])
    })
}

#[test]
fn behind_a_near_bar_both_surfaces_go_on_and_their_outline_does() {
    // An outline on a slope behind an upright bar: left of it the middle thing is above, and below the wall.
    let is_bar = |x: u32| (60..84).contains(&x);
    let is_above = |x: u32, y: u32| (y as f32) < 60.0 + 0.4 * (x as f32 - 72.0);
    let scene = |x, y| match () {
        () if is_bar(x) => NEAR,
        () if is_above(x, y) => MIDDLE,
        () => WALL,
    };
    let (mut map, color) = draw(144, 120, scene);
    add_to_matte(&mut map, &color, 1);
    let radius_px = -LENS.coc_px(NEAR_M);
    let told = |x: u32, y: u32| map.matte.pixels.iter().find(|pixel| pixel.at == y * 144 + x);
    for (x, y) in (0..120).flat_map(|y| (0..144).map(move |x| (x, y))) {
        assert_eq!(told(x, y).is_some(), is_bar(x), "({x}, {y}): a bar of 24 px is all within {radius_px} px");
    }
    let mut wrong = 0;
    for pixel in &map.matte.pixels {
        let (x, y) = (pixel.at % 144, pixel.at / 144);
        let (metres, expected) = if is_above(x, y) { MIDDLE } else { WALL };
        assert_eq!((pixel.alpha, pixel.background_alpha, pixel.near_m), (1.0, 1.0, NEAR_M));
        let is_right = (pixel.far_m / metres - 1.0).abs() < 1e-3 && color_behind(pixel, &color) == expected;
        wrong += u32::from(!is_right);
    }
    // The outline may be off by a pixel of half the size.
    assert!(wrong <= 2 * 24, "{wrong} of {} pixels", map.matte.pixels.len());
}

#[test]
fn only_the_surface_beside_the_outline_goes_on() {
    // A near disc before the wall; something in between, whose light must not be behind the disc, does not touch it.
    let scene = |x: u32, y: u32| match (x as f32 - 60.0).hypot(y as f32 - 60.0) {
        distance if distance < 16.0 => NEAR,
        distance if (28.0..40.0).contains(&distance) => MIDDLE,
        _ => WALL,
    };
    let (mut map, color) = draw(120, 120, scene);
    add_to_matte(&mut map, &color, 1);
    assert!(map.matte.pixels.len() > 700);
    for pixel in &map.matte.pixels {
        assert!(color_behind(pixel, &color) == WALL.1 && (pixel.far_m / FAR_M - 1.0).abs() < 1e-3, "{pixel:?}");
    }
}

#[test]
fn what_is_not_near_hides_nothing_here_and_what_is_told_stays() {
    let (mut map, color) = draw(64, 48, |x, y| if x < 30 && y > 9 { (1.0, [9; 3]) } else { WALL });
    let told = MixedPixel { at: 700, near_m: 1.0, far_m: 3.0, alpha: 0.5, ..MixedPixel::default() };
    map.matte.pixels = vec![told];
    let before = map.clone();
    add_to_matte(&mut map, &color, 2);
    assert_eq!(map, before);
    // Ground that comes nearer is one surface.
    let (mut map, color) = draw(64, 48, |_, y| (0.3 + 0.01 * (47 - y) as f32, [y as u8; 3]));
    add_to_matte(&mut map, &color, 2);
    assert!(map.matte.pixels.is_empty());
    // What the memory knows behind a near thing stays.
    let (mut map, color) = draw(64, 48, |x, _| if x < 30 { NEAR } else { WALL });
    let told = MixedPixel { at: 20, near_m: NEAR_M, far_m: 3.0, alpha: 1.0, ..MixedPixel::default() };
    map.matte.pixels = vec![told];
    add_to_matte(&mut map, &color, 1);
    assert_eq!(map.matte.pixels.iter().find(|pixel| pixel.at == 20), Some(&told));
    assert!(map.matte.pixels.len() > 400 && map.matte.pixels.is_sorted_by_key(|pixel| pixel.at));
}

#[test]
fn behind_the_subject_the_wall_goes_on_for_its_radius_and_fades() {
    // A subject before the wall, with one mixed pixel, and something near before both.
    let subject = (1.0, [0, 255, 0]);
    let scene = |x: u32, y: u32| match () {
        () if y >= 70 => NEAR,
        () if x < 40 => subject,
        () => WALL,
    };
    let (mut map, color) = draw(96, 80, scene);
    let mixed = MixedPixel { at: 30 * 96 + 40, near_m: 1.0, far_m: FAR_M, alpha: 0.5, ..MixedPixel::default() };
    map.matte.pixels = vec![mixed];
    add_behind(Hiding::SUBJECT, &mut map, &color, 2);
    let radius_px = LENS.coc_px(FAR_M);
    let told = |x: u32, y: u32| map.matte.pixels.iter().find(|pixel| pixel.at == y * 96 + x);
    assert_eq!(told(40, 30), Some(&MixedPixel { background_alpha: 1.0, ..mixed }), "the wall is known behind it");
    for y in (0..60).filter(|&y| y != 30) {
        let weights: Vec<f32> = (0..40).rev().map_while(|x| told(x, y)).map(|pixel| pixel.background_alpha).collect();
        assert!((weights.len() as f32 - radius_px - BEYOND).abs() <= 2.0, "{} of {radius_px}", weights.len());
        assert!(weights.is_sorted_by(|a, b| a >= b) && weights[0] > 0.75, "{weights:?}");
        assert!(weights[(0.75 * radius_px) as usize + 2] == 0.0, "{weights:?}");
    }
    for pixel in map.matte.pixels.iter().filter(|pixel| pixel.alpha == 1.0) {
        assert!(pixel.at / 96 < 70 && pixel.near_m == 1.0, "behind what is near another pass looks");
        assert!(color_behind(pixel, &color) == WALL.1 && (pixel.far_m / FAR_M - 1.0).abs() < 1e-3, "{pixel:?}");
    }
    // What is near hides nothing of the subject's, and the other way round.
    let (near, far) = (Hiding::NEAR, Hiding::SUBJECT);
    assert!([-9.0, -2.1, -2.0, 0.0, 1.4, 1.6].iter().all(|&px| !(near.includes(px) && far.includes(px))));
}

/// Returns a number of 0..n from a seed.
fn random(seed: &mut u32, n: u32) -> u32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) % n
}

#[test]
fn every_map_of_every_size_has_a_valid_matte_that_is_the_same_on_any_number_of_threads() {
    let mut seed = 7;
    for (width, height) in [(1, 1), (1, 9), (2, 2), (7, 1), (3, 5), (33, 31), (64, 200), (131, 97)] {
        for kind in 0..4 {
            let depths_m = [0.2, NEAR_M, 0.6, 1.0, 1.6, FAR_M, 0.0, f32::NAN, f32::INFINITY, -1.0, 1e-30];
            let (mut map, color) = draw(width, height, |x, y| match kind {
                0 => NEAR,
                1 => [NEAR, WALL, MIDDLE][(x / 5 % 3 + y / 7) as usize % 3],
                _ => WALL,
            });
            if kind >= 2 {
                let side = if kind == 2 { 1 } else { 9 };
                for at in 0..width * height {
                    let (x, y) = (at % width, at / width);
                    let is_new = x % side == 0 && y % side == 0;
                    let from = (y - y % side) * width + x - x % side;
                    let new_m = depths_m[random(&mut seed, depths_m.len() as u32) as usize];
                    map.metres[at as usize] = if is_new { new_m } else { map.metres[from as usize] };
                }
            }
            let same = |a: &MixedPixel, b: &MixedPixel| bytes_of(a) == bytes_of(b);
            let hiding = if kind % 2 == 0 { Hiding::NEAR } else { Hiding::SUBJECT };
            let before = map.clone();
            add_behind(hiding, &mut map, &color, 1);
            let pixels = &map.matte.pixels;
            assert!(pixels.len() <= Matte::max_hidden(width as usize, height as usize));
            assert!(pixels.is_sorted_by(|a, b| a.at < b.at));
            for pixel in pixels {
                assert!(pixel.difference.iter().all(|light| light.is_finite()), "{pixel:?}");
                assert!(pixel.far_m > 0.0 && hiding.includes(LENS.coc_px(pixel.near_m)), "{pixel:?}");
            }
            for threads in [2, 5] {
                let mut other = before.clone();
                add_behind(hiding, &mut other, &color, threads);
                let is_same = other.matte.pixels.len() == pixels.len()
                    && other.matte.pixels.iter().zip(pixels).all(|(a, b)| same(a, b));
                assert!(is_same, "{width} x {height}, kind {kind}, {threads} threads");
            }
        }
    }
}

/// Returns the values of a pixel as bits.
fn bytes_of(pixel: &MixedPixel) -> [u32; 8] {
    let MixedPixel { at, near_m, far_m, alpha, background_alpha, difference: [r, g, b] } = *pixel;
    [
        at,
        near_m.to_bits(),
        far_m.to_bits(),
        alpha.to_bits(),
        background_alpha.to_bits(),
        r.to_bits(),
        g.to_bits(),
        b.to_bits(),
    ]
}
