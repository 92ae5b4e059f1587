//! Depth in a camera's own pixels, for pictures that are turned, flipped and cut.

use super::{DepthError, DepthSource, FrameInput};
use crate::frame::transform::Transform;
use crate::frame::{ColorImage, DepthMap};

/// Transforms the maps of another source like the pictures that they belong to.
pub struct TransformedDepth {
    source: Box<dyn DepthSource>,
    transform: Transform,
    /// Width and height of the camera's own pictures.
    own_px: (u32, u32),
    /// The last picture in the camera's own pixels, where this source transforms the pictures, too.
    own: Option<ColorImage>,
    map: DepthMap,
}

impl TransformedDepth {
    /// Transforms the maps of `source` for pictures that were `own_px` large and are transformed already.
    pub fn new(source: Box<dyn DepthSource>, transform: Transform, own_px: (u32, u32)) -> Self {
        Self { source, transform, own_px, own: None, map: DepthMap::default() }
    }

    /// Transforms the pictures as well, once `source` has rectified and before it has matched them.
    pub fn with_pictures(self) -> Self {
        Self { own: Some(ColorImage::default()), ..self }
    }
}

impl DepthSource for TransformedDepth {
    fn rectify(&mut self, color: &mut ColorImage) {
        let Self { source, transform, own, .. } = self;
        let Some(own) = own else { return };
        source.rectify(color);
        std::mem::swap(own, color);
        transform.apply_to_color(own, color);
    }

    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        let color = self.own.as_ref().unwrap_or(seen.color);
        self.source.read(FrameInput { color, ..seen }, &mut self.map)?;
        self.transform.apply_to_map(&self.map, self.own_px, map);
        Ok(())
    }

    fn inner(&self) -> Option<&dyn DepthSource> {
        Some(&*self.source)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn DepthSource> {
        Some(&mut *self.source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Stamp;
    use crate::frame::transform::{Flip, Rotation};

    /// Adds 10 to a picture to rectify it; its depth is what the picture then has.
    struct Shown;

    impl DepthSource for Shown {
        fn rectify(&mut self, color: &mut ColorImage) {
            color.rgb.iter_mut().for_each(|code| *code += 10);
        }
        fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
            map.resize(seen.color.width, seen.color.height);
            let codes = seen.color.rgb.iter().step_by(3);
            map.metres.iter_mut().zip(codes).for_each(|(metres, &code)| *metres = f32::from(code));
            Ok(())
        }
    }

    #[test]
    fn a_pair_is_rectified_and_matched_in_the_cameras_own_pixels() {
        let turn = Transform { rotation: Rotation::Quarter, flip: Flip::None, area: Some("2x2+0+1".parse().unwrap()) };
        let mut source = TransformedDepth::new(Box::new(Shown), turn, (3, 2)).with_pictures();
        let mut map = DepthMap::default();
        for frame in 0..3 {
            let rgb = (0..6).flat_map(|k| [k + frame; 3]).collect();
            let mut color = ColorImage { width: 3, height: 2, rgb };
            source.rectify(&mut color);
            // Rows of 0 1 2 and 3 4 5 become 3 0, 4 1 and 5 2, of which the last two rows stay.
            let turned = [4, 1, 5, 2].map(|k| k + frame + 10);
            assert_eq!(
                (color.size(), color.rgb.iter().copied().step_by(3).collect::<Vec<u8>>()),
                ((2, 2), turned.into())
            );
            let stamp = Stamp { index: 0, time_ns: 0, captured_ns: None };
            source.read(FrameInput { stamp, color: &color, right: None }, &mut map).unwrap();
            assert_eq!((map.size(), &map.metres[..]), ((2, 2), &turned.map(f32::from)[..]), "as the picture");
        }
    }

    #[test]
    fn maps_alone_are_turned_where_the_pictures_are_already() {
        let turn = Transform { rotation: Rotation::Half, ..Transform::default() };
        let mut source = TransformedDepth::new(Box::new(Shown), turn, (2, 1));
        let mut color = ColorImage { width: 2, height: 1, rgb: vec![1, 1, 1, 2, 2, 2] };
        source.rectify(&mut color);
        assert_eq!(color.rgb, [1, 1, 1, 2, 2, 2]);
        let (stamp, mut map) = (Stamp { index: 0, time_ns: 0, captured_ns: None }, DepthMap::default());
        source.read(FrameInput { stamp, color: &color, right: None }, &mut map).unwrap();
        assert_eq!(map.metres, [2.0, 1.0]);
    }
}
