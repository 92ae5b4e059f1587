//! What lives on the device: allocated once per picture size.

use super::device::Device;
use super::shaders::{Bin, Group, Level};
use crate::bokeh::bank::Bank;
use crate::bokeh::plan::{CELL, Compositing, Plan, SEGMENT};

/// Columns of a strip of the CPU executor: both executors' grids are as wide, so that their cells agree.
const GRID_ROUNDING: usize = 64;

/// The buffers of a plan.
pub struct Buffers {
    /// Uniform `Frame`.
    pub frame: wgpu::Buffer,
    /// Uniform `Bin`, one each.
    pub bins: Vec<wgpu::Buffer>,
    /// The same as one array.
    pub all_bins: wgpu::Buffer,
    /// Uniform `Group`, one each.
    pub groups: Vec<wgpu::Buffer>,
    /// Uniform `Level`, one for each step of the pyramid.
    pub levels: Vec<wgpu::Buffer>,
    /// Sizes of those steps: fine, coarse.
    pub level_sizes: Vec<([u32; 2], [u32; 2])>,
    /// Packed picture in.
    pub color: wgpu::Buffer,
    /// Linear light and CoC.
    pub scene: wgpu::Buffer,
    /// A bin's picture.
    pub source: Vec<wgpu::Buffer>,
    /// Coverage times |CoC|, shared by all bins.
    pub weighted_coc: wgpu::Buffer,
    /// Coarse grid, shared by all bins.
    pub grid: wgpu::Buffer,
    /// Radius and range of colours at the edges of segments.
    pub edges: Vec<wgpu::Buffer>,
    /// Results of the horizontal filters, shared by all bins.
    pub rows: wgpu::Buffer,
    /// All blurred bins.
    pub blurred: wgpu::Buffer,
    /// Packed picture out.
    pub result: wgpu::Buffer,
    /// Half-size flags of what near objects touch.
    pub hidden: wgpu::Buffer,
    /// All levels of the pyramid.
    pub pyramid: wgpu::Buffer,
    /// How much each of its pixels knows.
    pub known: wgpu::Buffer,
    /// Horizontal and vertical filters, four terms a vector.
    pub banks: [wgpu::Buffer; 2],
    /// Outermost tap of each node.
    pub node_reach: wgpu::Buffer,
    /// Kernels of the exact gather, and where each node's starts.
    pub kernels: [wgpu::Buffer; 2],
}

/// Bytes of a packed picture, in whole words of whole quads.
pub fn picture_bytes(plan: &Plan) -> u64 {
    (plan.width * plan.height).div_ceil(4) as u64 * 12
}

/// The uniforms of a plan's bins.
pub fn bin_uniforms(plan: &Plan) -> Vec<Bin> {
    let mut offset = 0;
    let whole = plan.compositing != Compositing::Layers;
    (0..plan.bins.len())
        .map(|k| {
            let bin = &plan.bins[k];
            let cells_across = bin.width.next_multiple_of(GRID_ROUNDING) / CELL;
            let share = plan.share(k);
            let uniform = Bin {
                size: [bin.width as u32, bin.height as u32],
                cells: [cells_across as u32, bin.height.div_ceil(CELL) as u32],
                scale: bin.scale as u32,
                edges: (cells_across * CELL / SEGMENT + 1) as u32,
                turned: u32::from(bin.near),
                whole: u32::from(whole),
                front: share.front.into(),
                behind: share.behind.into(),
                max_radius_px: bin.max_radius_px,
                sigma_cells: bin.sigma_cells(),
                reach_cells: plan.reach_cells(bin) as u32,
                offset,
            };
            offset += (bin.width * bin.height) as u32;
            uniform
        })
        .collect()
}

