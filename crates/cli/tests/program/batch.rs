//! `render` of many pictures.
#![allow(missing_docs)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use bokehcam_media::recording::still::{read_color, write_color, write_depth};
use rustix::process::Signal;

use crate::common::{color, depth, noise};
use crate::program::{Beside, Home, Ran, found};

/// Creates `shots/` with a JPEG and its map, a PNG and its map, and a JPEG of another extension.
fn with_shots() -> Home {
    let home = Home::new();
    fs::create_dir(home.path("shots")).unwrap();
    let near_left = depth(64, 48, |x, _| if x < 32 { 0.8 } else { 4.0 });
    for (name, seed) in [("a.jpg", 3), ("b.png", 5), ("c.jpeg", 7)] {
        let picture = color(64, 48, |x, y| [(x * seed) as u8, (y * 3) as u8, (x * y) as u8]);
        write_color(&home.path("shots").join(name), &picture, false).unwrap();
    }
    write_depth(&home.path("shots/a-depth.png"), &near_left, 5000.0, false).unwrap();
    write_depth(&home.path("shots/b.depth.pfm"), &near_left, 5000.0, false).unwrap();
    home
}

fn render(home: &Home, arguments: &[&str]) -> Ran {
    home.run(&[&["render"], arguments, &["--backend", "cpu"]].concat())
}

/// Returns the names in a folder, sorted; hidden ones too.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .map_or(Vec::new(), |entries| entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect());
    names.sort();
    names
}

#[test]
fn each_of_many_pictures_becomes_what_it_becomes_alone() {
    let home = with_shots();
    for (picture, out) in
        [("shots/a.jpg", "alone/a.jpg"), ("shots/b.png", "alone/b.png"), ("shots/c.jpeg", "alone/c.jpg")]
    {
        render(&home, &[picture, "--out", out]).done();
    }
    for (images, out, expected) in [
        (&["shots"][..], "folder", &["a.jpg", "b.png", "c.jpg"][..]),
        (&["shots/*.j*", "shots/b.*"], "patterns", &["a.jpg", "b.png", "c.jpg"]),
        (&["shots/[ab].???"], "pattern", &["a.jpg", "b.png"]),
        (&["shots/c.jpeg", "shots/a-depth.png", "shots/a.jpg", "shots/../shots/a.jpg"], "files", &["a.jpg", "c.jpg"]),
        (&["shots/b.png"], "one/", &["b.png"]),
    ] {
        let ran = render(&home, &[images, &["--out", out]].concat());
        let count = expected.len();
        assert!(ran.done().ends_with(&format!("{count} written, 0 skipped, 0 failed\n")), "{images:?}: {}", ran.stderr);
        assert_eq!(names(&home.path(out)), expected, "{images:?}");
        for name in expected {
            let [many, alone] = [out, "alone"].map(|folder| fs::read(home.path(folder).join(name)).unwrap());
            assert!(many == alone, "{images:?}: {name}");
        }
    }
}

#[test]
fn a_second_run_makes_what_is_missing_and_force_makes_all() {
    let home = with_shots();
    render(&home, &["shots", "--out", "out"]).done();
    fs::remove_file(home.path("out/b.png")).unwrap();
    fs::write(home.path("out/a.jpg"), "of another program").unwrap();
    let ran = render(&home, &["shots", "--out", "out"]);
    assert!(ran.done().ends_with("1 written, 2 skipped (the result is there; --force renders it again), 0 failed\n"));
    assert_eq!(fs::read(home.path("out/a.jpg")).unwrap(), b"of another program");
    // A picture that is newer than its result.
    let picture = fs::File::options().append(true).open(home.path("shots/c.jpeg")).unwrap();
    picture.set_modified(std::time::SystemTime::now() + Duration::from_secs(9)).unwrap();
    let ran = render(&home, &["shots", "--out", "out"]);
    assert!(ran.done().contains("3 skipped (the result is there, and of 1 older than the picture;"), "{}", ran.stderr);
    render(&home, &["shots", "--out", "out", "--force"]).done();
    assert_eq!(read_color(&home.path("out/a.jpg")).unwrap().size(), (64, 48));
}

