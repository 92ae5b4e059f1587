//! Every fault of a recording is reported in one line: what, where, what to do.

use std::fs;
use std::os::unix::fs::symlink;

use bokehcam::frame::ColorImage;
use bokehcam_live::capture::Camera;
use bokehcam_live::capture::replay::{PlayRange, Replay};
use bokehcam_media::recording::{Options, Recording, RecordingError, Scratch};

use super::{SIZE, Scene, assert_says, color_of, depth_of, png_that_claims, save_grey, times_ns};

#[test]
fn a_folder_without_lists_is_no_recording() {
    let scene = Scene::new();
    assert_says(scene.open(), &["not a recording", "associations.txt", "rgb.txt", "give the folder"]);
    scene.write("file", "");
    assert_says(Recording::open(&scene.path("file"), &Options::default()), &["file: not a recording"]);
    assert_says(Recording::open(&scene.path("nowhere"), &Options::default()), &["cannot open", "nowhere", "No such"]);
}

#[test]
fn a_missing_list_is_named() {
    let scene = Scene::with_pairs(2);
    scene.remove("rgb.txt");
    assert_says(scene.open(), &["rgb.txt is missing", "depth.txt"]);
}

#[test]
fn an_empty_list_is_named() {
    for list in ["rgb.txt", "depth.txt", "associations.txt"] {
        let scene = Scene::with_pairs(2);
        scene.write(list, "# nothing but a comment\n\n");
        assert_says(scene.open(), &[list, "names no picture"]);
    }
}

#[test]
fn streams_that_never_meet_are_told() {
    let scene = Scene::with_pairs(2);
    scene.write("depth.txt", "9.0 depth/0.png\n");
    assert_says(scene.open(), &["no depth map lies within 20 ms", "of one clock"]);
}

/// Invalid lines, and the error of each.
const WRONG_LINES: [(&[u8], &str); 14] = [
    (b"1.1", "expected `time file`, found 1 column(s)"),
    (b"1.1 rgb/1.png 1.1 depth/1.png", "found 4 column(s)"),
    (b"nan rgb/1.png", "\"nan\" is not a time"),
    (b"inf rgb/1.png", "\"inf\" is not a time"),
    (b"-1.1 rgb/1.png", "\"-1.1\" is not a time"),
    (b"1.1e0 rgb/1.png", "\"1.1e0\" is not a time"),
    (b"1,1 rgb/1.png", "\"1,1\" is not a time"),
    (b"99999999999999999999 rgb/1.png", "is not a time"),
    (b"1.0 rgb/1.png", "out of order or repeated"),
    (b"../../1.png 1.1", "is not a time"),
    (b"1.1 ../rgb/1.png", "../rgb/1.png points outside the recording"),
    (b"1.1 /etc/hostname", "/etc/hostname points outside the recording"),
    (b"1.1 rgb/\x1b[2J.png", "control characters"),
    (b"1.1 rgb/\xff\xfe.png", "not UTF-8"),
];

fn with_wrong_line(wrong: &[u8]) -> Scene {
    let scene = Scene::with_pairs(4);
    scene.write("rgb.txt", [b"# colour\n1.0 rgb/0.png\n", wrong, b"\n1.2 rgb/2.png\n1.3 rgb/3.png\n"].concat());
    scene
}

#[test]
fn a_wrong_line_fails_the_opening() {
    for (wrong, says) in WRONG_LINES {
        assert_says(with_wrong_line(wrong).open(), &["rgb.txt:3: ", says, ";"]);
    }
}

#[test]
fn a_wrong_line_stays_a_frame_when_going_on() {
    for (wrong, says) in WRONG_LINES {
        let scene = with_wrong_line(wrong);
        let recording = scene.open_keep_going();
        assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000, 300_000_000]);
        assert_says(color_of(&recording, 1), &["rgb.txt:3: ", says]);
        for index in [0, 2, 3] {
            depth_of(&recording, index).unwrap();
        }
        // A line with a valid time still has its depth.
        match depth_of(&recording, 1) {
            Ok(depth) => assert_eq!(depth.metres[0], 2.0),
            error => assert_says(error, &["rgb.txt:3: ", says]),
        }
    }
}

