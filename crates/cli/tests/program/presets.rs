//! Presets and snapshots on the command line.
#![allow(missing_docs)]

use crate::common;

use std::fs;

use bokehcam::bokeh::cpu::BandedBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::bokeh::{Bokeh, Job};
use bokehcam::budget::Quality;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::hidden::{HiddenSurfaces, Hiding};
use bokehcam::depth::matting::{self, Matting};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::look::{CocRule, Effect, Look, Patch, Strength};
use bokehcam::optics::CocField;
use bokehcam_media::recording::snapshot::{self, Snapshot};
use bokehcam_media::recording::still::{read_color, write_color, write_depth};
use common::{noise, three_depths};

use crate::program::{Home, Ran};

/// Runs the program with these environment variables.
fn run(home: &Home, environment: &[(&str, &str)], args: &[&str]) -> Ran {
    Ran::of(home.command(args).envs(environment.iter().copied()))
}

/// Returns the line of a setting in `config dump`.
fn line<'a>(dump: &'a str, name: &str) -> &'a str {
    let is_it = |line: &&str| line.trim_start_matches("# ").starts_with(&format!("{name} = "));
    dump.lines().find(is_it).unwrap_or_else(|| panic!("no {name} in {dump}"))
}

const MINE: &str =
    "rim = 0.4\ncoc-at-infinity = 7\n\n[presets.mine]\nrim = 0.6\nf-number = 2\nfocal-length = 50\nsensor-width = 36\n";

#[test]
fn a_preset_goes_before_the_file_and_behind_the_environment() {
    let home = Home::new().with_settings(MINE);
    let dump = |environment: &[(&str, &str)], args: &[&str]| {
        let ran = run(&home, environment, &[&["config", "dump"], args].concat());
        assert_eq!(ran.done(), "");
        ran.stdout
    };
    assert_eq!(line(&dump(&[], &[]), "rim"), "rim = 0.4 # file");
    let mine = dump(&[], &["--preset", "mine"]);
    assert_eq!(line(&mine, "rim"), "rim = 0.6 # preset");
    assert_eq!(line(&mine, "f-number"), "f-number = 2 # preset");
    assert_eq!(line(&mine, "blur"), "# blur = # default", "the lens sets the file's aside");
    assert_eq!(line(&mine, "preset"), "# preset = \"mine\" # flag");
    let by_name = [("BOKEHCAM_PRESET", "mine")];
    assert_eq!(line(&dump(&by_name, &[]), "rim"), "rim = 0.6 # preset");
    assert_eq!(line(&dump(&by_name, &["--preset", "cinematic"]), "highlights"), "highlights = 6 # preset");
    let both = [("BOKEHCAM_PRESET", "mine"), ("BOKEHCAM_RIM", "0.7")];
    assert_eq!(line(&dump(&both, &[]), "rim"), "rim = 0.7 # environment");
    assert_eq!(line(&dump(&both, &["--rim", "0.8"]), "rim"), "rim = 0.8 # flag");
    let lens = dump(&[], &["--preset", "mine", "--coc-at-infinity", "5%"]);
    assert_eq!(line(&lens, "f-number"), "# f-number = # default", "a flag sets the preset's lens aside");
    assert_eq!(line(&lens, "blur"), "blur = \"5%\" # flag");

    let home = Home::new().with_settings(&format!("preset = \"mine\"\n{MINE}"));
    let dump = home.run(&["config", "dump"]).stdout;
    assert_eq!((line(&dump, "rim"), line(&dump, "preset")), ("rim = 0.6 # preset", "# preset = \"mine\" # file"));
}

#[test]
fn the_dump_with_a_preset_is_a_file_that_dumps_the_same() {
    let home = Home::new().with_settings(MINE);
    let first = home.run(&["config", "dump", "--preset", "mine", "--rim", "0.9"]).stdout;
    let again = Home::new().with_settings(&first);
    let second = again.run(&["config", "dump"]);
    assert_eq!(second.done(), "");
    let values = |dump: &str| -> Vec<String> {
        let lines = dump.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        lines.map(|line| line.split(" # ").next().unwrap().to_string()).collect()
    };
    assert_eq!(values(&first), values(&second.stdout));
    assert!(values(&first).contains(&"rim = 0.9".to_string()) && first.contains("\n[presets.mine]\n"));
}

#[test]
fn wrong_presets_cost_one_line_that_names_those_there_are() {
    let all = "use portrait, cinematic, dreamy, product, miniature, mine";
    for (settings, environment, args, said) in [
        (MINE, None, &["config", "dump", "--preset", "nope"][..], "there is no preset 'nope'"),
        (MINE, Some("nope"), &["config", "dump"], "there is no preset 'nope'"),
        (MINE, None, &["stream", "synthetic", "--to", "null", "--preset", ""], "there is no preset ''"),
        ("preset = \"nope\"\n[presets.mine]\n", None, &["config", "dump"], "config.toml:1: there is no preset 'nope'"),
    ] {
        let home = Home::new().with_settings(settings);
        let environment: Vec<_> = environment.map(|name| ("BOKEHCAM_PRESET", name)).into_iter().collect();
        let ran = run(&home, &environment, args);
        ran.refused(2, &[said, all]);
    }
    let home = Home::new().with_settings("[presets.mine]\nrim = 0.1\nto = \"null\"\n");
    let ran = home.run(&["config", "dump"]);
    assert!(ran.code == 2 && ran.stderr.contains("config.toml:3: there is no setting 'to'"), "{}", ran.stderr);
}

