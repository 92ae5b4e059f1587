//! Orientation tags (EXIF, tag 274).

use image::metadata::Orientation;

use bokehcam::frame::transform::{Flip, Rotation, Transform};

/// Returns what turns a stored picture upright, and all that is in its pixels.
pub(super) fn upright(orientation: Orientation) -> Transform {
    let (rotation, flip) = match orientation {
        Orientation::NoTransforms => (Rotation::None, Flip::None),
        Orientation::Rotate90 => (Rotation::Quarter, Flip::None),
        Orientation::Rotate180 => (Rotation::Half, Flip::None),
        Orientation::Rotate270 => (Rotation::ThreeQuarters, Flip::None),
        Orientation::FlipHorizontal => (Rotation::None, Flip::Horizontal),
        Orientation::FlipVertical => (Rotation::None, Flip::Vertical),
        Orientation::Rotate90FlipH => (Rotation::Quarter, Flip::Horizontal),
        Orientation::Rotate270FlipH => (Rotation::ThreeQuarters, Flip::Horizontal),
    };
    Transform { rotation, flip, area: None }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, RgbImage};

    use super::*;
    use bokehcam::frame::ColorImage;

    #[test]
    fn every_tag_turns_as_the_image_library_does() {
        let stored = ColorImage { width: 3, height: 2, rgb: (0..18).collect() };
        for tag in 1..=8 {
            let orientation = Orientation::from_exif(tag).unwrap();
            let mut expected = DynamicImage::from(RgbImage::from_raw(3, 2, stored.rgb.clone()).unwrap());
            expected.apply_orientation(orientation);
            let found = upright(orientation).transform_color(stored.clone());
            assert_eq!(found.size(), (expected.width(), expected.height()), "{tag}");
            assert_eq!(found.rgb, expected.into_bytes(), "{tag}");
        }
    }
}
