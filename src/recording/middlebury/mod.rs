//! The layout of the Middlebury and ETH3D two-view stereo sets: one pair, `im0.png` and `im1.png`, as a recording of
//! one frame. `calib.txt` has the geometry, with which `disp0.pfm` becomes depth.

pub(super) mod calib;

use std::path::Path;

use super::contents::{Contents, DepthForm, Folder, Layout, Listed, Source};
use super::decode;
use super::error::RecordingError;
use super::geometry::Geometry;
use super::{Options, Pair, Unpaired};
use crate::optics::StereoRig;

pub(super) const LAYOUT: Layout = Layout {
    name: "Middlebury stereo",
    looked_for: "im0.png and im1.png",
    is_in: |dir| find_pair(dir).is_some(),
    open,
};

/// Left and right picture; the second pair of names is that of the sets of 2001 and 2003.
const PICTURE_PAIRS: [[&str; 2]; 2] = [["im0.png", "im1.png"], ["im2.png", "im6.png"]];

const CALIBRATION: &str = "calib.txt";

/// Disparities of the left picture, in order of preference.
const DISPARITIES: [&str; 2] = ["disp0.pfm", "disp0GT.pfm"];

fn find_pair(dir: &Path) -> Option<[Source; 2]> {
    let pair = PICTURE_PAIRS.iter().find(|pair| pair.iter().all(|picture| dir.join(picture).exists()))?;
    Some(pair.map(|picture| Source::found(picture.into())))
}

/// Creates a recording of one frame: the pair, with depth if there are a calibration and a disparity map.
fn open(folder: &Folder, _: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let [color, right] = find_pair(dir).unwrap_or(PICTURE_PAIRS[0].map(|picture| Source::found(picture.into())));
    let file = dir.join(CALIBRATION);
    let rig = match file.exists() {
        true => Some(read_rig(folder, &color, &file)?),
        false => None,
    };
    let depth = DISPARITIES.iter().find(|name| dir.join(name).exists()).zip(rig.map(|(rig, _)| rig));
    let (depth, form) = depth.map(|(name, rig)| (Source::found(name.into()), DepthForm::Disparity(rig))).unzip();
    Ok(Contents {
        frames: vec![Listed { time_ns: Some(0), color, right: Some(right), depth }],
        depth: form,
        pair: Some(rig.map_or(Pair::Unstated, |(rig, _)| Pair::Rectified(rig))),
        disparities: rig.and_then(|(_, disparities)| disparities),
        unpaired: Unpaired::default(),
    })
}

/// Reads the rig and the number of disparities from the calibration `file`, scaled to the size of the picture `color`.
fn read_rig(folder: &Folder, color: &Source, file: &Path) -> Result<(StereoRig, Option<u32>), RecordingError> {
    let stated = Geometry::read_as(file, calib::parse)?;
    let path = folder.locate(color)?;
    let (size, _) = decode::header(&path).map_err(|fault| color.error(&folder.dir, fault))?;
    let fitted = stated.fitted(file, size)?;
    if fitted != stated {
        tracing::warn!("{}: made for pictures of another size, and scaled to {}x{}", file.display(), size.0, size.1);
    }
    Ok((fitted.rig, fitted.disparities))
}
