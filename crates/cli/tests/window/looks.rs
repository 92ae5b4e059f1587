//! Changing the look by gestures on the picture, and saving the result.

use std::fs;
use std::path::Path;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::read_color;

use super::picture::{distance, is_photograph, middle, part};
use super::preview::Program;
use super::program::{Home, PORTRAIT, Ran};
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// Loops one frame, in which the person is in focus, without controls over it.
const ONE_FRAME: [&str; 7] = ["--start", "0", "--end", "0.05", "--panel=false", "--quality", "balanced"];

fn start<'a>(screen: &'a Screen, more: &[&str]) -> (Program<'a>, Window<'a>) {
    let arguments: Vec<&str> = [PORTRAIT].iter().chain(&ONE_FRAME).chain(more).copied().collect();
    let mut program = Program::start(screen, &arguments);
    let window = program.window();
    window.until("the first picture", is_photograph);
    (program, window)
}

/// An area of the recording: centre and size, as fractions of width and height.
type Place = ((f64, f64), (f64, f64));
const LEAVES: Place = ((0.18, 0.80), (0.14, 0.20));
const FACE: Place = ((0.53, 0.45), (0.12, 0.16));

/// Measures detail: the mean difference between adjacent pixels.
fn detail(image: &ColorImage, ((x, y), (width, height)): Place) -> f64 {
    let px = |share: f64, all: u32| (share * f64::from(all)).round() as u32;
    let size = (px(width, image.width), px(height, image.height));
    let cut = part(image, (px(x, image.width) - size.0 / 2, px(y, image.height) - size.1 / 2), size);
    let next = part(&cut, (1, 0), (cut.width - 1, cut.height));
    distance(&next, &part(&cut, (0, 0), next.size()))
}

