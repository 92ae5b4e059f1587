//! The CPU executor: uses every core and the best vector instructions available, and allocates nothing per frame.

mod band;
mod bin;
mod blur;
mod cell_sums;
mod composite;
mod directional;
mod encode;
mod fill;
mod filter;
mod frames;
mod gather;
mod layers;
mod levels;
mod marking;
mod pixels;
mod probe;
mod reach;
mod rows;
mod shelves;
mod silhouettes;
mod tent;
mod tiles;
mod unpack;

use std::ops::{ControlFlow, Range};
use std::sync::atomic::AtomicBool;

use band::{Band, BandSums, Hidden, Layer, NONE};
use blur::{Scratch, Strip};
use gather::Gather;
use marking::Marking;
use pulp::Arch;
use reach::Reach;
use rows::Slot;
use shelves::{BinParts, StripParts};
use silhouettes::Silhouettes;
use tiles::{BLOCK, Survey, TILE_H, Tiles};
use unpack::Source;

use super::Finished;
use super::ladder::Compositing;
use super::occlusion::MAX_LAYERS;
use super::plan::{CELL, MAX_BINS, Plan};
use super::rung::SCALES;
use crate::budget::Quality;
use crate::compute::thread_pool::{DisjointParts, ThreadPool, cores};

pub use pixels::{Pixels, Radii, Sample};
pub use unpack::{compress, expand};

/// Runs a plan on the CPU.
pub struct CpuBokeh {
    plan: Plan,
    arch: Arch,
    workers: ThreadPool,
    encode: encode::EncodeTable,
    tiles: Tiles,
    silhouettes: Silhouettes,
    slots: Vec<Slot>,
    pyramid: Option<fill::Pyramid>,
    /// Per band and block, the first bin that waits for inpainting.
    waits: Vec<usize>,
    gather: Option<Gather>,
    members: Vec<ThreadMemory>,
    /// Flags for [`DisjointParts`]: one per part of the largest pass.
    taken: Vec<AtomicBool>,
    /// The last frame, until it is collected.
    done: Option<Finished>,
}

/// Scratch memory of one thread.
struct ThreadMemory {
    coc: Vec<f32>,
    sums: BandSums,
    reach: Vec<f32>,
    blur: Scratch,
    layers: layers::Layers,
}

impl CpuBokeh {
    /// Creates an executor of `plan` on `threads` threads (all cores when `None`).
    pub fn new(plan: Plan, threads: Option<usize>) -> Self {
        let threads = threads.unwrap_or_else(cores);
        let (width, height) = (plan.width, plan.height);
        let workers = ThreadPool::new("blur", threads);
        let slots: Vec<Slot> = (0..plan.slots()).map(|slot| Slot::new(&plan, slot)).collect();
        let members = (0..workers.thread_count())
            .map(|_| ThreadMemory {
                coc: vec![0.0; width],
                sums: BandSums::new(),
                // The pass needs a grid and one row of it.
                reach: Vec::with_capacity(slots.iter().map(|slot| slot.cells.data.len() * 2).max().unwrap_or(0)),
                blur: Scratch::new(&plan),
                layers: layers::Layers::new(),
            })
            .collect();
        let flags = |n: usize| (0..n).map(|_| AtomicBool::new(false)).collect();
        let gather = (plan.compositing == Compositing::Gather).then(|| Gather::new(&plan));
        Self {
            encode: encode::EncodeTable::new(),
            tiles: Tiles::new(width, height),
            silhouettes: Silhouettes::new(width, height),
            pyramid: (plan.compositing == Compositing::Layers).then(|| fill::Pyramid::new(width, height)),
            waits: vec![NONE; width.div_ceil(BLOCK) * height.div_ceil(CELL)],
            arch: Arch::new(),
            taken: flags(height.max(slots.len())),
            plan,
            workers,
            slots,
            gather,
            members,
            done: None,
        }
    }

    /// Changes the quality of the next frames, if the plan has other levels.
    pub fn set_quality(&mut self, quality: Quality) {
        self.plan.set_quality(quality);
    }

