//! Stereo recordings, rectified and in memory.

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::frame::{ColorImage, DisparityMap, GrayImage};
use bokehcam::optics::StereoRig;

use super::Outcome;
use super::quality::picture::Plane;
use super::quality::sheet;
use super::quality::texture::Rng;

/// A stereo pair.
pub struct Frame {
    /// Media time.
    pub time_ns: u64,
    /// The left picture.
    pub left: ColorImage,
    /// The right picture.
    pub right: ColorImage,
    /// The true disparity of the left picture in pixels, where it is known.
    pub truth: Option<Plane<f32>>,
}

/// A recording.
pub struct Sequence {
    /// Name in the tables.
    pub name: &'static str,
    /// The rig's geometry.
    pub rig: StereoRig,
    /// A disparity range that covers the sequence.
    pub disparities: u32,
    /// Frames in temporal order.
    pub frames: Vec<Frame>,
}

impl Frame {
    /// Returns both pictures in grey, the input of matchers.
    pub fn to_gray(&self) -> [GrayImage; 2] {
        [&self.left, &self.right].map(|color| {
            let mut gray = GrayImage::default();
            gray.set_luma_from(color);
            gray
        })
    }

    /// Adds normal noise to both pictures; each seed gives another noise.
    pub fn add_noise(&mut self, codes: f32, seed: u64) {
        let mut rng = Rng::new(seed);
        for code in self.left.rgb.iter_mut().chain(&mut self.right.rgb) {
            *code = (f32::from(*code) + codes * rng.normal()).round().clamp(0.0, 255.0) as u8;
        }
    }
}

/// Returns the path of a file in `recordings/`.
pub fn recording_path(path: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings").join(path)
}

/// Reads the project's own recording, `recordings/stereo`: 640x360, 12 frames a second, disparities of 3 to 85 px, with
/// truth.
///
/// # Errors
/// Fails if it is missing.
pub fn load_bundled() -> Outcome<Sequence> {
    const PERIOD_NS: u64 = 83_333_333;
    let folder = recording_path("stereo");
    let frames = list_files(&folder.join("image_2"))?.into_iter().enumerate().map(|(index, name)| {
        let truth = read_disparity(&folder.join("disp").join(&name))?;
        Ok(Frame {
            time_ns: index as u64 * PERIOD_NS,
            left: read_color(&folder.join("image_2").join(&name))?,
            right: read_color(&folder.join("image_3").join(&name))?,
            truth: Some(truth),
        })
    });
    let rig = StereoRig { focal_px: 640.0, baseline_m: 0.06, doffs_px: 0.0, metric: true };
    Ok(Sequence { name: "portrait", rig, disparities: 96, frames: frames.collect::<Outcome<_>>()? })
}

/// Reads 20 pairs of KITTI from a driving car, at 10 Hz, if they are there.
///
/// # Errors
/// Fails if a picture is unreadable.
pub fn load_kitti(data: &Path) -> Outcome<Option<Sequence>> {
    const PERIOD_NS: u64 = 100_000_000;
    let folder = data.join("stereo_seq/KITTI_sequence_1");
    if !folder.is_dir() {
        return Ok(None);
    }
    let names = list_files(&folder.join("image_l"))?;
    let frames = names.into_iter().enumerate().map(|(index, name)| {
        let camera = |camera: &str| read_color(&folder.join(camera).join(&name));
        Ok(Frame {
            time_ns: index as u64 * PERIOD_NS,
            left: camera("image_l")?,
            right: camera("image_r")?,
            truth: None,
        })
    });
    let rig = StereoRig { focal_px: 707.0912, baseline_m: 0.5372, doffs_px: 0.0, metric: true };
    Ok(Some(Sequence { name: "kitti", rig, disparities: 128, frames: frames.collect::<Outcome<_>>()? }))
}

/// Reads 6 pairs of EuRoC, at 20 Hz, almost static, rectified by their calibration, if they are there.
///
/// # Errors
/// Fails if a picture or the calibration is unreadable.
pub fn load_euroc(data: &Path) -> Outcome<Option<Sequence>> {
    const PERIOD_NS: u64 = 50_000_000;
    let folder = data.join("stereo_seq/MicroEurocDataset/mav0");
    if !folder.is_dir() {
        return Ok(None);
    }
    let sensors = ["cam0", "cam1"].map(|camera| folder.join(camera).join("sensor.yaml"));
    let calibration = bokehcam_calibration::load_calibration(&[&sensors[0], &sensors[1]])?;
    let names = list_files(&folder.join("cam0/data"))?;
    let first = names.first().ok_or_else(|| format!("{}: no pictures", folder.display()))?;
    let rectifier = Rectifier::new(&calibration, read_color(&folder.join("cam0/data").join(first))?.size())?;
    let frames = names.iter().enumerate().map(|(index, name)| {
        let [left, right] = [0, 1].map(|camera: usize| {
            let mut rectified = ColorImage::default();
            let taken = read_color(&folder.join(["cam0/data", "cam1/data"][camera]).join(name))?;
            rectifier.maps()[camera].remap_color(&taken, &mut rectified);
            Outcome::Ok(rectified)
        });
        Ok(Frame { time_ns: index as u64 * PERIOD_NS, left: left?, right: right?, truth: None })
    });
    let frames = frames.collect::<Outcome<_>>()?;
    Ok(Some(Sequence { name: "euroc", rig: rectifier.rig(), disparities: 96, frames }))
}

/// Reads a disparity map from a PFM file: values that are not finite are unknown, and become 0.
///
/// # Errors
/// Fails if the file is missing or not a little-endian PFM of one channel.
pub fn read_pfm(path: &Path) -> Outcome<DisparityMap> {
    let wrong = || format!("{}: not a little-endian PFM of one channel", path.display());
    let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let header: Vec<_> = bytes.splitn(4, |&byte| byte == b'\n').collect();
    let [b"Pf", size, scale, data] = header[..] else { return Err(wrong().into()) };
    let sides: Vec<u32> =
        std::str::from_utf8(size)?.split_whitespace().map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
    let [width, height] = sides[..] else { return Err(wrong().into()) };
    if !scale.starts_with(b"-") || data.len() != 4 * width as usize * height as usize || data.is_empty() {
        return Err(wrong().into());
    }
    // PFM stores the bottom row first.
    let rows = data.chunks_exact(4 * width as usize).rev();
    let values = rows.flat_map(|row| row.as_chunks::<4>().0).map(|&bytes| f32::from_le_bytes(bytes));
    let px = values.map(|px| if px.is_finite() { px.max(0.0) } else { 0.0 }).collect();
    Ok(DisparityMap { width, height, px })
}

fn read_color(path: &Path) -> Outcome<ColorImage> {
    sheet::read_png(path).ok_or_else(|| format!("{}: no picture that can be read", path.display()).into())
}

/// Reads a disparity map of 16-bit grey, pixels times 256.
fn read_disparity(path: &Path) -> Outcome<Plane<f32>> {
    let map = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?.into_luma16();
    let (width, height) = (map.width() as usize, map.height() as usize);
    Ok(Plane { width, height, data: map.iter().map(|&units| f32::from(units) / 256.0).collect() })
}

/// Returns the names of the files in a folder, sorted.
fn list_files(folder: &Path) -> Outcome<Vec<String>> {
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut names = entries
        .map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()))
        .collect::<Result<Vec<_>, std::io::Error>>()?;
    names.sort();
    Ok(names)
}
