//! Truncated singular value decomposition of an aperture (McGraw, eq. 1 and 2).

use super::aperture::Mask;

/// The singular value decomposition of a mask: `mask = sum_i sigma_i u_i v_i^T`, sigma descending.
#[derive(Clone, Debug)]
pub struct Decomposition {
    /// Rows and columns of the mask.
    pub size: usize,
    /// Singular values, descending, `size` of them.
    pub sigma: Vec<f64>,
    /// Left singular vectors (vertical), one row of `size` values each.
    pub u: Vec<f64>,
    /// Right singular vectors (horizontal), one row of `size` values each.
    pub v: Vec<f64>,
}

impl Decomposition {
    /// Decomposes a mask (one-sided Jacobi).
    pub fn of(_mask: &Mask) -> Self {
        unimplemented!()
    }

    /// The sum of the first `rank` terms: `size * size` values, row-major, not renormalised.
    pub fn approximation(&self, _rank: usize) -> Vec<f64> {
        unimplemented!()
    }

    /// Relative Frobenius error of the first `rank` terms: `sqrt(sum_{i>rank} sigma_i^2 / sum sigma_i^2)`.
    pub fn relative_error(&self, _rank: usize) -> f64 {
        unimplemented!()
    }
}
