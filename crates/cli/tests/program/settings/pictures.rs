//! Test files in a home: a photo with depth, and recordings.

use std::fs;
use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still;

use crate::common;
use crate::program::Home;

impl Home {
    /// Adds `photo.png` and its depth, `depth.png` and `depth.pfm`: 64 x 48 pixels, 0.5 m to 4.5 m from left to right.
    pub fn with_photo(self) -> Self {
        let (width, height) = (64, 48);
        let mut photo = ColorImage::new(width, height);
        photo.rgb.iter_mut().enumerate().for_each(|(k, value)| *value = (k * 37 % 251) as u8);
        still::write_color(&self.path("photo.png"), &photo, false).unwrap();
        ["depth.png", "depth.pfm"].iter().for_each(|name| self.add_depth(name, (width, height)));
        self
    }

    /// Adds a depth map that increases from left to right.
    pub fn add_depth(&self, name: &str, (width, height): (u32, u32)) {
        let depth = common::depth(width, height, |x, _| 0.5 + 4.0 * x as f32 / width as f32);
        let scale = if name.ends_with(".pfm") { 1.0 } else { 5000.0 };
        still::write_depth(&self.path(name), &depth, scale, false).unwrap();
    }

    /// Adds `recording`: four small frames with depth.
    pub fn with_recording(self) -> Self {
        self.run(&["record", "synthetic", "--size", "64x48", "--frames", "4", "--to", "recording"]).done();
        self
    }

    /// Adds `colours`: the recording without depth.
    pub fn with_colours(self) -> Self {
        let home = self.with_recording();
        fs::rename(home.path("recording"), home.path("colours")).unwrap();
        fs::remove_file(home.path("colours/depth.txt")).unwrap();
        let _ = fs::remove_file(home.path("colours/associations.txt"));
        home
    }
}

pub fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}
