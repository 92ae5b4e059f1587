//! The files of a recording.

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use bokehcam::frame::{ColorImage, DepthMap};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::Outcome;

/// The folder in which files are written, or compared.
pub struct Folder {
    pub root: PathBuf,
    /// Whether files are only compared.
    pub check: bool,
    /// Number of files that differ.
    pub differing: usize,
}

/// Depth or disparity units, or bytes, may differ by this much, and a thousandth of them by more: mathematical
/// functions round differently on another machine, and a ray at an edge may then fall on its other side.
const TOLERANCE: i32 = 2;

impl Folder {
    pub fn write_or_check_color(&mut self, name: &str, image: &ColorImage) -> Outcome {
        if self.check {
            let there = image::open(self.root.join(name))?.into_rgb8();
            let same_size = there.dimensions() == image.size();
            self.compare_values(
                name,
                same_size,
                there.iter().zip(&image.rgb).map(|(a, b)| i32::from(*a) - i32::from(*b)),
            );
            return Ok(());
        }
        self.write_png(name, &image.rgb, image.size(), ExtendedColorType::Rgb8)
    }

    /// Writes or compares a depth map, converted from metres by `units`.
    pub fn write_or_check_gray16(&mut self, name: &str, map: &DepthMap, units: impl Fn(f32) -> f32) -> Outcome {
        let units: Vec<u16> = map.metres.iter().map(|&z_m| units(z_m).round() as u16).collect();
        if self.check {
            let there = image::open(self.root.join(name))?.into_luma16();
            let same_size = there.dimensions() == map.size();
            self.compare_values(name, same_size, there.iter().zip(&units).map(|(a, b)| i32::from(*a) - i32::from(*b)));
            return Ok(());
        }
        let bytes: Vec<u8> = units.iter().flat_map(|unit| unit.to_ne_bytes()).collect();
        self.write_png(name, &bytes, map.size(), ExtendedColorType::L16)
    }

    pub fn write_or_check_text(&mut self, name: &str, text: &str) -> Outcome {
        let path = self.root.join(name);
        if self.check {
            if fs::read_to_string(path)? != text {
                self.report_difference(name);
            }
            return Ok(());
        }
        create_parent(&path)?;
        Ok(fs::write(path, text)?)
    }

    pub fn write_png(&self, name: &str, bytes: &[u8], size: (u32, u32), color: ExtendedColorType) -> Outcome {
        let path = self.root.join(name);
        create_parent(&path)?;
        let file = BufWriter::new(fs::File::create(&path)?);
        PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive)
            .write_image(bytes, size.0, size.1, color)?;
        eprintln!("{name}: {} kB", fs::metadata(path)?.len() / 1000);
        Ok(())
    }

    pub fn compare_values(&mut self, name: &str, same_size: bool, differences: impl Iterator<Item = i32>) {
        let (mut count, mut beyond) = (0usize, 0usize);
        for difference in differences {
            count += 1;
            beyond += usize::from(difference.abs() > TOLERANCE);
        }
        eprintln!("{name}: {beyond} of {count} values beyond {TOLERANCE}");
        if !same_size || beyond * 1000 > count {
            self.report_difference(name);
        }
    }

    fn report_difference(&mut self, name: &str) {
        eprintln!("{name} differs");
        self.differing += 1;
    }
}

fn create_parent(path: &Path) -> Outcome {
    Ok(path.parent().map_or(Ok(()), fs::create_dir_all)?)
}
