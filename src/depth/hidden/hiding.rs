//! Which surfaces hide others, and where they are.

use std::ops::Range;

use pulp::WithSimd;

use crate::frame::Matte;
use crate::optics::DepthCoc;

/// The surfaces that hide others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hiding {
    /// Their CoC, from the first value up to before the second, in pixels. What is nearer hides nothing here, and what is
    /// farther may be hidden.
    pub(super) range_px: (f32, f32),
    /// What is estimated counts less with the distance from the outline, and not at all at this factor of its own radius;
    /// `None` counts it in full.
    pub(super) fade: Option<f32>,
}

impl Hiding {
    /// What is near enough to be blurred visibly.
    pub const NEAR: Self = Self { range_px: (f32::NEG_INFINITY, -2.0), fade: None };
    /// The subject, in focus. The sharp texture beside it, such as text on a screen, ends somewhere behind it.
    pub const SUBJECT: Self = Self { range_px: (Self::NEAR.range_px.1, 1.5), fade: Some(0.75) };

    /// Whether a surface with this CoC hides others, in pixels.
    #[inline(always)]
    pub(super) fn includes(&self, coc_px: f32) -> bool {
        (coc_px >= self.range_px.0) & (coc_px < self.range_px.1)
    }

    /// Whether a surface with this CoC may not be hidden, in pixels.
    #[inline(always)]
    pub(super) fn is_front(&self, coc_px: f32) -> bool {
        coc_px < self.range_px.1
    }

    /// Tells the farther surface of mixed pixels in full, which goes on behind these surfaces now.
    pub(super) fn complete_mixed_pixels(&self, matte: &mut Matte, lens: &DepthCoc) {
        for pixel in &mut matte.pixels {
            let [near_px, far_px] = [pixel.near_m, pixel.far_m].map(|metres| lens.coc_px(metres));
            if pixel.alpha < 1.0 && self.includes(near_px) && !self.is_front(far_px) {
                pixel.background_alpha = 1.0;
            }
        }
    }
}

/// Returns the distance at which the CoC is `coc_px`, in metres; 0 if nothing nearer than the focal plane is blurred that
/// much, and infinite if nothing beyond it is.
pub fn distance_at(lens: &DepthCoc, coc_px: f32) -> f32 {
    if coc_px > 0.0 {
        return lens.far_m() / (1.0 - coc_px / lens.coc_at_infinity_px).max(0.0);
    }
    if lens.max_coc_px > -coc_px { lens.near_m() / (1.0 - coc_px / lens.coc_at_infinity_px) } else { 0.0 }
}

/// The pixels from `first` to before `end`, in columns and rows.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    pub first: (usize, usize),
    pub end: (usize, usize),
}

impl Default for Span {
    fn default() -> Self {
        Self { first: (usize::MAX, usize::MAX), end: (0, 0) }
    }
}

impl Span {
    pub fn union(self, other: Self) -> Self {
        Self {
            first: (self.first.0.min(other.first.0), self.first.1.min(other.first.1)),
            end: (self.end.0.max(other.end.0), self.end.1.max(other.end.1)),
        }
    }
}

/// Finds the pixels of some rows in a range of distances.
pub struct FindHiding<'a> {
    pub metres: &'a [f32],
    pub width: usize,
    pub rows: Range<usize>,
    pub range_m: (f32, f32),
    pub span: &'a mut Span,
}

impl WithSimd for FindHiding<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { metres, width, rows, range_m: (from_m, to_m), span } = self;
        let hides = |&metres: &f32| (metres > 0.0) & (metres >= from_m) & (metres < to_m);
        for y in rows {
            let row = &metres[y * width..][..width];
            if row.iter().fold(0, |count, metres| count + u32::from(hides(metres))) == 0 {
                continue;
            }
            let first = row.iter().position(hides).unwrap_or(0);
            let last = row.iter().rposition(hides).unwrap_or(0);
            *span = span.union(Span { first: (first, y), end: (last + 1, y + 1) });
        }
    }
}
