//! Writing to the virtual camera, and reading from it by other programs.

use std::fs;
use std::process::Command;
use std::str::FromStr;
use std::time::{Duration, Instant};

use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam_live::sink::{Ending, Options, Target};
use bokehcam_live::v4l2::FourCc;
use bokehcam_live::v4l2::node::list_nodes;

use super::machine::{
    BARS, CAMERA, Lost, Machine, Stream, VERSIONS, VIRTUAL, beside, distance_from, frame, frame_now, open, run, sh,
    until, wish,
};

/// Tolerance after two colour conversions, in codes.
const STEP: u8 = 5;
const MARGIN_PX: u32 = 4;

fn yuyv() -> Option<FourCc> {
    Some("YUYV".parse().unwrap())
}

/// Measures the picture's shift from frame to frame in pixels, by the edge between the black and the white bar.
fn steps(frames: &[u8], (width, height): (usize, usize)) -> Vec<usize> {
    let places: Vec<usize> = frames.chunks_exact(2 * width * height).map(|frame| place(&frame[..2 * width])).collect();
    places.windows(2).map(|pair| (pair[1] + width - pair[0]) % width).collect()
}

/// Returns the maximum difference between a YUYV picture and the shifted bars, in codes of limited-range BT.601.
fn codes_from_bars(frame: &[u8], width: usize) -> u8 {
    let codes = BARS.map(|rgb| {
        let [r, g, b] = rgb.map(|code| f64::from(code) / 255.0);
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        [16.0 + 219.0 * luma, 128.0 + 112.0 * (b - luma) / 0.886, 128.0 + 112.0 * (r - luma) / 0.701]
    });
    let begin = place(&frame[..2 * width]) + 1;
    let mut most = 0.0f64;
    for pair in 0..frame.len() / 4 {
        let x = (2 * pair + width - begin) % width;
        let bar = x * 8 / width;
        if x >= bar * width / 8 + 4 && x + 5 < (bar + 1) * width / 8 {
            let [y0, u, y1, v] = frame[4 * pair..4 * pair + 4] else { unreachable!() };
            for (code, due) in [(y0, 0), (y1, 0), (u, 1), (v, 2)] {
                most = most.max((f64::from(code) - codes[bar][due]).abs());
            }
        }
    }
    most.ceil() as u8
}

