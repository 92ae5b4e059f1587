//! What a video file contains, by ffprobe.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use serde::Deserialize;

use super::VideoError;
use super::command::{FFPROBE, INPUT_OPTIONS, base_command, file_url, find_unlisted_format};
use super::encryption::is_encrypted;
use bokehcam::color::YcbcrMatrix;
use bokehcam_files::input;
use bokehcam_files::process::Process;

/// Maximum size of ffprobe's answer, which has a few hundred bytes.
const MAX_ANSWER_BYTES: u64 = 1 << 16;

/// Period of a video that states no rate: 30 frames per second.
const DEFAULT_PERIOD_NS: u64 = 33_333_333;

/// A video file, and the properties of its first video stream.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VideoFile {
    /// The file.
    pub path: PathBuf,
    /// Width and height as displayed: rotated, with square pixels.
    pub size_px: (u32, u32),
    /// Mean time between frames, > 0.
    pub period_ns: u64,
    /// Number of frames, if the file states it.
    pub frames: Option<u64>,
    /// Length in seconds, if the file states it.
    pub length_s: Option<f64>,
    /// Number of its track in the file.
    pub track: u32,
    /// Time of the first picture in the file's own time, in seconds.
    pub first_s: f64,
    /// The same after the file's own start.
    pub offset_s: f64,
    /// Whether it is a transport stream of MPEG, in which ffmpeg cannot seek to a picture.
    pub is_transport_stream: bool,
    /// The matrix to assume for Y'CbCr, where the file states none.
    pub assumed_matrix: Option<YcbcrMatrix>,
    /// Whether its pictures may be transparent.
    pub has_alpha: bool,
    /// Whether its pictures are grey of 16 bits, as those of depth cameras are.
    pub is_16bit_grey: bool,
    /// The decoder that reads their alpha, where the usual one does not.
    pub alpha_decoder: Option<&'static str>,
    /// Whether there is sound.
    pub has_sound: bool,
    /// Whether there are subtitles.
    pub has_subtitles: bool,
    /// Whether it has a title, a date, a place or the like.
    pub has_tags: bool,
    /// What was chosen about it, or is not shown as it should be, a line each.
    pub remarks: Vec<String>,
}

#[derive(Deserialize)]
struct Answer {
    #[serde(default)]
    streams: Vec<Stream>,
    #[serde(default)]
    format: Container,
}

#[derive(Default, Deserialize)]
struct Container {
    format_name: Option<String>,
    #[serde(default)]
    tags: BTreeMap<String, String>,
    #[serde(flatten)]
    times: Times,
}

#[derive(Deserialize)]
struct Stream {
    index: u32,
    codec_type: Option<String>,
    codec_name: Option<String>,
    pix_fmt: Option<String>,
    field_order: Option<String>,
    time_base: Option<String>,
    start_pts: Option<i64>,
    width: Option<u32>,
    height: Option<u32>,
    sample_aspect_ratio: Option<String>,
    color_space: Option<String>,
    color_transfer: Option<String>,
    color_primaries: Option<String>,
    avg_frame_rate: Option<String>,
    r_frame_rate: Option<String>,
    nb_frames: Option<String>,
    #[serde(flatten)]
    times: Times,
    #[serde(default)]
    side_data_list: Vec<SideData>,
    disposition: Disposition,
    #[serde(default)]
    tags: BTreeMap<String, String>,
}

#[derive(Default, Deserialize)]
struct Times {
    start_time: Option<String>,
    duration: Option<String>,
}

#[derive(Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

#[derive(Deserialize)]
struct Disposition {
    #[serde(default)]
    default: u8,
    attached_pic: u8,
}

