//! Matting along depth edges: finds the mixed pixels, the coverage (alpha) of their nearer surface, and both colours.
//!
//! A depth map has one sample per pixel, but a camera's pixel is an area: on an outline, part of it shows the near
//! surface and the rest the far one. Pure pixels nearby give the colours of both surfaces, and with them the likelihood
//! of the pixel's colour for each alpha (Bayesian matting, after Chuang et al. 2001); the map gives the prior. All
//! steps are local and use one frame; the time grows with the length of the outlines.

mod alpha;
mod clusters;
mod contrast;
mod edges;
#[doc(hidden)]
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
pub mod gpu;
mod known_background;
pub mod mask;
mod mixture;
mod passes;
mod rank;
mod symmetric;
mod trace;

use std::ops::Range;
use std::sync::Arc;

use pulp::Arch;

use crate::color::srgb_to_linear_table;
use crate::compute::bands;
use crate::compute::thread_pool::ThreadPool;
use crate::compute::with_fallback::WithFallback;
use crate::compute::{Device, DeviceFrame};
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};

pub use known_background::{KnownBackground, Revision, light_at};

use super::bitmap::Bitmap;
use alpha::{Evidence, LANES, Labels, Prior};
use clusters::{Clusters, FrameView};
use edges::EdgeDetector;
use passes::{ComputeAlphas, EvaluateColors, SeparateColors};
use rank::keep_rarest_steps;
use trace::{Trace, WideRegions};

/// Minimum difference of the CoC across a depth discontinuity, in pixels, for its pixels to be matted.
pub const MIN_STEP_PX: f32 = 0.5;
/// Above this alpha, a pixel counts as pure.
const NEARLY_PURE: f32 = 0.98;

/// Maximum distance of traced pixels from an edge, in pixels.
const MAX_STEPS: usize = 16;
/// Minimum number of pixels per thread.
const MIN_PIXELS: usize = 256;

/// Estimates mattes; owns the memory for it.
#[derive(Debug)]
pub struct Matting {
    arch: Arch,
    light: Box<[f32; 256]>,
    /// Pixels beside a depth discontinuity to one of the eight neighbours; all others are pure.
    at_edge: Bitmap,
    edge_detector: EdgeDetector,
    edges: Vec<EdgePixel>,
    /// The pixels at edges, followed by the traced ones.
    pixels: Vec<Pixel>,
    clusters: Clusters,
    evidence: Vec<Evidence>,
    wide: WideRegions,
    /// Indices of the mixed pixels in raster order, and scratch memory for the sort.
    order: Vec<u32>,
    traced: Vec<u64>,
    /// GPU buffers of the next map and its picture.
    device_frame: Option<DeviceFrame>,
    /// Whether the warning about too many edges was logged.
    is_noise_logged: bool,
    /// The GPU implementation, used until the device fails.
    gpu: WithFallback<Option<gpu::GpuMatting>>,
}

/// A pixel beside a depth discontinuity.
#[derive(Clone, Copy, Debug, Default)]
struct EdgePixel {
    x: u32,
    y: u32,
    /// Largest and smallest inverse depth of the 3x3 neighbourhood, in 1/m.
    near: f32,
    far: f32,
    /// Labels from the map; unused for traced pixels.
    labels: Labels,
}

impl EdgePixel {
    /// Returns the mean of both surfaces' inverse depths.
    #[inline(always)]
    fn mean_inverse(&self) -> f32 {
        0.5 * (self.near + self.far)
    }

    /// Whether an inverse depth is closer to the near surface's.
    #[inline(always)]
    fn is_near(&self, inverse: f32) -> bool {
        inverse > self.mean_inverse()
    }
}

/// A pixel that may be mixed.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    edge: EdgePixel,
    /// Index of the colour model of the surfaces around.
    model: u32,
    /// Linear light of the pixel, and of the background behind it if known.
    own: [f32; 3],
    background: Option<[f32; 3]>,
    /// Coverage by the near surface, 0 to 1.
    alpha: f32,
}

impl Pixel {
    /// Creates a pixel that is not evaluated yet.
    #[inline(always)]
    fn new(edge: EdgePixel, model: u32) -> Self {
        Self { edge, model, own: [0.0; 3], background: None, alpha: 0.0 }
    }

