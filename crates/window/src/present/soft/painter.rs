//! Paints the picture and the controls into memory: everything but the way to the screen.

use std::sync::atomic::AtomicBool;

use pulp::Arch;

use super::controls::Overlay;
use super::picture::{Scaler, Scratch};
use crate::present::{Area, Controls, Drawing, Image};
use bokehcam::compute::thread_pool::{self, DisjointParts, ThreadPool};
use bokehcam::frame::ColorImage;

/// Rows that one thread paints at a time.
const BAND: usize = 16;
/// Above this many pixels several threads are faster than one: where they are copied, and where they are scaled.
const MANY_COPIED: u64 = 3_000_000;
const MANY_SCALED: u64 = 700_000;
/// At most this many threads, and half of the cores. The blur needs the others: waiting for a thread that gets no core
/// takes longer than to paint alone.
const MOST_THREADS: usize = 4;

/// Paints a window's content.
pub struct Painter {
    arch: Arch,
    size: (usize, usize),
    overlay: Overlay,
    scaler: Scaler,
    /// The threads, once they are needed.
    workers: Option<ThreadPool>,
    /// One for each thread.
    scratch: Vec<Scratch>,
    /// A flag for each band, for [`DisjointParts`].
    taken: Vec<AtomicBool>,
}

impl Painter {
    /// A painter of a window without pixels.
    pub fn new() -> Self {
        Self {
            arch: Arch::new(),
            size: (0, 0),
            overlay: Overlay::default(),
            scaler: Scaler::default(),
            workers: None,
            scratch: vec![Scratch::default()],
            taken: Vec::new(),
        }
    }

    /// Changes the size of the window, in pixels.
    pub fn resize(&mut self, size: (u32, u32)) {
        self.size = (size.0 as usize, size.1 as usize);
        self.overlay.resize(self.size);
        self.taken.resize_with(self.size.1.div_ceil(BAND), AtomicBool::default);
    }

    /// Controls to paint from now on.
    pub fn set_controls(&mut self, controls: Controls) {
        self.overlay.set(controls);
    }

    /// Paints the window into `pixels`: rows of `0x00RRGGBB` without gaps, of the window's size.
    pub fn paint(&mut self, pixels: &mut [u32], drawing: &Drawing) {
        if pixels.len() != self.size.0 * self.size.1 || pixels.is_empty() {
            return;
        }
        self.overlay.paint();
        let picture = match drawing.picture {
            Image::Memory(picture) if !picture.rgb.is_empty() && drawing.area.width > 0 && drawing.area.height > 0 => {
                if drawing.part.is_none() {
                    self.scaler.adapt(picture, drawing.area);
                }
                Some(picture)
            }
            _ => None,
        };
        let Self { arch, size: (width, _), overlay, scaler, workers, scratch, taken, .. } = self;
        let (arch, width, overlay, scaler) = (*arch, *width, &*overlay, &*scaler);
        let window = Window { arch, width, overlay, scaler, drawing, picture };
        let bands = pixels.len().div_ceil(width * BAND);
        let paint_band = |scratch: &mut Scratch, band: usize, pixels: &mut [u32]| {
            for (y, row) in (band * BAND..).zip(pixels.chunks_exact_mut(width)) {
                window.paint_row(y, scratch, row);
            }
        };
        if needs_threads(drawing) {
            let workers =
                workers.get_or_insert_with(|| ThreadPool::new("present", (thread_pool::cores() / 2).min(MOST_THREADS)));
            scratch.resize_with(workers.thread_count(), Scratch::default);
            let parts = DisjointParts::new(pixels, width * BAND, taken);
            workers.run_with(scratch, bands, &|scratch, band| paint_band(scratch, band, parts.part(band)));
        } else {
            for (band, pixels) in pixels.chunks_mut(width * BAND).enumerate() {
                paint_band(&mut scratch[0], band, pixels);
            }
        }
    }
}

impl Default for Painter {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether there is so much to paint that several threads are worth waking.
fn needs_threads(drawing: &Drawing) -> bool {
    let area = drawing.area;
    let scaled = drawing.picture.size() != (area.width, area.height);
    u64::from(area.width) * u64::from(area.height) > if scaled { MANY_SCALED } else { MANY_COPIED }
}

/// What the threads share while they paint a frame.
struct Window<'a> {
    arch: Arch,
    width: usize,
    overlay: &'a Overlay,
    scaler: &'a Scaler,
    drawing: &'a Drawing<'a>,
    /// The picture, where there is one in memory.
    picture: Option<&'a ColorImage>,
}

impl Window<'_> {
    /// Paints row `y` of the window: picture and background, and the controls over them.
    fn paint_row(&self, y: usize, scratch: &mut Scratch, row: &mut [u32]) {
        let Self { arch, width, overlay, scaler, drawing, picture } = *self;
        let Area { x, y: top, width: area_width, height } = drawing.area;
        let [r, g, b] = drawing.background;
        let background = u32::from_be_bytes([0, r, g, b]);
        let (left, right) = ((x as usize).min(width), (x as usize + area_width as usize).min(width));
        let (top, bottom) = (top as usize, top as usize + height as usize);
        match picture.filter(|_| (top..bottom).contains(&y)) {
            Some(picture) => {
                scaler.paint_row(arch, (drawing, picture), y - top, scratch, &mut row[left..right]);
                row[..left].fill(background);
                row[right..].fill(background);
            }
            None => row.fill(background),
        }
        overlay.blend(arch, y, row);
    }
}
