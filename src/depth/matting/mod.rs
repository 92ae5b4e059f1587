//! Matting along depth edges: which pixels show two surfaces at once, how much of each, and in which colours.
//!
//! A depth map has one sample a pixel, a camera's pixel is an area: on an outline it is a share of what is near and the
//! rest of what is far. Both surfaces have pure pixels close by, whose colours say how likely the mixed pixel's is for
//! each share (Bayesian matting, after Chuang et al. 2001), and the map says which shares are likely before that.
//! Everything is local, from one frame, and in time that grows with the length of the outlines.

mod behind;
mod clusters;
mod contrast;
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub mod gpu;
pub mod mask;
mod passes;
mod share;
mod survey;
mod symmetric;
mod trace;

use std::ops::Range;
use std::sync::Arc;

use pulp::Arch;

use crate::color::light_of_codes;
#[cfg(feature = "gpu")]
use crate::compute::backed::Backed;
use crate::compute::bands;
use crate::compute::thread_pool::ThreadPool;
use crate::compute::{Device, DeviceFrame};
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};

pub use behind::{Behind, light_at};

use super::bits::Bits;
use clusters::{Clusters, View};
use passes::{Compare, Mix, Weigh};
use share::{Evidence, LANES, Labels, Prior};
use survey::Survey;
use trace::{Trace, Wide};

/// Where the CoC jumps by so many pixels or more, pixels are worth taking apart.
pub const FROM_PX: f32 = 0.5;
/// Shares beyond this are those of a pure pixel.
const NEARLY_PURE: f32 = 0.98;

/// So many pixels away from an edge, at most.
const MOST_STEPS: usize = 16;
/// Where there are too many edges, only those of a jump twice as large are looked at, and so on, so many times.
const MOST_DOUBLINGS: usize = 8;
/// Fewer pixels are not worth another thread.
const LEAST_PIXELS: usize = 256;

/// Estimates mattes; owns the memory for it.
#[derive(Debug)]
pub struct Matting {
    arch: Arch,
    light: Box<[f32; 256]>,
    /// Whether pixels differ in depth from one of their eight neighbours: the others are pure.
    at_edge: Bits,
    survey: Survey,
    edges: Vec<EdgePixel>,
    /// The pixels at edges, and then those that were traced.
    pixels: Vec<Pixel>,
    clusters: Clusters,
    evidence: Vec<Evidence>,
    wide: Wide,
    /// The places of those that are mixed, in the order of the picture, and memory for that.
    order: Vec<u32>,
    traced: Vec<u64>,
    /// The next map and its picture.
    on_device: Option<DeviceFrame>,
    /// Whether it was said that there are too many edges.
    is_noise_said: bool,
    /// Finds them in the processor's place, as long as the device does not fail.
    #[cfg(feature = "gpu")]
    gpu: Backed<Option<gpu::GpuMatting>>,
}

/// A pixel beside a jump of depth.
#[derive(Clone, Copy, Debug, Default)]
struct EdgePixel {
    x: u32,
    y: u32,
    /// Inverse depth of the nearest and the farthest of the pixel and its neighbours, in 1/m.
    near: f32,
    far: f32,
    /// What the map says of it; nothing of a pixel that was traced.
    labels: Labels,
}

impl EdgePixel {
    /// The inverse depth in the middle between both surfaces.
    #[inline(always)]
    fn middle(&self) -> f32 {
        0.5 * (self.near + self.far)
    }

    /// Whether an inverse depth is closer to that of the near surface.
    #[inline(always)]
    fn is_near(&self, inverse: f32) -> bool {
        inverse > self.middle()
    }
}

/// A pixel that may be mixed.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    edge: EdgePixel,
    /// The place of the answer with the surfaces around it.
    answer: u32,
    /// Its own light, and what is behind it where that is known.
    own: [f32; 3],
    behind: Option<[f32; 3]>,
    /// How much of it the near surface has.
    share: f32,
}

impl Pixel {
    /// One that nothing else is known of.
    #[inline(always)]
    fn new(edge: EdgePixel, answer: u32) -> Self {
        Self { edge, answer, own: [0.0; 3], behind: None, share: 0.0 }
    }

