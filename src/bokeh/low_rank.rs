//! Truncated singular value decomposition of an aperture.
//!
//! T. McGraw, *Fast Bokeh Effects Using Low-Rank Linear Filters*, eq. 1 and 2: a kernel `K = U S V^T` cut to its
//! `r` largest singular values is a sum of `r` separable filters, `K ~ sum_i sigma_i u_i v_i^T`.

use super::aperture::Mask;

/// The singular value decomposition of a mask.
#[derive(Clone, Debug)]
pub struct Decomposition {
    /// Rows and columns of the mask.
    pub size: usize,
    /// `size` singular values, descending.
    pub sigma: Vec<f64>,
    /// Left singular vectors (vertical profiles), one row of `size` values each, unit length.
    pub u: Vec<f64>,
    /// Right singular vectors (horizontal profiles), one row of `size` values each, unit length.
    pub v: Vec<f64>,
}

/// Columns whose cosine is below this count as orthogonal.
const ORTHOGONAL: f64 = 1e-13;
/// Safeguard only: Jacobi rotations converge quadratically, in far fewer sweeps.
const MAX_SWEEPS: usize = 40;
/// Singular values below this fraction of the largest are rounding noise and are set to 0, with their vectors.
const NOISE: f64 = 1e-15;

impl Decomposition {
    /// Decomposes a mask by one-sided Jacobi rotations (Hestenes): short, and accurate to rounding. Along a
    /// mirror-symmetric axis only half of the mask is decomposed, each value with double weight: a symmetric mask has
    /// symmetric singular vectors.
    pub fn new(mask: &Mask) -> Self {
        let n = mask.size;
        let fold = |mirrored: bool| if mirrored { n.div_ceil(2) } else { n };
        let (across, down) = mask.symmetry();
        let (columns, rows) = (fold(across), fold(down));
        // Weight sqrt(2) of mirrored rows and columns keeps the norms; the middle one has no mirror image.
        let weight = |k: usize, mirrored: bool| if mirrored && 2 * k + 1 != n { 2f64.sqrt() } else { 1.0 };
        let at = |column: usize, row: usize| mask.values[row * n + column] * weight(column, across) * weight(row, down);
        // Row i of `work` is column i of the mask; rotating rows against each other makes them orthogonal.
        let folded: Vec<f64> = (0..columns * rows).map(|k| at(k / rows, k % rows)).collect();
        let mut work = folded.clone();
        // Rows this small are rounding noise (singular value 0); rotating them against each other would never end.
        let floor = dot(&work, &work) * 1e-30;
        for _ in 0..MAX_SWEEPS {
            let mut rotated = false;
            for i in 0..columns {
                for j in i + 1..columns {
                    rotated |= orthogonalise(&mut work, rows, i, j, floor);
                }
            }
            if !rotated {
                break;
            }
        }
        // Row i of `work` is now sigma_i u_i.
        let mut order: Vec<(usize, f64)> = work.chunks(rows).map(|row| dot(row, row).sqrt()).enumerate().collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let noise = order[0].1 * NOISE;
        let mut result = Self { size: n, sigma: vec![0.0; n], u: vec![0.0; n * n], v: vec![0.0; n * n] };
        let unfold = |vector: &mut [f64], mirrored: bool, half: &dyn Fn(usize) -> f64| {
            for (k, value) in vector.iter_mut().enumerate() {
                let k = if mirrored { k.min(n - 1 - k) } else { k };
                *value = half(k) / weight(k, mirrored);
            }
        };
        for (term, (i, sigma)) in order.into_iter().take_while(|(_, sigma)| *sigma > noise).enumerate() {
            let scaled = &work[i * rows..][..rows];
            result.sigma[term] = sigma;
            unfold(&mut result.u[term * n..][..n], down, &|row| scaled[row] / sigma);
            // The mask's transpose turns u_i into sigma_i v_i.
            unfold(&mut result.v[term * n..][..n], across, &|column| {
                dot(&folded[column * rows..][..rows], scaled) / (sigma * sigma)
            });
        }
        result
    }

    /// Returns the sum of the first `rank` terms: `size * size` values, row-major, not renormalised.
    pub fn approximation(&self, rank: usize) -> Vec<f64> {
        let n = self.size;
        let mut sum = vec![0.0; n * n];
        for i in 0..rank.min(n) {
            for (row, out) in sum.chunks_mut(n).enumerate() {
                let left = self.sigma[i] * self.u[i * n + row];
                out.iter_mut().zip(&self.v[i * n..][..n]).for_each(|(out, right)| *out += left * right);
            }
        }
        sum
    }

