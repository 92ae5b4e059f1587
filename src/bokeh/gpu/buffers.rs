//! Device buffers, allocated once per picture size.

use super::layout::Capacity;
use super::shaders::{Bin, Frame, LIST_HEAD};
use crate::bokeh::bank::FilterBank;
use crate::bokeh::ladder::Compositing;
use crate::bokeh::occlusion::{MAX_LAYERS, SILHOUETTE_CELL};
use crate::bokeh::plan::{MAX_BINS, Plan};
use crate::compute::device::{Device, UNIFORM_STRIDE};
use crate::frame::{Matte, MixedPixel};

/// Device buffers of a plan.
pub struct Buffers {
    /// Uniform `Frame`.
    pub frame: wgpu::Buffer,
    /// Uniform `Bin`, an array.
    pub bins: wgpu::Buffer,
    /// Uniforms `Work`, one every [`UNIFORM_STRIDE`] bytes.
    pub work: wgpu::Buffer,
    pub color: wgpu::Buffer,
    /// Linear light and CoC.
    pub scene: wgpu::Buffer,
    /// Mixed pixels: uploaded in metres, later the nearer surface of each.
    pub mixed: wgpu::Buffer,
    /// CoC range of each tile of the picture.
    pub ranges: wgpu::Buffer,
    /// Silhouettes: radius per cell, dilated along rows, and dilated along both axes.
    pub marks: wgpu::Buffer,
    pub row_dilated: wgpu::Buffer,
    pub dilated: wgpu::Buffer,
    /// The scene as a layer behind others sees it, inpainted.
    pub inpainted: wgpu::Buffer,
    /// Pictures of all bins.
    pub source: wgpu::Buffer,
    /// Coarse grids of all bins.
    pub grid: wgpu::Buffer,
    /// Radius and colour range at the segment edges of all bins.
    pub edges: wgpu::Buffer,
    /// Results of the horizontal filters, for the bins of a batch.
    pub rows: wgpu::Buffer,
    pub blurred: wgpu::Buffer,
    /// Lists of non-empty tiles: of the bins, of their rows, and of their results.
    pub binned: wgpu::Buffer,
    pub filtered: wgpu::Buffer,
    pub active: wgpu::Buffer,
    /// Per tile of the picture, a bit mask of the bins with content there.
    pub shown: wgpu::Buffer,
    pub result: wgpu::Buffer,
    /// CoC of the nearest surface, at half size.
    pub nearest_px: wgpu::Buffer,
    /// All levels of the pyramid.
    pub pyramid: wgpu::Buffer,
    /// Known weight of each pixel of the pyramid.
    pub known: wgpu::Buffer,
    /// Filters of each bank.
    pub banks: Vec<BankBuffers>,
    /// Kernels of the exact gather, and the start of each node's kernel.
    pub kernels: [wgpu::Buffer; 2],
}

/// Filters of a bank.
pub struct BankBuffers {
    pub terms: usize,
    /// Horizontal and vertical taps, four terms per vector.
    pub taps: [wgpu::Buffer; 2],
    /// Outermost tap of each node.
    pub node_half_width: wgpu::Buffer,
}

/// Returns the bytes of a packed picture, in whole words of whole groups of four pixels.
pub fn packed_picture_bytes(plan: &Plan) -> u64 {
    (plan.width * plan.height).div_ceil(4) as u64 * 12
}

/// Returns the largest number of uniforms `Work` of a frame: one per layer, one for all bins, and for the filters one
/// per group of four terms of every batch of bins.
pub fn work_count(plan: &Plan) -> usize {
    MAX_LAYERS + 1 + MAX_BINS * plan.ladder.max_terms().div_ceil(4)
}

/// Returns the bytes of the largest matte.
pub fn mixed_bytes(plan: &Plan) -> u64 {
    let is_layered = plan.compositing == Compositing::Layers;
    let pixels = if is_layered { Matte::capacity(plan.width, plan.height).max(1) } else { 1 };
    (pixels * size_of::<MixedPixel>()) as u64
}

/// Returns the bytes of the largest buffer of filters or kernels.
pub fn max_filter_bytes(plan: &Plan) -> u64 {
    let of_bank = |bank: &FilterBank| (bank.horizontal.len() / bank.terms * bank.terms.div_ceil(4) * 16) as u64;
    let of_node = |&half_width: &u32| u64::from(2 * half_width + 1).pow(2) * 4;
    let kernels = if plan.exact { plan.bank.node_half_width.iter().map(of_node).sum() } else { 0 };
    plan.ladder.banks.iter().map(|bank| of_bank(bank)).fold(kernels, u64::max)
}

