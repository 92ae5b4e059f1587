//! Converts 16-bit depth to metres.

use crate::layout::Family;
use crate::v4l2::Layout;
use bokehcam::frame::DepthMap;

/// The unit of a depth camera's numbers. 0 and the largest number, at which sensors clip, are unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Units per metre.
    pub per_m: f32,
    /// Another number for unknown depth.
    pub invalid: u16,
}

impl Units {
    /// Decodes a picture of this layout into `map`, which is resized to fit. Returns false if the layout is not 16-bit
    /// depth, or the plane is too short.
    pub(super) fn decode(&self, layout: &Layout, plane: &[u8], map: &mut DepthMap) -> bool {
        if layout.family() != Family::Depth16 || plane.len() < layout.min_size_bytes(0) {
            return false;
        }
        map.resize(layout.width, layout.height);
        let (stride_bytes, width) = (layout.planes()[0].stride_bytes, layout.width as usize);
        let m_per_unit = 1.0 / self.per_m;
        for (row, metres) in plane.chunks(stride_bytes).zip(map.metres.chunks_exact_mut(width)) {
            for (bytes, metres) in row.as_chunks().0.iter().zip(metres) {
                let units = u16::from_le_bytes(*bytes);
                // 0 units become 0 m, which means unknown as well.
                let known = (units != self.invalid) & (units != u16::MAX);
                *metres = if known { f32::from(units) * m_per_unit } else { 0.0 };
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v4l2::FourCc;

    #[test]
    fn numbers_become_metres_and_what_is_unknown_stays_so() {
        let layout = Layout::packed(FourCc::Z16, 3, 2).unwrap().with_row_padding(2);
        let units = Units { per_m: 1000.0, invalid: 7 };
        let numbers: [u16; 8] = [0, 1000, 7, 9999, 65535, 2500, 256, 9999];
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let mut map = DepthMap::default();
        assert!(units.decode(&layout, &bytes, &mut map));
        assert_eq!(map.size(), (3, 2));
        for (found, expected) in map.metres.iter().zip([0.0, 1.0, 0.0, 0.0, 2.5, 0.256]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        // The last row needs no padding.
        assert!(units.decode(&layout, &bytes[..14], &mut map));
        assert!(!units.decode(&layout, &bytes[..13], &mut map));
        let color = Layout::packed(FourCc::YUYV, 3, 2).unwrap();
        assert!(!units.decode(&color, &bytes, &mut map));
    }
}
