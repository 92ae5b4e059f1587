//! A stereo camera that delivers both views side by side in one picture.

use super::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam::frame::{ColorImage, compute_luma};

/// Splits the pictures of another camera: the left half is the left view, the right half the right view.
pub struct SideBySide {
    camera: Box<dyn Camera>,
    info: SourceInfo,
    wide: ColorImage,
}

impl SideBySide {
    /// Splits the pictures of `camera`.
    ///
    /// # Errors
    /// They have an odd width, or `camera` already delivers depth or a right view.
    pub fn new(camera: Box<dyn Camera>) -> Result<Self, CaptureError> {
        let mut info = camera.info();
        let (width, height) = info.size;
        if !width.is_multiple_of(2) || width == 0 {
            return Err(CaptureError::OddWidth { source_name: info.name, width, height });
        }
        if info.frame_data != FrameData::Color {
            return Err(CaptureError::NotSideBySide { source_name: info.name });
        }
        info.size = (width / 2, height);
        info.frame_data = FrameData::RightCamera;
        Ok(Self { camera, info, wide: ColorImage::default() })
    }
}

impl Camera for SideBySide {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, FrameBuffers { color, depth, right }: FrameBuffers) -> Result<Captured, CaptureError> {
        let captured = self.camera.next(FrameBuffers { color: &mut self.wide, depth, right: &mut *right })?;
        if matches!(captured, Captured::Frame(_)) {
            let (width, height) = self.info.size;
            color.resize(width, height);
            right.resize(width, height);
            let (row_px, row_bytes) = (width as usize, width as usize * 3);
            let rows = self.wide.rgb.chunks_exact(2 * row_bytes);
            let halves = color.rgb.chunks_exact_mut(row_bytes).zip(right.luma.chunks_exact_mut(row_px));
            for (row, (left, luma)) in rows.zip(halves) {
                left.copy_from_slice(&row[..row_bytes]);
                compute_luma(&row[row_bytes..], luma);
            }
        }
        Ok(captured)
    }

    fn inner(&mut self) -> Option<&mut dyn Camera> {
        Some(&mut *self.camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bokehcam::frame::{DepthMap, GrayImage, Stamp};

    /// One picture of this size: bytes count up, and the right half is 100 brighter.
    struct Wide((u32, u32), FrameData);

    impl Camera for Wide {
        fn info(&self) -> SourceInfo {
            let (name, frame_data) = ("wide".to_owned(), self.1);
            SourceInfo { name, size: self.0, period_ns: 1, frames: None, live: false, frame_data }
        }
        fn next(&mut self, buffers: FrameBuffers) -> Result<Captured, CaptureError> {
            buffers.color.resize(self.0.0, self.0.1);
            for (index, pixel) in buffers.color.rgb.chunks_exact_mut(3).enumerate() {
                let right = index as u32 % self.0.0 >= self.0.0 / 2;
                pixel.fill(index as u8 + if right { 100 } else { 0 });
            }
            Ok(Captured::Frame(Stamp { index: 3, time_ns: 5, captured_ns: None }))
        }
        fn skip_until(&mut self, until_ns: u64) -> u64 {
            until_ns
        }
    }

    #[test]
    fn the_left_half_is_the_picture_and_the_right_half_the_other_eye() {
        let mut camera = SideBySide::new(Box::new(Wide((6, 2), FrameData::Color))).unwrap();
        assert_eq!((camera.info().size, camera.info().frame_data), ((3, 2), FrameData::RightCamera));
        let (mut color, mut depth, mut right) = Default::default();
        let _: (&ColorImage, &DepthMap, &GrayImage) = (&color, &depth, &right);
        let buffers = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
        assert!(matches!(camera.next(buffers), Ok(Captured::Frame(Stamp { index: 3, .. }))));
        assert_eq!((color.size(), right.size()), ((3, 2), (3, 2)));
        let left: Vec<u8> = color.rgb.chunks_exact(3).map(|pixel| pixel[1]).collect();
        assert_eq!((left, right.luma), (vec![0, 1, 2, 6, 7, 8], vec![103, 104, 105, 109, 110, 111]));
        assert_eq!(camera.skip_until(7), 7);
    }

    #[test]
    fn what_has_no_two_halves_is_refused() {
        let refusal = |size, frame_data| SideBySide::new(Box::new(Wide(size, frame_data))).err().unwrap().to_string();
        let odd = refusal((7, 2), FrameData::Color);
        assert!(odd.contains("wide") && odd.contains("7x2") && odd.contains("even"), "{odd}");
        for frame_data in [FrameData::RightCamera, FrameData::Depth] {
            assert!(refusal((6, 2), frame_data).contains("--side-by-side"));
        }
    }
}
