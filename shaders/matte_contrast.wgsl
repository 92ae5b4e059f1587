// Shared by the passes that compare colours: symmetric matrices, and how the colours of two surfaces differ.

// The upper triangle of a matrix: xx, xy, xz; yy, yz, zz.
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

fn times(m: Symmetric, v: vec3<f32>) -> vec3<f32> {
    let middle = vec3(m.row.y, m.rest.xy);
    return vec3(dot(m.row, v), dot(middle, v), dot(vec3(m.row.z, m.rest.yz), v));
}

// The inverse, by the adjugate; of a matrix that has none, zeros.
fn inverted(m: Symmetric) -> Symmetric {
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

// A covariance of few pixels, a share of it kept, with what goes evenly into all directions.
fn widened(m: Symmetric, kept: f32) -> Symmetric {
    let floor = SHRINKAGE / 3.0 * (m.row.x + m.rest.x + m.rest.z) + QUANTISATION;
    return Symmetric(kept * m.row + vec3(floor, 0.0, 0.0), kept * m.rest + vec3(floor, 0.0, floor));
}

// The inverse of what both surfaces' colours vary by.
fn spread_of(near: Color, far: Color) -> Symmetric {
    return inverted(widened(Symmetric(near.row + far.row, near.rest + far.rest), 1.0 - SHRINKAGE));
}

// A colour's product with `direction`, less `offset`, is the share of the near surface; `certainty` is the reciprocal variance
// of that over the pixels of one surface.
struct Discriminant {
    direction: vec3<f32>,
    offset: f32,
    certainty: f32,
}

fn discriminant_of(near: vec3<f32>, spread: Symmetric, far: vec3<f32>) -> Discriminant {
    let difference = near - far;
    let product = times(spread, difference);
    let contrast = max(dot(product, difference), 1e-9);
    let direction = product / contrast;
    return Discriminant(direction, dot(direction, far), min(2.0 * contrast, MOST_CERTAINTY));
}

fn share_of(d: Discriminant, light: vec3<f32>) -> f32 {
    return dot(d.direction, light) - d.offset;
}

// Whether the far surface may have this light.
fn is_like(far: Color, light: vec3<f32>) -> bool {
    let off = light - far.mean;
    return dot(off, times(inverted(widened(Symmetric(far.row, far.rest), 1.0)), off)) < MOST_DEVIATION * MOST_DEVIATION;
}