    /// Blurs the `pixels` of one picture into `out`, which has the same length. Calls `lap` with the name of each pass
    /// after it; `lap` may stop the frame, which leaves the buffers in an unusable state.
    pub(super) fn blur_pixels<T: Sample>(
        &mut self,
        pixels: &[T],
        coc: Radii<'_>,
        out: &mut [T],
        mut lap: impl FnMut(&'static str) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if out.is_empty() {
            return ControlFlow::Continue(());
        }
        let frame = Source::new(&self.plan, T::pixels(pixels), coc);
        self.split(&frame);
        lap("split")?;
        // If something is in front, blocks where it occludes anything get the bins behind it after the inpainting.
        self.bin(&frame, None);
        lap("bin")?;
        for layer in self.plan.layers().skip(1) {
            if let Some(pyramid) = &mut self.pyramid {
                pyramid.fill(&self.plan.unhidden(layer.start), &self.silhouettes, &mut self.workers, self.arch);
            }
            lap("fill")?;
            self.bin(&frame, Some(layer));
            lap("bin")?;
        }
        if let Some(gather) = &mut self.gather {
            let workers = (&mut self.workers, self.arch);
            let bin = &self.slots[0].source;
            gather.run(workers, &self.plan, &frame, bin, &mut self.taken, || lap("gather"))?;
            lap("gather")?;
        } else {
            self.reach();
            lap("reach")?;
            self.blur_bins();
            lap("blur")?;
        }
        self.composite(&frame, pixels, out);
        lap("composite")
    }

    /// Splits the frame's CoC into bins; finds the tiles that stay unchanged and the bins that are not empty.
    fn split(&mut self, frame: &Source<'_>) {
        let across = self.tiles.across;
        let layered = self.plan.compositing == Compositing::Layers;
        if layered {
            let near_from_px = self.plan.near_from_px();
            // Part 0 computes the split; the other parts each survey a row of tiles.
            let mut alone = [AtomicBool::new(false)];
            let plan = DisjointParts::new(std::slice::from_mut(&mut self.plan), 1, &mut alone);
            let ranges = DisjointParts::new(&mut self.tiles.ranges, across, &mut self.taken);
            let marks = self.silhouettes.marks(TILE_H);
            let arch = self.arch;
            self.workers.run_with(&mut self.members, self.tiles.down + 1, &|member: &mut ThreadMemory, part| {
                let Some(row) = part.checked_sub(1) else {
                    return match frame.coc {
                        Radii::Field(field, depth) => plan.part(0)[0].split(depth, field),
                        Radii::Each(coc_px) => plan.part(0)[0].split_radii(coc_px),
                    };
                };
                let ranges = ranges.part(row);
                arch.dispatch(Survey { source: frame, row, ranges: &mut *ranges, coc: &mut member.coc });
                let rows = row * TILE_H..((row + 1) * TILE_H).min(frame.size.1);
                arch.dispatch(Marking { source: frame, ranges, rows, marks: marks.part(row), near_from_px });
            });
            self.silhouettes.spread(&mut self.workers, arch);
        }
        self.tiles.settle(layered);
        // Near content may spread to any tile in focus, so bins are needed there as well.
        if self.plan.bins.iter().any(|bin| bin.near) {
            self.tiles.idle.fill(false);
        }
        let in_front = self.plan.layers().next().map_or(0, |layer| layer.end);
        for k in 0..self.plan.bins.len() {
            let bin = &self.plan.bins[k];
            let slot = &mut self.slots[bin.slot];
            let meets = || self.tiles.any_within(&self.plan.share(k), 0..self.tiles.across, 0..self.tiles.down);
            // Inpainted pixels may be in any bin behind.
            slot.present = !layered || k >= in_front || meets();
            slot.reshape(&self.plan, bin);
        }
    }

