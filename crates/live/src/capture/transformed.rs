//! A camera whose pictures are turned, flipped and cut as they come.

use super::{Camera, CaptureError, Captured, FrameBuffers, SourceInfo};
use bokehcam::frame::transform::Transform;
use bokehcam::frame::{ColorImage, DepthMap};

/// Transforms the pictures of another camera, and the depth that it delivers.
pub struct TransformedCamera {
    camera: Box<dyn Camera>,
    transform: Transform,
    /// Width and height of the camera's own pictures.
    own_px: (u32, u32),
    info: SourceInfo,
    /// Whether pictures pass as they are, because their depth source transforms them.
    is_deferred: bool,
    color: ColorImage,
    depth: DepthMap,
}

impl TransformedCamera {
    /// Transforms the pictures of `camera`. If `is_deferred`, they pass as they are, and only their size is stated as it
    /// will be: their depth source rectifies them, and then transforms them. The right camera's pictures stay as they are.
    ///
    /// # Errors
    /// The area to keep is not within the pictures.
    pub fn new(camera: Box<dyn Camera>, transform: Transform, is_deferred: bool) -> Result<Self, CaptureError> {
        let mut info = camera.info();
        let own_px = info.size;
        info.size = transform.output_size(own_px).map_err(|size_px| CaptureError::AreaOutside {
            source_name: info.name.clone(),
            area: transform.area,
            size_px,
        })?;
        let (color, depth) = (ColorImage::default(), DepthMap::default());
        Ok(Self { camera, transform, own_px, info, is_deferred, color, depth })
    }
}

impl Camera for TransformedCamera {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn next(&mut self, FrameBuffers { color, depth, right }: FrameBuffers) -> Result<Captured, CaptureError> {
        if self.is_deferred {
            return self.camera.next(FrameBuffers { color, depth, right });
        }
        let own = FrameBuffers { color: &mut self.color, depth: &mut self.depth, right };
        let captured = self.camera.next(own)?;
        if matches!(captured, Captured::Frame(_)) {
            self.transform.apply_to_color(&self.color, color);
            // A camera without depth leaves the map empty.
            if !self.depth.metres.is_empty() {
                self.transform.apply_to_map(&self.depth, self.own_px, depth);
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
    use crate::capture::FrameData;
    use bokehcam::frame::transform::{Flip, Rotation};
    use bokehcam::frame::{GrayImage, Stamp};

    /// Pictures of 3 x 2 pixels in reading order, with their number as depth.
    struct Numbered;

    impl Camera for Numbered {
        fn info(&self) -> SourceInfo {
            let (name, frame_data) = ("numbered".to_owned(), FrameData::Depth);
            SourceInfo { name, size: (3, 2), period_ns: 1, frames: None, live: false, frame_data }
        }
        fn next(&mut self, FrameBuffers { color, depth, right }: FrameBuffers) -> Result<Captured, CaptureError> {
            (color.width, color.height, color.rgb) = (3, 2, (0..6).flat_map(|k| [k; 3]).collect());
            (depth.width, depth.height, depth.metres) = (3, 2, (0..6_u8).map(f32::from).collect());
            right.luma = vec![1, 2, 3];
            Ok(Captured::Frame(Stamp { index: 3, time_ns: 5, captured_ns: None }))
        }
        fn skip_until(&mut self, until_ns: u64) -> u64 {
            until_ns
        }
    }

    fn read(transform: Transform, is_deferred: bool) -> ((u32, u32), Vec<u8>, Vec<f32>, Vec<u8>) {
        let mut camera = TransformedCamera::new(Box::new(Numbered), transform, is_deferred).unwrap();
        let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
        for _ in 0..2 {
            let buffers = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
            assert!(matches!(camera.next(buffers), Ok(Captured::Frame(Stamp { index: 3, .. }))));
        }
        assert_eq!(camera.skip_until(7), 7);
        (camera.info().size, color.rgb.iter().copied().step_by(3).collect(), depth.metres, right.luma)
    }

    #[test]
    fn pictures_and_their_depth_are_turned_alike_and_the_right_eye_is_not() {
        let area = Some("1x3+1+0".parse().unwrap());
        let turn = Transform { rotation: Rotation::Quarter, flip: Flip::None, area };
        assert_eq!(read(turn, false), ((1, 3), vec![0, 1, 2], vec![0.0, 1.0, 2.0], vec![1, 2, 3]));
        let flip = Transform { flip: Flip::Vertical, ..Transform::default() };
        assert_eq!(read(flip, false).1, [3, 4, 5, 0, 1, 2]);
        let (size, rgb, ..) = read(turn, true);
        assert_eq!((size, rgb), ((1, 3), vec![0, 1, 2, 3, 4, 5]), "its depth source turns it");
    }

    #[test]
    fn an_area_outside_names_the_camera_and_the_size() {
        let area = Some("3x2+0+0".parse().unwrap());
        let turn = Transform { rotation: Rotation::ThreeQuarters, flip: Flip::None, area };
        let error = TransformedCamera::new(Box::new(Numbered), turn, false).err().unwrap().to_string();
        assert!(error.contains("--crop 3x2+0+0") && error.contains("numbered") && error.contains("2x3"), "{error}");
    }
}
