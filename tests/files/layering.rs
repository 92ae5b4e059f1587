//! Imports only point to lower layers, siblings do not import each other, and a crate is used at one place: a scan of
//! the source text.

use std::fs;
use std::path::{Path, PathBuf};

/// Crates of the workspace: their folder, and their modules by layer, the lowest first. A crate without layers is a room by
/// itself. Cargo sees to it that crates import downwards.
const CRATES: [(&str, &[&[&str]]); 12] = [
    (
        "src",
        &[
            &["names"],
            &["color", "frame", "optics", "clock"],
            &["compute", "calibration", "budget"],
            &["bokeh", "depth"],
            &["look"],
            &["computing"],
            &["engine"],
        ],
    ),
    (
        "crates/live/src",
        &[
            &["camera_control", "layout"],
            &["control", "pipewire", "stats", "v4l2"],
            &["capture", "depth", "sink"],
            &["pipeline"],
            &["source"],
            &["controller"],
        ],
    ),
    ("crates/networks/src", &[&["network"], &["single_camera"]]),
    ("crates/files/src", &[]),
    ("crates/calibration/src", &[]),
    ("crates/jpeg/src", &[]),
    ("crates/link/src", &[]),
    ("crates/media/src", &[&["recording"]]),
    ("crates/video/src", &[]),
    ("crates/lab/src", &[]),
    ("crates/window/src", &[]),
    ("crates/cli/src", &[]),
];

/// External crates, and the only places that may name them: modules of the library, or folders of a crate above it.
const DOORS: [(&str, &[&str]); 29] = [
    ("bokehcam_link", &["lib"]),
    ("clap", &["cli", "source/options"]),
    ("crossbeam_channel", &["link"]),
    ("egui_wgpu", &["window/present"]),
    ("egui_winit", &["window/window"]),
    ("image", &["capture/demo", "jpeg", "recording", "sink"]),
    ("image_webp", &["recording/encode"]),
    ("jiff", &["files/user_folders", "recording/kitti"]),
    ("lz4_flex", &["recording/mcap"]),
    ("lzfse_rust", &["recording/record3d"]),
    ("moxcms", &["recording/color_space"]),
    ("pipewire", &["pipewire"]),
    ("png", &["recording", "sink"]),
    (
        "rustix",
        &[
            "compute/memory",
            "compute/thread_pool",
            "clock",
            "control",
            "files",
            "link/event",
            "pipewire",
            "sink/pipe",
            "v4l2",
        ],
    ),
    ("rfd", &["window/dialog"]),
    ("roxmltree", &["recording/embedded", "recording/xmp"]),
    ("rten", &["network/built_in"]),
    ("rten_tensor", &["network/built_in"]),
    ("ruzstd", &["recording/mcap"]),
    ("saphyr_parser", &["calibration"]),
    ("sha2", &["network/known"]),
    ("skrifa", &["window/panel/fonts"]),
    ("softbuffer", &["window/present"]),
    ("strsim", &["names", "v4l2"]),
    ("v4l", &["v4l2"]),
    (
        "wgpu",
        &["bokeh/gpu", "compute/device", "depth/matting/gpu", "depth/refine/gpu", "depth/stereo/gpu", "window/present"],
    ),
    ("winit", &["window/present", "window/window"]),
    ("zbus", &["control/bus", "window/window"]),
    ("zune_jpeg", &["capture", "jpeg"]),
];

