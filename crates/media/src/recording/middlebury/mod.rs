//! The layout of the Middlebury and ETH3D two-view stereo sets: one pair, `im0.png` and `im1.png`, as a recording of
//! one frame. `calib.txt` has the geometry, with which `disp0.pfm` becomes depth.

pub(super) mod calib;

use std::path::Path;

use super::contents::{Contents, DepthFormat, Layout, ListedFrame, PictureSource, RecordingFolder};
use super::decode;
use super::error::{RecordingError, Result};
use super::geometry::Geometry;
use super::{Options, StereoGeometry};
use bokehcam::optics::StereoRig;

pub(super) const LAYOUT: Layout = Layout {
    name: "Middlebury stereo",
    expected_files: "im0.png and im1.png",
    matches: |dir| find_pair(dir).is_some() || find_half(dir).is_some(),
    open,
};

/// Left and right picture; the second pair of names is that of the sets of 2001 and 2003.
const PICTURE_PAIRS: [[&str; 2]; 2] = [["im0.png", "im1.png"], ["im2.png", "im6.png"]];

const CALIBRATION: &str = "calib.txt";

/// Disparities of the left picture, in order of preference.
const DISPARITIES: [&str; 2] = ["disp0.pfm", "disp0GT.pfm"];

fn find_pair(dir: &Path) -> Option<[PictureSource; 2]> {
    let pair = PICTURE_PAIRS.iter().find(|pair| pair.iter().all(|picture| dir.join(picture).exists()))?;
    Some(pair.map(|picture| PictureSource::from_path(picture.into())))
}

/// Returns the missing and the existing picture of an incomplete pair with its calibration or disparities.
fn find_half(dir: &Path) -> Option<[&'static str; 2]> {
    let has = |name: &str| dir.join(name).exists();
    let [left, right] = PICTURE_PAIRS[0];
    let half = [[left, right], [right, left]].into_iter().find(|[missing, present]| !has(missing) && has(present));
    half.filter(|_| has(CALIBRATION) || DISPARITIES.iter().any(|name| has(name)))
}

/// Creates a recording of one frame: the pair, with depth if there are a calibration and a disparity map.
fn open(folder: &RecordingFolder, _: &Options) -> Result<Contents> {
    let dir = &folder.dir;
    if let Some([missing, present]) = find_half(dir).filter(|_| find_pair(dir).is_none()) {
        return Err(RecordingError::MissingEye { dir: dir.clone(), missing, present });
    }
    let [color, right] =
        find_pair(dir).unwrap_or(PICTURE_PAIRS[0].map(|picture| PictureSource::from_path(picture.into())));
    let file = dir.join(CALIBRATION);
    let rig = match file.exists() {
        true => Some(read_rig(folder, &color, &file)?),
        false => None,
    };
    let depth = DISPARITIES.iter().find(|name| dir.join(name).exists()).zip(rig.map(|(rig, _)| rig));
    let (depth, form) =
        depth.map(|(name, rig)| (PictureSource::from_path(name.into()), DepthFormat::Disparity(rig))).unzip();
    Ok(Contents {
        frames: vec![ListedFrame { time_ns: Some(0), color, right: Some(right), depth }],
        depth: form,
        stereo_geometry: Some(rig.map_or(StereoGeometry::Uncalibrated, |(rig, _)| StereoGeometry::Rectified(rig))),
        disparity_count: rig.and_then(|(_, count)| count),
        ..Contents::default()
    })
}

/// Reads the rig and the number of disparities from the calibration `file`, scaled to the size of the picture `color`.
fn read_rig(folder: &RecordingFolder, color: &PictureSource, file: &Path) -> Result<(StereoRig, Option<u32>)> {
    let stated = Geometry::read_with(file, calib::parse)?;
    let path = folder.locate(color)?;
    let (size, _) = decode::read_header(&path).map_err(|fault| color.error(&folder.dir, fault))?;
    let fitted = stated.scaled_to(file, size)?;
    if fitted != stated {
        tracing::warn!("{}: made for pictures of another size, and scaled to {}x{}", file.display(), size.0, size.1);
    }
    Ok((fitted.rig, fitted.disparity_count))
}