impl VideoFile {
    /// Reads the properties of a file.
    ///
    /// # Errors
    /// The file is not a regular one, empty, encrypted, unreadable, or has no video; ffprobe is missing.
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let mut file = input::open(path).map_err(VideoError::io(path))?;
        if file.metadata().map_err(VideoError::io(path))?.len() == 0 {
            return Err(VideoError::Empty { path: path.to_owned() });
        }
        if is_encrypted(&mut file).map_err(VideoError::io(path))? {
            return Err(VideoError::Encrypted { path: path.to_owned() });
        }
        let answer = ask(&mut probe_command(path), path)?;
        let is_video = |stream: &&Stream| is_kind(stream, "video") && stream.disposition.attached_pic == 0;
        let videos: Vec<&Stream> = answer.streams.iter().filter(is_video).collect();
        let video = videos.iter().find(|video| video.disposition.default != 0).or(videos.first()).copied();
        let size =
            video.and_then(|video| video.width.zip(video.height)).filter(|&(width, height)| width.min(height) > 0);
        let (Some(video), Some(size)) = (video, size) else {
            return Err(VideoError::NoVideo { path: path.to_owned() });
        };
        let has = |kind: &str| answer.streams.iter().any(|stream| is_kind(stream, kind));
        let rate = [&video.avg_frame_rate, &video.r_frame_rate].into_iter().find_map(|rate| parse_ratio(rate, '/'));
        Ok(Self {
            path: path.to_owned(),
            size_px: video.displayed_size(size),
            period_ns: rate.map_or(DEFAULT_PERIOD_NS, |rate| ((1e9 / rate) as u64).max(1)),
            frames: video.nb_frames.as_ref().and_then(|frames| frames.parse().ok()).filter(|&frames| frames > 0),
            length_s: [&video.times, &answer.format.times].into_iter().find_map(|times| parse_seconds(&times.duration)),
            track: video.index,
            first_s: video.first_s(),
            offset_s: video.first_s() - parse_seconds(&answer.format.times.start_time).unwrap_or(0.0),
            is_transport_stream: answer.format.format_name.as_deref() == Some("mpegts"),
            assumed_matrix: video.color_space.is_none().then(|| YcbcrMatrix::for_height(size.1)),
            has_alpha: video.has_alpha(),
            is_16bit_grey: video.pix_fmt.as_deref().is_some_and(|format| format.starts_with("gray16")),
            alpha_decoder: video.alpha_decoder(),
            has_sound: has("audio"),
            has_subtitles: has("subtitle"),
            has_tags: !answer.format.tags.is_empty(),
            remarks: video.remarks(videos.len()),
        })
    }

    /// Returns the number of frames from `start_s` to `end_s`, in seconds after the first frame: as the file states it,
    /// else an upper bound by its length.
    pub fn count_frames(&self, start_s: f64, end_s: Option<f64>) -> Option<u64> {
        let period_s = self.period_ns as f64 / 1e9;
        let length_s = self.frames.map(|frames| frames as f64 * period_s).or(self.length_s);
        let end_s = [length_s, end_s].into_iter().flatten().reduce(f64::min)?;
        match self.frames.filter(|_| start_s == 0.0) {
            Some(frames) if length_s == Some(end_s) => Some(frames),
            _ => Some(((end_s - start_s).max(0.0) / period_s).ceil() as u64),
        }
    }
}

impl Stream {
    /// Returns the time of the first picture in seconds: to the tick, as ffprobe rounds seconds.
    fn first_s(&self) -> f64 {
        let exact = self.start_pts.zip(parse_tick(&self.time_base));
        exact.map_or_else(
            || parse_seconds(&self.times.start_time).unwrap_or(0.0),
            |(ticks, tick_s)| ticks as f64 * tick_s,
        )
    }

    /// Returns whether the pixel format has an alpha channel, or a palette, of which one colour may be transparent.
    fn has_alpha(&self) -> bool {
        const NAMES: [&str; 10] = ["yuva", "rgba", "bgra", "argb", "abgr", "gbrap", "ayuv", "pal8", "ya8", "ya16"];
        let is_stated = |name: &str| NAMES.iter().any(|alpha| name.contains(alpha));
        self.pix_fmt.as_deref().is_some_and(is_stated) || self.alpha_decoder().is_some()
    }

