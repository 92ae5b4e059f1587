use super::super::aperture::{Aperture, Shape};
use super::*;

fn bank(shape: Shape, rank: Rank) -> FilterBank {
    FilterBank::new(&Aperture { shape, intensity: 0.0 }.to_mask(MASK_CELLS, 0.2), rank, 10.0)
}

#[test]
fn every_filter_sums_to_one_at_every_radius_and_rank() {
    for shape in [Shape::Disc, Shape::Heart, Shape::Ring { inner: 0.6 }] {
        for rank in [Rank::Terms(1), Rank::Terms(3), Rank::Full] {
            let bank = bank(shape.clone(), rank);
            for node in 0..bank.node_half_width.len() {
                let sum: f32 = bank.kernel(node, false).iter().sum();
                assert!((sum - 1.0).abs() < 1e-4, "{shape:?} {rank:?} {node}: {sum}");
            }
        }
    }
}

#[test]
fn the_full_bank_is_the_area_sampled_aperture() {
    let mask = Aperture::default().to_mask(MASK_CELLS, 0.2);
    let bank = FilterBank::new(&mask, Rank::Full, 10.0);
    for node in [5, 40, 101, 160] {
        let radius_px = node as f64 / f64::from(STEPS_PER_PX) * mask.extent;
        let half_width = bank.node_half_width[node] as i64;
        let side = 2 * half_width + 1;
        // Fraction of the mask's light that falls on each pixel, summed over the mask's cells.
        let mut direct = vec![0.0; (side * side) as usize];
        let (cell, sum) = (2.0 * radius_px / mask.size as f64, mask.sum());
        let overlap = |index: usize| {
            let (from, to) = (index as f64 * cell - radius_px, (index + 1) as f64 * cell - radius_px);
            let border = to.round() + if to.round() > to { -0.5 } else { 0.5 };
            let first = ((border - from) / cell).clamp(0.0, 1.0);
            [(border - 0.5, first), (border + 0.5, 1.0 - first)]
        };
        for (k, value) in mask.values.iter().enumerate() {
            for (y, fraction_y) in overlap(k / mask.size) {
                for (x, fraction_x) in overlap(k % mask.size) {
                    let (x, y) = (x as i64 + half_width, y as i64 + half_width);
                    if fraction_x * fraction_y > 0.0 {
                        direct[(y * side + x) as usize] += value / sum * fraction_x * fraction_y;
                    }
                }
            }
        }
        let kernel = bank.kernel(node, true);
        let peak = direct.iter().copied().fold(0.0, f64::max);
        for (a, b) in kernel.iter().zip(&direct) {
            assert!((f64::from(*a) - b).abs() < 1e-4 * peak, "node {node}: {a} against {b}");
        }
    }
}

#[test]
fn nodes_are_a_sixteenth_of_a_pixel_apart_and_then_a_share_of_the_radius() {
    assert_eq!(node_radius_px(161), 10.0625);
    let mut before_px = -1.0 / STEPS_PER_PX;
    for node in 0..3000 {
        let radius_px = node_radius_px(node);
        let step_px = radius_px - before_px;
        let max_px = (radius_px / OCTAVES_FROM_PX).max(1.0) / STEPS_PER_PX;
        assert!(step_px > max_px / 2.01 && step_px <= max_px, "{radius_px}: {step_px}");
        for aside_px in [-0.49 * step_px, 0.0, 0.24 * step_px] {
            assert_eq!(round_to_node((radius_px + aside_px).max(0.0)), node, "{radius_px} {aside_px}");
        }
        assert_eq!(count_nodes(radius_px), node + 1);
        assert_eq!(count_nodes(radius_px + 0.2 * step_px), node + 2);
        before_px = radius_px;
    }
}

/// The table's size grows linearly with the radius.
#[test]
fn a_table_of_a_wide_blur_is_no_more_than_in_proportion() {
    let taps = |radius_px| {
        let mask = Aperture::default().to_mask(MASK_CELLS, 0.2);
        FilterBank::new(&mask, Rank::Terms(2), radius_px).horizontal.len() as f32
    };
    let (narrow, wide) = (taps(64.0), taps(1024.0));
    assert!(wide < 16.0 * narrow * 2.5, "{narrow} to {wide}");
}

