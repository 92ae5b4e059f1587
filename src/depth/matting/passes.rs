//! The per-pixel steps, vectorised.
//! twin: shaders/matte_compare.wgsl, matte_weigh.wgsl, matte_mix.wgsl

use pulp::WithSimd;

use super::Pixel;
use super::behind::Behind;
use super::clusters::{Clusters, View};
use super::contrast::Parts;
use super::share::{Colors, Evidence, LANES, Prior};
use crate::frame::MixedPixel;

/// Evaluates pixels against the colours of the surfaces around.
pub struct Compare<'a> {
    pub view: &'a View<'a>,
    pub clusters: &'a Clusters,
    pub behind: Option<&'a Behind<'a>>,
    pub pixels: &'a mut [Pixel],
    pub evidence: &'a mut [Evidence],
}

impl WithSimd for Compare<'_> {
    type Output = ();
    // No explicit vectors: the dispatch compiles all inlined code for the processor's instruction set. Loops instead of
    // iterator closures, which would not be.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { view, clusters, behind, pixels, evidence } = self;
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            // Scattered reads first, so that they overlap.
            for pixel in &mut *pixels {
                let at = pixel.at(view.size.0);
                pixel.own = view.light(at);
                pixel.behind = match behind {
                    Some(behind) => behind.light(at, pixel.edge.near),
                    None => None,
                };
            }
            let mut colors = Colors::NONE;
            for (k, pixel) in pixels.iter_mut().enumerate() {
                let Some(contrast) = clusters.at(pixel.model) else { continue };
                // A remembered colour unlike the far surface here is of another surface.
                pixel.behind = match pixel.behind {
                    Some(light) if contrast.is_like_far(light) => Some(light),
                    _ => None,
                };
                let discriminant = contrast.discriminant(pixel.behind);
                let alpha = discriminant.alpha(pixel.own);
                let off_line = match pixel.behind {
                    Some(light) => Some(contrast.off_line(light, pixel.own, alpha)),
                    None => None,
                };
                colors.set(k, pixel.edge.labels, (alpha, discriminant.precision), off_line);
            }
            *evidence = Evidence::new(&colors);
        }
    }
}

/// Computes alpha of pixels by the frame's prior, which is estimated from the first call's pixels.
pub struct Weigh<'a> {
    pub prior: &'a mut Prior,
    pub is_first: bool,
    pub evidence: &'a [Evidence],
    pub pixels: &'a mut [Pixel],
}

impl WithSimd for Weigh<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { prior, is_first, evidence, pixels } = self;
        if is_first {
            *prior = Prior::estimate(evidence);
        }
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            let alphas = prior.alphas(evidence);
            for (pixel, alpha) in pixels.iter_mut().zip(alphas) {
                pixel.alpha = alpha;
            }
        }
    }
}

/// Separates mixed pixels into their two colours.
pub struct Mix<'a> {
    pub clusters: &'a Clusters,
    pub width: usize,
    pub pixels: &'a [Pixel],
    /// Indices of the mixed pixels.
    pub order: &'a [u32],
    pub mixed: &'a mut [MixedPixel],
}

impl WithSimd for Mix<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { clusters, width, pixels, order, mixed } = self;
        let mut parts = Parts::default();
        for (order, mixed) in order.chunks(LANES).zip(mixed.chunks_mut(LANES)) {
            for (k, &place) in order.iter().enumerate() {
                let pixel = &pixels[place as usize];
                if let Some(contrast) = clusters.at(pixel.model) {
                    parts.set(k, contrast.before(pixel.behind), pixel.own, pixel.alpha);
                }
            }
            let differences = parts.differences();
            for (k, (&place, mixed)) in order.iter().zip(mixed).enumerate() {
                let pixel = &pixels[place as usize];
                let Pixel { edge, behind, alpha, .. } = *pixel;
                let behind = if behind.is_some() { 1.0 } else { 1.0 - alpha };
                let (near_m, far_m) = (edge.near.recip(), edge.far.recip());
                let difference = [differences[0][k], differences[1][k], differences[2][k]];
                *mixed = MixedPixel { at: pixel.at(width) as u32, near_m, far_m, alpha, behind, difference };
            }
        }
    }
}
