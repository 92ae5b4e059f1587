//! Targets for pictures, depth maps, disparities and snapshots in files.

use std::path::Path;

use bokehcam::frame::{ColorImage, DepthMap, DisparityMap};
use bokehcam_media::recording::depth_file::{self, DepthUnit, Fit, Options};
use bokehcam_media::recording::{Photo, PhotoMetadata, embedded, snapshot as snapshots, still};

use super::input::{assert_one_line, file_path, write_file};

/// Maximum size of pictures to write back, which is slow.
const MAX_WRITTEN_BYTES: usize = 1 << 16;

/// Reads a PNG or JPEG in each way that the commands do.
pub fn picture(data: &[u8]) {
    let path = write_file("picture.png", data);
    match still::read_photo(&path) {
        Ok((image, metadata)) => {
            assert!(image.width > 0 && image.height > 0);
            assert_eq!(image.rgb.len(), image.width as usize * image.height as usize * 3);
            if image.rgb.len() < MAX_WRITTEN_BYTES {
                check_roundtrip(&image, metadata);
                check_photo(&path);
            }
        }
        Err(error) => assert_one_line(error),
    }
    check_maps(&path);
    match still::read_grey(&path) {
        Ok((width, height, grey)) => {
            assert_eq!(grey.len(), width as usize * height as usize);
            assert!(grey.iter().all(|value| (0.0..=1.0).contains(value)));
        }
        Err(error) => assert_one_line(error),
    }
    if let Err(error) = snapshots::read_settings(&path) {
        assert_one_line(error);
    }
}

/// Checks that a photo is written as TIFF and WebP as it was read.
fn check_photo(path: &Path) {
    for name in ["photo.tif", "photo.webp"] {
        let (photo, to) = (Photo::read(path).expect("a photo that was read before"), file_path(name));
        let (size, is_16bit, alpha) = (photo.color.size(), photo.is_16bit, photo.alpha.clone());
        photo.write(&to, true).expect("a photo that was read can be written");
        let again = Photo::read(&to).expect("a photo that was written can be read");
        assert_eq!(again.color.size(), size, "{name}");
        if name == "photo.tif" {
            assert_eq!((again.is_16bit, again.alpha), (is_16bit, alpha));
        }
    }
}

/// Finds the depth inside a photo.
pub fn embedded_depth(data: &[u8]) {
    match embedded::find(data) {
        Ok(Some(found)) => {
            assert!(found.map.len() + found.original.map_or(0, |original| original.len()) <= data.len());
            let depths = [0.0, 0.25, 1.0].map(|v| found.meaning.to_depth(v));
            assert!(depths.iter().all(|depth| depth.is_finite() && *depth >= 0.0), "{:?}", found.meaning);
        }
        Ok(None) => {}
        Err(fault) => assert_one_line(fault),
    }
}

/// Reads a depth map in any format as depth and as disparity.
pub fn depth_map(data: &[u8]) {
    let path = write_file("map", data);
    check_maps(&path);
}

/// Reads a file as depth and as disparity.
fn check_maps(path: &Path) {
    for unit in [None, Some(DepthUnit::PerMetre(1000.0)), Some(DepthUnit::Inverse), Some(DepthUnit::Disparity)] {
        for fit in [Fit::Stretch, Fit::Crop] {
            let options = Options { unit, fit: Some(fit), invalid: Some(7.0), ..Options::default() };
            match depth_file::read(path, &options, (40, 30)) {
                Ok(file) => {
                    assert_depth(&file.map);
                    assert!(
                        depth_file::covers(file.map.size(), (40, 30))
                            || fit == Fit::Stretch
                            || file.map.size() < (9, 9)
                    );
                }
                Err(error) => assert_one_line(error),
            }
        }
    }
    match still::read_depth(path, 5000.0, None) {
        Ok(depth) => assert_depth(&depth),
        Err(error) => assert_one_line(error),
    }
    match still::read_disparity(path) {
        Ok(disparity) => assert_disparity(&disparity),
        Err(error) => assert_one_line(error),
    }
}

/// Checks that a picture and its metadata survive writing and reading.
fn check_roundtrip(image: &ColorImage, metadata: PhotoMetadata) {
    let metadata = metadata.without_thumbnail();
    for (name, metadata) in [("again.png", metadata.clone()), ("again.jpg", metadata.for_jpeg())] {
        let path = file_path(name);
        still::write_photo(&path, image, &metadata, true).expect("a picture that was read can be written");
        let (again, with) = still::read_photo(&path).expect("a picture that was written can be read");
        assert_eq!((again.width, again.height), (image.width, image.height), "{name}");
        assert_eq!((with.icc_profile, with.exif), (metadata.icc_profile, metadata.exif), "{name}");
        assert!(name != "again.png" || again.rgb == image.rgb);
    }
}

/// Reads the settings of a snapshot from a text chunk with the input, and parses them like `--like`.
pub fn snapshot(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = write_file("snapshot.png", &png_with_text(text));
    match snapshots::read_settings(&path) {
        Ok(settings) => {
            assert!(settings.iter().all(|(_, value)| !value.contains('\n')), "{settings:?}");
            let flags = settings.into_iter().map(|(name, value)| format!("--{name}={value}"));
            let command = ["bokehcam", "config", "dump"].map(String::from).into_iter().chain(flags);
            let command: Vec<_> = command.map(Into::into).collect();
            if let Err(message) = bokehcam_cli::parsers::parse_arguments(&command) {
                assert_one_line(message);
            }
        }
        Err(error) => assert_one_line(error),
    }
}

fn png_with_text(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.add_itxt_chunk(snapshots::KEYWORD.to_string(), text.to_string()).unwrap();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0; 3]).unwrap();
    writer.finish().unwrap();
    bytes
}

fn assert_depth(depth: &DepthMap) {
    assert_eq!(depth.metres.len(), depth.width as usize * depth.height as usize);
    assert!(depth.metres.iter().all(|metres| metres.is_finite() && *metres >= 0.0));
}

fn assert_disparity(disparity: &DisparityMap) {
    assert_eq!(disparity.px.len(), disparity.width as usize * disparity.height as usize);
    assert!(disparity.px.iter().all(|px| px.is_finite() && *px >= 0.0));
}
