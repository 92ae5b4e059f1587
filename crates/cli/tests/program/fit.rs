//! Edge misalignment between depth maps and pictures: measurement, messages and correction.
#![allow(missing_docs)]

use std::path::Path;

use bokehcam::depth::agreement::EdgeAlignment;
use bokehcam::engine::still::{Depth, compute_coc_and_depth};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{Look, Refine};
use bokehcam_media::recording::still::{read_color, read_depth, write_color, write_depth};

use crate::program::Home;

const PICTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait/rgb/000000.png");
const DEPTH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait/depth/000000.png");

fn portrait() -> (ColorImage, DepthMap) {
    (read_color(Path::new(PICTURE)).unwrap(), read_depth(Path::new(DEPTH), 5000.0, None).unwrap())
}

/// Applies `pick` to the depths within `reach` pixels of each pixel, separably.
fn around(map: &DepthMap, reach: i64, pick: impl Fn(&mut dyn Iterator<Item = f32>) -> f32) -> DepthMap {
    let (width, height) = (i64::from(map.width), i64::from(map.height));
    // One pass per axis.
    let along = |from: &[f32], (dx, dy): (i64, i64)| -> Vec<f32> {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| {
                let at =
                    |k: i64| ((y + k * dy).clamp(0, height - 1) * width + (x + k * dx).clamp(0, width - 1)) as usize;
                pick(&mut (-reach..=reach).map(|k| from[at(k)]))
            })
            .collect()
    };
    DepthMap { metres: along(&along(&map.metres, (1, 0)), (0, 1)), ..map.clone() }
}

fn fat(map: &DepthMap, reach: i64) -> DepthMap {
    around(map, reach, |depths_m| depths_m.fold(f32::INFINITY, f32::min))
}

/// Blurs the map's inverse depth by a box filter, applied twice.
fn soft(map: &DepthMap, reach: i64) -> DepthMap {
    let mean = |map: &DepthMap| {
        around(map, reach, |depths_m| (2 * reach + 1) as f32 / depths_m.map(|depth_m| 1.0 / depth_m).sum::<f32>())
    };
    mean(&mean(map))
}

fn mirrored(map: &DepthMap) -> DepthMap {
    let mut map = map.clone();
    map.metres.chunks_exact_mut(map.width as usize).for_each(<[f32]>::reverse);
    map
}

fn quarter(map: &DepthMap) -> DepthMap {
    let (width, height) = (map.width / 4, map.height / 4);
    let metres = (0..width * height).map(|k| {
        let (x, y) = (4 * (k % width) + 2, 4 * (k / width) + 2);
        map.metres[(y * map.width + x) as usize]
    });
    DepthMap { width, height, metres: metres.collect(), ..DepthMap::default() }
}

#[test]
fn it_is_seen_how_outlines_lie() {
    let (color, map) = portrait();
    assert_eq!(EdgeAlignment::measure(&map, &color), EdgeAlignment::Aligned);
    for reach in [4, 8] {
        let found = EdgeAlignment::measure(&fat(&map, reach), &color);
        let EdgeAlignment::Shifted { distance_px } = found else { panic!("fat by {reach} px: {found:?}") };
        assert!((distance_px + reach as i32).abs() <= 1, "fat by {reach} px: {distance_px}");
    }
    let found = EdgeAlignment::measure(&soft(&map, 4), &color);
    assert!(matches!(found, EdgeAlignment::Soft { width_px: 6..=14 }), "{found:?}");
    assert_eq!(EdgeAlignment::measure(&mirrored(&map), &color), EdgeAlignment::Unrelated);
    // Without depth edges there is nothing to compare.
    let wall = DepthMap { metres: vec![3.0; map.metres.len()], ..map.clone() };
    let unknown = DepthMap { metres: vec![0.0; map.metres.len()], ..map.clone() };
    for map in [&wall, &unknown, &DepthMap::default()] {
        assert_eq!(EdgeAlignment::measure(map, &color), EdgeAlignment::Unknown);
    }
    assert_eq!(EdgeAlignment::measure(&map, &ColorImage::new(640, 360)), EdgeAlignment::Unknown);
}

/// Returns the mean absolute error of the CoC radius, in pixels.
fn coc_error_px(refine: Refine, color: &ColorImage, map: DepthMap, truth: &DepthMap) -> f32 {
    let look = Look { refine, focus: "1.2".parse().unwrap(), ..Look::default() };
    let (field, map) = compute_coc_and_depth(&look, &mut color.clone(), Some(Depth::Measured(map)), None).unwrap();
    let map = map.unwrap();
    let bokehcam::optics::CocField::Depth(lens) = field else { panic!("the blur follows depth") };
    let step = truth.width / map.width;
    let off = (0..truth.metres.len() as u32).map(|k| {
        let (x, y) = (k % truth.width / step, k / truth.width / step);
        (lens.coc_px(map.metres[(y * map.width + x) as usize]) - lens.coc_px(truth.metres[k as usize])).abs()
    });
    off.sum::<f32>() / truth.metres.len() as f32
}

