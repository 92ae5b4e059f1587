//! The commands of README.md and docs/, one after the other as somebody follows them, each page in a fresh folder.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// What no test can run: a part of the command, and why.
const LEFT_OUT: [(&str, &str); 27] = [
    ("sudo ", "needs root"),
    ("systemctl ", "needs a session, and starts something in it"),
    ("journalctl ", "needs a session"),
    ("gst-", "needs GStreamer: gst/test follows it"),
    ("GST_PLUGIN_PATH", "needs GStreamer"),
    ("cargo build", "builds"),
    ("pip install", "needs a network"),
    ("cargo install", "needs a network, and installs"),
    ("scripts/", "builds everything, or needs pictures of a chessboard"),
    ("python/test", "builds everything, and needs a network"),
    ("python/wheel", "needs maturin"),
    ("bokehcam.farm", "needs Ray"),
    ("parallel --joblog", "needs GNU parallel"),
    ("sbatch ", "needs Slurm"),
    ("bokehcam models add", "needs a file from elsewhere"),
    ("--depth matte", "needs a network that is installed"),
    ("bokehcam plate", "needs a camera"),
    ("bokehcam preview", "needs a screen"),
    ("/dev/video", "needs a camera"),
    ("pipewire", "needs PipeWire's daemons"),
    ("bokehcam devices", "says what this machine has"),
    ("bokehcam doctor", "judges this machine"),
    ("bokehcam ctl", "needs a stream that runs"),
    ("UNIX-CONNECT", "needs a stream that runs"),
    ("gsettings", "needs GNOME"),
    ("org.gnome", "needs GNOME"),
    ("bokehcam bench", "measures this machine, for minutes"),
];

/// The commands in the `sh` blocks of a page, without their comments; one that goes on in the next line is whole.
fn commands(page: &str) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let (mut inside, mut goes_on) = (false, false);
    for line in page.lines() {
        match line.trim_end() {
            "```sh" => inside = true,
            "```" => inside = false,
            line if inside => {
                let code = line.split_once(" # ").map_or(line, |(code, _)| code).trim_end();
                match commands.last_mut().filter(|_| goes_on) {
                    Some(last) => *last += code,
                    None => commands.push(code.to_owned()),
                }
                goes_on = code.ends_with(['\\', '|']);
                if let Some(last) = commands.last_mut().filter(|_| goes_on) {
                    *last = format!("{} ", last.trim_end_matches('\\').trim_end());
                }
            }
            _ => {}
        }
    }
    commands
}

/// A folder as its owner has it: the repository's recordings, and pictures by the names that the pages use.
fn stand_ins(folder: &Path) {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::os::unix::fs::symlink(repository.join("recordings"), folder.join("recordings")).unwrap();
    let copy = |from: &str, to: &str| {
        fs::copy(repository.join("recordings").join(from), folder.join(to)).unwrap();
    };
    for left in ["left.png", "im0.png"] {
        copy("stereo/image_2/000000.png", left);
    }
    for right in ["right.png", "im1.png"] {
        copy("stereo/image_3/000000.png", right);
    }
    let calibration = "cam0=[640 0 319.5; 0 640 179.5; 0 0 1]\ncam1=[640 0 319.5; 0 640 179.5; 0 0 1]\ndoffs=0\n\
                       baseline=60\nwidth=640\nheight=360\nndisp=96\n";
    fs::write(folder.join("calib.txt"), calibration).unwrap();
    for color in ["photo.jpg", "NAME-color.png"] {
        copy("portrait/rgb/000000.png", color);
    }
    copy("portrait/depth/000000.png", "depth.png");
    let mut snapshot = png::Encoder::new(fs::File::create(folder.join("NAME.png")).unwrap(), 1, 1);
    snapshot.add_itxt_chunk("bokehcam".to_string(), "--effect=blur\n--rim=0.5\n".to_string()).unwrap();
    snapshot.write_header().unwrap().write_image_data(&[0]).unwrap();

    let programs = folder.join("programs");
    fs::create_dir(&programs).unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_bokehcam"), programs.join("bokehcam")).unwrap();
    fs::write(programs.join("ffplay"), "#!/bin/sh\nexec cat >/dev/null\n").unwrap();
    fs::set_permissions(programs.join("ffplay"), std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
}

/// Runs the commands of a page; at least `least` of them, so that none is left out by mistake.
fn follow(page: &str, least: usize) {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    stand_ins(folder.path());
    let path = format!("{}:{}", folder.path().join("programs").display(), std::env::var("PATH").unwrap());
    let mut ran = 0;
    for command in commands(&text) {
        if let Some((_, why)) = LEFT_OUT.iter().find(|(part, _)| command.contains(part)) {
            println!("left out, {why}: {command}");
            continue;
        }
        let mut shell = Command::new("bash");
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("BOKEHCAM_") {
                shell.env_remove(name);
            }
        }
        shell.args(["-o", "pipefail", "-c", &command]).current_dir(&folder).stdin(Stdio::null());
        shell.env("PATH", &path).env("HOME", folder.path().join("home"));
        shell.env_remove("XDG_CONFIG_HOME").env_remove("RUST_LOG");
        let output = shell.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{page}: `{command}` ends with {}: {said}", output.status);
        println!("ran: {command}");
        ran += 1;
    }
    assert!(ran >= least, "{page}: {ran} commands ran, where {least} can");
}

#[test]
fn commands_are_found_in_pages() {
    let page = "text\n```sh\na b   # why\nc \\\n  d |\n    e\n```\n```toml\nx = 1\n```\n`y`\n";
    assert_eq!(commands(page), ["a b", "c   d |     e"]);
}

#[test]
#[ignore = "needs ffmpeg"]
fn the_readme_can_be_followed_line_by_line() {
    follow("README.md", 9);
}

#[test]
fn the_pages_can_be_followed_line_by_line() {
    for (page, least) in [("docs/algorithm.md", 1), ("docs/settings.md", 5), ("docs/stereo.md", 2)] {
        follow(page, least);
    }
    for page in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")).unwrap() {
        let name = page.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".md") && !["algorithm.md", "settings.md", "stereo.md"].contains(&name.as_str()) {
            follow(&format!("docs/{name}"), 0);
        }
    }
}
