//! The split view: the picture before the blur on the left, after it on the right.

use std::ops::Range;

use super::Drawing;
use bokehcam::frame::ColorImage;

/// Rows of the picture's area per pixel of the divider's thickness.
const ROWS_PER_PX: u32 = 800;
/// Colours of the divider's stripes, left to right: dark next to bright stands out on any picture.
const STRIPES: [[u8; 3]; 3] = [[24; 3], [255; 3], [24; 3]];

/// The split position and the divider, in columns of the picture's area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// The first column that shows the picture after the blur.
    pub at: usize,
    /// The same before clamping to the area.
    line: isize,
    /// Width of the area in columns.
    width: usize,
    /// Width of a dark stripe; the bright one is twice as wide.
    stripe_px: usize,
}

impl Split {
    /// Computes a split at `fraction` of `whole` columns, of which an area of `width` x `height` pixels shows those
    /// from `first` on.
    fn new(fraction: f32, (whole, first): (u32, u32), width: u32, height: u32) -> Self {
        let line = (fraction.clamp(0.0, 1.0) * whole as f32).round() as isize - first as isize;
        let at = line.clamp(0, width as isize) as usize;
        Self { at, line, width: width as usize, stripe_px: (height / ROWS_PER_PX).max(1) as usize }
    }

    /// Returns the columns and the colour of each stripe of the divider.
    pub fn divider(self) -> [(Range<usize>, [u8; 3]); 3] {
        let Self { line, width, stripe_px, .. } = self;
        let edges = [-2, -1, 1, 2].map(|step| (line + step * stripe_px as isize).clamp(0, width as isize) as usize);
        std::array::from_fn(|k| (edges[k]..edges[k + 1], STRIPES[k]))
    }
}

impl<'a> Drawing<'a> {
    /// Returns the picture before the blur and the split; `None` without a split, or if their sizes differ.
    pub fn split(&self) -> Option<(&'a ColorImage, Split)> {
        let (before, fraction) = self.before.filter(|(before, _)| before.size() == self.picture.size())?;
        let whole = self
            .visible_region
            .map_or((self.area.width, 0), |part| (part.factor * self.picture.size().0, part.origin.0));
        Some((before, Split::new(fraction, whole, self.area.width, self.area.height)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_divider_stays_within_the_area() {
        let stripes =
            |fraction, height| Split::new(fraction, (100, 0), 100, height).divider().map(|(columns, _)| columns);
        assert_eq!(stripes(0.5, 720), [48..49, 49..51, 51..52]);
        assert_eq!(stripes(0.5, 1600), [46..48, 48..52, 52..54]);
        assert_eq!(stripes(0.0, 720), [0..0, 0..1, 1..2]);
        assert_eq!(stripes(7.0, 720), [98..99, 99..100, 100..100]);
        assert_eq!(stripes(f32::NAN, 720), [0..0, 0..1, 1..2]);
        // A zoomed picture, of which columns 150 to 250 of 400 are visible.
        let part = |fraction| Split::new(fraction, (400, 150), 100, 720);
        assert_eq!(part(0.5).divider().map(|(columns, _)| columns), [48..49, 49..51, 51..52]);
        for (fraction, at) in [(0.1, 0), (0.9, 100)] {
            assert!(part(fraction).at == at && part(fraction).divider().iter().all(|(columns, _)| columns.is_empty()));
        }
    }
}
