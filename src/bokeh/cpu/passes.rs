//! The passes of a frame, each shared out to the threads.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::band::{Band, Inpainting, Layer};
use super::bin_parts::{BinParts, StripParts};
use super::blur::Strip;
use super::composite::Composite;
use super::marking::MarkSilhouettes;
use super::pixels::Sample;
use super::reach::DilateRadii;
use super::tiles::{BLOCK, ComputeTileRanges, TILE_H};
use super::unpack::InputFrame;
use super::{CpuBokeh, ThreadScratch};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::occlusion::{DISTANCES_PER_CELL, MAX_LAYERS};
use crate::bokeh::plan::MAX_BINS;
use crate::compute::thread_pool::DisjointParts;

impl CpuBokeh {
    /// Splits the frame's CoC into bins; finds the tiles that stay unchanged and the bins that are not empty.
    pub(super) fn split_bins(&mut self, frame: &InputFrame<'_>) {
        let across = self.tiles.across;
        let layered = self.plan.compositing == Compositing::Layers;
        if layered {
            let near_from_px = self.plan.near_from_px();
            let (down, arch) = (self.tiles.down, self.arch);
            self.tiles.find_mixed(frame.matte, frame.size);
            let first_mixed = &self.tiles.first_mixed;
            let mixed =
                |row: usize| frame.matte.map_or(&[][..], |matte| &matte.pixels[first_mixed[row]..first_mixed[row + 1]]);
            let ranges = DisjointParts::new(&mut self.tiles.ranges, across, &mut self.taken);
            self.workers.run_with(&mut self.thread_scratch, down, &|thread: &mut ThreadScratch, row| {
                let (mixed, ranges) = (mixed(row), ranges.part(row));
                let (coc, lanes) = (&mut thread.coc, &mut thread.lanes);
                arch.dispatch(ComputeTileRanges { source: frame, row, mixed, ranges, coc, lanes });
            });
            // Part 0 computes the split; the other parts each survey a row of tiles.
            let mut alone = [AtomicBool::new(false)];
            let plan = DisjointParts::new(std::slice::from_mut(&mut self.plan), 1, &mut alone);
            let (all, marks) = (&self.tiles.ranges, self.silhouettes.marks(TILE_H));
            self.workers.run(down + 1, &|part| {
                let Some(row) = part.checked_sub(1) else {
                    return frame.coc.split(&mut plan.part(0)[0]);
                };
                let ranges = |row: usize| &all[row.min(down - 1) * across..][..across];
                let (ranges, rows) =
                    ([ranges(row), ranges(row + 1)], row * TILE_H..((row + 1) * TILE_H).min(frame.size.1));
                let (mixed, marks) = (mixed(row), marks.part(row));
                arch.dispatch(MarkSilhouettes { source: frame, ranges, rows, mixed, marks, near_from_px });
            });
            // With nothing in front, no background is inpainted.
            let planes =
                if self.plan.bins.iter().any(|bin| bin.near) { DISTANCES_PER_CELL } else { DISTANCES_PER_CELL - 1 };
            self.silhouettes.dilate(planes, &mut self.workers, arch);
        } else {
            self.tiles.set_ranges(frame.coc);
        }
        self.tiles.classify(layered);
        self.tiles.find_only_bins(&self.plan, frame.matte);
        let sharp = self.plan.sharp_bin();
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
            // What is in focus is read from the picture.
            slot.present = Some(k) != sharp && (!layered || k >= in_front || overlaps());
            slot.reshape(&self.plan, bin);
        }
    }

    /// Pass `bin`: all bins, or those of a `layer` in the blocks that waited for its inpainting.
    pub(super) fn compute_bins(&mut self, frame: &InputFrame<'_>, layer: Option<Range<usize>>) {
        let plan = &self.plan;
        let blocks = plan.width.div_ceil(BLOCK);
        let rows = plan.band_rows();
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
                bins: std::array::from_fn(|k| {
                    let bin_part = bin_parts[k].as_ref()?;
                    let needed = plan.content_rows(&plan.bins[k]);
                    (band * rows < needed.end && needed.start < (band + 1) * rows).then(|| bin_part.part(band))
                }),
                inpainting,
                first_pending: first_pending.part(band),
                scratch: &mut thread.band,
            });
        });
    }

    /// Pass `reach`: each part is a bin.
    pub(super) fn dilate_radii(&mut self) {
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

    /// Pass `decimate`: bin by bin.
    pub(super) fn decimate_bins(&mut self) {
        let plan = &self.plan;
        for slot in self.slots.iter_mut().filter(|slot| slot.present && plan.bin_in_slot(slot.index).is_some()) {
            if let Some(decimated) = slot.decimated.as_mut().filter(|decimated| decimated.is_in_use()) {
                let threads = (&mut self.workers, &mut self.thread_scratch[..]);
                decimated.run(&slot.source, threads, self.arch, &mut slot.taken[0]);
            }
        }
    }

    /// Pass `blur`: each part is a strip. The strips of all bins are numbered consecutively, so that no thread idles.
    pub(super) fn blur_bins(&mut self) {
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
                decimated: strip_part.decimated,
                size: (bin.width, bin.height),
                wanted_px: plan.wanted_rows(),
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
    pub(super) fn composite<T: Sample>(&mut self, frame: &InputFrame<'_>, pixels: &[T], out: &mut [T]) {
        let width = self.plan.width;
        let out = DisjointParts::new(out, TILE_H * width * 3, &mut self.taken);
        let gathered = self.gather.as_ref().map_or(&[][..], |gather| gather.result());
        let (plan, slots, tiles, silhouettes) = (&self.plan, &self.slots, &self.tiles, &self.silhouettes);
        let (arch, encoder) = (self.arch, &*self.encoder);
        self.workers.run_with(
            &mut self.thread_scratch,
            plan.height.div_ceil(TILE_H),
            &|thread: &mut ThreadScratch, part| {
                let (y0, scratch, wanted) = (part * TILE_H, &mut thread.composite, plan.wanted_rows());
                if y0 >= wanted.end || y0 + TILE_H <= wanted.start {
                    return;
                }
                let out = out.part(part);
                arch.dispatch(Composite {
                    plan,
                    slots,
                    tiles,
                    silhouettes,
                    frame,
                    pixels,
                    gathered,
                    encoder,
                    y0,
                    scratch,
                    out,
                });
            },
        );
    }
}
