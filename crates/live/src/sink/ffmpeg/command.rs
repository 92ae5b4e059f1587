//! Command lines of ffmpeg for writing.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::sink::Sound;
use bokehcam::color::YcbcrMatrix;
use bokehcam_video::command::{FFMPEG, INPUT_OPTIONS, base_command, file_url, frame_timing_option};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Container {
    /// `.mp4` and `.mov`.
    Mp4,
    /// `.mkv` and `.webm`.
    Matroska,
}

/// Output parameters of ffmpeg, selected by the file's extension.
pub(super) struct Format {
    container: Container,
    muxer: &'static [&'static str],
    encoder: &'static [&'static str],
    /// The pixel format of opaque pictures, and of those with an alpha channel, if it keeps that.
    pixels: (&'static str, Option<&'static str>),
    /// The muxer of a copy with its index at the front, if that needs one.
    faststart: Option<&'static str>,
    /// Unit of the frames' time stamps, as a fraction of a second.
    time_base: &'static str,
}

impl Format {
    /// Selects the format. Every format is written in pieces of a second, so that a truncated file can be played.
    pub(super) fn for_path(path: &Path) -> Self {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let matroska = |muxer, encoder, pixels| Self {
            container: Container::Matroska,
            muxer,
            encoder,
            pixels,
            faststart: None,
            time_base: "1:1000",
        };
        let mp4 = |muxer, encoder, pixels, kind| Self {
            container: Container::Mp4,
            muxer,
            encoder,
            pixels,
            faststart: Some(kind),
            time_base: MP4_TIME_BASE,
        };
        let opaque = ("yuv420p", None);
        match extension.as_deref() {
            Some("webm") => {
                matroska(&["-cluster_time_limit", "1000", "-f", "webm"], VP9, ("yuv420p", Some("yuva420p")))
            }
            Some("mkv") => matroska(&["-cluster_time_limit", "1000", "-f", "matroska"], H264, opaque),
            Some("mov") => mp4(FRAGMENTED_MOV, PRORES, ("yuv444p10le", Some("yuva444p10le")), "mov"),
            _ => mp4(FRAGMENTED_MP4, H264, opaque, "mp4"),
        }
    }

    /// Whether it keeps an alpha channel.
    pub(super) fn keeps_alpha(&self) -> bool {
        self.pixels.1.is_some()
    }

    /// The muxer of a copy with its index at the front, if that needs one.
    pub(super) fn faststart(&self) -> Option<&'static str> {
        self.faststart
    }
}

/// A tick that divides the usual frame periods, and long enough that a gap of half a day is below 2^28 ticks: readers
/// distrust longer ones.
const MP4_TIME_BASE: &str = "1:6000";

const FRAGMENTED_MP4: &[&str] =
    &["-movflags", "+frag_keyframe+delay_moov+default_base_moof", "-frag_duration", "1000000", "-f", "mp4"];

const FRAGMENTED_MOV: &[&str] =
    &["-movflags", "+frag_keyframe+delay_moov+default_base_moof", "-frag_duration", "1000000", "-f", "mov"];

/// Visually lossless, at several times the speed of the default preset.
const H264: &[&str] = &["-c:v", "libx264", "-preset", "veryfast", "-crf", "18"];

const VP9: &[&str] =
    &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "5", "-row-mt", "1"];

/// ProRes 4444, which editors read.
const PRORES: &[&str] = &["-c:v", "prores_ks", "-profile:v", "4444", "-vendor", "apl0"];

/// Builds the command that encodes the Matroska stream on its standard input into the file `part`, with `threads`
/// threads. With `alpha`, the stream is RGBA, and otherwise Y'CbCr.
pub(super) fn encode_command(
    format: &Format,
    part: &Path,
    (height, alpha): (u32, bool),
    threads: Option<usize>,
) -> Command {
    let color = match YcbcrMatrix::for_height(height) {
        YcbcrMatrix::Bt601 => "smpte170m",
        // Players expect this for high definition.
        YcbcrMatrix::Bt709 | YcbcrMatrix::Bt2020 => "bt709",
    };
    // Tagged on the frames, for filters, and on the stream, for the muxer. 4:2:0 encoders refuse odd sizes.
    let (opaque, with_alpha) = format.pixels;
    let pixels = with_alpha.filter(|_| alpha).unwrap_or(opaque);
    let convert = match alpha {
        true => format!(
            "scale=out_color_matrix={color}:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int,format={pixels},"
        ),
        false => String::new(),
    };
    let filters = format!(
        "crop=trunc(iw/2)*2:trunc(ih/2)*2,{convert}\
         setparams=range=tv:colorspace={color}:color_primaries={color}:color_trc={color}"
    );
    let mut command = base_command(FFMPEG);
    command
        .args(["-nostdin", "-y"])
        .args(["-f", "matroska", "-i", "pipe:0"])
        .args(["-vf", &filters, "-pix_fmt", pixels, "-color_range", "tv"])
        .args(["-colorspace", color, "-color_primaries", color, "-color_trc", color])
        .args([frame_timing_option(), "vfr", "-enc_time_base", format.time_base])
        .args(format.encoder)
        // Frames that are not shown would have no alpha; of the encoders here only that of VP9 makes them.
        .args(if alpha && format.container == Container::Matroska { &["-auto-alt-ref", "0"][..] } else { &[] })
        .args(threads.iter().flat_map(|threads| ["-threads".to_owned(), threads.to_string()]))
        // No random identifiers: the same frames produce the same file.
        .args(["-fflags", "+bitexact", "-flush_packets", "1"])
        .args(format.muxer)
        .arg(file_url(part))
        .stdin(Stdio::piped());
    command
}

/// Builds the command that copies the pictures of `from` to `to`, and beside them title, date and place of `sound` and,
/// `with_sound`, `length_s` seconds of it.
pub(super) fn sound_command(
    format: &Format,
    from: &Path,
    (sound, with_sound): (&Sound, bool),
    length_s: f64,
    to: &Path,
) -> Command {
    let muxer = match format.container {
        Container::Mp4 => &["-movflags", "+faststart", "-f", format.faststart.unwrap_or("mp4")],
        Container::Matroska => format.muxer,
    };
    let tracks: &[&str] = if with_sound { &["-map", "0:v", "-map", "1:a?"] } else { &["-map", "0:v"] };
    let mut command = base_command(FFMPEG);
    command
        .args(["-nostdin", "-y", "-i"])
        .arg(file_url(from))
        .args(INPUT_OPTIONS)
        .args(["-ss", &format!("{:.6}", sound.start_s), "-t", &format!("{length_s:.6}"), "-i"])
        .arg(file_url(&sound.path))
        .args(tracks)
        .args(["-map_metadata", "1", "-c", "copy", "-fflags", "+bitexact"])
        .args(muxer)
        .arg(file_url(to));
    command
}

/// Builds the command that copies `from` to `to` by `muxer`, mp4 or mov, with its index in front, so that a player can
/// start before it has the whole file.
pub(super) fn faststart_command(muxer: &str, from: &Path, to: &Path) -> Command {
    let mut command = base_command(FFMPEG);
    command
        .args(["-nostdin", "-y", "-i"])
        .arg(file_url(from))
        .args(["-c", "copy", "-movflags", "+faststart", "-f", muxer])
        .arg(file_url(to));
    command
}
