//! Format of messages: one line, JSON if requested, without control characters.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;

use crate::program::{Home, Ran};

#[test]
fn numbers_below_zero_reach_the_option_that_they_are_for() {
    for (option, value, said) in [
        ("--focus", "-1", "METRES above 0"),
        ("--focus", "-0.5,0.2", "fractions of width and height"),
        ("--coc-at-infinity", "-3%", "from 0 to 20000"),
        ("--max-coc", "-2", "from 0 to 20000"),
        ("--rim", "-0.1", "from 0 to 1"),
        ("--highlights", "-1", "from 0 to 1000"),
        ("--depth-scale", "-5000", "above 0"),
        ("--depth-invalid", "-1", "from 0 to 65535"),
        ("--f-number", "-2", "above 0"),
        ("--tilt", "-1", "0.6:0.1:15"),
        ("--frames", "-1", "use a whole number from 1"),
        ("--frames", "1e3", "use a whole number from 1"),
        ("--frames", "0", "use a whole number from 1"),
        ("--depth-scale", "1e300", "use a number above 0, up to 3.4"),
        ("--depth-invalid", "NaN", "use a whole number from 0 to 65535"),
        ("--start", "-1", "seconds from 0"),
        ("--fps", "-5", "from 0.1 to 1000"),
        ("--threads", "-2", "from 1 to 1024"),
        ("--threads", "0", "use a whole number from 1 to 1024"),
        ("--max-disparity", "-16", "16 to 256"),
        ("--budget-ms", "-1", "above 0"),
        ("--rank", "-3", "1 to 16"),
    ] {
        let ran = Home::new().run(&["config", "dump", option, value]);
        ran.refused(2, &[said]);
        assert!(!ran.stderr.contains("tip:"), "{}", ran.stderr);
    }
    Home::new().run(&["config", "dump", "--force=maybe"]).refused(2, &["use true or false"]);
    let feather = ["render", "photo.png", "--out", "x.png", "--mask", "m.png", "--mask-feather", "NaN"];
    Home::new().with_photo().run(&feather).refused(2, &["use a whole number from 0 to 200"]);
    let short = Home::new().with_photo().run(&["render", "photo.png", "-o", "x.png"]);
    short.refused(2, &["there is no option -o of `render`, did you mean --out?"]);
    let open = Home::new().with_settings("blur = \"3\n").run(&["config", "dump"]);
    open.refused(2, &["config.toml:1: write NAME = VALUE, and text in double quotes"]);
    assert!(Home::new().run(&["config", "dump", "--intensity", "-0.5"]).stdout.contains("intensity = -0.5 # flag"));
}

#[test]
fn a_mistyped_folder_is_a_folder_and_the_right_one_is_named() {
    let home = Home::new().with_recording();
    let stream = |source: &str| home.run(&["stream", source, "--to", "null"]);
    stream("./recordng").refused(1, &["there is no such folder, did you mean ./recording?"]);
    stream("nowhere/at/all").refused(1, &["there is no such folder; use"]);
    fs::write(home.path("clip.mp4"), "").unwrap();
    stream("cilp.mp4").refused(1, &["'cilp.mp4' for '<SOURCE>': there is no such file, did you mean clip.mp4?"]);
    let missing = stream("../nowhere/FILE.mp44");
    assert!(missing.refused(1, &["there is no such file"]).trim_end().ends_with("there is no such file"));
    stream("").refused(2, &["the name is empty: use "]);
    if cfg!(feature = "camera") {
        stream("recordng").refused(1, &["there is no camera 'recordng'", "did you mean the folder recording?"]);
    }
}

#[test]
fn a_folder_whose_name_is_no_text_works_and_other_arguments_are_named() {
    let home = Home::new().with_recording();
    let name = OsStr::from_bytes(b"caf\xe9");
    fs::rename(home.path("recording"), home.path(name)).unwrap();
    for args in [&["stream", "--to", "null", "--backend", "cpu"][..], &["record", "--to", "other"]] {
        Ran::of(home.command(args).arg(name)).done();
    }
    let ran = Ran::of(home.command(&["stream", "synthetic", "--to"]).arg(name));
    ran.refused(2, &["'caf\\xe9' is not UTF-8 text"]);
}

