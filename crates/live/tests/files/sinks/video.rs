//! Video through ffmpeg: complete, tagged, at the times of its frames, and never lost.

use std::fs;
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bokehcam_live::sink::{Ending, Sink, SinkError, Y4m};

use super::{PERIOD_NS, flat, forced, listing, open, options, picture, put_all};

#[test]
#[ignore = "needs ffmpeg"]
fn a_player_shows_pictures_as_they_come() {
    // Decodes each picture as soon as it arrives, and writes it out.
    let mut player = Command::new("ffmpeg")
        .args(["-v", "error", "-probesize", "32", "-analyzeduration", "0"])
        .args(["-threads", "1", "-f", "yuv4mpegpipe", "-i", "pipe:0"])
        .args(["-f", "rawvideo", "-flush_packets", "1", "pipe:1"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stream = Y4m::new(player.stdin.take().unwrap(), Path::new("player"), &options((64, 48)));
    let mut shown = player.stdout.take().unwrap();
    let mut picture_shown = vec![0; 64 * 48 * 3 / 2];
    // The decoder may hold a few; a picture that has not reached it would never come out.
    const IN_HAND: u32 = 4;
    for frame in 0..20 {
        stream.write(&picture(64, 48, frame), u64::from(frame) * PERIOD_NS).unwrap();
        if frame >= IN_HAND {
            io::Read::read_exact(&mut shown, &mut picture_shown).unwrap();
        }
    }
    drop(stream);
    let mut rest = Vec::new();
    io::Read::read_to_end(&mut shown, &mut rest).unwrap();
    assert_eq!(rest.len(), IN_HAND as usize * picture_shown.len());
    assert!(player.wait().unwrap().success());
}

/// Returns the output of `ffprobe` for a file.
fn probe(name: &Path, entries: &str) -> String {
    let probe = Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-of", "csv=p=0", "-show_entries", entries])
        .arg(name)
        .output()
        .unwrap();
    String::from_utf8(probe.stdout).unwrap().trim().to_owned()
}

/// Returns the time of each picture and the total duration, in milliseconds.
fn times(name: &Path) -> (Vec<u64>, u64) {
    let ms = |line: &str| (line.trim_end_matches(',').parse::<f64>().unwrap() * 1e3).round() as u64;
    let mut shown: Vec<u64> = probe(name, "packet=pts_time").lines().map(ms).collect();
    shown.sort_unstable();
    (shown, ms(&probe(name, "format=duration")))
}

const TAGS: &str = "stream=width,height,nb_read_frames,color_range,color_space,color_transfer,color_primaries";

#[test]
#[ignore = "needs ffmpeg"]
fn files_are_whole_and_tagged() {
    let folder = tempfile::tempdir().unwrap();
    for (extension, width, height, expected) in [
        ("mp4", 64, 48, "64,48,tv,smpte170m,smpte170m,smpte170m,5"),
        ("mkv", 33, 721, "32,720,tv,bt709,bt709,bt709,5"),
        ("webm", 64, 48, "64,48,tv,smpte170m,smpte170m,smpte170m,5"),
        ("mov", 64, 48, "64,48,tv,smpte170m,smpte170m,smpte170m,5"),
    ] {
        let name = folder.path().join(format!("a: clip.{extension}"));
        let mut sink = open(&name, &options((width, height))).unwrap();
        let frames: Vec<_> = (0..5).map(|frame| picture(width, height, frame)).collect();
        put_all(&mut *sink, &frames);
        assert!(!name.exists());
        sink.finish(Ending::Complete).unwrap();
        assert_eq!(probe(&name, TAGS), expected, "{extension}");
        assert_eq!(times(&name), (vec![0, 40, 80, 120, 160], 200), "{extension}");
        if ["mp4", "mov"].contains(&extension) {
            let bytes = fs::read(&name).unwrap();
            let at = |kind: &[u8]| bytes.windows(4).position(|bytes| bytes == kind);
            assert!(at(b"moov") < at(b"mdat") && at(b"moof").is_none(), "the index is in front");
        }
        fs::remove_file(&name).unwrap();
        assert!(listing(folder.path()).is_empty(), "{extension}: no partial names");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn frames_keep_their_times() {
    let folder = tempfile::tempdir().unwrap();
    // Half the rate in the dark, two frames almost at once, and a camera that was unplugged for an hour.
    let at_ms = [0, 40, 80, 160, 240, 333, 334, 413, 3_600_413, 3_600_453];
    for extension in ["mp4", "mkv", "webm", "mov"] {
        let name = folder.path().join(format!("clip.{extension}"));
        let mut sink = open(&name, &options((64, 48))).unwrap();
        for (ms, number) in at_ms.into_iter().zip(0..) {
            let time_ns = 123_456_789 + ms * 1_000_000;
            assert!(sink.write_frame(&picture(64, 48, number), time_ns).unwrap().is_continue());
        }
        sink.finish(Ending::Complete).unwrap();
        let (shown, duration_ms) = times(&name);
        let off_ms = shown.iter().zip(at_ms).map(|(shown, at)| shown.abs_diff(at)).max();
        assert!(shown.len() == at_ms.len() && off_ms <= Some(1), "{extension}: {shown:?}");
        assert!(duration_ms.abs_diff(3_600_493) <= PERIOD_NS / 1_000_000, "{extension}: {duration_ms}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn colours_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["mp4", "mkv", "webm", "mov"] {
        let name = folder.path().join(format!("clip.{extension}"));
        let shown = picture(64, 48, 3);
        let mut sink = open(&name, &options((64, 48))).unwrap();
        put_all(&mut *sink, std::slice::from_ref(&shown));
        sink.finish(Ending::Complete).unwrap();
        let decoded = Command::new("ffmpeg")
            .args(["-v", "error", "-i"])
            .arg(&name)
            .args(["-vf", "scale=flags=accurate_rnd", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
            .output()
            .unwrap();
        assert_eq!(decoded.stdout.len(), shown.rgb.len());
        let off = decoded.stdout.iter().zip(&shown.rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
        let mean = off / shown.rgb.len() as f64;
        assert!(mean < 2.0, "{extension}: mean difference {mean}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_failing_ffmpeg_is_the_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // One column cannot be encoded as 4:2:0, which ffmpeg detects at the first frame.
    let mut sink = open(&folder.path().join("clip.mp4"), &options((1, 1000))).unwrap();
    let mut frames = (0..).map(|at| sink.write_frame(&picture(1, 1000, 0), at * PERIOD_NS));
    let error = frames.find_map(Result::err).unwrap();
    let SinkError::Ffmpeg { status, stderr, .. } = &error else { panic!("{error}") };
    assert!(status.contains('1') && !stderr.is_empty(), "{error}");
    drop(sink);
    assert!(listing(folder.path()).is_empty());
}

#[test]
#[ignore = "needs ffmpeg"]
fn no_frame_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    open(&folder.path().join("clip.mp4"), &options((64, 48))).unwrap().finish(Ending::Complete).unwrap();
    assert!(listing(folder.path()).is_empty());
}

/// Returns the process id of the ffmpeg that writes into `folder`.
fn encoder(folder: &Path) -> String {
    let began = Instant::now();
    loop {
        for entry in fs::read_dir("/proc").unwrap().flatten() {
            let line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line);
            if line.starts_with("ffmpeg\0")
                && line.contains(folder.to_str().unwrap())
                && line.contains("-enc_time_base")
            {
                return entry.file_name().into_string().unwrap();
            }
        }
        assert!(began.elapsed() < Duration::from_secs(60), "no ffmpeg writes there");
    }
}

fn signal(name: &str, process: &str) {
    assert!(Command::new("kill").args([name, process]).status().unwrap().success());
}

/// Puts noise until `enough` returns true, or until it fails; returns the number of frames.
fn put_until(sink: &mut dyn Sink, enough: impl Fn(u32) -> bool) -> (u32, Result<(), SinkError>) {
    for number in 0.. {
        if enough(number) {
            return (number, Ok(()));
        }
        match sink.write_frame(&picture(320, 240, number), u64::from(number) * PERIOD_NS) {
            Ok(flow) => assert!(flow.is_continue()),
            Err(error) => return (number, Err(error)),
        }
    }
    unreachable!()
}

#[test]
#[ignore = "needs ffmpeg"]
fn what_a_killed_ffmpeg_had_written_can_be_played() {
    for extension in ["mp4", "mkv", "webm"] {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = open(&folder.path().join(format!("clip.{extension}")), &options((320, 240))).unwrap();
        let part = || fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        // Ten seconds of video, of which ffmpeg may still hold the last few.
        let (_, put) = put_until(&mut *sink, |number| number >= 250 && fs::metadata(part()).unwrap().len() > 20_000);
        put.unwrap();
        signal("-KILL", &encoder(folder.path()));
        let error = put_until(&mut *sink, |_| false).1.unwrap_err();
        sink.finish(Ending::Truncated).unwrap();
        let SinkError::Kept { error, kept } = &error else { panic!("{error}") };
        assert!(error.to_string().contains("SIGKILL"), "{error}");
        assert_eq!(listing(folder.path()), [format!("clip.incomplete.{extension}")]);
        let frames: u32 = probe(kept, "stream=nb_read_frames").trim_end_matches(',').parse().unwrap();
        assert!(frames > 25, "{extension}: {frames} frames are left");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn an_ffmpeg_that_hangs_ends_with_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let options = options((320, 240));
    for at_the_end in [false, true] {
        let mut sink = open(&folder.path().join("clip.mp4"), &options).unwrap();
        put_until(&mut *sink, |number| number == 100).1.unwrap();
        signal("-STOP", &encoder(folder.path()));
        options.stop.store(true, std::sync::atomic::Ordering::Relaxed);
        let error = if at_the_end {
            sink.finish(Ending::Truncated).unwrap_err()
        } else {
            let error = put_until(&mut *sink, |_| false).1.unwrap_err();
            sink.finish(Ending::Truncated).unwrap();
            error
        };
        assert!(error.to_string().contains("it hung"), "{error}");
        assert!(
            listing(folder.path()).iter().all(|name| name.starts_with("clip.incomplete") && name.ends_with(".mp4"))
        );
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_that_was_cut_short_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.mp4");
    fs::write(&name, "old").unwrap();
    let mut sink = open(&name, &forced((64, 48))).unwrap();
    put_all(&mut *sink, &[flat(64, 48, [90; 3]), flat(64, 48, [99; 3])]);
    sink.finish(Ending::Truncated).unwrap();
    assert_eq!(fs::read(&name).unwrap(), b"old");
    let kept = folder.path().join("clip.incomplete.mp4");
    assert_eq!(times(&kept), (vec![0, 40], 80));
}
