//! Each command with valid arguments.

use std::fs;
use std::process::Stdio;

use crate::program::{Home, Ran, json, run};

/// Creates a home with `recording`, three small frames.
fn recorded() -> Home {
    let home = Home::new();
    let ran = home.run(&["record", "synthetic", "--size", "64x48", "--frames", "3", "--to", "recording"]);
    assert_eq!((ran.code, ran.stdout.as_str()), (0, ""), "{}", ran.stderr);
    home
}

#[test]
fn a_recording_becomes_pictures_and_a_report_that_adds_up() {
    let home = recorded();
    // On the CPU, as a GPU driver may write to stderr itself.
    let args = ["stream", "recording", "--backend", "cpu", "--to", "out/", "--report", "report.json"];
    let ran = home.run(&args);
    assert_eq!((ran.code, ran.stdout.as_str()), (0, ""), "{}", ran.stderr);
    let said: Vec<&str> = ran.stderr.lines().collect();
    assert!(said[0].ends_with(", to PNG files in out/"), "{said:?}");
    assert!(said[1].starts_with("3 of 3 frames delivered"), "{said:?}");

    let report = json(home.path("report.json"));
    assert_eq!((&report["frames"]["captured"], &report["frames"]["delivered"]), (&3.into(), &3.into()));
    assert_eq!(report["quality"]["balanced"], 1.0);
    let original = image::open(home.path("recording/rgb/000001.png")).unwrap().to_rgb8();
    let blurred = image::open(home.path("out/000001.png")).unwrap().to_rgb8();
    assert_eq!(original.dimensions(), blurred.dimensions());
    assert_ne!(original, blurred);

    let again = home.run(&args);
    assert!(again.code == 1 && again.stderr.contains("--force"), "{}", again.stderr);
}

#[test]
fn depth_can_come_from_another_recording() {
    let home = recorded();
    let stream = |flags: &[&str]| {
        let args = ["stream", "recording", "--backend", "cpu", "--to", "null"];
        home.run(&[&args, flags].concat())
    };
    let ran = stream(&["--depth", "./recording"]);
    assert!(ran.code == 0 && ran.stderr.contains("\n3 of 3 frames delivered"), "{}", ran.stderr);
    let ran = stream(&["--depth", "./recording", "--effect", "blur"]);
    assert!(ran.code == 2 && ran.stderr.contains("only --effect dof"), "{}", ran.stderr);
    let ran = stream(&["--depth", "none", "--effect", "blur", "--depth-calibration", "c.toml"]);
    assert!(ran.code == 0 && ran.warning().contains("--depth-calibration c.toml (depth does not"), "{}", ran.stderr);
    let ran = stream(&["--depth-calibration", "c.toml"]);
    assert!(ran.code != 0 && ran.stderr.starts_with("error: c.toml"), "{}", ran.stderr);
    let ran = stream(&["--depth", "no such camera"]);
    assert!(ran.code != 0 && ran.stderr.starts_with("error: --depth"), "{}", ran.stderr);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
}

#[test]
fn effect_none_passes_frames_through_and_mirror_turns_them() {
    let home = recorded();
    let args = ["stream", "recording", "--to", "out/", "--effect", "none", "--mirror", "--start", "0.03", "-q"];
    assert_eq!(home.run(&args).done(), "");
    let original = image::open(home.path("recording/rgb/000001.png")).unwrap().to_rgb8();
    let mirrored = image::open(home.path("out/000000.png")).unwrap().fliph().to_rgb8();
    assert!(original == mirrored, "the second frame, mirrored, comes first");
}

#[test]
fn one_picture_is_blurred_by_each_effect_and_its_file_is_safe() {
    let home = recorded();
    const IMAGE: &str = "recording/rgb/000000.png";
    let out = home.path("out.png");
    let render = |more: &[&str]| home.run(&[&["render", IMAGE, "--out", "out.png"], more].concat());
    let mut seen = vec![image::open(home.path(IMAGE)).unwrap().to_rgb8()];
    for more in [
        &["--depth-map", "recording/depth/000000.png"][..],
        &["--effect", "blur", "--coc-at-infinity", "5", "--force"],
        &["--effect", "tilt-shift", "--coc-at-infinity", "5", "--force"],
    ] {
        let ran = render(more);
        assert_eq!((ran.code, ran.stdout.as_str()), (0, ""), "{}", ran.stderr);
        let result = image::open(&out).unwrap().to_rgb8();
        assert!(seen.iter().all(|other| *other != result), "{more:?} is something of its own");
        seen.push(result);
    }
    let refused = render(&["--effect", "none"]);
    assert!(refused.code == 1 && refused.stderr.contains("--force"), "{}", refused.stderr);
    assert!(image::open(&out).unwrap().to_rgb8() == seen[3], "what was there stays");
    render(&["--effect", "none", "--force"]).done();
    assert!(image::open(&out).unwrap().to_rgb8() == seen[0]);
}