#[test]
fn no_shift_and_the_second_moment_grows_with_the_radius() {
    let bank = bank(Shape::Disc, Rank::Terms(3));
    for node in (32..bank.nodes).step_by(16) {
        let (kernel, half_width) = (bank.kernel(node, false), bank.node_half_width[node] as i64);
        let side = 2 * half_width + 1;
        let moment = |power: i32| -> f64 {
            kernel
                .iter()
                .enumerate()
                .map(|(k, w)| f64::from(*w) * ((k as i64 % side - half_width) as f64).powi(power))
                .sum()
        };
        let radius_px = node as f64 / f64::from(STEPS_PER_PX);
        assert!(moment(1).abs() < 1e-4);
        // A disc of radius R has variance R^2 / 4 per axis; pixels add 1 / 12, the rim and the rank a little.
        assert!((moment(2) / (radius_px * radius_px / 4.0 + 1.0 / 12.0) - 1.0).abs() < 0.05, "{node}");
    }
}

/// A point at any place, downscaled, filtered, and enlarged: how far that is from the aperture at full scale, as a
/// fraction of it.
#[test]
fn at_a_reduced_scale_filter_and_tents_are_near_the_aperture() {
    let mask = Aperture::default().to_mask(MASK_CELLS, 0.2);
    let bank = FilterBank::new(&mask, Rank::Full, 40.0);
    for (scale, coc_px) in [(2, 4.0), (2, 8.0), (2, 16.0), (4, 12.0), (4, 20.0), (8, 26.0), (8, 40.0)] {
        let of = |node: usize| (bank.kernel(node, false), bank.node_half_width[node] as isize);
        let (kernel, reach) = of(bank.first_node(scale) + bank.nearest_node(compensated_radius_px(coc_px, scale)));
        let (aperture, radius) = of(bank.nearest_node(coc_px));
        let s = scale as f32;
        let tent = |pixel: isize, cell: isize| {
            let apart_px = (pixel as f32 + 0.5 - (cell as f32 + 0.5) * s).abs();
            (1.0 - apart_px / s).max(0.0)
        };
        let cells = -(reach + 3)..=reach + 3;
        let (mut apart, mut whole) = (0.0, 0.0);
        for (at_x, at_y) in [(0, 0), (1, 0), (scale as isize / 2, scale as isize - 1)] {
            for y in at_y - radius..=at_y + radius {
                for x in at_x - radius..=at_x + radius {
                    let mut shown = 0.0;
                    let weighted = |pixel: isize, at: isize| -> Vec<(isize, f32)> {
                        // Shift from the cell that a point falls into to the one that a pixel is read from.
                        let pairs = cells.clone().flat_map(|to| (-1..=1).map(move |from| (to, from)));
                        let weigh = |(to, from)| (to - from, tent(pixel, to) * tent(at, from) / s);
                        pairs.map(weigh).filter(|pair| pair.1 > 0.0 && pair.0.abs() <= reach).collect()
                    };
                    let across = weighted(x, at_x);
                    for (down, weight) in weighted(y, at_y) {
                        let row = &kernel[((down + reach) * (2 * reach + 1)) as usize..][..2 * reach as usize + 1];
                        shown += across.iter().map(|(x, w)| row[(x + reach) as usize] * w).sum::<f32>() * weight;
                    }
                    let row = (y - at_y + radius) * (2 * radius + 1);
                    let wanted = aperture[(row + x - at_x + radius) as usize];
                    (apart, whole) = (apart + (shown - wanted).powi(2), whole + wanted * wanted);
                }
            }
        }
        let error = (apart / whole).sqrt();
        assert!(error < 0.58 * s / coc_px, "{coc_px} px, scale {scale}: {error}");
    }
}

#[test]
fn far_content_shows_the_aperture_upright_and_near_content_turns_it() {
    let bank = bank(Shape::Heart, Rank::Terms(8));
    let node = 160;
    let (half_width, side) = (bank.node_half_width[node] as usize, 2 * bank.node_half_width[node] as usize + 1);
    let upper = |kernel: &[f32]| kernel[..half_width * side].iter().sum::<f32>();
    // A kernel that gathers draws a point rotated by 180 degrees: for an upright heart its weight is below.
    assert!(upper(&bank.kernel(node, false)) < 0.45);
    assert!(upper(&bank.kernel(node, true)) > 0.55);
}
