//! Contents of packages: manual pages, completions, and desktop files.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::program::{Home, PORTRAIT, PROGRAM, ROOT, Ran, STEREO, run};

mod layout;

fn here(path: &str) -> String {
    let path = Path::new(ROOT).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the names that start the entries of a help text's section; empty without such a section.
fn listed(help: &str, section: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != section).skip(1).take_while(|line| !line.is_empty());
    let entries = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    entries.filter_map(|line| line.split_whitespace().next().map(str::to_owned)).collect()
}

/// Returns the long flags in a help text.
fn flags(help: &str) -> Vec<String> {
    let explained = help.lines().filter(|line| line.starts_with("  -") || line.starts_with("      --"));
    let words = explained.filter_map(|line| line.split([' ', '=', '[', ',', '.']).find(|word| word.starts_with("--")));
    words.map(str::to_owned).collect()
}

/// Returns every command in the help, such as `config dump`, with its own help text.
fn commands() -> Vec<(Vec<String>, String)> {
    let (mut found, mut waiting) = (Vec::new(), vec![Vec::new()]);
    while let Some(command) = waiting.pop() {
        let args: Vec<&str> = command.iter().map(String::as_str).chain(["--help-all"]).collect();
        let help = run(&args).printed();
        for below in listed(&help, "Commands:").into_iter().filter(|name| name != "help") {
            waiting.push([command.as_slice(), &[below]].concat());
        }
        found.push((command, help));
    }
    found
}

#[test]
fn there_is_a_manual_page_of_every_command_with_every_flag() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("man1");
    run(&["manual", "--out", out.to_str().unwrap()]).done();
    let commands = commands();
    assert!(commands.len() > 12, "help lists only {} commands", commands.len());
    for (command, help) in &commands {
        let name = [&["bokehcam".to_owned()], command.as_slice()].concat().join("-");
        let page = fs::read_to_string(out.join(format!("{name}.1"))).unwrap_or_else(|error| panic!("{name}: {error}"));
        let page = page.replace("\\-", "-");
        // Subcommands may have no examples of their own.
        assert!(command.len() > 1 || page.contains(".SH EXAMPLES"), "{name} has no examples");
        assert!(page.contains(env!("CARGO_PKG_VERSION")), "{name} does not say its version");
        let flags = flags(help);
        assert!(flags.len() >= 4, "{name}: {flags:?}");
        for flag in flags {
            assert!(page.contains(&format!("\\fB{flag}\\fR")), "{name} does not explain {flag}");
        }
    }
    assert_eq!(fs::read_dir(&out).unwrap().count(), commands.len(), "a page of no command");
}

#[test]
fn manual_pages_are_not_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bokehcam.1"), "mine").unwrap();
    let manual = |more: &[&str]| run(&[&["manual", "--out", folder.path().to_str().unwrap()], more].concat());
    manual(&[]).failed(1, &["--force"]);
    assert_eq!(fs::read(folder.path().join("bokehcam.1")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "others were written");
    manual(&["--force"]).done();
    assert_ne!(fs::read(folder.path().join("bokehcam.1")).unwrap(), b"mine");
}

#[test]
fn completions_know_every_command_and_flag() {
    let commands = commands();
    for shell in ["bash", "zsh", "fish"] {
        let script = run(&["completions", shell]).printed();
        for (command, help) in &commands {
            for name in command {
                assert!(script.contains(name), "{shell}: {name}");
            }
            for flag in flags(help) {
                // Fish lists long flags without dashes.
                let flag = if shell == "fish" { flag.replacen("--", "-l ", 1) } else { flag };
                assert!(script.contains(&flag), "{shell}: {command:?} {flag}");
            }
        }
    }
}

/// An installed program cannot refer to files of the repository.
#[test]
fn help_names_only_what_a_package_brings() {
    let install = here("packaging/install");
    assert!(
        install.contains("for page in ../README.md ../docs/*.md; do put \"$page\" \"share/doc/bokehcam/${page#../}\"")
    );
    for (command, help) in commands() {
        assert!(!help.contains("recordings/portrait") && !help.contains("recordings/stereo"), "{command:?}: {help}");
        for (at, _) in help.match_indices("docs/") {
            let name = help[at..].split(|c: char| c.is_whitespace() || "),;:".contains(c)).next().unwrap();
            assert!(Path::new(ROOT).join(name).is_file(), "{command:?}: {name}");
        }
    }
}

/// Returns the value of a key in a text of `key=value` lines.
fn value<'a>(file: &'a str, key: &str) -> &'a str {
    let found = file.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    found.unwrap_or_else(|| panic!("there is no {key}"))
}

