//! The passes in their order: pipelines and bind groups are made once, and recorded for every frame.

use std::ops::Range;

use super::buffers::{BankBuffers, Buffers, work_count};
use super::layout::{self, Layout, count_tiles};
use super::shaders::{
    self, Bin, EDGES_TILE, MAX_TILE_WORKGROUPS, RESULT_TILE, ROWS_TILE, SMALL_TILE, TILE, WORKGROUP_1D, Work,
};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::occlusion::{MAX_LAYERS, SILHOUETTE_CELL};
use crate::bokeh::plan::{MAX_BINS, Plan};
use crate::compute::device::{Device, Pass, Recorder, Shader, UNIFORM_STRIDE, uniform_binding, workgroups_2d};

/// Index of the uniform `Work` of a dispatch: 0.. for layers, `ALL` for `reach`, then one per batch of the filters.
const ALL: usize = MAX_LAYERS;
const FIRST_BATCH: usize = ALL + 1;
/// Pass names under which several dispatches are timed together.
const FILL: &str = shaders::FILL.name;
const SILHOUETTES: &str = shaders::UNPACK.name;

/// The passes of a layer.
struct Layer {
    /// Inpainting of the background behind the layers in front: pull-push, and the filled scene. `None`
    /// for the foremost layer, which uses the scene unchanged.
    fill: Option<[Pass; 3]>,
    bin: Pass,
}

/// All passes of a frame.
pub struct Passes {
    clear: Pass,
    unpack: Pass,
    /// Dilation of the silhouettes over their grid, along rows and down columns.
    silhouettes: [Pass; 2],
    /// Finds the nearest surface, a possible occluder.
    find_occluders: Pass,
    layers: Vec<Layer>,
    gather: Option<Pass>,
    reach: Pass,
    /// Means of larger cells, and colours between them.
    decimate: [Pass; 2],
    /// Per bank, the row and column pass of each batch of bins and group of terms.
    blur: Vec<Vec<[Pass; 2]>>,
    composite: Pass,
    /// The uniforms `Work` as uploaded.
    work: Vec<u8>,
}

/// Creates passes.
struct PassBuilder<'a> {
    device: &'a Device,
    buffers: &'a Buffers,
}

impl PassBuilder<'_> {
    /// Creates a pass that binds these uniforms first and then `buffers`.
    fn create_pass(
        &self,
        shader: Shader,
        uniforms: &[wgpu::BufferBinding<'_>],
        buffers: &[&wgpu::Buffer],
        workgroups: [u32; 3],
    ) -> Pass {
        let buffers = buffers.iter().map(|buffer| buffer.as_entire_buffer_binding());
        Pass::new(self.device, shader, &shaders::CONSTANTS, uniforms.iter().cloned().chain(buffers), workgroups)
    }

    /// Creates a pass over several bins, given by uniform `Work` number `work`; binds that and the bins first. The
    /// number of workgroups depends on the frame.
    fn create_pass_over_bins(&self, shader: Shader, work: usize, buffers: &[&wgpu::Buffer]) -> Pass {
        let uniforms =
            [uniform_binding::<Work>(&self.buffers.work, work), self.buffers.bins.as_entire_buffer_binding()];
        self.create_pass(shader, &uniforms, buffers, [1; 3])
    }

    /// Creates the passes of a layer of a picture.
    fn create_layer(&self, index: usize, picture: [u32; 2]) -> Layer {
        let b = self.buffers;
        let fill = (index > 0).then(|| {
            let half = picture.map(|side| side.div_ceil(2));
            let pulled = [&b.frame, &b.scene, &b.nearest_px, &b.pyramid, &b.known, &b.mixed];
            let coarse = [&b.frame, &b.pyramid, &b.known];
            let (seen, nearest, lists) = ([&b.scene, &b.ranges, &b.inpainted], &b.nearest_px, &b.binned);
            let filled = [
                &b.frame, &b.pyramid, &b.known, seen[0], seen[1], seen[2], nearest, &b.bins, lists, &b.dilated,
                &b.mixed,
            ];
            let work = [uniform_binding::<Work>(&b.work, index)];
            [
                // A thread does four pixels of half the size, or of the picture.
                self.create_pass(shaders::PULL, &work, &pulled, covering_workgroups(half, 2 * TILE)).with_name(FILL),
                self.create_pass(shaders::COARSE, &[], &coarse, [1; 3]).with_name(FILL),
                self.create_pass(shaders::FILL, &work, &filled, covering_workgroups(picture, TILE)),
            ]
        });
        let (seen, lists) = ([&b.scene, &b.inpainted, &b.ranges], [&b.binned, &b.filtered]);
        let bin = [&b.frame, seen[0], seen[1], seen[2], &b.source, &b.grid, &b.mixed, lists[0], lists[1]];
        Layer { fill, bin: self.create_pass_over_bins(shaders::BIN, index, &bin) }
    }

    /// Creates the passes that blur with a bank, along rows and down columns, for batch and group of terms `k`.
    fn create_filters(&self, BankBuffers { taps: [horizontal, vertical], .. }: &BankBuffers, k: usize) -> [Pass; 2] {
        let b = self.buffers;
        let rows = [&b.frame, horizontal, &b.edges, &b.scene, &b.grid, &b.source, &b.rows, &b.filtered, &b.active];
        let columns = [&b.frame, vertical, &b.edges, &b.scene, &b.rows, &b.filtered, &b.blurred, &b.active, &b.shown];
        [
            self.create_pass_over_bins(shaders::BLUR_ROWS, FIRST_BATCH + k, &rows),
            self.create_pass_over_bins(shaders::BLUR_COLUMNS, FIRST_BATCH + k, &columns),
        ]
    }
}