/// Returns the violations in the source file `path`, relative to its crate's folder, whose name begins it for crates without
/// layers; one line each.
fn violations(path: &str, source: &str, layers: &[&[&str]]) -> Vec<String> {
    let module = path.split(['/', '.']).next().unwrap_or_default();
    let layer = |module: &str| layers.iter().position(|modules| modules.contains(&module));
    let mut found = Vec::new();
    let own = layer(module);
    if own.is_none() && module != "lib" && !layers.is_empty() {
        return vec![format!("{path}: module {module} has no layer")];
    }
    // Tests may import anything; they are last in a file, or a file of their own.
    let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    for (number, line) in (1..).zip(source.lines()) {
        let code = line.split("//").next().unwrap_or_default();
        for used in after(code, "crate::").flat_map(names).filter(|used| used != module) {
            if own.zip(layer(&used)).is_some_and(|(own, other)| other >= own) {
                found.push(format!("{path}:{number}: {module} may not import {used}"));
            }
        }
        for (door, homes) in DOORS {
            let named = after(code, &format!("{door}::")).next().is_some() || code.contains(&format!("use {door};"));
            if named && !homes.iter().any(|home| path == format!("{home}.rs") || path.starts_with(&format!("{home}/")))
            {
                found.push(format!("{path}:{number}: {door} belongs to {homes:?}"));
            }
        }
    }
    found
}

/// Returns the text after each `path_root` in a line, where that begins a path.
fn after<'a>(code: &'a str, path_root: &'a str) -> impl Iterator<Item = &'a str> {
    code.match_indices(path_root).filter_map(move |(at, _)| {
        let before = code[..at].chars().last();
        let begins = before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':');
        begins.then(|| &code[at + path_root.len()..])
    })
}

/// Returns the first name of a path, or of each path in braces.
fn names(path: &str) -> Vec<String> {
    let first = |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let Some(list) = path.strip_prefix('{') else { return vec![first(path)] };
    let mut depth = 0;
    let outer: String = list
        .chars()
        .filter(|&c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            depth == 0
        })
        .collect();
    outer.split(',').map(first).collect()
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries
        .flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("tests.rs"))
        .collect();
    files.sort();
    files
}

#[test]
fn imports_go_down_and_crates_have_one_door() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for (folder, layers) in CRATES {
        let root = top.join(folder);
        let files = sources(&root);
        assert!(files.len() > 5, "the scan found only {} files in {folder}", files.len());
        let prefix = if layers.is_empty() { folder["crates/".len()..].replace("src", "") } else { String::new() };
        for file in files {
            let path = format!("{prefix}{}", file.strip_prefix(&root).unwrap().to_str().unwrap());
            found.extend(violations(&path, &fs::read_to_string(&file).unwrap(), layers));
        }
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn the_scan_finds_what_it_should() {
    let layers = |folder: &str| CRATES.iter().find(|(named, _)| *named == folder).unwrap().1;
    let [engine, networks, live, cli] = ["src", "crates/networks/src", "crates/live/src", "crates/cli/src"].map(layers);
    let bad = [
        (engine, "frame.rs", "use crate::bokeh::Bokeh;"),
        (live, "sink/png.rs", "use crate::capture::Camera;"),
        (engine, "bokeh/mod.rs", "    let x = crate::engine::run();"),
        (networks, "network.rs", "use crate::{files::place, single_camera::Hints};"),
        (live, "pipeline.rs", "use crossbeam_channel::bounded;"),
        (engine, "bokeh/cpu/mod.rs", "fn f() { wgpu::Instance::default(); }"),
        (cli, "cli/commands/render/mod.rs", "use image;"),
        (engine, "frame.rs", "#[cfg(test)]\nmod tests;\nuse crate::bokeh::Bokeh;"),
        (engine, "attic.rs", ""),
    ];
    for (layers, path, source) in bad {
        assert_eq!(violations(path, source, layers).len(), 1, "{path}: {source}");
    }
    let good = [
        (live, "pipeline.rs", "use crate::{capture::{Camera, Captured}, sink};"),
        (engine, "bokeh/gpu/device.rs", "use wgpu::Device; use crate::bokeh::plan;"),
        (live, "sink/png.rs", "use image::ImageEncoder; // crate::source would be wrong"),
        (engine, "frame.rs", "#[cfg(test)]\nmod tests { use crate::engine::run; }"),
        (cli, "cli/main.rs", "use bokehcam_window::window; use crate::source;"),
        (engine, "optics.rs", "let my_image::x = super::image();"),
    ];
    for (layers, path, source) in good {
        assert_eq!(violations(path, source, layers), Vec::<String>::new(), "{path}");
    }
}
