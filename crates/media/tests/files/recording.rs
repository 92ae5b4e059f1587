//! Recordings and single pictures: a written file is read back, and faults are reported.

mod associations;
mod by_name;
mod by_rule;
mod depth_files;
mod embedded;
mod euroc;
mod faults;
mod formats;
mod kinect;
mod kitti;
mod kitti_scenes;
mod layout;
mod maps;
mod masks;
mod middlebury;
mod pictures;
mod real;
mod registered;
mod rgbd;
mod siblings;
mod single_file;
mod still;
mod writer;

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::{Options, Recording, RecordingError, Scratch};
use image::{GrayImage, ImageBuffer, Luma, RgbImage};
use tempfile::TempDir;

const SIZE: (u32, u32) = (24, 16);

/// A folder in which a test assembles a recording.
struct Scene {
    dir: TempDir,
}

impl Scene {
    fn new() -> Self {
        let dir = TempDir::new().unwrap();
        fs::create_dir(dir.path().join("rgb")).unwrap();
        fs::create_dir(dir.path().join("depth")).unwrap();
        Self { dir }
    }

    /// Creates `count` pairs at times 1.0, 1.1, ... s, pictures numbered from 0, with their lists.
    fn with_pairs(count: u8) -> Self {
        let scene = Self::new();
        for index in 0..count {
            scene.color(&format!("rgb/{index}.png"), SIZE, index);
            scene.depth(&format!("depth/{index}.png"), SIZE, 5000 * (u16::from(index) + 1));
        }
        let list = |folder| (0..count).map(|index| format!("1.{index} {folder}/{index}.png\n")).collect::<String>();
        scene.write("rgb.txt", list("rgb"));
        scene.write("depth.txt", list("depth"));
        scene
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    fn remove(&self, name: &str) {
        fs::remove_file(self.path(name)).unwrap();
    }

    /// Writes a picture of the single colour (`shade`, 100, 200).
    fn color(&self, name: &str, (width, height): (u32, u32), shade: u8) {
        RgbImage::from_pixel(width, height, [shade, 100, 200].into()).save(self.path(name)).unwrap();
    }

    fn depth(&self, name: &str, (width, height): (u32, u32), units: u16) {
        ImageBuffer::<Luma<u16>, _>::from_pixel(width, height, [units].into()).save(self.path(name)).unwrap();
    }

    fn open(&self) -> Result<Recording, RecordingError> {
        self.open_with(&Options::default())
    }

    fn open_with(&self, options: &Options) -> Result<Recording, RecordingError> {
        Recording::open(self.dir.path(), options)
    }

    fn open_keep_going(&self) -> Recording {
        self.open_with(&Options { keep_going: true, ..Options::default() }).unwrap()
    }
}

fn color_of(recording: &Recording, index: usize) -> Result<ColorImage, RecordingError> {
    let mut image = ColorImage::default();
    recording.read_color(index, &mut Scratch::default(), &mut image).map(|()| image)
}

fn depth_of(recording: &Recording, index: usize) -> Result<DepthMap, RecordingError> {
    let mut depth = DepthMap::default();
    recording.read_depth(index, &mut Scratch::default(), &mut depth).map(|()| depth)
}

fn right_of(recording: &Recording, index: usize) -> Result<bokehcam::frame::GrayImage, RecordingError> {
    let mut luma = bokehcam::frame::GrayImage::default();
    recording.read_right(index, &mut Scratch::default(), &mut luma).map(|()| luma)
}

fn times_ns(recording: &Recording) -> Vec<u64> {
    (0..recording.len()).map(|index| recording.time_ns(index)).collect()
}

/// Asserts that the message is one line that contains all `parts`.
#[track_caller]
fn assert_says<T>(result: Result<T, RecordingError>, parts: &[&str]) {
    let Err(error) = result else { panic!("no error, where one should say {parts:?}") };
    let message = error.to_string();
    assert!(!message.contains('\n'), "more than one line: {message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

/// Returns a PNG that claims `width` x `height` pixels and has none, with a valid checksum.
fn png_that_claims(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    file.extend(13_u32.to_be_bytes());
    file.extend(&header);
    file.extend(crc32(&header).to_be_bytes());
    file.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    file
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}

fn save_grey(path: &Path, (width, height): (u32, u32), value: u8) {
    GrayImage::from_pixel(width, height, [value].into()).save(path).unwrap();
}