#[test]
fn with_json_every_line_is_an_object() {
    let home = Home::new().with_photo().with_recording();
    let json = |args: &[&str], code: i32| {
        let ran = home.run(&[args, &["--log-format", "json"]].concat());
        assert_eq!(ran.code, code, "{}", ran.stderr);
        let objects = ran.stderr.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{line}")));
        objects.collect::<Vec<serde_json::Value>>()
    };
    let stream = ["stream", "recording", "--to", "null", "--backend", "cpu", "--fps", "9", "-v"];
    let lines = json(&stream, 0);
    assert!(
        lines.iter().any(|line| line["level"] == "WARN" && line["fields"]["message"].to_string().contains("--fps 9"))
    );
    let report = lines.last().unwrap();
    assert!(report["level"] == "INFO" && report["fields"]["message"].as_str().unwrap().starts_with("4 of 4 frames"));
    assert!(lines.iter().all(|line| line["timestamp"].is_string() && line["target"].is_string()), "{lines:?}");
    for (args, code) in [
        (&["render", "nowhere.png", "--out", "out.png"][..], 1),
        (&["render", "photo.png", "--out", "out.png", "--rim", "7"], 2),
        (&["stream", "nowhere/", "--to", "null"], 1),
    ] {
        let lines = json(args, code);
        assert_eq!((lines.len(), &lines[0]["level"]), (1, &"ERROR".into()), "{lines:?}");
    }
}

#[test]
fn nothing_that_a_terminal_would_obey_reaches_it() {
    let home = Home::new().with_recording();
    let nasty = "a\u{1b}[2J\u{9b}31m\r\nb";
    let file = home.path(nasty);
    fs::write(&file, "\"\\u001b]0;title\\u0007\" = 1\n").unwrap();
    fs::write(home.path("plain.toml"), "\"\\u001b]0;title\\u0007\" = 1\n").unwrap();
    fs::rename(home.path("recording"), home.path("re\u{1b}cording")).unwrap();
    for args in [
        &["render", &format!("{nasty}.png"), "--out", "out.png"][..],
        &["config", "dump", "--config", nasty],
        &["config", "dump", "--config", "plain.toml"],
        &["stream", nasty, "--to", "null"],
        &["stream", "synthetic", "--to", nasty, "--frames", "1", "--size", "16x12", "--aperture", "image:\u{1b}c"],
        &["stream", "re\u{1b}cording", "--to", "null", "--backend", "cpu", "-v"],
        &["render", "x.png", "--out", "x\u{7}.gif", "--preset", "\u{1b}c"],
    ] {
        let ran = home.run(args);
        let acts = |c: char| c.is_control() && c != '\n';
        assert!(!ran.stderr.contains(acts) && !ran.stdout.contains(acts), "{args:?}: {:?}", ran.stderr);
        if ran.code != 0 {
            assert_eq!(ran.stderr.lines().count(), 1, "{args:?}: {}", ran.stderr);
        }
    }
}