#[test]
fn wrong_lines_of_the_depth_list_are_told_where_they_are() {
    let scene = Scene::with_pairs(3);
    scene.write("depth.txt", "1.0 depth/0.png\n1.1 /depth/1.png\nsoon depth/2.png\n");
    assert_says(scene.open(), &["depth.txt:2: ", "points outside"]);
    let recording = scene.open_keep_going();
    // The second pairs by its time; the third has no time to pair by.
    assert_eq!((recording.len(), recording.unpaired().color, recording.unpaired().depth), (2, 1, 1));
    assert!(color_of(&recording, 1).is_ok());
    assert_says(depth_of(&recording, 1), &["depth.txt:2: ", "points outside"]);
}

#[test]
fn wrong_lines_of_the_associations_are_told_where_they_are() {
    let scene = Scene::with_pairs(4);
    scene.write(
        "associations.txt",
        "1.0 rgb/0.png 1.0 depth/0.png\n1.1 rgb/1.png depth/1.png\n1.2 rgb/2.png 1.2 ../depth/2.png\n1.3 rgb/3.png 1.3 depth/3.png\n",
    );
    assert_says(scene.open(), &["associations.txt:2: ", "`time file time file`", "3 column(s)"]);
    let recording = scene.open_keep_going();
    assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000, 300_000_000]);
    assert_says(color_of(&recording, 1), &["associations.txt:2: "]);
    assert_says(depth_of(&recording, 1), &["associations.txt:2: "]);
    assert!(color_of(&recording, 2).is_ok());
    assert_says(depth_of(&recording, 2), &["associations.txt:3: ", "points outside"]);
    assert!(depth_of(&recording, 3).is_ok());
}

/// Times are 64-bit nanoseconds; sums of them must not overflow.
#[test]
fn a_time_of_another_age_is_a_fault() {
    let scene = Scene::with_pairs(3);
    scene.remove("depth.txt");
    scene.write("rgb.txt", "0 rgb/0.png\n18446744073.7 rgb/1.png\n18446744073.709551615 rgb/2.png\n");
    assert_says(scene.open(), &["rgb.txt:1: ", "more than ten years from most"]);
    let recording = scene.open_keep_going();
    let readable: Vec<_> = (0..3).map(|index| color_of(&recording, index).is_ok()).collect();
    assert_eq!(readable, [false, true, true]);

    scene.write("rgb.txt", "0 rgb/0.png\n157680000 rgb/1.png\n315360000 rgb/2.png\n");
    let whole = PlayRange { looped: true, ..PlayRange::default() };
    let mut replay = Replay::new(std::sync::Arc::new(scene.open().unwrap()), "old", &whole).unwrap();
    let frames = replay.skip_until(u64::MAX);
    assert!((100..200).contains(&frames), "{frames}: round and round, to the end of time");
}

#[test]
fn one_wrong_date_does_not_cost_the_frames_after_it() {
    let scene = Scene::with_pairs(4);
    scene.remove("depth.txt");
    scene.write("rgb.txt", "1.0 rgb/0.png\n9999.0 rgb/1.png\n1.2 rgb/2.png\n1.3 rgb/3.png\n");
    assert_says(scene.open(), &["rgb.txt:2: ", "out of order"]);
    let recording = scene.open_keep_going();
    let readable: Vec<_> = (0..4).map(|index| color_of(&recording, index).is_ok()).collect();
    assert_eq!(readable, [true, false, true, true]);
    assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000, 300_000_000]);
}

