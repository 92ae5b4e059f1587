//! The table of texts: complete, without unused entries, and used for everything that is drawn.

use std::path::Path;

use super::{Window, sample};
use crate::keys::GROUPS;
use crate::state::{Action, DepthMethod, DroppedFile, Output, Source, State, Transport, tweak};
use crate::texts::{self, tests as table};
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::plate::Step;
use bokehcam::look::{Effect, FramingZoom, Privacy, Strength};

/// Creates windows that together show nearly every text.
fn windows() -> Vec<Window> {
    let changes: [&dyn Fn(&mut State); 22] = [
        &|_| {},
        &|state| {
            state.transport = Some(Transport { frame: 3, frames: 24, time_ns: 1, length_ns: 9 });
            (state.self_timer, state.saved_in, state.frozen) = (true, Some("gone".into()), true);
            (state.mirror, state.is_transitional) = (true, true);
        },
        &|state| state.look.effect = Effect::TiltShift,
        &|state| {
            (state.look.focus, state.look.strength) = (tweak::focus_on_point(0.5, 0.5), Strength::Percent(0.0));
            state.look.privacy = Privacy::On;
        },
        &|state| {
            state.outputs.push(Output { name: "/dev/video9".into(), is_camera: true });
            state.look.strength = Strength::Percent(0.5);
        },
        &|state| {
            state.look.strength = Strength::Lens(tweak::DEFAULT_LENS);
            state.look.aperture.shape = bokehcam::bokeh::aperture::Shape::Ring { inner: 0.5 };
        },
        &|state| {
            state.look.aperture.shape =
                bokehcam::bokeh::aperture::Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.1 };
            state.split = Some(0.5);
        },
        &|state| {
            (state.look.background, state.look.follow) = (Background::Color([1, 2, 3]), FramingZoom::from_zoom(2.0));
        },
        &|state| state.help = true,
        &|state| {
            let Source::Running(running) = &mut state.source else { return };
            running.depth_methods = vec![
                DepthMethod::Measured,
                DepthMethod::Stereo,
                DepthMethod::Person,
                DepthMethod::PersonAndMonoDepth,
                DepthMethod::Plate,
            ];
            (state.camera.metres, state.look.focus_range_m) = (bokehcam::look::Metres::Missing, 0.5);
        },
        &|state| {
            let Source::Running(running) = &mut state.source else { return };
            running.name = "demo".into();
            (state.look.focus_range_m, state.output_failure) = (0.5, Some("No space left on device: x; kept".into()));
            state.apply(Action::Section("More", false));
        },
        &|state| (state.closing, state.frozen) = (true, true),
        &|state| state.source = sample::running(false),
        &|state| (state.source, state.plate) = (sample::running(false), Some(Step::Mismatched)),
        &|state| (state.source, state.plate) = (sample::running(false), Some(Step::StepOut(3))),
        &|state| (state.source, state.plate) = (sample::running(false), Some(Step::PersonThere)),
        &|state| {
            let Source::Running(running) = &mut state.source else { return };
            (running.has_depth, running.depth_methods) = (false, vec![DepthMethod::Person]);
        },
        &|state| state.dropped = Some(DroppedFile { name: "wall.png".into(), is_asked: true }),
        &|state| {
            let Source::Running(running) = &mut state.source else { return };
            (running.name, state.camera.is_fallback) = ("demo".into(), true);
        },
        &|state| state.source = Source::Lost("gone".into()),
        &|state| (state.source, state.output_failure) = (Source::Ended, Some("gone".into())),
        &|state| (state.source, state.virtual_cameras) = (Source::Opening, Vec::new()),
    ];
    let mut windows = Vec::new();
    for change in changes {
        let mut state = sample::state();
        state.outputs = vec![Output { name: "clip.mp4".into(), is_camera: false }];
        for section in ["Controls of the camera", "For experts", "Background"] {
            state.apply(Action::Section(section, true));
        }
        change(&mut state);
        windows.push(Window::of(state, (1280, 2400)));
    }
    windows
}

