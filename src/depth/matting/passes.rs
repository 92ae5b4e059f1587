//! The per-pixel steps, vectorised.
//! twin: shaders/matte/compare.wgsl, matte/weigh.wgsl, matte/mix.wgsl

use pulp::WithSimd;

use super::Pixel;
use super::alpha::{Colors, Evidence, LANES, Prior};
use super::clusters::{Clusters, FrameView};
use super::known_background::KnownBackground;
use super::mixture::ColorBatch;
use crate::frame::MixedPixel;

/// Evaluates pixels against the colours of the surfaces around.
pub struct EvaluateColors<'a> {
    pub view: &'a FrameView<'a>,
    pub clusters: &'a Clusters,
    pub background: Option<&'a KnownBackground<'a>>,
    pub pixels: &'a mut [Pixel],
    pub evidence: &'a mut [Evidence],
}

impl WithSimd for EvaluateColors<'_> {
    type Output = ();
    // No explicit vectors: the dispatch compiles all inlined code for the processor's instruction set. Loops instead of
    // iterator closures, which would not be.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { view, clusters, background, pixels, evidence } = self;
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            // Scattered reads first, so that they overlap.
            for pixel in &mut *pixels {
                let at = pixel.index(view.size.0);
                pixel.own = view.light(at);
                pixel.background = match background {
                    Some(background) => background.light_at(at, pixel.edge.near),
                    None => None,
                };
            }
            let mut colors = Colors::NONE;
            for (k, pixel) in pixels.iter_mut().enumerate() {
                let Some(contrast) = clusters.contrast(pixel.model) else { continue };
                // A remembered colour unlike the far surface here is of another surface.
                pixel.background = match pixel.background {
                    Some(light) if contrast.is_plausible_far(light) => Some(light),
                    _ => None,
                };
                let surfaces = contrast.colors_with_background(pixel.background);
                colors.set_lane(k, pixel.edge.labels, pixel.own, surfaces, pixel.background.is_some());
            }
            *evidence = Evidence::new(&colors);
        }
    }
}

/// Computes alpha of pixels by the frame's prior, which is estimated from the first call's pixels.
pub struct ComputeAlphas<'a> {
    pub prior: &'a mut Prior,
    pub is_first: bool,
    pub evidence: &'a [Evidence],
    pub pixels: &'a mut [Pixel],
}

impl WithSimd for ComputeAlphas<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { prior, is_first, evidence, pixels } = self;
        if is_first {
            *prior = Prior::estimate(evidence);
        }
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            let alphas = prior.posterior_alphas(evidence);
            for (pixel, alpha) in pixels.iter_mut().zip(alphas) {
                pixel.alpha = alpha;
            }
        }
    }
}

/// Separates mixed pixels into their two colours.
pub struct SeparateColors<'a> {
    pub clusters: &'a Clusters,
    pub width: usize,
    pub pixels: &'a [Pixel],
    /// Indices of the mixed pixels.
    pub order: &'a [u32],
    pub mixed: &'a mut [MixedPixel],
}

impl WithSimd for SeparateColors<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { clusters, width, pixels, order, mixed } = self;
        let mut batch = ColorBatch::NONE;
        for (order, mixed) in order.chunks(LANES).zip(mixed.chunks_mut(LANES)) {
            for (k, &place) in order.iter().enumerate() {
                let pixel = &pixels[place as usize];
                if let Some(contrast) = clusters.contrast(pixel.model) {
                    batch.set_lane(k, contrast.colors_with_background(pixel.background), pixel.own, pixel.alpha);
                }
            }
            let differences = batch.color_differences();
            for (k, (&place, mixed)) in order.iter().zip(mixed).enumerate() {
                let pixel = &pixels[place as usize];
                let Pixel { edge, background, alpha, .. } = *pixel;
                let background_alpha = if background.is_some() { 1.0 } else { 1.0 - alpha };
                let (near_m, far_m) = (edge.near.recip(), edge.far.recip());
                let difference = [differences[0][k], differences[1][k], differences[2][k]];
                *mixed =
                    MixedPixel { at: pixel.index(width) as u32, near_m, far_m, alpha, background_alpha, difference };
            }
        }
    }
}