#[test]
fn desktops_find_the_program_its_icon_and_its_version() {
    let entry = here("packaging/bokehcam.desktop");
    assert!(entry.starts_with("[Desktop Entry]\n"));
    assert_eq!(value(&entry, "Exec"), "bokehcam preview");
    let icon = here(&format!("packaging/{}.svg", value(&entry, "Icon")));
    assert!(
        roxmltree::Document::parse(&icon).unwrap().root_element().has_tag_name(("http://www.w3.org/2000/svg", "svg"))
    );
    // The window's class must match this desktop file.
    let class = format!("const APP_ID: &str = \"{}\";", value(&entry, "StartupWMClass"));
    assert!(here("crates/window/src/window/gfx.rs").contains(&class), "{class}");

    let id = "io.github.bokehcam.bokehcam";
    let metainfo = here(&format!("packaging/{id}.metainfo.xml"));
    let metainfo = roxmltree::Document::parse(&metainfo).unwrap();
    let element = |name: &str| metainfo.descendants().find(|node| node.has_tag_name(name)).unwrap();
    assert_eq!(element("id").text(), Some(id));
    assert_eq!(element("launchable").text(), Some("bokehcam.desktop"));
    assert_eq!(element("icon").text(), Some(value(&entry, "Icon")));
    assert_eq!(element("release").attribute("version"), Some(env!("CARGO_PKG_VERSION")));
    assert_eq!(element("project_license").text(), Some(env!("CARGO_PKG_LICENSE")));
    assert_eq!(value(&here("packaging/arch/PKGBUILD"), "pkgver"), env!("CARGO_PKG_VERSION"));
    let flatpak: serde_json::Value = serde_json::from_str(&here(&format!("packaging/flatpak/{id}.json"))).unwrap();
    assert_eq!((&flatpak["id"], &flatpak["rename-desktop-file"]), (&id.into(), &"bokehcam.desktop".into()));
}

/// Finds versioned library names, such as `libX11.so.6`, anywhere in an executable.
fn libraries(program: &[u8]) -> Vec<String> {
    let text: String = program.iter().map(|&byte| if byte.is_ascii_graphic() { byte as char } else { ' ' }).collect();
    let mut found: Vec<String> = Vec::new();
    for (at, _) in text.match_indices(".so.") {
        // Strings in an executable are not delimited, so the name starts at the last preceding `lib`.
        let before = &text[at.saturating_sub(40)..at];
        let Some(begin) = before.rfind("lib") else { continue };
        let name = &before[begin..];
        let number: String = text[at + 4..].chars().take_while(char::is_ascii_digit).collect();
        if !number.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.+".contains(c)) {
            found.push(format!("{name}.so.{number}"));
        }
    }
    found.sort();
    found.dedup();
    found
}

/// Returns the libraries that the program is linked with; packaging tools add these dependencies automatically.
fn linked() -> Vec<String> {
    let output = Command::new("ldd").arg(PROGRAM).output().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    lines.lines().filter_map(|line| line.split_whitespace().next().map(str::to_owned)).collect()
}

#[test]
fn packages_ask_for_every_library_that_is_loaded() {
    if cfg!(not(all(feature = "window", feature = "networks"))) {
        return;
    }
    let list = here("packaging/libraries");
    let mut asked: Vec<&str> = list
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let columns: Vec<&str> = line.split_whitespace().collect();
            assert!(columns.len() == 3 && ["depends", "suggests"].contains(&columns[2]), "{line}");
            columns[0]
        })
        .collect();
    asked.sort_unstable();
    let linked = linked();
    let mut loaded = libraries(&fs::read(PROGRAM).unwrap());
    loaded.retain(|library| !linked.contains(library));
    assert_eq!(asked, loaded);
}

#[test]
fn examples_and_the_unit_are_those_of_the_page_on_calls() {
    let page = here("docs/call.md");
    let options = here("packaging/examples/modprobe.conf");
    let options = options.lines().find_map(|line| line.strip_prefix("options ")).unwrap();
    assert!(page.contains(&format!("sudo modprobe {options}")), "{options}");
    let unit = here("packaging/bokehcam.service");
    let stream = unit.lines().find_map(|line| line.strip_prefix("Environment=\"STREAM=")?.strip_suffix('"')).unwrap();
    assert!(page.contains(&format!("bokehcam stream {stream}\n")), "{stream}");
}

/// Runs the program without daemons and installed files; returns its exit code and its message.
fn exit_code(args: &[&str]) -> (i32, String) {
    let home = Home::new();
    fs::write(home.path("text.txt"), "text").unwrap();
    fs::copy(format!("{PORTRAIT}/rgb/000000.png"), home.path("photo.png")).unwrap();
    let ran = Ran::of(home.command(args).env("HOME", home.0.path()));
    (ran.code, ran.stderr)
}

