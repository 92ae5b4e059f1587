//! The passes in order: bind groups are created once per picture size, and recorded once per frame.

use super::buffers::{Buffers, Extent};
use super::shaders::{self, BLOCK, LANES, ROWS, RUNS, WORD, workgroup_count};
use crate::compute::device::{Device, Pass, Recorder, Shader};
use crate::depth::matting::alpha::PRIOR_ROUNDS;

/// All passes of a frame.
pub struct Passes(Vec<Pass>);

impl Passes {
    /// Creates the passes over the buffers for pictures of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32), b: &Buffers) -> Self {
        let Extent { max_entries, words, cells, .. } = Extent::new(size);
        let over = |shader: Shader, again, run: Option<usize>, buffers: &[&wgpu::Buffer], [across, down]: [u32; 2]| {
            let first = std::iter::once(b.frame.as_entire_buffer_binding()).chain(run.map(|run| b.run_binding(run)));
            let all = first.chain(buffers.iter().map(|buffer| buffer.as_entire_buffer_binding()));
            Pass::new(device, shader, &shaders::constants(again), all, [across, down, 1])
        };
        let count = |again| {
            let bits = if again { &b.marks } else { &b.edges };
            let blocks = (words as u32).div_ceil(BLOCK);
            [
                over(shaders::COUNT, again, None, &[&b.metres, bits, &b.counts], [blocks, 1]),
                over(shaders::TOTAL, again, None, &[&b.counts, &b.mixed], [1, 1]),
            ]
        };
        let of_entries = [workgroup_count(max_entries.div_ceil(LANES as usize)), 1];
        let of_cells = [workgroup_count((cells[0] * cells[1]) as usize / 4), 1];

        let tiles = [size.0.div_ceil(WORD), size.1.div_ceil(ROWS)];
        let mut passes =
            vec![over(shaders::FIND_EDGES, false, None, &[&b.metres, &b.edges, &b.counts, &b.cells], tiles)];
        passes.extend(count(false));
        let clusters = [&b.lights, &b.metres, &b.rgb, &b.edges, &b.clusters];
        passes.push(over(shaders::CLUSTERS, false, None, &clusters, cells));
        let edges = [&b.lights, &b.metres, &b.rgb, &b.background, &b.edges, &b.counts, &b.clusters];
        let entered = [&b.cells, &b.places, &b.entries, &b.colors];
        passes.push(over(shaders::EDGES, false, None, &[&edges[..], &entered].concat(), of_cells));
        let expect = [&b.counts, &b.entries, &b.partials];
        passes.extend((0..PRIOR_ROUNDS).map(|round| over(shaders::EXPECT, false, Some(round), &expect, [LANES, 1])));
        let weigh = [&b.metres, &b.partials, &b.counts, &b.cells, &b.places, &b.entries];
        passes.push(over(shaders::WEIGH, false, None, &weigh, of_entries));
        let trace = [&b.lights, &b.metres, &b.rgb, &b.background, &b.partials, &b.clusters, &b.counts];
        let trace = [&trace[..], &entered].concat();
        passes.extend((1..RUNS).map(|step| over(shaders::TRACE, false, Some(step), &trace, of_cells)));
        let wide = [&b.counts, &b.places, &b.entries];
        passes.extend((1..RUNS).map(|step| over(shaders::SPREAD, false, Some(step), &wide, of_entries)));
        passes.push(over(shaders::MARK, false, None, &[&b.counts, &b.entries, &b.marks], of_entries));
        passes.extend(count(true));
        let mix = [&b.lights, &b.rgb, &b.background, &b.marks, &b.counts, &b.colors, &b.entries, &b.mixed];
        passes.push(over(shaders::MIX, false, None, &mix, of_entries));
        Self(passes)
    }

    /// Records all passes of a frame.
    pub fn record(&self, recorder: &mut Recorder) {
        self.0.iter().for_each(|pass| recorder.record(pass));
    }
}
