//! What is behind the subject: nothing, and videos.

use std::fs;
use std::path::Path;
use std::process::Command;

use image::{DynamicImage, GrayImage, Luma, Rgb, RgbImage, RgbaImage};

use crate::program::{Home, Ran};

/// Width and height of all pictures.
const SIZE: (u32, u32) = (96, 64);
const GREEN: [u8; 3] = [0, 177, 64];

/// Whether a pixel shows the person.
fn is_person(x: u32, y: u32) -> bool {
    (30..66).contains(&x) && y > 20
}

/// Creates a photo of a reddish person before a bluish wall, its mask, and its depth.
fn photo(home: &Home) {
    let shade = |x: u32, y: u32| ((x * 7 + y * 5) % 40) as u8;
    RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| match is_person(x, y) {
        true => Rgb([190 + shade(x, y), 80, 60]),
        false => Rgb([30, 60, 120 + shade(y, x)]),
    })
    .save(home.path("in.png"))
    .unwrap();
    let mask = GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| Luma([if is_person(x, y) { 255 } else { 0 }]));
    mask.save(home.path("mask.png")).unwrap();
    let depth =
        image::ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| Luma([if is_person(x, y) { 5000_u16 } else { 25_000 }]));
    depth.save(home.path("in-depth.png")).unwrap();
}

/// Renders the photo with its mask.
fn render(home: &Home, behind: &str, out: &str, more: &[&str]) -> Ran {
    let args = ["render", "in.png", "--behind", behind, "--out", out, "--backend", "cpu", "--force"];
    home.run(&[&args[..], more].concat())
}

fn rgba(path: impl AsRef<Path>) -> RgbaImage {
    let picture = image::open(path.as_ref()).unwrap();
    assert!(matches!(picture, DynamicImage::ImageRgba8(_)), "{}", path.as_ref().display());
    picture.into_rgba8()
}

