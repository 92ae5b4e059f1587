//! The command `service`, with a fake `systemctl` that records its calls.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::program::{Home, PROGRAM, ROOT, Ran};
use crate::terminal::{open_terminal, terminal};

/// A fake `systemctl`: files in its folder hold the unit's load, enablement and activity state.
const SYSTEMCTL: &str = r#"
here=$(dirname "$0")
echo "$*" >>"$here/told"
[ "$1" = --user ] && [ -e "$here/session" ] || { echo "Failed to connect to bus: No medium found" >&2; exit 1; }
own="$XDG_CONFIG_HOME/systemd/user/bokehcam.service"
case "$2" in
show)
    case "$4" in graphical-session.target) echo "ActiveState=$(cat "$here/desktop")"; exit 0 ;; esac
    [ -e "$here/loaded" ] || { echo LoadState=not-found; exit 0; }
    echo LoadState=$(cat "$here/loaded")
    echo ActiveState=$(cat "$here/active" 2>/dev/null || echo inactive)
    echo UnitFileState=$(cat "$here/enabled" 2>/dev/null || echo disabled)
    echo "FragmentPath=$own"
    program=$(sed -n 's/^ExecStart="\{0,1\}\([^ "]*\).*/\1/p' "$own")
    echo "ExecStart={ path=$program ; argv[]=$program stream \$STREAM ; ignore_errors=no }"
    grep '^Environment=' "$own"
    exit 0 ;;
daemon-reload) grep -q '^ExecStart=' "$own" && echo loaded >"$here/loaded"; exit 0 ;;
enable) echo enabled >"$here/enabled"; cp "$here/becomes" "$here/active" ;;
disable) rm -f "$here/enabled" "$here/active" ;;
esac
"#;

struct Session {
    home: Home,
}

impl Session {
    /// Creates a session in which a started unit enters the state `becomes`.
    fn new(becomes: &str) -> Self {
        let session = Self { home: Home::new() };
        session.home.add_program("systemctl", SYSTEMCTL);
        session.home.add_program("journalctl", "echo 'error: 0: no such camera'");
        for (name, text) in [("session", ""), ("desktop", "active"), ("becomes", becomes), ("told", "")] {
            fs::write(session.at(name), text).unwrap();
        }
        session
    }

    fn at(&self, name: &str) -> PathBuf {
        self.home.path("bin").join(name)
    }

    fn unit(&self) -> PathBuf {
        self.home.path("config/systemd/user/bokehcam.service")
    }

    fn put_unit(&self, text: &str) {
        fs::create_dir_all(self.unit().parent().unwrap()).unwrap();
        fs::write(self.unit(), text).unwrap();
    }

    fn service(&self, what: &str) -> Ran {
        Ran::of(&mut self.command(&["service", what]))
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = self.home.command(args);
        command.env("PATH", format!("{}:/usr/bin:/bin", self.at("").display())).env("HOME", self.home.path("user"));
        command
    }

    /// Adds a browser that reads a flags file in the folder for settings; returns the path of that file.
    fn add_browser(&self, program: &str, file: &str) -> PathBuf {
        let flags = format!("$(cat \"${{XDG_CONFIG_HOME:-~/.config}}/{file}\")");
        self.home.add_program(program, &format!("exec /usr/lib/browser {flags} \"$@\""));
        self.home.path("config").join(file)
    }

    fn add_flags(&self) -> Ran {
        Ran::of(&mut self.command(&["service", "on", "--browser-flags"]))
    }

    /// Returns the recorded calls, except queries.
    fn told(&self) -> Vec<String> {
        let told = fs::read_to_string(self.at("told")).unwrap();
        told.lines().filter(|line| !line.starts_with("--user show ")).map(str::to_owned).collect()
    }
}

/// Returns the arguments of `bokehcam stream` in the packages' unit.
fn unit_arguments() -> String {
    let unit = fs::read_to_string(Path::new(ROOT).join("packaging/bokehcam.service")).unwrap();
    let line = unit.lines().find_map(|line| line.strip_prefix("Environment=\"STREAM=")).unwrap();
    line.strip_suffix('"').unwrap().to_owned()
}

