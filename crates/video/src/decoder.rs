//! Decodes the pictures of a video file in a child process.

use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use super::MAX_SIDE_PX;
use super::command::{FFMPEG, INPUT_OPTIONS, base_command, file_url, frame_timing_option};
use super::completeness::{Expected, is_cut_gif, is_loss};
use super::{VideoError, VideoFile};
use bokehcam::color::YcbcrMatrix;
use bokehcam_files::pipe_reader::{Filled, PipeReader};
use bokehcam_files::process::{Process, Watchdog};

/// Number of error messages that are kept: the first ones name the cause.
const MAX_MESSAGES: usize = 2;

/// ffmpeg states a picture's time before the picture itself, on another pipe.
const TIME_TIMEOUT: Duration = Duration::from_secs(2);

/// The form of decoded pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// Width and height of every picture.
    pub size_px: (u32, u32),
    /// Its samples.
    pub pixels: Pixels,
    /// Frames per second, by repeating and leaving out; `None` keeps every frame at its own time.
    pub fps: Option<f64>,
    /// Start at the first frame at or after this time, in seconds after the first frame.
    pub start_s: f64,
}

/// The samples of a decoded picture, row by row without padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// Three bytes per pixel: R, G, B; full range.
    Rgb24,
    /// Two bytes per pixel, little-endian: luma; full range.
    Grey16,
}

impl Pixels {
    fn name(self) -> &'static str {
        match self {
            Self::Rgb24 => "rgb24",
            Self::Grey16 => "gray16le",
        }
    }

    /// Returns the number of bytes per pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Rgb24 => 3,
            Self::Grey16 => 2,
        }
    }
}

/// Result of [`Decoder::read`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoded {
    /// A picture, with its time in nanoseconds after the first frame of the file; `None` if the file states none.
    Picture(Option<i64>),
    /// No whole picture yet; the next call continues.
    Waiting,
    /// There are no more pictures.
    End,
}

/// A running ffmpeg. Dropping it kills the process.
pub struct Decoder {
    process: Process,
    watchdog: Watchdog,
    pictures: PipeReader,
    /// The times of pictures on their way, in the file's own time.
    times_ns: Receiver<Option<i64>>,
    /// Time of the file's first frame in that, in nanoseconds.
    first_ns: i64,
    path: PathBuf,
    /// Bytes of the picture that have arrived.
    filled: usize,
    /// Since when nothing has arrived.
    idle_since: Option<Instant>,
    frames: u64,
    /// Time of the last picture in the file, in nanoseconds.
    last_ns: Option<i64>,
    /// Whether ffmpeg has said that something is lost.
    has_loss: Arc<AtomicBool>,
    expected: Expected,
    remark: Option<String>,
}

impl Decoder {
    /// Starts ffmpeg, found through `PATH`, on a file.
    ///
    /// # Errors
    /// The pictures are larger than supported, or ffmpeg is missing or cannot be started.
    pub fn start(file: &VideoFile, conversion: &Conversion) -> Result<Self, VideoError> {
        let (path, (width, height)) = (&file.path, conversion.size_px);
        if width.max(height) > MAX_SIDE_PX {
            return Err(VideoError::TooLarge { path: path.clone(), width, height });
        }
        let (to_times, times_ns) = mpsc::channel();
        let mut messages = 0;
        let has_loss = Arc::new(AtomicBool::new(false));
        let lost = Arc::clone(&has_loss);
        let log = move |line: &str| {
            if is_loss(line) {
                lost.store(true, Ordering::Relaxed);
            }
            if let Some(time_ns) = parse_time(line) {
                // The decoder may have been dropped.
                let _ = to_times.send(time_ns);
            }
            let message = parse_message(line).filter(|_| messages < MAX_MESSAGES)?;
            messages += 1;
            Some(message.to_owned())
        };
        let mut command = decode_command(file, conversion);
        let mut process =
            Process::start_logging(&mut command, &Arc::default(), log).map_err(VideoError::start(path))?;
        let stdout = process.stdout().ok_or_else(|| VideoError::io(path)(ErrorKind::BrokenPipe.into()))?;
        Ok(Self {
            watchdog: process.watchdog(),
            process,
            pictures: PipeReader::from_owned(OwnedFd::from(stdout)),
            times_ns,
            first_ns: (file.first_s * 1e9).round() as i64,
            path: path.clone(),
            filled: 0,
            idle_since: None,
            frames: 0,
            last_ns: None,
            has_loss,
            expected: Expected::of(file, conversion.start_s == 0.0 && conversion.fps.is_none()),
            remark: None,
        })
    }

