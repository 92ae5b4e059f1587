//! Video files as sources: whatever the container, with the times, sizes and colours that a player shows.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use bokehcam::depth::FrameInput;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::look::Look;
use bokehcam_live::capture::{Captured, FrameBuffers};
use bokehcam_live::source::{DepthChoice, Frames, Options, Source, SourceName};
use bokehcam_media::recording::DepthUnit;

/// Twenty frames of 40 ms; the grey of each is twelve times its number.
const GREYS: &str = "color=black:s=64x48:r=25:d=0.8,format=gray,geq=lum=12*N";

fn ffmpeg(arguments: &[&str], file: &Path) {
    let ended =
        Command::new("ffmpeg").args(["-v", "error", "-nostdin", "-y"]).args(arguments).arg(file).output().unwrap();
    assert!(ended.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&ended.stderr));
}

/// Makes a clip from a source of lavfi, with more arguments separated by spaces.
fn clip(folder: &Path, name: &str, lavfi: &str, arguments: &str) -> PathBuf {
    let file = folder.join(name);
    ffmpeg(&[&["-f", "lavfi", "-i", lavfi][..], &arguments.split_whitespace().collect::<Vec<_>>()].concat(), &file);
    file
}

/// What a source delivered until its end.
#[derive(Debug, Default, PartialEq)]
struct Played {
    size: (u32, u32),
    stamps: Vec<Stamp>,
    pictures: Vec<ColorImage>,
    /// The middle of each frame's depth map.
    depths_m: Vec<f32>,
    /// The fault, if it ended with one.
    fault: Option<String>,
}

impl Played {
    fn times_ms(&self) -> Vec<u64> {
        self.stamps.iter().map(|stamp| (stamp.time_ns + 500_000) / 1_000_000).collect()
    }

    /// Returns the number of each picture, by its grey.
    fn numbers(&self) -> Vec<u8> {
        self.pictures.iter().map(|picture| (picture.rgb[picture.rgb.len() / 2] + 6) / 12).collect()
    }
}

/// Plays a source to its end, or at most 100 frames of it.
fn play(file: &Path, options: &Options) -> Result<Played, String> {
    let name = SourceName::parse_os(file.as_os_str()).map_err(|error| error.to_string())?;
    let mut source = Source::open(&name, options, Some(&Look::default())).map_err(|error| error.to_string())?;
    let mut played = Played { size: source.camera.info().size, ..Played::default() };
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    while played.stamps.len() < 100 {
        let buffers = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
        match source.camera.next(buffers).map_err(|error| error.to_string())? {
            Captured::Frame(stamp) => {
                if let Some(source) = &mut source.depth {
                    let mut map = DepthMap::default();
                    let seen = FrameInput { stamp, color: &color, right: None };
                    source.read(seen, &mut map).map_err(|error| error.to_string())?;
                    played.depths_m.push(map.metres[map.metres.len() / 2 + map.width as usize / 2]);
                }
                assert_eq!(color.size(), played.size);
                played.stamps.push(stamp);
                played.pictures.push(color.clone());
            }
            Captured::Waiting => {}
            Captured::Corrupt(error) => played.fault = Some(error.to_string()),
            Captured::End => break,
            other => panic!("{other:?}"),
        }
    }
    Ok(played)
}

fn without_depth(frames: Frames) -> Options {
    Options { frames, depth_choice: DepthChoice::None, ..Options::default() }
}

fn play_all(file: &Path) -> Played {
    let played = play(file, &without_depth(Frames::default())).unwrap();
    assert_eq!(played.fault, None, "{}", file.display());
    played
}

fn assert_one_line(message: &str, file: &Path) {
    assert!(message.contains(file.to_str().unwrap()) && !message.contains('\n'), "{message}");
}

