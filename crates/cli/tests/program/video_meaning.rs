//! What a video file states beside its pictures: which track, which start, which alpha, which unit, title and subtitles.

use std::fs;
use std::process::Command;

use bokehcam_media::recording::still::read_color;

use crate::program::{Home, Ran};

/// Makes a file in a home by ffmpeg.
fn make(home: &Home, arguments: &[&str]) {
    let mut ffmpeg = home.within(Command::new("ffmpeg"));
    Ran::of(ffmpeg.args(["-v", "error", "-y"]).args(arguments)).done();
}

fn source(filter: &str) -> [&str; 4] {
    ["-f", "lavfi", "-i", filter]
}

fn probe(home: &Home, entries: &str, file: &str) -> String {
    let mut probe = home.within(Command::new("ffprobe"));
    Ran::of(probe.args(["-v", "error", "-of", "csv=p=0", "-show_entries", entries, file])).printed()
}

#[test]
#[ignore = "needs ffmpeg"]
fn the_track_marked_as_default_is_played() {
    let home = Home::new();
    let [small, large] = ["color=red:s=32x24:d=0.2", "color=blue:s=64x48:d=0.2"];
    let tracks = ["-map", "0", "-map", "1", "-disposition:0", "0", "-disposition:1", "default", "two.mkv"];
    make(&home, &[&source(small)[..], &source(large), &tracks].concat());
    let ran = home.run(&["stream", "two.mkv", "--effect", "none", "--to", "out/"]);
    assert!(ran.done().contains("has 2 tracks of pictures, of which the one marked as default is played"), "{ran:?}");
    let picture = read_color(&home.path("out/000000.png")).unwrap();
    assert!(picture.size() == (64, 48) && picture.rgb[2] > 200, "{:?}", picture.size());
}

#[test]
fn two_files_are_made_one() {
    let home = Home::new();
    ["left.mp4", "right.mp4"].iter().for_each(|file| fs::write(home.path(file), "").unwrap());
    let said = ["two files are no source", "ffmpeg -i left.mp4 -i right.mp4 -filter_complex hstack", "--side-by-side"];
    home.run(&["stream", "left.mp4,right.mp4", "--to", "null"]).refused(2, &said);
    home.run(&["stream", "left.mp4,nothing.mp4", "--to", "null"]).refused(1, &["nothing.mp4"]);
}

