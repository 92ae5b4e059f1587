//! Runs the commands of README.md and docs/, in code blocks and in sentences, in their order, each page in a new
//! folder.
#![allow(missing_docs)]

#[allow(dead_code)] // Only one of its networks is used here.
use crate::onnx;
mod pages;

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use crate::program::{Beside, PROGRAM, ROOT, in_session, until, without};

/// Commands of other programs, and builds, that are skipped: a part of the command, and the reason.
const LEFT_OUT: [(&str, &str); 17] = [
    ("sudo ", "needs root"),
    ("systemctl ", "needs a session, and starts something in it"),
    ("journalctl ", "needs a session"),
    ("gst-", "needs GStreamer: gst/tests follows it"),
    ("GST_PLUGIN_PATH", "needs GStreamer"),
    ("cargo ", "builds"),
    ("pip install", "needs a network"),
    ("scripts/", "builds everything, or needs pictures of a chessboard"),
    ("python/", "builds everything, and needs a network"),
    ("bokehcam.farm", "needs Ray"),
    ("parallel --joblog", "needs GNU parallel"),
    ("sbatch ", "needs Slurm"),
    ("UNIX-CONNECT", "needs socat"),
    ("gdbus ", "needs a session's message bus"),
    ("gnome-shell", "needs GNOME"),
    ("gnome-extensions", "needs GNOME"),
    ("git clone", "needs a network"),
];

/// Commands of this program whose arguments are only checked: a part of the command, and the reason.
const ONLY_CHECKED: [(&str, &str); 12] = [
    ("bokehcam models add", "needs a file from elsewhere"),
    ("bokehcam models get", "needs a network"),
    ("bokehcam plate", "needs a camera"),
    ("bokehcam preview", "needs a screen"),
    ("bokehcam ctl depth", "needs a preview, which needs a screen"),
    ("/dev/video", "needs a camera"),
    ("pipewire", "needs PipeWire's daemons"),
    ("bokehcam service", "needs a session, and starts something in it"),
    ("bokehcam devices", "says what this machine has"),
    ("bokehcam doctor", "judges this machine"),
    ("bokehcam bench", "measures this machine, for minutes"),
    ("somewhere/", "needs a data set"),
];

/// A missing settings file: the program parses all other arguments before it refuses this one.
const NO_SETTINGS: &str = "no-settings.toml";

/// Commands that read no settings.
const WITHOUT_SETTINGS: [&str; 6] = ["completions", "ctl", "devices", "doctor", "models", "service"];

/// The state of a page's run: a user's folder with the repository's recordings, and pictures by the pages' file names.
struct Follower {
    folder: tempfile::TempDir,
    /// The stream for `bokehcam ctl`, once started.
    running: Option<Beside>,
}

