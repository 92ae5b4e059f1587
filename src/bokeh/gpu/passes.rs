//! The passes in their order: pipelines and bind groups made once, one `encode` per frame.

use super::buffers::Buffers;
use super::device::Device;
use super::readback::MAX_QUERIES;
use super::shaders::{self, Shader};
use crate::bokeh::plan::{Compositing, Plan};

/// Invocations of a workgroup in x and y, as the shaders declare them.
const TILE: u32 = 16;
const SMALL_TILE: u32 = 8;
const LINE: u32 = 64;

/// One dispatch: a pipeline, its buffers and how many workgroups.
struct Step {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    workgroups: [u32; 2],
}

/// Everything that a frame runs.
pub struct Passes {
    unpack: Shader,
    unpack_pipeline: wgpu::ComputePipeline,
    unpack_bindings: wgpu::BindGroup,
    unpack_workgroups: [u32; 2],
    fill: Vec<Step>,
    /// Per bin.
    bins: Vec<Vec<Step>>,
    finish: Vec<Step>,
    near_bins: usize,
}

/// Makes the steps.
struct Maker<'a> {
    device: &'a wgpu::Device,
    made: Vec<(&'static str, wgpu::ComputePipeline)>,
}

impl Maker<'_> {
    fn pipeline(&mut self, shader: Shader) -> wgpu::ComputePipeline {
        if let Some((_, pipeline)) = self.made.iter().find(|(name, _)| *name == shader.name) {
            return pipeline.clone();
        }
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(shader.name),
            source: wgpu::ShaderSource::Wgsl(shader.source.into()),
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(shader.name),
            layout: None,
            module: &module,
            entry_point: Some(shader.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &shaders::CONSTANTS,
                ..Default::default()
            },
            cache: None,
        });
        self.made.push((shader.name, pipeline.clone()));
        pipeline
    }

    fn bindings(&self, pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .enumerate()
            .map(|(k, buffer)| wgpu::BindGroupEntry { binding: k as u32, resource: buffer.as_entire_binding() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    fn step(
        &mut self,
        name: &'static str,
        shader: Shader,
        size: [u32; 2],
        tile: [u32; 2],
        buffers: &[&wgpu::Buffer],
    ) -> Step {
        let pipeline = self.pipeline(shader);
        let bindings = self.bindings(&pipeline, buffers);
        Step { name, pipeline, bindings, workgroups: [size[0].div_ceil(tile[0]), size[1].div_ceil(tile[1])] }
    }
}

impl Passes {
    /// The passes of a plan over its buffers.
    pub fn new(device: &Device, plan: &Plan, b: &Buffers, depth: &wgpu::Buffer) -> Self {
        let mut maker = Maker { device: &device.device, made: Vec::new() };
        let picture = [plan.width as u32, plan.height as u32];
        let half = picture.map(|v| v.div_ceil(2));
        let (square, small, line) = ([TILE; 2], [SMALL_TILE; 2], [LINE, 1]);

        let unpack_pipeline = maker.pipeline(shaders::UNPACK);
        let unpack_bindings = maker.bindings(&unpack_pipeline, &[&b.frame, &b.color, depth, &b.scene]);

        let mut fill = Vec::new();
        if !b.levels.is_empty() {
            fill.push(maker.step("fill", shaders::HIDE, half, square, &[&b.frame, &b.scene, &b.hidden]));
            let known = [&b.frame, &b.scene, &b.hidden, &b.pyramid, &b.known];
            fill.push(maker.step("fill", shaders::KNOW, half, square, &known));
            for (level, (_, coarse)) in b.levels.iter().zip(&b.level_sizes) {
                fill.push(maker.step("fill", shaders::PULL, *coarse, small, &[level, &b.pyramid, &b.known]));
            }
            for (level, (fine, _)) in b.levels.iter().zip(&b.level_sizes).rev() {
                fill.push(maker.step("fill", shaders::PUSH, *fine, small, &[level, &b.pyramid, &b.known]));
            }
            let filled = [&b.frame, &b.hidden, &b.pyramid, &b.scene];
            fill.push(maker.step("fill", shaders::FILL, picture, square, &filled));
        }

        let mut bins = Vec::new();
        for (k, info) in super::buffers::bin_uniforms(plan).iter().enumerate() {
            let (bin, source, edges) = (&b.bins[k], &b.source[k], &b.edges[k]);
            if plan.exact {
                let [starts, kernels] = &b.kernels;
                let buffers = [&b.frame, starts, kernels, &b.scene, &b.node_reach, &b.blurred];
                bins.push(vec![maker.step("gather", shaders::GATHER, picture, square, &buffers)]);
                continue;
            }
            let across = [info.edges, info.cells[1]];
            let mut steps = vec![
                maker.step("bin", shaders::BIN, info.size, square, &[&b.frame, bin, &b.scene, source, &b.weighted_coc]),
                maker.step("cells", shaders::CELLS, info.cells, small, &[bin, source, &b.weighted_coc, &b.grid]),
                maker.step("reach", shaders::REACH, across, small, &[bin, &b.grid, edges]),
            ];
            for group in &b.groups {
                let [horizontal, vertical] = &b.banks;
                let rows = [&b.frame, bin, group, horizontal, &b.node_reach, edges, source, &b.rows, &b.scene];
                steps.push(maker.step("blur_rows", shaders::BLUR_ROWS, info.size, line, &rows));
                let columns = [&b.frame, bin, group, vertical, &b.node_reach, edges, &b.rows, &b.blurred, &b.scene];
                steps.push(maker.step("blur_columns", shaders::BLUR_COLUMNS, info.size, line, &columns));
            }
            bins.push(steps);
        }

        let quads = (plan.width * plan.height).div_ceil(4) as u32;
        let columns = quads.div_ceil(LINE).min(32_768);
        let size = [columns * LINE, quads.div_ceil(columns * LINE)];
        let composite = [&b.frame, &b.all_bins, &b.blurred, &b.scene, &b.result];
        let finish = vec![maker.step("composite", shaders::COMPOSITE, size, line, &composite)];
        let near_bins = match plan.compositing {
            Compositing::Layers => plan.bins.iter().filter(|bin| bin.near).count(),
            _ => 0,
        };
        Self {
            unpack: shaders::UNPACK,
            unpack_workgroups: picture.map(|v| v.div_ceil(TILE)),
            unpack_pipeline,
            unpack_bindings,
            fill,
            bins,
            finish,
            near_bins,
        }
    }

    /// Binds another depth buffer.
    pub fn set_depth(&mut self, device: &Device, b: &Buffers, depth: &wgpu::Buffer) {
        let maker = Maker { device: &device.device, made: Vec::new() };
        self.unpack_bindings = maker.bindings(&self.unpack_pipeline, &[&b.frame, &b.color, depth, &b.scene]);
    }

    /// Records one frame: bins that nothing belongs to (bit `k` of `present`) are left out. `names` gets the name of
    /// every pass that `queries` times.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        present: u32,
        queries: Option<&wgpu::QuerySet>,
        names: &mut Vec<&'static str>,
    ) {
        let unpack =
            std::iter::once((self.unpack.name, &self.unpack_pipeline, &self.unpack_bindings, self.unpack_workgroups));
        let here = |k: &usize| present & (1 << k) != 0;
        let any_near = (0..self.near_bins).any(|k| here(&k));
        let near = (0..self.near_bins).filter(here).flat_map(|k| &self.bins[k]);
        let fill = self.fill.iter().filter(|_| any_near);
        let rest = (self.near_bins..self.bins.len()).filter(here).flat_map(|k| &self.bins[k]);
        let steps = near.chain(fill).chain(rest).chain(&self.finish);
        let steps = steps.map(|step| (step.name, &step.pipeline, &step.bindings, step.workgroups));
        for (name, pipeline, bindings, [x, y]) in unpack.chain(steps) {
            let index = 2 * names.len() as u32;
            let timed = queries.filter(|_| index + 1 < MAX_QUERIES);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(name),
                timestamp_writes: timed.map(|query_set| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(index),
                    end_of_pass_write_index: Some(index + 1),
                }),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bindings, &[]);
            pass.dispatch_workgroups(x, y, 1);
            drop(pass);
            if timed.is_some() {
                names.push(name);
            }
        }
    }
}
