//! Stereo sources on the command line: recordings and side-by-side pictures blurred by their disparity, and refusals.

use crate::planes;
use crate::program::{PORTRAIT, STEREO, run};

use std::fs;
use std::path::Path;

use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_media::recording::RecordingWriter;
use bokehcam_media::recording::{Options, Recording, Scratch};

fn path(folder: &Path) -> &str {
    folder.to_str().unwrap()
}

fn save(image: &ColorImage, to: &Path) {
    image::save_buffer(to, &image.rgb, image.width, image.height, image::ColorType::Rgb8).unwrap();
}

/// Creates a folder in Middlebury's layout: a square at 2.5 m before a wall at 10 m.
fn rectified_pair() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (left, right) = planes::seen();
    save(&left, &folder.path().join("im0.png"));
    let (width, height) = planes::SIZE;
    image::save_buffer(folder.path().join("im1.png"), &right.luma, width, height, image::ColorType::L8).unwrap();
    let calib = "cam0=[300 0 80; 0 300 60; 0 0 1]\ncam1=[300 0 80; 0 300 60; 0 0 1]\ndoffs=0\nbaseline=100\nwidth=160\n\
                 height=120\nndisp=16\n";
    fs::write(folder.path().join("calib.txt"), calib).unwrap();
    folder
}

/// Creates a recording of side-by-side pictures of the scene, with `more` additional columns.
fn side_by_side(more: u32) -> tempfile::TempDir {
    let (left, right) = planes::seen();
    recording_of(&left, &right, more)
}

/// Returns a photograph as a stereo pair with a disparity of 12 px; rectification checks need its many features.
fn photograph() -> (ColorImage, GrayImage) {
    const DISPARITY_PX: usize = 12;
    let recording = Recording::open(Path::new(PORTRAIT), &Options::default()).unwrap();
    let (mut left, mut right) = (ColorImage::default(), GrayImage::default());
    recording.read_color(0, &mut Scratch::default(), &mut left).unwrap();
    right.set_luma_from(&left);
    for row in right.luma.chunks_exact_mut(left.width as usize) {
        row.rotate_left(DISPARITY_PX);
    }
    (left, right)
}

fn recording_of(left: &ColorImage, right: &GrayImage, more: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (width, height) = (left.width as usize, left.height as usize);
    let mut wide = ColorImage::new(2 * left.width + more, left.height);
    let wide_px = wide.width as usize;
    for y in 0..height {
        wide.rgb[3 * y * wide_px..][..3 * width].copy_from_slice(&left.rgb[3 * y * width..][..3 * width]);
        for x in 0..width {
            wide.rgb[3 * (y * wide_px + width + x)..][..3].fill(right.luma[y * width + x]);
        }
    }
    let mut writer = RecordingWriter::create(&folder.path().join("wide"), false).unwrap();
    for frame in 0..2 {
        writer.add(frame * 33_000_000, &wide, None).unwrap();
    }
    writer.finish().unwrap();
    folder
}

/// Streams one frame in focus on the square; returns the blur of the square and of the wall.
fn blurred(source: &Path, more: &[&str]) -> (f64, f64) {
    let out = tempfile::tempdir().unwrap();
    let to = format!("{}/", path(&out.path().join("out")));
    let args = ["stream", path(source), "--to", &to, "--frames", "1", "--focus", "0.5,0.5", "--coc-at-infinity", "8"];
    run(&[&args[..], &["--backend", "cpu"], more].concat()).done();
    let written = Path::new(&to).join("000000.png");
    let picture = image::open(written).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), planes::SIZE);
    let sharp = planes::seen().0.rgb;
    let of = |inside| planes::difference(picture.as_raw(), &sharp, inside);
    (of(planes::is_well_inside), of(planes::is_well_outside))
}

#[test]
fn a_recording_with_two_eyes_is_blurred_by_their_disparity() {
    let pair = rectified_pair();
    for more in [&[][..], &["--depth", "stereo"], &["--focal-px", "200", "--baseline-m", "0.2"], &["--refine", "off"]] {
        let (near, far) = blurred(pair.path(), more);
        assert!(near < 3.0 && far > 15.0, "{more:?}: {near} in focus, {far} behind");
    }
    // Without a need for depth, nothing is matched.
    let (near, far) = blurred(pair.path(), &["--depth", "none", "--effect", "blur"]);
    assert!(near > 15.0 && far > 15.0, "{near}, {far}");
}

