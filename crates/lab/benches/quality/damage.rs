//! Depth maps with the errors of real sensors.

use super::picture::Plane;
use super::texture::Rng;

/// The error of a depth map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// Normal noise of 0.8 px CoC, correlated over 2 px.
    Noise,
    /// Near objects are dilated by 3 px.
    Fat,
    /// A quarter of the resolution, up again bilinearly.
    Coarse,
    /// 5 % of the pixels are unknown, in blots, half of them at depth edges.
    Holes,
    /// All of these together.
    All,
}

/// Standard deviation of the noise, in pixels of CoC.
const NOISE_PX: f32 = 0.8;
/// Standard deviation of the Gaussian that correlates the noise, in pixels.
const CORRELATION_PX: f32 = 2.0;
/// Dilation of near objects, in pixels.
const FAT_PX: i32 = 3;
/// Downsampling factor in each direction.
const COARSE: usize = 4;
/// Fraction of pixels that become unknown.
const HOLES: f32 = 0.05;
/// Difference in CoC between neighbours that counts as an edge, in pixels.
const EDGE_PX: f32 = 1.0;

impl Damage {
    /// All kinds.
    pub const KINDS: [Damage; 5] = [Damage::Noise, Damage::Fat, Damage::Coarse, Damage::Holes, Damage::All];

    /// Returns the name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Damage::Noise => "noise",
            Damage::Fat => "fat",
            Damage::Coarse => "coarse",
            Damage::Holes => "holes",
            Damage::All => "all",
        }
    }

    /// Returns the damaged CoC, and whether each pixel is known.
    pub fn apply(self, coc_px: &Plane<f32>, seed: u64) -> (Plane<f32>, Plane<bool>) {
        let is = |damage| self == damage || self == Damage::All;
        let mut damaged = coc_px.clone();
        if is(Damage::Fat) {
            damaged = fatten_foreground(&damaged);
        }
        if is(Damage::Coarse) {
            damaged = resample_coarse(&damaged);
        }
        if is(Damage::Noise) {
            let noise = correlated_noise(damaged.width, damaged.height, seed);
            damaged.data.iter_mut().zip(noise.data).for_each(|(c, noise)| *c += noise);
        }
        let known = if is(Damage::Holes) { mark_known_pixels(coc_px, seed) } else { coc_px.map(|_| true) };
        (damaged, known)
    }
}

/// Returns normal noise, correlated, with the standard deviation [`NOISE_PX`].
pub fn correlated_noise(width: usize, height: usize, seed: u64) -> Plane<f32> {
    let mut rng = Rng::new(seed);
    let white = Plane { width, height, data: (0..width * height).map(|_| rng.normal()).collect::<Vec<_>>() };
    let reach = (3.0 * CORRELATION_PX) as i32;
    let taps: Vec<(i32, f32)> =
        (-reach..=reach).map(|d| (d, (-0.5 * (d as f32 / CORRELATION_PX).powi(2)).exp())).collect();
    // The filter reduces the variance of independent values by this factor, along each axis.
    let scale = 1.0 / taps.iter().map(|tap| tap.1 * tap.1).sum::<f32>();
    let along = |of: &Plane<f32>, dx: i32, dy: i32| {
        Plane::from_fn(width, height, |x, y| {
            taps.iter().map(|&(d, tap)| tap * of.at(x as i32 + d * dx, y as i32 + d * dy)).sum::<f32>()
        })
    };
    along(&along(&white, 1, 0), 0, 1).map(|value| value * scale * NOISE_PX)
}

fn fatten_foreground(coc_px: &Plane<f32>) -> Plane<f32> {
    let nearest = |of: &Plane<f32>, dx: i32, dy: i32| {
        Plane::from_fn(of.width, of.height, |x, y| {
            (-FAT_PX..=FAT_PX).map(|d| of.at(x as i32 + d * dx, y as i32 + d * dy)).fold(f32::INFINITY, f32::min)
        })
    };
    nearest(&nearest(coc_px, 1, 0), 0, 1)
}

