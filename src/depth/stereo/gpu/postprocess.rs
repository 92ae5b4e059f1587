//! The passes that post-process a map: remove speckles and fill gaps.
//!
//! Speckles are small connected components, found by label equivalence with union-find in the labels: runs of rows
//! first, which are then joined from row to row by atomic minima (after Komura, *GPU-based cluster-labeling algorithm
//! without the use of conventional iteration*, Computer Physics Communications, 2015). Whatever the order, the root of
//! a component is its first pixel that begins a run.

use super::shaders::{self, Constants, linear_workgroups};
use crate::compute::device::{Device, Pass};

/// Buffers of four bytes per pixel each, with any content.
pub struct Scratch<'a> {
    pub labels: &'a wgpu::Buffer,
    pub sizes: &'a wgpu::Buffer,
    pub filled: &'a wgpu::Buffer,
}

/// Returns the passes that remove the speckles of `map`, a word per pixel, and write it with its gaps filled to
/// `words`, two pixels per word.
pub fn create_passes(
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
        pass(shaders::JOIN, &[map, labels], linear_workgroups(pixels)),
        pass(shaders::SIZES, &[map, labels, sizes], linear_workgroups(pixels)),
        pass(shaders::GAPS, &[labels, sizes, map, filled], rows),
        pass(shaders::PACK, &[filled, words], linear_workgroups(pixels.div_ceil(2))),
    ]
}