    /// Returns the pixel's index in a picture `width` pixels wide.
    #[inline(always)]
    fn index(&self, width: usize) -> usize {
        self.edge.y as usize * width + self.edge.x as usize
    }

    /// Whether the pixel shows two surfaces.
    #[inline(always)]
    fn is_mixed(&self) -> bool {
        if self.edge.labels.is_near { self.alpha <= NEARLY_PURE } else { self.alpha >= 1.0 - NEARLY_PURE }
    }
}

impl Default for Matting {
    fn default() -> Self {
        Self {
            arch: Arch::new(),
            light: srgb_to_linear_table(),
            at_edge: Bitmap::default(),
            edge_detector: EdgeDetector::default(),
            edges: Vec::new(),
            pixels: Vec::new(),
            clusters: Clusters::default(),
            evidence: Vec::new(),
            wide: WideRegions::default(),
            order: Vec::new(),
            traced: Vec::new(),
            device_frame: None,
            is_noise_logged: false,
            gpu: WithFallback::default(),
        }
    }
}

impl Matting {
    /// Moves the computation to `device`, if its GPU matting passes a self-test against the CPU. If the device fails
    /// later, the CPU takes over from that frame on.
    #[must_use]
    pub fn with_device(self, device: Option<&Arc<Device>>) -> Self {
        let gpu = WithFallback::create_tested(device, "finds mattes", gpu::run_self_test, gpu::GpuMatting::new);
        Self { gpu, ..self }
    }

    /// Sets the GPU buffers that already contain the map and the picture of the next call.
    pub fn set_device_frame(&mut self, device_frame: Option<DeviceFrame>) {
        self.device_frame = device_frame;
    }

    /// Returns the backends used, for the report: `cpu`, `gpu`, or `gpu, then cpu`.
    pub fn backends(&self) -> &'static str {
        self.gpu.backends()
    }

    /// Finds the mixed pixels beside steps of inverse depth larger than `depth_step`, in 1/m. Finds none if the map and
    /// the picture differ in size, or `depth_step` is not finite. If there are more than [`Matte::max_edges`] edge
    /// pixels, only those count whose size of step the fewest have.
    pub fn find_mixed_pixels(&mut self, map: &mut DepthMap, color: &ColorImage, depth_step: f32) {
        self.find_with_background(&mut ThreadPool::new("matte", 1), (map, color), depth_step, None);
    }

    /// Finds mixed pixels like [`Self::find_mixed_pixels`], on several threads, and uses the known `background` behind
    /// pixels. The result is bit-identical for any number of threads.
    pub fn find_with_background(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&mut DepthMap, &ColorImage),
        depth_step: f32,
        background: Option<&KnownBackground>,
    ) {
        let device_frame = self.device_frame.take();
        map.matte.pixels.clear();
        if map.size() != color.size() || map.metres.is_empty() || !depth_step.is_finite() {
            return;
        }
        let most = Matte::max_edges(map.width as usize, map.height as usize);
        if self.gpu.try_run("finds mattes", |gpu| {
            let edges = gpu.find_mixed_pixels((map, color), device_frame.clone(), depth_step, background)?;
            log_noise(edges > most, &mut self.is_noise_logged);
            Ok(())
        }) {
            return;
        }
        map.matte.pixels.clear();
        let Self { arch, light, at_edge, edge_detector, edges, pixels, clusters, .. } = self;
        let arch = *arch;
        let size = (map.width as usize, map.height as usize);
        edge_detector.find_edges((arch, workers), map, depth_step, at_edge, edges);
        let is_whole = keep_rarest_steps(edges, at_edge, depth_step, most);
        log_noise(!is_whole, &mut self.is_noise_logged);
        clusters.clear(size);
        pixels.clear();
        pixels.extend(edges.iter().map(|edge| Pixel::new(*edge, clusters.request_model(depth_step, edge))));
        let (metres, rgb) = (&map.metres, &color.rgb[..]);
        clusters.fit_models((arch, workers), &FrameView { size, metres, depth_step, at_edge, rgb, light }, 0);
        // Without pure pixels of both surfaces, a colour says nothing about alpha.
        pixels.retain(|pixel| clusters.contrast(pixel.model).is_some());
        let on_edges = pixels.len();
        self.trace_pixels(workers, (&*map, color), depth_step, background);
        let Self { clusters, pixels, wide, order, traced, .. } = self;
        wide.discard_wide(size, pixels);
        sort_mixed(size.0, pixels, on_edges, order, traced);

        let each = bands::chunk_len(order.len(), MIN_PIXELS);
        let found = &mut map.matte.pixels;
        found.resize(order.len(), MixedPixel::default());
        workers.run_each(order.chunks(each).zip(found.chunks_mut(each)), &|(order, mixed)| {
            arch.dispatch(SeparateColors { clusters, width: size.0, pixels, order, mixed });
        });
    }

    /// Evaluates the pixels at edges, and traces on, step by step, from those with some alpha.
    fn trace_pixels(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&DepthMap, &ColorImage),
        depth_step: f32,
        background: Option<&KnownBackground>,
    ) {
        let Self { arch, light, at_edge, edges, pixels, clusters, evidence, wide, .. } = self;
        let (arch, size) = (*arch, (map.width as usize, map.height as usize));
        let (metres, rgb, most) = (&map.metres, &color.rgb[..], Matte::max_pixels(size.0, size.1));
        wide.steps.clear();
        let (mut evaluated, mut marked) = (0..0, edges.len());
        let (mut prior, mut steps) = (Prior::default(), 0);
        loop {
            let found = evaluated.end..pixels.len();
            // Where several pixels trace the same one in a step, the first in raster order counts.
            if steps > 0 {
                pixels[found.clone()].sort_unstable_by_key(|pixel| pixel.index(size.0));
            }
            evidence.resize(found.len().div_ceil(LANES), Evidence::default());
            // Evaluate the new pixels, then trace one step further from those with some alpha.
            let each = bands::chunk_len(found.len(), MIN_PIXELS).next_multiple_of(LANES);
            let view = FrameView { size, metres, depth_step, at_edge, rgb, light };
            let parts = pixels[found.clone()].chunks_mut(each).zip(evidence.chunks_mut(each / LANES));
            workers.run_each(parts, &|(pixels, evidence)| {
                let view = &view;
                arch.dispatch(EvaluateColors { view, clusters, background, pixels, evidence });
            });
            let is_first = steps == 0;
            arch.dispatch(ComputeAlphas { prior: &mut prior, is_first, evidence, pixels: &mut pixels[found.clone()] });
            if !is_first {
                wide.steps.push(found.clone());
            }
            evaluated = found;
            if evaluated.is_empty() || steps == MAX_STEPS {
                break;
            }
            let (compared, workers) = (evaluated.clone(), &mut *workers);
            let trace =
                Trace { arch, workers, size, metres, depth_step, rgb, light, at_edge, clusters, compared, pixels };
            marked += arch.dispatch(trace);
            // More traced pixels than hair has: the map is noise.
            if marked > most {
                pixels.truncate(evaluated.end);
                break;
            }
            steps += 1;
        }
    }
}

