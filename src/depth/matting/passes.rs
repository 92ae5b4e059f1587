//! What is done to many pixels at once.

use pulp::WithSimd;

use super::Pixel;
use super::behind::Behind;
use super::clusters::{Clusters, View};
use super::contrast::Parts;
use super::share::{Colors, Evidence, LANES, Prior};
use crate::frame::MixedPixel;

/// Compares pixels with the surfaces around them.
pub struct Compare<'a> {
    pub view: &'a View<'a>,
    pub clusters: &'a Clusters,
    pub behind: Option<&'a Behind<'a>>,
    pub pixels: &'a mut [Pixel],
    pub evidence: &'a mut [Evidence],
}

impl WithSimd for Compare<'_> {
    type Output = ();
    // No vectors by hand: the call has the compiler use what the processor has, in all that it takes in. Loops, not closures for
    // iterators, which would not have them.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { view, clusters, behind, pixels, evidence } = self;
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            // What lies apart in memory first, so that none waits for another.
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
                let Some(contrast) = clusters.at(pixel.answer) else { continue };
                // What is remembered of a surface that looks otherwise here is not of that surface.
                pixel.behind = match pixel.behind {
                    Some(light) if contrast.is_like_far(light) => Some(light),
                    _ => None,
                };
                let discriminant = contrast.discriminant(pixel.behind);
                let share = discriminant.share(pixel.own);
                let off_line = match pixel.behind {
                    Some(light) => Some(contrast.off_line(light, pixel.own, share)),
                    None => None,
                };
                colors.set(k, pixel.edge.labels, (share, discriminant.precision), off_line);
            }
            *evidence = Evidence::of(&colors);
        }
    }
}

/// Gives pixels their shares, by what is likely in this frame: that is found from the first of them.
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
            *prior = Prior::of(evidence);
        }
        for (pixels, evidence) in pixels.chunks_mut(LANES).zip(evidence) {
            let shares = prior.shares(evidence);
            for (pixel, share) in pixels.iter_mut().zip(shares) {
                pixel.share = share;
            }
        }
    }
}

/// Takes mixed pixels apart.
pub struct Mix<'a> {
    pub clusters: &'a Clusters,
    pub width: usize,
    pub pixels: &'a [Pixel],
    /// The places of those that are mixed.
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
                if let Some(contrast) = clusters.at(pixel.answer) {
                    parts.set(k, contrast.before(pixel.behind), pixel.own, pixel.share);
                }
            }
            let differences = parts.differences();
            for (k, (&place, mixed)) in order.iter().zip(mixed).enumerate() {
                let pixel = &pixels[place as usize];
                let Pixel { edge, behind, share, .. } = *pixel;
                let behind = if behind.is_some() { 1.0 } else { 1.0 - share };
                let (near_m, far_m) = (edge.near.recip(), edge.far.recip());
                let difference = [differences[0][k], differences[1][k], differences[2][k]];
                *mixed = MixedPixel { at: pixel.at(width) as u32, near_m, far_m, share, behind, difference };
            }
        }
    }
}