/// The unit restarts after errors that may disappear, and gives up after usage errors.
#[test]
fn the_unit_gives_up_on_wrong_arguments_alone() {
    let unit = here("packaging/bokehcam.service");
    assert_eq!((value(&unit, "Restart"), value(&unit, "RestartPreventExitStatus")), ("on-failure", "2"));
    assert_eq!(value(&unit, "StartLimitIntervalSec"), "0", "it is to be tried for as long as it takes");

    let mut may_come = vec![
        vec!["./folder/of/a/disk", "--to", "null"],
        vec!["photo.png", "--depth", "./folder/of/a/disk", "--to", "null"],
        vec![STEREO, "--depth", "stereo", "--calib", "nothing.yml", "--to", "null"],
    ];
    if cfg!(feature = "camera") {
        let by_id = "/dev/v4l/by-id/usb-Nobody_s_camera-video-index0";
        let cameras =
            ["4711", "4711,4712", "/dev/video4711", by_id, "usb-Nobody_s_camera-video-index0", "Nobody's camera"];
        may_come.extend(cameras.map(|camera| vec![camera, "--to", "/dev/video10", "--on-demand"]));
        may_come.push(vec!["photo.png", "--depth", "/dev/video4711", "--to", "null"]);
        may_come.push(vec!["demo", "--to", "/dev/video4711"]);
    }
    if cfg!(feature = "pipewire") {
        may_come.push(vec!["pipewire:Nobody's camera", "--to", "null"]);
        may_come.push(vec!["demo", "--to", "pipewire"]);
    }
    if cfg!(feature = "networks") {
        may_come.push(vec!["photo.png", "--depth", "matte", "--to", "null"]);
    }
    for args in may_come {
        let (code, said) = exit_code(&[&["stream"], args.as_slice()].concat());
        assert!(
            code == 1 && said.lines().last().is_some_and(|line| line.starts_with("error: ")),
            "{args:?}: {code}: {said}"
        );
    }
    if cfg!(feature = "window") {
        let (code, said) = exit_code(&["preview", "./folder/of/a/disk"]);
        assert!(code == 1 && said.contains("./folder/of/a/disk: there is no such folder"), "{code}: {said}");
    }

    for args in [
        &["demo"][..],
        &["demo", "--to", "null", "--nosuch"],
        &["demo", "--to", "null", "--rim", "7"],
        &["demo", "--to", "null", "--preset", "nosuch"],
        &["demo", "--to", "null", "--start", "3"],
        &["text.txt", "--to", "null"],
        &["pipewire:", "--to", "null"],
    ] {
        let (code, said) = exit_code(&[&["stream"], args].concat());
        assert!(code == 2 && said.lines().count() == 1, "{args:?}: {code}: {said}");
    }
}

/// A user unit must not use options that need namespaces, which some systems deny to users.
#[test]
fn the_unit_is_confined_by_what_a_user_may_ask_for() {
    let unit = here("packaging/bokehcam.service");
    for (key, is) in [
        ("NoNewPrivileges", "yes"),
        ("LockPersonality", "yes"),
        ("RestrictNamespaces", "yes"),
        ("RestrictSUIDSGID", "yes"),
        ("SystemCallArchitectures", "native"),
        ("SystemCallFilter", "@system-service"),
        ("SystemCallErrorNumber", "EPERM"),
        ("UMask", "0077"),
        ("LimitCORE", "0"),
    ] {
        assert_eq!(value(&unit, key), is, "{key}");
    }
    assert!(value(&unit, "MemoryMax").ends_with('G'));
    assert!(
        value(&unit, "RestrictAddressFamilies").split(' ').all(|family| ["AF_UNIX", "AF_NETLINK"].contains(&family))
    );
    let needs_namespaces =
        ["Private", "Protect", "ReadWritePaths=", "ReadOnlyPaths=", "InaccessiblePaths=", "TemporaryFileSystem="];
    // PipeWire needs real-time scheduling, and GPU drivers compile code at run time.
    let would_break = ["MemoryDenyWriteExecute=", "RestrictRealtime="];
    for line in unit.lines() {
        let bad = needs_namespaces.iter().chain(&would_break).find(|begin| line.starts_with(*begin));
        assert!(bad.is_none(), "{line}");
    }
}

/// GNOME refuses an extension that does not list its version.
#[test]
fn the_extension_lists_every_gnome_from_45_on() {
    let metadata: serde_json::Value = serde_json::from_str(&here("packaging/gnome-extension/metadata.json")).unwrap();
    let listed: Vec<u32> = metadata["shell-version"]
        .as_array()
        .unwrap()
        .iter()
        .map(|version| version.as_str().unwrap().parse().unwrap())
        .collect();
    assert_eq!(listed, (45..=51).collect::<Vec<_>>());
    assert!(here("docs/ctl.md").contains("GNOME, from 45 on"));
}
