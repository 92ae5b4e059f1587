//! The passes in their order: bind groups made once for pictures of one size, one `encode` a frame.

use super::super::align::ROUNDS;
use super::buffers::Buffers;
use super::shaders::{self, COLUMNS, STRIP, TILE, WAVES};
use crate::compute::device::{Device, Pass, Recorder, Shader};

/// Everything that a frame runs.
pub struct Passes {
    prepare: Pass,
    /// Holes are filled, of a map of which anything is known.
    fill: Vec<Pass>,
    /// The noise, and less of it; edges, and where they belong.
    align: Vec<Pass>,
    /// What changed since the frame before, if there is one.
    change: [Pass; 2],
    steady: Pass,
}

/// Makes the passes for pictures of one size.
struct Maker<'a> {
    device: &'a Device,
    size: [u32; 2],
    b: &'a Buffers,
}

impl<'a> Maker<'a> {
    /// A pass, in its second run where it runs `again`, over these buffers after the frame.
    fn pass(
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

    fn over<const N: usize>(
        &self,
        shader: Shader,
        again: bool,
        tile: [u32; 2],
        buffers: [&'a wgpu::Buffer; N],
    ) -> Pass {
        let [across, down] = [0, 1].map(|axis| self.size[axis].div_ceil(tile[axis]));
        self.pass(shader, again, buffers.map(wgpu::Buffer::as_entire_buffer_binding), [across, down])
    }

    /// A pass that is one workgroup.
    fn single<const N: usize>(&self, shader: Shader, again: bool, buffers: [&'a wgpu::Buffer; N]) -> Pass {
        self.pass(shader, again, buffers.map(wgpu::Buffer::as_entire_buffer_binding), [1, 1])
    }

    fn prepare(&self) -> Pass {
        let b = self.b;
        let made = [&b.colors, &b.flags, &b.filled, &b.inverse, &b.front];
        let buffers = [&b.map, &b.taps, &b.rgb].into_iter().chain(made).map(wgpu::Buffer::as_entire_buffer_binding);
        let workgroups = [0, 1].map(|axis| self.size[axis].div_ceil(TILE[axis]));
        self.pass(shaders::PREPARE, false, buffers, workgroups)
    }

    fn fill(&self, again: bool) -> [Pass; 2] {
        let b = self.b;
        let [width, height] = self.size;
        [
            self.over(shaders::BESIDE, again, [width, 1], [&b.counts, &b.filled, &b.lent]),
            self.over(shaders::FILL, again, [COLUMNS, height], [&b.counts, &b.filled, &b.lent]),
        ]
    }

    fn claim(&self, again: bool) -> [Pass; 2] {
        let b = self.b;
        let claims = if again { &b.front } else { &b.inverse };
        [
            self.over(shaders::CLAIM, again, TILE, [&b.flags, &b.filled, &b.colors, claims]),
            self.over(shaders::AGREE, again, TILE, [claims, &b.flags, &b.filled]),
        ]
    }

    fn noise(&self, again: bool) -> Pass {
        let b = self.b;
        let map = if again { &b.inverse } else { &b.filled };
        self.single(shaders::NOISE, again, [&b.flags, map, &b.samples, &b.measures])
    }

    fn round(&self, round: usize) -> impl Iterator<Item = Pass> {
        let b = self.b;
        let front = if round == 0 { &b.front } else { &b.lent };
        let band = [&b.measures, &b.inverse, &b.colors, &b.flags, &b.votes, front, &b.counts];
        let band = self.over(shaders::BAND, round > 0, TILE, band);
        let vote = move |wave: usize| {
            let buffers = [&b.measures, &b.nearby, &b.votes, &b.inverse, &b.flags, front, &b.counts];
            let buffers = buffers.map(wgpu::Buffer::as_entire_buffer_binding);
            let uniform = b.wave(round, wave);
            let [first, other] = shaders::turns(self.size.map(|side| side as usize).iter().product());
            let turns = match wave {
                0 => first,
                WAVES => 1,
                _ => other,
            };
            self.pass(shaders::VOTE, wave == WAVES, std::iter::once(uniform).chain(buffers), [turns, 1])
        };
        std::iter::once(band).chain((0..=WAVES).map(vote))
    }
}

impl Passes {
    /// The passes over the buffers of pictures of `size` pixels.
    pub fn new(device: &Device, size: (u32, u32), b: &Buffers) -> Self {
        let maker = Maker { device, size: [size.0, size.1], b };
        let smooth = |again, from, to| maker.over(shaders::SMOOTH, again, STRIP, [&b.measures, from, to]);
        let steady = [&b.measures, &b.flags, &b.inverse, &b.colors, &b.lent, &b.memory, &b.before, &b.refined];
        Self {
            prepare: maker.prepare(),
            // What is left after the first time crosses rows that are full then.
            fill: [false, true]
                .into_iter()
                .flat_map(|again| maker.fill(again))
                .chain([false, true].into_iter().flat_map(|again| maker.claim(again)))
                .collect(),
            align: [maker.noise(false), smooth(false, &b.filled, &b.lent), smooth(true, &b.lent, &b.inverse)]
                .into_iter()
                .chain([maker.noise(true)])
                .chain((0..ROUNDS).flat_map(|round| maker.round(round)))
                .collect(),
            change: [
                maker.over(shaders::CHANGE, false, TILE, [&b.colors, &b.before, &b.lent]),
                maker.single(shaders::MEDIAN, false, [&b.lent, &b.samples, &b.measures]),
            ],
            steady: maker.over(shaders::STEADY, false, STRIP, steady),
        }
    }

    /// Takes another buffer for the map as it comes.
    pub fn set_map(&mut self, device: &Device, size: (u32, u32), b: &Buffers) {
        self.prepare = Maker { device, size: [size.0, size.1], b }.prepare();
    }

    /// All passes of a frame; whether nothing is known of its map, and whether no frame before counts.
    pub fn record(&self, recorder: &mut Recorder, is_empty: bool, is_fresh: bool) {
        let fill = self.fill.iter().filter(|_| !is_empty);
        let change = self.change.iter().filter(|_| !is_fresh);
        let passes = [&self.prepare].into_iter().chain(fill).chain(&self.align).chain(change).chain([&self.steady]);
        passes.for_each(|pass| recorder.run(pass));
    }
}