    /// Returns the relative Frobenius error of the first `rank` terms: `sqrt(sum_{i>rank} sigma_i^2 / sum sigma_i^2)`.
    pub fn relative_error(&self, rank: usize) -> f64 {
        let square = |s: &[f64]| s.iter().map(|x| x * x).sum::<f64>();
        (square(&self.sigma[rank.min(self.size)..]) / square(&self.sigma)).sqrt()
    }

    /// Returns the number of terms above the rounding of the `f32` filters, at least 1.
    pub fn numerical_rank(&self) -> usize {
        self.sigma.iter().take_while(|&&s| s > 1e-7 * self.sigma[0]).count().max(1)
    }
}

/// Rotates rows `i < j` of `work` (`n` values each) to be orthogonal (Jacobi rotation). Returns false if they already
/// are, or if their dot product is at most `floor`.
fn orthogonalise(work: &mut [f64], n: usize, i: usize, j: usize, floor: f64) -> bool {
    let (head, tail) = work.split_at_mut(j * n);
    let (a, b) = (&mut head[i * n..][..n], &mut tail[..n]);
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    if ab * ab <= ORTHOGONAL * ORTHOGONAL * aa * bb || ab * ab <= floor * floor {
        return false;
    }
    // Smaller root of t^2 + 2 zeta t - 1 = 0: the angle is at most 45 degrees, for which the sweeps converge.
    let zeta = (bb - aa) / (2.0 * ab);
    let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = cosine * tangent;
    for (x, y) in a.iter_mut().zip(b) {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    }
    true
}

/// Dot product with several accumulators, which hides the latency of the additions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const SUMS: usize = 8;
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
    let mut sums = [0.0; SUMS];
    for (x, y) in a.iter().zip(b) {
        (0..SUMS).for_each(|k| sums[k] += x[k] * y[k]);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::super::aperture::{Aperture, Shape};
    use super::*;

    #[test]
    fn every_term_together_is_the_kernel() {
        let turned = Shape::Polygon { blades: 5, rotation_deg: 13.0, curvature: 0.0 };
        for shape in [Shape::Disc, Shape::Heart, Shape::Star { points: 5 }, Shape::Ring { inner: 0.5 }, turned] {
            let mask = Aperture { shape, intensity: 0.0 }.to_mask(33, 0.1);
            let svd = Decomposition::new(&mask);
            let full = svd.approximation(mask.size);
            let worst = mask.values.iter().zip(&full).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-12, "{worst}");
        }
    }

    #[test]
    fn vectors_are_orthonormal_with_and_without_mirror_images() {
        let hexagon = |rotation_deg| Shape::Polygon { blades: 6, rotation_deg, curvature: 0.1 };
        for shape in [Shape::Disc, Shape::Heart, hexagon(0.0), hexagon(13.0)] {
            for size in [40, 41] {
                let mask = Aperture { shape: shape.clone(), intensity: 0.0 }.to_mask(size, 0.1);
                let svd = Decomposition::new(&mask);
                assert!(svd.sigma.is_sorted_by(|a, b| a >= b));
                for vectors in [&svd.u, &svd.v] {
                    let row = |i: usize| &vectors[i * size..][..size];
                    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
                        let wanted = f64::from(u8::from(i == j));
                        assert!((dot(row(i), row(j)) - wanted).abs() < 1e-10, "{shape:?} {size} {i} {j}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_error_by_rank_is_the_tail_of_the_singular_values() {
        let mask = Aperture::default().to_mask(33, 0.0);
        let svd = Decomposition::new(&mask);
        let size = mask.values.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut last = 1.0;
        for rank in 1..12 {
            let approximation = svd.approximation(rank);
            let error = mask.values.iter().zip(&approximation).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            assert!((error / size - svd.relative_error(rank)).abs() < 1e-10);
            assert!(svd.relative_error(rank) < last);
            last = svd.relative_error(rank);
        }
    }

    #[test]
    fn the_disc_has_the_known_spectrum() {
        // Eigenvalues of the operator on [-1, 1] with kernel [x^2 + y^2 <= 1]; a cell is 2 / size wide.
        let svd = Decomposition::new(&Aperture::default().to_mask(128, 0.0));
        for (sigma, known) in svd.sigma.iter().zip([1.6802, 0.4045, 0.2310, 0.1618, 0.1245]) {
            assert!((sigma * 2.0 / 128.0 - known).abs() < 2e-3, "{} against {known}", sigma * 2.0 / 128.0);
        }
    }

    #[test]
    fn small_discs_are_exactly_low_rank() {
        let rank_at = |d: usize| Decomposition::new(&Aperture::default().to_mask(d, 0.0)).numerical_rank();
        assert_eq!((rank_at(9), rank_at(17)), (4, 6));
    }
}