    /// Its place in a picture so wide.
    #[inline(always)]
    fn at(&self, width: usize) -> usize {
        self.edge.y as usize * width + self.edge.x as usize
    }

    /// Whether it shows two surfaces.
    #[inline(always)]
    fn is_mixed(&self) -> bool {
        if self.edge.labels.is_near { self.share <= NEARLY_PURE } else { self.share >= 1.0 - NEARLY_PURE }
    }
}

impl Default for Matting {
    fn default() -> Self {
        Self {
            arch: Arch::new(),
            light: light_of_codes(),
            at_edge: Bits::default(),
            survey: Survey::default(),
            edges: Vec::new(),
            pixels: Vec::new(),
            clusters: Clusters::default(),
            evidence: Vec::new(),
            wide: Wide::default(),
            order: Vec::new(),
            traced: Vec::new(),
            on_device: None,
            is_noise_said: false,
            #[cfg(feature = "gpu")]
            gpu: Backed::default(),
        }
    }
}

impl Matting {
    /// The same on a device, where there is one that finds mattes as the processor does. When it fails, the processor goes on, from
    /// the frame on with which it does.
    #[must_use]
    pub fn on(self, device: Option<&Arc<Device>>) -> Self {
        #[cfg(feature = "gpu")]
        {
            Self { gpu: Backed::tried(device, "finds mattes", gpu::trial, gpu::GpuMatting::new), ..self }
        }
        #[cfg(not(feature = "gpu"))]
        {
            let _ = device;
            self
        }
    }

    /// The map and the picture of the next call are on a device already, as they are in memory.
    pub fn take_from(&mut self, on_device: Option<DeviceFrame>) {
        self.on_device = on_device;
    }

    /// What finds mattes, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        #[cfg(feature = "gpu")]
        return self.gpu.backends();
        #[cfg(not(feature = "gpu"))]
        "cpu"
    }

    /// Finds the mixed pixels of a map as large as its picture, beside jumps of inverse depth of more than `jump`, in 1/m.
    /// Of another size, or where `jump` is not finite, it has none; with more edges than [`Matte::most`] it has those beside the
    /// largest jumps.
    pub fn find(&mut self, map: &mut DepthMap, color: &ColorImage, jump: f32) {
        self.find_before(&mut ThreadPool::new("matte", 1), (map, color), jump, None);
    }

    /// The same on several threads, with what is known to lie behind pixels. The matte is the same to the bit for any number of
    /// threads.
    pub fn find_before(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&mut DepthMap, &ColorImage),
        jump: f32,
        behind: Option<&Behind>,
    ) {
        let on_device = self.on_device.take();
        map.matte.pixels.clear();
        if map.size() != color.size() || map.metres.is_empty() || !jump.is_finite() {
            return;
        }
        #[cfg(not(feature = "gpu"))]
        let _ = on_device;
        let most = Matte::most(map.width as usize, map.height as usize);
        let asked = jump;
        let jumps = || std::iter::successors(Some(asked), |jump| Some(2.0 * jump)).take(MOST_DOUBLINGS);
        let is_noise_said = &mut self.is_noise_said;
        let mut say = |jump: f32| {
            if jump > asked && !std::mem::replace(is_noise_said, true) {
                tracing::info!(
                    "the depth has jumps nearly everywhere: outlines are taken apart only where it jumps most"
                );
            }
        };
        #[cfg(feature = "gpu")]
        if self.gpu.did("finds mattes", |gpu| {
            for jump in jumps() {
                if gpu.find((map, color), on_device.clone(), jump, behind)? <= most {
                    say(jump);
                    break;
                }
            }
            Ok(())
        }) {
            return;
        }
        map.matte.pixels.clear();
        let Self { arch, light, at_edge, survey, edges, pixels, clusters, evidence, wide, order, traced, .. } = self;
        let arch = *arch;
        let size = (map.width as usize, map.height as usize);
        let fits = |jump: &f32| {
            survey.find((arch, workers), map, *jump, (at_edge, edges));
            edges.len() <= most
        };
        // Noise has more edges than any picture has: those beside the largest jumps are what counts.
        let Some(jump) = jumps().find(fits) else { return };
        say(jump);
        clusters.clear(size);
        pixels.clear();
        pixels.extend(edges.iter().map(|edge| Pixel::new(*edge, clusters.ask(jump, edge))));
        let (metres, matte, rgb) = (&map.metres, &mut map.matte, &color.rgb[..]);
        clusters.find((arch, workers), &View { size, metres, jump, at_edge, rgb, light }, 0);
        // Those between surfaces of which one has no pixels tell nothing.
        pixels.retain(|pixel| clusters.at(pixel.answer).is_some());
        let on_edges = pixels.len();
        let (mut compared, mut marked) = (0..0, edges.len());
        wide.steps.clear();
        let (mut prior, mut steps) = (Prior::default(), 0);
        loop {
            let found = compared.end..pixels.len();
            evidence.resize(found.len().div_ceil(LANES), Evidence::default());
            let each = bands::share(found.len(), LEAST_PIXELS).next_multiple_of(LANES);
            let view = View { size, metres, jump, at_edge, rgb, light };
            let parts = pixels[found.clone()].chunks_mut(each).zip(evidence.chunks_mut(each / LANES));
            workers.run_each(parts, &|(pixels, evidence)| {
                let view = &view;
                arch.dispatch(Compare { view, clusters, behind, pixels, evidence });
            });
            let is_first = steps == 0;
            arch.dispatch(Weigh { prior: &mut prior, is_first, evidence, pixels: &mut pixels[found.clone()] });
            if !is_first {
                wide.steps.push(found.clone());
            }
            compared = found;
            if compared.is_empty() || steps == MOST_STEPS {
                break;
            }
            let (compared, workers) = (compared.clone(), &mut *workers);
            let found_until = compared.end;
            let trace = Trace { arch, workers, size, metres, jump, rgb, light, at_edge, clusters, compared, pixels };
            marked += arch.dispatch(trace);
            // Noise, too: no hair is that long.
            if marked > most {
                pixels.truncate(found_until);
                break;
            }
            steps += 1;
        }
        wide.drop(size, pixels);
        sort(size.0, pixels, on_edges, (order, traced));

        let each = bands::share(order.len(), LEAST_PIXELS);
        matte.pixels.resize(order.len(), MixedPixel::default());
        workers.run_each(order.chunks(each).zip(matte.pixels.chunks_mut(each)), &|(order, mixed)| {
            arch.dispatch(Mix { clusters, width: size.0, pixels, order, mixed });
        });
    }
}