#[test]
#[ignore = "needs ffmpeg"]
fn no_frame_is_lost_to_a_start_that_is_rounded() {
    let home = Home::new();
    for (file, more) in [("late.ts", &[][..]), ("late.mp4", &["-output_ts_offset", "0.6666666"])] {
        let clip = ["-c:v", "libx264", "-bf", "0", "-video_track_timescale", "90000"];
        let clip = if file == "late.ts" { &clip[..4] } else { &clip };
        make(&home, &[&source("testsrc=s=64x48:r=30:d=1")[..], clip, more, &[file]].concat());
        let ran = home.run(&["stream", file, "--effect", "none", "--to", "null"]);
        assert!(ran.done().contains("30 of 30 frames"), "{file}: {ran:?}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn what_cannot_be_shown_as_it_is_is_told() {
    let home = Home::new();
    let fields = ["-vf", "interlace", "-c:v", "libx264", "-flags", "+ildct+ilme", "-x264opts", "tff=1", "fields.mp4"];
    make(&home, &[&source("testsrc=s=64x48:r=50:d=0.4")[..], &fields].concat());
    let ran = home.run(&["stream", "fields.mp4", "--effect", "none", "--to", "null"]);
    assert!(ran.done().contains("fields.mp4: interlaced pictures"), "{ran:?}");

    let p3 = ["-color_primaries", "smpte432", "-color_trc", "bt709", "-colorspace", "bt709", "p3.mp4"];
    make(&home, &[&source("testsrc=s=64x48:r=10:d=0.4")[..], &p3].concat());
    let ran = home.run(&["stream", "p3.mp4", "--effect", "none", "--to", "null"]);
    assert!(ran.done().contains("p3.mp4: colours of smpte432 are shown as those of BT.709"), "{ran:?}");
    make(&home, &[&source("testsrc=s=64x48:r=10:d=1")[..], &["colours.mp4"]].concat());
    make(
        &home,
        &[&source("gradients=s=64x48:r=10:d=1:c0=black:c1=white")[..], &["-vf", "format=gray", "grey.mp4"]].concat(),
    );
    let stream = |depth: &str| home.run(&["stream", "colours.mp4", "--depth", depth, "--focus", "0", "--to", "null"]);
    stream("colours.mp4").failed(1, &["colours.mp4: a video in colours is not depth", "--grayscale"]);
    stream("grey.mp4").done();
}

#[test]
#[ignore = "needs ffmpeg"]
fn what_is_transparent_is_in_front_of_white() {
    let home = Home::new();
    let half = "color=red:s=64x48:r=10:d=0.3,format=rgba,geq=r=255:g=0:b=0:a='if(lt(X,32),255,0)'";
    // A palette in which one number is transparent.
    let paletted = format!("{half},split[a][b];[a]palettegen[p];[b][p]paletteuse");
    for (file, filter, codec) in [
        ("half.mov", half, &["-c:v", "png"][..]),
        ("half.gif", &*paletted, &[]),
        ("vp9.webm", half, &["-c:v", "libvpx-vp9", "-lossless", "1", "-pix_fmt", "yuva420p"]),
        ("vp8.webm", half, &["-c:v", "libvpx", "-auto-alt-ref", "0", "-b:v", "1M", "-pix_fmt", "yuva420p"]),
    ] {
        make(&home, &[&source(filter)[..], codec, &[file]].concat());
        home.run(&["stream", file, "--effect", "none", "--to", "out/", "--force"]).done();
        let picture = read_color(&home.path("out/000001.png")).unwrap();
        let pixel = |x: usize| &picture.rgb[3 * (24 * 64 + x)..][..3];
        assert!(pixel(8).iter().zip([255, 0, 0]).all(|(a, b)| a.abs_diff(b) < 8), "{file}: {:?}", pixel(8));
        assert!(pixel(56).iter().all(|&code| code > 250), "{file}: {:?}", pixel(56));
    }
    // An alpha channel does not change the matrix of large pictures, where none is stated.
    let [opaque, alpha] = ["yuv444p", "yuva444p"].map(|pixels| {
        let file = format!("{pixels}.mkv");
        let hd = source("color=0xfa5b29:s=1280x720:r=10:d=0.1");
        make(&home, &[&hd[..], &["-c:v", "ffv1", "-pix_fmt", pixels, &file]].concat());
        home.run(&["stream", &file, "--effect", "none", "--to", "out/", "--force"]).done();
        let picture = read_color(&home.path("out/000000.png")).unwrap();
        [picture.rgb[0], picture.rgb[1], picture.rgb[2]]
    });
    assert!(opaque.iter().zip(alpha).all(|(a, b)| a.abs_diff(b) <= 2), "{opaque:?} and {alpha:?}");
}

#[test]
#[ignore = "needs ffmpeg"]
fn title_and_sound_stay_where_the_file_holds_them() {
    let home = Home::new();
    fs::write(home.path("words.srt"), "1\n00:00:00,000 --> 00:00:01,000\nHello\n").unwrap();
    let inputs = [&source("testsrc=s=64x48:r=10:d=1")[..], &source("sine=d=1"), &["-i", "words.srt"]].concat();
    let tags = ["-metadata", "title=A day", "-metadata", "date=2026"];
    make(&home, &[&inputs[..], &tags, &["-c:a", "pcm_s16le", "-c:s", "srt", "in.mkv"]].concat());
    for (to, has_sound) in [("out.mkv", true), ("out.mp4", false)] {
        let ran = home.run(&["stream", "in.mkv", "--effect", "none", "--to", to]);
        assert!(ran.done().contains("in.mkv: written without its subtitles"), "{ran:?}");
        let is_told = ran.stderr.contains("files of this kind do not hold it; .mkv and .mov do");
        assert_eq!(
            (is_told, probe(&home, "stream=codec_type", to).contains("audio")),
            (!has_sound, has_sound),
            "{ran:?}"
        );
        assert!(probe(&home, "format_tags=title", to).contains("A day"), "{to}");
    }
    // Without sound, the title is copied alone.
    make(&home, &[&source("testsrc=s=64x48:r=10:d=1")[..], &tags, &["silent.mp4"]].concat());
    home.run(&["stream", "silent.mp4", "--effect", "none", "--to", "silent-out.mp4"]).done();
    assert!(probe(&home, "format_tags=title", "silent-out.mp4").contains("A day"));
}

#[test]
#[ignore = "needs ffmpeg"]
fn grey_of_16_bits_is_asked_about_as_depth() {
    let home = Home::new();
    let clip = |name: &'static str, format: &'static str| {
        make(
            &home,
            &[&source("gradients=s=64x48:d=0.2:r=10")[..], &["-pix_fmt", format, "-c:v", "ffv1", name]].concat(),
        );
    };
    clip("clip.mkv", "yuv420p");
    clip("deep.mkv", "gray16le");
    clip("grey.mkv", "gray");
    let stream = |options: &[&str]| home.run(&[&["stream", "clip.mkv", "--to", "out/", "--force"], options].concat());
    for unit in [&[][..], &["--depth-unit", "millimetres"]] {
        let way_out = ["deep.mkv", "may be distances", "--depth MAPS --depth-unit millimetres"];
        stream(&[&["--depth", "deep.mkv"], unit].concat()).failed(2, &way_out);
    }
    stream(&["--depth", "deep.mkv", "--depth-unit", "inverse"]).done();
    stream(&["--depth", "grey.mkv"]).done();
}