#[test]
fn pictures_with_both_eyes_are_split() {
    let wide = side_by_side(0);
    let (near, far) = blurred(&wide.path().join("wide"), &["--side-by-side", "--rectified"]);
    assert!(near < 3.0 && far > 15.0, "{near} in focus, {far} behind");
}

#[test]
fn a_pair_that_is_not_what_it_was_said_to_be_is_said_in_one_line() {
    let said = |change: &dyn Fn(&mut ColorImage, &mut GrayImage)| {
        let (mut left, mut right) = photograph();
        change(&mut left, &mut right);
        let folder = recording_of(&left, &right, 0);
        let source = folder.path().join("wide");
        let args = ["stream", path(&source), "--side-by-side", "--rectified", "--to", "null", "--backend", "cpu"];
        let ran = run(&args);
        ran.done().lines().filter(|line| line.starts_with("warning: ")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(said(&|_, _| {}), Vec::<String>::new());
    // The right camera is 5 rows lower.
    let lower = said(&|_, right| right.luma.rotate_left(5 * right.width as usize));
    assert!(lower.len() == 1 && lower[0].contains("not rectified") && lower[0].contains("--calib"), "{lower:?}");
    let exchanged = said(&|left, right| {
        let (was_left, was_right) = (left.clone(), right.clone());
        right.set_luma_from(&was_left);
        left.rgb = was_right.luma.iter().flat_map(|&luma| [luma; 3]).collect();
    });
    assert!(exchanged.len() == 1 && exchanged[0].contains("swapped"), "{exchanged:?}");
}

#[test]
fn metres_are_those_of_the_rig() {
    let pair = rectified_pair();
    let focused = |focus: &str| {
        let out = tempfile::tempdir().unwrap();
        let to = path(&out.path().join("out.y4m")).to_owned();
        run(&["stream", path(pair.path()), "--to", &to, "--focus", focus, "--backend", "cpu"]).done();
        fs::read(to).unwrap()
    };
    assert_ne!(focused("2.5"), focused("10"));

    let out = tempfile::tempdir().unwrap();
    let to = out.path().join("recorded");
    run(&["record", path(pair.path()), "--to", path(&to)]).done();
    let recorded = Recording::open(&to, &Options::default()).unwrap();
    let mut map = DepthMap::default();
    recorded.read_depth(0, &mut Scratch::default(), &mut map).unwrap();
    let at = |x: usize, y: usize| map.metres[y * map.width as usize + x];
    assert!((at(80, 60) - 2.5).abs() < 0.15 && (at(130, 20) - 10.0).abs() < 1.5, "{} {}", at(80, 60), at(130, 20));
}

#[test]
fn what_does_not_fit_two_eyes_costs_one_line_and_exit_code_2() {
    let (pair, wide, odd) = (rectified_pair(), side_by_side(0), side_by_side(1));
    let (pair, wide, odd) = (pair.path(), wide.path().join("wide"), odd.path().join("wide"));
    let cases: &[(&Path, &[&str], &str)] = &[
        (&wide, &["--depth", "stereo"], "has one camera"),
        ("synthetic".as_ref(), &["--depth", "stereo"], "has one camera"),
        ("synthetic".as_ref(), &["--side-by-side"], "--side-by-side"),
        (pair, &["--side-by-side"], "--side-by-side"),
        (&odd, &["--side-by-side", "--rectified"], "321x120"),
        (&wide, &["--side-by-side"], "--calib FILE, or --rectified"),
        (&wide, &["--side-by-side", "--focal-px", "300", "--baseline-m", "0.1"], "add --rectified"),
        (&wide, &["--side-by-side", "--rectified", "--focal-px", "300"], "both --focal-px and --baseline-m"),
        (&wide, &["--side-by-side", "--rectified", "--doffs-px", "3"], "both --focal-px and --baseline-m"),
        (&wide, &["--side-by-side", "--rectified", "--focus", "2"], "--focus 2 needs distances"),
        (
            &wide,
            &["--side-by-side", "--rectified", "--f-number", "2", "--focal-length", "50", "--sensor-width", "36"],
            "--f-number 2 needs distances",
        ),
        (&wide, &["--rectified"], "for stereo depth"),
        (&wide, &["--calib", "nowhere.yml"], "for stereo depth"),
        (pair, &["--max-disparity", "60"], "a multiple of 16"),
        (pair, &["--max-disparity", "272"], "a multiple of 16"),
        (pair, &["--baseline-m", "0"], "above 0"),
        (pair, &["--calib", "x.yml", "--focal-px", "9"], "--focal-px"),
        (pair, &["--depth", "stereo", "--effect", "blur"], "--effect dof"),
    ];
    for (source, more, said) in cases {
        run(&[&["stream", path(source), "--to", "null"], *more].concat()).refused(2, &[said]);
    }
}

/// The leaves before the portrait have disparities of up to 84 px, beyond the default range of a tenth of the width, 64
/// px.
#[test]
fn near_things_beyond_the_range_are_found_or_said() {
    let out = tempfile::tempdir().unwrap();
    let stream = |name: &str, more: &[&str]| {
        let to = out.path().join(name).join("");
        let all = ["stream", STEREO, "--depth", "stereo", "--frames", "2", "--backend", "cpu", "--to", path(&to)];
        let ran = run(&[&all, more].concat());
        let said = ran.done().to_owned();
        (fs::read(to.join("000001.png")).unwrap(), said)
    };
    let (found, said) = stream("default", &[]);
    let (wide, _) = stream("wide", &["--max-disparity", "96"]);
    assert!(found == wide && !said.contains("disparit"), "{said}");
    let (narrow, said) = stream("narrow", &["--max-disparity", "64"]);
    assert!(narrow != wide && said.contains("more than the 64 that are searched"), "{said}");
    assert!(said.contains("use --max-disparity 96"), "{said}");
}

#[test]
fn a_calibration_that_cannot_be_read_is_named() {
    let wide = side_by_side(0);
    let wide = wide.path().join("wide");
    let nowhere = ["stream", path(&wide), "--to", "null", "--side-by-side", "--calib", "nowhere.yml"];
    run(&nowhere).refused(1, &["nowhere.yml"]);
    // Exchanged cameras, millimetres, and an unknown picture size still give a single line.
    let calib = wide.with_file_name("calib.yml");
    let camera =
        "!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [300., 0., 80., 0., 300., 60., 0., 0., 1.]\n";
    let none = "!!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [0., 0., 0., 0., 0.]\n";
    let rotation = "!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]\n";
    let with = |x_mm: i32| {
        let place = format!("!!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [{x_mm}., 0., 0.]\n");
        let text = format!("%YAML:1.0\n---\nM1: {camera}D1: {none}M2: {camera}D2: {none}R: {rotation}T: {place}");
        fs::write(&calib, text).unwrap();
        run(&["stream", path(&wide), "--to", "null", "--side-by-side", "--calib", path(&calib), "--focus", "2"])
    };
    with(100).refused(1, &["swap"]);
    let good = with(-100);
    assert!(good.done().contains("assuming millimetres"), "{}", good.stderr);
    // Centimetres, and squares of the chessboard.
    for length in [-6, -1] {
        let doubted = with(length);
        assert!(
            doubted.done().contains("implausible") && doubted.stderr.contains("--baseline-m"),
            "{}",
            doubted.stderr
        );
    }
}

#[test]
#[cfg(feature = "camera")]
fn two_cameras_are_two_cameras() {
    let cases: &[(&[&str], i32, &str)] = &[
        (&["/dev/null,/dev/null", "--rectified"], 2, "the same camera"),
        (&["/dev/null,/dev/nothing", "--rectified"], 1, "/dev/nothing"),
        (&["nowhere,elsewhere"], 1, "LEFT,RIGHT"),
        (&["/dev/null,/dev/zero", "--rectified", "--pace", "asap"], 2, "leave --pace out"),
        // Devices that are not cameras.
        (&["/dev/null,/dev/zero", "--rectified"], 1, "/dev/null: this is not a camera"),
    ];
    for (args, code, said) in cases {
        run(&[&["stream", "--to", "null"], *args].concat()).refused(*code, &[said]);
    }
}

#[test]
fn a_folder_with_a_comma_is_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let with_comma = folder.path().join("left,right");
    fs::create_dir(&with_comma).unwrap();
    let pair = rectified_pair();
    for entry in fs::read_dir(pair.path()).unwrap() {
        let entry = entry.unwrap().path();
        fs::copy(&entry, with_comma.join(entry.file_name().unwrap())).unwrap();
    }
    run(&["stream", path(&with_comma), "--to", "null", "--quiet"]).done();
}
