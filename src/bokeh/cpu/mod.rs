//! The CPU executor: uses every core and the best vector instructions available, and allocates nothing per frame.

mod band;
mod bin;
mod bin_parts;
mod blur;
mod cell_sums;
mod composite;
mod directional;
mod encode;
mod fill;
mod filter;
mod frames;
mod gather;
mod held;
mod layers;
mod levels;
mod marking;
mod pixels;
mod probe;
mod reach;
mod rows;
mod silhouettes;
mod survey;
mod tent;
mod tiles;
mod unpack;

use std::ops::{ControlFlow, Range};
use std::sync::atomic::AtomicBool;

use band::{Band, BandSums, Inpainting, Kept, Layer, NO_BIN};
use bin_parts::{BinParts, StripParts};
use blur::{Scratch, Strip};
use gather::Gather;
use held::{Held, HeldRows};
use marking::MarkSilhouettes;
use pulp::Arch;
use reach::DilateRadii;
use rows::Slot;
use silhouettes::Silhouettes;
use tiles::{BLOCK, ComputeTileRanges, TILE_H, Tiles};
use unpack::InputFrame;

use super::BlurredFrame;
use super::ladder::Compositing;
use super::occlusion::MAX_LAYERS;
use super::plan::{CELL, MAX_BINS, Plan};
use super::reuse::{CONTENT_BIN_W, Units, content_rows, is_kept};
use crate::budget::Quality;
use crate::compute::thread_pool::{DisjointParts, ThreadPool, core_count};

pub use pixels::{Pixels, Radii, Sample};
pub use unpack::{compression_factor, expansion_factor};

// Content is kept in whole strips.
const _: () = assert!(CONTENT_BIN_W == rows::STRIP);

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
    first_pending: Vec<usize>,
    gather: Option<Gather>,
    held: Option<Held>,
    thread_scratch: Vec<ThreadScratch>,
    /// Flags for [`DisjointParts`]: one per part of the largest pass.
    taken: Vec<AtomicBool>,
    /// The last frame, until it is collected.
    done: Option<BlurredFrame>,
    /// Fraction of the last frame that was kept from earlier ones.
    kept_fraction: f32,
}

