//! Folders of colour pictures and depth maps without lists, paired by name or number: `color` and `depth` (ScanNet,
//! Open3D), `rgb` and `depth` with `scene_camera.json` (BOP), `results/frame000000.jpg` and `results/depth000000.png`
//! with `cam_params.json` (Replica, as NICE-SLAM renders it), `frame-000000.color.png` and `frame-000000.depth.png`
//! (7-Scenes), `left000000.png` and `depth000000.png` (ZED's export), `frame_00000.jpg` and `depth_00000.png` (3D Scanner
//! App), and `rgb.mp4` and `depth` (Stray Scanner).

mod scale;

use std::path::Path;

use super::contents::{Contents, DepthFormat, Layout, ListedFrame, PictureSource, RecordingFolder};
use super::decode::DepthUnits;
use super::error::RecordingError;
use super::folder::{Pictures, pair_by_name};
use super::{DepthUnit, Options, Unpaired, timeline};
use bokehcam_files::folder::has_file_list;
pub(super) use scale::{Scale, StatedUnits};

pub(super) const LAYOUT: Layout = Layout {
    name: "RGB-D folders",
    expected_files: "color and depth, rgb and depth, images and depths, results, or frame-000000.color.png",
    // Our own folder without its lists is an unfinished recording.
    matches: |dir| (find_pair(dir).is_some() || is_film(dir)) && !has_file_list(dir),
    open,
};

/// Names of the folder of colour pictures, in order of preference.
pub(super) const COLOR_FOLDERS: [&str; 7] = ["color", "rgb", "image", "images", "gray", "Color", "RGB"];
/// Names of the folder of depth maps: of the colour camera's view before that of another.
pub(super) const DEPTH_FOLDERS: [&str; 4] = ["aligned_depth", "depth", "depths", "Depth"];

/// Film and pictures of Stray Scanner.
const FILM: &str = "rgb.mp4";

/// Pairs of pictures that share a folder: its name, then prefix and suffix of colour and of depth.
const SHARED_FOLDERS: [(&str, [(&str, &str); 2]); 6] = [
    ("results", [("frame", ""), ("depth", "")]),
    ("", [("frame-", ".color"), ("frame-", ".depth")]),
    ("", [("left", ""), ("depth", "")]),
    ("", [("frame_", ""), ("depth_", "")]),
    ("", [("color_", ""), ("depth_", "")]),
    ("", [("rgb_", ""), ("depth_", "")]),
];

/// Returns the kinds of the colour pictures and depth maps in `dir`, if it has both.
fn find_pair(dir: &Path) -> Option<[Pictures<'static>; 2]> {
    let shared = SHARED_FOLDERS.iter().map(|(folder, kinds)| {
        kinds.map(|(prefix, suffix)| Pictures { folder: Path::new(folder), prefix, suffix, is_any: false })
    });
    let apart = COLOR_FOLDERS
        .iter()
        .flat_map(|color| DEPTH_FOLDERS.map(|depth| [color, depth].map(|folder| Pictures::all_in(Path::new(folder)))));
    apart.chain(shared).find(|pair| pair.iter().all(|kind| kind.exist_in(dir)))
}

fn is_film(dir: &Path) -> bool {
    dir.join(FILM).is_file() && DEPTH_FOLDERS.iter().any(|folder| dir.join(folder).is_dir())
}

fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let Some([color, depth]) = find_pair(dir) else { return Err(RecordingError::Film { dir: dir.clone() }) };
    let names = color.find_in(dir)?;
    let maps = depth.find_in(dir)?;
    from_pairs(dir, (color, names), (dir, depth, maps), Scale::of_folder(dir, color.folder), options)
}

/// Creates the contents from the pictures `names` in `dir` and the depth maps `maps` in `maps_dir`, which have `scale` unless
/// the options have another.
///
/// # Errors
/// Two pictures have the same number, none pairs, or the scale's file is faulty.
pub(super) fn from_pairs(
    dir: &Path,
    (color, names): (Pictures, Vec<String>),
    (maps_dir, depth, maps): (&Path, Pictures, Vec<String>),
    scale: Scale,
    options: &Options,
) -> Result<Contents, RecordingError> {
    let counts = [names.len(), maps.len()];
    let (pairs, by) = pair_by_name(dir, (color, names), (depth, maps))?;
    if pairs.is_empty() {
        let [color, depth] =
            [dir.join(color.folder), maps_dir.join(depth.folder)].map(|path| path.display().to_string());
        return Err(RecordingError::NoNumberPairs { dir: dir.to_owned(), color, depth });
    }
    let (format, unit) = depth_format(scale, options)?;
    let by = by.describe();
    let rate = timeline::describe_rate(options);
    tracing::warn!("{}: {} pairs of colour and depth by their {by}, {rate}; {unit}", dir.display(), pairs.len());
    let unpaired = Unpaired::beside(pairs.len(), counts[0], Some(counts[1]));
    if unpaired != Unpaired::default() {
        let Unpaired { color, depth, .. } = unpaired;
        tracing::warn!(
            "{}: left out: {color} pictures without depth, {depth} depth maps without picture",
            dir.display()
        );
    }
    let is_outside = maps_dir != dir;
    let frames = (0..).zip(&pairs).map(|(index, (name, map))| {
        let map = depth.folder.join(map);
        ListedFrame {
            time_ns: Some(timeline::numbered_time_ns(index, options)),
            color: PictureSource::from_path(color.folder.join(name)),
            right: None,
            depth: Some(PictureSource::from_path(if is_outside { maps_dir.join(map) } else { map })),
        }
    });
    let frames = frames.collect();
    Ok(Contents { frames, depth: Some(format), unpaired, are_photos: true, ..Contents::default() })
}

/// Returns the encoding of depth, and a sentence about its unit.
fn depth_format(scale: Scale, options: &Options) -> Result<(DepthFormat, String), RecordingError> {
    let scale_given = options.depth_unit.units_per_m().or(options.depth_scale);
    Ok(match (options.depth_unit, scale_given) {
        (DepthUnit::Inverse, _) => (DepthFormat::of_pictures(options, 1.0), "depth is relative".to_owned()),
        (_, Some(scale)) => {
            let format = DepthFormat::of_pictures(options, scale);
            (format, format!("depth has {scale} units per metre, as requested"))
        }
        (_, None) => {
            let stated = scale.read(None)?;
            // 0 is unknown anyway: it states nothing.
            let invalid = options.depth_invalid.filter(|&value| value != 0).or(stated.invalid);
            let units = DepthUnits { scale: stated.per_m, invalid };
            (DepthFormat::StatedUnits(units), format!("depth {}", stated.describe()))
        }
    })
}