#[test]
fn an_aperture_can_be_a_picture() {
    let home = recorded();
    let cat = image::GrayImage::from_fn(9, 9, |x, _| image::Luma([if x < 3 { 255 } else { 0 }]));
    cat.save(home.path("cat.png")).unwrap();
    let stream = |aperture: &str| home.run(&["stream", "recording", "--to", "null", "--aperture", aperture]);
    stream("image:cat.png").done();
    let ran = stream("image:nowhere.png");
    assert!(ran.code == 1 && ran.stderr.contains("nowhere.png"), "{}", ran.stderr);
}

#[test]
fn bench_measures_every_combination() {
    let args = ["bench", "--sizes", "64x48,17x13", "--coc", "2,4", "--threads", "1,2", "--frames", "3", "--json"];
    let ran = run(&[&args[..], &["--backend", "cpu"]].concat());
    assert_eq!(ran.done(), "");
    let lines: Vec<serde_json::Value> = ran.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 8);
    for line in &lines {
        let time = |key: &str| line[key].as_f64().unwrap();
        assert!(0.0 < time("p50_ms") && time("p50_ms") <= time("p95_ms") && time("p95_ms") <= time("max_ms"), "{line}");
    }
    assert!(lines[0]["executor"].as_str().unwrap().contains("1 thread"), "{}", lines[0]);
}

#[test]
fn benched_frames_arrive_at_the_given_rate() {
    let began = std::time::Instant::now();
    run(&["bench", "--sizes", "17x13", "--backend", "cpu", "--frames", "8", "--fps", "20", "--json"]).done();
    assert!(began.elapsed() >= std::time::Duration::from_secs(8) / 20);
    run(&["bench", "--fps", "0"]).refused(2, &["--fps", "from 1 to 1000"]);
}

#[test]
fn y4m_on_standard_output_is_nothing_but_y4m() {
    let home = recorded();
    let output = home.command(&["stream", "recording", "--to", "-"]).output().unwrap();
    assert!(output.status.success());
    let header_end = output.stdout.iter().position(|&byte| byte == b'\n').unwrap() + 1;
    assert!(output.stdout.starts_with(b"YUV4MPEG2 W64 H48 "));
    assert_eq!(output.stdout.len() - header_end, 3 * ("FRAME\n".len() + 64 * 48 * 3 / 2));
}

#[test]
fn one_stream_goes_to_several_sinks() {
    let home = Home::new();
    let args = ["stream", "synthetic", "--size", "16x12", "--frames", "2", "--effect", "none", "--quiet", "--to", "-"];
    let output = home.command(&args).args(["--to", "a.y4m"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.stdout.windows(6).filter(|bytes| bytes == b"FRAME\n").count(), 2);
    assert_eq!(fs::read(home.path("a.y4m")).unwrap(), output.stdout);
}

#[test]
fn completions_name_the_commands_in_each_shell() {
    for shell in ["bash", "zsh", "fish"] {
        let script = run(&["completions", shell]);
        assert_eq!(script.code, 0);
        for word in ["aperture", "config", "dump", "intensity", "tilt-shift"] {
            assert!(script.stdout.contains(word), "{shell}: {word}");
        }
    }
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let home = Home::new();
    let mut child =
        home.command(&["completions", "bash"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(Ran::from(child.wait_with_output().unwrap()).done(), "");
}

#[test]
fn the_aperture_analysis_is_whole_and_is_not_overwritten_unasked() {
    let home = Home::new();
    let out = home.path("kernels");
    let args = ["aperture", "--apertures", "disc,star:5", "--size", "33", "--out", "kernels"];
    let first = home.run(&args);
    assert_eq!((first.code, first.stdout.as_str()), (0, ""), "{}", first.stderr);
    let mut files: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["aperture.json", "disc.png", "errors.svg", "star-5.png"]);
    let table = json(out.join("aperture.json"));
    // McGraw 2015: kernels of 33 taps with a hard rim; the disc has an error of 18.7 % at rank 2.
    let disc = &table["apertures"][0];
    assert_eq!(disc["aperture"], "disc");
    assert_eq!(disc["singular_values"].as_array().unwrap().len(), 33);
    let error = disc["ranks"][1]["truncation_error"].as_f64().unwrap();
    assert!((error - 0.187).abs() < 0.003, "{error}");
    let sheet = image::open(out.join("star-5.png")).unwrap().to_rgb8();
    assert!(sheet.pixels().any(|pixel| pixel.0 == [255; 3]), "the kernel is white");

    fs::write(out.join("disc.png"), "mine").unwrap();
    let second = home.run(&args);
    assert_eq!(second.code, 1);
    assert!(second.stderr.contains("exists") && second.stderr.contains("--force"), "{}", second.stderr);
    assert_eq!(fs::read(out.join("disc.png")).unwrap(), b"mine");

    home.run(&[&args[..], &["--force"]].concat()).done();
    assert_ne!(fs::read(out.join("disc.png")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(&out).unwrap().count(), 4, "no leftovers");
}

#[cfg(not(feature = "camera"))]
#[test]
fn without_cameras_the_commands_about_them_say_so() {
    for command in ["devices", "doctor"] {
        run(&[command]).refused(1, &["built without cameras"]);
    }
}
