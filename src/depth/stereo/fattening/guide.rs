//! The guide image whose colours show outlines, as separate channels.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::compute::thread_pool::{DisjointParts, ThreadPool};
use crate::depth::stereo::color_similarity::Colors;

/// Buffer of the channels of a picture.
pub struct Guide {
    /// `[row][channel][column]`.
    channels: Vec<u8>,
    pixels: usize,
}

/// The channels of a picture of the size of a map.
#[derive(Clone, Copy)]
pub struct Channels<'a> {
    /// `[row][channel][column]`.
    values: &'a [u8],
    width: usize,
    /// Whether rows have three channels instead of one.
    pub is_color: bool,
}

impl Guide {
    /// Allocates for maps of `pixels` pixels.
    pub fn new(pixels: usize) -> Self {
        Self { channels: Vec::with_capacity(3 * pixels), pixels }
    }

    /// Returns the channels of `colors`, or `luma` if there are no colours or all pixels are grey.
    pub fn fill_channels<'a>(
        &'a mut self,
        luma: &'a [u8],
        colors: Option<Colors>,
        width: usize,
        workers: &mut ThreadPool,
        taken: &mut [AtomicBool],
    ) -> Channels<'a> {
        let grey = Channels { values: luma, width, is_color: false };
        let Some(Colors { image, stride }) = colors else { return grey };
        self.channels.resize(3 * self.pixels, 0);
        let is_color = AtomicBool::new(false);
        let rows = DisjointParts::new(&mut self.channels, 3 * width, taken);
        workers.run(self.pixels / width, &|y| {
            let row = &image.rgb[3 * image.width as usize * stride * y..];
            let [red, green, blue] = split_channels(rows.part(y), width);
            let mut differ = 0;
            let mut store = |x: usize, pixel: &[u8]| {
                (red[x], green[x], blue[x]) = (pixel[0], pixel[1], pixel[2]);
                differ |= (pixel[0] ^ pixel[1]) | (pixel[1] ^ pixel[2]);
            };
            // With a constant step this takes a third of the time.
            if stride == 1 {
                row[..3 * width].as_chunks::<3>().0.iter().enumerate().for_each(|(x, pixel)| store(x, pixel));
            } else {
                row.chunks(3 * stride).take(width).enumerate().for_each(|(x, pixel)| store(x, pixel));
            }
            if differ != 0 {
                is_color.store(true, Ordering::Relaxed);
            }
        });
        if is_color.into_inner() { Channels { values: &self.channels, width, is_color: true } } else { grey }
    }
}

fn split_channels(row: &mut [u8], width: usize) -> [&mut [u8]; 3] {
    let (red, others) = row.split_at_mut(width);
    let (green, blue) = others.split_at_mut(width);
    [red, green, &mut blue[..width]]
}

impl<'a> Channels<'a> {
    /// Returns the channels of row `y`: red, green and blue, or the brightness three times.
    #[inline(always)]
    pub fn row(&self, y: usize) -> [&'a [u8]; 3] {
        let Self { values, width, .. } = *self;
        if self.is_color {
            [0, 1, 2].map(|channel| &values[(3 * y + channel) * width..][..width])
        } else {
            [&values[y * width..][..width]; 3]
        }
    }
}
