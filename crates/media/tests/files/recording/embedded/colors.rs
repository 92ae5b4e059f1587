//! The colours of originals inside photos.

use std::fs;
use std::sync::Arc;

use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam::look::Look;
use bokehcam_live::capture::FrameBuffers;
use bokehcam_live::source::photo::read_default_depth;
use bokehcam_live::source::{Options, Source, SourceName};
use bokehcam_media::recording::PhotoMetadata;
use bokehcam_media::recording::still::{read_color, write_photo};
use moxcms::ColorProfile;
use tempfile::TempDir;

use super::RANGE;
use super::containers::{gdepth_extended, maps};

#[test]
fn an_original_is_shown_in_srgb_and_kept_in_its_own_colours() {
    let dir = TempDir::new().unwrap();
    let [original, photo] = ["original.png", "photo.jpg"].map(|name| dir.path().join(name));
    let mut picture = ColorImage::new(16, 8);
    picture.rgb.as_chunks_mut::<3>().0.fill([200, 60, 40]);
    for profile in [Some(ColorProfile::new_display_p3()), None] {
        let icc_profile = profile.map(|profile| profile.encode().unwrap());
        let is_other = icc_profile.is_some();
        write_photo(&original, &picture, &PhotoMetadata { icc_profile, ..PhotoMetadata::default() }, true).unwrap();
        fs::write(&photo, gdepth_extended(RANGE, &maps()[1], &fs::read(&original).unwrap(), |_| {})).unwrap();
        let options = Options::default();
        let mut source = Source::open(&SourceName::Photo(photo.clone()), &options, None).unwrap();
        let mut shown = ColorImage::default();
        let (depth, right) = (&mut DepthMap::default(), &mut GrayImage::default());
        source.camera.next(FrameBuffers { color: &mut shown, depth, right }).unwrap();
        assert_eq!(shown, read_color(&original).unwrap());
        assert_eq!(shown != picture, is_other);
        let (found, _) = read_default_depth(&photo, &Arc::new(shown), &options, &Look::default()).unwrap();
        assert_eq!(found.unwrap().original, Some(picture.clone()));
    }
}
