//! Hashes and value noise: the only randomness here, so pictures are reproducible.

use glam::Vec3;

/// Returns a well-mixed hash of a number.
pub fn hash(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Returns the hash of `x` as a number in 0..1.
pub fn hash_to_unit(x: u32) -> f32 {
    (hash(x) >> 8) as f32 / (1 << 24) as f32
}

/// Returns the hash of a cell of the plane as a number in 0..1.
pub fn hash_cell(x: i32, y: i32) -> f32 {
    hash_to_unit((x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77))
}

/// A pseudo-random number generator with a seed.
pub struct Rng(u32);

impl Rng {
    /// Creates the generator of `seed`.
    pub fn new(seed: u32) -> Self {
        Self(hash(seed ^ 0x51ab_7e11))
    }

    /// Returns the next number in 0..1.
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        hash_to_unit(self.0)
    }

    /// Returns the next number in `low..high`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    /// Returns a direction, uniformly distributed over the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let y = self.between(-1.0, 1.0);
        let (sin, cos) = (std::f32::consts::TAU * self.next()).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        Vec3::new(r * cos, y, r * sin)
    }
}

/// Returns smooth value noise in 0..1 with cells of size 1.
pub fn value_noise(p: Vec3) -> f32 {
    let floor = p.floor();
    let f = p - floor;
    let w = f * f * (3.0 - 2.0 * f);
    let (x, y, z) = (floor.x as i32 as u32, floor.y as i32 as u32, floor.z as i32 as u32);
    let corner = |dx: u32, dy: u32, dz: u32| {
        hash_to_unit(
            x.wrapping_add(dx).wrapping_mul(0x9e37_79b1)
                ^ y.wrapping_add(dy).wrapping_mul(0x85eb_ca77)
                ^ z.wrapping_add(dz).wrapping_mul(0xc2b2_ae3d),
        )
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), w.x);
    mix(mix(row(0, 0), row(1, 0), w.y), mix(row(0, 1), row(1, 1), w.y), w.z)
}

/// Returns `octaves` of value noise, each twice as fine and half as strong, in 0..1.
pub fn fractal_noise(mut p: Vec3, octaves: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for _ in 0..octaves {
        sum += weight * value_noise(p);
        total += weight;
        weight *= 0.5;
        // Not exactly doubled, and shifted, so that the cells of the octaves do not coincide.
        p = p * 2.03 + Vec3::splat(17.3);
    }
    sum / total
}