impl Follower {
    fn new() -> Self {
        let follower = Self { folder: tempfile::tempdir().unwrap(), running: None };
        let repository = Path::new(ROOT);
        symlink(repository.join("recordings"), follower.path("recordings")).unwrap();
        let copy = |from: &str, to: &str| {
            fs::copy(repository.join("recordings").join(from), follower.path(to)).unwrap();
        };
        for left in ["left.png", "im0.png"] {
            copy("stereo/image_2/000000.png", left);
        }
        for right in ["right.png", "im1.png"] {
            copy("stereo/image_3/000000.png", right);
        }
        let calibration = "cam0=[640 0 319.5; 0 640 179.5; 0 0 1]\ncam1=[640 0 319.5; 0 640 179.5; 0 0 1]\ndoffs=0\n\
                           baseline=60\nwidth=640\nheight=360\nndisp=96\n";
        fs::write(follower.path("calib.txt"), calibration).unwrap();
        for color in ["photo.jpg", "NAME-color.png"] {
            copy("portrait/rgb/000000.png", color);
        }
        copy("portrait/depth/000000.png", "depth.png");
        fs::copy(repository.join("fuzz/seeds/embedded_depth/gdepth.jpg"), follower.path("PHONE.jpg")).unwrap();
        // Any picture is a mask.
        copy("portrait/rgb/000000.png", "MASK.png");
        let mut snapshot = png::Encoder::new(fs::File::create(follower.path("NAME.png")).unwrap(), 1, 1);
        snapshot.add_itxt_chunk("bokehcam".to_string(), "--effect=blur\n--rim=0.5\n".to_string()).unwrap();
        snapshot.write_header().unwrap().write_image_data(&[0]).unwrap();
        // A network that takes bright pixels for the person, or for near ones.
        fs::write(follower.path("small.onnx"), onnx::matte(64, 36, [4.0, 4.0, 4.0], -6.0)).unwrap();

        for folder in ["programs", "home", "session"] {
            fs::create_dir(follower.path(folder)).unwrap();
        }
        fs::set_permissions(follower.path("session"), PermissionsExt::from_mode(0o700)).unwrap();
        symlink(PROGRAM, follower.path("programs/bokehcam")).unwrap();
        fs::write(follower.path("programs/ffplay"), "#!/bin/sh\nexec cat >/dev/null\n").unwrap();
        fs::set_permissions(follower.path("programs/ffplay"), PermissionsExt::from_mode(0o755)).unwrap();
        follower
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn shell(&self, command: &str) -> Command {
        let mut shell = without(in_session(Command::new("bash")), &["XDG_"]);
        shell.args(["-o", "pipefail", "-c", command]).current_dir(&self.folder);
        let path = format!("{}:{}", self.path("programs").display(), std::env::var("PATH").unwrap());
        shell.env("PATH", path).env("HOME", self.path("home")).env("XDG_RUNTIME_DIR", self.path("session"));
        // The maximum width of help texts.
        shell.env("COLUMNS", "110");
        shell
    }

    fn output(&self, command: &str) -> Output {
        self.shell(command).output().unwrap()
    }

    /// Starts a stream for `bokehcam ctl`, once.
    fn start_a_stream(&mut self) {
        if self.running.is_some() {
            return;
        }
        let stream = "exec bokehcam --quiet stream demo --pace realtime --to null --name desk";
        self.running = Some(Beside::start(&mut self.shell(stream)));
        let answers = || self.output("bokehcam ctl status").status.success();
        until("the stream answers", Duration::from_secs(60), answers);
    }

    /// Checks that the program accepts the arguments of a command that cannot run here, which settings that are not there
    /// or `--help` keep from running; unavailable sources become `demo`.
    fn check(&self, command: &str) -> Result<(), String> {
        let command = command.split(['>', '|']).next().unwrap_or_default().trim_end();
        let mut words: Vec<&str> = command.split(' ').collect();
        if let [_, "stream" | "preview" | "plate" | "record", source, ..] = &mut words[..] {
            let elsewhere = ["/dev/", "pipewire:", "C920", "OBS", "somewhere/"];
            let is_number = source.starts_with(|first: char| first.is_ascii_digit());
            if is_number || elsewhere.iter().any(|begin| source.starts_with(begin)) {
                *source = "demo";
            }
        }
        let reads_settings = !matches!(words[..], [_, command, ..] if WITHOUT_SETTINGS.contains(&command));
        let end = if reads_settings { format!("--config {NO_SETTINGS}") } else { "--help".to_owned() };
        let ran = self.output(&format!("{} {end}", words.join(" ")));
        let said = String::from_utf8_lossy(&ran.stderr);
        let is_accepted = match reads_settings {
            true => ran.status.code() == Some(1) && said.contains(NO_SETTINGS),
            false => ran.status.success(),
        };
        match is_accepted {
            true => Ok(()),
            false => Err(said.into_owned()),
        }
    }

    /// Runs a command, or only checks its arguments; returns whether it ran.
    fn follow(&mut self, command: &str) -> Result<bool, String> {
        // The known networks are not installed here, so the small one replaces them.
        let command = ["matte", "mono"].iter().fold(command.to_owned(), |command, task| {
            let of_our_own = format!("{task}:small.onnx");
            command.split(' ').map(|word| named(word, task, &of_our_own)).collect::<Vec<_>>().join(" ")
        });
        let has_ffmpeg = || self.output("ffmpeg -version").status.success();
        let only_checked = match command.contains(".mp4") && !has_ffmpeg() {
            true => Some("needs ffmpeg"),
            false => ONLY_CHECKED.iter().find(|(part, _)| command.contains(part)).map(|(_, why)| *why),
        };
        if let Some(why) = only_checked.filter(|_| !command.ends_with(" --help")) {
            println!("only checked, {why}: {command}");
            return self.check(&command).map(|()| false);
        }
        if command.contains("bokehcam ctl") {
            self.start_a_stream();
        }
        let ran = self.output(&command);
        match ran.status.success() {
            true => println!("ran: {command}"),
            false => return Err(format!("{}: {}", ran.status, String::from_utf8_lossy(&ran.stderr))),
        }
        Ok(true)
    }
}

/// Replaces a task in a list such as `plate,matte` by its network's file.
fn named(word: &str, task: &str, file: &str) -> String {
    let parts: Vec<&str> = word.split(',').map(|part| if part == task { file } else { part }).collect();
    parts.join(",")
}

/// Runs a page's commands; asserts that at least `least` of them ran, so that none is skipped by mistake.
fn follow(page: &str, least: usize) {
    let repository = Path::new(ROOT);
    let text = fs::read_to_string(repository.join(page)).unwrap();
    let mut follower = Follower::new();
    let mut done: Vec<String> = Vec::new();
    let (mut ran, mut faults) = (0, Vec::new());
    for command in pages::commands(&text) {
        // A repeated command runs once.
        if done.contains(&command) {
            continue;
        }
        let left_out = LEFT_OUT.iter().find(|(part, _)| command.contains(part));
        match left_out {
            Some((_, why)) => {
                println!("left out, {why}: {command}");
                let program = command.split(' ').next().unwrap_or_default();
                if program.contains('/') && !program.contains('=') && !repository.join(program).is_file() {
                    faults.push(format!("`{command}`: there is no {program}"));
                }
            }
            None => match follower.follow(&command) {
                Ok(true) => ran += 1,
                Ok(false) => {}
                Err(said) => faults.push(format!("`{command}`: {said}")),
            },
        }
        done.push(command);
    }
    assert!(faults.is_empty(), "{page}:\n{}", faults.join("\n"));
    assert!(ran >= least, "{page}: {ran} commands ran, where {least} can");
}

#[test]
fn arguments_are_checked_without_what_they_need() {
    let follower = Follower::new();
    assert_eq!(follower.check("bokehcam stream 0,2 --calib any.yml --to /dev/video10"), Ok(()));
    for (wrong, said) in [
        ("bokehcam stream 0 --on-demand", "--to"),
        ("bokehcam preview --nosuch", "--nosuch"),
        ("bokehcam bench --quality nosuch", "nosuch"),
    ] {
        assert!(follower.check(wrong).unwrap_err().contains(said), "{wrong}");
    }
}

/// Returns the examples in the help of a command and of its subcommands, such as `config dump`.
fn help_of(follower: &Follower, command: &str) -> Vec<(String, Vec<String>)> {
    let output = follower.output(&format!("{command} --help"));
    let help = String::from_utf8(output.stdout).unwrap();
    let section = |begins: &'static str| {
        let lines = help.lines().skip_while(move |line| !line.starts_with(begins)).skip(1);
        lines.take_while(|line| line.starts_with("  ")).filter(|line| !line.starts_with("   ")).map(str::trim)
    };
    let below = section("Commands:").filter_map(|line| line.split(' ').next()).filter(|name| *name != "help");
    let below = below.flat_map(|name| help_of(follower, &format!("{command} {name}")));
    // The text beside an example may continue on the next line.
    let examples = section("Example").filter(|line| line.starts_with("bokehcam "));
    let examples = examples.map(|line| line.split_once("  ").map_or(line, |(code, _)| code).to_owned());
    [(command.to_owned(), examples.collect())].into_iter().chain(below).collect()
}