/// Replaces `order` by the places of the mixed pixels, of which the first are in order and the others are not; `rest` is memory.
fn sort(width: usize, pixels: &[Pixel], first: usize, (order, rest): (&mut Vec<u32>, &mut Vec<u64>)) {
    const PLACE_BITS: u32 = 32;
    let key = |k: usize| (pixels[k].at(width) as u64) << PLACE_BITS | k as u64;
    let mixed = |places: Range<usize>| places.filter(|&k| pixels[k].is_mixed());
    rest.clear();
    rest.extend(mixed(first..pixels.len()).map(key));
    rest.sort_unstable();
    let mut rest = rest.iter().copied().peekable();
    order.clear();
    for k in mixed(0..first) {
        while let Some(key) = rest.next_if(|&other| other < key(k)) {
            order.push(key as u32);
        }
        order.push(k as u32);
    }
    order.extend(rest.map(|key| key as u32));
}

/// The colour of a pixel in linear light.
#[inline(always)]
fn light_of(light: &[f32; 256], rgb: &[u8], at: usize) -> [f32; 3] {
    let code = &rgb[3 * at..][..3];
    [light[usize::from(code[0])], light[usize::from(code[1])], light[usize::from(code[2])]]
}

/// The columns and rows of a pixel and those around it, `by` pixels to each side, as far as the picture has them.
#[inline(always)]
fn around(edge: &EdgePixel, by: usize, (width, height): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (x, y) = (edge.x as usize, edge.y as usize);
    (x.saturating_sub(by)..(x + by + 1).min(width), y.saturating_sub(by)..(y + by + 1).min(height))
}

/// The larger of two numbers: one instruction, unlike `f32::max`, which looks for what is no number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
