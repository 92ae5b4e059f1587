//! Depth and colour of a frame laid out for windows that take every second pixel: even and odd columns apart, so that
//! the pixels of one row of a window lie side by side.

use pulp::WithSimd;

/// Values that a window reads of a row.
pub const LANES: usize = 16;
/// Columns of one parity before the picture's first and after its last, in which nothing weighs anything.
const MARGIN: usize = LANES;

/// Inverse depth, its confidence, red, green and blue.
const KINDS: usize = 5;

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
    planes: [Vec<f32>; KINDS],
}

impl Planes {
    /// Takes the colours of a picture (sRGB, 0 to 255), for windows that reach over `reach` pixels of one parity.
    pub fn set_colors(&mut self, rgb: &[u8], width: usize, height: usize, reach: usize) {
        if (self.width, self.height) != (width, height) {
            (self.width, self.height, self.stride) = (width, height, width.div_ceil(2) + 2 * MARGIN);
            for plane in &mut self.planes {
                plane.clear();
                plane.resize(2 * self.stride * height, 0.0);
            }
        }
        self.reach = reach;
        let (stride, [_, _, red, green, blue]) = (self.stride, &mut self.planes);
        for (y, row) in rgb.chunks_exact(3 * width).enumerate() {
            for (parity, first) in [(0, 0), (1, 3)] {
                let at = (2 * y + parity) * stride + MARGIN;
                // Every second pixel: six bytes on. A row of one pixel has no odd column.
                let pixels = row[first.min(row.len())..].chunks(6);
                let out = red[at..].iter_mut().zip(&mut green[at..]).zip(&mut blue[at..]);
                for (pixel, ((red, green), blue)) in pixels.zip(out) {
                    (*red, *green, *blue) = (f32::from(pixel[0]), f32::from(pixel[1]), f32::from(pixel[2]));
                }
            }
        }
    }

    /// Red, green and blue of a pixel.
    #[inline(always)]
    pub fn color(&self, x: usize, y: usize) -> [f32; 3] {
        let at = (2 * y + x % 2) * self.stride + MARGIN + x / 2;
        [self.planes[2][at], self.planes[3][at], self.planes[4][at]]
    }

    /// The pixels of row `y` with the parity of `x`, from `reach` before it on: inverse depth, confidence, red, green,
    /// blue.
    #[inline(always)]
    pub fn window(&self, x: usize, y: usize) -> [&[f32; LANES]; KINDS] {
        let at = (2 * y + x % 2) * self.stride + MARGIN + x / 2 - self.reach;
        let [depth, confidence, red, green, blue] = &self.planes;
        [chunk(depth, at), chunk(confidence, at), chunk(red, at), chunk(green, at), chunk(blue, at)]
    }
}

/// Copies inverse depths, and how much each of them weighs, into the planes.
pub struct SetDepths<'a> {
    pub planes: &'a mut Planes,
    /// Inverse depths of the picture, row by row.
    pub inverse: &'a [f32],
    pub confidence: &'a [f32],
}

impl WithSimd for SetDepths<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes: Planes { width, stride, planes: [depth, weight, ..], .. }, inverse, confidence } = self;
        for (from, to) in [(inverse, depth), (confidence, weight)] {
            for (row, out) in from.chunks_exact(*width).zip(to.chunks_exact_mut(2 * *stride)) {
                let (even, odd) = out.split_at_mut(*stride);
                let (even, odd) = (&mut even[MARGIN..][..width.div_ceil(2)], &mut odd[MARGIN..][..*width / 2]);
                for ((pair, even), odd) in row.chunks_exact(2).zip(even.iter_mut()).zip(odd) {
                    (*even, *odd) = (pair[0], pair[1]);
                }
                if let ([last], Some(even)) = (row.chunks_exact(2).remainder(), even.last_mut()) {
                    *even = *last;
                }
            }
        }
    }
}

#[inline(always)]
fn chunk(plane: &[f32], at: usize) -> &[f32; LANES] {
    plane[at..].first_chunk().expect("a margin after the last column")
}