/// Logs once that a map is noise.
fn log_noise(is_noise: bool, is_logged: &mut bool) {
    if is_noise && !std::mem::replace(is_logged, true) {
        tracing::info!(
            "the depth has jumps nearly everywhere: outlines are separated only where it jumps as much as in few other places"
        );
    }
}

/// Replaces `order` by the indices of the mixed pixels in raster order. The `first` ones are in order already, the rest
/// is sorted in `rest` and merged.
fn sort_mixed(width: usize, pixels: &[Pixel], first: usize, order: &mut Vec<u32>, rest: &mut Vec<u64>) {
    const PLACE_BITS: u32 = 32;
    let key = |k: usize| (pixels[k].index(width) as u64) << PLACE_BITS | k as u64;
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

/// Returns the linear light of a pixel.
#[inline(always)]
fn linear_light(light: &[f32; 256], rgb: &[u8], at: usize) -> [f32; 3] {
    let code = &rgb[3 * at..][..3];
    [light[usize::from(code[0])], light[usize::from(code[1])], light[usize::from(code[2])]]
}

/// Returns the columns and rows within `by` pixels of a pixel, clamped to the picture.
#[inline(always)]
fn neighbourhood(edge: &EdgePixel, by: usize, (width, height): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (x, y) = (edge.x as usize, edge.y as usize);
    (x.saturating_sub(by)..(x + by + 1).min(width), y.saturating_sub(by)..(y + by + 1).min(height))
}

/// Returns the larger number, in one instruction: unlike `f32::max`, it does not handle NaN.
#[inline(always)]
fn fast_max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn fast_min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
