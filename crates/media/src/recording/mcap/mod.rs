//! Recordings of ROS in an MCAP file (mcap.dev/spec), as rosbag2 writes them: pictures and depth maps on topics, paired
//! by the times at which they were taken.

mod cameras;
mod channels;
mod chunk;
mod definitions;
mod fields;
mod file;
mod file_writer;
mod message;
mod rvl;
mod scan;
mod topic;
mod writer;

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::contents::{Contents, DepthFormat, Layout, ListedFrame, PictureSource, RecordingFolder, warn_of_damage};
use super::decode::DepthUnits;
use super::error::RecordingError;
use super::timeline::MAX_LENGTH_NS;
use super::{Options, Unpaired, pair};
use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam_files::input;
use chunk::ChunkCache;
use file::McapFile;
use topic::{Message, Topic};
pub(super) use writer::Writer;

/// A file, or a folder of rosbag2 with one.
pub(super) const LAYOUT: Layout =
    Layout { name: "MCAP", expected_files: "a file .mcap of ROS", matches: |path| !find_files(path).is_empty(), open };

/// What rosbag2 writes beside its files.
const METADATA: &str = "metadata.yaml";

/// Units of depth pictures per metre (ROS REP 118).
const DEPTH_SCALE: f32 = 1000.0;

/// Returns the files of a recording: itself, or those in a folder of rosbag2.
fn find_files(path: &Path) -> Vec<PathBuf> {
    let is_mcap = |path: &Path| {
        let is_named = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        path.is_file() && (is_named || starts_with_magic(path))
    };
    if path.is_file() {
        return Some(path.to_owned()).filter(|path| is_mcap(path)).into_iter().collect();
    }
    if !path.join(METADATA).is_file() {
        return Vec::new();
    }
    let inside = fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = inside.filter(|path| is_mcap(path)).collect();
    files.sort();
    files
}

fn starts_with_magic(path: &Path) -> bool {
    let mut start = [0; scan::MAGIC.len()];
    input::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == scan::MAGIC
}

/// Returns the only file of a recording.
fn find_file(path: &Path) -> Result<PathBuf, String> {
    let path = match &find_files(path)[..] {
        [path] => path.clone(),
        [first, ..] => return Err(format!("several files; give one of them, such as {}", first.display())),
        [] => path.to_owned(),
    };
    match starts_with_magic(&path) {
        true => Ok(path),
        false => Err("not an MCAP file, although its name says so; copy it again".to_owned()),
    }
}

/// Returns how depth is registered to colour, if it is of another camera, and the file says how.
fn find_calibration(found: &channels::Contents, name: &str, depth: &Topic, color: &Topic) -> Option<RgbdCalibration> {
    if depth.frame_id == color.frame_id {
        return None;
    }
    let (of_depth, of_color) = (depth.frame_id.escape_debug(), color.frame_id.escape_debug());
    let views = format!("the depth of {depth} is of another camera ({of_depth}) than the colour ({of_color})");
    let calibration = found.cameras.find_calibration(depth, color);
    match &calibration {
        Ok(_) => tracing::info!("{name}: {views}; it is registered by their camera_info and /tf_static"),
        Err(missing) => tracing::warn!(
            "{name}: {views}, and is taken as if both had the same view, because {missing}; record aligned depth, \
             or give --depth-calibration"
        ),
    }
    calibration.ok()
}