/// Finds the column in a YUYV row where the black bar ends and the white one begins.
fn place(row: &[u8]) -> usize {
    let luma: Vec<u8> = row.iter().step_by(2).copied().collect();
    let width = luma.len();
    let rises = |x: &usize| luma[(x + 1) % width].saturating_sub(luma[(x + width - 1) % width]);
    (0..width).max_by_key(rises).unwrap_or_default()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn what_goes_in_at_30_frames_per_second_comes_out_for_other_programs() {
    for size in [(640, 480), (1280, 720)] {
        let machine = Machine::new();
        machine.at_30_fps();
        machine.control("horizontal_movement", "Move Right Fast");
        let (width, height) = size;
        let began = Instant::now();
        let stream = Stream::show(&format!("0 --size {width}x{height} --fps 30 --effect none"));
        let mut moved = Vec::new();
        // After a long stall of the machine, all pictures may be repeats of one.
        until("a picture that moves", || {
            sh(&format!(
                "timeout 120 v4l2-ctl -d {VIRTUAL} --stream-mmap --stream-skip=5 --stream-count=60 --stream-to=/tmp/frames 2>&1"
            ));
            let frames = fs::read("/tmp/frames").unwrap();
            assert_eq!(frames.len(), 60 * 2 * width * height);
            moved = steps(&frames, size);
            moved.iter().any(|step| *step > 0)
        });
        let steps = moved;
        machine.control("horizontal_movement", "No Movement");
        sh(&format!(
            "timeout 120 ffmpeg -v error -y -probesize 32 -analyzeduration 0 -f v4l2 -i {VIRTUAL} -frames:v 10 -c copy -f rawvideo /tmp/frames"
        ));
        let frames = fs::read("/tmp/frames").unwrap();
        assert_eq!(frames.len(), 10 * 2 * width * height);
        let far = codes_from_bars(&frames[9 * 2 * width * height..], width);
        assert!(far <= 4, "{width}x{height}: {far} codes from what went in");

        let report = stream.report(true);
        let runs_s = began.elapsed().as_secs_f64();
        let frames = &report["frames"];
        let (captured, delivered) = (frames["captured"].as_f64().unwrap(), frames["delivered"].as_f64().unwrap());
        println!("{width}x{height}: {frames} {}", report["stages_ms"]);
        // Each shift is a whole number of frame steps, and their total is at most the number of captured frames.
        let least = *steps.iter().filter(|step| **step > 0).min().unwrap();
        // If frames were always skipped, the smallest shift is a multiple of the step; subpixel motion may make it a
        // pixel short.
        let fits = |step: usize| steps.iter().all(|passed| passed % step <= 1 || passed % step + 1 >= step);
        let step = (4..=least + 1).rev().find(|&step| fits(step));
        let step = step.unwrap_or_else(|| panic!("not in steps of one length: {steps:?}"));
        let frames_passed: usize = steps.iter().map(|passed| (passed + step / 2) / step).sum();
        assert!(frames_passed as f64 <= captured, "{report}: steps {steps:?}");
        let per_second = captured / report["elapsed_s"].as_f64().unwrap();
        println!("{per_second:.1} frames per second captured, {:.1} % delivered", 100.0 * delivered / captured);
        // The number of frames depends on the machine's speed. The count starts with the camera, before the run's own
        // start.
        assert!(captured <= 31.0 * runs_s + 1.0, "no more than the camera takes: {runs_s} s, {report}");
        // The virtual camera repeats its last picture if none arrives in time, so readers may get more pictures than
        // were delivered, but not more distinct ones.
        let differ = 1 + steps.iter().filter(|step| **step > 0).count();
        assert!(differ > 1 && differ as f64 <= delivered, "{differ} pictures that differ: {frames}");
        // Every duplicate is a reported repeat.
        let again = steps.len() + 1 - differ;
        assert!(again as u64 <= report["repeats"].as_u64().unwrap(), "{again} pictures again: {report}");
        assert_eq!(frames["dropped"]["corrupt"], 0, "{frames}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_few_small_frames_are_blurred_on_the_way() {
    let machine = Machine::new();
    machine.at_30_fps();
    let stream = Stream::show("0 --size 320x180 --fps 30 --effect blur --coc-at-infinity 6 --backend cpu");
    let mut reader = open(VIRTUAL, wish((320, 180), 30.0, yuyv()));
    let soft = |image: &ColorImage| {
        // Between the yellow and the cyan bar, red decreases gradually.
        let red = |x: usize| image.rgb[3 * (90 * 320 + x)];
        (30..160).contains(&red(80)) && red(68) > 170 && red(92) < 25
    };
    until("soft edges", || soft(&frame(&mut reader).0));
    let (image, _) = frame(&mut reader);
    assert!(distance_from(&image, &BARS, 12) <= STEP + 1, "inside the bars nothing changes");
    stream.report(true);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_hundred_writers_come_and_go() {
    let options = Options::new((64, 48), 33_333_333);
    let (mut picture, mut ready) = (ColorImage::new(64, 48), YuyvImage::default());
    for version in VERSIONS {
        let machine = Machine::new();
        machine.loopback(version);
        for turn in 0..100u8 {
            picture.rgb.fill(2 * turn + 20);
            let mut sink = Target::from_str(VIRTUAL)
                .unwrap()
                .open(&options)
                .unwrap_or_else(|error| panic!("{version}, {turn}: {error}"));
            let _ = sink.write_frame(&picture, 0).unwrap();
            let mut reader = open(VIRTUAL, wish((64, 48), 30.0, yuyv()));
            // Every other writer sends a picture that is already YUYV.
            let is_yuyv = turn % 2 == 1;
            assert!(sink.wants_yuyv());
            let code = if is_yuyv { 235 - 2 * turn } else { 2 * turn + 20 };
            let seen = |image: ColorImage| image.rgb.iter().all(|seen| seen.abs_diff(code) <= 2);
            // Earlier pictures may arrive first.
            until("the reader sees it", || {
                ready.resize(64, 48);
                ready.bytes.as_chunks_mut().0.fill([(u32::from(code) * 220 / 256 + 16) as u8, 128]);
                let _ = if is_yuyv { sink.write_yuyv(&mut ready, 0) } else { sink.write_frame(&picture, 0) }.unwrap();
                frame_now(&mut reader).is_some_and(seen)
            });
            drop(reader);
            sink.finish(Ending::Complete).unwrap();
            let node = list_nodes().into_iter().find(|node| node.path.to_str() == Some(VIRTUAL)).unwrap();
            assert!(node.outputs, "{version}, {turn}: it takes no more writers");
        }
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn readers_come_and_go() {
    for version in [VERSIONS[0], VERSIONS[2]] {
        let machine = Machine::new();
        machine.loopback(version);
        machine.at_30_fps();
        let stream = Stream::show("0 --size 320x180 --fps 30 --effect none");
        let read = || {
            let mut read = Command::new("v4l2-ctl");
            read.args(["-d", VIRTUAL, "--stream-mmap", "--stream-count=1000"]);
            read
        };
        let mut lost = Lost::default();
        for _ in 0..3 {
            sh(&format!("timeout 120 v4l2-ctl -d {VIRTUAL} --stream-mmap --stream-count=10 2>&1"));
            // A reader killed while reading, as a browser may be.
            let killed = beside(read());
            std::thread::sleep(Duration::from_millis(600));
            drop(killed);
            let mut reader = open(VIRTUAL, wish((320, 180), 30.0, yuyv()));
            for _ in 0..10 {
                lost.add(frame(&mut reader).1);
            }
            assert!(distance_from(&frame(&mut reader).0, &BARS, MARGIN_PX) <= STEP, "{version}");
        }
        // The number delivered depends on the machine's speed, but the report accounts for each frame.
        let report = stream.report(true);
        let frames = &report["frames"];
        println!("{version}: {frames}, of the reader {lost:?}");
        assert!(frames["delivered"].as_u64().unwrap() > 0 && frames["dropped"]["corrupt"] == 0, "{frames}");
        assert_eq!(lost.corrupt, 0, "{lost:?}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn off_is_off_for_readers_while_nobody_reads_another_output() {
    let machine = Machine::new();
    machine.at_30_fps();
    // The standard output is a pipe without a reader.
    let stream = Stream::show("0 --size 320x180 --fps 30 --effect none --to -");
    let mut reader = open(VIRTUAL, wish((320, 180), 30.0, yuyv()));
    let mut shows_bars = || distance_from(&frame(&mut reader).0, &BARS, MARGIN_PX) <= STEP;
    until("the camera's picture", &mut shows_bars);
    let off = run("ctl off");
    assert!(off.done().contains("standard output: busy"), "{}", off.stderr);
    // Pictures may have been in flight to the reader when the answer came.
    until("the card", || !shows_bars());
    assert!((0..20).all(|_| !shows_bars()), "a picture after the card");
    run("ctl on").done();
    until("the camera's picture again", &mut shows_bars);
    stream.report(true);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn jpegs_of_a_camera_are_decoded() {
    let _machine = Machine::new();
    let mut bars = b"P6 640 480 255\n".to_vec();
    bars.extend((0..640 * 480).flat_map(|k| BARS[k % 640 / 80]));
    fs::write("/tmp/bars.ppm", bars).unwrap();
    let mut ffmpeg = Command::new("ffmpeg");
    let arguments = "-v error -re -loop 1 -framerate 30 -i /tmp/bars.ppm -c:v mjpeg -huffman default -pix_fmt yuvj422p -q:v 2 -f v4l2";
    ffmpeg.args(arguments.split(' ')).arg(VIRTUAL);
    let mut ffmpeg = beside(ffmpeg);
    until("ffmpeg writes", || {
        assert!(ffmpeg.runs());
        list_nodes().iter().any(|node| node.path.to_str() == Some(VIRTUAL) && node.captures)
    });
    let mut camera = open(VIRTUAL, wish((640, 480), 30.0, Some("MJPG".parse().unwrap())));
    let mut lost = Lost::default();
    for _ in 0..30 {
        let (image, before) = frame(&mut camera);
        lost.add(before);
        let step = distance_from(&image, &BARS, 4);
        assert!(step <= 8, "{step} codes from what was encoded");
    }
    assert!(lost.corrupt <= 1, "all but perhaps the first, which may be an old one: {lost:?}");
    drop(camera);
    run(&format!("stream {VIRTUAL} --format MJPG --effect none --frames 10 --to null")).done();
    assert!(resolve_is_real(), "the camera goes before the virtual one");
}

/// Whether a name that matches both devices resolves to the camera.
fn resolve_is_real() -> bool {
    bokehcam_live::v4l2::node::resolve_node("i").unwrap().to_str() == Some(CAMERA)
}
