//! The command `depth`: output, messages and refusals.

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam_media::recording::still::{read_depth, read_disparity};
use image::GrayImage;

use crate::common::grain;
use crate::program::{Home, Ran, STEREO};

const SIZE: (u32, u32) = (160, 64);
/// Disparity of the wall, in pixels.
const WALL_PX: u32 = 8;

/// A folder with a stereo pair of a wall of noise at a disparity of 8 px.
struct Desk {
    home: Home,
}

impl Desk {
    fn new() -> Self {
        let desk = Self { home: Home::new() };
        desk.save("left.png", SIZE, 0);
        desk.save("right.png", SIZE, WALL_PX);
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path(name)
    }

    fn save(&self, name: &str, (width, height): (u32, u32), shift_px: u32) {
        let noise = GrayImage::from_fn(width, height, |x, y| [grain(x + shift_px, y)].into());
        noise.save(self.path(name)).unwrap();
    }

    /// Runs `depth left.png right.png` on the CPU with `more`, in the folder.
    fn run(&self, more: &[&str]) -> Ran {
        self.run_any(&[&["depth", "left.png", "right.png", "--backend", "cpu"], more].concat())
    }

    /// Runs any command.
    fn run_any(&self, args: &[&str]) -> Ran {
        let ran = self.home.run(args);
        assert!(ran.stdout.is_empty(), "results go to files");
        ran
    }

    #[track_caller]
    fn assert_written(&self, more: &[&str]) -> String {
        self.run(more).done().to_owned()
    }

    #[track_caller]
    fn assert_refused(&self, more: &[&str], code: i32, says: &str) {
        let ran = self.run(more);
        assert_eq!((ran.code, ran.stderr.lines().filter(|line| !line.starts_with("note: ")).count()), (code, 1));
        assert!(ran.stderr.contains("error: ") && ran.stderr.contains(says), "{says:?} is not in: {}", ran.stderr);
    }
}

/// Returns the median of the area that both cameras see, away from the borders.
fn median(values: &[f32]) -> f32 {
    let rows = values.chunks_exact(SIZE.0 as usize).skip(8).take(48);
    let mut inner: Vec<f32> = rows.flat_map(|row| row[40..150].iter().copied()).collect();
    inner.sort_unstable_by(f32::total_cmp);
    inner[inner.len() / 2]
}

fn disparity(path: &Path) -> Vec<f32> {
    let map = read_disparity(path).unwrap();
    assert_eq!(map.size(), SIZE);
    map.px
}

#[test]
fn a_wall_has_the_disparity_that_it_was_given() {
    let desk = Desk::new();
    for effort in ["full", "fast"] {
        let said = desk.assert_written(&["--out", "d.pfm", "--max-disparity", "32", "--effort", effort, "--force"]);
        let px = median(&disparity(&desk.path("d.pfm")));
        assert!((px - WALL_PX as f32).abs() < 0.5, "{effort}: {px}");
        assert_eq!(said.lines().count(), 1, "{said}");
        for part in ["d.pfm: written (160x64, 32 disparities, ", " ms, cpu"] {
            assert!(said.contains(part), "{part:?} is not in: {said}");
        }
    }
    desk.assert_written(&["--out", "d.png", "--max-disparity", "32"]);
    let wide = image::open(desk.path("d.png")).unwrap().into_luma16();
    let units: Vec<f32> = wide.as_raw().iter().map(|&units| f32::from(units)).collect();
    assert!((median(&units) / 256.0 - WALL_PX as f32).abs() < 0.5);
}

