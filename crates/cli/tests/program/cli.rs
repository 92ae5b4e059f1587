//! The command line: output, refusals and exit codes.

use std::fs;

use crate::program::{Home, Ran, run};

#[cfg(feature = "camera")]
mod cameras;
mod commands;
mod service;

/// Returns the value of a setting and its origin, as `config dump` prints them.
fn dumped(dump: &str, name: &str) -> (String, String) {
    let line = dump.lines().find(|line| line.starts_with(&format!("{name} = "))).unwrap_or_else(|| panic!("{dump}"));
    let (value, origin) = line[name.len() + 3..].rsplit_once(" # ").unwrap();
    (value.to_string(), origin.to_string())
}

const COMMANDS: [&[&str]; 15] = [
    &["stream"],
    &["ctl"],
    &["service"],
    &["render"],
    &["depth"],
    &["record"],
    &["aperture"],
    &["bench"],
    &["devices"],
    &["doctor"],
    &["completions"],
    &["manual"],
    &["config"],
    &["config", "dump"],
    &["config", "save"],
];

#[test]
fn every_command_has_help_with_examples() {
    for command in [&[][..]].into_iter().chain(COMMANDS) {
        let help = run(&[command, &["--help"]].concat());
        assert_eq!((help.code, help.stderr.as_str()), (0, ""), "{command:?}");
        let example = format!("bokehcam {}", command.join(" "));
        let examples = help.stdout.split("Example").nth(1).unwrap_or_default();
        assert!(examples.contains(example.trim_end()), "{command:?}: {}", help.stdout);
    }
}

