//! Pictures in linear light, with rows processed in parallel.

use std::sync::Mutex;
use std::thread;

use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::frame::ColorImage;

/// Red, green, blue in linear light, 1 = white; values above 1 are clipped in an 8-bit picture.
pub type Rgb = [f32; 3];

/// One value per pixel, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane<T> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width` values.
    pub data: Vec<T>,
}

impl<T: Copy + Send + Sync> Plane<T> {
    /// Creates the plane whose value at column `x`, row `y` is `of(x, y)`; rows are computed in parallel.
    pub fn from_fn(width: usize, height: usize, of: impl Fn(usize, usize) -> T + Sync) -> Self
    where
        T: Default,
    {
        let mut data = vec![T::default(); width * height];
        for_each_row(&mut data, width, |y, row| row.iter_mut().enumerate().for_each(|(x, value)| *value = of(x, y)));
        Self { width, height, data }
    }

    /// Returns the value at a position; outside, that of the nearest pixel inside.
    #[inline]
    pub fn at(&self, x: i32, y: i32) -> T {
        let (x, y) = (x.clamp(0, self.width as i32 - 1) as usize, y.clamp(0, self.height as i32 - 1) as usize);
        self.data[y * self.width + x]
    }

    /// Maps every value.
    pub fn map<U>(&self, of: impl Fn(T) -> U) -> Plane<U> {
        Plane { width: self.width, height: self.height, data: self.data.iter().map(|&value| of(value)).collect() }
    }
}

/// Calls `work(y, row)` for every row of `width` values, on all cores.
pub fn for_each_row<T: Send>(data: &mut [T], width: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    let rows = Mutex::new(data.chunks_exact_mut(width.max(1)).enumerate());
    let next = || rows.lock().ok().and_then(|mut rows| rows.next());
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((y, row)) = next() {
                    work(y, row);
                }
            });
        }
    });
}

/// Converts an 8-bit picture to linear light.
pub fn decode_srgb(image: &ColorImage) -> Plane<Rgb> {
    let light: Vec<f32> = (0..256).map(|code| srgb_to_linear(code as f32 / 255.0)).collect();
    let data = image.rgb.chunks_exact(3).map(|p| [0, 1, 2].map(|k| light[usize::from(p[k])])).collect();
    Plane { width: image.width as usize, height: image.height as usize, data }
}

/// Encodes light as 8-bit sRGB, clipped at white like a camera.
pub fn encode_srgb(light: &Plane<Rgb>) -> ColorImage {
    let code = |light: f32| (linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8;
    let rgb = light.data.iter().flat_map(|pixel| pixel.map(code)).collect();
    ColorImage { width: light.width as u32, height: light.height as u32, rgb }
}