impl Buffers {
    /// Allocates everything and uploads the constant data.
    pub fn new(device: &Device, plan: &Plan, capacity: &Capacity) -> Self {
        use wgpu::BufferUsages as Usage;
        let buffer = |label: &str, bytes: usize, usage: Usage| {
            device.create_buffer(label, bytes.next_multiple_of(16), usage | Usage::COPY_DST)
        };
        let with_data = |label: &str, data: &[u8]| {
            let target = buffer(label, data.len(), Usage::STORAGE);
            device.queue.write_buffer(&target, 0, data);
            target
        };
        let bank_buffers = |bank: &FilterBank| BankBuffers {
            terms: bank.terms,
            taps: [&bank.horizontal, &bank.vertical]
                .map(|taps| with_data("bank", bytemuck::cast_slice(&pad_to_fours(taps, bank.terms)))),
            node_half_width: with_data("node reach", bytemuck::cast_slice(&bank.node_half_width)),
        };
        // In words of four bytes: a bin's pixel is four halves, a cell or an edge eight floats.
        let storage = |label: &str, words: usize| buffer(label, words * 4, Usage::STORAGE | Usage::COPY_SRC);
        // A flag and a place for each tile.
        let list = |label: &str, tiles: usize| storage(label, LIST_HEAD + 2 * tiles);
        let (width, height) = (plan.width, plan.height);
        let layered = plan.compositing == Compositing::Layers;
        let pyramid_pixels = if layered { count_pyramid_pixels(width, height) } else { 1 };
        let (behind, tiles) = (if layered { width * height } else { 1 }, width.div_ceil(16) * height.div_ceil(16));
        let grid = if layered { width.div_ceil(SILHOUETTE_CELL) * height.div_ceil(SILHOUETTE_CELL) } else { 1 };
        let (kernels, starts) = if plan.exact { concatenate_kernels(&plan.bank) } else { (vec![0.0], vec![0]) };
        let work_bytes = work_count(plan) * UNIFORM_STRIDE as usize;
        Self {
            frame: buffer("frame", size_of::<Frame>(), Usage::UNIFORM),
            bins: buffer("bins", MAX_BINS * size_of::<Bin>(), Usage::UNIFORM),
            work: buffer("work", work_bytes, Usage::UNIFORM),
            color: storage("color", packed_picture_bytes(plan) as usize / 4),
            scene: storage("scene", width * height * 2),
            mixed: storage("mixed", mixed_bytes(plan) as usize / 4),
            ranges: storage("ranges", tiles * 2),
            marks: storage("marks", grid * 4),
            row_dilated: storage("along", grid * 4),
            dilated: storage("reached", grid * 4),
            inpainted: storage("behind", behind * 2),
            source: storage("source", capacity.pixels * 2),
            grid: storage("grid", capacity.cells * 8),
            edges: storage("edges", capacity.edges * 8),
            rows: storage("rows", capacity.rows * 2 * plan.ladder.max_terms().min(4)),
            blurred: storage("blurred", capacity.pixels * 2),
            binned: list("binned", capacity.binned),
            filtered: list("filtered", capacity.filtered),
            active: list("active", capacity.active),
            shown: storage("shown", tiles),
            result: storage("result", packed_picture_bytes(plan) as usize / 4),
            nearest_px: storage("nearest", if layered { width.div_ceil(2) * height.div_ceil(2) } else { 1 }),
            pyramid: storage("pyramid", pyramid_pixels * 4),
            known: storage("known", pyramid_pixels),
            banks: plan.ladder.banks.iter().map(|bank| bank_buffers(bank)).collect(),
            kernels: [
                with_data("kernel starts", bytemuck::cast_slice(&starts)),
                with_data("kernels", bytemuck::cast_slice(&kernels)),
            ],
        }
    }

    /// Creates a buffer for a depth map of `pixels` pixels.
    pub fn create_depth_buffer(device: &Device, pixels: usize) -> wgpu::Buffer {
        device.create_buffer("depth", 4 * pixels, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)
    }
}

/// Pads the terms of each tap with zeros to groups of four, the vectors of the shaders.
fn pad_to_fours(taps: &[f32], terms: usize) -> Vec<[f32; 4]> {
    let padded = |tap: &[f32]| {
        let mut four = [0.0; 4];
        four[..tap.len()].copy_from_slice(tap);
        four
    };
    taps.chunks(terms).flat_map(|tap| tap.chunks(4).map(padded)).collect()
}

/// Returns the number of stored pixels of the pyramid: all levels from a quarter of the picture's size to one pixel.
fn count_pyramid_pixels(width: usize, height: usize) -> usize {
    let halved = |size: &[usize; 2]| size.map(|side| side.div_ceil(2));
    let finest = [width, height].map(|side| side.div_ceil(4));
    let levels = std::iter::successors(Some(finest), |level| (*level != [1, 1]).then(|| halved(level)));
    levels.map(|[across, down]| across * down).sum()
}

/// Returns the kernels of all nodes, one after the other, and the start of each.
fn concatenate_kernels(bank: &FilterBank) -> (Vec<f32>, Vec<u32>) {
    let (mut taps, mut starts) = (Vec::new(), Vec::new());
    for node in 0..bank.nodes {
        starts.push(taps.len() as u32);
        taps.extend(bank.kernel(node, false));
    }
    (taps, starts)
}
