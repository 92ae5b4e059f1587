//! The passes in their order: bind groups are created once for pictures of one size.

use super::super::align::ROUNDS;
use super::buffers::Buffers;
use super::shaders::{self, COLUMNS, STRIP, TILE, WAVES};
use crate::compute::device::{Device, Pass, Recorder, Shader};

/// All passes of a frame.
pub struct Passes {
    prepare: Pass,
    /// Hole filling, for maps with any known depth.
    fill: Vec<Pass>,
    /// Noise, smoothing, and edge alignment.
    align: Vec<Pass>,
    /// Colour change since the last frame, if there is one.
    change: [Pass; 2],
    steady: Pass,
}

/// Creates the passes for pictures of one size.
struct PassBuilder<'a> {
    device: &'a Device,
    size: [u32; 2],
    b: &'a Buffers,
}

impl<'a> PassBuilder<'a> {
    /// Creates a pass over the frame's uniform and `buffers`; `again` selects its second variant.
    fn create_pass(
        &self,
        shader: Shader,
        again: bool,
        buffers: impl IntoIterator<Item = wgpu::BufferBinding<'a>>,
        [across, down]: [u32; 2],
    ) -> Pass {
        let frame = self.b.frame.as_entire_buffer_binding();
        let buffers = std::iter::once(frame).chain(buffers);
        Pass::new(self.device, shader, &shaders::constants(again), buffers, [across, down, 1])
    }

    fn create_tiled<const N: usize>(
        &self,
        shader: Shader,
        again: bool,
        tile: [u32; 2],
        buffers: [&'a wgpu::Buffer; N],
    ) -> Pass {
        let [across, down] = [0, 1].map(|axis| self.size[axis].div_ceil(tile[axis]));
        self.create_pass(shader, again, buffers.map(wgpu::Buffer::as_entire_buffer_binding), [across, down])
    }

    /// Creates a pass of a single workgroup.
    fn create_single<const N: usize>(&self, shader: Shader, again: bool, buffers: [&'a wgpu::Buffer; N]) -> Pass {
        self.create_pass(shader, again, buffers.map(wgpu::Buffer::as_entire_buffer_binding), [1, 1])
    }

    fn create_prepare(&self) -> Pass {
        let b = self.b;
        let made = [&b.colors, &b.flags, &b.filled, &b.inverse, &b.worklist];
        let buffers = [&b.map, &b.taps, &b.rgb].into_iter().chain(made).map(wgpu::Buffer::as_entire_buffer_binding);
        let workgroups = [0, 1].map(|axis| self.size[axis].div_ceil(TILE[axis]));
        self.create_pass(shaders::PREPARE, false, buffers, workgroups)
    }

    fn create_fill(&self, again: bool) -> [Pass; 2] {
        let b = self.b;
        let [width, height] = self.size;
        [
            self.create_tiled(shaders::BESIDE, again, [width, 1], [&b.counts, &b.filled, &b.scratch]),
            self.create_tiled(shaders::FILL, again, [COLUMNS, height], [&b.counts, &b.filled, &b.scratch]),
        ]
    }

    fn create_claim(&self, again: bool) -> [Pass; 2] {
        let b = self.b;
        let claims = if again { &b.worklist } else { &b.inverse };
        [
            self.create_tiled(shaders::CLAIM, again, TILE, [&b.flags, &b.filled, &b.colors, claims]),
            self.create_tiled(shaders::AGREE, again, TILE, [claims, &b.flags, &b.filled]),
        ]
    }

    fn create_noise(&self, again: bool) -> Pass {
        let b = self.b;
        let map = if again { &b.inverse } else { &b.filled };
        self.create_single(shaders::NOISE, again, [&b.flags, map, &b.samples, &b.measures])
    }

    fn create_round(&self, round: usize) -> impl Iterator<Item = Pass> {
        let b = self.b;
        let worklist = if round == 0 { &b.worklist } else { &b.scratch };
        let band = [&b.measures, &b.inverse, &b.colors, &b.flags, &b.votes, worklist, &b.counts];
        let band = self.create_tiled(shaders::BAND, round > 0, TILE, band);
        let vote = move |wave: usize| {
            let buffers = [&b.measures, &b.spatial_weights, &b.votes, &b.inverse, &b.flags, worklist, &b.counts];
            let buffers = buffers.map(wgpu::Buffer::as_entire_buffer_binding);
            let uniform = b.wave_binding(round, wave);
            let [first, other] = shaders::vote_workgroups(self.size.map(|side| side as usize).iter().product());
            let workgroups = match wave {
                0 => first,
                WAVES => 1,
                _ => other,
            };
            self.create_pass(shaders::VOTE, wave == WAVES, std::iter::once(uniform).chain(buffers), [workgroups, 1])
        };
        std::iter::once(band).chain((0..=WAVES).map(vote))
    }
}

impl Passes {
    /// Creates the passes over the buffers of pictures of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32), b: &Buffers) -> Self {
        let builder = PassBuilder { device, size: [size.0, size.1], b };
        let smooth = |again, from, to| builder.create_tiled(shaders::SMOOTH, again, STRIP, [&b.measures, from, to]);
        let steady = [&b.measures, &b.flags, &b.inverse, &b.colors, &b.scratch, &b.memory, &b.before, &b.refined];
        Self {
            prepare: builder.create_prepare(),
            // Holes left after the first run cross rows or columns that are then full.
            fill: [false, true]
                .into_iter()
                .flat_map(|again| builder.create_fill(again))
                .chain([false, true].into_iter().flat_map(|again| builder.create_claim(again)))
                .collect(),
            align: [
                builder.create_noise(false),
                smooth(false, &b.filled, &b.scratch),
                smooth(true, &b.scratch, &b.inverse),
            ]
            .into_iter()
            .chain([builder.create_noise(true)])
            .chain((0..ROUNDS).flat_map(|round| builder.create_round(round)))
            .collect(),
            change: [
                builder.create_tiled(shaders::CHANGE, false, TILE, [&b.colors, &b.before, &b.scratch]),
                builder.create_single(shaders::MEDIAN, false, [&b.scratch, &b.samples, &b.measures]),
            ],
            steady: builder.create_tiled(shaders::STEADY, false, STRIP, steady),
        }
    }

    /// Rebinds the passes after the map's buffer was replaced.
    pub fn rebind_map(&mut self, device: &Device, size: (u32, u32), b: &Buffers) {
        self.prepare = PassBuilder { device, size: [size.0, size.1], b }.create_prepare();
    }

    /// Records all passes of a frame; `is_fresh` without a last one.
    pub fn record(&self, recorder: &mut Recorder, is_fresh: bool) {
        let change = self.change.iter().filter(|_| !is_fresh);
        let passes =
            [&self.prepare].into_iter().chain(&self.fill).chain(&self.align).chain(change).chain([&self.steady]);
        passes.for_each(|pass| recorder.record(pass));
    }
}
