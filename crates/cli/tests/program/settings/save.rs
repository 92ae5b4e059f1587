//! `config save`, and a shell redirect that truncates the settings file before it is read.

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use crate::program::{Beside, Home, ROOT, Ran};

use super::pictures::text;

#[test]
fn settings_are_saved_among_those_that_are_there() {
    let home = Home::new();
    let saved = home.run(&["config", "save", "--rim", "0.1", "--aperture", "polygon:6"]);
    assert_eq!(saved.done(), format!("{}: saved aperture, rim\n", home.settings().display()));
    assert_eq!(text(&home.settings()), "aperture = \"polygon:6\"\nrim = 0.1\n");

    let before = "# mine\nrim = 0.4 # wide\ncoc-at-infinity = 7\n\n[presets.mine]\nrim = 0.6\n";
    let home = Home::new().with_settings(before);
    home.run(&["config", "save", "--rim", "0.2"]).done();
    assert_eq!(text(&home.settings()), before.replace("rim = 0.4", "rim = 0.2"));
    let lens = ["config", "save", "--f-number", "2", "--focal-length", "50", "--sensor-width", "36"];
    assert!(home.run(&lens).done().contains("coc-at-infinity set aside"));
    let after = text(&home.settings());
    assert!(!after.contains("coc-at-infinity") && after.contains("f-number = 2\n"), "{after}");
    home.run(&["config", "save", "--preset", "mine", "--force"]).done();
    let dump = home.run(&["config", "dump"]);
    assert!(dump.stdout.contains("\nforce = true # file\n") && dump.stdout.contains("rim = 0.6 # preset"));
    assert_eq!(fs::read_dir(home.settings().parent().unwrap()).unwrap().count(), 1, "no leftovers");
}

#[test]
fn pictures_are_saved_by_their_whole_paths_and_those_in_the_file_count_from_it() {
    let home = Home::new().with_photo();
    home.run(&["config", "save", "--behind", "image:photo.png"]).done();
    let whole = home.0.path().canonicalize().unwrap().join("photo.png");
    let saved = text(&home.settings());
    assert!(saved == format!("behind = \"image:{}\"\n", whole.display()) || saved.contains("/photo.png"), "{saved}");
    assert!(saved.starts_with("behind = \"image:/"), "{saved}");

    let home = Home::new().with_photo().with_settings("rim = 0.1\nbehind = \"image:wall.png\"\n");
    let render = |home: &Home| {
        home.run(&["render", "photo.png", "--depth-map", "depth.png", "--out", "out.png", "--backend", "cpu"])
    };
    let wall = home.settings().with_file_name("wall.png");
    render(&home).refused(1, &[wall.to_str().unwrap(), "there is no such file", "(behind in ", "config.toml)"]);
    fs::copy(home.path("photo.png"), &wall).unwrap();
    render(&home).done();
    // An invalid value that is only detected later also names its key.
    let home = Home::new().with_photo().with_settings("effect = \"dof\"\n");
    let ran = home.run(&["render", "photo.png", "--out", "out.png"]);
    ran.refused(2, &["--effect dof needs depth", "(effect in ", "config.toml)"]);
    let flag = home.run(&["render", "photo.png", "--out", "out.png", "--effect", "dof"]);
    assert!(flag.code == 2 && !flag.stderr.contains("config.toml"), "{}", flag.stderr);
}

#[test]
fn a_link_stays_a_link_even_one_to_nothing_yet() {
    let home = Home::new();
    fs::create_dir_all(home.settings().parent().unwrap()).unwrap();
    symlink("../../dotfiles/bokehcam.toml", home.settings()).unwrap();
    home.run(&["config", "save", "--rim", "0.1"]).done();
    home.run(&["config", "save", "--rank", "3"]).done();
    assert!(home.settings().symlink_metadata().unwrap().is_symlink());
    assert_eq!(text(&home.path("dotfiles/bokehcam.toml")), "rim = 0.1\nrank = 3\n");
    home.run(&["--config", "another.toml", "config", "save", "--rim", "0.3"]).done();
    assert_eq!(text(&home.path("another.toml")), "rim = 0.3\n");
}