/// Returns the bindings of `unpack`, including the depth map, whose buffer may be replaced.
fn unpack_bindings<'a>(b: &'a Buffers, metres: &'a wgpu::Buffer) -> impl Iterator<Item = wgpu::BufferBinding<'a>> {
    let read = [&b.bins, &b.frame, &b.color, metres];
    let buffers = read.into_iter().chain([&b.scene, &b.ranges, &b.mixed, &b.shown, &b.binned, &b.marks]);
    std::iter::once(uniform_binding::<Work>(&b.work, 0)).chain(buffers.map(wgpu::Buffer::as_entire_buffer_binding))
}

/// Returns the workgroups for a list of tiles, over which they loop.
fn looping_workgroups(tiles: usize) -> [u32; 3] {
    [tiles.clamp(1, MAX_TILE_WORKGROUPS) as u32, 1, 1]
}

/// Returns the workgroups of `tile` x `tile` invocations that cover `size`.
fn covering_workgroups(size: [u32; 2], tile: u32) -> [u32; 3] {
    let [across, down] = size.map(|size| size.div_ceil(tile));
    [across, down, 1]
}

impl Passes {
    /// Creates the passes of a plan over its buffers.
    pub fn new(device: &Device, plan: &Plan, b: &Buffers, metres: &wgpu::Buffer) -> Self {
        let builder = PassBuilder { device, buffers: b };
        let picture = [plan.width as u32, plan.height as u32];
        let grid = covering_workgroups(
            [plan.width, plan.height].map(|side| side.div_ceil(SILHOUETTE_CELL) as u32),
            SMALL_TILE,
        );
        let silhouettes = [
            builder
                .create_pass(shaders::DILATE_ROWS, &[], &[&b.frame, &b.marks, &b.row_dilated], grid)
                .with_name(SILHOUETTES),
            builder
                .create_pass(shaders::DILATE_COLUMNS, &[], &[&b.frame, &b.row_dilated, &b.dilated], grid)
                .with_name(SILHOUETTES),
        ];
        let find_occluders = [&b.frame, &b.scene, &b.nearest_px, &b.ranges, &b.mixed];
        let half = picture.map(|side| side.div_ceil(2));
        let find_occluders = builder
            .create_pass(shaders::FIND_OCCLUDERS, &[], &find_occluders, covering_workgroups(half, TILE))
            .with_name(FILL);
        // A batch has at least one bin, so there are no more batches than bins.
        let blur = b.banks.iter().map(|bank| {
            let steps = 0..MAX_BINS * bank.terms.div_ceil(4);
            steps.map(|k| builder.create_filters(bank, k)).collect()
        });
        let blur = blur.collect();
        let gather = plan.exact.then(|| {
            let [starts, kernels] = &b.kernels;
            let buffers = [&b.frame, starts, kernels, &b.scene, &b.banks[plan.bank_index].node_half_width, &b.blurred];
            builder.create_pass(shaders::GATHER, &[], &buffers, covering_workgroups(picture, TILE))
        });
        let composite = [&b.frame, &b.bins, &b.blurred, &b.scene, &b.result, &b.active, &b.shown, &b.dilated];
        let lines = workgroups_2d((plan.width * plan.height).div_ceil(WORKGROUP_1D as usize) as u32);
        let clear = [&b.binned, &b.filtered, &b.active, &b.grid];
        let unpack = Pass::new(
            device,
            shaders::UNPACK,
            &shaders::CONSTANTS,
            unpack_bindings(b, metres),
            covering_workgroups(picture, TILE),
        );
        let cleared = looping_workgroups(b.grid.size() as usize / (16 * WORKGROUP_1D as usize));
        Self {
            clear: builder.create_pass(shaders::CLEAR, &[], &clear, cleared),
            unpack,
            silhouettes,
            find_occluders,
            layers: (0..MAX_LAYERS).map(|index| builder.create_layer(index, picture)).collect(),
            gather,
            reach: builder.create_pass_over_bins(shaders::REACH, ALL, &[&b.grid, &b.edges]),
            decimate: [
                builder.create_pass_over_bins(shaders::DECIMATE, ALL, &[&b.grid, &b.source, &b.blurred]),
                builder.create_pass_over_bins(shaders::INTERPOLATE, ALL, &[&b.grid, &b.blurred, &b.source]),
            ],
            blur,
            composite: builder.create_pass(shaders::COMPOSITE, &[], &composite, lines),
            work: vec![0; work_count(plan) * UNIFORM_STRIDE as usize],
        }
    }