#[test]
#[ignore = "needs an X server"]
fn a_click_focuses_there_and_a_double_click_follows_what_was_clicked() {
    let screen = Screen::new();
    let (program, window) = start(&screen, &[]);
    let before = window.until("the face is sharp", |image| detail(image, FACE) > 1.3 * detail(image, LEAVES));
    window.click(LEAVES.0, 1);
    window.until("the leaves are sharp and the face is not", |image| {
        detail(image, LEAVES) > 1.5 * detail(&before, LEAVES) && detail(image, FACE) < 0.9 * detail(&before, FACE)
    });
    window.click(FACE.0, 2);
    window.until("the face is sharp again", |image| {
        detail(image, FACE) > 0.95 * detail(&before, FACE) && detail(image, LEAVES) < 1.1 * detail(&before, LEAVES)
    });
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn the_wheel_blurs_more_and_less_and_undo_goes_back() {
    const WALL: Place = ((0.68, 0.62), (0.10, 0.14));
    let screen = Screen::new();
    let (program, window) = start(&screen, &["--effect", "blur"]);
    let before = window.until("a picture", is_photograph);
    window.wheel(WALL.0, 6);
    let changed = |image: &ColorImage, factor: f64| {
        let change = detail(image, WALL) / detail(&before, WALL);
        if factor < 1.0 { change < factor } else { change > factor }
    };
    let up = window.until("another blur", |image| changed(image, 0.93) || changed(image, 1.07));
    window.wheel(WALL.0, -6);
    // Notes and controls come and go around the middle.
    let off = |image: &ColorImage| distance(&middle(image), &middle(&before));
    window.until("about as before", |image| off(image) < 0.35 * off(&up));
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn the_line_between_before_and_after_is_dragged() {
    const RIGHT_OF_IT: Place = ((0.62, 0.35), (0.06, 0.20));
    let screen = Screen::new();
    let (program, window) = start(&screen, &["--split", "0.5", "--coc-at-infinity", "5%"]);
    let before = window.until("a picture", is_photograph);
    window.drag((0.5, 0.6), (0.8, 0.6));
    window.until("what the line passed is sharp", |image| {
        detail(image, RIGHT_OF_IT) > 1.2 * detail(&before, RIGHT_OF_IT)
    });
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_snapshot_is_repeated_by_render_and_a_copied_command_runs() {
    let screen = Screen::new();
    // A user whose snapshots keep their sources.
    let home = Home::new();
    let state = home.path("state/bokehcam");
    fs::create_dir_all(&state).unwrap();
    fs::write(state.join("window.toml"), "[habits]\nkeep-sources = true\n").unwrap();
    // A snapshot has its own frame, but not the background that earlier frames left in memory.
    let options = ["-vv", "--backend", "cpu", "--background-memory=off"];
    let arguments: Vec<&str> = [PORTRAIT].iter().chain(&ONE_FRAME).chain(&options).copied().collect();
    let mut program = Program::start_at(&screen, home, &arguments);
    let window = program.window();
    window.until("the first picture", is_photograph);
    window.key(&[], u32::from('2'));
    until("its executor", PATIENCE, || program.said().contains("an executor was made"));
    // Wait for a frame in the new look, too.
    std::thread::sleep(Duration::from_millis(500));
    window.key(&[], u32::from('s'));
    window.key(&[], u32::from('k'));
    let mut picture = None;
    until("the snapshot", PATIENCE, || {
        picture = kept(program.home(), ".png");
        picture.is_some()
    });
    let picture = picture.unwrap();
    until("the command", PATIENCE, || program.said().contains("Copied: bokehcam preview"));
    let ended = program.close();
    // Repeat it as a user without settings.
    let other = Home::new();
    let run = |arguments: &[&str]| {
        Ran::of(other.with_drivers(arguments).current_dir(&ended.home.0).env("DISPLAY", &screen.display))
    };
    run(&["render", "--like", &picture, "--out", "again.png", "--backend", "cpu"]).done();
    let read = |name: &str| read_color(&ended.home.path(name)).unwrap();
    assert_eq!(read(&picture), read("again.png"), "to the bit");

    let copied = ended.said.split("Copied: bokehcam ").nth(1).and_then(|rest| rest.lines().next()).unwrap();
    assert!(copied.contains("--aperture polygon") && copied.contains("--start=0"), "{copied}");
    let arguments: Vec<&str> = copied.split(' ').chain(["--frames=3", "--report=again.json"]).collect();
    println!("{copied}");
    run(&arguments).done();
    assert!(ended.home.path("again.json").exists());
}

#[test]
#[ignore = "needs an X server"]
fn a_recording_is_begun_and_ended_by_a_key() {
    let screen = Screen::new();
    // On a GPU, pictures are read back only on demand.
    for backend in [&["--backend", "cpu"][..], &["--backend", "gpu", "--adapter", "llvmpipe"]] {
        let (program, window) = start(&screen, backend);
        window.key(&[], u32::from('s'));
        until("the snapshot", PATIENCE, || kept(program.home(), ".png").is_some());
        let picture = program.home().join(kept(program.home(), ".png").unwrap());
        let is_part = |file: fs::DirEntry| file.file_name().as_encoded_bytes().starts_with(b".bokehcam 20");
        let is_recorded = || fs::read_dir(program.home()).unwrap().flatten().any(is_part);
        // On a busy machine, a short recording may contain no frame, and then no file is written.
        let mut longer = [2500, 10_000, 40_000].iter();
        until("the video is whole", PATIENCE, || {
            window.key(&[], u32::from('v'));
            until("the recording", PATIENCE, is_recorded);
            std::thread::sleep(Duration::from_millis(*longer.next().expect("a frame in so long a time")));
            window.key(&[], u32::from('v'));
            until("its end", PATIENCE, || !is_recorded());
            kept(program.home(), ".mp4").is_some()
        });
        assert!(is_photograph(&read_color(&picture).unwrap()));
        program.close();
    }
}

/// Finds a file that the window wrote in a folder, except the sources of a snapshot.
fn kept(folder: &Path, ending: &str) -> Option<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut ours = names.filter(|name| name.starts_with("bokehcam 20") && !name.ends_with("-color.png"));
    ours.find(|name| name.ends_with(ending))
}

/// Copies the first six frames of the recording, without depth, into `folder`.
fn without_depth(folder: &Path) {
    fs::create_dir_all(folder.join("rgb")).unwrap();
    let list = fs::read_to_string(Path::new(PORTRAIT).join("rgb.txt")).unwrap();
    let lines: Vec<&str> = list.lines().filter(|line| !line.starts_with('#')).take(6).collect();
    for file in lines.iter().filter_map(|line| line.split_whitespace().nth(1)) {
        fs::copy(Path::new(PORTRAIT).join(file), folder.join(file)).unwrap();
    }
    fs::write(folder.join("rgb.txt"), lines.join("\n") + "\n").unwrap();
}

/// Measures colourfulness: the mean absolute difference between red and blue.
fn colour(image: &ColorImage) -> f64 {
    let pixels = image.rgb.as_chunks::<3>().0;
    let sum: f64 = pixels.iter().map(|rgb| f64::from(rgb[0].abs_diff(rgb[2]))).sum();
    sum / pixels.len() as f64
}

#[test]
#[ignore = "needs an X server"]
fn a_band_alone_is_sharp_and_a_lost_camera_is_shown_in_grey_until_it_is_back() {
    let screen = Screen::new();
    let folder = tempfile::tempdir().unwrap();
    without_depth(folder.path());
    let name = folder.path().to_str().unwrap();
    let mut program =
        Program::start(&screen, &[name, "--panel=false", "--effect", "tilt-shift", "--coc-at-infinity", "5%"]);
    let window = program.window();
    let shown = window.until("the first picture", is_photograph);
    const TOP: Place = ((0.5, 0.1), (0.8, 0.15));
    const BAND: Place = ((0.5, 0.55), (0.3, 0.10));
    assert!(detail(&shown, BAND) > 1.5 * detail(&shown, TOP), "sharp in the band alone");

    // The next picture to be read is truncated, so the source fails.
    let last = fs::read_dir(folder.path().join("rgb")).unwrap().map(|entry| entry.unwrap().path()).max().unwrap();
    let whole = fs::read(&last).unwrap();
    fs::write(&last, &whole[..whole.len() / 2]).unwrap();
    window.until("the picture stays, in grey", |image| {
        colour(image) < 0.35 * colour(&shown) && is_grey_photograph(image)
    });
    fs::write(&last, &whole).unwrap();
    window.key(&[], super::input::sym::F1 + 4);
    window.until("it is back", |image| colour(image) > 0.8 * colour(&shown) && is_photograph(image));
    program.close();
}

fn is_grey_photograph(image: &ColorImage) -> bool {
    let mut seen = [false; 256];
    image.rgb.iter().step_by(3).for_each(|&byte| seen[usize::from(byte)] = true);
    seen.iter().filter(|seen| **seen).count() > 60
}

#[test]
#[ignore = "needs an X server"]
fn a_gpu_shows_the_same_as_the_processor() {
    let screen = Screen::new();
    let shown = [&["--backend", "cpu"][..], &["--backend", "gpu", "--adapter", "llvmpipe"]].map(|backend| {
        let (program, window) = start(&screen, backend);
        let mut last: Option<ColorImage> = None;
        let image = window.until("it stands still", |image| {
            std::thread::sleep(Duration::from_millis(250));
            let same = last.as_ref().is_some_and(|last| is_photograph(last) && distance(last, image) < 0.05);
            last = Some(image.clone());
            same
        });
        program.close();
        image
    });
    // The recording's bar hides after a while, perhaps before a slow machine takes the picture; compare the middle
    // only.
    let off = distance(&middle(&shown[0]), &middle(&shown[1]));
    assert!(off < 1.0, "{off}");
}