#[test]
fn every_built_in_preset_blurs_in_its_own_way() {
    let home = Home::new();
    write_color(&home.path("a.png"), &noise(96, 72), false).unwrap();
    write_depth(&home.path("a.pfm"), &three_depths(96, 72), 1.0, false).unwrap();
    let mut seen: Vec<ColorImage> = Vec::new();
    for preset in ["portrait", "cinematic", "dreamy", "product", "miniature"] {
        let args = ["render", "a.png", "--depth-map", "a.pfm", "--preset", preset, "--backend", "cpu", "-q"];
        assert_eq!(home.run(&[&args[..], &["--force", "--out", "out.png"]].concat()).done(), "");
        let picture = read_color(&home.path("out.png")).unwrap();
        assert!(!seen.contains(&picture), "{preset} is something of its own");
        seen.push(picture);
    }
}

/// Blurs a frame as the window does; also returns each pixel's CoC radius.
fn blurred(look: &Look, color: &ColorImage, map: &DepthMap, focus_m: f32, quality: Quality) -> (ColorImage, CocField) {
    let size = color.size();
    let field = match look.coc_rule(size) {
        CocRule::Fixed(field) => field,
        CocRule::Depth { lens, range_m, max_coc_px, .. } => lens.coc_field(focus_m, range_m, size.0, max_coc_px),
    };
    let mut map = map.clone();
    if let CocField::Depth(lens) = &field {
        Matting::default().find_mixed_pixels(&mut map, color, lens.inverse_depth_step(matting::MIN_STEP_PX));
        let (mut hidden, mut workers) = (HiddenSurfaces::default(), ThreadPool::new("depth", 1));
        hidden.add_to_matte(&mut workers, &mut map, color, lens, Hiding::NEAR);
    }
    // A live run uses one executor for all quality levels.
    let settings = look.blur_settings(size, true).unwrap();
    let mut cpu = BandedBokeh::new(Plan::new(&settings, size.0, size.1), Some(2));
    let job = Job::new(Pooled::detached(color.clone()), Some(Pooled::detached(map)), field);
    cpu.submit(Job { quality, ..job }).unwrap();
    (cpu.collect(true).unwrap().unwrap().picture.memory().unwrap().clone(), field)
}

#[test]
fn a_snapshot_is_repeated_to_the_bit_whatever_the_settings_around() {
    let settings = "rim = 0.9\neffect = \"blur\"\nrefine = \"on\"\nmax-coc = 3\npreset = \"dreamy\"\nf-number = 2\n";
    let home = Home::new().with_settings(settings);
    let environment = [("BOKEHCAM_FOCUS", "7"), ("BOKEHCAM_F_NUMBER", "2"), ("BOKEHCAM_QUALITY", "draft")];
    let color = noise(101, 77);
    // With some unknown depths: `--like` must not estimate them a second time.
    let mut map = three_depths(101, 77);
    map.metres.iter_mut().step_by(13).for_each(|metres| *metres = 0.0);
    let dof = Look {
        focus: FocusRule::Auto,
        focus_range_m: 0.123_456_7,
        strength: Strength::Percent(9.7),
        highlights: 5.0,
        ..Look::default()
    };
    let tilt = Look { strength: Strength::Default, rim: 0.1, ..Look::with_effect(Effect::TiltShift) };
    let shots = home.path("shots");
    for (name, look, quality) in
        [("a", &dof, Quality::Draft), ("a", &dof, Quality::Balanced), ("b.c", &tilt, Quality::Best)]
    {
        let (picture, field) = blurred(look, &color, &map, 1.123_456_7, quality);
        let settings = Patch::from_look(&look.for_frame(&field, Some(quality))).values();
        let depth = matches!(field, CocField::Depth(_)).then_some(&map);
        let shot =
            Snapshot { picture: &picture, sources: Some((&color, depth)), settings: &settings, source: "camera" };
        let path = snapshot::save(&shots, name, &shot).unwrap();
        assert_eq!(read_color(&path).unwrap(), picture);
        let out = path.with_extension("again.png");
        let (like, to) = (path.to_str().unwrap(), out.to_str().unwrap());
        let args = ["render", "--like", like, "--out", to, "--backend", "cpu", "--threads", "3", "-q"];
        let ran = run(&home, &environment, &args);
        assert_eq!(ran.done(), "", "{like}");
        assert!(read_color(&out).unwrap() == picture, "{like} {quality}");
        // Additional flags override the snapshot's settings.
        let ran = run(&home, &environment, &[&args[..], &["--force", "--aperture", "heart"]].concat());
        assert_eq!(ran.done(), "");
        assert!(read_color(&out).unwrap() != picture);
        let ran = run(&home, &environment, &[&args[..], &["--force", "--preset", "product"]].concat());
        assert_eq!(ran.done(), "");
        assert!(read_color(&out).unwrap() != picture, "a preset that is asked for goes before it");
        fs::remove_file(out).unwrap();
    }
    let mut files: Vec<_> = fs::read_dir(&shots).unwrap().map(|file| file.unwrap().file_name()).collect();
    files.sort();
    let expected = [
        "a-2-color.png",
        "a-2-depth.pfm",
        "a-2.png",
        "a-color.png",
        "a-depth.pfm",
        "a.png",
        "b.c-color.png",
        "b.c.png",
    ];
    assert_eq!(files, expected);
}

