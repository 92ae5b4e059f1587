//! Pictures, depth maps and disparities in files, and snapshots.

use bokehcam::recording::{snapshot as snapshots, still};

use super::input::{assert_one_line, put};

/// PNG and JPEG, as each command reads them.
pub fn picture(data: &[u8]) {
    let path = put("picture.png", data);
    match still::read_color(&path) {
        Ok(image) => {
            assert!(image.width > 0 && image.height > 0);
            assert_eq!(image.rgb.len(), image.width as usize * image.height as usize * 3);
        }
        Err(error) => assert_one_line(error),
    }
    match still::read_depth(&path, 5000.0, Some(7)) {
        Ok(depth) => assert_depth(&depth),
        Err(error) => assert_one_line(error),
    }
    match still::read_disparity(&path) {
        Ok(disparity) => {
            assert_eq!(disparity.px.len(), disparity.width as usize * disparity.height as usize);
            assert!(disparity.px.iter().all(|px| px.is_finite() && *px >= 0.0));
        }
        Err(error) => assert_one_line(error),
    }
    match still::read_grey(&path) {
        Ok((width, height, grey)) => {
            assert_eq!(grey.len(), width as usize * height as usize);
            assert!(grey.iter().all(|value| (0.0..=1.0).contains(value)));
        }
        Err(error) => assert_one_line(error),
    }
    if let Err(error) = snapshots::settings(&path) {
        assert_one_line(error);
    }
}

/// PFM, as depth and as disparity.
pub fn pfm(data: &[u8]) {
    let path = put("map.pfm", data);
    match still::read_depth(&path, 1.0, None) {
        Ok(depth) => assert_depth(&depth),
        Err(error) => assert_one_line(error),
    }
    match still::read_disparity(&path) {
        Ok(disparity) => {
            assert_eq!(disparity.px.len(), disparity.width as usize * disparity.height as usize);
            assert!(disparity.px.iter().all(|px| px.is_finite() && *px >= 0.0));
        }
        Err(error) => assert_one_line(error),
    }
}

/// The settings in a snapshot: as a text that the input is, and as one that `--like` takes over.
pub fn snapshot(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = put("snapshot.png", &png_with(text));
    match snapshots::settings(&path) {
        Ok(settings) => {
            assert!(settings.iter().all(|(_, value)| !value.contains(['\n', '\r'])), "{settings:?}");
            let flags = settings.into_iter().map(|(name, value)| format!("--{name}={value}"));
            let command = ["bokehcam", "config", "dump"].map(String::from).into_iter().chain(flags);
            let command: Vec<_> = command.map(Into::into).collect();
            if let Err(message) = bokehcam::cli::parsers::arguments(&command) {
                assert_one_line(message);
            }
        }
        Err(error) => assert_one_line(error),
    }
}

fn png_with(text: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.add_itxt_chunk(snapshots::KEYWORD.to_string(), text.to_string()).unwrap();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0; 3]).unwrap();
    writer.finish().unwrap();
    bytes
}

fn assert_depth(depth: &bokehcam::frame::DepthMap) {
    assert_eq!(depth.metres.len(), depth.width as usize * depth.height as usize);
    assert!(depth.metres.iter().all(|metres| metres.is_finite() && *metres >= 0.0));
}