#[test]
fn the_units_command_line_is_the_promised_one_and_works() {
    let arguments = unit_arguments();
    assert_eq!(arguments, "0 --to pipewire --on-demand");
    for page in ["README.md", "docs/call.md"] {
        let text = fs::read_to_string(Path::new(ROOT).join(page)).unwrap();
        assert!(text.contains(&format!("bokehcam stream {arguments}")), "{page}");
    }
    let home = Home::new();
    let stream = |arguments: &str| {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        home.run(&[&["stream", "--tray"], &arguments[..]].concat())
    };
    // There is no PipeWire here, and mostly no camera: both may come, so systemd tries again (not for exit code 2).
    assert_eq!(stream(&arguments).code, 1);
    if cfg!(feature = "pipewire") {
        let (source, rest) = arguments.split_once(' ').unwrap();
        assert_eq!(source, "0");
        stream(&format!("demo {rest}")).failed(1, &["PipeWire cannot be reached"]);
    }
}

#[test]
fn one_word_starts_it_with_every_session_and_one_ends_that() {
    let session = Session::new("active");
    let off = session.service("status");
    assert!(off.code == 0 && off.stdout.starts_with("off: there is no unit"), "{}{}", off.stdout, off.stderr);
    assert!(session.told().is_empty(), "status changes nothing: {:?}", session.told());

    let on = session.service("on");
    assert_eq!(
        (on.code, session.told()),
        (0, vec!["--user daemon-reload".into(), "--user enable --now bokehcam.service".into()])
    );
    let streams = format!("on: it runs\n  streams   {}\n", unit_arguments());
    assert!(on.stdout.starts_with(&streams), "{}", on.stdout);
    assert!(on.stdout.contains("bokehcam/stream.conf"), "{}", on.stdout);
    // The written unit is the packaged one with the path of this program.
    let packaged = fs::read_to_string(Path::new(ROOT).join("packaging/bokehcam.service")).unwrap();
    let start = format!("ExecStart=\"{PROGRAM}\" stream");
    assert_eq!(
        fs::read_to_string(session.unit()).unwrap(),
        packaged.replace("ExecStart=/usr/bin/bokehcam stream", &start)
    );

    let conf = session.home.settings().with_file_name("stream.conf");
    fs::create_dir_all(conf.parent().unwrap()).unwrap();
    fs::write(&conf, "# mine\nSTREAM=\"C920 --to pipewire --on-demand\"\n").unwrap();
    let status = session.service("status");
    let named = format!("  streams   C920 --to pipewire --on-demand\n  settings  {}\n", conf.display());
    assert!(status.stdout.contains(&named), "{}", status.stdout);

    let off = session.service("off");
    assert_eq!((off.code, session.told().last().unwrap().as_str()), (0, "--user disable --now bokehcam.service"));
    assert!(session.service("status").stdout.starts_with("off: it does not run\n"));
}

#[test]
fn a_unit_that_is_there_is_left_as_it_is() {
    let session = Session::new("active");
    let own = "[Service]\nExecStart=/bin/sh -c true\n";
    session.put_unit(own);
    let on = session.service("on");
    assert_eq!((on.code, fs::read_to_string(session.unit()).unwrap().as_str()), (0, own), "{}", on.stderr);

    let session = Session::new("active");
    session.put_unit("nothing\n");
    let on = session.service("on");
    assert!(on.code == 1 && on.stderr.contains("does not accept it as a unit"), "{}", on.stderr);
    assert_eq!(fs::read_to_string(session.unit()).unwrap(), "nothing\n");
    assert_eq!(session.told(), ["--user daemon-reload"]);

    // The unit of a program that has moved.
    let session = Session::new("active");
    session.put_unit("[Service]\nExecStart=/gone/bokehcam stream $STREAM\n");
    fs::write(session.at("loaded"), "loaded").unwrap();
    let on = session.service("on");
    assert!(on.code == 1 && on.stderr.contains("starts /gone/bokehcam, which does not exist"), "{}", on.stderr);
    assert!(session.told().is_empty());
}

