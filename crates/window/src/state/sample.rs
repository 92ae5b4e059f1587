//! Sample states for tests.

use super::{DepthMethod, Running, Source, State};
use bokehcam::look::presets::Preset;
use bokehcam::look::{Effect, Look, Patch, Strength, Tilt};
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::source::devices::Choice;
use bokehcam_live::source::{DepthOrigin, Kind};

/// Returns a typical look.
pub fn look() -> Look {
    Look { tilt: Tilt { center_y: 0.5, band: 0.15, angle_deg: 0.0 }, highlights: 8.0, ..Look::default() }
}

/// Returns [`look`] with a different blur strength.
pub fn blurred(radius_px: f32) -> Look {
    Look { strength: Strength::AtInfinity(radius_px), ..look() }
}

/// Returns a running source.
pub fn running(has_depth: bool) -> Source {
    Source::Running(Running {
        name: "portrait".into(),
        label: "Desk camera".into(),
        size: (1280, 720),
        period_ns: 33_333_333,
        has_depth,
        kind: Kind::Camera,
        depth_from: if has_depth { DepthOrigin::Metres } else { DepthOrigin::Nothing },
        depth_methods: if has_depth { vec![DepthMethod::Measured] } else { vec![DepthMethod::Plate] },
        depth_method: has_depth.then_some(DepthMethod::Measured),
        executor: "cpu, 2 threads, AVX2".into(),
    })
}

/// Returns the state of a window with a running source with depth, and several choices in every list.
pub fn state() -> State {
    let mut state = State::new(look(), "portrait".into());
    state.source = running(true);
    state.focus_m = Some(1.24);
    let choice = |name: &str, label: &str| Choice { name: name.into(), label: label.into() };
    state.sources = vec![choice("portrait", "Recording: portrait"), choice("/dev/video0", "Desk camera")];
    state.virtual_cameras = vec![choice("/dev/video9", "bokehcam (/dev/video9)")];
    let preset = |name: &str, look: Look, is_user_defined: bool| Preset {
        name: name.into(),
        patch: Patch::from_look(&look),
        is_user_defined,
    };
    state.presets = vec![
        preset("portrait", look(), false),
        preset("cinematic", blurred(30.0), false),
        preset("dreamy", Look { highlights: 20.0, ..blurred(40.0) }, false),
        preset("product", Look { focus_range_m: 0.2, ..blurred(12.0) }, false),
        preset("miniature", Look { effect: Effect::TiltShift, ..blurred(14.0) }, false),
        preset("my desk", blurred(21.0), true),
    ];
    let control = |name: &str, value: i64, range: (i64, i64, i64)| CameraControl {
        name: name.into(),
        value,
        range,
        menu: Vec::new(),
        is_boolean: false,
        is_active: true,
    };
    let menu = vec![(1, "Manual Mode".to_owned()), (3, "Aperture Priority Mode".to_owned())];
    // Expands the panel.
    state.preferences.sections.insert("More".into(), true);
    state.controls = vec![
        control("brightness", 10, (-64, 64, 1)),
        CameraControl { is_boolean: true, ..control("white_balance_automatic", 1, (0, 1, 1)) },
        CameraControl { menu, ..control("auto_exposure", 3, (0, 3, 1)) },
        CameraControl { is_active: false, ..control("exposure_time_absolute", 157, (1, 5000, 1)) },
    ];
    state
}