#[test]
fn a_snapshots_settings_can_be_given_to_another_picture() {
    let home = Home::new();
    let (color, map) = (noise(40, 30), three_depths(40, 30));
    let look = Look::with_effect(Effect::Blur);
    let (picture, field) = blurred(&look, &color, &map, 1.0, Quality::Balanced);
    let settings = Patch::from_look(&look.for_frame(&field, None)).values();
    let shot = Snapshot { picture: &picture, sources: Some((&color, None)), settings: &settings, source: "camera" };
    let like = snapshot::save(home.0.path(), "x", &shot).unwrap();
    write_color(&home.path("other.png"), &three_depths_as_picture(), false).unwrap();
    home.run(&["render", "other.png", "--like", like.to_str().unwrap(), "--backend", "cpu", "--out", "out.png"]).done();
    assert_eq!(read_color(&home.path("out.png")).unwrap().size(), (20, 10));
}

fn three_depths_as_picture() -> ColorImage {
    common::color(20, 10, |x, y| [x as u8 * 9, y as u8 * 20, 77])
}

#[test]
fn a_snapshot_that_cannot_be_repeated_costs_one_line() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    let (color, map) = (noise(24, 18), three_depths(24, 18));
    let save = |name: &str, settings: &[(&'static str, String)]| {
        let shot = Snapshot { picture: &color, sources: Some((&color, Some(&map))), settings, source: "camera" };
        snapshot::save(home.0.path(), name, &shot).unwrap();
    };
    write_color(&at("plain.png"), &color, false).unwrap();
    fs::write(at("text.png"), "no picture").unwrap();
    save("alien", &[("mirror", "true".to_string())]);
    save("bad", &[("rim", "7".to_string())]);
    save("good", &Patch::from_look(&Look::default().for_frame(&common::DOF, None)).values());
    save("lone", &[("effect", "blur".to_string())]);
    fs::remove_file(at("lone-color.png")).unwrap();
    fs::copy(at("good.png"), at("depthless.png")).unwrap();
    fs::copy(at("good-color.png"), at("depthless-color.png")).unwrap();
    let whole = fs::read(at("good.png")).unwrap();
    fs::write(at("short.png"), &whole[..60]).unwrap();
    for (name, code, said) in [
        ("nowhere.png", 1, "nowhere.png: there is no such file"),
        ("plain.png", 1, "plain.png: not a snapshot"),
        ("text.png", 1, "text.png: not a PNG file"),
        ("short.png", 1, "short.png: "),
        ("alien.png", 2, "alien.png: its setting 'mirror' is not a setting of the look"),
        ("bad.png", 2, "from 0 to 1"),
        ("lone.png", 1, "lone-color.png: there is no such file: a snapshot holds its settings, and a preview saves"),
        ("depthless.png", 2, "needs depth"),
    ] {
        home.run(&["render", "--like", name, "--out", "out.png"]).refused(code, &[said]);
        assert!(!at("out.png").exists());
    }
}

#[test]
fn a_snapshot_is_whole_or_not_there() {
    let home = Home::new().with_settings("");
    let color = noise(8, 6);
    let shot = Snapshot { picture: &color, sources: Some((&color, None)), settings: &[], source: "camera" };
    for (dir, stem, shot) in [
        (home.path("a"), "../x", shot),
        (home.path("a"), "", shot),
        (home.settings(), "x", shot),
        (home.path("a"), "x", Snapshot { settings: &[("aperture", "image:a\nb".to_string())], ..shot }),
    ] {
        let refused = snapshot::save(&dir, stem, &shot).unwrap_err().to_string();
        assert!(!refused.contains('\n'), "{refused}");
    }
    assert!(!home.path("a").exists() && !home.path("x.png").exists());

    // One existing file blocks the whole snapshot name.
    let dir = home.path("shots");
    fs::create_dir(&dir).unwrap();
    fs::write(dir.join("x-depth.pfm"), "mine").unwrap();
    assert_eq!(snapshot::save(&dir, "x", &shot).unwrap(), dir.join("x-2.png"));
    assert_eq!(snapshot::save(&dir, "x", &shot).unwrap(), dir.join("x-3.png"));
    assert_eq!(fs::read(dir.join("x-depth.pfm")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(&dir).unwrap().count(), 5, "no leftovers");
    assert_eq!(snapshot::read_settings(&dir.join("x-2.png")).unwrap(), []);
}