/// Runs without the repository, as an installed program does.
#[test]
fn the_examples_of_help_are_right() {
    let mut follower = Follower::new();
    fs::remove_file(follower.path("recordings")).unwrap();
    let help = help_of(&follower, "bokehcam");
    assert!(help.len() > 12, "{} commands", help.len());
    let mut faults = Vec::new();
    for (command, examples) in help {
        assert!(!examples.is_empty() || command.split(' ').count() > 2, "{command} has no examples");
        for example in examples {
            // The program's own examples all run; others are only checked, except `config save`, whose file need not
            // exist.
            let done = match command == "bokehcam" || example.contains("config save") {
                true => follower.follow(&example).map(drop),
                false => follower.check(&example),
            };
            faults.extend(done.err().map(|said| format!("{command}: `{example}`: {said}")));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Commands refuse to replace a file, so that a page that writes to the files of another one could not be followed after it.
#[test]
fn pages_that_are_followed_after_each_other_write_to_different_files() {
    let mut written: Vec<(String, String)> = Vec::new();
    let pages = fs::read_dir(Path::new(ROOT).join("docs")).unwrap().map(|page| page.unwrap().path());
    for page in
        pages.chain([Path::new(ROOT).join("README.md")]).filter(|page| page.extension().is_some_and(|is| is == "md"))
    {
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        let skipped = |command: &String| {
            let parts = LEFT_OUT.iter().chain(&ONLY_CHECKED).map(|(part, _)| *part);
            parts.chain(["--force"]).any(|part| command.contains(part)) || !command.starts_with("bokehcam ")
        };
        for command in
            pages::commands_in_blocks(&fs::read_to_string(&page).unwrap()).iter().filter(|command| !skipped(command))
        {
            let words: Vec<&str> = command.split(' ').filter(|word| !word.is_empty()).collect();
            let outputs = words.windows(2).filter(|pair| ["--out", "--to", "--preview", "--report"].contains(&pair[0]));
            for output in outputs.map(|pair| pair[1]).filter(|output| !["-", "null"].contains(output)) {
                let earlier = written.iter().find(|(other, page)| other == output && *page != name);
                assert_eq!(earlier, None, "{name} writes to {output}, too");
                written.push((output.to_owned(), name.clone()));
            }
        }
    }
    assert!(written.len() > 30, "{written:?}");
}

#[test]
fn the_readme_can_be_followed_line_by_line() {
    follow("README.md", 7);
}

#[test]
fn the_pages_can_be_followed_line_by_line() {
    let least = [("algorithm.md", 1), ("settings.md", 5), ("stereo.md", 2), ("ctl.md", 6)];
    for page in fs::read_dir(Path::new(ROOT).join("docs")).unwrap() {
        let name = page.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".md") {
            let least = least.iter().find(|(page, _)| *page == name).map_or(0, |(_, least)| *least);
            follow(&format!("docs/{name}"), least);
        }
    }
}