/// Opens the file, chooses its topics, and pairs their pictures.
fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let fault = |what: String| RecordingError::File { path: folder.dir.clone(), what };
    let path = find_file(&folder.dir).map_err(fault)?;
    let name = path.display().to_string();
    let file = input::open(&path).map_err(RecordingError::io("open the recording", &path))?;
    let found = scan::scan(&file, &name).map_err(RecordingError::io("read the recording", &path))?;
    let ending = || found.damage.as_ref().map_or(String::new(), |damage| format!("; {damage}"));
    let choice = topic::choose(&found.topics, &options.topics, &found.others)
        .map_err(|what| fault(format!("{what}{}", ending())))?;
    let (color, depth) = (&found.topics[choice.color], choice.depth.map(|at| &found.topics[at]));
    warn_of_damage(&name, found.damage.as_deref());
    if choice.is_guess {
        let depth = depth.map_or(String::new(), |depth| format!(", and depth from {depth}"));
        tracing::warn!("{name}: several topics have pictures: colour is taken from {color}{depth} (--topic)");
    }
    let other = found.topics.iter().find(|topic| topic.content(false) != topic.content(true));
    if let Some(other) = other.filter(|_| depth.is_none() && options.topics.is_empty()) {
        tracing::warn!("{name}: {other} is no depth by its name; --topic {other} takes it as depth");
    }
    let registered = depth.filter(|_| options.depth_calibration.is_none());
    let depth_calibration = registered.and_then(|depth| find_calibration(&found, &name, depth, color));
    options.warn_of_inverse_unit(&name, depth.is_some());
    let frames = pair_frames(&name, color, depth);
    let unpaired = Unpaired::beside(frames.len(), color.messages.len(), depth.map(|depth| depth.messages.len()));
    if frames.is_empty() {
        let depth = depth.map_or(String::new(), |depth| depth.to_string());
        return Err(fault(format!(
            "no depth map of {depth} was taken within half a frame of a picture of {color}; name other topics with \
             --topic, or use --depth none"
        )));
    }
    let listed = |&(time_ns, color_at, depth_at): &(u64, usize, Option<usize>)| ListedFrame {
        time_ns: Some(time_ns),
        color: color.source(color_at),
        right: None,
        depth: depth.zip(depth_at).map(|(depth, at)| depth.source(at)),
    };
    let listed: Vec<_> = frames.iter().map(listed).collect();
    let given = options.depth_unit.units_per_m().or(options.depth_scale);
    let invalid = options.depth_invalid.filter(|&invalid| invalid != 0);
    let units = DepthUnits { scale: given.unwrap_or(DEPTH_SCALE), invalid };
    let depth_format = depth.map(|depth| match given {
        Some(_) if !depth.has_metres() => DepthFormat::Units(units),
        _ => DepthFormat::StatedUnits(units),
    });
    let container = McapFile {
        file,
        topics: found.topics,
        chunks: found.chunks,
        chosen: [Some(choice.color), choice.depth],
        frames: frames.into_iter().map(|(_, color, depth)| (color, depth)).collect(),
        units,
        cache: ChunkCache::default(),
    };
    Ok(Contents {
        frames: listed,
        depth: depth_format,
        depth_calibration,
        unpaired,
        has_times: true,
        container: Some(Box::new(container)),
        ..Contents::default()
    })
}

/// Pictures of a topic in order: their times, and their positions in the topic.
type Timed = Vec<(u64, usize)>;

/// Returns the pictures of a topic in the order of their times, each time once.
fn in_order(topic: &Topic, has_stamps: bool) -> Timed {
    let time_ns = |message: &Message| if has_stamps { message.stamp_ns } else { message.log_ns };
    let mut timed: Timed = topic.messages.iter().map(time_ns).zip(0..).collect();
    timed.sort_unstable();
    timed.dedup_by_key(|(time_ns, _)| *time_ns);
    timed
}

/// Pairs the pictures with the depth maps that were taken within half a frame. Returns the time of each frame, and the
/// positions of its messages in their topics.
fn pair_frames(name: &str, color: &Topic, depth: Option<&Topic>) -> Vec<(u64, usize, Option<usize>)> {
    let topics = [Some(color), depth].into_iter().flatten();
    let stamps = topics.clone().flat_map(|topic| topic.messages.iter().map(|message| message.stamp_ns));
    let length_ns = stamps.clone().max().zip(stamps.min()).map_or(0, |(last, first)| last - first);
    if length_ns > MAX_LENGTH_NS {
        tracing::warn!("{name}: the times in headers span more than ten years: those of recording are used");
    }
    // Some drivers leave the times at 0, and a simulator's clock begins there.
    let mut later = topics.flat_map(|topic| topic.messages.iter().skip(1));
    let has_stamps = length_ns <= MAX_LENGTH_NS && later.all(|message| message.stamp_ns > 0);
    let colors = in_order(color, has_stamps);
    let depths = depth.map(|depth| in_order(depth, has_stamps));
    let times = |timed: &Timed| timed.iter().map(|&(time_ns, _)| time_ns).collect::<Vec<_>>();
    let pairs = pair::pair_frames(&times(&colors), depths.as_ref().map(times).as_deref());
    let frame = |(color, depth): (usize, Option<usize>)| {
        let depth = depths.as_ref().zip(depth).map(|(depths, at)| depths[at].1);
        (colors[color].0, colors[color].1, depth)
    };
    pairs.into_iter().map(frame).collect()
}

impl Topic {
    /// Names a message, for messages to users.
    fn source(&self, at: usize) -> PictureSource {
        let name = self.to_string();
        PictureSource::from_path(format!("{}, message {at}", name.trim_start_matches('/')).into())
    }
}
