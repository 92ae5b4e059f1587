//! The CPU executor: uses every core and the best vector instructions available, and allocates nothing per frame.

mod band;
mod banded;
mod bin;
mod bin_parts;
mod bin_store;
mod blur;
mod cell_sums;
mod composite;
mod decimate;
mod encode;
mod enlarge;
mod fill;
mod filter;
mod frames;
mod gather;
mod layers;
mod levels;
mod marking;
mod passes;
mod pixels;
mod probe;
mod reach;
mod rows;
mod sample;
mod silhouettes;
mod steady;
mod tent;
mod tiles;
mod unpack;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use band::{BandScratch, NO_BIN};
use blur::Scratch;
use decimate::DecimateScratch;
use encode::Encoder;
use gather::Gather;
use pulp::Arch;
use rows::Slot;
use silhouettes::Silhouettes;
use tiles::{BLOCK, TILE_W, Tiles};
use unpack::InputFrame;

use super::ladder::Compositing;
use super::plan::{CELL, Plan};
use crate::budget::Quality;
use crate::compute::thread_pool::{ThreadPool, core_count};

pub use banded::{BandedBokeh, MAX_WHOLE_PIXELS};
pub use pixels::{Pixels, Radii, Sample};

/// Runs a plan on the CPU, with buffers for the whole of it; [`BandedBokeh`] has one for the picture or for a band.
pub struct CpuBokeh {
    plan: Plan,
    arch: Arch,
    workers: ThreadPool,
    encoder: Arc<Encoder>,
    tiles: Tiles,
    silhouettes: Silhouettes,
    slots: Vec<Slot>,
    pyramid: Option<fill::Pyramid>,
    /// Per band and block, the first bin that waits for inpainting.
    first_pending: Vec<usize>,
    gather: Option<Gather>,
    thread_scratch: Vec<ThreadScratch>,
    /// Flags for [`DisjointParts`]: one per part of the largest pass.
    taken: Vec<AtomicBool>,
}

/// Scratch memory of one thread.
struct ThreadScratch {
    coc: Vec<f32>,
    lanes: Vec<f32>,
    band: BandScratch,
    dilation: Vec<f32>,
    decimate: DecimateScratch,
    blur: Scratch,
    composite: composite::CompositeScratch,
}

impl CpuBokeh {
    /// Creates an executor of `plan` on `threads` threads (all cores when `None`).
    pub fn new(plan: Plan, threads: Option<usize>) -> Self {
        let threads = threads.unwrap_or_else(core_count);
        let (width, height) = (plan.width, plan.height);
        let workers = ThreadPool::new("blur", threads);
        let slots: Vec<Slot> = (0..plan.slot_count()).map(|slot| Slot::new(&plan, slot)).collect();
        let thread_scratch = (0..workers.thread_count())
            .map(|_| ThreadScratch {
                coc: vec![0.0; width],
                // Two vectors for each tile.
                lanes: vec![0.0; width.next_multiple_of(TILE_W)],
                band: BandScratch::new(),
                // The pass needs a grid and one row of it.
                dilation: Vec::with_capacity(slots.iter().map(|slot| slot.cells.data.len() * 2).max().unwrap_or(0)),
                decimate: DecimateScratch::new(if plan.privacy { width } else { 0 }),
                blur: Scratch::new(&plan),
                composite: composite::CompositeScratch::new(width),
            })
            .collect();
        let flags = |n: usize| (0..n).map(|_| AtomicBool::new(false)).collect();
        let gather = (plan.compositing == Compositing::Gather).then(|| Gather::new(&plan));
        Self {
            encoder: Arc::new(Encoder { curves: None }),
            tiles: Tiles::new(width, height),
            silhouettes: Silhouettes::new(width, height),
            pyramid: (plan.compositing == Compositing::Layers).then(|| fill::Pyramid::new(width, height)),
            first_pending: vec![NO_BIN; width.div_ceil(BLOCK) * height.div_ceil(CELL)],
            arch: Arch::new(),
            taken: flags(height.max(slots.len())),
            workers,
            slots,
            gather,
            thread_scratch,
            plan,
        }
    }

    /// Uses these vector instructions instead of the best available ones, for tests.
    #[doc(hidden)]
    pub fn with_arch(mut self, arch: Arch) -> Self {
        self.arch = arch;
        self
    }

    /// Changes the quality of the next frames, if the plan has other levels.
    pub fn set_quality(&mut self, quality: Quality) {
        self.plan.set_quality(quality);
    }

    /// Blurs the `pixels` of one picture into `out`, which has the same length. Calls `lap` with the name of each pass
    /// after it; `lap` may stop the frame, which leaves the buffers in an unusable state.
    fn blur_pixels<T: Sample>(
        &mut self,
        pixels: &[T],
        coc: Radii<'_>,
        out: &mut [T],
        mut lap: impl FnMut(&'static str) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if out.is_empty() {
            return ControlFlow::Continue(());
        }
        let encoder = Arc::clone(&self.encoder);
        let frame = InputFrame::new(&self.plan, T::as_pixels(pixels, &encoder), coc);
        self.split_bins(&frame);
        lap("split")?;
        // If something is in front, blocks where it occludes anything get the bins behind it after the inpainting.
        self.compute_bins(&frame, None);
        lap("bin")?;
        for layer in self.plan.layers().skip(1) {
            if let Some(pyramid) = &mut self.pyramid {
                pyramid.fill(&self.plan.visible_weight(layer.start), &mut self.workers, self.arch);
            }
            lap("fill")?;
            self.compute_bins(&frame, Some(layer));
            lap("bin")?;
        }
        if let Some(gather) = &mut self.gather {
            let workers = (&mut self.workers, self.arch);
            let bin = &self.slots[0].source;
            gather.run(workers, &self.plan, &frame, bin, &mut self.taken, || lap("gather"))?;
            lap("gather")?;
        } else {
            self.dilate_radii();
            lap("reach")?;
            if self.plan.privacy {
                self.decimate_bins();
                lap("decimate")?;
            }
            self.blur_bins();
            lap("blur")?;
        }
        self.composite(&frame, pixels, out);
        lap("composite")
    }
}