    /// Reads the next picture into `picture`, which has its size and stays the same until it is whole. Waits up to
    /// `patience` for each part of it.
    ///
    /// # Errors
    /// The file is damaged or truncated, which is known only at its end; ffmpeg failed or hung.
    pub fn read(&mut self, picture: &mut [u8], patience: Duration) -> Result<Decoded, VideoError> {
        let before = self.filled;
        let filled = self.pictures.fill(picture, &mut self.filled, patience).map_err(VideoError::io(&self.path))?;
        if self.filled > before {
            self.idle_since = None;
        }
        match filled {
            Filled::Waiting => {
                let idle_since = *self.idle_since.get_or_insert_with(Instant::now);
                match self.watchdog.is_hung(idle_since.elapsed()) {
                    true => Err(VideoError::Hung { path: self.path.clone() }),
                    false => Ok(Decoded::Waiting),
                }
            }
            Filled::End => self.finish().map(|()| Decoded::End),
            Filled::Whole => {
                (self.filled, self.frames) = (0, self.frames + 1);
                let time_ns = self.times_ns.recv_timeout(TIME_TIMEOUT).ok().flatten();
                let time_ns = time_ns.map(|time_ns| time_ns.saturating_sub(self.first_ns));
                self.last_ns = time_ns;
                Ok(Decoded::Picture(time_ns))
            }
        }
    }

    /// Takes what ffmpeg called an error, though nothing is missing: for a warning after the end.
    pub fn take_remark(&mut self) -> Option<String> {
        let (remark, path) = (self.remark.take()?, self.path.display());
        Some(format!("{path}: ffmpeg says \"{remark}\", but all of its {} pictures are there", self.frames))
    }

    /// Waits for the end of ffmpeg, which has closed its output, and checks that the file was whole.
    fn finish(&mut self) -> Result<(), VideoError> {
        let ended = self.process.wait().map_err(VideoError::io(&self.path))?;
        let Some(status) = ended.status else { return Err(VideoError::Hung { path: self.path.clone() }) };
        // Standard error is closed by now, so that all losses are known.
        let is_whole = status.success()
            && self.filled == 0
            && !self.has_loss.load(Ordering::Relaxed)
            && self.expected.is_reached(self.frames, self.last_ns);
        let what = match ended.stderr {
            messages if !messages.is_empty() && is_whole => {
                self.remark = Some(messages);
                return Ok(());
            }
            messages if !messages.is_empty() => messages,
            _ if !status.success() => format!("ffmpeg ended with {status}"),
            _ if self.filled > 0 => "the last picture is incomplete".to_owned(),
            _ if is_cut_gif(&self.path) => "the end is missing".to_owned(),
            _ => return Ok(()),
        };
        Err(VideoError::Damaged { path: self.path.clone(), frames: self.frames, what })
    }
}

/// Draws pictures over white, as transparent photos are shown.
const ON_WHITE: &str = ",format=rgba,split[front][back];[back]lutrgb=r=255:g=255:b=255:a=255[white];\
                        [white][front]overlay=format=rgb,";

