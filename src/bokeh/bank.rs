//! The filter bank: separable 1-D kernels for every radius.
//!
//! The singular functions of an aperture scale with the radius, so a filter tap at full scale is the integral of one of
//! them over a pixel: a difference of two values of its cumulative table. Fractional radii are therefore exact and
//! continuous.

mod reduced;

use super::Rank;
use super::aperture::Mask;
use super::low_rank::Decomposition;
pub use reduced::{EXTRA_TAPS, SPLINE_LEFT, compensated_radius_px};

use reduced::ReducedTaps;

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

/// The separable filters of one aperture, for radii from 0 to a maximum: for full scale, and for reduced scales.
///
/// The filter of node `k`, and of node `nodes + k` for reduced scales, has the radius [`node_radius_px`];
/// `out(p) = sum_t sum_j vertical_t(j) sum_i horizontal_t(i) in(p + (i, j))` (McGraw, *Fast Bokeh Effects Using
/// Low-Rank Linear Filters*, eq. 2), and its taps sum to 1 at every node.
#[derive(Clone, Debug)]
pub struct FilterBank {
    /// Number of separable terms.
    pub terms: usize,
    /// Half-width at the largest radius: taps go from `-half_width` to `half_width`.
    pub half_width: usize,
    /// Number of tabulated radii, of each kind.
    pub nodes: usize,
    /// True if every profile is symmetric, so that taps at `-j` and `j` are equal.
    pub is_symmetric: bool,
    /// Whether the aperture is hollow ([`Mask::is_hollow`]).
    pub is_hollow: bool,
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
        Self::from_decomposition(&Decomposition::new(mask), mask, rank, max_radius_px, true)
    }

    /// Same as [`FilterBank::new`], given the decomposition of `mask`; filters for reduced scales only if they are
    /// `with_reduced`.
    pub fn from_decomposition(
        svd: &Decomposition,
        mask: &Mask,
        rank: Rank,
        max_radius_px: f32,
        with_reduced: bool,
    ) -> Self {
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
        // The vertical taps include the singular values.
        for (profile, sigma) in down.iter_mut().zip(&svd.sigma) {
            profile.iter_mut().for_each(|x| *x *= sigma);
        }

        let nodes = count_nodes(max_radius_px.max(0.0));
        let half_width_at =
            |node: usize| (f64::from(node_radius_px(node)) * mask.extent - 0.5).ceil().max(0.0) as usize;
        let node_half_width: Vec<u32> = [0, EXTRA_TAPS][..1 + usize::from(with_reduced)]
            .iter()
            .flat_map(|extra| (0..nodes).map(move |node| (half_width_at(node) + extra) as u32))
            .collect();
        let half_width = *node_half_width.last().expect("radius 0 is a node") as usize;
        let symmetry = mask.symmetry();
        let taps = node_half_width.len() * (2 * half_width + 1) * terms;
        let mut bank = Self {
            terms,
            half_width,
            nodes,
            is_symmetric: symmetry == (true, true),
            is_hollow: mask.is_hollow(),
            extent: mask.extent,
            node_half_width,
            horizontal: vec![0.0; taps],
            vertical: vec![0.0; taps],
        };
        let reduced = ReducedTaps::new();
        let mut line = vec![0.0; 2 * half_width + 1];
        for node in 0..bank.node_half_width.len() {
            // At radius 0, tap 0 covers the whole profile.
            let radius_px = (f64::from(node_radius_px(node % nodes)) * mask.extent).max(1e-6);
            let reach = bank.node_half_width[node] as usize;
            let (first, mut total) = (bank.tap_index(node, -(reach as isize)), 0.0);
            for t in 0..terms {
                let mut sums = [0.0; 2];
                let tables = [&mut bank.horizontal, &mut bank.vertical];
                for ((profile, table), sum) in [&across[t], &down[t]].into_iter().zip(tables).zip(&mut sums) {
                    let integral = |from: f64, to: f64| {
                        interpolate_cumulative(profile, to / radius_px)
                            - interpolate_cumulative(profile, from / radius_px)
                    };
                    match node < nodes {
                        true => sample_pixels(integral, &mut line[..2 * reach + 1]),
                        false => reduced.sample(integral, &mut line[..2 * reach + 1]),
                    }
                    for (tap, value) in table[first + t..].iter_mut().step_by(terms).zip(&line[..2 * reach + 1]) {
                        *tap = *value as f32;
                        *sum += value;
                    }
                }
                total += sums[0] * sums[1];
            }
            // All taps sum to 1; what is cut off beyond the last one is spread over them.
            let taps = &mut bank.vertical[first..][..(2 * reach + 1) * terms];
            taps.iter_mut().for_each(|tap| *tap = (f64::from(*tap) / total) as f32);
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

    /// Returns the node nearest to a radius in pixels, at full scale.
    #[inline(always)]
    pub fn nearest_node(&self, radius_px: f32) -> usize {
        round_to_node(radius_px).min(self.nodes - 1)
    }

    /// Whether there are filters for reduced scales.
    pub fn has_reduced(&self) -> bool {
        self.node_half_width.len() > self.nodes
    }

    /// Whether filters keep the aperture's shape at radii of two pixels of a reduced scale.
    pub fn fits_coarse_scales(&self) -> bool {
        self.has_reduced() && !self.is_hollow
    }

    /// Returns the first node of the filters for a scale.
    #[inline(always)]
    pub fn first_node(&self, scale: usize) -> usize {
        if scale > 1 && self.has_reduced() { self.nodes } else { 0 }
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

/// Fills `taps` of full scale, centred on 0, from the `integral` of a profile between two places, in pixels.
fn sample_pixels(integral: impl Fn(f64, f64) -> f64, taps: &mut [f64]) {
    let reach = (taps.len() / 2) as f64;
    for (j, tap) in taps.iter_mut().enumerate() {
        let x = j as f64 - reach;
        *tap = integral(x - 0.5, x + 0.5);
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
mod tests;
