//! Paints drawing and controls into memory: all but the way to the screen.

use std::sync::atomic::AtomicBool;

use pulp::Arch;

use super::controls::Overlay;
use super::picture::{Scaler, Scratch};
use crate::compute::thread_pool::{self, DisjointParts, ThreadPool};
use crate::frame::ColorImage;
use crate::preview::present::{Area, Controls, Drawing, Image};

/// Rows that one thread paints at a time.
const BAND: usize = 16;
/// Pixels from which on one thread is not enough, where they are copied and where they are scaled.
const MANY_COPIED: u64 = 3_000_000;
const MANY_SCALED: u64 = 700_000;
/// The blur has the other half of the cores: who waits for a thread that gets none is slower than alone.
const MOST_THREADS: usize = 4;
/// Windows are double or triple buffered.
const BUFFERS: usize = 4;

/// Paints a window's content.
pub struct Painter {
    arch: Arch,
    size: (usize, usize),
    overlay: Overlay,
    scaler: Scaler,
    /// The threads, once they are needed.
    workers: Option<ThreadPool>,
    scratch: Vec<Scratch>,
    taken: Vec<AtomicBool>,
    around: Around,
}

/// What is around the picture, which is painted only when it changes.
#[derive(Debug, Default)]
struct Around {
    area: Area,
    background: [u8; 3],
    version: u64,
    /// What the buffers have that were painted last, the last one in front.
    painted: [u64; BUFFERS],
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
            around: Around::default(),
        }
    }

    /// Another size of the window, in pixels.
    pub fn resize(&mut self, size: (u32, u32)) {
        self.size = (size.0 as usize, size.1 as usize);
        self.overlay.resize(self.size);
        self.taken.resize_with(self.size.1.div_ceil(BAND), AtomicBool::default);
        self.around.version += 1;
    }

    /// Controls to paint from now on.
    pub fn set_controls(&mut self, controls: Controls) {
        self.overlay.set(controls);
        self.around.version += 1;
    }

    /// Paints the window into `pixels`: rows of `0x00RRGGBB` without gaps, as many as the window has. `age` says how
    /// many paintings ago these were painted last, 0 that they hold anything.
    pub fn paint(&mut self, pixels: &mut [u32], age: u8, drawing: &Drawing) {
        if pixels.len() != self.size.0 * self.size.1 || pixels.is_empty() {
            return;
        }
        self.overlay.paint();
        let around = self.around.begin(age, drawing);
        let picture = match drawing.picture {
            Image::Memory(picture) if !picture.rgb.is_empty() && drawing.area.width > 0 && drawing.area.height > 0 => {
                self.scaler.adapt(picture, drawing.area);
                Some(picture)
            }
            _ => None,
        };
        let Self { arch, size: (width, _), overlay, scaler, workers, scratch, taken, .. } = self;
        let (arch, width, overlay, scaler) = (*arch, *width, &*overlay, &*scaler);
        let window = Window { arch, width, overlay, scaler, drawing, picture, around };
        let bands = pixels.len().div_ceil(width * BAND);
        let band = |scratch: &mut Scratch, band: usize, pixels: &mut [u32]| {
            for (y, row) in (band * BAND..).zip(pixels.chunks_exact_mut(width)) {
                window.row(y, scratch, row);
            }
        };
        if is_much(drawing) {
            let workers =
                workers.get_or_insert_with(|| ThreadPool::new("present", (thread_pool::cores() / 2).min(MOST_THREADS)));
            scratch.resize_with(workers.thread_count(), Scratch::default);
            let shelf = DisjointParts::new(pixels, width * BAND, taken);
            workers.run_with(scratch, bands, &|scratch, part| band(scratch, part, shelf.part(part)));
        } else {
            for (part, pixels) in pixels.chunks_mut(width * BAND).enumerate() {
                band(&mut scratch[0], part, pixels);
            }
        }
    }
}

impl Default for Painter {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether several threads are worth their waking.
fn is_much(drawing: &Drawing) -> bool {
    let area = drawing.area;
    let scaled = drawing.picture.size() != (area.width, area.height);
    u64::from(area.width) * u64::from(area.height) > if scaled { MANY_SCALED } else { MANY_COPIED }
}

impl Around {
    /// Whether what is around the picture has to be painted.
    fn begin(&mut self, age: u8, drawing: &Drawing) -> bool {
        let looks = (drawing.area, drawing.background);
        if (self.area, self.background) != looks {
            (self.area, self.background) = looks;
            self.version += 1;
        }
        let known = usize::from(age).checked_sub(1).and_then(|ago| self.painted.get(ago));
        let needed = known != Some(&self.version);
        self.painted.rotate_right(1);
        self.painted[0] = self.version;
        needed
    }
}

struct Window<'a> {
    arch: Arch,
    width: usize,
    overlay: &'a Overlay,
    scaler: &'a Scaler,
    drawing: &'a Drawing<'a>,
    /// The picture, where there is one in memory.
    picture: Option<&'a ColorImage>,
    /// Whether what is around it is painted.
    around: bool,
}

impl Window<'_> {
    fn row(&self, y: usize, scratch: &mut Scratch, row: &mut [u32]) {
        let Self { arch, width, overlay, scaler, drawing, picture, around } = *self;
        let Area { x, y: top, width: across, height } = drawing.area;
        let [r, g, b] = drawing.background;
        let background = u32::from_be_bytes([0, r, g, b]);
        let (left, right) = ((x as usize).min(width), (x as usize + across as usize).min(width));
        let (top, bottom) = (top as usize, top as usize + height as usize);
        let Some(picture) = picture.filter(|_| (top..bottom).contains(&y)) else {
            if around || self.picture.is_none() {
                row.fill(background);
                overlay.blend(arch, y, 0..width, row);
            }
            return;
        };
        scaler.row(arch, (drawing, picture), y - top, scratch, &mut row[left..right]);
        if around {
            row[..left].fill(background);
            row[right..].fill(background);
            overlay.blend(arch, y, 0..width, row);
        } else {
            overlay.blend(arch, y, left..right, &mut row[left..right]);
        }
    }
}