fn resample_coarse(coc_px: &Plane<f32>) -> Plane<f32> {
    let (width, height) = (coc_px.width.div_ceil(COARSE), coc_px.height.div_ceil(COARSE));
    let half = COARSE / 2;
    let small = Plane::from_fn(width, height, |x, y| coc_px.at((x * COARSE + half) as i32, (y * COARSE + half) as i32));
    Plane::from_fn(coc_px.width, coc_px.height, |x, y| {
        let place = |at: usize| (at as f32 - half as f32) / COARSE as f32;
        let (u, v) = (place(x), place(y));
        let (column, row) = (u.floor(), v.floor());
        let (fu, fv, column, row) = (u - column, v - row, column as i32, row as i32);
        let across = |row| small.at(column, row) * (1.0 - fu) + small.at(column + 1, row) * fu;
        across(row) * (1.0 - fv) + across(row + 1) * fv
    })
}

/// Returns whether the 3x3 neighbourhood of a pixel contains an edge.
pub fn is_edge(coc_px: &Plane<f32>, x: i32, y: i32) -> bool {
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).map(|(dx, dy)| coc_px.at(x + dx, y + dy));
    let (low, high) = around.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
    high - low > EDGE_PX
}

/// Returns which pixels are known.
fn mark_known_pixels(coc_px: &Plane<f32>, seed: u64) -> Plane<bool> {
    let (width, height) = (coc_px.width as i32, coc_px.height as i32);
    let mut rng = Rng::new(seed ^ 0x00C0_FFEE);
    let mut known = coc_px.map(|_| true);
    let edges: Vec<(i32, i32)> =
        (0..width * height).map(|k| (k % width, k / width)).filter(|&(x, y)| is_edge(coc_px, x, y)).collect();
    let mut left = (HOLES * known.data.len() as f32) as usize;
    let mut at_edge = false;
    while left > 0 {
        at_edge = !at_edge && !edges.is_empty();
        let (x, y) = if at_edge {
            edges[(rng.next() * edges.len() as f32) as usize]
        } else {
            ((rng.next() * width as f32) as i32, (rng.next() * height as f32) as i32)
        };
        let radius = rng.between(2.0, 6.0) as i32;
        for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
            let (x, y) = (x + dx, y + dy);
            if dx * dx + dy * dy <= radius * radius && (0..width).contains(&x) && (0..height).contains(&y) {
                let pixel = &mut known.data[(y * width + x) as usize];
                left = left.saturating_sub(usize::from(*pixel));
                *pixel = false;
            }
        }
    }
    known
}

/// Fills unknown pixels (0) with the value of the nearest known one, by two chamfer sweeps (Borgefors 1986).
pub fn fill_from_nearest(metres: &Plane<f32>) -> Plane<f32> {
    const FAR: f32 = 1e9;
    let (width, height) = (metres.width as i32, metres.height as i32);
    let mut filled = metres.map(|z_m| (z_m, if z_m > 0.0 && z_m.is_finite() { 0.0 } else { FAR }));
    let mut sweep = |neighbours: [(i32, i32, f32); 4], from_the_end: bool| {
        for k in 0..width * height {
            let k = if from_the_end { width * height - 1 - k } else { k };
            let (x, y) = (k % width, k / width);
            for (dx, dy, step) in neighbours {
                if (0..width).contains(&(x + dx)) && (0..height).contains(&(y + dy)) {
                    let (z_m, distance) = filled.at(x + dx, y + dy);
                    if distance + step < filled.data[k as usize].1 {
                        filled.data[k as usize] = (z_m, distance + step);
                    }
                }
            }
        }
    };
    let before = [(-1, 0, 1.0), (0, -1, 1.0), (-1, -1, 1.4), (1, -1, 1.4)];
    sweep(before, false);
    sweep(before.map(|(dx, dy, step)| (-dx, -dy, step)), true);
    filled.map(|(z_m, _)| z_m)
}