/// Builds the command that writes the pictures of `file` to standard output, and their times to standard error.
fn decode_command(file: &VideoFile, conversion: &Conversion) -> Command {
    let Conversion { size_px: (width, height), pixels, fps, start_s } = *conversion;
    let fps = fps.map_or(String::new(), |fps| format!("fps={fps},"));
    // Otherwise BT.601 is assumed for every size.
    let matrix = if file.assumed_matrix == Some(YcbcrMatrix::Bt709) { ":in_color_matrix=bt709" } else { "" };
    let seeks = start_s > 0.0 && !file.is_transport_stream;
    let begin = match start_s > 0.0 && !seeks {
        true => format!("trim=start={:.9},", file.first_s + start_s),
        false => String::new(),
    };
    let flags = format!("flags=bicubic+accurate_rnd+full_chroma_int+bitexact{matrix}");
    // The conversion to R'G'B' that drawing needs has the same matrix.
    let background = match file.has_alpha && pixels == Pixels::Rgb24 {
        true => format!("scale={flags}{ON_WHITE}"),
        false => String::new(),
    };
    let filters = format!(
        "{begin}{fps}{background}scale={width}:{height}:{flags},format={},settb=1/1000000000,showinfo=checksum=0",
        pixels.name()
    );
    let mut command = base_command(FFMPEG);
    command
        // The times are messages of level `info`.
        .args(["-nostdin", "-nostats", "-loglevel", "repeat+level+info"])
        .args(INPUT_OPTIONS)
        .args(["-max_pixels", &(u64::from(MAX_SIDE_PX) * u64::from(MAX_SIDE_PX)).to_string()]);
    if seeks {
        command.args(["-ss", &format!("{:.6}", start_s + file.offset_s)]);
    }
    command.args(file.alpha_decoder.iter().flat_map(|decoder| ["-c:v", decoder]));
    command
        // Times stay those of the file: otherwise ffmpeg counts from the first picture or sound that it uses, or from the
        // start of the file, as the format has it.
        .args(["-copyts", "-i"])
        .arg(file_url(&file.path))
        .args([
            "-map",
            &format!("0:{}", file.track),
            "-vf",
            &filters,
            frame_timing_option(),
            "passthrough",
            "-f",
            "rawvideo",
            "pipe:1",
        ])
        .stdout(Stdio::piped());
    command
}

/// Parses the line of the filter `showinfo` about a picture, such as `[Parsed_showinfo_3 @ 0x55] [info] n:   1
/// pts:40000000 pts_time:0.04 ...`; an unknown time is `NOPTS`.
fn parse_time(line: &str) -> Option<Option<i64>> {
    let line = line.strip_prefix("[Parsed_showinfo")?;
    let (_, time) = line.split_once(" n:")?.1.split_once(" pts:")?;
    Some(time.split_whitespace().next()?.parse().ok())
}

/// Returns the text of an error message, such as `[h264 @ 0x55] [error] no frame!`.
fn parse_message(line: &str) -> Option<&str> {
    ["[error] ", "[fatal] ", "[panic] "].iter().find_map(|level| {
        let (context, message) = line.split_once(level)?;
        (context.is_empty() || context.starts_with('[') && context.trim_end().ends_with(']')).then_some(message)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_errors_are_told_from_other_lines() {
        let head = "[Parsed_showinfo_3 @ 0x55d7cba31ec0] [info]";
        let time = |line: &str| parse_time(&format!("{head} {line}"));
        assert_eq!(time("n:   1 pts:40000000 pts_time:0.04    pos:     9746 fmt:rgb24"), Some(Some(40_000_000)));
        assert_eq!(time("n:1000 pts:     -7 pts_time:-7e-09"), Some(Some(-7)));
        assert_eq!(time("n:   0 pts:NOPTS pts_time:NOPTS"), Some(None));
        for line in ["color_range:pc color_space:gbr", "config in time_base: 1/1000000000, frame_rate: 25/1", ""] {
            assert_eq!(time(line), None, "{line}");
        }
        assert_eq!(parse_time("[info]     title : n: 1 pts: 3"), None);

        assert_eq!(parse_message("[h264 @ 0x5581] [error] no frame!"), Some("no frame!"));
        assert_eq!(parse_message("[error] a.mp4: Invalid data"), Some("a.mp4: Invalid data"));
        for line in ["[info]     title : [error] none", "Press [q]", "[h264 @ 0x5581] [warning] odd"] {
            assert_eq!(parse_message(line), None, "{line}");
        }
    }
}
