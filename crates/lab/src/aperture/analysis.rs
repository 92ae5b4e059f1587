//! A kernel and the errors of its low-rank approximations.

use serde::Serialize;

use bokehcam::bokeh::aperture::Mask;
use bokehcam::bokeh::low_rank::Decomposition;

/// Largest rank of the error curves.
const LAST_PLOTTED_RANK: usize = 16;

/// A kernel of unit sum, with its approximations.
pub struct Analysis {
    /// The aperture as a setting.
    pub name: String,
    /// Rows and columns of the kernel.
    pub size: usize,
    /// `size * size` taps, row-major, their sum 1.
    pub kernel: Vec<f64>,
    /// The largest tap, to which errors are relative.
    pub plateau: f64,
    /// One per requested rank.
    pub approximations: Vec<Approximation>,
    /// `sqrt(sum_{i>r} sigma_i^2 / sum sigma_i^2)` for r = 1, 2, ...
    pub truncation_errors: Vec<f64>,
    /// Singular values in descending order.
    pub sigma: Vec<f64>,
    /// Number of singular values above rounding errors.
    pub numerical_rank: usize,
}

/// The kernel from its first terms, normalised to unit sum.
pub struct Approximation {
    /// Terms of the sum.
    pub rank: usize,
    /// `size * size` taps, row-major, their sum 1.
    pub taps: Vec<f64>,
    /// The errors relative to the kernel.
    pub errors: RankErrors,
}

/// The errors of an approximation.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RankErrors {
    rank: usize,
    /// Frobenius norm of the difference over that of the kernel, both of unit sum.
    relative_error: f64,
    /// Relative error before normalisation to unit sum: the tail of the singular values.
    truncation_error: f64,
    /// Largest absolute difference over the kernel's largest tap.
    largest_error: f64,
    /// Most negative tap over the kernel's largest tap; 0 without negative taps.
    most_negative_tap: f64,
}

impl Analysis {
    /// Decomposes a mask and rebuilds it with each of `ranks`.
    pub fn new(name: String, mask: &Mask, ranks: &[usize]) -> Self {
        let svd = Decomposition::new(mask);
        let kernel = normalize_sum(&mask.values);
        let plateau = kernel.iter().copied().fold(0.0, f64::max);
        let approximations = ranks
            .iter()
            .map(|&rank| {
                let taps = normalize_sum(&svd.approximation(rank));
                let errors = RankErrors::measure(&kernel, &taps, plateau, rank, svd.relative_error(rank));
                Approximation { rank, taps, errors }
            })
            .collect();
        Self {
            name,
            size: mask.size,
            plateau,
            approximations,
            truncation_errors: (1..=LAST_PLOTTED_RANK.min(mask.size)).map(|rank| svd.relative_error(rank)).collect(),
            numerical_rank: svd.numerical_rank(),
            sigma: svd.sigma,
            kernel,
        }
    }
}

impl RankErrors {
    /// Compares the approximation `taps` with `kernel`, both of unit sum; `plateau` is the largest tap of the kernel.
    fn measure(kernel: &[f64], taps: &[f64], plateau: f64, rank: usize, truncation_error: f64) -> Self {
        let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
        let difference = || kernel.iter().zip(taps).map(|(exact, tap)| tap - exact);
        Self {
            rank,
            relative_error: norm(&mut difference()) / norm(&mut kernel.iter().copied()),
            truncation_error,
            largest_error: difference().map(f64::abs).fold(0.0, f64::max) / plateau,
            most_negative_tap: taps.iter().copied().fold(0.0, f64::min) / plateau,
        }
    }
}

fn normalize_sum(taps: &[f64]) -> Vec<f64> {
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| tap / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::bokeh::aperture::Aperture;

    #[test]
    fn a_disc_has_the_published_errors() {
        // Antialiased disc of 65 taps: 30.6, 20.3, 15.6 and 12.7 % at rank 1 to 4, lobes of -0.26 and -0.20.
        let analysis = Analysis::new("disc".into(), &Aperture::default().to_mask(65, 0.0), &[1, 2, 3, 4]);
        for (approximation, percent) in analysis.approximations.iter().zip([30.6, 20.3, 15.6, 12.7]) {
            let errors = approximation.errors;
            assert!((errors.truncation_error * 100.0 - percent).abs() < 0.3, "{errors:?}");
            assert!(errors.relative_error >= errors.truncation_error * 0.99, "{errors:?}");
            assert!((approximation.taps.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let lobes: Vec<f64> = analysis.approximations.iter().map(|a| a.errors.most_negative_tap).collect();
        assert!(lobes[0] == 0.0 && (lobes[1] + 0.26).abs() < 0.02 && (lobes[2] + 0.20).abs() < 0.02, "{lobes:?}");
    }
}
