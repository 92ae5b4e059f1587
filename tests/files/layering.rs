//! Imports only point to lower layers, siblings do not import each other, and a crate is used at one place: a scan of
//! the source text.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules of `bokehcam`, `bokehcam-media` and `bokehcam-live` by layer, the lowest first, then the crates above them.
const LAYERS: [&[&str]; 13] = [
    &["names"],
    &["color", "frame", "optics", "clock", "files", "camera_control"],
    &["compute", "calibration", "layout"],
    &["link", "budget", "network", "stats", "recording", "video", "v4l2", "pipewire", "control"],
    &["capture", "depth", "bokeh", "sink"],
    &["look"],
    &["computing"],
    &["engine"],
    &["pipeline"],
    &["source"],
    &["controller"],
    // Crates of their own, under `crates/`.
    &["lab", "window"],
    &["cli"],
];

/// External crates, and the only places that may name them: modules of the library, or folders of a crate above it.
const DOORS: [(&str, &[&str]); 29] = [
    ("bokehcam_link", &["lib"]),
    ("clap", &["cli", "source/options"]),
    ("crossbeam_channel", &["link"]),
    ("egui_wgpu", &["window/present"]),
    ("egui_winit", &["window/window"]),
    ("image", &["capture/demo", "recording", "sink"]),
    ("image_webp", &["recording/encode"]),
    ("jiff", &["files/user_folders"]),
    ("lz4_flex", &["recording/mcap"]),
    ("lzfse_rust", &["recording/record3d"]),
    ("moxcms", &["recording/icc"]),
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
            "video",
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
    ("zune_jpeg", &["capture", "recording"]),
];

/// Crates of the workspace above the library.
const CRATES: [&str; 3] = ["cli", "lab", "window"];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|modules| modules.contains(&module))
}

/// Returns the violations in the source file `path` (relative to `src/`, or the name of a crate and relative to its
/// `src/`), one line each.
fn violations(path: &str, source: &str) -> Vec<String> {
    let module = path.split(['/', '.']).next().unwrap_or_default();
    let mut found = Vec::new();
    let Some(own) = layer(module) else {
        return if module == "lib" { found } else { vec![format!("{path}: module {module} has no layer")] };
    };
    // Tests may import anything; they are last in a file, or a file of their own.
    let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    for (number, line) in (1..).zip(source.lines()) {
        let code = line.split("//").next().unwrap_or_default();
        let of_library = ["crate::", "bokehcam::", "bokehcam_media::", "bokehcam_live::"]
            .into_iter()
            .skip(usize::from(CRATES.contains(&module)));
        let libraries = CRATES
            .iter()
            .filter(|above| code.contains(&format!("bokehcam_{above}::")))
            .map(|above| (*above).to_owned());
        let used = of_library.flat_map(|root| after(code, root)).flat_map(names).chain(libraries);
        for used in used {
            match layer(&used) {
                _ if used == module => {}
                Some(other) if other < own => {}
                Some(_) => found.push(format!("{path}:{number}: {module} may not import {used}")),
                None => {}
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
    let read = |prefix: &str, folder: &str| -> Vec<(String, String)> {
        let root = top.join(folder);
        let path = |file: &Path| format!("{prefix}{}", file.strip_prefix(&root).unwrap().to_str().unwrap());
        sources(&root).iter().map(|file| (path(file), fs::read_to_string(file).unwrap())).collect()
    };
    let above = CRATES.map(|name| read(&format!("{name}/"), &format!("crates/{name}/src")));
    // The modules of the engine and of the crates on it, which have different names or continue one another.
    let library = ["src", "crates/media/src", "crates/live/src"].map(|folder| read("", folder)).concat();
    let library = [library, read("link/", "crates/link/src")].concat();
    let mut found = Vec::new();
    for files in above.into_iter().chain([library]) {
        assert!(files.len() > 20, "the scan found only {} files: {files:?}", files.len());
        for (path, source) in files {
            found.extend(violations(&path, &source));
        }
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn the_scan_finds_what_it_should() {
    let bad = [
        ("frame.rs", "use crate::link::pool::Pool;"),
        ("sink/png.rs", "use crate::capture::Camera;"),
        ("bokeh/mod.rs", "    let x = crate::pipeline::run();"),
        ("stats.rs", "use crate::{frame::FrameId, recording::tum};"),
        ("pipeline.rs", "use crossbeam_channel::bounded;"),
        ("bokeh/cpu/mod.rs", "fn f() { wgpu::Instance::default(); }"),
        ("cli/commands/render/mod.rs", "use image;"),
        ("window/lib.rs", "use bokehcam_cli::run;"),
        ("frame.rs", "#[cfg(test)]\nmod tests;\nuse crate::link::pool::Pool;"),
        ("attic.rs", ""),
    ];
    for (path, source) in bad {
        assert_eq!(violations(path, source).len(), 1, "{path}: {source}");
    }
    let good = [
        ("pipeline.rs", "use crate::{bokeh::{Bokeh, Job}, sink};"),
        ("bokeh/gpu/device.rs", "use wgpu::Device; use crate::bokeh::plan;"),
        ("sink/png.rs", "use image::ImageEncoder; // crate::cli would be wrong"),
        ("frame.rs", "#[cfg(test)]\nmod tests { use crate::pipeline::run; }"),
        ("cli/main.rs", "use bokehcam_window::window; use crate::source;"),
        ("optics.rs", "let my_image::x = super::image();"),
    ];
    for (path, source) in good {
        assert_eq!(violations(path, source), Vec::<String>::new(), "{path}");
    }
}
