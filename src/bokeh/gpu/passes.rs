//! The passes in their order: pipelines and bind groups made once, one `encode` per frame.

use std::ops::Range;

use super::buffers::{Buffers, Filters, WORK_STRIDE, work_count};
use super::layout::{self, Layout, tiles};
use super::readback::MAX_QUERIES;
use super::shaders::{self, Bin, EDGES_TILE, LINE, RESULT_TILE, ROWS_TILE, TAKING_TURNS, TILE, Work};
use crate::bokeh::occlusion::MOST_LAYERS;
use crate::bokeh::plan::{MAX_BINS, Plan};
use crate::compute::device::{Device, Shader, workgroups_2d};

/// Which uniform `Work` a dispatch has: that of its layer, of `reach`, or of a batch of the filters.
const ALL: usize = MOST_LAYERS;
const FIRST_BATCH: usize = ALL + 1;

/// One pass: a pipeline and its buffers.
struct Step {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
}

/// A pass over the picture or the pyramid: always as many workgroups.
struct Fixed {
    step: Step,
    workgroups: [u32; 2],
}

/// The passes of a layer.
struct Layer {
    /// What is known behind those in front of it, up and down a pyramid, and the scene with that filled in; the foremost
    /// has the scene as it is.
    fill: Option<[Fixed; 3]>,
    bin: Step,
}

/// Everything that a frame runs.
pub struct Passes {
    clear: Fixed,
    unpack: Fixed,
    /// What may hide others.
    hide: Fixed,
    layers: Vec<Layer>,
    gather: Option<Fixed>,
    reach: Step,
    /// For each bank, rows and columns of each batch of bins and group of terms.
    blur: Vec<Vec<[Step; 2]>>,
    composite: Fixed,
    /// The uniforms `Work` as they are uploaded.
    work: Vec<u8>,
}

/// Makes the passes.
struct Maker<'a> {
    device: &'a Device,
    buffers: &'a Buffers,
}

impl Maker<'_> {
    fn pipeline(&self, shader: Shader) -> wgpu::ComputePipeline {
        self.device.pipeline(shader, &shaders::CONSTANTS)
    }

    /// A pass with these uniforms first and then `buffers`; its time counts for `name`.
    fn step(
        &self,
        name: &'static str,
        shader: Shader,
        uniforms: &[wgpu::BufferBinding<'_>],
        buffers: &[&wgpu::Buffer],
    ) -> Step {
        let pipeline = self.pipeline(shader);
        let buffers = buffers.iter().map(|buffer| buffer.as_entire_buffer_binding());
        let bindings = self.device.bindings(&pipeline, uniforms.iter().cloned().chain(buffers));
        Step { name, pipeline, bindings }
    }

    /// A pass over several bins at once, which are in uniform `Work` number `work`; binds that and the bins first.
    fn over_bins(&self, name: &'static str, shader: Shader, work: usize, buffers: &[&wgpu::Buffer]) -> Step {
        let uniforms = [work_binding(self.buffers, work), self.buffers.bins.as_entire_buffer_binding()];
        self.step(name, shader, &uniforms, buffers)
    }
}

/// Uniform `Work` number `index`.
fn work_binding(b: &Buffers, index: usize) -> wgpu::BufferBinding<'_> {
    let size = wgpu::BufferSize::new(size_of::<Work>() as u64);
    wgpu::BufferBinding { buffer: &b.work, offset: index as u64 * WORK_STRIDE, size }
}

/// The bind group of `unpack`: the CoC of the depth map is in it, whose buffer may become another.
fn unpack_bindings(
    device: &Device,
    pipeline: &wgpu::ComputePipeline,
    b: &Buffers,
    radii: &wgpu::Buffer,
) -> wgpu::BindGroup {
    let buffers = [&b.bins, &b.frame, &b.color, radii, &b.scene, &b.ranges, &b.mixed, &b.shown, &b.binned];
    let buffers = buffers.map(wgpu::Buffer::as_entire_buffer_binding);
    device.bindings(pipeline, std::iter::once(work_binding(b, 0)).chain(buffers))
}