/// Returns the crate's source code, with continued string literals joined.
fn sources(folder: &Path) -> String {
    let mut all = String::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_string_lossy().into_owned();
        if entry.is_dir() && name != "tests" {
            all += &sources(&entry);
        } else if name.ends_with(".rs") && name != "tests.rs" {
            all += &std::fs::read_to_string(entry).unwrap();
        }
    }
    let lines: Vec<&str> = all.split("\\\n").collect();
    lines[1..].iter().fold(lines[0].to_owned(), |all, line| all + line.trim_start())
}

#[test]
fn the_table_has_all_texts_and_no_others() {
    let sources = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let is_written = |text: &str| sources.contains(&format!("\"{}\"", text.replace('"', "\\\"")));
    for mut window in windows() {
        window.wait(0.3);
        for act in ["Save as…", "Edit…", "Delete"] {
            if let Some(at) = window.place_of(act) {
                window.click(at);
                window.wait(0.1);
            }
        }
    }
    for (does, keys) in GROUPS.iter().flat_map(|group| group.bindings).map(|binding| (binding.help, binding.keys)) {
        texts::tr(does);
        texts::tr(keys);
    }
    let english = table::english_table();
    let missing: Vec<String> =
        table::recorded_texts().into_iter().filter(|text| is_written(text) && !english.contains_key(text)).collect();
    let lines: Vec<String> = missing.iter().map(|text| format!("{text:?} = \"\"")).collect();
    assert!(missing.is_empty(), "texts.toml has not:\n{}", lines.join("\n"));
    let gone: Vec<&String> = english.keys().filter(|text| !is_written(text)).collect();
    assert!(gone.is_empty(), "texts.toml has what is nowhere: {gone:#?}");
}

#[test]
fn what_is_said_while_it_runs_is_in_the_table_too() {
    let sources = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let english = table::english_table();
    let literal = |after: &str| {
        let text = after.trim_start().strip_prefix('"')?.split('"').next()?.to_owned();
        (text.contains(' ') && text.starts_with(char::is_uppercase)).then_some(text)
    };
    let following = |before: &str| sources.split(before).skip(1).filter_map(literal).collect::<Vec<_>>();
    let constants = following(": &str =").into_iter().filter(|text| text.ends_with('.'));
    let said: Vec<String> = constants.chain(following("note(format!(")).chain(following("note(")).collect();
    assert!(said.len() > 20, "{said:?}");
    let missing: Vec<&String> = said.iter().filter(|text| !english.contains_key(*text)).collect();
    assert!(missing.is_empty(), "texts.toml has not: {missing:#?}");
}

#[test]
fn all_that_is_drawn_is_translated() {
    // Names, error reasons and numbers are the same in every language.
    let names = [
        "Desk camera",
        "portrait",
        "clip.mp4",
        "wall.png",
        "bokehcam",
        "kept",
        "cpu, 2",
        "gone",
        "Manual Mode",
        "Aperture Priority",
    ];
    let english = table::english_table();
    texts::set_translation(english.into_keys().map(|text| (text.clone(), format!("«{text}»"))).collect());
    let presets: Vec<String> = sample::state().presets.iter().map(|preset| preset.name.to_lowercase()).collect();
    let controls = ["Brightness", "White balance", "Auto exposure", "Exposure time"];
    let levels = ["draft", "balanced", "best", "auto", "full"];
    let units = ["fps", "px", "mm", "kB", "MB"];
    for mut window in windows() {
        window.wait(0.3);
        for text in window.texts() {
            let has_word =
                text.split(|c: char| !c.is_alphabetic()).any(|word| word.len() > 1 && !units.contains(&word));
            let is_name = names.iter().chain(&controls).any(|name| text.contains(name))
                || presets.contains(&text.to_lowercase())
                || levels.iter().any(|level| text.contains(level));
            assert!(text.contains('«') || !has_word || is_name, "{text}");
        }
    }
}
