//! A stereo camera that delivers both views side by side in one picture.

use std::sync::Arc;

use super::{Brings, Camera, CaptureError, Captured, Seeker, Shot, SourceInfo};
use crate::frame::{ColorImage, luma_of};

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
            return Err(CaptureError::NoHalves { source_name: info.name, width, height });
        }
        if info.brings != Brings::Color {
            return Err(CaptureError::NotOnePicture { source_name: info.name });
        }
        info.size = (width / 2, height);
        info.brings = Brings::RightCamera;
        Ok(Self { camera, info, wide: ColorImage::default() })
    }
}

impl Camera for SideBySide {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, Shot { color, depth, right }: Shot) -> Result<Captured, CaptureError> {
        let captured = self.camera.next(Shot { color: &mut self.wide, depth, right: &mut *right })?;
        if matches!(captured, Captured::Frame(_)) {
            let (width, height) = self.info.size;
            color.resize(width, height);
            right.resize(width, height);
            let (row_px, row_bytes) = (width as usize, width as usize * 3);
            let rows = self.wide.rgb.chunks_exact(2 * row_bytes);
            let halves = color.rgb.chunks_exact_mut(row_bytes).zip(right.luma.chunks_exact_mut(row_px));
            for (row, (left, luma)) in rows.zip(halves) {
                left.copy_from_slice(&row[..row_bytes]);
                luma_of(&row[row_bytes..], luma);
            }
        }
        Ok(captured)
    }

    fn skip(&mut self, until_ns: u64) -> u64 {
        self.camera.skip(until_ns)
    }

    fn waited_ns(&self) -> u64 {
        self.camera.waited_ns()
    }

    fn seeker(&self) -> Option<Arc<Seeker>> {
        self.camera.seeker()
    }

    fn seek(&mut self, place: usize) -> i64 {
        self.camera.seek(place)
    }

    fn suspend(&mut self) {
        self.camera.suspend();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{DepthMap, GrayImage, Stamp};

    /// One picture of this size: bytes count up, and the right half is 100 brighter.
    struct Wide((u32, u32), Brings);

    impl Camera for Wide {
        fn info(&self) -> SourceInfo {
            let (name, brings) = ("wide".to_owned(), self.1);
            SourceInfo { name, size: self.0, period_ns: 1, frames: None, live: false, brings }
        }
        fn next(&mut self, shot: Shot) -> Result<Captured, CaptureError> {
            shot.color.resize(self.0.0, self.0.1);
            for (index, pixel) in shot.color.rgb.chunks_exact_mut(3).enumerate() {
                let right = index as u32 % self.0.0 >= self.0.0 / 2;
                pixel.fill(index as u8 + if right { 100 } else { 0 });
            }
            Ok(Captured::Frame(Stamp { index: 3, time_ns: 5, captured_ns: None }))
        }
        fn skip(&mut self, until_ns: u64) -> u64 {
            until_ns
        }
    }

    #[test]
    fn the_left_half_is_the_picture_and_the_right_half_the_other_eye() {
        let mut camera = SideBySide::new(Box::new(Wide((6, 2), Brings::Color))).unwrap();
        assert_eq!((camera.info().size, camera.info().brings), ((3, 2), Brings::RightCamera));
        let (mut color, mut depth, mut right) = Default::default();
        let _: (&ColorImage, &DepthMap, &GrayImage) = (&color, &depth, &right);
        let shot = Shot { color: &mut color, depth: &mut depth, right: &mut right };
        assert!(matches!(camera.next(shot), Ok(Captured::Frame(Stamp { index: 3, .. }))));
        assert_eq!((color.size(), right.size()), ((3, 2), (3, 2)));
        let left: Vec<u8> = color.rgb.chunks_exact(3).map(|pixel| pixel[1]).collect();
        assert_eq!((left, right.luma), (vec![0, 1, 2, 6, 7, 8], vec![103, 104, 105, 109, 110, 111]));
        assert_eq!(camera.skip(7), 7);
    }

    #[test]
    fn what_has_no_two_halves_is_refused() {
        let refusal = |size, brings| SideBySide::new(Box::new(Wide(size, brings))).err().unwrap().to_string();
        let odd = refusal((7, 2), Brings::Color);
        assert!(odd.contains("wide") && odd.contains("7x2") && odd.contains("even"), "{odd}");
        for brings in [Brings::RightCamera, Brings::Depth] {
            assert!(refusal((6, 2), brings).contains("--side-by-side"));
        }
    }
}