/// Workgroups for so many pieces of work, which they take turns with.
fn turns(pieces: usize) -> u32 {
    pieces.clamp(1, TAKING_TURNS) as u32
}

/// A pass over `size` invocations in workgroups of `tile` x `tile`.
fn over(step: Step, size: [u32; 2], tile: u32) -> Fixed {
    Fixed { step, workgroups: size.map(|size| size.div_ceil(tile)) }
}

impl Passes {
    /// The passes of a plan over its buffers.
    pub fn new(device: &Device, plan: &Plan, b: &Buffers, radii: &wgpu::Buffer) -> Self {
        let maker = Maker { device, buffers: b };
        let picture = [plan.width as u32, plan.height as u32];
        let half = picture.map(|v| v.div_ceil(2));

        let hide = [&b.frame, &b.scene, &b.nearest_px, &b.ranges, &b.mixed];
        let hide = over(maker.step("fill", shaders::HIDE, &[], &hide), half, TILE);
        let layers = (0..MOST_LAYERS).map(|index| {
            let fill = (index > 0).then(|| {
                let pulled = [&b.frame, &b.scene, &b.nearest_px, &b.pyramid, &b.known];
                let coarse = [&b.frame, &b.pyramid, &b.known];
                let known = [&b.pyramid, &b.known];
                let (seen, nearest) = ([&b.scene, &b.ranges, &b.behind], &b.nearest_px);
                let filled = [&b.frame, known[0], known[1], seen[0], seen[1], seen[2], nearest, &b.bins, &b.binned];
                let work = [work_binding(b, index)];
                [
                    // A thread takes four pixels of half the size, or of the picture.
                    over(maker.step("fill", shaders::PULL, &work, &pulled), half, 2 * TILE),
                    over(maker.step("fill", shaders::COARSE, &[], &coarse), [1, 1], 1),
                    over(maker.step("fill", shaders::FILL, &work, &filled), picture, TILE),
                ]
            });
            let (seen, lists) = ([&b.scene, &b.behind, &b.ranges], [&b.binned, &b.filtered]);
            let bin = [&b.frame, seen[0], seen[1], seen[2], &b.source, &b.grid, &b.mixed, lists[0], lists[1]];
            Layer { fill, bin: maker.over_bins("bin", shaders::BIN, index, &bin) }
        });
        let layers = layers.collect();
        let filters = |bank: &Filters, k: usize| {
            let [horizontal, vertical] = &bank.taps;
            let rows = [&b.frame, horizontal, &b.edges, &b.scene, &b.grid, &b.source, &b.rows, &b.filtered, &b.active];
            let columns =
                [&b.frame, vertical, &b.edges, &b.scene, &b.rows, &b.filtered, &b.blurred, &b.active, &b.shown];
            [
                maker.over_bins("blur_rows", shaders::BLUR_ROWS, FIRST_BATCH + k, &rows),
                maker.over_bins("blur_columns", shaders::BLUR_COLUMNS, FIRST_BATCH + k, &columns),
            ]
        };
        // A batch has at least one bin, so there are no more batches than bins.
        let blur = b.banks.iter().map(|bank| {
            let steps = 0..MAX_BINS * bank.terms.div_ceil(4);
            steps.map(|k| filters(bank, k)).collect()
        });
        let blur = blur.collect();
        let gather = plan.exact.then(|| {
            let [starts, kernels] = &b.kernels;
            let buffers = [&b.frame, starts, kernels, &b.scene, &b.banks[plan.bank_index].node_reach, &b.blurred];
            over(maker.step("gather", shaders::GATHER, &[], &buffers), picture, TILE)
        });
        let composite = [&b.frame, &b.bins, &b.blurred, &b.scene, &b.result, &b.active, &b.shown];
        let composite = Fixed {
            step: maker.step("composite", shaders::COMPOSITE, &[], &composite),
            workgroups: workgroups_2d((plan.width * plan.height).div_ceil(LINE as usize) as u32),
        };
        let clear = [&b.binned, &b.filtered, &b.active, &b.grid];
        let pipeline = maker.pipeline(shaders::UNPACK);
        let bindings = unpack_bindings(device, &pipeline, b, radii);
        let unpack = Step { name: "unpack", pipeline, bindings };
        Self {
            clear: Fixed {
                step: maker.step("clear", shaders::CLEAR, &[], &clear),
                workgroups: [turns(b.grid.size() as usize / (16 * LINE as usize)), 1],
            },
            unpack: over(unpack, picture, TILE),
            hide,
            layers,
            gather,
            reach: maker.over_bins("reach", shaders::REACH, ALL, &[&b.grid, &b.edges]),
            blur,
            composite,
            work: vec![0; work_count(plan) * WORK_STRIDE as usize],
        }
    }

