// Included by passes that compare colours: symmetric 3 x 3 matrices, and Fisher's linear discriminant between two
// surfaces.
// twin: src/depth/matting/contrast.rs and symmetric.rs

// A symmetric matrix: xx, xy, xz; yy, yz, zz.
struct Symmetric {
    row: vec3<f32>,
    rest: vec3<f32>,
}

// Mean and covariance of a surface's colours in linear light.
struct Color {
    mean: vec3<f32>,
    row: vec3<f32>,
    rest: vec3<f32>,
}

fn multiply(m: Symmetric, v: vec3<f32>) -> vec3<f32> {
    let middle = vec3(m.row.y, m.rest.xy);
    return vec3(dot(m.row, v), dot(middle, v), dot(vec3(m.row.z, m.rest.yz), v));
}

// Inverse by the adjugate; zeros for a singular matrix.
fn invert(m: Symmetric) -> Symmetric {
    let row = vec3(
        m.rest.x * m.rest.z - m.rest.y * m.rest.y,
        m.row.z * m.rest.y - m.row.y * m.rest.z,
        m.row.y * m.rest.y - m.row.z * m.rest.x,
    );
    let rest = vec3(
        m.row.x * m.rest.z - m.row.z * m.row.z,
        m.row.y * m.row.z - m.row.x * m.rest.y,
        m.row.x * m.rest.x - m.row.y * m.row.y,
    );
    let determinant = dot(m.row, row);
    let scale = select(0.0, 1.0 / determinant, determinant > 0.0);
    return Symmetric(scale * row, scale * rest);
}

// Regularised covariance: `kept` of it, plus an isotropic part, since covariances of few pixels are too narrow.
fn regularize(m: Symmetric, kept: f32) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (m.row.x + m.rest.x + m.rest.z) + QUANTISATION;
    return Symmetric(kept * m.row + vec3(floor, 0.0, 0.0), kept * m.rest + vec3(floor, 0.0, floor));
}

// Inverse of the within-class scatter, the sum of both covariances.
fn inverse_scatter(near: Color, far: Color) -> Symmetric {
    return invert(regularize(Symmetric(near.row + far.row, near.rest + far.rest), 1.0 - SHRINKAGE));
}

// Alpha of a colour, from below 0 to above 1, along the discriminant of both surfaces.
fn discriminant_alpha(near: Color, far: Color, light: vec3<f32>) -> f32 {
    let difference = near.mean - far.mean;
    let product = multiply(inverse_scatter(near, far), difference);
    return dot(product, light - far.mean) / max(dot(product, difference), 1e-9);
}

// Whether the light is plausible for the far surface, by its Mahalanobis distance.
fn is_plausible_far(far: Color, light: vec3<f32>) -> bool {
    let off = light - far.mean;
    return dot(off, multiply(invert(regularize(Symmetric(far.row, far.rest), 1.0)), off)) < MAX_DEVIATION * MAX_DEVIATION;
}