#[test]
fn what_does_not_fit_is_mended_and_what_fits_stays() {
    let (color, map) = portrait();
    for (name, damaged, most) in [
        ("fat", fat(&map, 4), 0.4),
        ("very fat", fat(&map, 8), 0.4),
        ("soft", soft(&map, 4), 0.75),
        ("small", quarter(&map), 0.75),
    ] {
        let [off, auto] = [Refine::Off, Refine::Auto].map(|refine| coc_error_px(refine, &color, damaged.clone(), &map));
        assert!(auto < most * off, "{name}: the CoC is off by {auto} px, and by {off} px as it came");
    }
    assert_eq!(coc_error_px(Refine::Auto, &color, map.clone(), &map), 0.0);
    // Another picture's colours give no evidence.
    let other = mirrored(&map);
    assert_eq!(coc_error_px(Refine::Auto, &color, other.clone(), &other), 0.0);
}

#[test]
fn render_says_what_it_does_about_it() {
    let home = Home::new();
    let (_, map) = portrait();
    for (name, map) in [
        ("fat.png", fat(&map, 6)),
        ("small.png", quarter(&map)),
        ("soft.png", soft(&map, 4)),
        ("other.png", mirrored(&map)),
    ] {
        write_depth(&home.path(name), &map, 5000.0, false).unwrap();
    }
    let render = |map: &str, more: &[&str]| {
        let command = ["render", PICTURE, "--depth-map", map, "--out", "out.png", "--force", "--backend", "cpu"];
        home.run(&[&command, more].concat()).done().to_owned()
    };
    for (map, begin) in [
        ("fat.png", "note: fat.png: refined, as its outlines lie about "),
        ("soft.png", "note: soft.png: refined, as its outlines are about "),
        ("small.png", "note: small.png: refined, as it has 160 x 90 pixels; --refine off uses it unchanged"),
        ("other.png", "warning: other.png: none of its outlines match those of the picture: "),
    ] {
        let said = render(map, &[]);
        assert!(said.starts_with(begin) && said.lines().count() == 2, "{map}: {said}");
        // An explicit `--refine` suppresses the warning, except for a map of another picture.
        for refine in ["on", "off"] {
            let said = render(map, &["--refine", refine]);
            assert_eq!(said.starts_with("warning"), map == "other.png", "{map}: {said}");
        }
    }
    assert_eq!(render(DEPTH, &[]).lines().count(), 1);
}

#[test]
fn a_stream_says_once_how_its_depth_does_not_fit_and_mends_it() {
    let home = Home::new();
    let (color, map) = portrait();
    let record = |name: &str, map: &DepthMap| {
        let folder = home.path(name);
        let (mut rgb, mut depth) = (String::new(), String::new());
        std::fs::create_dir_all(folder.join("rgb")).unwrap();
        std::fs::create_dir_all(folder.join("depth")).unwrap();
        write_color(&folder.join("rgb/0.png"), &color, false).unwrap();
        write_depth(&folder.join("depth/0.png"), map, 5000.0, false).unwrap();
        for k in 0..25 {
            rgb += &format!("{}.{:02} rgb/0.png\n", k / 10, k % 10 * 10);
            depth += &format!("{}.{:02} depth/0.png\n", k / 10, k % 10 * 10);
        }
        std::fs::write(folder.join("rgb.txt"), rgb).unwrap();
        std::fs::write(folder.join("depth.txt"), depth).unwrap();
    };
    record("fits", &map);
    record("other", &mirrored(&map));
    record("fat", &fat(&map, 6));
    let stream = |name: &str, to: &str| {
        let ran = home.run(&["stream", name, "--to", to, "--backend", "cpu", "--quality", "draft"]);
        ran.done().to_owned()
    };
    let about =
        |said: &str| said.lines().filter(|line| line.contains("none of the outlines of its depth match")).count();
    assert_eq!(about(&stream("fits", "null")), 0);
    assert_eq!(about(&stream("other", "null")), 1);
    let pictures = |name: &str| {
        let out = format!("{name}-out/");
        let said = stream(name, &out);
        let of = |frame: &str| read_color(&home.path(&out).join(frame)).unwrap();
        (said, [of("000000.png"), of("000024.png")])
    };
    let ((_, fitting), (said, mended)) = (pictures("fits"), pictures("fat"));
    let about =
        said.lines().filter(|line| line.contains("depth is aligned with the pictures, as its outlines lie about"));
    assert_eq!(about.count(), 1, "{said}");
    // The first frames are used for the measurement, and not corrected yet.
    let off = |k: usize| {
        let values = fitting[k].rgb.iter().zip(&mended[k].rgb);
        values.map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum::<f64>()
    };
    assert!(off(1) < 0.8 * off(0), "{} before, {} after", off(0), off(1));
}
