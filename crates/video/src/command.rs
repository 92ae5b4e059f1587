//! Command lines of ffmpeg and ffprobe.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use bokehcam_files::process::read_output_within;

/// The program that decodes and encodes.
pub const FFMPEG: &str = "ffmpeg";
/// The program that describes files.
pub const FFPROBE: &str = "ffprobe";

/// The formats that are read, by ffmpeg's names: each holds its pictures itself. Playlists (`hls`, `concat`, `dash`, `sdp`,
/// `imf`), names of series (`image2`), scripts and devices lead to other files, whatever the name of the file.
const FORMATS: &str = "mov,matroska,avi,mpegts,mpeg,mpegvideo,flv,live_flv,kux,ogg,asf,asf_o,rm,ivr,mxf,gxf,lxf,nut,nuv,nsv,\
                       wtv,ty,pva,dv,dhav,ivf,obu,av1,av2,h261,h263,h264,hevc,vvc,evc,m4v,vc1,vc1test,cavsvideo,avs2,avs3,\
                       dirac,dnxhd,mjpeg,mpjpeg,smjpeg,mjpeg_2000,ingenient,yuv4mpegpipe,gif,apng,webp,webp_anim,fits,flic,\
                       swf,r3d,cine,ser,smush,film_cpk,roq,smk,bink,4xm,idcin,ipmovie,thp,vmd,wc3movie,ea,lmlm4,xmv,mtv,mvi,\
                       nc,vivo,viv,bmp_pipe,dds_pipe,dpx_pipe,exr_pipe,gif_pipe,j2k_pipe,jpeg_pipe,jpegls_pipe,jpegxl_pipe,\
                       jpegxl_anim,pam_pipe,pbm_pipe,pcx_pipe,pgm_pipe,png_pipe,ppm_pipe,psd_pipe,qoi_pipe,sgi_pipe,\
                       tiff_pipe,webp_pipe";

/// What ffmpeg says of another format, after `[NAME @ ADDRESS] `.
const NOT_LISTED: &str = "Format not on whitelist";

/// Options of an input, so that one local file is read and no other, whatever it contains.
pub const INPUT_OPTIONS: [&str; 4] = ["-protocol_whitelist", "file", "-format_whitelist", FORMATS];

/// Returns the name of a format that is not read, if that is what one of ffmpeg's lines says.
pub(super) fn find_unlisted_format(line: &str) -> Option<&str> {
    line.split_once(NOT_LISTED)?.0.rsplit_once('[')?.1.split_once(" @").map(|(format, _)| format)
}

/// Builds a command of ffmpeg or ffprobe, which logs only errors.
pub fn base_command(program: &str) -> Command {
    let mut command = Command::new(program);
    command
        .args(["-hide_banner", "-loglevel", "error"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// Prefixes the path as a file, so that ffmpeg interprets neither a dash as an option nor a colon as a protocol.
pub fn file_url(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

/// Returns the name of the option by which frames keep their times: `-fps_mode` since ffmpeg 5.1, `-vsync` before,
/// which later versions no longer support.
pub fn frame_timing_option() -> &'static str {
    let text = read_output_within(Command::new(FFMPEG).arg("-version"), Duration::from_secs(2));
    if text.as_deref().and_then(parse_version).is_some_and(|version| version < (5, 1)) { "-vsync" } else { "-fps_mode" }
}

/// Parses `ffmpeg version 5.1.9-0+deb12u1 Copyright ...` to (5, 1).
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let number = text.strip_prefix("ffmpeg version ")?.split_whitespace().next()?.trim_start_matches('n');
    let mut parts = number.split(|c: char| !c.is_ascii_digit());
    Some((parts.next()?.parse().ok()?, parts.next().and_then(|minor| minor.parse().ok()).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_as_builds_state_them() {
        for (text, expected) in [
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright (c) 2000-2026", Some((5, 1))),
            ("ffmpeg version n6.0-10-g1 Copyright", Some((6, 0))),
            ("ffmpeg version 4.4.2-0ubuntu0.22.04.1 Copyright", Some((4, 4))),
            ("ffmpeg version 7.1 Copyright", Some((7, 1))),
            ("ffmpeg version 8", Some((8, 0))),
            ("ffmpeg version N-109542-g0a7c6b4 Copyright", None),
            ("something else", None),
        ] {
            assert_eq!(parse_version(text), expected, "{text}");
        }
    }
}