    /// Pass `bin`: all bins, or those of a `layer` in the blocks that waited for its inpainting.
    fn bin(&mut self, frame: &Source<'_>, layer: Option<Range<usize>>) {
        let plan = &self.plan;
        let blocks = plan.width.div_ceil(BLOCK);
        // Bands of at least 32 rows, because each reads some rows of its neighbours again.
        let coarsest = plan.bins.iter().map(|bin| bin.scale).max().unwrap_or(1).max(SCALES[2]);
        let rows = CELL * coarsest;
        let mut shelves: [Option<BinParts<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        for slot in self.slots.iter_mut().filter(|slot| slot.present) {
            let Some(k) = plan.bin_in(slot.index) else { continue };
            if layer.as_ref().is_none_or(|layer| layer.contains(&k)) {
                shelves[k] = Some(BinParts::new(plan, k, slot, rows));
            }
        }
        let (arch, tiles) = (self.arch, &self.tiles);
        let bands = plan.height.div_ceil(rows);
        let waits = DisjointParts::new(&mut self.waits[..bands * blocks], blocks, &mut self.taken);
        let behind = |first: usize| Layer { first, unhidden: plan.unhidden(first) };
        let mut layers = [behind(0); MAX_LAYERS];
        let mut count = 0;
        for (layer, range) in layers.iter_mut().zip(plan.layers().skip(1)) {
            (*layer, count) = (behind(range.start), count + 1);
        }
        let layers = &layers[..count];
        let (halves, filled) = match (&mut self.pyramid, layer) {
            (Some(pyramid), Some(Range { start: first, .. })) => {
                (None, Some((first, pyramid.behind(&self.silhouettes, plan, first))))
            }
            (Some(pyramid), None) if !layers.is_empty() => (Some(pyramid.halves(rows)), None),
            _ => (None, None),
        };
        self.workers.run_with(&mut self.members, bands, &|member: &mut ThreadMemory, band| {
            let hidden = match (&halves, filled) {
                (Some(halves), _) => Hidden::Waits { layers, halves: halves.band(band, rows, plan.height) },
                (_, Some((first, behind))) => Hidden::Filled { first, behind },
                _ => Hidden::Nothing,
            };
            arch.dispatch(Band {
                source: *frame,
                tiles,
                rows: band * rows..(band + 1) * rows,
                bins: std::array::from_fn(|k| shelves[k].as_ref().map(|shelf| shelf.part(band))),
                hidden,
                waits: waits.part(band),
                sums: &mut member.sums,
            });
        });
    }

    /// Pass `reach`: each part is a bin.
    fn reach(&mut self) {
        let (plan, arch) = (&self.plan, self.arch);
        let parts = DisjointParts::new(&mut self.slots, 1, &mut self.taken);
        self.workers.run_with(&mut self.members, plan.bins.len(), &|member: &mut ThreadMemory, part| {
            let bin = &plan.bins[part];
            for slot in parts.part(bin.slot).iter_mut().filter(|slot| slot.present) {
                let (cells, edges, scratch) = (&slot.cells, &mut slot.edges, &mut member.reach);
                arch.dispatch(Reach { plan, bin, cells, edges, scratch });
            }
        });
    }

    /// Pass `blur`: each part is a strip. The strips of all bins are numbered consecutively, so that no thread idles.
    fn blur_bins(&mut self) {
        let (plan, arch) = (&self.plan, self.arch);
        let mut shelves: [Option<StripParts<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        let mut parts = 0;
        for slot in self.slots.iter_mut().filter(|slot| slot.present) {
            let Some(k) = plan.bin_in(slot.index) else { continue };
            let strips = slot.source.across;
            shelves[k] = Some(StripParts::new(&plan.bins[k], slot, parts));
            parts += strips;
        }
        self.workers.run_with(&mut self.members, parts, &|member: &mut ThreadMemory, part| {
            // The bin of a part is the last one whose first part is not after it.
            let all = shelves.iter().zip(&plan.bins).filter_map(|(shelf, bin)| shelf.as_ref().zip(Some(bin)));
            let Some((shelf, bin)) = all.filter(|(shelf, _)| shelf.first <= part).max_by_key(|(shelf, _)| shelf.first)
            else {
                return;
            };
            let strip = part - shelf.first;
            arch.dispatch(Strip {
                source: shelf.source,
                size: (bin.width, bin.height),
                cells: shelf.cells,
                edges: shelf.edges,
                bank: &plan.bank,
                whole: plan.compositing != Compositing::Layers,
                turned: bin.near,
                reach: plan.bin_half_width(bin),
                strip,
                out: shelf.out.part(strip),
                active: shelf.active.part(strip),
                scratch: &mut member.blur,
            });
        });
    }

    /// Pass `composite`: each part is a row of tiles.
    fn composite<T: Sample>(&mut self, frame: &Source<'_>, pixels: &[T], out: &mut [T]) {
        let width = self.plan.width;
        let out = DisjointParts::new(out, TILE_H * width * 3, &mut self.taken);
        let gathered = self.gather.as_ref().map_or(&[][..], |gather| gather.result());
        let (plan, slots, tiles, silhouettes) = (&self.plan, &self.slots, &self.tiles, &self.silhouettes);
        let (arch, encode) = (self.arch, &self.encode);
        self.workers.run_with(&mut self.members, plan.height.div_ceil(TILE_H), &|member: &mut ThreadMemory, part| {
            let (y0, layers) = (part * TILE_H, &mut member.layers);
            let out = out.part(part);
            arch.dispatch(composite::Composite {
                plan,
                slots,
                tiles,
                silhouettes,
                frame,
                pixels,
                gathered,
                encode,
                y0,
                layers,
                out,
            });
        });
    }
}