/// Asserts the error of reading picture 1, a fault that opening the recording does not report.
fn assert_color_fault(scene: &Scene, says: &str) {
    assert_says(color_of(&scene.open().unwrap(), 1), &["rgb.txt:2: rgb/1.png: ", says, ";"]);
    assert!(color_of(&scene.open().unwrap(), 2).is_ok());
}

fn assert_depth_fault(scene: &Scene, says: &str) {
    assert_says(depth_of(&scene.open().unwrap(), 1), &["depth.txt:2: depth/1.png: ", says, ";"]);
    assert!(depth_of(&scene.open().unwrap(), 2).is_ok());
}

#[test]
fn a_missing_picture_is_told_when_it_is_read() {
    let scene = Scene::with_pairs(3);
    scene.remove("rgb/1.png");
    scene.remove("depth/1.png");
    assert_color_fault(&scene, "no such file");
    assert_depth_fault(&scene, "no such file");
}

#[test]
fn what_is_no_regular_file_is_not_opened() {
    let scene = Scene::with_pairs(3);
    scene.remove("rgb/1.png");
    fs::create_dir(scene.path("rgb/1.png")).unwrap();
    assert_color_fault(&scene, "not a regular file");
}

#[test]
fn a_link_out_of_the_recording_is_refused_and_one_inside_is_followed() {
    let (scene, elsewhere) = (Scene::with_pairs(3), Scene::with_pairs(3));
    scene.remove("rgb/1.png");
    symlink(elsewhere.path("rgb/1.png"), scene.path("rgb/1.png")).unwrap();
    assert_color_fault(&scene, "leads outside the recording; add --follow-links if you trust it");
    let follow_links = Options { follow_links: true, ..Options::default() };
    assert_eq!(color_of(&scene.open_with(&follow_links).unwrap(), 1).unwrap().rgb[0], 1);
    scene.remove("rgb/1.png");
    symlink("2.png", scene.path("rgb/1.png")).unwrap();
    assert_eq!(color_of(&scene.open().unwrap(), 1).unwrap().rgb[0], 2);
    // The recording itself may be reached through a symbolic link.
    symlink(scene.dir.path(), elsewhere.path("linked")).unwrap();
    let recording = Recording::open(&elsewhere.path("linked"), &Options::default()).unwrap();
    assert_eq!(color_of(&recording, 0).unwrap().size(), SIZE);
}

#[test]
fn a_picture_of_another_size_is_refused() {
    let scene = Scene::with_pairs(3);
    scene.color("rgb/1.png", (25, 16), 0);
    assert_color_fault(&scene, "25x16, and the recording began with 24x16");
}

#[test]
fn a_cut_png_is_told() {
    let scene = Scene::with_pairs(3);
    for (name, assert_fault) in
        [("rgb/1.png", assert_color_fault as fn(&Scene, &str)), ("depth/1.png", assert_depth_fault)]
    {
        let whole = fs::read(scene.path(name)).unwrap();
        for length in [0, 7, 20, 40, whole.len() - 30] {
            scene.write(name, &whole[..length]);
            assert_fault(&scene, "ends before the picture does");
        }
        scene.write(name, whole);
    }
}

#[test]
fn a_cut_jpeg_is_told_at_every_length() {
    let scene = Scene::with_pairs(3);
    let mut list = fs::read_to_string(scene.path("rgb.txt")).unwrap();
    list = list.replace("1.png", "1.jpg");
    scene.write("rgb.txt", list);
    scene.color("rgb/1.jpg", SIZE, 50);
    assert!(color_of(&scene.open().unwrap(), 1).is_ok());
    let whole = fs::read(scene.path("rgb/1.jpg")).unwrap();
    for length in (0..whole.len() - 1).step_by(7).chain([whole.len() - 1]) {
        scene.write("rgb/1.jpg", &whole[..length]);
        assert_says(color_of(&scene.open().unwrap(), 1), &["rgb.txt:2: rgb/1.jpg: the file ends before"]);
    }
    // Trailing garbage is harmless.
    scene.write("rgb/1.jpg", [&whole[..], b"rubbish"].concat());
    assert!(color_of(&scene.open().unwrap(), 1).is_ok());
}

