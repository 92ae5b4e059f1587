//! What the numbers of a picture mean as colours.

use super::Family;
use crate::color::Matrix;

/// Which numbers stand for black and white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Range {
    /// Luma from 16 to 235, chroma from 16 to 240.
    #[default]
    Limited,
    /// From 0 to 255.
    Full,
}

/// How numbers grow with light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    /// Made to be shown on a screen: the curves of sRGB and BT.709, and all that is close to them.
    #[default]
    Display,
    /// In proportion to the light.
    Linear,
    /// A power of 2.2 (opRGB) or 2.6 (DCI-P3); in tenths.
    Gamma(u8),
    /// High dynamic range (SMPTE 2084), of which no faithful 8-bit sRGB picture can be made.
    Pq,
}

/// What the numbers of a picture mean: which weights make luma, which numbers are black and white, and how they grow with light.
pub type Colors = (Matrix, Range, Transfer);

/// What they mean where nobody says.
pub(super) fn usual(family: Family) -> Colors {
    let range = match family {
        Family::Rgb24 { .. } | Family::Grey | Family::Depth16 | Family::Jpeg => Range::Full,
        Family::Packed422 { .. } | Family::SemiPlanar420 { .. } | Family::Planar420 { .. } => Range::Limited,
    };
    (Matrix::Bt601, range, Transfer::Display)
}
