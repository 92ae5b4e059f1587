//! Symmetric 3x3 matrices and vectors, for covariances of colours.
//! twin: shaders/matte/contrast.wgsl

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
pub type Symmetric = [f32; 6];

/// Returns the upper triangle of `a` times its transpose (outer product).
#[inline(always)]
pub(super) fn outer_product(a: [f32; 3]) -> Symmetric {
    [a[0] * a[0], a[0] * a[1], a[0] * a[2], a[1] * a[1], a[1] * a[2], a[2] * a[2]]
}

/// Returns the dot product.
#[inline(always)]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns `matrix` times `vector`.
#[inline(always)]
pub(super) fn multiply(&[xx, xy, xz, yy, yz, zz]: &Symmetric, vector: [f32; 3]) -> [f32; 3] {
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| dot(row, vector))
}

/// Returns the inverse, by the adjugate; zeros for a singular matrix.
#[inline(always)]
pub(super) fn invert(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> Symmetric {
    let (a, b, c) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (d, e, f) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let determinant = xx * a + xy * b + xz * c;
    let scale = if determinant > 0.0 { 1.0 / determinant } else { 0.0 };
    [a, b, c, d, e, f].map(|value| scale * value)
}
