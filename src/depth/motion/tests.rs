use super::*;

const SIZE: (usize, usize) = (640, 360);
const FAR_M: f32 = 4.0;
const NEAR_M: f32 = 1.0;
/// Minimum step between surfaces, in 1/m.
const DEPTH_STEP: f32 = 0.1;

/// Returns a random texture with spots of three pixels, as a function of the position.
fn texture(x: i32, y: i32, plane: u32) -> u8 {
    let spot = |x: i32, y: i32| {
        let hash = (x as u64 & 0xffff) << 32 | (y as u64 & 0xffff) << 8 | u64::from(plane);
        let hash = (hash ^ 0x9e37_79b9).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40 & 0xff
    };
    let (column, row) = (x.div_euclid(3), y.div_euclid(3));
    (40 + (spot(column, row) + spot(column + 1, row) + spot(column, row + 1)) / 5) as u8
}

/// Renders a picture and its depth map from a function of the pixel: grey value and metres.
fn seen(of: impl Fn(i32, i32) -> (u8, f32)) -> (ColorImage, DepthMap) {
    let (mut color, mut map) =
        (ColorImage::new(SIZE.0 as u32, SIZE.1 as u32), DepthMap::new(SIZE.0 as u32, SIZE.1 as u32));
    for at in 0..SIZE.0 * SIZE.1 {
        let (luma, metres) = of((at % SIZE.0) as i32, (at / SIZE.0) as i32);
        color.rgb[3 * at..3 * at + 3].fill(luma);
        map.metres[at] = metres;
    }
    (color, map)
}

/// Returns the depth of `then`, warped by the motion to `now`.
fn moved(then: &(ColorImage, DepthMap), now: &ColorImage) -> DepthMap {
    let mut motion = MotionEstimator::default();
    motion.set_reference(&then.1, &then.0, DEPTH_STEP);
    let mut map = then.1.clone();
    if motion.estimate(&then.1, now) != Motion::Rest {
        motion.warp(&then.1, &mut map);
    }
    map
}

/// A square of 140 px in the middle, moved by `near`, before a wall, moved by `far`.
fn square(near: Vector, far: Vector, plain: bool) -> (ColorImage, DepthMap) {
    seen(|x, y| {
        let (own_x, own_y) = (x - near[0], y - near[1]);
        if (250..390).contains(&own_x) && (110..250).contains(&own_y) {
            (if plain { 220 } else { texture(own_x, own_y, 1) }, NEAR_M)
        } else {
            (texture(x - far[0], y - far[1], 2), FAR_M)
        }
    })
}

