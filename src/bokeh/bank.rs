//! The filter bank: separable 1-D kernels for every radius.
//!
//! The singular functions of an aperture scale with the radius, so a filter tap is the integral of one of them over a
//! pixel: a difference of two values of its cumulative table. Fractional radii are therefore exact and continuous.

use super::Rank;
use super::aperture::Mask;
use super::low_rank::Decomposition;

/// Nodes per pixel of radius, up to twice [`OCTAVES_FROM_PX`].
pub const STEPS_PER_PX: f32 = 16.0;

/// From this radius on, every octave has the same number of nodes, so that a step is a constant fraction of the radius:
/// the table grows linearly with the largest radius, not with its square. A power of two.
pub const OCTAVES_FROM_PX: f32 = 16.0;

/// Nodes of an octave; the first octave continues the step of [`STEPS_PER_PX`].
const NODES_PER_OCTAVE: usize = (OCTAVES_FROM_PX * STEPS_PER_PX) as usize;
/// Right shift that leaves the bits of a float that give the node within its octave.
pub const OCTAVE_SHIFT: u32 = f32::MANTISSA_DIGITS - 1 - NODES_PER_OCTAVE.ilog2();

/// Side of the mask that a bank is made from, in cells.
pub const MASK_CELLS: usize = 128;

/// The separable filters of one aperture, for radii from 0 to a maximum.
///
/// The filter of node `k` has the radius [`node_radius_px`];
/// `out(p) = sum_t sum_j vertical_t(j) sum_i horizontal_t(i) in(p + (i, j))` (McGraw, *Fast Bokeh Effects Using
/// Low-Rank Linear Filters*, eq. 2), and its taps sum to 1 at every node.
#[derive(Clone, Debug)]
pub struct FilterBank {
    /// Number of separable terms.
    pub terms: usize,
    /// Half-width at the largest radius: taps go from `-half_width` to `half_width`.
    pub half_width: usize,
    /// Number of tabulated radii.
    pub nodes: usize,
    /// True if every profile is symmetric, so that taps at `-j` and `j` are equal.
    pub is_symmetric: bool,
    /// Distance of the aperture's outermost point from the centre, in radii.
    pub extent: f64,
    /// Half-width of each node: its outermost tap.
    pub node_half_width: Vec<u32>,
    /// Horizontal taps, `[node][half_width + j][term]`, for content behind the focal plane.
    pub horizontal: Vec<f32>,
    /// Vertical taps in the same layout, with singular values and normalisation included.
    pub vertical: Vec<f32>,
}

impl FilterBank {
    /// Creates the bank of a mask for radii up to `max_radius_px`.
    pub fn new(mask: &Mask, rank: Rank, max_radius_px: f32) -> Self {
        Self::from_decomposition(&Decomposition::new(mask), mask, rank, max_radius_px)
    }

    /// Same as [`FilterBank::new`], given the decomposition of `mask`.
    pub fn from_decomposition(svd: &Decomposition, mask: &Mask, rank: Rank, max_radius_px: f32) -> Self {
        let terms = match rank {
            Rank::Terms(n) => (n as usize).clamp(1, svd.numerical_rank()),
            Rank::Full => svd.numerical_rank(),
        };
        let n = svd.size;
        // Gathering with a tap at +j draws the aperture rotated by 180 degrees; reversed profiles draw it upright.
        let cumulate = |profile: &[f64]| -> Vec<f64> {
            std::iter::once(0.0)
                .chain(profile.iter().rev().scan(0.0, |sum, x| {
                    *sum += x;
                    Some(*sum)
                }))
                .collect()
        };
        let across: Vec<_> = (0..terms).map(|t| cumulate(&svd.v[t * n..][..n])).collect();
        let mut down: Vec<_> = (0..terms).map(|t| cumulate(&svd.u[t * n..][..n])).collect();
        // The vertical taps include the singular values and the normalisation of all taps to sum 1.
        let total: f64 = (0..terms).map(|t| svd.sigma[t] * across[t][n] * down[t][n]).sum();
        for (t, profile) in down.iter_mut().enumerate() {
            profile.iter_mut().for_each(|x| *x *= svd.sigma[t] / total);
        }

        let nodes = count_nodes(max_radius_px.max(0.0));
        let half_width_at = |node: usize| (f64::from(node_radius_px(node)) * mask.extent - 0.5).ceil().max(0.0);
        let half_width = half_width_at(nodes - 1) as usize;
        let symmetry = mask.symmetry();
        let mut bank = Self {
            terms,
            half_width,
            nodes,
            is_symmetric: symmetry == (true, true),
            extent: mask.extent,
            node_half_width: (0..nodes).map(|k| half_width_at(k) as u32).collect(),
            horizontal: Vec::with_capacity(nodes * (2 * half_width + 1) * terms),
            vertical: Vec::with_capacity(nodes * (2 * half_width + 1) * terms),
        };
        for node in 0..nodes {
            // At radius 0, tap 0 covers the whole profile.
            let radius_px = (f64::from(node_radius_px(node)) * mask.extent).max(1e-6);
            for j in -(half_width as i64)..=half_width as i64 {
                let (left, right) = ((j as f64 - 0.5) / radius_px, (j as f64 + 0.5) / radius_px);
                for t in 0..terms {
                    bank.horizontal.push(
                        (interpolate_cumulative(&across[t], right) - interpolate_cumulative(&across[t], left)) as f32,
                    );
                    bank.vertical.push(
                        (interpolate_cumulative(&down[t], right) - interpolate_cumulative(&down[t], left)) as f32,
                    );
                }
            }
        }
        bank
    }