#[test]
fn the_version_is_the_packages() {
    let version = format!("bokehcam {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(run(&["-V"]).stdout, version);
    let long = run(&["--version"]).stdout;
    let parts = long.strip_prefix(&*version).unwrap().strip_prefix("built with ").unwrap().trim_end();
    let parts: Vec<&str> = parts.split(", ").collect();
    // Every feature of the program is listed, if it is on.
    let manifest = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let features = manifest["features"].as_table().unwrap().keys().map(String::as_str);
    let features: Vec<&str> = features.filter(|name| !["default", "packaged"].contains(name)).collect();
    assert!(parts.iter().all(|part| features.contains(part)), "{parts:?} of {features:?}");
    assert!(!cfg!(feature = "packaged") || features.iter().all(|name| *name == "lab" || parts.contains(name)));
}

#[test]
fn wrong_arguments_cost_one_line_and_exit_code_2() {
    let cases: [(&[&str], &str); 31] = [
        (
            &["stream", concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"), "--to", "null"],
            "a folder with a recording or pictures, a .mcap, .r3d or Kinect's .mkv file, demo or synthetic",
        ),
        (&["stream", "synthetic", "--to", "film.avi"], "FILE.mp4"),
        (&["stream", "synthetic", "--to", "null", "--loop", "--frames", "1"], "--loop are for recordings"),
        (&["stream", "demo", "--to", "null", "--start", "1", "--frames", "1"], "demo never ends"),
        (&["stream", "demo", "--depth", "stereo", "--to", "null"], "has one camera"),
        (&["stream", "demo", "--depth", "plate", "--to", "null"], "leave --depth out"),
        (&["stream", "synthetic", "--to", "null", "--f-number", "2"], "--sensor-width"),
        (&["stream", "synthetic", "--to", "null", "--size", "640"], "1280x720"),
        (&["stream", "synthetic", "--to", "null", "--depth", "none", "--effect", "dof"], "--effect blur"),
        (&["stream", "synthetic"], "--to"),
        (&["stream", "synthetic", "--to", "-", "--to", "-"], "-: given twice"),
        (&["stream", "synthetic", "--to", "window", "--to", "window"], "window: given twice"),
        (&["stream", "synthetic", "--to", "window", "--on-demand"], "--to pipewire or --to /dev/videoN"),
        (&["stream", "synthetic", "--to", "x/a.y4m", "--to", "null", "--to", "./x/a.y4m"], "twice"),
        (&["stream", "synthetic", "--to", "/dev/null", "--to", "/dev/../dev/null"], "twice"),
        (&["stream", "synthetic", "--to", "null", "--on-demand"], "--to pipewire or --to /dev/videoN"),
        (&["stream", "synthetic", "--to", "null", "--out-size", "640x480"], "--to /dev/videoN"),
        (&["stream", "synthetic", "--to", "/dev/video99", "--out-size", "641x480"], "642"),
        (&["render", "x.png"], "--out"),
        (&["frobnicate"], "frobnicate"),
        (&["aperture"], "--out"),
        (&["aperture", "--out", "x", "--size", "3"], "from 5 to 257"),
        (&["aperture", "--out", "x", "--apertures", "disc,blob"], "polygon:N"),
        (&["aperture", "--out", "x", "--apertures", "disc,disc"], "twice"),
        (&["config", "dump", "--rim", "1.5"], "from 0 to 1"),
        (&["config", "dump", "--intensity", "-2"], "from -1 to 1"),
        (&["config", "dump", "--rank", "99"], "1 to 16, or full"),
        (&["config", "dump", "--focus", "behind"], "METRES"),
        (&["config", "dump", "--quality", "superb"], "balanced"),
        (&["config", "dump", "--effect", "sepia"], "tilt-shift"),
        (&["config", "dump", "--coc-at-infinity", "9", "--f-number", "2"], "--f-number"),
    ];
    for (args, accepted) in cases {
        println!("{args:?}");
        run(args).refused(2, &[accepted]);
    }
}

#[test]
fn a_flag_goes_before_the_environment_before_the_file_before_the_default() {
    let home = Home::new();
    let dump = |flags: &[&str], environment: bool| {
        let mut command = home.command(&[&["config", "dump"], flags].concat());
        if environment {
            command.env("BOKEHCAM_RIM", "0.3").env("BOKEHCAM_LOOP", "true");
        }
        let ran = Ran::of(&mut command);
        assert_eq!(ran.done(), "");
        ran.stdout
    };
    let pair = |value: &str, origin: &str| (value.to_string(), origin.to_string());
    assert_eq!(dumped(&dump(&[], false), "rim").1, "default");
    assert_eq!(dumped(&dump(&[], false), "quality"), ("\"auto\"".to_string(), "default".to_string()));

    fs::create_dir_all(home.settings().parent().unwrap()).unwrap();
    fs::write(home.settings(), "rim = 0.4\nrank = \"full\"\n").unwrap();
    assert_eq!(dumped(&dump(&[], false), "rim"), pair("0.4", "file"));
    assert_eq!(dumped(&dump(&[], false), "rank"), pair("\"full\"", "file"));
    assert_eq!(dumped(&dump(&[], true), "rim"), pair("0.3", "environment"));
    assert_eq!(dumped(&dump(&[], true), "loop"), pair("true", "environment"));
    assert_eq!(dumped(&dump(&["--rim", "0.5"], true), "rim"), pair("0.5", "flag"));
    assert_eq!(dumped(&dump(&["--loop"], false), "loop"), pair("true", "flag"));
    assert_eq!(dumped(&dump(&["--loop=false"], true), "loop"), pair("false", "flag"));
}

#[test]
fn a_flag_sets_aside_what_it_excludes_in_the_file() {
    let home = Home::new();
    fs::write(home.path("mine.toml"), "coc-at-infinity = 20\n").unwrap();
    let ran = home.run(&["config", "dump", "--config", "mine.toml", "--f-number", "2"]);
    assert_eq!(ran.done(), "");
    assert_eq!(dumped(&ran.stdout, "f-number"), ("2".to_string(), "flag".to_string()));
    assert!(!ran.stdout.contains("\nblur = "), "{}", ran.stdout);
}

#[test]
fn the_dump_is_a_settings_file_that_dumps_the_same() {
    let home = Home::new();
    let flags = ["config", "dump", "--aperture", "polygon:6:15", "--focus", "0.5,0.25", "--force", "--intensity=-0.5"];
    let first = home.run(&flags);
    fs::write(home.path("saved.toml"), &first.stdout).unwrap();
    let second = home.run(&["--config", "saved.toml", "config", "dump"]);
    assert_eq!(second.done(), "");
    let values = |dump: &str| {
        let lines = dump.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        lines.map(|line| line.rsplit_once(" # ").unwrap().0.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(values(&first.stdout), values(&second.stdout));
    assert!(values(&first.stdout).contains(&"aperture = \"polygon:6:15\"".to_string()));
    assert!(values(&first.stdout).len() > 15);
}

#[test]
fn an_unknown_key_in_the_file_is_named_with_its_line() {
    let home = Home::new();
    fs::write(home.path("mine.toml"), "rim = 0.1\n\napertur = \"disc\"\n").unwrap();
    let dump = |file: &str| home.run(&["config", "dump", "--config", file]);
    dump("mine.toml").refused(2, &["mine.toml:3: ", "did you mean aperture?"]);
    let ran = dump("/nowhere.toml");
    assert!(ran.code != 0 && ran.stderr.contains("/nowhere.toml"), "{}", ran.stderr);
}
