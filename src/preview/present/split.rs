//! Where before and after meet.

use std::ops::Range;

use super::Drawing;
use crate::frame::ColorImage;

/// Rows of the picture's area for each pixel of the divider's thickness.
const ROWS_PER_PX: u32 = 800;
/// The divider's stripes, left to right: dark beside bright can be seen on everything.
const STRIPES: [[u8; 3]; 3] = [[24; 3], [255; 3], [24; 3]];

/// Where the two meet, in columns of the area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// The first column of what is shown after the blur.
    pub at: usize,
    width: usize,
    unit: usize,
}

impl Split {
    /// At a fraction of an area.
    fn new(fraction: f32, width: u32, height: u32) -> Self {
        let at = (fraction.clamp(0.0, 1.0) * width as f32).round() as usize;
        Self { at, width: width as usize, unit: (height / ROWS_PER_PX).max(1) as usize }
    }

    /// The columns of each stripe of the divider, and its colour.
    pub fn divider(self) -> [(Range<usize>, [u8; 3]); 3] {
        let Self { at, width, unit } = self;
        // The bright one is twice as wide.
        let edges = [-2, -1, 1, 2].map(|step: isize| at.saturating_add_signed(step * unit as isize).min(width));
        std::array::from_fn(|k| (edges[k]..edges[k + 1], STRIPES[k]))
    }
}

impl<'a> Drawing<'a> {
    /// What is shown on the left, and how far; none where it does not fit the picture.
    pub fn split(&self) -> Option<(&'a ColorImage, Split)> {
        let (before, fraction) = self.before.filter(|(before, _)| before.size() == self.picture.size())?;
        Some((before, Split::new(fraction, self.area.width, self.area.height)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_divider_stays_within_the_area() {
        let stripes = |fraction, height| Split::new(fraction, 100, height).divider().map(|(columns, _)| columns);
        assert_eq!(stripes(0.5, 720), [48..49, 49..51, 51..52]);
        assert_eq!(stripes(0.5, 1600), [46..48, 48..52, 52..54]);
        assert_eq!(stripes(0.0, 720), [0..0, 0..1, 1..2]);
        assert_eq!(stripes(7.0, 720), [98..99, 99..100, 100..100]);
        assert_eq!(stripes(f32::NAN, 720), [0..0, 0..1, 1..2]);
    }
}