fn linear(code: u8) -> f64 {
    let code = f64::from(code) / 255.0;
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn a_cut_out_over_a_colour_is_the_picture_before_that_colour() {
    let home = Home::new();
    photo(&home);
    for more in [
        &["--mask", "mask.png", "--mask-feather", "4"][..],
        &["--focus", "0.5,0.9"],
        &["--focus", "0.5,0.9", "--blur", "9"],
    ] {
        render(&home, "transparent", "cut.png", more).done();
        render(&home, "green", "green.png", more).done();
        let (cut, green) = (rgba(home.path("cut.png")), image::open(home.path("green.png")).unwrap().into_rgb8());
        let mut partial = 0;
        for ((x, y, pixel), due) in cut.enumerate_pixels().zip(green.pixels()) {
            let alpha = f64::from(pixel[3]) / 255.0;
            partial += usize::from(pixel[3] > 0 && pixel[3] < 255);
            for channel in 0..3 {
                let over = alpha * linear(pixel[channel]) + (1.0 - alpha) * linear(GREEN[channel]);
                let off = (over - linear(due[channel])).abs();
                assert!(off < 0.02, "{more:?}: {x},{y}: {pixel:?} over green is not {due:?}");
            }
        }
        let at = |x, y| cut.get_pixel(x, y).0;
        assert_eq!((at(48, 50)[3], at(5, 5)), (255, [0; 4]), "{more:?}");
        if more.contains(&"--mask-feather") {
            assert!(partial > 50, "{partial} pixels are partly transparent");
        }
    }
}

#[test]
fn without_depth_all_of_a_picture_is_kept_and_that_is_said() {
    let home = Home::new();
    photo(&home);
    let said = render(&home, "transparent", "cut.png", &["--effect", "blur"]).warning().to_owned();
    assert!(said.contains("--behind transparent"), "{said}");
    assert!(matches!(image::open(home.path("cut.png")).unwrap(), DynamicImage::ImageRgb8(_)));
}

#[test]
fn what_keeps_no_transparency_is_refused_with_what_does() {
    let home = Home::new();
    photo(&home);
    home.run(&["render", "in.png", "--behind", "transparent", "--out", "cut.jpg"]).refused(2, &["cut.jpg", ".png"]);
    for to in ["cut.mp4", "cut.mkv", "cut.y4m", "-", "/dev/video99", "pipewire"] {
        let args = ["stream", "in.png", "--behind", "transparent", "--to", "null", "--to", to];
        home.run(&args).refused(2, &["--behind transparent", to, "FILE.webm", "FILE.mov", "DIR/"]);
    }
    assert!(!home.path("cut.mp4").exists());
    // Many pictures: each result is a PNG.
    fs::create_dir(home.path("photos")).unwrap();
    image::open(home.path("in.png")).unwrap().into_rgb8().save(home.path("photos/one.jpg")).unwrap();
    fs::copy(home.path("in-depth.png"), home.path("photos/one-depth.png")).unwrap();
    home.run(&["render", "photos", "--behind", "transparent", "--focus", "0.5,0.9", "--out", "cut/"]).done();
    assert_eq!(rgba(home.path("cut/one.png")).get_pixel(48, 50).0[3], 255);
}

#[test]
fn numbered_pictures_have_the_alpha_of_a_still_also_cut_and_mirrored() {
    let home = Home::new();
    photo(&home);
    let stream = |to: &[&str], more: &[&str]| {
        let args = ["stream", "in.png", "--behind", "transparent", "--focus", "0.5,0.9", "--backend", "cpu", "-q"];
        home.run(&[&args[..], to, more].concat()).done();
    };
    stream(&["--to", "one/", "--to", "two/"], &[]);
    stream(&["--to", "mirrored/"], &["--mirror"]);
    let [one, two, mirrored] = ["one", "two", "mirrored"].map(|folder| rgba(home.path(folder).join("000000.png")));
    assert!(one == two && image::imageops::flip_horizontal(&one) == mirrored);
    assert_eq!((one.get_pixel(48, 50).0[3], one.get_pixel(5, 5).0), (255, [0; 4]));
}

/// Returns the pictures of a video with their alpha.
fn decode(home: &Home, file: &str, decoder: &[&str]) -> Vec<RgbaImage> {
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error"]).args(decoder).arg("-i").arg(home.path(file));
    let output = ffmpeg.args(["-f", "rawvideo", "-pix_fmt", "rgba", "pipe:1"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = 4 * SIZE.0 as usize * SIZE.1 as usize;
    output
        .stdout
        .chunks_exact(bytes)
        .map(|bytes| RgbaImage::from_raw(SIZE.0, SIZE.1, bytes.to_vec()).unwrap())
        .collect()
}

#[test]
#[ignore = "needs ffmpeg"]
fn videos_keep_the_alpha_of_the_pictures() {
    let home = Home::new();
    photo(&home);
    let args = ["stream", "in.png", "--behind", "transparent", "--focus", "0.5,0.9", "--loop", "--frames", "5", "-q"];
    let all = ["--to", "out/", "--to", "cut.webm", "--to", "cut.mov", "--backend", "cpu"];
    home.run(&[&args[..], &all].concat()).done();
    let expected = rgba(home.path("out/000000.png"));
    for (file, decoder) in [("cut.webm", &["-c:v", "libvpx-vp9"][..]), ("cut.mov", &[])] {
        let pictures = decode(&home, file, decoder);
        assert_eq!(pictures.len(), 5, "{file}");
        for picture in pictures {
            let pairs = || picture.pixels().zip(expected.pixels());
            let alpha_off: u64 = pairs().map(|(a, b)| u64::from(a.0[3].abs_diff(b.0[3]))).sum();
            assert!(alpha_off as f64 / f64::from(SIZE.0 * SIZE.1) < 2.0, "{file}: {alpha_off}");
            let inside = picture.get_pixel(48, 50).0.into_iter().zip(expected.get_pixel(48, 50).0);
            assert!(inside.clone().all(|(a, b)| a.abs_diff(b) < 24), "{file}: {:?}", inside.collect::<Vec<_>>());
        }
    }
}

/// Creates a video of two seconds at 10 frames per second: the first is red, the second blue.
fn clip(home: &Home) {
    let colors = "color=red:s=48x32:r=10:d=1[a];color=blue:s=48x32:r=10:d=1[b];[a][b]concat";
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", colors, "-c:v", "libx264", "-pix_fmt", "yuv420p", "-g", "5"]);
    Ran::of(ffmpeg.arg(home.path("clip.mp4"))).done();
}

/// Streams the photo for as many frames, ten a second, into a folder; returns the colours in a corner, and stderr.
fn corners(home: &Home, frames: &str, video: &str, to: &str) -> (Vec<char>, String) {
    let behind = format!("video:{video}");
    let args = ["stream", "in.png", "--loop", "--frames", frames, "--focus", "0.5,0.9", "--backend", "cpu"];
    let ran = home.run(&[&args[..], &["--behind", &behind, "--to", to]].concat());
    let said = ran.done().to_owned();
    let mut files: Vec<_> = fs::read_dir(home.path(to)).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "png"));
    files.sort();
    let corner = |file| match image::open(file).unwrap().into_rgb8().get_pixel(4, 4).0 {
        [200..=255, ..60, ..60] => 'r',
        [..60, ..60, 200..=255] => 'b',
        _ => '?',
    };
    (files.into_iter().map(corner).collect(), said)
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_behind_plays_at_its_own_rate_in_a_loop() {
    let home = Home::new();
    photo(&home);
    clip(&home);
    // The photo's frames come every 100 ms, like the video's.
    let (seen, _) = corners(&home, "45", "clip.mp4", "one/");
    let expected: Vec<char> = (0..45).map(|frame| if frame % 20 < 10 { 'r' } else { 'b' }).collect();
    assert_eq!(seen, expected);
    assert_eq!(corners(&home, "45", "clip.mp4", "two/").0, seen);
    for file in ["000003.png", "000033.png"] {
        let [one, two] = ["one", "two"].map(|folder| fs::read(home.path(folder).join(file)).unwrap());
        assert!(one == two, "{file}: every run gives the same");
    }
    let said = render(&home, "video:clip.mp4", "still.png", &["--focus", "0.5,0.9"]).done().to_owned();
    assert!(said.contains("first frame"), "{said}");
    let corner = image::open(home.path("still.png")).unwrap().into_rgb8().get_pixel(4, 4).0;
    assert!(matches!(corner, [200..=255, ..60, ..60]), "{corner:?}");
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_damaged_video_stays_on_its_last_picture_and_no_video_is_one_line() {
    let home = Home::new();
    photo(&home);
    clip(&home);
    // Matroska can be read up to where it ends.
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args([
        "-v",
        "error",
        "-f",
        "lavfi",
        "-i",
        "testsrc2=s=320x240:r=10:d=3",
        "-c:v",
        "mpeg4",
        "-q:v",
        "3",
        "-g",
        "5",
    ]);
    Ran::of(ffmpeg.arg(home.path("whole.avi"))).done();
    let bytes = fs::read(home.path("whole.avi")).unwrap();
    fs::write(home.path("cut.avi"), &bytes[..bytes.len() / 2]).unwrap();
    let (seen, said) = corners(&home, "60", "cut.avi", "cut/");
    let warnings: Vec<&str> = said.lines().filter(|line| line.contains("cut.avi")).collect();
    assert!(seen.len() == 60 && warnings.len() == 1, "{said}");
    assert!(warnings[0].contains("its last picture stays"), "{said}");
    let [late, later] = ["000050.png", "000059.png"].map(|file| fs::read(home.path("cut").join(file)).unwrap());
    assert!(late == later, "the last picture stays");

    fs::write(home.path("none.mp4"), b"no video").unwrap();
    for (file, said) in [("gone.mp4", "there is no such file"), ("none.mp4", "none.mp4")] {
        let behind = format!("video:{file}");
        home.run(&["stream", "in.png", "--behind", &behind, "--to", "null"]).refused(1, &["--behind", file, said]);
    }
    home.run(&["stream", "in.png", "--behind", "video:clip.mp4", "--to", "clip.mp4", "--force"])
        .refused(2, &["which is the input"]);
}