#[test]
fn what_keeps_it_from_running_is_said_in_plain_words() {
    let session = Session::new("activating");
    let on = session.service("on");
    let waits = "on: it tries again every five seconds\n  says      error: 0: no such camera\n";
    assert!(on.code == 0 && on.stdout.starts_with(waits), "{}{}", on.stdout, on.stderr);
    fs::write(session.at("active"), "failed").unwrap();
    fs::write(session.at("desktop"), "inactive").unwrap();
    let status = session.service("status");
    assert!(status.stdout.starts_with("on: it gave up\n  says      error: "), "{}", status.stdout);
    assert!(status.stderr.contains("graphical-session.target"), "{}", status.stderr);
    fs::write(session.at("loaded"), "masked").unwrap();
    let masked = session.service("on");
    assert!(masked.code == 1 && masked.stderr.contains("systemctl --user unmask bokehcam"), "{}", masked.stderr);

    let none = Session::new("active");
    fs::remove_file(none.at("session")).unwrap();
    for what in ["on", "off", "status"] {
        let ran = none.service(what);
        assert!(ran.code == 1 && ran.stderr.lines().count() == 1, "{}", ran.stderr);
        assert!(ran.stderr.contains("no systemd session (Failed to connect to bus"), "{}", ran.stderr);
    }
    fs::remove_file(none.at("systemctl")).unwrap();
    let ran = Ran::of(none.home.command(&["service", "on"]).env("PATH", none.at("")));
    assert!(ran.code == 1 && ran.stderr.contains("there is no systemd here"), "{}", ran.stderr);
    assert!(!none.unit().exists(), "a unit that nobody reads");
}

const FLAG: &str = "--enable-features=WebRtcPipeWireCamera\n";

#[test]
fn the_flag_of_browsers_is_named_and_added_when_that_is_wished() {
    let session = Session::new("active");
    let chromium = session.add_browser("chromium", "chromium-flags.conf");
    let on = session.service("on");
    assert!(on.code == 0 && on.stderr.contains("`bokehcam service on --browser-flags` adds it"), "{}", on.stderr);
    assert!(on.stderr.contains(chromium.to_str().unwrap()) && !chromium.exists(), "{}", on.stderr);

    for time in 0..2 {
        let on = session.add_flags();
        assert_eq!(on.stderr.matches("start the browser again").count(), 1 - time, "{}", on.stderr);
        assert_eq!(fs::read_to_string(&chromium).unwrap(), FLAG);
    }
    let off = session.service("off");
    assert!(off.code == 0 && off.stderr.contains("removed --enable-features="), "{}", off.stderr);
    assert!(!chromium.exists(), "it was not there before");
    assert_eq!(session.service("off").stderr.matches("removed").count(), 0);
}

