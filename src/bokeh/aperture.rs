//! The shape of the lens opening, sampled as an antialiased mask.

use std::sync::Arc;

/// A lens opening as seen by the camera, inside the unit disc (x right, y down).
#[derive(Clone, Debug, PartialEq)]
pub struct Aperture {
    /// The outline.
    pub shape: Shape,
    /// Radial intensity: -1 a soap bubble (bright rim), 0 flat, 1 apodised (bright centre).
    pub intensity: f32,
}

/// The outline of an aperture.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A circle.
    Disc,
    /// A circle with a hole (mirror lens).
    Ring {
        /// Radius of the hole, 0 to below 1.
        inner: f32,
    },
    /// A regular polygon of straight or curved blades.
    Polygon {
        /// Number of blades, 3 to 16.
        blades: u32,
        /// Turn clockwise in degrees; 0 puts a corner at the top.
        rotation_deg: f32,
        /// 0 straight blades to 1 a circle.
        curvature: f32,
    },
    /// A heart.
    Heart,
    /// A star.
    Star {
        /// Number of points, 3 to 16.
        points: u32,
    },
    /// A greyscale picture, its larger side spanning the disc's diameter.
    Picture(Arc<Picture>),
}

/// A greyscale picture used as an aperture.
#[derive(Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` transmittances, 0 to 1, row-major.
    pub grey: Vec<f32>,
}

/// A square mask: `size` x `size` transmittances >= 0 over [-1, 1] x [-1, 1], row-major, at least one of them > 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Columns and rows.
    pub size: usize,
    /// `size * size` values.
    pub values: Vec<f64>,
}

impl Aperture {
    /// The antialiased mask, with a rim that ramps over `rim` (0 to 1) of the radius.
    pub fn mask(&self, _size: usize, _rim: f32) -> Mask {
        unimplemented!()
    }
}