#[test]
fn what_is_not_understood_is_answered_in_the_words_of_who_asked() {
    let home = Home::new().with_photo();
    fs::write(home.path("text.png"), "hello").unwrap();
    fs::write(home.path("clip.mp4"), "video").unwrap();
    let render = ["render", "photo.png", "--out", "o.png"];
    for (args, code, said) in [
        (
            &["stream", "demo", "--to", "null", "--mask", "m.png"][..],
            2,
            "no option --mask of `stream`: it is for `render`",
        ),
        (
            &["record", "demo", "--to", "r", "--keep-going"],
            2,
            if cfg!(feature = "window") {
                "--keep-going of `record`: it is for `preview`, `stream`"
            } else {
                "--keep-going of `record`: it is for `stream`"
            },
        ),
        (&["render", "photo.png", "--background", "w.jpg"], 2, "did you mean --behind?"),
        (&["render", "photo.png", "--blurr", "3"], 2, "no option --blurr of `render`, did you mean --blur?"),
        (&["render", "-dash.png", "--out", "o.png"], 2, "is ./-dash.png"),
        (&["render", "photo.png", "depth.png", "--out", "o.png"], 2, "--depth-map FILE"),
        (&["render", "photo.png", "--out", "o.png", "--backend", "cuda"], 2, "[possible values: auto, gpu, cpu]"),
        (&["render", "photo.png", "--out", "o.png", "--depth", "mate"], 2, "did you mean matte?"),
        (&["render", "photo.png", "--out", "o.png", "--depth-unit", "cm"], 2, "millimetres, scale:N"),
        (&["render", "text.png", "--out", "o.png"], 1, "text.png: not a PNG, JPEG, TIFF, WebP, BMP, PNM or GIF file"),
        (&["render", "photo.png", "--out", "o.xyz"], 2, "--out o.xyz: no format is known for this name; end it with"),
        (&["render", "photo.png", "--out", "o.gif"], 2, "--out o.gif: no format is known"),
        (&["render", "photo.png", "--out", "o"], 2, "--out o: no format is known"),
        (&["plate", "photo.png", "--to", "o.gif"], 2, "--to o.gif: no format is known"),
        (&["render", "gone.png", "--out", "o.png"], 1, "gone.png: there is no such file"),
        (&["config", "dump", "--config", "gone.toml"], 1, "gone.toml: there is no such file"),
        (&["render", "photo.png", "--out", "o.png", "--depth-map", "photo.png"], 1, "colours have no order"),
        (&["stream", "clip.mp4", "--to", "null"], 1, "ffmpeg"),
        (&["stream", "https://a.org/clip.mp4", "--to", "null"], 2, "ffmpeg -i 'https://a.org/clip.mp4'"),
        (&["record", "demo", "--to", "rec.mp4"], 2, "a recording is a folder"),
    ] {
        let ran = home.run(args);
        ran.refused(code, &[said]);
        assert!(!ran.stderr.contains("tip:") && !ran.stderr.contains("os error"), "{}", ran.stderr);
    }
    for behind in ["green", "photo.png", "#00ff00"] {
        home.run(
            &[&render[..], &["--force", "--backend", "cpu", "--depth-map", "depth.png", "--behind", behind]].concat(),
        )
        .done();
    }
    assert!(!home.path("rec.mp4").exists());
}

/// Warnings of the library and of the command line have the same format.
#[test]
fn all_warnings_look_alike() {
    let home = Home::new().with_photo();
    fs::create_dir(home.path("pictures")).unwrap();
    fs::copy(home.path("photo.png"), home.path("pictures/1.png")).unwrap();
    let ran =
        home.run(&["stream", "pictures", "--to", "null", "--backend", "cpu", "--effect", "blur", "--tilt", "0.5"]);
    let warnings: Vec<&str> =
        ran.done().lines().filter(|line| line.contains("without lists") || line.contains("--tilt")).collect();
    assert_eq!(warnings.len(), 2, "{}", ran.stderr);
    assert!(warnings.iter().all(|line| line.starts_with("warning: ")), "{}", ran.stderr);
}

#[test]
fn a_run_says_where_it_goes_and_how_it_went_and_its_times_where_they_are_wanted() {
    let home = Home::new().with_recording();
    let stream = ["stream", "recording", "--to", "null", "--backend", "cpu"];
    let said: Vec<String> = home.run(&stream).done().lines().map(str::to_owned).collect();
    assert!(
        said.len() == 2 && said[0].ends_with("recording, to null") && said[1].contains("frames delivered"),
        "{said:?}"
    );
    assert!(home.run(&[&stream[..], &["-v"]].concat()).done().contains("blur ms: p50"));
}

#[test]
fn a_report_can_go_to_standard_output() {
    let home = Home::new();
    let args = ["stream", "synthetic", "--size", "32x24", "--frames", "2", "--effect", "none", "--report", "-", "--to"];
    let ran = home.run(&[&args[..], &["null"]].concat());
    ran.done();
    assert_eq!(ran.json()["frames"]["delivered"], 2);
    assert!(!home.path("-").exists());
    home.run(&[&args[..], &["-"]].concat()).refused(2, &["--report - and --to -"]);
}

#[test]
fn advice_names_options_that_there_are() {
    let home = Home::new().with_recording();
    let list = fs::read_to_string(home.path("recording/depth.txt")).unwrap();
    let later = |line: &str| match line.split_once(' ') {
        Some((time, file)) if !line.starts_with('#') => format!("{} {file}", time.parse::<f64>().unwrap() + 99.0),
        _ => line.to_owned(),
    };
    fs::write(home.path("recording/depth.txt"), list.lines().map(later).collect::<Vec<_>>().join("\n")).unwrap();
    let ran = home.run(&["stream", "recording", "--to", "null"]);
    ran.refused(1, &["no depth map lies within 20 ms"]);
    assert!(!ran.stderr.contains("tolerance"), "{}", ran.stderr);
}
