//! `render --debug-dir`: the files of a blur's intermediate results.

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam::frame::DepthMap;
use bokehcam::recording::still::write_depth;
use serde_json::Value;

use crate::program::{Home, Ran, json};

/// A small picture with depth: a person in focus, an object in front, a room behind.
struct Still {
    home: Home,
}

const IMAGE: &str = "recording/rgb/000000.png";
const DEPTH: &str = "recording/depth/000000.png";

impl Still {
    fn new() -> Self {
        let still = Self { home: Home::new() };
        still.run(&["record", "synthetic", "--size", "96x56", "--frames", "1", "--to", "recording"]).done();
        still
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path(name)
    }

    fn run(&self, args: &[&str]) -> Ran {
        let ran = self.home.run(args);
        assert_eq!(ran.stdout, "");
        ran
    }

    /// Renders the picture into `out.png`, and its intermediate results into the folder `dir`.
    fn render(&self, dir: &str, more: &[&str]) -> Ran {
        self.run(&[&["render", IMAGE, "--out", "out.png", "--debug-dir", dir], more].concat())
    }

    fn render_depth(&self, dir: &str, more: &[&str]) -> Ran {
        self.render(dir, &[&["--depth-map", DEPTH, "--coc-at-infinity", "6", "--max-coc", "9"], more].concat())
    }

    fn plan(&self, dir: &str) -> Value {
        json(self.path(dir).join("plan.json"))
    }

    fn picture(&self, name: &str) -> image::RgbImage {
        image::open(self.path(name)).unwrap().to_rgb8()
    }
}

/// Returns the file names in a folder, and those listed in its plan.
fn names(dir: &Path, plan: &Value) -> [Vec<String>; 2] {
    let mut found: Vec<String> =
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    let mut told: Vec<String> =
        plan["files"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_string()).collect();
    told.push("plan.json".to_string());
    found.sort();
    told.sort();
    [found, told]
}

#[test]
fn every_intermediate_of_a_layered_blur_is_there_in_its_size() {
    let still = Still::new();
    still.render_depth("a/within", &[]).done();
    let plan = still.plan("a/within");
    let [found, told] = names(&still.path("a/within"), &plan);
    assert_eq!(found, told);

    let bins = plan["bins"].as_array().unwrap();
    let mut expected: Vec<String> =
        ["behind.png", "behind_coc.png", "coc.png", "hidden.png", "plan.json", "still.png"].map(String::from).into();
    let parts = ["bin", "blur", "blur_coverage", "coverage", "radius"];
    expected.extend((0..bins.len()).flat_map(|k| parts.map(|part| format!("{part}_{k}.png"))));
    expected.sort();
    assert_eq!(found, expected);

    assert_eq!(plan["compositing"], "layers");
    assert_eq!((&plan["filled"], &bins[0]["near"]), (&true.into(), &true.into()));
    assert!(bins[0]["low_px"].is_null() && bins[bins.len() - 1]["high_px"].is_null());
    assert!(bins.windows(2).all(|pair| pair[0]["high_px"] == pair[1]["low_px"]), "front to back");
    let share: f64 = bins.iter().map(|bin| bin["picture_share"].as_f64().unwrap()).sum();
    assert!((share - 1.0).abs() < 1e-3, "{share}");
    for (k, bin) in bins.iter().enumerate() {
        let size = ["width", "height"].map(|key| bin[key].as_u64().unwrap() as u32);
        let scale = bin["scale"].as_u64().unwrap() as u32;
        assert_eq!(size, [96u32, 56].map(|side| side.div_ceil(scale)));
        for part in parts {
            let picture = still.picture(&format!("a/within/{part}_{k}.png"));
            assert_eq!(<[u32; 2]>::from(picture.dimensions()), size, "{part} {k}");
        }
        // Depth increases with the signed CoC, so the bins' depth ranges are in the same order.
        let depth = |k: usize, end: usize| bins[k]["content_depth_m"][end].as_f64();
        if let (Some(before), Some(here)) = (k.checked_sub(1).and_then(|before| depth(before, 1)), depth(k, 0)) {
            assert!(before <= here, "{k}: {before} {here}");
        }
    }
    for name in ["coc", "behind", "behind_coc", "hidden", "still"] {
        assert_eq!(still.picture(&format!("a/within/{name}.png")).dimensions(), (96, 56));
    }
    // Hidden pixels are replaced; all others are unchanged.
    let [before, behind, hidden] =
        [IMAGE, "a/within/behind.png", "a/within/hidden.png"].map(|name| still.picture(name));
    let mut replaced = 0;
    for ((before, behind), hidden) in before.pixels().zip(behind.pixels()).zip(hidden.pixels()) {
        match hidden.0[0] {
            0 => assert_eq!(before, behind),
            _ => replaced += u32::from(before != behind),
        }
    }
    assert!(replaced > 0);

    // Writing intermediate results does not change the output.
    let looked = still.picture("out.png");
    let args =
        ["render", IMAGE, "--depth-map", DEPTH, "--coc-at-infinity", "6", "--max-coc", "9", "--out", "plain.png"];
    still.run(&[&args[..], &["--backend", "cpu"]].concat()).done();
    assert!(looked == still.picture("plain.png"));
}