    /// Returns the index of the first term of tap `j` of `node` in [`FilterBank::horizontal`] and
    /// [`FilterBank::vertical`].
    #[inline(always)]
    pub fn tap_index(&self, node: usize, j: isize) -> usize {
        (node * (2 * self.half_width + 1) + (self.half_width as isize + j) as usize) * self.terms
    }

    /// Returns the largest tabulated radius, in pixels.
    pub fn max_radius_px(&self) -> f32 {
        node_radius_px(self.nodes - 1)
    }

    /// Returns the node nearest to a radius in pixels.
    #[inline(always)]
    pub fn nearest_node(&self, radius_px: f32) -> usize {
        round_to_node(radius_px).min(self.nodes - 1)
    }

    /// Returns the 2-D kernel of a node: `(2 r + 1)^2` taps with `r = node_half_width[node]`, row-major. With `turned`,
    /// the aperture is rotated by 180 degrees, as content in front of the focal plane shows it.
    pub fn kernel(&self, node: usize, turned: bool) -> Vec<f32> {
        let half_width = self.node_half_width[node] as isize;
        let sign = if turned { -1 } else { 1 };
        let at = |taps: &[f32], j: isize, t: usize| f64::from(taps[self.tap_index(node, sign * j) + t]);
        let range = move || -half_width..=half_width;
        range()
            .flat_map(|y| range().map(move |x| (x, y)))
            .map(|(x, y)| (0..self.terms).map(|t| at(&self.horizontal, x, t) * at(&self.vertical, y, t)).sum::<f64>())
            .map(|tap| tap as f32)
            .collect()
    }
}

/// Returns the radius of a node, in pixels.
pub fn node_radius_px(node: usize) -> f32 {
    match node.checked_sub(NODES_PER_OCTAVE) {
        None => node as f32 / STEPS_PER_PX,
        Some(above) => f32::from_bits(OCTAVES_FROM_PX.to_bits() + ((above as u32) << OCTAVE_SHIFT)),
    }
}

/// Returns the node nearest to a radius >= 0 in pixels. The bits of a float are linear within each octave.
#[inline(always)]
fn round_to_node(radius_px: f32) -> usize {
    if radius_px < OCTAVES_FROM_PX {
        return (radius_px * STEPS_PER_PX + 0.5) as usize;
    }
    let above = radius_px.to_bits() - OCTAVES_FROM_PX.to_bits() + (1 << (OCTAVE_SHIFT - 1));
    NODES_PER_OCTAVE + (above >> OCTAVE_SHIFT) as usize
}

/// Returns the number of nodes needed to cover a radius.
fn count_nodes(radius_px: f32) -> usize {
    let node = round_to_node(radius_px);
    node + 1 + usize::from(node_radius_px(node) < radius_px)
}

/// Returns the cumulative profile at `x` in [-1, 1], linear between its nodes, constant outside.
fn interpolate_cumulative(cumulative: &[f64], x: f64) -> f64 {
    let last = cumulative.len() - 1;
    let at = ((x + 1.0) * 0.5 * last as f64).clamp(0.0, last as f64);
    let index = (at as usize).min(last - 1);
    let fraction = at - index as f64;
    cumulative[index] * (1.0 - fraction) + cumulative[index + 1] * fraction
}

#[cfg(test)]
mod tests {
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
                for node in 0..bank.nodes {
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
}