/// `render` reads the output of `depth` with the right meaning.
#[test]
fn render_takes_disparity_for_what_it_is() {
    let desk = Desk::new();
    let geometry = ["--focal-px", "100", "--baseline-m", "0.08"];
    // 100 px x 0.08 m / 8 px
    for (out, more) in [("d.png", &geometry[..]), ("plain.png", &[]), ("plain.pfm", &geometry)] {
        desk.assert_written(&[&["--out", out][..], more].concat());
    }
    desk.assert_written(&[&["--out", "z.png", "--metres"][..], &geometry].concat());
    let render = |depth: &str, more: &[&str]| {
        let args = ["render", "left.png", "--depth-map", depth, "--backend", "cpu", "--out", "blurred.png", "--force"];
        desk.run_any(&[&args[..], more].concat())
    };
    let blurred = || fs::read(desk.path("blurred.png")).unwrap();
    let by_metres = render("z.png", &["--focus", "1", "--refine", "off"]);
    assert_eq!((by_metres.code, by_metres.stderr.lines().count()), (0, 1), "{}", by_metres.stderr);
    let from_metres = image::load_from_memory(&blurred()).unwrap().into_rgb8();
    let by_disparity = render("d.png", &["--focus", "1", "--refine", "off"]);
    assert_eq!((by_disparity.code, by_disparity.stderr.lines().count()), (0, 1), "{}", by_disparity.stderr);
    let from_disparity = image::load_from_memory(&blurred()).unwrap().into_rgb8();
    let off: f64 = from_metres.iter().zip(from_disparity.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    assert!(off / (from_metres.len() as f64) < 1.0, "the same distances, the same blur");
    for file in ["plain.png", "plain.pfm"] {
        let ran = render(file, &["--focus", "auto"]);
        assert!(ran.code == 0 && ran.stderr.contains("contains disparity without a scale"), "{}", ran.stderr);
        let ran = render(file, &["--focus", "2"]);
        assert!(ran.code == 2 && ran.stderr.contains("--focus 2 needs distances"), "{}", ran.stderr);
        assert!(ran.stderr.contains(file) && ran.stderr.contains("depth --metres"), "{}", ran.stderr);
    }
}

#[test]
fn metres_follow_the_geometry_however_it_is_given() {
    let desk = Desk::new();
    fs::write(
        desk.path("middlebury.txt"),
        "cam0=[100 0 80; 0 100 32; 0 0 1]\ncam1=[100 0 82; 0 100 32; 0 0 1]\ndoffs=2\nbaseline=100\nwidth=160\n\
         height=64\nndisp=30\n",
    )
    .unwrap();
    fs::write(desk.path("kitti.txt"), "P0: 100 0 80 0 0 100 32 0 0 0 1 0\nP1: 100 0 82 -10 0 100 32 0 0 0 1 0\nR: 1\n")
        .unwrap();
    let plain = ["--focal-px", "100", "--baseline-m", "0.1", "--doffs-px", "2"];
    for (geometry, says) in [
        (&["--calib", "middlebury.txt"][..], "note: 32 disparities (the calibration's)"),
        (&["--calib", "kitti.txt"], "note: 64 disparities (assumed: --max-disparity says how many)"),
        (&plain, "note: 64 disparities (assumed"),
    ] {
        for (out, tolerance_m) in [("z.pfm", 0.05), ("z.png", 0.05)] {
            let said = desk.assert_written(&[geometry, &["--metres", "--out", out, "--force"]].concat());
            assert!(said.contains(says), "{says:?} is not in: {said}");
            // 100 px x 0.1 m / (8 + 2) px
            let metres = median(&read_depth(&desk.path(out), 5000.0, None).unwrap().metres);
            assert!((metres - 1.0).abs() < tolerance_m, "{geometry:?}: {metres} m");
        }
    }
    // A calibration for twice the picture size is scaled to these pictures.
    let double = "cam0=[200 0 160; 0 200 64; 0 0 1]\ndoffs=4\nbaseline=100\nwidth=320\nheight=128\nndisp=60\n";
    fs::write(desk.path("double.txt"), double).unwrap();
    let said = desk.assert_written(&["--calib", "double.txt", "--metres", "--out", "z.pfm", "--force"]);
    assert!(said.contains("double.txt is for pictures of 320x128: scaled to 160x64"), "{said}");
    assert!((median(&read_depth(&desk.path("z.pfm"), 5000.0, None).unwrap().metres) - 1.0).abs() < 0.05);
    // Another baseline scales all depth.
    for (calib, baseline_m) in [("middlebury.txt", "0.05"), ("kitti.txt", "0.2"), ("double.txt", "0.3")] {
        let more = ["--baseline-m", baseline_m, "--metres", "--out", "z.pfm", "--force"];
        let said = desk.assert_written(&[&["--calib", calib][..], &more].concat());
        let wanted_m: f32 = baseline_m.parse().unwrap();
        let mm = format!("note: the cameras are {:.1} mm apart (--baseline-m)", wanted_m * 1e3);
        assert!(said.contains(&mm), "{said}");
        let metres = median(&read_depth(&desk.path("z.pfm"), 5000.0, None).unwrap().metres);
        assert!((metres - 10.0 * wanted_m).abs() < 0.5 * wanted_m, "{calib}, {baseline_m} m: {metres} m");
    }
    // Depths beyond a PNG's range are reported.
    let said = desk.assert_written(&["--focal-px", "2000", "--baseline-m", "9", "--metres", "--out", "far.png"]);
    assert!(said.contains("beyond 13.1 m"), "{said}");
}

#[test]
fn a_preview_shows_it_in_colours_and_nothing_is_overwritten_unasked() {
    let desk = Desk::new();
    let args = ["--out", "d.pfm", "--max-disparity", "16", "--preview", "d.png"];
    assert!(desk.assert_written(&[&args[..], &["-q"]].concat()).is_empty());
    let picture = image::open(desk.path("d.png")).unwrap();
    assert_eq!((picture.width(), picture.height(), picture.color()), (160, 64, image::ColorType::Rgb8));
    desk.assert_refused(&args, 1, "d.pfm exists");
    fs::remove_file(desk.path("d.pfm")).unwrap();
    desk.assert_refused(&args, 1, "d.png exists");
    assert!(!desk.path("d.pfm").exists());
    desk.assert_written(&[&args[..], &["--force"]].concat());
}

#[test]
fn the_range_is_rounded_up_and_fits_the_pictures() {
    let desk = Desk::new();
    let said = desk.assert_written(&["--out", "a.pfm", "--max-disparity", "33"]);
    assert!(said.starts_with("note: --max-disparity 33 is rounded up to 48, a multiple of 16\n"), "{said}");
    desk.assert_refused(&["--out", "b.pfm", "--max-disparity", "150"], 2, "160 px wide: use at most 144");
    desk.assert_refused(&["--out", "b.pfm", "--max-disparity", "0"], 2, "from 1 to 256");
    desk.assert_refused(&["--out", "b.pfm", "--max-disparity", "257"], 2, "from 1 to 256");
    for name in ["left.png", "right.png"] {
        desk.save(name, (40, 16), 0);
    }
    let said = desk.assert_written(&["--out", "b.pfm"]);
    assert!(said.contains("at most 32 can be searched"), "{said}");
    for name in ["left.png", "right.png"] {
        desk.save(name, (16, 16), 0);
    }
    desk.assert_refused(&["--out", "c.pfm"], 2, "16 px wide, and matching needs 17");
}

#[test]
fn what_does_not_fit_is_refused_in_one_line() {
    let desk = Desk::new();
    let cases: [(&[&str], &str); 11] = [
        (&[], "--out"),
        (&["--out", "d.jpg"], "--out FILE ends with .pfm or .png"),
        (&["--out", "d.pfm", "--preview", "d.gif"], "--preview FILE.png"),
        (&["--out", "d.png", "--preview", "d.png"], "name the same file"),
        // Every command would take the colours for depth.
        (
            &["--out", "d.pfm", "--preview", "left-depth.png"],
            "the depth map of left.png; use another, such as left-preview.png",
        ),
        (&["--out", "d.pfm", "--preview", "./right.depth.png"], "the depth map of right.png"),
        (&["--out", "d.pfm", "--metres"], "--metres needs the stereo geometry: give --calib FILE"),
        (&["--out", "d.pfm", "--focal-px", "700"], "--baseline-m"),
        (&["--out", "d.pfm", "--baseline-m", "0.1"], "--baseline-m needs --focal-px, or --calib FILE"),
        (&["--out", "d.pfm", "--focal-px", "0", "--baseline-m", "1"], "above 0"),
        (&["--out", "d.pfm", "--calib", "c.txt", "--focal-px", "7", "--baseline-m", "1"], "cannot be used with"),
    ];
    for (more, says) in cases {
        desk.assert_refused(more, 2, says);
    }
    for (calib, says) in [
        ("doffs=0\nbaseline=100\n", "c.txt: the key cam0 is missing"),
        ("cam0=[100 0 80; 0 100 32; 0 0 1]\ndoffs=0\n", "c.txt: the key baseline is missing"),
        ("cam0=[100 0 80; 0 100 32; 0 0 1]\ndoffs=0\nbaseline=0\n", "c.txt:3: the baseline is 0"),
        ("P0: 1 2 3\nP1: 4\n", "c.txt:1: P0: \"1 2 3\" is not a projection"),
        ("P2: 100 0 80 0 0 100 32 0 0 0 1 0\n", "c.txt: the key P0 is missing"),
        ("hello\n", "c.txt: not a stereo calibration that is read; the formats are OpenCV"),
        (
            "cam0=[100 0 80; 0 100 32; 0 0 1]\ndoffs=0\nbaseline=9\nwidth=160\nheight=80\n",
            "c.txt: made for pictures of 160x80, but these are 160x64",
        ),
    ] {
        fs::write(desk.path("c.txt"), calib).unwrap();
        desk.assert_refused(&["--out", "d.pfm", "--calib", "c.txt"], 1, says);
    }
    desk.assert_refused(&["--out", "d.pfm", "--calib", "none.txt"], 1, "none.txt: there is no such file");
    desk.save("right.png", (160, 65), 0);
    desk.assert_refused(&["--out", "d.pfm"], 1, "the left picture is 160x64, and the right one 160x65");
    fs::remove_file(desk.path("right.png")).unwrap();
    desk.assert_refused(&["--out", "d.pfm"], 1, "right.png: there is no such file");
    assert!(!desk.path("d.pfm").exists());
}

#[test]
fn a_pair_that_is_none_is_said() {
    let desk = Desk::new();
    let bundled = |eye: &str| Path::new(STEREO).join(eye).join("000000.png");
    let save = |left: &str, right: &str, rows: i64| {
        fs::copy(bundled(left), desk.path("left.png")).unwrap();
        let eye = image::open(bundled(right)).unwrap().into_luma8();
        let mut moved = GrayImage::new(eye.width(), eye.height());
        image::imageops::replace(&mut moved, &eye, 0, rows);
        moved.save(desk.path("right.png")).unwrap();
    };
    for (left, right, rows, said) in [
        ("image_2", "image_3", 0, None),
        ("image_2", "image_3", 4, Some("rows are off by")),
        ("image_3", "image_2", 0, Some("left and right are swapped")),
    ] {
        save(left, right, rows);
        let ran = desk.run(&["--out", "out.pfm", "--max-disparity", "96", "--force"]);
        match said {
            Some(said) => assert!(ran.done().contains(said), "{said}: {}", ran.stderr),
            None => {
                assert!(!ran.done().contains("note: the pair") && !ran.stderr.contains("exchanged"), "{}", ran.stderr)
            }
        }
    }
}
