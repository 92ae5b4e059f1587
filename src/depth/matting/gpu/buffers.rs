//! GPU buffers for one picture size.

use super::shaders::{BLOCK, CELL, COLORS, COUNTS, ENTRY, Frame, LANES, MAX_BUFFERS, PassRun, RUNS, WORD};
use crate::compute::GpuError;
use crate::compute::device::{Device, Readback, UNIFORM_STRIDE, uniform_binding};
use crate::depth::matting::alpha::PRIOR_ROUNDS;
use crate::depth::matting::clusters::CELL_PX;
use crate::frame::{Matte, MixedPixel};

/// All buffers of a picture.
pub struct Buffers {
    pub frame: wgpu::Buffer,
    runs: wgpu::Buffer,
    /// Per code, its linear light, and that of a remembered code in each channel.
    pub lights: wgpu::Buffer,
    pub metres: wgpu::Buffer,
    pub rgb: wgpu::Buffer,
    /// The remembered background: sRGB, rounds, and inverse depth.
    pub background: wgpu::Buffer,
    /// Bitmaps with the number of set bits before each word: of edges, and of mixed pixels.
    pub edges: wgpu::Buffer,
    pub marks: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    pub clusters: wgpu::Buffer,
    pub cells: wgpu::Buffer,
    /// Per pixel, its entry, or the directions it was claimed from.
    pub places: wgpu::Buffer,
    pub entries: wgpu::Buffer,
    /// Both colours of each model.
    pub colors: wgpu::Buffer,
    /// Per round of expectation maximisation, the partial sums of each workgroup.
    pub partials: wgpu::Buffer,
    /// The number of mixed pixels, and the pixels.
    pub mixed: wgpu::Buffer,
    pub readback: Readback,
}

/// Dimensions that follow from the picture size.
#[derive(Clone, Copy)]
pub struct Extent {
    pub pixels: usize,
    /// Maximum number of entries, and of mixed pixels.
    pub max_entries: usize,
    /// Words of the bitmap, each of 32 pixels of a row; cells in each direction.
    pub words: usize,
    pub cells: [u32; 2],
}

impl Extent {
    pub fn new((width, height): (u32, u32)) -> Self {
        let (pixels, max_entries) =
            (width as usize * height as usize, Matte::max_pixels(width as usize, height as usize));
        let words = width.div_ceil(WORD) as usize * height as usize;
        Self { pixels, max_entries, words, cells: [width, height].map(|side| side.div_ceil(CELL_PX as u32)) }
    }
}

impl Buffers {
    /// Allocates the buffers for pictures of `size` pixels.
    ///
    /// # Errors
    /// The device has too little memory, or allows too few buffers per shader.
    pub fn new(device: &Device, size: (u32, u32)) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let Extent { pixels, max_entries, words, cells } = Extent::new(size);
        // Buffers must not be empty.
        let max_entries = max_entries.max(1);
        let cells: usize = cells.iter().map(|&side| side as usize).product();
        // The colours of surfaces are the largest buffer.
        device.check_picture_size(size, (COLORS * max_entries) as u64, "matted")?;
        if device.device.limits().max_storage_buffers_per_shader_stage < MAX_BUFFERS {
            return Err(GpuError::Failed(format!(
                "{}: its limit of buffers per shader is too low for mattes",
                device.name
            )));
        }
        let buffer = |label, bytes, usage| device.create_buffer(label, bytes, usage);
        let storage = |label, bytes: usize| buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST);
        let uniform = |label, bytes: usize| buffer(label, bytes, Usage::UNIFORM | Usage::COPY_DST);
        let record = size_of::<MixedPixel>();
        // Sizes in bytes: 4 a number, 16 a vector (vec4), 12 vectors for the three clusters of a cell.
        let buffers = device.with_error_scope(|| Self {
            frame: uniform("matted frame", size_of::<Frame>()),
            runs: uniform("turns", RUNS * UNIFORM_STRIDE as usize),
            lights: uniform("lights", 256 * 16),
            metres: storage("refined depth", 4 * pixels),
            rgb: storage("matted rgb", 3 * pixels),
            background: storage("known behind", background_offsets(pixels)[2] as usize + 4 * pixels),
            edges: storage("edges", 8 * words),
            marks: storage("marks", 8 * words),
            counts: storage("matte counts", 4 * (COUNTS + words.div_ceil(BLOCK as usize))),
            clusters: storage("clusters", 12 * 16 * cells),
            cells: storage("cells", CELL * cells),
            places: storage("places", 4 * pixels),
            entries: storage("entries", ENTRY * max_entries),
            colors: storage("colors of surfaces", COLORS * max_entries),
            partials: storage("partials", 16 * LANES as usize * PRIOR_ROUNDS),
            mixed: buffer("mixed", record * (1 + max_entries), Usage::STORAGE | Usage::COPY_SRC),
            readback: Readback::new(device, "mixed back", record * (1 + max_entries)),
        })?;
        for run in 0..RUNS {
            device.upload(
                &buffers.runs,
                run as u64 * UNIFORM_STRIDE,
                bytemuck::bytes_of(&PassRun { index: run as u32 }),
            );
        }
        Ok(buffers)
    }

    /// Returns the uniform of the given run of a pass.
    pub fn run_binding(&self, run: usize) -> wgpu::BufferBinding<'_> {
        uniform_binding::<PassRun>(&self.runs, run)
    }
}

/// Returns the byte offsets of the sRGB, the rounds, and the inverse depth in `background`.
pub fn background_offsets(pixels: usize) -> [u64; 3] {
    let rounds = (3 * pixels).next_multiple_of(4);
    [0, rounds as u64, (rounds + pixels.next_multiple_of(4)) as u64]
}