#[test]
fn a_flags_file_stays_as_it_is_but_for_the_line() {
    let session = Session::new("active");
    let chromium = session.add_browser("chromium", "chromium-flags.conf");
    let dotfiles = session.home.path("dotfiles");
    fs::create_dir_all(&dotfiles).unwrap();
    fs::create_dir_all(chromium.parent().unwrap()).unwrap();
    let own = "# --enable-features=Old\n\n--ozone-platform=wayland\t\r\n  --incognito";
    fs::write(dotfiles.join("chromium"), own).unwrap();
    fs::set_permissions(dotfiles.join("chromium"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink(dotfiles.join("chromium"), &chromium).unwrap();
    session.add_flags();
    assert_eq!(fs::read_to_string(&chromium).unwrap(), format!("{FLAG}{own}"));
    assert_eq!(fs::read_link(&chromium).unwrap(), dotfiles.join("chromium"));
    // What its user writes meanwhile stays, too.
    fs::write(&chromium, format!("--new\n{FLAG}{own}")).unwrap();
    session.service("off");
    assert_eq!(fs::read_to_string(&chromium).unwrap(), format!("--new\n{own}"));
    assert_eq!(chromium.metadata().unwrap().mode() & 0o777, 0o640);
    assert!(chromium.is_symlink());

    // A link to nothing is not replaced.
    fs::remove_file(dotfiles.join("chromium")).unwrap();
    let on = session.add_flags();
    assert!(on.code == 1 && on.stderr.contains("link to nothing") && chromium.is_symlink(), "{}", on.stderr);
}

#[test]
fn the_users_own_flags_are_left_alone() {
    let session = Session::new("active");
    let chromium = session.add_browser("chromium", "chromium-flags.conf");
    let brave = session.add_browser("brave", "brave-flags.conf");
    session.home.add_program("google-chrome-stable", "exec /opt/google/chrome/chrome \"$@\"");
    let flatpak = session.home.path("user/.var/app/com.google.Chrome/config/chrome-flags.conf");
    fs::create_dir_all(flatpak.parent().unwrap().parent().unwrap()).unwrap();
    fs::create_dir_all(chromium.parent().unwrap()).unwrap();
    let kept = [(&chromium, FLAG.to_owned()), (&brave, "--enable-features=\"Vulkan,VaapiVideoDecoder\"\n".to_owned())];
    kept.iter().for_each(|(file, text)| fs::write(file, text).unwrap());
    let on = session.add_flags();
    assert!(
        on.stderr.contains("Brave lists PipeWire cameras with ,WebRtcPipeWireCamera at the end of"),
        "{}",
        on.stderr
    );
    assert!(on.stderr.contains("Chrome lists PipeWire cameras after chrome://flags/"), "{}", on.stderr);
    let place = "added --enable-features=WebRtcPipeWireCamera to ~/.var/app/com.google.Chrome/config/chrome-flags.conf";
    assert!(on.stderr.contains(place), "{}", on.stderr);
    assert_eq!(fs::read_to_string(&flatpak).unwrap(), FLAG);
    session.service("off");
    assert!(!flatpak.exists());
    kept.iter().for_each(|(file, text)| assert_eq!(&fs::read_to_string(file).unwrap(), text));

    // Of several, only the last counts.
    fs::write(&chromium, format!("{FLAG}--enable-features=Vulkan,\n")).unwrap();
    let on = session.add_flags();
    assert!(on.stderr.contains("Chromium lists PipeWire cameras with ,WebRtcPipeWireCamera"), "{}", on.stderr);

    // A v4l2loopback camera needs no flag.
    let conf = session.home.settings().with_file_name("stream.conf");
    fs::create_dir_all(conf.parent().unwrap()).unwrap();
    fs::write(&conf, "STREAM=\"0 --to /dev/video10\"\n").unwrap();
    assert!(!session.service("on").stderr.contains("PipeWire cameras"));
}

#[test]
fn at_a_terminal_the_flag_is_asked_about() {
    for (answer, is_added) in [("y\n", true), ("\n", false), ("no\n", false)] {
        let session = Session::new("active");
        let chromium = session.add_browser("chromium", "chromium-flags.conf");
        let (mut screen, name) = terminal();
        let [stdin, stderr] = [(); 2].map(|()| open_terminal(&name));
        screen.write_all(answer.as_bytes()).unwrap();
        let mut command = session.command(&["service", "on"]);
        let code = command.stdin(stdin).stdout(Stdio::null()).stderr(stderr).status().unwrap().code();
        // Without a program at the terminal, reading it fails after the last byte.
        drop(command);
        let mut said = Vec::new();
        screen.read_to_end(&mut said).unwrap_err();
        let said = String::from_utf8_lossy(&said);
        assert_eq!((code, chromium.exists()), (Some(0), is_added), "{said}");
        assert!(said.contains("[y/N]"), "{said}");
    }
}
