//! User-supplied networks: loading, running, sandboxing, and their depth for a single camera.

mod hostile;
mod installed;
use crate::onnx;
mod plate;
mod real;
#[cfg(feature = "window")]
mod window;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam_networks::network::{self, Tensor};
use bokehcam_networks::single_camera::{Hints, SingleCamera};
use onnx::{Side, constant, conv, matte, model, node, port};
use tempfile::TempDir;

use crate::program::{Home, PORTRAIT, Ran};

/// Weights that classify red as the person and blue as background, with certainty at codes of 255 and 0.
const WEIGHTS: [f32; 3] = [12.0, 0.0, -12.0];

fn written(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn camera(file: &Path) -> SingleCamera {
    SingleCamera::open(Some(file), None, &Hints::default()).unwrap()
}

fn read(camera: &mut dyn DepthSource, color: &ColorImage, frame: u64) -> DepthMap {
    let mut map = DepthMap::default();
    let stamp = Stamp { index: frame as usize, time_ns: frame * 33_000_000, captured_ns: None };
    camera.read(FrameInput { stamp, color, right: None }, &mut map).unwrap();
    map
}

/// Draws an antialiased red disc on blue; returns the picture and the disc's coverage per pixel.
fn disc(width: u32, height: u32, (x, y): (f32, f32), radius_px: f32) -> (ColorImage, Vec<f32>) {
    let mut color = ColorImage::new(width, height);
    let mut shares = Vec::new();
    for at in 0..width * height {
        let inside = (0..64).filter(|sub| {
            let (sub_x, sub_y) = ((sub % 8) as f32 / 8.0 + 1.0 / 16.0, (sub / 8) as f32 / 8.0 + 1.0 / 16.0);
            let off = ((at % width) as f32 + sub_x - x, (at / width) as f32 + sub_y - y);
            off.0.hypot(off.1) < radius_px
        });
        let share = inside.count() as f32 / 64.0;
        let code = |share: f32| (bokehcam::color::linear_to_srgb(0.05 + 0.9 * share) * 255.0).round() as u8;
        color.rgb[3 * at as usize..][..3].copy_from_slice(&[code(share), 60, code(1.0 - share)]);
        shares.push(share);
    }
    (color, shares)
}

#[test]
fn a_network_gives_what_its_layers_say() {
    let folder = TempDir::new().unwrap();
    let file = written(&folder, "sum.onnx", &matte(8, 4, [1.0, 2.0, -3.0], 0.25));
    let mut network = network::load(&file).unwrap().network;
    let values: Vec<f32> = (0..96).map(|k| k as f32 / 96.0).collect();
    let mut outputs = Vec::new();
    network.run(&[Tensor { shape: vec![1, 3, 4, 8], values: values.clone() }], &mut outputs).unwrap();
    assert_eq!(outputs[0].shape, [1, 1, 4, 8]);
    for at in 0..32 {
        let sum = values[at] + 2.0 * values[32 + at] - 3.0 * values[64 + at] + 0.25;
        let exact = 1.0 / (1.0 + (-sum).exp());
        assert!((outputs[0].values[at] - exact).abs() < 1e-5, "{at}");
    }
}

#[test]
fn a_coarse_mask_becomes_the_share_of_every_pixel() {
    let folder = TempDir::new().unwrap();
    // The network's input has a tenth of the picture's size.
    let file = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    let (color, shares) = disc(320, 240, (163.0, 118.0), 70.0);
    let map = read(&mut camera(&file), &color, 0);
    assert_eq!(map.subject_m, Some(1.0));
    let mut found: Vec<f32> = map.metres.iter().map(|&metres| f32::from(u8::from(metres <= 1.0))).collect();
    for pixel in &map.matte.pixels {
        found[pixel.at as usize] = pixel.alpha;
    }
    let mixed = |share: &f32| *share > 0.02 && *share < 0.98;
    let error: f32 = found.iter().zip(&shares).map(|(found, share)| (found - share).abs()).sum();
    let count = shares.iter().filter(|share| mixed(share)).count() as f32;
    assert!(error / count < 0.03, "mean error over {count} mixed pixels: {}", error / count);
    // Unmixed foreground and background colours are pure, so that their difference is nearly one.
    for pixel in &map.matte.pixels {
        let red = pixel.difference[0];
        assert!((0.7..1.0).contains(&red), "{pixel:?}");
    }
}

/// In a live run, a depth network may take longer than a frame; its result arrives some frames later, unchanged.
#[test]
fn what_is_seen_aside_is_what_is_seen_at_once() {
    let folder = TempDir::new().unwrap();
    let person = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    // Blue is nearer than red.
    let depth = written(&folder, "mono.onnx", &matte(32, 24, [-1.0, 0.0, 1.0], 0.0));
    let open = || SingleCamera::open(Some(&person), Some(&depth), &Hints::default()).unwrap();
    let [(first, _), (second, _)] = [100.0, 220.0].map(|x| disc(320, 240, (x, 118.0), 60.0));
    let (mut at_once, mut live) = (open(), open());
    let finest = live.efforts().len() - 1;
    live.set_effort(finest);
    let distances = |map: &DepthMap| map.metres.iter().any(|&metres| metres > DepthMap::SUBJECT_M && metres < 10.0);
    let [seen_live, seen] = [&mut live, &mut at_once].map(|camera| read(camera, &first, 0));
    assert!(distances(&seen_live) && distances(&seen), "the first one has its own depth");
    // After 199 frames, pixels near the threshold have settled.
    let expected = (1..200).map(|frame| read(&mut at_once, &second, frame)).last();
    let is_there = (1..2000).any(|frame| {
        std::thread::sleep(Duration::from_millis(1));
        Some(read(&mut live, &second, frame)) == expected
    });
    assert!(is_there, "the thread never told");
}

/// Even at the lowest effort, a frame never reuses the mask of the previous one.
#[test]
fn each_frame_has_a_mask_of_its_own_at_every_effort() {
    let folder = TempDir::new().unwrap();
    let person = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    let depth = written(&folder, "mono.onnx", &matte(32, 24, [-1.0, 0.0, 1.0], 0.0));
    let open = |mono: Option<&Path>| SingleCamera::open(Some(&person), mono, &Hints::default()).unwrap();
    let (mut finest, mut least) = (open(None), open(None));
    finest.set_effort(finest.efforts().len() - 1);
    least.set_effort(0);
    for frame in 0..8u64 {
        let (color, _) = disc(320, 240, (80.0 + 20.0 * frame as f32, 118.0), 60.0);
        assert!(read(&mut least, &color, frame) == read(&mut finest, &color, frame), "frame {frame}");
    }
    assert!(!least.is_reusable() && !open(Some(&*depth)).is_reusable());
    let alone = SingleCamera::open(None, Some(&depth), &Hints::default()).unwrap();
    assert!(alone.is_reusable(), "what is near and far is no mask");
}

/// Without a person, everything is background, also with distances: nothing is in focus in place of the person.
#[test]
fn without_a_person_nothing_is_as_near_as_one() {
    let folder = TempDir::new().unwrap();
    let person = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    let depth = written(&folder, "mono.onnx", &matte(32, 24, [-1.0, 0.0, 1.0], 0.0));
    let mut both = SingleCamera::open(Some(&person), Some(&depth), &Hints::default()).unwrap();
    let mut wall = ColorImage::new(320, 240);
    wall.rgb.chunks_exact_mut(3).enumerate().for_each(|(at, pixel)| pixel[2] = 128 + (at % 320 / 4) as u8);
    let map = read(&mut both, &wall, 0);
    let nearest_m = map.metres.iter().copied().fold(f32::INFINITY, f32::min);
    assert!(nearest_m > 1.05 * DepthMap::SUBJECT_M && map.farthest_m() > Some(nearest_m), "{nearest_m}");
}

/// Draws a disc at column `x` with sensor noise of one code, another in every frame.
fn noisy_disc(x: f32, frame: u64) -> ColorImage {
    let (mut color, _) = disc(320, 240, (x, 118.0), 60.0);
    for (at, code) in color.rgb.iter_mut().enumerate().filter(|(at, _)| (at + frame as usize).is_multiple_of(7)) {
        *code = code.saturating_add(u8::from(at % 2 == 0));
    }
    color
}

/// Pictures that hardly differ share a map, and a change of the picture is followed at once.
#[test]
fn still_pictures_share_a_map_and_moved_ones_do_not() {
    let folder = TempDir::new().unwrap();
    let person = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    let (mut kept, mut fresh) = (camera(&person), camera(&person));
    let mut frame = 0;
    let mut read_both = |x: f32| {
        frame += 1;
        let color = noisy_disc(x, frame);
        let mut changed = color.clone();
        // The network does not look at green.
        for y in 0..40 {
            let corner = &mut changed.rgb[y * 960..][..120];
            corner.iter_mut().skip(1).step_by(3).for_each(|green| *green += 60 * (frame % 2) as u8);
        }
        (read(&mut kept, &color, frame), read(&mut fresh, &changed, frame))
    };
    let still: Vec<(DepthMap, DepthMap)> = (0..12).map(|_| read_both(160.0)).collect();
    assert!(still[2..].iter().all(|(kept, _)| *kept == still[2].0), "one map for all");
    assert!(still[2..].iter().any(|(_, fresh)| *fresh != still[2].1), "noise changes the fresh ones");
    for step in 1..8 {
        let (kept, fresh) = read_both(160.0 + 2.0 * step as f32);
        let apart = kept.metres.iter().zip(&fresh.metres).filter(|(a, b)| a != b).count();
        assert!(apart < 40, "step {step}: {apart} pixels of an outline of 380");
    }
}

/// A person who moves by half a pixel from picture to picture never gets an earlier mask.
#[test]
fn a_moving_person_never_gets_the_map_of_an_earlier_picture() {
    let folder = TempDir::new().unwrap();
    let mut camera = camera(&written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0)));
    let mut before = DepthMap::default();
    for frame in 0..60 {
        let map = read(&mut camera, &noisy_disc(140.0 + 0.5 * frame as f32, frame), frame);
        assert!(map != before, "frame {frame}");
        before = map;
    }
}

