//! Misalignment of a depth map with its picture, and the corrections that the colour-guided alignment needs.

use std::fmt;

use super::agreement::EdgeAlignment;
use super::refine::{MapCorrection, Outlines};
use crate::frame::{ColorImage, DepthMap};

/// Why a depth map does not fit its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misalignment {
    /// Columns and rows of the map, if it has fewer columns than the picture.
    pub smaller: Option<(u32, u32)>,
    /// How depth edges and picture edges are aligned.
    pub outlines: EdgeAlignment,
}

impl Misalignment {
    /// Measures the depth `map` against its picture; `None` if it fits.
    pub fn measure(map: &DepthMap, color: &ColorImage) -> Option<Self> {
        Self::from_alignment(EdgeAlignment::measure(map, color), map, color)
    }

    /// Like [`Misalignment::measure`] with a known alignment of the outlines.
    pub fn from_alignment(outlines: EdgeAlignment, map: &DepthMap, color: &ColorImage) -> Option<Self> {
        let smaller = (map.width < color.width).then(|| map.size());
        let fits = smaller.is_none() && matches!(outlines, EdgeAlignment::Aligned | EdgeAlignment::Unknown);
        (!fits).then_some(Self { smaller, outlines })
    }

    /// Returns the required correction; `None` if the picture has no edges near the depth edges.
    pub fn correction(self, map: &DepthMap, color: &ColorImage) -> Option<MapCorrection> {
        let (mut outlines, mut distance_px) = (self.outlines, 0);
        if let EdgeAlignment::Shifted { distance_px: picture_px } = outlines {
            // The last pixel is left to the colours, so that thin structures are not lost.
            distance_px = picture_px - picture_px.signum();
            let mut moved = map.clone();
            let unknown: Vec<bool> = map.metres.iter().map(|&metres| !DepthMap::is_known(metres)).collect();
            let map_px = distance_px * map.width as i32 / color.width as i32;
            moved.metres.iter_mut().for_each(|metres| *metres = DepthMap::inverse_depth(*metres));
            Outlines::default().shift(&mut moved.metres, &unknown, map.width as usize, map_px, 0.0);
            // Back to metres: 0 is unknown in both units.
            moved.metres.iter_mut().filter(|value| **value > 0.0).for_each(|value| *value = value.recip());
            outlines = EdgeAlignment::measure(&moved, color);
        }
        // At each scale, edges move by about three pixels.
        let of_size = self.smaller.map_or(1, |(width, _)| color.width.div_ceil(width.max(1)));
        let coarsest = match outlines {
            EdgeAlignment::Unrelated => return None,
            EdgeAlignment::Soft { width_px } => width_px.div_ceil(3).max(of_size),
            EdgeAlignment::Aligned | EdgeAlignment::Unknown | EdgeAlignment::Shifted { .. } if distance_px == 0 => {
                of_size
            }
            EdgeAlignment::Aligned | EdgeAlignment::Unknown | EdgeAlignment::Shifted { .. } => of_size.max(2),
        };
        Some(MapCorrection { distance_px, coarsest })
    }
}

impl fmt::Display for Misalignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((width, height)) = self.smaller {
            write!(f, "it has {width} x {height} pixels")?;
        }
        let and = if self.smaller.is_some() { " and " } else { "" };
        match self.outlines {
            EdgeAlignment::Shifted { distance_px } => {
                let side = if distance_px < 0 { "outside" } else { "inside" };
                write!(f, "{and}its outlines lie about {} px {side} those of the picture", distance_px.abs())
            }
            EdgeAlignment::Soft { width_px } => write!(f, "{and}its outlines are about {width_px} px wide"),
            EdgeAlignment::Unrelated => write!(f, "{and}none of its outlines match those of the picture"),
            EdgeAlignment::Aligned | EdgeAlignment::Unknown => Ok(()),
        }
    }
}