/// Scratch memory of one thread.
struct ThreadScratch {
    coc: Vec<f32>,
    sums: BandSums,
    dilation: Vec<f32>,
    blur: Scratch,
    layers: layers::Layers,
    survey: Vec<u32>,
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
                sums: BandSums::new(),
                // The pass needs a grid and one row of it.
                dilation: Vec::with_capacity(slots.iter().map(|slot| slot.cells.data.len() * 2).max().unwrap_or(0)),
                blur: Scratch::new(&plan),
                layers: layers::Layers::new(),
                survey: Vec::with_capacity(if plan.reuse { width * 3 } else { 0 }),
            })
            .collect();
        let flags = |n: usize| (0..n).map(|_| AtomicBool::new(false)).collect();
        let gather = (plan.compositing == Compositing::Gather).then(|| Gather::new(&plan));
        Self {
            encode: encode::EncodeTable::new(),
            tiles: Tiles::new(width, height),
            silhouettes: Silhouettes::new(width, height),
            pyramid: (plan.compositing == Compositing::Layers).then(|| fill::Pyramid::new(width, height)),
            first_pending: vec![NO_BIN; width.div_ceil(BLOCK) * height.div_ceil(CELL)],
            arch: Arch::new(),
            taken: flags(height.max(slots.len())),
            workers,
            slots,
            gather,
            held: Held::new(&plan),
            thread_scratch,
            done: None,
            kept_fraction: 0.0,
            plan,
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
        let frame = InputFrame::new(&self.plan, T::as_pixels(pixels), coc);
        self.split_bins(&frame);
        lap("split")?;
        // Where results are kept, the bins' buffers keep what they are made from.
        let mut held = self.held.take();
        let mut units = None;
        if let Some(held) = &mut held {
            if self.find_kept(&frame, held) {
                units = Some((held.detector.content(), held.detector.results()));
            }
            lap("survey")?;
        }
        self.kept_fraction = units.map_or(0.0, |(_, results)| results.kept_fraction());
        let (content, results) = units.unzip();
        // If something is in front, blocks where it occludes anything get the bins behind it after the inpainting.
        self.compute_bins(&frame, None, content);
        lap("bin")?;
        for layer in self.plan.layers().skip(1) {
            if let Some(pyramid) = &mut self.pyramid {
                pyramid.fill(&self.plan.visible_weight(layer.start), &self.silhouettes, &mut self.workers, self.arch);
            }
            lap("fill")?;
            self.compute_bins(&frame, Some(layer), content);
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
            self.blur_bins(results);
            lap("blur")?;
        }
        let kept = self.kept_fraction > 0.0;
        self.composite(&frame, pixels, out, held.as_mut().and_then(|held| held.rows(kept)));
        self.held = held;
        lap("composite")
    }

    /// Splits the frame's CoC into bins; finds the tiles that stay unchanged and the bins that are not empty.
    fn split_bins(&mut self, frame: &InputFrame<'_>) {
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
            self.workers.run_with(
                &mut self.thread_scratch,
                self.tiles.down + 1,
                &|thread: &mut ThreadScratch, part| {
                    let Some(row) = part.checked_sub(1) else {
                        return match frame.coc {
                            Radii::Field(field, depth) => plan.part(0)[0].split_by_depth(depth, field),
                            Radii::Each(coc_px) => plan.part(0)[0].split_by_radii(coc_px),
                        };
                    };
                    let ranges = ranges.part(row);
                    arch.dispatch(ComputeTileRanges { source: frame, row, ranges: &mut *ranges, coc: &mut thread.coc });
                    let rows = row * TILE_H..((row + 1) * TILE_H).min(frame.size.1);
                    arch.dispatch(MarkSilhouettes {
                        source: frame,
                        ranges,
                        rows,
                        marks: marks.part(row),
                        near_from_px,
                    });
                },
            );
            self.silhouettes.dilate(&mut self.workers, arch);
        }
        self.tiles.classify(layered);
        // Near content may spread to any tile in focus, so bins are needed there as well.
        if self.plan.bins.iter().any(|bin| bin.near) {
            self.tiles.idle.fill(false);
        }
        let in_front = self.plan.layers().next().map_or(0, |layer| layer.end);
        for k in 0..self.plan.bins.len() {
            let bin = &self.plan.bins[k];
            let slot = &mut self.slots[bin.slot];
            let overlaps =
                || self.tiles.any_overlapping(&self.plan.bin_weight(k), 0..self.tiles.across, 0..self.tiles.down);
            // Inpainted pixels may be in any bin behind.
            slot.present = !layered || k >= in_front || overlaps();
            slot.reshape(&self.plan, bin);
        }
    }

    /// Pass `bin`: all bins, or those of a `layer` in the blocks that waited for its inpainting.
    fn compute_bins(&mut self, frame: &InputFrame<'_>, layer: Option<Range<usize>>, content: Option<&Units>) {
        let plan = &self.plan;
        let blocks = plan.width.div_ceil(BLOCK);
        let rows = content_rows(plan);
        let mut bin_parts: [Option<BinParts<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        for slot in self.slots.iter_mut().filter(|slot| slot.present) {
            let Some(k) = plan.bin_in_slot(slot.index) else { continue };
            if layer.as_ref().is_none_or(|layer| layer.contains(&k)) {
                bin_parts[k] = Some(BinParts::new(plan, k, slot, rows));
            }
        }
        let (arch, tiles) = (self.arch, &self.tiles);
        let bands = plan.height.div_ceil(rows);
        let first_pending = DisjointParts::new(&mut self.first_pending[..bands * blocks], blocks, &mut self.taken);
        let layer_from = |first: usize| Layer { first, visible_weight: plan.visible_weight(first) };
        let mut layers = [layer_from(0); MAX_LAYERS];
        let mut count = 0;
        for (layer, range) in layers.iter_mut().zip(plan.layers().skip(1)) {
            (*layer, count) = (layer_from(range.start), count + 1);
        }
        let layers = &layers[..count];
        let kept = content.map(|content| Kept { content, bins: plan.kept_bins() });
        let (halves, filled) = match (&mut self.pyramid, layer) {
            (Some(pyramid), Some(Range { start: first, .. })) => {
                (None, Some((first, pyramid.background(&self.silhouettes, plan, first))))
            }
            (Some(pyramid), None) if !layers.is_empty() => (Some(pyramid.half_picture(rows)), None),
            _ => (None, None),
        };
        self.workers.run_with(&mut self.thread_scratch, bands, &|thread: &mut ThreadScratch, band| {
            let inpainting = match (&halves, filled) {
                (Some(halves), _) => Inpainting::Pending { layers, halves: halves.band(band, rows, plan.height) },
                (_, Some((first, background))) => Inpainting::Done { first, background },
                _ => Inpainting::NotNeeded,
            };
            arch.dispatch(Band {
                source: *frame,
                tiles,
                rows: band * rows..(band + 1) * rows,
                bins: std::array::from_fn(|k| bin_parts[k].as_ref().map(|bin_part| bin_part.part(band))),
                inpainting,
                kept,
                first_pending: first_pending.part(band),
                sums: &mut thread.sums,
            });
        });
    }

    /// Pass `reach`: each part is a bin.
    fn dilate_radii(&mut self) {
        let (plan, arch) = (&self.plan, self.arch);
        let parts = DisjointParts::new(&mut self.slots, 1, &mut self.taken);
        self.workers.run_with(&mut self.thread_scratch, plan.bins.len(), &|thread: &mut ThreadScratch, part| {
            let bin = &plan.bins[part];
            for slot in parts.part(bin.slot).iter_mut().filter(|slot| slot.present) {
                let (cells, edges, scratch) = (&slot.cells, &mut slot.edges, &mut thread.dilation);
                arch.dispatch(DilateRadii { plan, bin, cells, edges, scratch });
            }
        });
    }

    /// Pass `blur`: each part is a strip. The strips of all bins are numbered consecutively, so that no thread idles.
    fn blur_bins(&mut self, units: Option<&Units>) {
        let (plan, arch) = (&self.plan, self.arch);
        let mut strip_parts: [Option<StripParts<'_>>; MAX_BINS] = [const { None }; MAX_BINS];
        let mut parts = 0;
        for slot in self.slots.iter_mut().filter(|slot| slot.present) {
            let Some(k) = plan.bin_in_slot(slot.index) else { continue };
            let strips = slot.source.across;
            strip_parts[k] = Some(StripParts::new(&plan.bins[k], slot, parts));
            parts += strips;
        }
        self.workers.run_with(&mut self.thread_scratch, parts, &|thread: &mut ThreadScratch, part| {
            // The bin of a part is the last one whose first part is not after it.
            let all =
                strip_parts.iter().zip(&plan.bins).filter_map(|(strip_part, bin)| strip_part.as_ref().zip(Some(bin)));
            let Some((strip_part, bin)) =
                all.filter(|(strip_part, _)| strip_part.first <= part).max_by_key(|(strip_part, _)| strip_part.first)
            else {
                return;
            };
            let strip = part - strip_part.first;
            arch.dispatch(Strip {
                source: strip_part.source,
                size: (bin.width, bin.height),
                units: units.filter(|_| is_kept(bin)),
                scale: bin.scale,
                cells: strip_part.cells,
                edges: strip_part.edges,
                bank: &plan.bank,
                whole: plan.compositing != Compositing::Layers,
                turned: bin.near,
                half_width: plan.bin_half_width(bin),
                strip,
                out: strip_part.out.part(strip),
                active: strip_part.active.part(strip),
                scratch: &mut thread.blur,
            });
        });
    }

    /// Pass `composite`: each part is a row of tiles.
    fn composite<T: Sample>(
        &mut self,
        frame: &InputFrame<'_>,
        pixels: &[T],
        out: &mut [T],
        held: Option<HeldRows<'_>>,
    ) {
        let width = self.plan.width;
        let out = DisjointParts::new(out, TILE_H * width * 3, &mut self.taken);
        let gathered = self.gather.as_ref().map_or(&[][..], |gather| gather.result());
        let (plan, slots, tiles, silhouettes) = (&self.plan, &self.slots, &self.tiles, &self.silhouettes);
        let (arch, encode) = (self.arch, &self.encode);
        self.workers.run_with(
            &mut self.thread_scratch,
            plan.height.div_ceil(TILE_H),
            &|thread: &mut ThreadScratch, part| {
                let (y0, layers) = (part * TILE_H, &mut thread.layers);
                let out = out.part(part);
                let held = held.as_ref().map(|rows| rows.part(part));
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
                    held,
                    out,
                });
            },
        );
    }
}
