//! Background plates: with locked camera controls, and captured by the program while the person steps aside.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use bokehcam_live::sink::{Ending, Options, Target};
use bokehcam_live::v4l2::live::auto_lock::AutoLock;
use bokehcam_live::v4l2::node::list_nodes;
use bokehcam_media::recording::still;

use rustix::process::Signal;

use super::machine::{CAMERA, Ends, HANG, Machine, VIRTUAL, bokehcam, sh, until};
use super::program::Beside;

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn what_a_camera_decides_by_itself_is_held_and_given_back() {
    let machine = Machine::new();
    let told = |name: &str| sh(&format!("v4l2-ctl -d {CAMERA} -C {name}")).trim().to_owned();
    for automatic in ["1", "0"] {
        machine.control("gain_automatic", automatic);
        let held = AutoLock::new(CAMERA).unwrap();
        assert_eq!(told("gain_automatic"), "gain_automatic: 0");
        drop(held);
        assert_eq!(told("gain_automatic"), format!("gain_automatic: {automatic}"));
    }
    assert!(AutoLock::new("/dev/video99").is_err());
}

const SIZE: (u32, u32) = (160, 96);

/// Draws a wall with a pattern, optionally with a striped person before it.
fn picture(with_person: bool) -> ColorImage {
    let mut picture = ColorImage::new(SIZE.0, SIZE.1);
    for (at, pixel) in picture.rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (at as u32 % SIZE.0, at as u32 / SIZE.0);
        let wall = if (x / 4 + y / 4) % 2 == 0 { [40, 120, 60] } else { [90, 190, 110] };
        let stripes = if x / 4 % 2 == 0 { [200, 60, 60] } else { [120, 20, 140] };
        pixel.copy_from_slice(if with_person && is_person(x, y) { &stripes } else { &wall });
    }
    picture
}

fn is_person(x: u32, y: u32) -> bool {
    (50..110).contains(&x) && y > 24
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_stream_tells_a_person_to_step_out_and_makes_a_portrait() {
    let _machine = Machine::new();
    let folder = Path::new("/tmp/plate");
    let (is_there, over) = (AtomicBool::new(true), AtomicBool::new(false));
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut camera = Target::from_str(VIRTUAL).unwrap().open(&Options::new(SIZE, 50_000_000)).unwrap();
            for frame in 0.. {
                if over.load(Ordering::SeqCst) {
                    break;
                }
                let _ = camera.write_frame(&picture(is_there.load(Ordering::SeqCst)), frame * 50_000_000);
                thread::sleep(Duration::from_millis(50));
            }
            let _ = camera.finish(Ending::Complete);
        });
        let _ends = Ends(&over);
        until("the camera shows something", || {
            list_nodes().iter().any(|node| node.path == Path::new(VIRTUAL) && node.captures)
        });
        let arguments =
            format!("stream {VIRTUAL} --depth plate --coc-at-infinity 6 --quality draft --to {}/", folder.display());
        let mut program = Beside::start(bokehcam(&arguments).stderr(Stdio::piped()));
        let mut said = BufReader::new(program.0.stderr.take().unwrap()).lines().map_while(Result::ok);
        let mut hears = |part: &str| {
            assert!(
                said.by_ref().inspect(|line| println!("{line}")).any(|line| line.contains(part)),
                "never said: {part}"
            );
        };
        (1..=3).rev().for_each(|seconds| {
            hears(&format!("step out of the picture: {seconds}"));
            // Remove the person at once, so that no picture of them is in flight when the capture begins.
            is_there.store(false, Ordering::SeqCst);
        });
        hears("come back");
        is_there.store(true, Ordering::SeqCst);
        let newest = || fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path()).max();
        let before = newest();
        until("some frames more", || {
            let count = |path: &PathBuf| {
                path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse::<u64>().ok())
            };
            newest().as_ref().and_then(count) > before.as_ref().and_then(count).map(|count| count + 20)
        });
        program.end_by(Signal::INT, HANG).done();
        let blurred = still::read_color(&newest().unwrap()).unwrap();
        let shown = picture(true);
        let change = |of: bool| {
            let inner = |at: &usize| {
                let (x, y) = (*at as u32 % SIZE.0, *at as u32 / SIZE.0);
                let apart = x.abs_diff(50).min(x.abs_diff(109)) > 8 && y.abs_diff(24) > 8;
                apart && is_person(x, y) == of
            };
            let all: Vec<u8> = (0..(SIZE.0 * SIZE.1) as usize)
                .filter(inner)
                .map(|at| blurred.rgb[3 * at + 1].abs_diff(shown.rgb[3 * at + 1]))
                .collect();
            all.iter().map(|&change| u32::from(change)).sum::<u32>() / all.len() as u32
        };
        assert!(change(true) <= 4 && change(false) >= 15, "person {} codes off, wall {}", change(true), change(false));
    });
}