    /// Binds another buffer of the CoC of depth maps.
    pub fn set_radii(&mut self, device: &Device, b: &Buffers, radii: &wgpu::Buffer) {
        self.unpack.step.bindings = unpack_bindings(device, &self.unpack.step.pipeline, b, radii);
    }

    /// Uploads which bins each pass of this frame does, with the terms of the plan's bank.
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
                nearest_px: plan.nearest_behind_px(bins.start),
                unhidden: plan.unhidden(bins.start).front.into(),
            };
            let bytes = bytemuck::bytes_of(&work);
            self.work[index * WORK_STRIDE as usize..][..bytes.len()].copy_from_slice(bytes);
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

    /// Records one frame of a plan's level. `names` gets the name of every pass that `queries` times.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        plan: &Plan,
        layout: &Layout,
        queries: Option<&wgpu::QuerySet>,
        names: &mut Vec<&'static str>,
    ) {
        let mut run = |step: &Step, [x, y]: [u32; 2]| {
            let index = 2 * names.len() as u32;
            let timed = queries.filter(|_| index + 1 < MAX_QUERIES);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(step.name),
                timestamp_writes: timed.map(|query_set| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(index),
                    end_of_pass_write_index: Some(index + 1),
                }),
            });
            pass.set_pipeline(&step.pipeline);
            pass.set_bind_group(0, &step.bindings, &[]);
            pass.dispatch_workgroups(x, y, 1);
            drop(pass);
            if timed.is_some() {
                names.push(step.name);
            }
        };
        // Workgroups that take turns with the tiles of some bins.
        let workgroups = |bins: &[Bin], of: &dyn Fn(&Bin) -> usize| [turns(bins.iter().map(of).sum()), 1];
        run(&self.clear.step, self.clear.workgroups);
        run(&self.unpack.step, self.unpack.workgroups);
        if let Some(gather) = &self.gather {
            run(&gather.step, gather.workgroups);
        } else {
            for ((index, bins), layer) in plan.layers().enumerate().zip(&self.layers) {
                if index == 1 {
                    run(&self.hide.step, self.hide.workgroups);
                }
                layer.fill.iter().flatten().for_each(|fixed| run(&fixed.step, fixed.workgroups));
                run(&layer.bin, workgroups(&layout.bins[bins], &|bin| layout::binned_tiles(bin.size, bin.scale)));
            }
            let edges = layout.bins.iter().map(|bin| tiles([2 * bin.edges, bin.cells[1]], EDGES_TILE) as u32);
            run(&self.reach, workgroups_2d(edges.sum()));
            let groups = plan.bank.terms.div_ceil(4);
            for (batch, steps) in layout.batches.iter().zip(self.blur[plan.bank_index].chunks_exact(groups)) {
                let bins = &layout.bins[batch.clone()];
                for [rows, columns] in steps {
                    run(rows, workgroups(bins, &|bin| tiles(bin.size, ROWS_TILE)));
                    run(columns, workgroups(bins, &|bin| tiles(bin.size, RESULT_TILE)));
                }
            }
        }
        run(&self.composite.step, self.composite.workgroups);
    }
}
