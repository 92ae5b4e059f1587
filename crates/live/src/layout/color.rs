//! The colour encoding of pixel values.

use super::Family;
use bokehcam::color::YcbcrMatrix;

/// The quantisation range of pixel values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Range {
    /// Luma from 16 to 235, chroma from 16 to 240.
    #[default]
    Limited,
    /// From 0 to 255.
    Full,
}

/// The transfer function of pixel values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    /// Display-referred: sRGB, BT.709 and similar curves.
    #[default]
    Display,
    /// Proportional to light.
    Linear,
    /// A power function with exponent 2.2 (opRGB) or 2.6 (DCI-P3), in tenths.
    Gamma(u8),
    /// High dynamic range (SMPTE 2084), which 8-bit sRGB cannot reproduce.
    Pq,
}

/// The colour encoding: weights of luma, quantisation range and transfer function.
pub type ColorEncoding = (YcbcrMatrix, Range, Transfer);

/// Returns the default encoding of a format family.
pub(super) fn default_encoding(family: Family) -> ColorEncoding {
    let range = match family {
        Family::Rgb24 { .. } | Family::Grey | Family::Depth16 | Family::Jpeg => Range::Full,
        Family::Packed422 { .. } | Family::SemiPlanar420 { .. } | Family::Planar420 { .. } => Range::Limited,
    };
    (YcbcrMatrix::Bt601, range, Transfer::Display)
}
