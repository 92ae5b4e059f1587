//! Paints the picture and the controls into memory, independent of the display server.

use std::sync::atomic::AtomicBool;

use pulp::Arch;

use super::controls::Overlay;
use super::picture::{Scaler, Scratch};
use crate::present::{Area, Controls, Drawing, Image};
use bokehcam::compute::thread_pool::{self, DisjointParts, ThreadPool};
use bokehcam::frame::ColorImage;

/// Rows per band, the unit of parallel work.
const BAND_ROWS: usize = 16;
/// Pixel counts above which several threads are faster than one: for copied and for scaled pictures.
const MIN_SHARED_COPY_PX: u64 = 3_000_000;
const MIN_SHARED_SCALE_PX: u64 = 700_000;
/// Maximum number of threads, besides the limit of half the cores. The blur needs the others: waiting for a thread
/// without a core takes longer than painting on one thread.
const MAX_THREADS: usize = 4;

/// Paints the content of a window.
pub struct Painter {
    arch: Arch,
    size: (usize, usize),
    overlay: Overlay,
    scaler: Scaler,
    /// Created on first use.
    workers: Option<ThreadPool>,
    /// One per thread.
    scratch: Vec<Scratch>,
    /// One flag per band, for [`DisjointParts`].
    taken: Vec<AtomicBool>,
}

impl Painter {
    /// Creates a painter for a window of zero size.
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

    /// Changes the window's size, in pixels.
    pub fn resize(&mut self, size: (u32, u32)) {
        self.size = (size.0 as usize, size.1 as usize);
        self.overlay.resize(self.size);
        self.taken.resize_with(self.size.1.div_ceil(BAND_ROWS), AtomicBool::default);
    }

    /// Replaces the controls.
    pub fn set_controls(&mut self, controls: Controls) {
        self.overlay.set_controls(controls);
    }

    /// Paints the window into `pixels`: tightly packed rows of `0x00RRGGBB`, of the window's size.
    pub fn paint(&mut self, pixels: &mut [u32], drawing: &Drawing) {
        if pixels.len() != self.size.0 * self.size.1 || pixels.is_empty() {
            return;
        }
        self.overlay.paint();
        let picture = match drawing.picture {
            Image::Memory(picture) if !picture.rgb.is_empty() && drawing.area.width > 0 && drawing.area.height > 0 => {
                if drawing.visible_region.is_none() {
                    self.scaler.prepare(picture, drawing.area);
                }
                Some(picture)
            }
            _ => None,
        };
        let Self { arch, size: (width, _), overlay, scaler, workers, scratch, taken, .. } = self;
        let (arch, width, overlay, scaler) = (*arch, *width, &*overlay, &*scaler);
        let context = PaintContext { arch, width, overlay, scaler, drawing, picture };
        let bands = pixels.len().div_ceil(width * BAND_ROWS);
        let paint_band = |scratch: &mut Scratch, band: usize, pixels: &mut [u32]| {
            for (y, row) in (band * BAND_ROWS..).zip(pixels.chunks_exact_mut(width)) {
                context.paint_row(y, scratch, row);
            }
        };
        // Small windows are painted on this thread: waking others would take longer.
        if needs_threads(drawing) {
            let workers = workers
                .get_or_insert_with(|| ThreadPool::new("present", (thread_pool::core_count() / 2).min(MAX_THREADS)));
            scratch.resize_with(workers.thread_count(), Scratch::default);
            let parts = DisjointParts::new(pixels, width * BAND_ROWS, taken);
            workers.run_with(scratch, bands, &|scratch, band| paint_band(scratch, band, parts.part(band)));
        } else {
            for (band, pixels) in pixels.chunks_mut(width * BAND_ROWS).enumerate() {
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

/// Whether there is enough work to justify waking several threads.
fn needs_threads(drawing: &Drawing) -> bool {
    let area = drawing.area;
    let scaled = drawing.picture.size() != (area.width, area.height);
    u64::from(area.width) * u64::from(area.height) > if scaled { MIN_SHARED_SCALE_PX } else { MIN_SHARED_COPY_PX }
}

/// Data that the threads share while they paint a frame.
struct PaintContext<'a> {
    arch: Arch,
    width: usize,
    overlay: &'a Overlay,
    scaler: &'a Scaler,
    drawing: &'a Drawing<'a>,
    /// The picture, if it is in memory.
    picture: Option<&'a ColorImage>,
}

impl PaintContext<'_> {
    /// Paints row `y` of the window: picture and background, then the controls over them.
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
        overlay.blend_row(arch, y, row);
    }
}