#[test]
fn what_cannot_be_saved_changes_nothing() {
    let home = Home::new().with_settings("rim = 0.4\n");
    home.run(&["config", "save"]).refused(2, &["nothing to save", "--rim 0.1"]);
    home.run(&["config", "save", "--rim", "7"]).refused(2, &["from 0 to 1"]);
    home.run(&["config", "save", "--preset", "gone"]).refused(2, &["no preset 'gone'"]);
    assert_eq!(text(&home.settings()), "rim = 0.4\n");
    let home = Home::new().with_settings("rim = \n");
    home.run(&["config", "save", "--rim", "0.1"]).refused(2, &["config.toml:1: "]);
    assert_eq!(text(&home.settings()), "rim = \n");
}

#[test]
fn a_value_that_is_refused_is_replaced() {
    let home = Home::new().with_settings("# mine\nblur = -3\nrim = 0.4\n");
    home.run(&["config", "dump"]).refused(2, &["config.toml:2: "]);
    Ran::of(home.command(&["config", "save", "--blur", "3%"]).env("BOKEHCAM_BLUR", "abc")).done();
    assert_eq!(text(&home.settings()), "# mine\nblur = \"3%\"\nrim = 0.4\n");
    // Another fault stays, and is named with its line in the file as it is.
    let typo = "rim = 0.4\n[presets.a]\nhighlihts = 8\n";
    let home = Home::new().with_settings(typo);
    home.run(&["config", "save", "--blur", "3%"]).refused(2, &["config.toml:3: there is no setting 'highlihts'"]);
    assert_eq!(text(&home.settings()), typo);
}

#[test]
fn settings_that_are_saved_at_once_are_all_there() {
    const SETTINGS: [(&str, &str); 4] = [("rim", "0.1"), ("blur", "3"), ("focus", "1.5"), ("aperture", "star:5")];
    for _ in 0..5 {
        let home = Home::new();
        let start = |(name, value): (&str, &str)| {
            Beside::start(home.command(&["config", "save", &format!("--{name}"), value]).stderr(Stdio::piped()))
        };
        for saving in SETTINGS.map(start) {
            assert!(saving.end(Duration::from_secs(60)).done().contains(": saved "));
        }
        let saved = text(&home.settings());
        assert_eq!(saved.lines().count(), SETTINGS.len(), "{saved}");
    }
}

#[test]
fn what_a_killed_save_left_behind_is_removed_and_nothing_else() {
    let home = Home::new().with_settings("rim = 0.4\n");
    let beside = |name: &str| home.settings().with_file_name(name);
    let (dead, of_another, held) =
        (beside(".config.toml.4711-0.part"), beside(".other.toml.4711-0.part"), beside(".config.toml.4712-0.part"));
    for part in [&dead, &of_another, &held] {
        fs::write(part, "rim = 0.").unwrap();
    }
    let writer = File::open(&held).unwrap();
    rustix::fs::flock(&writer, rustix::fs::FlockOperation::LockExclusive).unwrap();
    home.run(&["config", "save", "--rim", "0.2"]).done();
    assert_eq!([&dead, &of_another, &held].map(|part| part.exists()), [false, true, true]);
    assert_eq!(text(&home.settings()), "rim = 0.2\n");
}

#[test]
fn a_picture_that_is_not_there_is_told_when_it_is_saved() {
    let home = Home::new().with_photo();
    for (option, value) in
        [("--behind", "image:nofile.jpg"), ("--aperture", "image:nofile.png"), ("--calib", "no.yaml")]
    {
        let saved = home.run(&["config", "save", option, value]);
        assert!(saved.warning().contains("there is no such file"), "{}", saved.stderr);
    }
    assert_eq!(home.run(&["config", "save", "--behind", "image:photo.png", "--report", "r.json"]).warning(), "");
}

#[test]
fn a_dump_onto_the_file_that_it_reads_is_told() {
    let home = Home::new().with_settings("rim = 0.4\n");
    let onto = |path: &Path| Ran::of(home.command(&["config", "dump"]).stdout(File::create(path).unwrap()));
    onto(&home.settings()).refused(2, &["config.toml: this is the settings file", "`bokehcam config save`"]);
    assert_eq!(onto(&home.path("elsewhere.toml")).done(), "");
}

#[test]
fn no_document_shows_a_redirect_onto_the_settings() {
    let root = Path::new(ROOT);
    let files = fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    for path in files.chain([root.join("README.md")]).filter(|path| path.extension().is_some_and(|e| e == "md")) {
        let shown = text(&path);
        assert!(!shown.lines().any(|line| line.contains("> ~/.config")), "{}", path.display());
    }
}