#[test]
fn a_bad_picture_is_named_and_the_others_are_made() {
    let home = with_shots();
    let whole = fs::read(home.path("shots/b.png")).unwrap();
    fs::write(home.path("shots/cut.png"), &whole[..whole.len() / 2]).unwrap();
    fs::write(home.path("shots/empty.jpg"), "").unwrap();
    fs::write(home.path("shots/text.png"), "no picture").unwrap();
    fs::write(home.path("shots/notes.txt"), "not a picture by its name either").unwrap();
    let ran = render(&home, &["shots", "shots/none.jpg", "--out", "out"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    let errors: Vec<&str> = ran.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    for (error, name) in errors.iter().zip(["cut.png", "empty.jpg", "text.png", "none.jpg"]) {
        assert!(error.contains(&format!("shots/{name}: ")), "{name}: {error}");
    }
    assert_eq!(errors[4..], ["error: 3 written, 0 skipped, 4 failed"], "{}", ran.stderr);
    assert_eq!(names(&home.path("out")), ["a.jpg", "b.png", "c.jpg"]);
}

#[test]
fn what_is_said_of_many_pictures_is_said_once() {
    let home = with_shots();
    fs::remove_file(home.path("shots/a-depth.png")).unwrap();
    let ran = render(&home, &["shots", "--out", "out"]);
    assert!(
        ran.warning().contains("there is no depth") && ran.warning().contains("(2 pictures, the first is shots/a.jpg)")
    );
    let ran = render(&home, &["shots/a.jpg", "shots/b.png", "--out", "two"]);
    assert!(ran.warning().starts_with("warning: shots/a.jpg: there is no depth"), "{}", ran.stderr);
    assert_eq!(render(&home, &["shots", "--out", "out", "--force", "--quiet"]).done(), "");
}

#[test]
fn no_input_is_ever_replaced() {
    let home = with_shots();
    symlink("shots", home.path("link")).unwrap();
    fs::create_dir(home.path("hard")).unwrap();
    fs::hard_link(home.path("shots/a-depth.png"), home.path("hard/b.png")).unwrap();
    let before: Vec<Vec<u8>> =
        names(&home.path("shots")).iter().map(|name| fs::read(home.path("shots").join(name)).unwrap()).collect();
    for out in ["shots", "link", "hard", "shots/../link/"] {
        for force in [&[][..], &["--force"]] {
            let ran = render(&home, &[&["shots", "--out", out, "--quiet"], force].concat());
            ran.refused(2, &["which is the input; choose another place"]);
        }
    }
    fs::hard_link(home.path("shots/a.jpg"), home.path("other.jpg")).unwrap();
    let ran = render(&home, &["shots/a.jpg", "--out", "other.jpg", "--force", "--quiet"]);
    ran.refused(2, &["this is another name of shots/a.jpg"]);
    let after: Vec<Vec<u8>> =
        names(&home.path("shots")).iter().map(|name| fs::read(home.path("shots").join(name)).unwrap()).collect();
    assert_eq!(before, after);
    // Names that differ do not collide.
    render(&home, &["shots/c.jpeg", "--out", "shots/"]).done();
    assert!(home.path("shots/c.jpg").is_file());
}

#[test]
fn what_cannot_be_for_many_is_refused_before_anything_is_written() {
    let home = with_shots();
    fs::create_dir(home.path("other")).unwrap();
    fs::copy(home.path("shots/a.jpg"), home.path("other/a.jpeg")).unwrap();
    fs::create_dir(home.path("none")).unwrap();
    for (arguments, expected) in [
        (&["shots", "other"][..], "shots/a.jpg and other/a.jpeg have the same result, out/a.jpg"),
        (&["none"], "none: no picture there (PNG, JPEG, TIFF, WebP, BMP or HEIC)"),
        (&["none/*.png"], "none/*.png: no picture there (PNG, JPEG, TIFF, WebP, BMP or HEIC)"),
        (&["shots/***"], "shots/***: this is no pattern"),
        (&["shots", "--depth-map", "shots/a-depth.png"], "--depth-map shots/a-depth.png: for many pictures this is"),
        (&["shots", "--mask", "shots/b.png"], "--mask shots/b.png: for many pictures this is a folder"),
        (&["shots", "--depth", "stereo"], "--depth stereo: "),
        (&["shots", "--out-format", "gif"], "use png, jpg, tif or webp"),
    ] {
        render(&home, &[arguments, &["--out", "out", "--quiet"]].concat()).refused(2, &[expected]);
        assert!(!home.path("out").exists(), "{arguments:?}");
    }
    for out in ["out.jpg", "shots/a.jpg"] {
        render(&home, &["shots/a.jpg", "shots/b.png", "--out", out]).refused(2, &["many pictures need a folder"]);
    }
}

#[test]
fn all_results_have_the_format_that_is_asked_for() {
    let home = with_shots();
    for format in ["png", "jpg"] {
        let out = format!("{format}s/");
        let all = ["shots", "--effect", "blur", "--out", &out, "--out-format", format];
        render(&home, &all).done();
        let named = |stem: &str| format!("{stem}.{format}");
        assert_eq!(names(&home.path(&out)), ["a", "b", "c"].map(named));
        let kinds = names(&home.path(&out)).iter().all(|name| {
            let start = fs::read(home.path(&out).join(name)).unwrap();
            start.starts_with(if format == "png" { b"\x89PNG" } else { b"\xff\xd8\xff\xe0" })
        });
        assert!(kinds, "{format}");
    }
    let one = ["shots/a.jpg", "--out", "one.png", "--out-format", "jpg"];
    render(&home, &one).refused(2, &["--out-format jpg: the name behind --out decides"]);
}

#[test]
fn folders_give_each_picture_its_map_or_mask() {
    let home = with_shots();
    for dir in ["maps", "masks"] {
        fs::create_dir(home.path(dir)).unwrap();
    }
    let near_right = depth(64, 48, |x, _| if x < 32 { 4.0 } else { 0.8 });
    write_depth(&home.path("maps/a.pfm"), &near_right, 5000.0, false).unwrap();
    write_depth(&home.path("maps/b_depth.png"), &near_right, 5000.0, false).unwrap();
    let mask = color(64, 48, |x, _| if x < 32 { [255; 3] } else { [0; 3] });
    write_color(&home.path("masks/a_mask.png"), &mask, false).unwrap();
    write_color(&home.path("masks/b.png"), &mask, false).unwrap();
    write_color(&home.path("masks/b.jpg"), &mask, false).unwrap();
    for (option, dir, written, failures) in [
        ("--depth-map", "maps", &["a.jpg", "b.png"][..], &["shots/c.jpeg: --depth-map maps: nothing there is for"][..]),
        ("--mask", "masks", &["a.jpg"], &["shots/b.png: --mask masks: ", "shots/c.jpeg: --mask masks: nothing"]),
    ] {
        let ran = render(&home, &["shots", option, dir, "--out", &format!("out-{dir}")]);
        assert_eq!(ran.code, 1, "{}", ran.stderr);
        failures.iter().for_each(|failure| assert!(ran.stderr.contains(failure), "{failure}: {}", ran.stderr));
        assert_eq!(names(&home.path(format!("out-{dir}"))), written);
    }
    render(&home, &["shots/a.jpg", "--depth-map", "maps/a.pfm", "--out", "a.jpg"]).done();
    assert_eq!(fs::read(home.path("a.jpg")).unwrap(), fs::read(home.path("out-maps/a.jpg")).unwrap());
}

#[test]
fn masks_beside_their_pictures_are_none_of_them() {
    let home = with_shots();
    let mask = color(64, 48, |x, _| if x < 32 { [255; 3] } else { [0; 3] });
    // The last one is beside no picture of that name.
    for name in ["a-mask.png", "b.mask.png", "c-mask.jpg", "face-mask.png"] {
        write_color(&home.path("shots").join(name), &mask, false).unwrap();
    }
    let ran = render(&home, &["shots", "--effect", "blur", "--out", "folder"]);
    assert!(ran.done().contains("4 files left out by their names: depth maps, masks"), "{}", ran.stderr);
    let results = ["a.jpg", "b.png", "c.jpg", "face-mask.png"];
    assert_eq!(names(&home.path("folder")), results);
    render(&home, &["shots/*", "--effect", "blur", "--out", "pattern"]).done();
    assert_eq!(names(&home.path("pattern")), results);
    render(&home, &["shots/*-mask.png", "shots/c.jpeg", "--effect", "blur", "--out", "some"]).done();
    assert_eq!(names(&home.path("some")), ["c.jpg", "face-mask.png"]);
    // One that is named alone is meant.
    render(&home, &["shots/a-mask.png", "--effect", "blur", "--out", "alone/"]).done();
    assert_eq!(names(&home.path("alone")), ["a-mask.png"]);
    fs::remove_file(home.path("shots/face-mask.png")).unwrap();
    render(&home, &["shots", "--mask", "shots", "--out", "masked"]).done();
    assert_eq!(names(&home.path("masked")), results[..3]);
}

#[test]
fn ctrl_c_leaves_whole_pictures_and_the_next_run_makes_the_rest() {
    let home = Home::new();
    fs::create_dir(home.path("shots")).unwrap();
    let picture = noise(320, 240);
    let count = 30;
    for k in 0..count {
        write_color(&home.path(format!("shots/{k:02}.jpg")), &picture, false).unwrap();
    }
    let arguments = ["render", "shots", "--effect", "blur", "--blur", "9", "--out", "out", "--backend", "cpu"];
    let mut run = Beside::start(home.command(&arguments).stderr(Stdio::piped()));
    found("a result", Duration::from_secs(60), || {
        assert!(run.runs(), "it ends only when told to");
        names(&home.path("out")).iter().any(|name| name.ends_with(".jpg") && !name.starts_with('.')).then_some(())
    });
    let ran = run.end_by(Signal::INT, Duration::from_secs(60));
    assert!(ran.code == 1 && ran.stderr.contains("not begun: the same command renders the rest"), "{ran:?}");
    let written = names(&home.path("out"));
    assert!(!written.is_empty() && written.len() < count, "{written:?}");
    for name in &written {
        assert_eq!(read_color(&home.path("out").join(name)).unwrap().size(), (320, 240), "{name}");
    }
    let ran = home.run(&arguments);
    let expected = format!("{} written, {} skipped", count - written.len(), written.len());
    assert!(ran.done().contains(&expected), "{}", ran.stderr);
}
