use super::*;
use crate::depth::matting::mixture::{ALPHA_VARIANCE, ISOTROPY, NOISE};
use crate::depth::matting::symmetric::{Symmetric, dot, invert, multiply, outer_product};

/// Whether a point is on the near side of a straight outline.
fn is_inside(direction: [f32; 2], offset: f32, x: f32, y: f32) -> bool {
    direction[0] * x + direction[1] * y < offset
}

#[test]
fn shares_are_those_of_straight_outlines_that_pass_anywhere() {
    const SAMPLES: usize = 12;
    let mut found = [[0.0f32; SIDE]; OUTLINES.len()];
    for turn in 0..360 {
        let (sin, cos) = (turn as f32 + 0.5).to_radians().sin_cos();
        for offset in (-140..140).map(|k| 0.01 * k as f32 + 0.005) {
            let is_near = |x: i32, y: i32| is_inside([cos, sin], offset, x as f32, y as f32);
            let alike = |places: [(i32, i32); 4]| {
                places.iter().filter(|(x, y)| is_near(*x, *y) == is_near(0, 0)).count() as u32
            };
            let counts = (alike([(1, 0), (-1, 0), (0, 1), (0, -1)]), alike([(1, 1), (-1, 1), (1, -1), (-1, -1)]));
            let Some(row) = OUTLINES.iter().position(|at| *at == counts) else { continue };
            let at = |k: usize| (k as f32 + 0.5) / SAMPLES as f32 - 0.5;
            let of_own = |k: &usize| is_inside([cos, sin], offset, at(k % SAMPLES), at(k / SAMPLES)) == is_near(0, 0);
            let alpha = (0..SAMPLES * SAMPLES).filter(of_own).count() as f32 / (SAMPLES * SAMPLES) as f32;
            let step = ((alpha - 0.5).max(0.0) / STEP).min((SIDE - 1) as f32);
            let below = (step as usize).min(SIDE - 2);
            found[row][below] += 1.0 - (step - below as f32);
            found[row][below + 1] += step - below as f32;
        }
    }
    for (found, priors) in found.iter().zip(&ALPHA_PRIORS[1..]) {
        let total: f32 = found.iter().sum();
        // The uniform part: as much as the least likely sample has, and less than three quarters.
        let even = SIDE as f32 * priors.iter().copied().fold(1.0, f32::min);
        assert!(even < 0.75, "{priors:?}");
        let least = found.iter().copied().fold(total, f32::min) / total;
        let even = (even - SIDE as f32 * least).max(0.0);
        for (found, prior) in found.iter().zip(priors) {
            let expected = (1.0 - even) * found / total + even / SIDE as f32;
            assert!((prior - expected).abs() < 0.03, "{prior} is not {expected}: {priors:?}, {found:?}");
        }
    }
    ALPHA_PRIORS.iter().for_each(|priors| assert!((priors.iter().sum::<f32>() - 1.0).abs() < 2e-3, "{priors:?}"));
}

#[test]
fn evidence_of_each_lane_is_that_of_its_pixel_alone() {
    let mut seed = 1u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32
    };
    // Also batches that are not full.
    for lanes in [LANES, 5, 1] {
        let mut colors = Colors::NONE;
        let pixels: Vec<_> = (0..lanes)
            .map(|k| {
                let [sides, corners] = [random(), random()].map(|part| (4.9 * part) as u32);
                let labels = Labels::new(random() > 0.5, random() > 0.5, sides, corners);
                let mut light = || std::array::from_fn(|_| random());
                let [own, near, far, spread]: [[f32; 3]; 4] = [light(), light(), light(), light()];
                // Correlated channels.
                let [r, g, b] = spread.map(|value| 0.02 + 0.1 * value);
                let covariance = [r * r, 0.5 * r * g, 0.0, g * g, -0.3 * g * b, b * b];
                let surfaces = [near, far].map(|mean| Color { mean, covariance });
                let has_background = random() > 0.5;
                colors.set_lane(k, labels, own, surfaces, has_background);
                (labels, own, surfaces, has_background)
            })
            .collect();
        let evidence = Evidence::new(&colors);
        for (k, (labels, own, [near, far], has_background)) in pixels.into_iter().enumerate() {
            let likelihood = |step: usize| {
                let alpha = step as f32 * STEP;
                let mut spread: Symmetric = std::array::from_fn(|p| {
                    alpha * alpha * near.covariance[p] + (1.0 - alpha) * (1.0 - alpha) * far.covariance[p]
                });
                let part = ISOTROPY / 3.0 * (spread[0] + spread[3] + spread[5]) + NOISE;
                let difference: [f32; 3] = std::array::from_fn(|p| near.mean[p] - far.mean[p]);
                let squares = outer_product(difference);
                for p in 0..6 {
                    spread[p] += ALPHA_VARIANCE * squares[p] + if [0, 3, 5].contains(&p) { part } else { 0.0 };
                }
                let [xx, xy, xz, yy, yz, zz] = spread;
                let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
                let off = std::array::from_fn(|p| own[p] - far.mean[p] - alpha * difference[p]);
                let distance = dot(off, multiply(&invert(&spread), off));
                ((1.0 + distance / 5.0).powi(-4) / determinant.sqrt()).max(MIN_LIKELIHOOD)
            };
            let own_step = |own: usize| if labels.is_near { MIDDLE + own } else { MIDDLE - own };
            let row = usize::from(labels.outline);
            let prior = |own: usize| ALPHA_PRIORS[row][own];
            let outlier = if labels.is_near || !has_background { OUTLIER } else { 0.0 };
            let pure = PURE_PRIORS[row] * likelihood(own_step(SIDE - 1)).max(outlier);
            assert!(is_close(evidence.pure[k], pure), "{k}");
            for n in 0..2 {
                let weighted = |step: usize| likelihood(step) * (step as f32 * STEP).powi(n as i32);
                let any = (0..STEPS).map(weighted).sum::<f32>() / STEPS as f32;
                let side = (0..SIDE).map(|own| prior(own) * weighted(own_step(own))).sum();
                assert!(is_close(evidence.any_alpha[n][k], any), "{k} {n}");
                assert!(is_close(evidence.sided[n][k], if labels.is_thin { any } else { side }), "{k} {n}");
            }
        }
        let unused = lanes..LANES;
        assert!(evidence.any_alpha.iter().all(|lanes| lanes[unused.clone()].iter().all(|&value| value == 0.0)));
    }
}

fn is_close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-3 * a.max(b)
}