    /// Binds a new buffer for depth maps.
    pub fn bind_depth_buffer(&mut self, device: &Device, b: &Buffers, metres: &wgpu::Buffer) {
        self.unpack.rebind(device, unpack_bindings(b, metres));
    }

    /// Uploads the bins of each pass of this frame, with the terms of the plan's bank.
    pub fn upload(&mut self, device: &Device, b: &Buffers, plan: &Plan, layout: &Layout) {
        let terms = b.banks[plan.bank_index].terms;
        let groups = terms.div_ceil(4);
        let mut set = |index: usize, bins: &Range<usize>, group: usize| {
            let work = Work {
                first: bins.start as u32,
                count: bins.len() as u32,
                group: group as u32,
                terms: (terms - 4 * group).min(4) as u32,
                last: u32::from(group + 1 == groups),
                nearest_px: plan.min_inpainted_px(bins.start),
                visible_weight: plan.visible_weight(bins.start).front.into(),
            };
            let bytes = bytemuck::bytes_of(&work);
            self.work[index * UNIFORM_STRIDE as usize..][..bytes.len()].copy_from_slice(bytes);
        };
        for (index, bins) in plan.layers().enumerate() {
            set(index, &bins, 0);
        }
        set(ALL, &(0..layout.bins.len()), 0);
        for (k, bins) in layout.batches.iter().enumerate() {
            (0..groups).for_each(|group| set(FIRST_BATCH + k * groups + group, bins, group));
        }
        device.queue.write_buffer(&b.work, 0, &self.work);
        device.queue.write_buffer(&b.bins, 0, bytemuck::cast_slice(&layout.bins));
    }

    /// Records one frame at the plan's quality level.
    pub fn record(&self, recorder: &mut Recorder, plan: &Plan, layout: &Layout) {
        // Workgroups that loop over the tiles of some bins.
        let workgroups = |bins: &[Bin], of: &dyn Fn(&Bin) -> usize| looping_workgroups(bins.iter().map(of).sum());
        recorder.record(&self.clear);
        recorder.record(&self.unpack);
        if let Some(gather) = &self.gather {
            recorder.record(gather);
        } else {
            if plan.compositing == Compositing::Layers {
                self.silhouettes.iter().for_each(|pass| recorder.record(pass));
            }
            for ((index, bins), layer) in plan.layers().enumerate().zip(&self.layers) {
                // Nothing hides the foremost layer.
                if index == 1 {
                    recorder.record(&self.find_occluders);
                }
                layer.fill.iter().flatten().for_each(|pass| recorder.record(pass));
                recorder.record_workgroups(
                    &layer.bin,
                    workgroups(&layout.bins[bins], &|bin| layout::count_bin_tiles(bin.size, bin.scale)),
                );
            }
            let edges = layout.bins.iter().map(|bin| count_tiles([2 * bin.edges, bin.cells[1]], EDGES_TILE) as u32);
            recorder.record_workgroups(&self.reach, workgroups_2d(edges.sum()));
            self.record_decimation(recorder, &layout.bins);
            let groups = plan.bank.terms.div_ceil(4);
            for (batch, steps) in layout.batches.iter().zip(self.blur[plan.bank_index].chunks_exact(groups)) {
                let bins = &layout.bins[batch.clone()];
                for [rows, columns] in steps {
                    recorder.record_workgroups(rows, workgroups(bins, &|bin| count_tiles(bin.size, ROWS_TILE)));
                    recorder.record_workgroups(columns, workgroups(bins, &|bin| count_tiles(bin.size, RESULT_TILE)));
                }
            }
        }
        recorder.record(&self.composite);
    }

    /// Records the decimation of the bins that are decimated.
    fn record_decimation(&self, recorder: &mut Recorder, bins: &[Bin]) {
        let tiles = |size: &dyn Fn(&Bin) -> [u32; 2]| -> u32 {
            let decimated = bins.iter().filter(|bin| bin.decimation > 1);
            decimated.map(|bin| count_tiles(size(bin), [SMALL_TILE as usize; 2]) as u32).sum()
        };
        let [decimate, interpolate] = &self.decimate;
        let means = tiles(&|bin| bin.size.map(|side| side.div_ceil(bin.decimation)));
        if means > 0 {
            recorder.record_workgroups(decimate, workgroups_2d(means));
            recorder.record_workgroups(interpolate, workgroups_2d(tiles(&|bin| bin.size)));
        }
    }
}