#[test]
#[ignore = "needs ffmpeg"]
fn every_container_is_known_by_its_content_and_plays_the_same_twice() {
    let folder = tempfile::tempdir().unwrap();
    let every_40_ms: Vec<u64> = (0..20).map(|number| number * 40).collect();
    for (container, codec) in [
        ("mp4", "libx264 -pix_fmt yuv420p"),
        ("mov", "mjpeg -pix_fmt yuvj420p"),
        ("matroska", "libx264 -pix_fmt yuv420p10le"),
        ("webm", "libvpx -b:v 1M"),
        ("avi", "mpeg4 -q:v 2"),
        ("gif", "gif"),
        ("mpegts", "mpeg2video -q:v 2"),
        ("yuv4mpegpipe", "wrapped_avframe -pix_fmt yuv444p"),
    ] {
        let file = clip(folder.path(), "clip", GREYS, &format!("-c:v {codec} -f {container}"));
        let played = play_all(&file);
        assert_eq!((played.size, played.times_ms()), ((64, 48), every_40_ms.clone()), "{container}");
        let numbers: Vec<u8> = (0..20).collect();
        assert_eq!(played.numbers(), numbers, "{container}");
        assert!(played.stamps.iter().enumerate().all(|(index, stamp)| stamp.index == index), "{container}");
        assert!(play_all(&file) == played, "{container}: bit for bit");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn pictures_are_as_large_and_upright_as_a_player_shows_them() {
    let folder = tempfile::tempdir().unwrap();
    // The left half is white.
    let halves = "color=black:s=34x18:d=0.08:r=25,format=gray,geq=lum='255*lt(X,W/2)'";
    // This tag turns counterclockwise.
    let corner = 34 * 18 - 1;
    for (degrees, size, white_at) in [(0, (34, 18), 0), (90, (18, 34), corner), (180, (34, 18), 33), (270, (18, 34), 0)]
    {
        let flat = clip(folder.path(), "flat.mp4", halves, "-c:v libx264 -pix_fmt yuv420p");
        let file = folder.path().join("turned.mp4");
        // Versions before 6 know only the tag.
        let turn = format!("rotate={degrees}");
        ffmpeg(&["-i", flat.to_str().unwrap(), "-c", "copy", "-metadata:s:v", &turn], &file);
        let played = play_all(&file);
        assert_eq!(played.size, size, "{degrees}");
        let pixel = |at: usize| played.pictures[0].rgb[3 * at];
        assert!(pixel(white_at) > 240 && pixel(corner - white_at) < 15, "{degrees}");
    }
    for (size, arguments, expected) in [
        ("33x17", "-c:v ffv1 -pix_fmt yuv444p", (33, 17)),
        ("1x1", "-c:v ffv1 -pix_fmt yuv420p", (1, 1)),
        ("48x32", "-c:v ffv1 -vf setsar=3/2", (72, 32)),
    ] {
        let file = clip(folder.path(), "odd.mkv", &format!("testsrc=s={size}:d=0.2"), arguments);
        assert_eq!(play_all(&file).size, expected, "{size}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_variable_rate_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    for (name, keeps) in
        [("a.mkv", "not(eq(mod(n,3),1))"), ("b.mp4", "lt(n,5)+gt(n,12)"), ("c.mkv", "eq(mod(n*n,5),4)")]
    {
        let lavfi = format!("{GREYS},select='{keeps}'");
        let file = clip(folder.path(), name, &lavfi, "-fps_mode passthrough -c:v libx264 -pix_fmt yuv420p");
        let played = play_all(&file);
        let numbers = played.numbers();
        assert!((8..20).contains(&numbers.len()), "{name}");
        let expected: Vec<u64> = numbers.iter().map(|&number| u64::from(number - numbers[0]) * 40).collect();
        assert_eq!(played.times_ms(), expected, "{name}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn colours_are_those_of_the_tags_or_else_of_the_size() {
    let folder = tempfile::tempdir().unwrap();
    for (size, matrix, range, tags) in [
        ("64x48", "bt709", "tv", "-colorspace bt709 -color_range tv"),
        ("64x48", "bt601", "tv", "-colorspace smpte170m -color_range tv"),
        ("64x48", "bt601", "pc", "-colorspace smpte170m -color_range pc"),
        ("64x720", "bt709", "tv", ""),
        ("64x48", "bt601", "tv", ""),
    ] {
        for (color, rgb) in [("red", [254, 0, 0]), ("0x40A060", [64, 160, 96])] {
            let lavfi = format!("color={color}:s={size}:d=0.1,scale=out_color_matrix={matrix}:out_range={range}");
            // A tagged file keeps its tags; the raw encoder adds none.
            let file = clip(folder.path(), "c.mkv", &lavfi, &format!("-pix_fmt yuv444p {tags} -c:v ffv1"));
            let found = play_all(&file).pictures[0].rgb.as_chunks::<3>().0[70];
            let is_near = found.iter().zip(rgb).all(|(&found, expected)| i32::from(found).abs_diff(expected) <= 3);
            assert!(is_near, "{size} {matrix} {range} {tags}: {found:?} for {color}");
        }
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn parts_loops_sizes_and_rates_are_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let file = clip(folder.path(), "clip.mp4", GREYS, "-c:v libx264 -g 7 -pix_fmt yuv420p");
    let part = |frames: Frames| play(&file, &without_depth(frames)).unwrap();
    let numbers = |start, end, frames| {
        let played = part(Frames { start, end, frames, ..Frames::default() });
        assert_eq!(played.times_ms()[0], 0);
        (played.numbers()[0], *played.numbers().last().unwrap(), played.numbers().len())
    };
    assert_eq!(numbers(Some(0.4), None, None), (10, 19, 10));
    assert_eq!(numbers(Some(0.41), Some(0.6), None), (11, 14, 4));
    assert_eq!(numbers(None, Some(0.2), None), (0, 4, 5));
    assert_eq!(numbers(Some(0.2), None, Some(3)), (5, 7, 3));

    let looped = part(Frames { start: Some(0.64), repeat: true, frames: Some(10), ..Frames::default() });
    assert_eq!(looped.numbers(), [16, 17, 18, 19, 16, 17, 18, 19, 16, 17]);
    assert_eq!(looped.times_ms(), (0..10).map(|number| number * 40).collect::<Vec<_>>());

    let small = part(Frames { size: Some("32x24".parse().unwrap()), fps: Some(12.5), ..Frames::default() });
    assert_eq!((small.size, small.times_ms()), ((32, 24), (0..10).map(|number| number * 80).collect()));

    for (start, end) in [(Some(2.0), None), (Some(0.5), Some(0.5)), (None, Some(0.0))] {
        let error = play(&file, &without_depth(Frames { start, end, ..Frames::default() })).unwrap_err();
        assert!(error.contains("has no frame from"), "{error}");
        assert_one_line(&error, &file);
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_cut_at_fifty_places_is_a_fault_after_its_whole_frames() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut");
    for (name, arguments, cuts) in [
        ("a.mp4", "-c:v libx264 -pix_fmt yuv420p -movflags +faststart", 18),
        ("a.mkv", "-c:v libx264 -pix_fmt yuv420p", 16),
        ("a.gif", "", 16),
    ] {
        let whole = fs::read(clip(folder.path(), name, "testsrc=s=64x48:r=25:d=0.8", arguments)).unwrap();
        for place in 0..cuts {
            let bytes = whole.len() * place / cuts;
            fs::write(&cut, &whole[..bytes]).unwrap();
            fs::rename(&cut, folder.path().join(format!("cut{name}"))).unwrap();
            let file = folder.path().join(format!("cut{name}"));
            match play(&file, &without_depth(Frames::default())) {
                Ok(Played { fault: Some(fault), stamps, .. }) => {
                    assert!(fault.contains(&format!("after {} frames", stamps.len())), "{fault}");
                    assert_one_line(&fault, &file);
                }
                Ok(played) => panic!("{name} cut at {bytes}: {} frames and no fault", played.stamps.len()),
                Err(error) => assert_one_line(&error, &file),
            }
        }
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn what_is_no_video_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let sound = clip(folder.path(), "sound.mp4", "sine=d=0.3", "-c:a aac");
    let key = "-encryption_scheme cenc-aes-ctr -encryption_key 76a6c65c5ea762046bd749a2e632ccbb -encryption_kid \
               a7e61c373e219033c21091fa607bf3b8";
    let locked = clip(folder.path(), "locked.mp4", GREYS, &format!("-c:v libx264 -pix_fmt yuv420p {key}"));
    let [empty, text] = ["empty.mp4", "text.mkv"].map(|name| folder.path().join(name));
    fs::write(&empty, "").unwrap();
    fs::write(&text, "#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n").unwrap();
    for (file, what) in [(sound, "only sound"), (locked, "encrypted"), (empty, "empty"), (text, "cannot read it")] {
        let error = play(&file, &without_depth(Frames::default())).unwrap_err();
        assert!(error.contains(what), "{error}");
        assert_one_line(&error, &file);
    }
    for address in ["https://host/clip.mp4", "rtsp://camera:554/live", "http://host"] {
        let error = SourceName::parse_os(address.as_ref()).unwrap_err();
        assert!(error.is_wrong_argument() && error.to_string().contains(&format!("ffmpeg -i '{address}'")), "{error}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn depth_in_a_second_video_belongs_to_the_frame_of_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let color = clip(folder.path(), "color.mp4", GREYS, "-c:v libx264 -g 7 -pix_fmt yuv420p");
    let near_to_far = "format=gray16le,geq=lum='65535-3000*N'";
    let source = |size: &str, length_s: &str| format!("color=black:s={size}:r=25:d={length_s},{near_to_far}");
    let with = |depth: &Path, frames: Frames, inverted: bool| {
        let mut options = Options { frames, depth_choice: DepthChoice::Video(depth.to_owned()), ..Options::default() };
        options.depth.depth_invert = inverted;
        options.depth.depth_unit = Some(DepthUnit::Inverse);
        play(&color, &options)
    };
    let expected_m = |number: u8| DepthMap::relative_to_metres(1.0 - 3000.0 * f32::from(number) / 65535.0);
    for size in ["64x48", "32x24", "128x96"] {
        let depth = clip(folder.path(), "depth.mkv", &source(size, "0.8"), "-c:v ffv1");
        for (start, repeat) in [(None, false), (Some(0.41), false), (Some(0.64), true)] {
            let played = with(&depth, Frames { start, repeat, frames: Some(10), ..Frames::default() }, false).unwrap();
            assert!(played.numbers().len() >= 9);
            for (number, metres) in played.numbers().into_iter().zip(&played.depths_m) {
                assert!((metres / expected_m(number) - 1.0).abs() < 0.01, "{size}, frame {number}: {metres} m");
            }
        }
        let played = with(&depth, Frames { frames: Some(3), ..Frames::default() }, true).unwrap();
        assert_eq!(played.depths_m[0], DepthMap::relative_to_metres(0.0), "{size}");
        assert!(played.depths_m[1] > played.depths_m[2], "{size}");
    }
    for (size, length_s, what) in [("64x48", "0.4", "10 frames"), ("64x64", "0.8", "aspect")] {
        let depth = clip(folder.path(), "other.mkv", &source(size, length_s), "-c:v ffv1");
        let error = with(&depth, Frames::default(), false).unwrap_err();
        assert!(error.contains(what), "{error}");
        assert_one_line(&error, &depth);
    }
    let options = Options { depth_choice: DepthChoice::Video(color.clone()), ..Options::default() };
    assert!(Source::open(&SourceName::Synthetic, &options, Some(&Look::default())).is_err());
}

#[test]
#[ignore = "needs ffmpeg"]
fn no_decoder_outlives_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let file = clip(folder.path(), "long.mp4", "testsrc=s=320x240:d=20", "-c:v libx264 -pix_fmt yuv420p");
    let decoders = || {
        let processes = fs::read_dir("/proc").unwrap().flatten();
        let lines = processes.map(|process| fs::read(process.path().join("cmdline")).unwrap_or_default());
        lines.filter(|line| String::from_utf8_lossy(line).contains(file.to_str().unwrap())).count()
    };
    for frames in [1, 3] {
        let name = SourceName::parse_os(file.as_os_str()).unwrap();
        let mut source = Source::open(&name, &without_depth(Frames::default()), Some(&Look::default())).unwrap();
        let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
        for _ in 0..frames {
            let buffers = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
            source.camera.next(buffers).unwrap();
        }
        assert_eq!(decoders(), 1);
        drop(source);
        assert_eq!(decoders(), 0);
    }
}
