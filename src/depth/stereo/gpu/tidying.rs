//! The passes that tidy up a map: islands are dropped and gaps filled.
//!
//! Islands are found by label equivalence, with union-find in the labels: runs of rows first, which are then joined from
//! row to row by atomic minima (after Komura, *GPU-based cluster-labeling algorithm without the use of conventional
//! iteration*, Computer Physics Communications, 2015). Whatever the order, the root of an island is its first pixel that
//! begins a run.

use super::shaders::{self, Constants, in_line};
use crate::compute::device::{Device, Pass};

/// Four bytes a pixel each, of any content.
pub struct Scratch<'a> {
    pub labels: &'a wgpu::Buffer,
    pub sizes: &'a wgpu::Buffer,
    pub filled: &'a wgpu::Buffer,
}

/// Passes that drop the islands of `map`, a word a pixel, and leave it without its gaps in `words`, two pixels a word.
pub fn passes(
    device: &Device,
    (width, height): (usize, usize),
    constants: &Constants,
    map: &wgpu::Buffer,
    Scratch { labels, sizes, filled }: Scratch,
    words: &wgpu::Buffer,
) -> [Pass; 5] {
    let (pixels, rows) = (width * height, [height as u32, 1, 1]);
    let pass = |shader, buffers: &[&wgpu::Buffer], workgroups| {
        Pass::new(device, shader, constants, buffers.iter().map(|buffer| buffer.as_entire_buffer_binding()), workgroups)
    };
    [
        pass(shaders::RUNS, &[map, labels, sizes], rows),
        pass(shaders::JOIN, &[map, labels], in_line(pixels)),
        pass(shaders::SIZES, &[map, labels, sizes], in_line(pixels)),
        pass(shaders::GAPS, &[labels, sizes, map, filled], rows),
        pass(shaders::PACK, &[filled, words], in_line(pixels.div_ceil(2))),
    ]
}