/// Nothing is kept across a seek, a change of size, and a cut.
#[test]
fn another_scene_gets_a_map_of_its_own() {
    let folder = TempDir::new().unwrap();
    let person = written(&folder, "matte.onnx", &matte(32, 24, WEIGHTS, 0.0));
    for change in ["none", "seek", "size", "cut", "gap"] {
        let mut kept = camera(&person);
        let still: Vec<DepthMap> = (0..6).map(|frame| read(&mut kept, &noisy_disc(160.0, frame), frame)).collect();
        assert!(still[5] == still[4], "{change}: kept before");
        let mut color = noisy_disc(160.0, 6);
        match change {
            "seek" => kept.seek(0),
            "size" => color = disc(640, 480, (320.0, 236.0), 120.0).0,
            "cut" => color = noisy_disc(220.0, 6),
            _ => {}
        }
        let map = read(&mut kept, &color, if change == "gap" { 60 } else { 6 });
        assert_eq!(map == still[5], change == "none", "{change}");
        if change != "none" {
            let anew = read(&mut camera(&person), &color, 6);
            let apart = map.metres.iter().zip(&anew.metres).filter(|(a, b)| a != b).count();
            assert!(map.size() == anew.size() && apart < 40, "{change}: {apart} pixels");
        }
    }
}

