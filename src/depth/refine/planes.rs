//! Depth and colour of a frame laid out for windows that take every second pixel: even and odd columns apart, so that
//! the pixels of one row of a window lie side by side.

use pulp::WithSimd;

use super::tiles::Tiles;

/// Values that a window reads of a row.
pub const LANES: usize = 16;
/// Columns of one parity before the picture's first and after its last, in which nothing weighs anything.
const MARGIN: usize = LANES;

/// Values that are laid out at a time.
const CHUNK: usize = 64;

/// Planes of a frame, even columns in the first half of each row, odd ones in the second.
#[derive(Debug, Default)]
pub struct Planes {
    /// Columns of the picture.
    pub width: usize,
    /// Rows of the picture.
    pub height: usize,
    /// Values of one parity in a row.
    stride: usize,
    /// Pixels of one parity that a window reaches to the left.
    reach: usize,
    /// Inverse depth, and its confidence.
    depths: [Vec<f32>; 2],
    /// Red, green and blue.
    colors: [Vec<u8>; 3],
}

impl Planes {
    /// Makes room for a picture, and for windows that reach over `reach` pixels of one parity.
    pub fn resize(&mut self, width: usize, height: usize, reach: usize) {
        if (self.width, self.height) != (width, height) {
            (self.width, self.height, self.stride) = (width, height, width.div_ceil(2) + 2 * MARGIN);
            let count = 2 * self.stride * height;
            for plane in &mut self.depths {
                plane.clear();
                plane.resize(count, 0.0);
            }
            for plane in &mut self.colors {
                plane.clear();
                plane.resize(count, 0);
            }
        }
        self.reach = reach;
    }

    /// Where a row begins whose pixels have this parity.
    #[inline(always)]
    fn row(&self, y: usize, parity: usize) -> usize {
        (2 * y + parity) * self.stride + MARGIN
    }

    /// The places of row `y` from the even column `x` on, of either parity.
    #[inline(always)]
    fn places(&self, x: usize, y: usize) -> [usize; 2] {
        [0, 1].map(|parity| self.row(y, parity) + x / 2)
    }

    /// Red, green and blue of a pixel.
    #[inline(always)]
    pub fn color(&self, x: usize, y: usize) -> [f32; 3] {
        let at = self.row(y, x % 2) + x / 2;
        self.colors.each_ref().map(|plane| f32::from(plane[at]))
    }

    /// The pixels of row `y` with the parity of `x`, from `reach` before it on: inverse depth and confidence, and red, green,
    /// blue.
    #[inline(always)]
    pub fn window(&self, x: usize, y: usize) -> ([&[f32; LANES]; 2], [&[u8; LANES]; 3]) {
        let at = self.row(y, x % 2) + x / 2 - self.reach;
        (self.depths.each_ref().map(|plane| chunk(plane, at)), self.colors.each_ref().map(|plane| chunk(plane, at)))
    }
}

/// Lays values out from these places on, of either parity.
#[inline(always)]
fn part<T: Copy>(plane: &mut [T], [even, odd]: [usize; 2], values: &[T]) {
    let (pairs, last) = values.as_chunks::<2>();
    let (before, after) = plane.split_at_mut(odd);
    let even = &mut before[even..][..values.len().div_ceil(2)];
    for ((pair, even), odd) in pairs.iter().zip(&mut *even).zip(after) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    if let [last] = last {
        even[pairs.len()] = *last;
    }
}

/// Copies the colours of a picture (sRGB, 0 to 255) near edges into the planes.
pub struct SetColors<'a> {
    pub planes: &'a mut Planes,
    pub tiles: &'a Tiles,
    pub rgb: &'a [u8],
}

impl WithSimd for SetColors<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, tiles, rgb } = self;
        for (y, row) in rgb.as_chunks::<3>().0.chunks_exact(planes.width).enumerate() {
            for columns in tiles.columns(y) {
                for (pixels, k) in row[columns.clone()].chunks(CHUNK).zip(0..) {
                    let mut values = [[0; CHUNK]; 3];
                    let [red, green, blue] = &mut values;
                    for (((pixel, red), green), blue) in pixels.iter().zip(red).zip(green).zip(blue) {
                        [*red, *green, *blue] = *pixel;
                    }
                    let places = planes.places(columns.start + k * CHUNK, y);
                    for (plane, values) in planes.colors.iter_mut().zip(&values) {
                        part(plane, places, &values[..pixels.len()]);
                    }
                }
            }
        }
    }
}

/// Copies inverse depths near edges, and how much each of them weighs, into the planes.
pub struct SetDepths<'a> {
    pub planes: &'a mut Planes,
    pub tiles: &'a Tiles,
    /// Inverse depths of the picture, row by row.
    pub inverse: &'a [f32],
    /// Whether each was made up, and whether it may be wrong.
    pub flags: [&'a [bool]; 2],
    /// How much such depths count as votes.
    pub weights: [f32; 2],
}

impl WithSimd for SetDepths<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, tiles, inverse, flags: [unknown, band], weights: [made_up, unsure] } = self;
        for y in 0..planes.height {
            for columns in tiles.columns(y) {
                let row = y * planes.width;
                let places = planes.places(columns.start, y);
                part(&mut planes.depths[0], places, &inverse[row..][columns.clone()]);
                for begin in columns.clone().step_by(CHUNK) {
                    let pixels = row + begin..row + (begin + CHUNK).min(columns.end);
                    let mut weights = [1.0; CHUNK];
                    let flags = unknown[pixels.clone()].iter().zip(&band[pixels.clone()]);
                    for (weight, (&unknown, &band)) in weights.iter_mut().zip(flags) {
                        *weight = if band { unsure } else { 1.0 };
                        *weight = if unknown { made_up } else { *weight };
                    }
                    let places = planes.places(begin, y);
                    part(&mut planes.depths[1], places, &weights[..pixels.len()]);
                }
            }
        }
    }
}

#[inline(always)]
fn chunk<T>(plane: &[T], at: usize) -> &[T; LANES] {
    plane[at..].first_chunk().expect("a margin after the last column")
}