impl Buffers {
    /// Allocates everything and uploads what never changes.
    pub fn new(device: &Device, plan: &Plan) -> Self {
        use wgpu::BufferUsages as Usage;
        let buffer = |label: &str, bytes: usize, usage: Usage| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                // A binding must not be empty.
                size: bytes.max(16).next_multiple_of(16) as u64,
                usage: usage | Usage::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let filled = |label: &str, data: &[u8], usage: Usage| {
            let target = buffer(label, data.len(), usage);
            device.queue.write_buffer(&target, 0, data);
            target
        };
        let storage = |label: &str, values: usize| buffer(label, values * 4, Usage::STORAGE | Usage::COPY_SRC);
        let uniforms = bin_uniforms(plan);
        let (width, height) = (plan.width, plan.height);
        let largest = plan.bins.iter().map(|bin| bin.width * bin.height).max().unwrap_or(1);
        let all: usize = plan.bins.iter().map(|bin| bin.width * bin.height).sum();
        let cells = uniforms.iter().map(|bin| bin.cells[0] as usize * bin.cells[1] as usize).max().unwrap_or(1);
        let layered = plan.compositing == Compositing::Layers;
        let (levels, pyramid_pixels) = if layered && plan.fill { levels(width, height) } else { (Vec::new(), 1) };
        let (kernels, starts) = if plan.exact { kernels(&plan.bank) } else { (vec![0.0], vec![0]) };
        let terms = plan.bank.terms;
        let groups = (0..terms.div_ceil(4)).map(|k| Group {
            index: k as u32,
            terms: (terms - 4 * k).min(4) as u32,
            last: u32::from(4 * (k + 1) >= terms),
            unused: 0,
        });
        Self {
            frame: buffer("frame", size_of::<super::shaders::Frame>(), Usage::UNIFORM),
            bins: uniforms.iter().map(|bin| filled("bin", bytemuck::bytes_of(bin), Usage::UNIFORM)).collect(),
            all_bins: filled("bins", bytemuck::cast_slice(&uniforms), Usage::STORAGE),
            groups: groups.map(|group| filled("group", bytemuck::bytes_of(&group), Usage::UNIFORM)).collect(),
            level_sizes: levels.iter().map(|level| (level.fine, level.coarse)).collect(),
            levels: levels.iter().map(|level| filled("level", bytemuck::bytes_of(level), Usage::UNIFORM)).collect(),
            color: storage("color", picture_bytes(plan) as usize / 4),
            scene: storage("scene", width * height * 4),
            source: uniforms.iter().map(|bin| storage("source", (bin.size[0] * bin.size[1]) as usize * 4)).collect(),
            weighted_coc: storage("weighted coc", largest),
            grid: storage("grid", cells * 8),
            edges: uniforms.iter().map(|bin| storage("edges", (bin.edges * bin.cells[1]) as usize * 8)).collect(),
            rows: storage("rows", largest * 4 * terms.min(4)),
            blurred: storage("blurred", all * 4),
            result: storage("result", picture_bytes(plan) as usize / 4),
            hidden: storage("hidden", if layered { width.div_ceil(2) * height.div_ceil(2) } else { 1 }),
            pyramid: storage("pyramid", pyramid_pixels * 4),
            known: storage("known", pyramid_pixels),
            banks: [&plan.bank.horizontal, &plan.bank.vertical]
                .map(|taps| filled("bank", bytemuck::cast_slice(&in_fours(taps, terms)), Usage::STORAGE)),
            node_reach: filled("node reach", bytemuck::cast_slice(&plan.bank.node_reach), Usage::STORAGE),
            kernels: [
                filled("kernel starts", bytemuck::cast_slice(&starts), Usage::STORAGE),
                filled("kernels", bytemuck::cast_slice(&kernels), Usage::STORAGE),
            ],
        }
    }

    /// A buffer for depth of `values` metres.
    pub fn depth(device: &Device, values: usize) -> wgpu::Buffer {
        device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("depth"),
            size: (values.max(4) * 4) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }
}

/// Taps padded with zeros to whole groups of four terms.
fn in_fours(taps: &[f32], terms: usize) -> Vec<[f32; 4]> {
    let padded = |tap: &[f32]| {
        let mut four = [0.0; 4];
        four[..tap.len()].copy_from_slice(tap);
        four
    };
    taps.chunks(terms).flat_map(|tap| tap.chunks(4).map(padded)).collect()
}

/// The steps of the pyramid, finest first, and its pixels in all.
fn levels(width: usize, height: usize) -> (Vec<Level>, usize) {
    let (mut fine, mut offset, mut steps) = ([width.div_ceil(2), height.div_ceil(2)], 0, Vec::new());
    while fine != [1, 1] {
        let coarse = [fine[0].div_ceil(2), fine[1].div_ceil(2)];
        let next = offset + fine[0] * fine[1];
        steps.push(Level {
            fine: fine.map(|v| v as u32),
            coarse: coarse.map(|v| v as u32),
            fine_offset: offset as u32,
            coarse_offset: next as u32,
            unused: [0; 2],
        });
        (fine, offset) = (coarse, next);
    }
    (steps, offset + 1)
}

/// Every node's kernel, one after the other, and where each starts.
fn kernels(bank: &Bank) -> (Vec<f32>, Vec<u32>) {
    let (mut taps, mut starts) = (Vec::new(), Vec::new());
    for node in 0..bank.nodes {
        starts.push(taps.len() as u32);
        taps.extend(bank.kernel(node, false));
    }
    (taps, starts)
}