#[test]
fn what_a_network_is_shown_may_lie_any_way_and_be_of_any_size() {
    let folder = TempDir::new().unwrap();
    let (color, _) = disc(64, 48, (32.0, 24.0), 15.0);
    let planes = matte(16, 12, WEIGHTS, 0.0);
    // Interleaved channels (NHWC): a product with the weights, summed over the channels.
    let beside = |channels| [Side::Is(1), Side::Is(12), Side::Is(16), Side::Is(channels)];
    let beside = model(
        &[port("picture", &beside(3))],
        &[constant("w", &[3, 1], &WEIGHTS)],
        &[node("MatMul", &["picture", "w"], "sum", &[]), node("Sigmoid", &["sum"], "out", &[])],
        &[port("out", &beside(1))],
    );
    let any = |channels| [Side::Any("n"), Side::Is(channels), Side::Any("h"), Side::Any("w")];
    let any_size = model(
        &[port("picture", &any(3))],
        &[constant("w", &[1, 3, 1, 1], &WEIGHTS)],
        &[conv(&["picture", "w"], "sum"), node("Sigmoid", &["sum"], "out", &[])],
        &[port("out", &any(1))],
    );
    // Two logits, before softmax: background and person.
    let two = model(
        &[port("picture", &any(3))],
        &[constant("w", &[2, 3, 1, 1], &[-6.0, 0.0, 6.0, 6.0, 0.0, -6.0])],
        &[conv(&["picture", "w"], "out")],
        &[port("out", &any(2))],
    );
    for (name, bytes) in [("planes", planes), ("beside", beside), ("any size", any_size), ("two", two)] {
        let map = read(&mut camera(&written(&folder, "m.onnx", &bytes)), &color, 0);
        assert_eq!((map.metres[24 * 64 + 32], map.metres[0]), (1.0, 1000.0), "{name}");
    }
}