#[test]
fn what_rests_has_the_same_depth_to_the_bit() {
    let slope = |x: i32, y: i32| (texture(x, y, 0), 1.0 + 0.01 * (x + 2 * y) as f32);
    let then = seen(slope);
    let mut noisy = then.0.clone();
    for (at, code) in noisy.rgb.iter_mut().enumerate() {
        *code = code.wrapping_add_signed([0, 2, -2, 1, 0, -1, 3][at % 7]);
    }
    for now in [&then.0, &noisy] {
        assert!(moved(&then, now).metres.iter().zip(&then.1.metres).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}

#[test]
fn the_depth_of_a_picture_that_moved_has_moved_as_far() {
    for shift in [[5, -3], [-14, 0], [0, 9], [31, 22], [1, 1]] {
        let at = |x: i32, y: i32| (texture(x, y, 0), 1.0 + 0.001 * (x + 700) as f32 + 0.003 * (y + 400) as f32);
        let now = seen(|x, y| at(x - shift[0], y - shift[1]));
        let map = moved(&seen(at), &now.0);
        for y in 0..SIZE.1 as i32 {
            for x in 0..SIZE.0 as i32 {
                let (from_x, from_y) = (x - shift[0], y - shift[1]);
                // Content from beyond the border is replicated from it. Close to the border, most of a block is
                // missing, and the motion is unknown.
                let is_inside = |from: i32, count: usize| (24..count as i32 - 24).contains(&from);
                let is_far = shift.iter().any(|px| px.abs() > 8);
                if is_far
                    && !([x, from_x].iter().all(|&x| is_inside(x, SIZE.0))
                        && [y, from_y].iter().all(|&y| is_inside(y, SIZE.1)))
                {
                    continue;
                }
                let expected = at(from_x.clamp(0, SIZE.0 as i32 - 1), from_y.clamp(0, SIZE.1 as i32 - 1)).1;
                let found = map.metres[y as usize * SIZE.0 + x as usize];
                assert!(found.to_bits() == expected.to_bits(), "{shift:?}: {found} at {x},{y} instead of {expected}");
            }
        }
    }
}

/// Returns the fraction of pixels whose depth is not as expected.
fn wrong(found: &DepthMap, expected: &DepthMap) -> f32 {
    let count = found.metres.iter().zip(&expected.metres).filter(|(a, b)| (*a - *b).abs() > 0.01).count();
    count as f32 / found.metres.len() as f32
}

#[test]
fn of_two_surfaces_the_nearer_one_stays_before_the_other() {
    let rest = square([0; 2], [0; 2], false);
    for (near, far) in [([7, 0], [0, 0]), ([-12, 5], [0, 0]), ([0, 0], [9, 0]), ([8, 0], [-6, 0]), ([0, -20], [0, 3])] {
        let now = square(near, far, false);
        let map = moved(&rest, &now.0);
        assert_eq!(wrong(&map, &now.1), 0.0, "{near:?} {far:?}");
    }
}

#[test]
fn something_plain_moves_with_its_outline() {
    let rest = square([0; 2], [0; 2], true);
    for near in [[6, 0], [-6, 0], [0, 6], [5, -4]] {
        let now = square(near, [0; 2], true);
        let (held, map) = (wrong(&rest.1, &now.1), wrong(&moved(&rest, &now.0), &now.1));
        assert!(map < 0.75 * held, "{near:?}: {map} of the pixels are wrong, and {held} without motion");
    }
}

#[test]
fn a_map_of_fewer_pixels_moves_as_well() {
    let (then, now) = (square([0; 2], [0; 2], false), square([8, 4], [0; 2], false));
    let small = |map: &DepthMap| {
        let mut small = DepthMap::new(map.width / 2, map.height / 2);
        let (across, width) = (small.width as usize, map.width as usize);
        small
            .metres
            .iter_mut()
            .enumerate()
            .for_each(|(at, metres)| *metres = map.metres[at / across * 2 * width + at % across * 2]);
        small
    };
    let map = moved(&(then.0, small(&then.1)), &now.0);
    assert!(wrong(&map, &small(&now.1)) < 0.001);
}

#[test]
fn what_cannot_be_compared_stays() {
    let then = square([0; 2], [0; 2], false);
    let other = ColorImage::new(320, 180);
    assert_eq!(moved(&then, &other), then.1);
    let unknown = (then.0.clone(), DepthMap::new(640, 360));
    assert_eq!(moved(&unknown, &square([9, 0], [0; 2], false).0), unknown.1);
    let tiny = (ColorImage::new(5, 4), DepthMap { metres: vec![1.0; 20], ..DepthMap::new(5, 4) });
    assert_eq!(moved(&tiny, &ColorImage { rgb: vec![90; 60], ..ColorImage::new(5, 4) }), tiny.1);
}

#[test]
fn a_surface_is_asked_for_by_its_depth() {
    let (then, now) = (square([0; 2], [0; 2], false), square([10, 0], [-4, 0], false));
    let mut motion = MotionEstimator::default();
    motion.set_reference(&then.1, &then.0, DEPTH_STEP);
    assert_eq!(motion.estimate(&then.1, &now.0), Motion::Moved);
    // On both sides of the square's left outline.
    for x in [246, 250, 253] {
        let at = 180 * SIZE.0 + x;
        assert_eq!([NEAR_M, FAR_M].map(|metres| motion.vector_at(at, metres)), [[10, 0], [-4, 0]], "{x}");
    }
}

#[test]
fn who_leaves_or_another_scene_is_no_motion() {
    let estimate = |then: &(ColorImage, DepthMap), now: &ColorImage| {
        let mut motion = MotionEstimator::default();
        motion.set_reference(&then.1, &then.0, DEPTH_STEP);
        motion.estimate(&then.1, now)
    };
    let then = square([0; 2], [0; 2], true);
    for (near, far) in [([0; 2], [0; 2]), ([9, -3], [0; 2]), ([-12, 4], [6, 2]), ([0; 2], [20, 0])] {
        let expected = if (near, far) == ([0; 2], [0; 2]) { Motion::Rest } else { Motion::Moved };
        assert_eq!(estimate(&then, &square(near, far, true).0), expected, "{near:?} {far:?}");
    }
    let wall = seen(|x, y| (texture(x, y, 2), FAR_M));
    let other = seen(|x, y| (if (x / 24 + y / 24) % 2 == 0 { 20 } else { 230 }, FAR_M));
    for now in [&wall, &other] {
        assert_eq!(estimate(&then, &now.0), Motion::Unexplained);
    }
}