#[test]
fn pictures_of_light_are_encoded_as_the_result_is() {
    let still = Still::new();
    for highlights in ["0", "8"] {
        let more = ["--effect", "blur", "--coc-at-infinity", "5", "--highlights", highlights, "--force"];
        still.render("within", &more).done();
        let plan = still.plan("within");
        assert_eq!((&plan["compositing"], &plan["filled"]), (&"select".into(), &false.into()));
        let [found, told] = names(&still.path("within"), &plan);
        assert_eq!(found, told);
        let all = ["bin_0", "blur_0", "blur_coverage_0", "coc", "coverage_0", "radius_0"].map(|n| format!("{n}.png"));
        assert_eq!(
            found.iter().filter(|name| *name != "plan.json").collect::<Vec<_>>(),
            all.iter().collect::<Vec<_>>()
        );
        // A single bin at full resolution contains the whole picture: the input before the filters, the output after
        // them.
        for (inside, outside) in [("bin_0", IMAGE), ("blur_0", "out.png")] {
            let [a, b] = [still.picture(&format!("within/{inside}.png")), still.picture(outside)];
            let most = a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(most <= Some(1), "{inside}, highlights {highlights}: {most:?}");
        }
        for white in ["coverage_0", "radius_0"] {
            assert!(still.picture(&format!("within/{white}.png")).iter().all(|&value| value == 255), "{white}");
        }
    }
}

#[test]
fn what_is_in_focus_all_over_is_still_and_stays_bit_for_bit() {
    let still = Still::new();
    let plane = DepthMap { width: 96, height: 56, metres: vec![1.0; 96 * 56], ..DepthMap::default() };
    write_depth(&still.path("plane.png"), &plane, 5000.0, false).unwrap();
    still.render("within", &["--depth-map", "plane.png", "--focus", "1"]).done();
    assert_eq!(still.plan("within")["still_share"], 1.0);
    assert!(still.picture("within/still.png").iter().all(|&value| value == 255));
    assert!(still.picture("out.png") == still.picture(IMAGE));
}

#[test]
fn methods_without_bins_have_what_there_is() {
    let still = Still::new();
    let found = |dir: &str, ran: Ran| {
        ran.done();
        names(&still.path(dir), &still.plan(dir))[0].clone()
    };
    let gathered = found("gather", still.render_depth("gather", &["--method", "gather"]));
    assert_eq!(gathered, ["bin_0.png", "coc.png", "coverage_0.png", "plan.json"]);
    assert_eq!(found("none", still.render("none", &["--effect", "none", "--force"])), ["plan.json"]);
    let tilted = found("tilt", still.render("tilt", &["--effect", "tilt-shift", "--coc-at-infinity", "6", "--force"]));
    assert!(tilted.contains(&"radius_1.png".to_string()) && !tilted.contains(&"behind.png".to_string()), "{tilted:?}");
    // Without a foreground, nothing is hidden.
    let far = found("far", still.render_depth("far", &["--focus", "0.1", "--force"]));
    assert!(far.contains(&"bin_0.png".to_string()) && !far.contains(&"hidden.png".to_string()), "{far:?}");
}

#[test]
fn what_cannot_be_written_is_told_in_one_line_and_nothing_is() {
    let still = Still::new();
    fs::write(still.path("file"), "mine").unwrap();
    let refused = |ran: Ran, code: i32, told: &str| {
        ran.refused(code, &[told]);
        assert!(!still.path("out.png").exists());
    };
    refused(still.render_depth("file", &[]), 1, "file: not a folder");
    refused(still.render_depth("file/within", &[]), 1, "file/within");
    refused(still.render_depth("within", &["--backend", "gpu"]), 2, "--backend gpu");

    fs::create_dir(still.path("within")).unwrap();
    fs::write(still.path("within/coc.png"), "mine").unwrap();
    refused(still.render_depth("within", &[]), 1, "--force");
    assert_eq!(fs::read(still.path("within/coc.png")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(still.path("within")).unwrap().count(), 1);
    still.render_depth("within", &["--force"]).done();
    assert_eq!(still.picture("within/coc.png").dimensions(), (96, 56));
    fs::remove_file(still.path("out.png")).unwrap();
    refused(still.render_depth("within", &[]), 1, "plan.json");
}