#[test]
fn a_network_with_a_memory_gets_back_what_it_gave() {
    let folder = TempDir::new().unwrap();
    let sides = |channels| [Side::Is(1), Side::Is(channels), Side::Is(4), Side::Is(4)];
    // A recurrent network that accumulates its input, and detects a person from 0.5 on.
    let recurrent = model(
        &[port("src", &sides(3)), port("r1i", &sides(1))],
        &[
            constant("w", &[1, 3, 1, 1], &[0.1, 0.0, 0.0]),
            constant("slope", &[1], &[200.0]),
            constant("half", &[1], &[-110.0]),
        ],
        &[
            conv(&["src", "w"], "seen"),
            node("Add", &["seen", "r1i"], "r1o", &[]),
            node("Mul", &["r1o", "slope"], "steep", &[]),
            node("Add", &["steep", "half"], "shifted", &[]),
            node("Sigmoid", &["shifted"], "pha", &[]),
        ],
        &[port("pha", &sides(1)), port("r1o", &sides(1))],
    );
    let mut red = ColorImage::new(16, 16);
    red.rgb.chunks_mut(3).for_each(|pixel| pixel[0] = 255);
    let mut camera = camera(&written(&folder, "r.onnx", &recurrent));
    // The sixth frame is the first above the threshold.
    let near: Vec<bool> = (0..7).map(|frame| read(&mut camera, &red, frame).metres[0] <= 1.0).collect();
    assert_eq!(near.iter().position(|near| *near), Some(5), "{near:?}");
    // A long gap between frames resets the state.
    assert!(read(&mut camera, &red, 1000).metres[0] > 1.0);
}

/// Streams some frames of the portrait with a network as its mask.
fn streamed(home: &Home, name: &str, bytes: &[u8], frames: &str) -> Ran {
    let file = format!("{name}.onnx");
    written(&home.0, &file, bytes);
    let matte = format!("matte:{file}");
    let stream = ["stream", PORTRAIT, "--depth", &matte, "--to", "null"];
    home.run(&[&stream[..], &["--frames", frames]].concat())
}

#[test]
fn a_bad_file_is_refused_in_one_line() {
    let home = Home::new();
    let good = matte(8, 4, WEIGHTS, 0.0);
    let sides = |channels, side| [Side::Is(1), Side::Is(channels), Side::Is(side), Side::Is(side)];
    let plain = |input: &[Side], output: &[Side]| {
        let nodes = [node("Identity", &["in"], "out", &[])];
        model(&[port("in", input)], &[], &nodes, &[port("out", output)])
    };
    let zero = model(
        &[port("in", &sides(3, 8))],
        &[constant("w", &[1, 3, 1, 1], &[0.0; 3])],
        &[conv(&["in", "w"], "zero"), node("Div", &["zero", "zero"], "out", &[])],
        &[port("out", &sides(1, 8))],
    );
    let unknown =
        model(&[port("in", &sides(3, 8))], &[], &[node("Magic", &["in"], "out", &[])], &[port("out", &sides(1, 8))]);
    let cases: [(&str, Vec<u8>, &str); 8] = [
        ("cut", good[..good.len() / 2].to_vec(), "this network cannot be run"),
        ("empty", Vec::new(), "this network cannot be run"),
        ("text", b"not a network at all".to_vec(), "this network cannot be run"),
        ("grey", plain(&sides(1, 8), &sides(1, 8)), "three channels"),
        ("three", plain(&sides(3, 8), &sides(3, 8)), "its output is not a picture"),
        ("huge", plain(&sides(3, 8192), &sides(1, 8192)), "more than"),
        ("nan", zero, "not a number"),
        ("unknown", unknown, "Magic"),
    ];
    for (name, bytes, expected) in &cases {
        streamed(&home, name, bytes, "1").refused(1, &[expected, name]);
    }
    for (depth, said) in [("matte:nowhere.onnx", "nowhere.onnx: No such file"), ("matte", "`bokehcam models get")] {
        home.run(&["stream", PORTRAIT, "--depth", depth, "--to", "null"]).failed(1, &[said]);
    }
}

#[test]
fn relative_depth_refuses_metres() {
    let home = Home::new();
    written(&home.0, "m.onnx", &matte(8, 4, WEIGHTS, 0.0));
    let stream = ["stream", PORTRAIT, "--depth", "matte:m.onnx", "--focus", "1.2", "--frames", "1", "--to", "null"];
    home.run(&stream).failed(2, &["--focus 1.2 needs distances"]);
}