    /// Returns the decoder of a VP8 or VP9 with alpha, which is a second stream in it that ffmpeg's own decoders leave out.
    fn alpha_decoder(&self) -> Option<&'static str> {
        let has_mode = self.tags.iter().any(|(name, mode)| name.eq_ignore_ascii_case("alpha_mode") && mode == "1");
        match self.codec_name.as_deref().filter(|_| has_mode) {
            Some("vp8") => Some("libvpx"),
            Some("vp9") => Some("libvpx-vp9"),
            _ => None,
        }
    }

    /// Returns what is to be said of it, as one of several tracks of pictures.
    fn remarks(&self, tracks: usize) -> Vec<String> {
        let by = if self.disposition.default != 0 { "the one marked as default" } else { "the first" };
        let choice = (tracks > 1).then(|| format!("has {tracks} tracks of pictures, of which {by} is played"));
        let curve = self.color_transfer.as_deref().filter(|curve| matches!(*curve, "smpte2084" | "arib-std-b67"));
        let curve = curve.map(|curve| format!("high dynamic range ({curve}) is shown without tone mapping"));
        let is_wide = |name: &&str| matches!(*name, "smpte431" | "smpte432" | "bt2020");
        let primaries = self.color_primaries.as_deref().filter(is_wide).filter(|_| curve.is_none());
        let primaries =
            primaries.map(|name| format!("colours of {name} are shown as those of BT.709, so a little paler"));
        let is_interlaced = matches!(self.field_order.as_deref(), Some("tt" | "bb" | "tb" | "bt"));
        let fields = is_interlaced.then(|| {
            "interlaced pictures are shown as they are; deinterlace them before: ffmpeg -i IN -vf yadif OUT".to_owned()
        });
        [choice, curve, primaries, fields].into_iter().flatten().collect()
    }

    /// Returns the size of a stream of `width` x `height` stored pixels on a screen.
    fn displayed_size(&self, (width, height): (u32, u32)) -> (u32, u32) {
        let aspect = parse_ratio(&self.sample_aspect_ratio, ':').unwrap_or(1.0);
        let wide = (f64::from(width) * aspect).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        let rotation = self.side_data_list.iter().find_map(|data| data.rotation).unwrap_or(0.0);
        if (rotation / 90.0).round() % 2.0 == 0.0 { (wide, height) } else { (height, wide) }
    }
}

fn is_kind(stream: &Stream, kind: &str) -> bool {
    stream.codec_type.as_deref() == Some(kind)
}

fn probe_command(path: &Path) -> Command {
    let mut command = base_command(FFPROBE);
    command
        .args(INPUT_OPTIONS)
        .args(["-of", "json", "-show_entries"])
        .arg(
            "stream=index,codec_type,codec_name,pix_fmt,field_order,time_base,start_pts,width,height,sample_aspect_ratio,color_space,\
             color_transfer,color_primaries,avg_frame_rate,r_frame_rate,nb_frames,start_time,duration:\
             stream_disposition=default,attached_pic:stream_tags=alpha_mode:stream_side_data=rotation:format=format_name,start_time,duration:\
             format_tags=title,artist,date,creation_time,location,comment,description",
        )
        .arg(file_url(path))
        .stdout(Stdio::piped());
    command
}

/// Runs ffprobe on the file at `path`.
fn ask(command: &mut Command, path: &Path) -> Result<Answer, VideoError> {
    let mut process = Process::start(command, &Arc::default()).map_err(VideoError::start(path))?;
    let stdout = process.stdout();
    let ended = process.wait().map_err(VideoError::io(path))?;
    let what = ended.stderr.rsplit(" | ").next().unwrap_or_default();
    let what = what.strip_prefix(&*file_url(path).to_string_lossy()).unwrap_or(what).trim_start_matches([':', ' ']);
    let unreadable = |what: &str| VideoError::Unreadable { path: path.to_owned(), what: what.to_owned() };
    match ended.status {
        None => return Err(VideoError::Hung { path: path.to_owned() }),
        Some(status) if !status.success() => {
            return Err(match find_unlisted_format(&ended.stderr) {
                Some(format) => VideoError::Unlisted { path: path.to_owned(), format: format.to_owned() },
                None => unreadable(what),
            });
        }
        Some(_) => {}
    }
    // The answer fits into the pipe, so that ffprobe could end before it is read.
    let mut text = String::new();
    stdout
        .ok_or_else(|| ErrorKind::BrokenPipe.into())
        .and_then(|stdout| stdout.take(MAX_ANSWER_BYTES).read_to_string(&mut text))
        .map_err(VideoError::io(path))?;
    serde_json::from_str(&text).map_err(|error| unreadable(&format!("ffprobe's answer: {error}")))
}