#[test]
fn damage_is_told() {
    let scene = Scene::with_pairs(3);
    let mut file = fs::read(scene.path("rgb/1.png")).unwrap();
    let middle = file.len() / 2;
    file[middle..middle + 4].fill(0xA5);
    scene.write("rgb/1.png", file);
    assert_color_fault(&scene, "damaged");
    scene.write("rgb/1.png", b"a text rather than a picture");
    assert_color_fault(&scene, "not a PNG, JPEG, TIFF, WebP, BMP, PNM or GIF file");
}

#[test]
fn a_bomb_is_refused_from_its_header() {
    let scene = Scene::with_pairs(3);
    let sides = [(16385, 1), (1, 16385), (11000, 11000), (65535, 65535), (1 << 20, 1 << 20), (i32::MAX as u32, 3)];
    for (width, height) in sides {
        scene.write("rgb/1.png", png_that_claims(width, height));
        let what = "and at most 16384 a side and 120 megapixels are read; scale it down";
        assert_color_fault(&scene, &format!("claims {width}x{height} pixels, {what}"));
        scene.write("depth/1.png", png_that_claims(width, height));
        assert_depth_fault(&scene, &format!("claims {width}x{height} pixels"));
    }
    // A JPEG stores its size in the frame header.
    scene.color("rgb/bomb.jpg", SIZE, 0);
    let mut file = fs::read(scene.path("rgb/bomb.jpg")).unwrap();
    let header = file.windows(2).position(|pair| pair == [0xFF, 0xC0]).unwrap();
    file[header + 5..header + 9].copy_from_slice(&[0xEA, 0x60, 0xEA, 0x60]);
    scene.write("rgb/1.png", file);
    assert_color_fault(&scene, "claims 60000x60000 pixels");
}

#[test]
fn depth_is_16_bit_grey_or_refused() {
    let scene = Scene::with_pairs(3);
    save_grey(&scene.path("depth/1.png"), SIZE, 7);
    assert_depth_fault(&scene, "an 8-bit grey picture is not depth");
    scene.color("depth/1.png", SIZE, 0);
    assert_depth_fault(&scene, "a colour picture is not depth");
}

#[test]
fn the_size_is_that_of_the_first_readable_picture() {
    let scene = Scene::with_pairs(3);
    scene.remove("rgb/0.png");
    assert_eq!(scene.open().unwrap().size(), SIZE);
    for index in 1..3 {
        scene.write(&format!("rgb/{index}.png"), "");
    }
    assert_says(scene.open(), &["rgb.txt:1: rgb/0.png: ", "no such file"]);
}

#[test]
fn a_frame_beyond_the_end_is_an_error() {
    let recording = Scene::with_pairs(2);
    let recording = recording.open().unwrap();
    assert_says(color_of(&recording, 2), &["frame 2", "has 2"]);
    assert_says(depth_of(&recording, usize::MAX), &["has 2"]);
}

#[test]
fn after_a_fault_the_same_memory_reads_on() {
    let scene = Scene::with_pairs(3);
    scene.color("rgb/1.png", (100, 100), 0);
    let recording = scene.open().unwrap();
    let (mut scratch, mut image) = (Scratch::default(), ColorImage::default());
    let mut read = |index| recording.read_color(index, &mut scratch, &mut image).map(|()| image.clone());
    assert!(read(0).is_ok());
    assert!(matches!(read(1), Err(RecordingError::Listed { line: 2, .. })));
    let image = read(2).unwrap();
    assert!(image.rgb.chunks_exact(3).all(|pixel| pixel == [2, 100, 200]));
}

#[test]
fn recordings_and_scratch_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<Recording>();
    crosses::<Scratch>();
    crosses::<RecordingError>();
}