/// Parses a positive ratio such as `30000/1001` or `4:3`.
fn parse_ratio(text: &Option<String>, separator: char) -> Option<f64> {
    let (above, below) = text.as_ref()?.split_once(separator)?;
    let ratio = above.parse::<f64>().ok()? / below.parse::<f64>().ok()?;
    (1e-3..=1e6).contains(&ratio).then_some(ratio)
}

/// Parses a time base such as `1/90000`, however small, to seconds.
fn parse_tick(text: &Option<String>) -> Option<f64> {
    let (above, below) = text.as_ref()?.split_once('/')?;
    let tick_s = above.parse::<u32>().ok().map(f64::from)? / below.parse::<u32>().ok().map(f64::from)?;
    (tick_s > 0.0 && tick_s.is_finite()).then_some(tick_s)
}

fn parse_seconds(text: &Option<String>) -> Option<f64> {
    text.as_ref()?.parse().ok().filter(|seconds: &f64| seconds.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_positive_numbers_or_none() {
        let ratio = |text: &str| parse_ratio(&Some(text.to_owned()), '/');
        assert_eq!([ratio("25/1"), ratio("1/2"), ratio("3/4")], [Some(25.0), Some(0.5), Some(0.75)]);
        for text in ["0/0", "1/0", "0/1", "-25/1", "25", "a/b", "", "1/1e-30", "NaN/1"] {
            assert_eq!(ratio(text), None, "{text}");
        }
        assert_eq!(parse_ratio(&None, '/'), None);
    }

    #[test]
    fn a_stream_is_as_large_as_it_is_shown() {
        let stream = |json: &str| serde_json::from_str::<Stream>(json).unwrap().displayed_size((720, 576));
        let disposition = r#""index":0,"disposition":{"attached_pic":0}"#;
        for (entries, expected) in [
            ("", (720, 576)),
            (r#""sample_aspect_ratio":"64:45","#, (1024, 576)),
            (r#""sample_aspect_ratio":"0:1","#, (720, 576)),
            (r#""side_data_list":[{},{"rotation":-90}],"#, (576, 720)),
            (r#""side_data_list":[{"rotation":180}],"#, (720, 576)),
            (r#""sample_aspect_ratio":"2:1","side_data_list":[{"rotation":270}],"#, (576, 1440)),
        ] {
            assert_eq!(stream(&format!("{{{entries}{disposition}}}")), expected, "{entries}");
        }
    }

    #[test]
    fn a_part_has_at_most_its_share_of_the_frames() {
        let file = VideoFile { period_ns: 40_000_000, frames: Some(50), ..VideoFile::default() };
        let parts = [(0.0, None), (0.0, Some(9.0)), (0.0, Some(1.0)), (1.5, None), (1.5, Some(1.7)), (9.0, None)];
        assert_eq!(parts.map(|(start, end)| file.count_frames(start, end)), [50, 50, 25, 13, 5, 0].map(Some));
        let unstated = VideoFile { frames: None, length_s: Some(1.99), ..file.clone() };
        assert_eq!(unstated.count_frames(0.0, None), Some(50));
        let endless = VideoFile { frames: None, ..file };
        assert_eq!((endless.count_frames(1.0, None), endless.count_frames(0.0, Some(0.2))), (None, Some(5)));
    }
}
