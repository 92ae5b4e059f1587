//! The table of key bindings.

use egui::Key;

use super::{Binding, Chord, Context, Group};
use crate::state::{Action, Source, State, ViewMode, tweak};
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Look;

const fn key(key: Key) -> Chord {
    Chord { key, ctrl: false, shift: false }
}

const fn ctrl(key: Key) -> Chord {
    Chord { key, ctrl: true, shift: false }
}

const fn shift(key: Key) -> Chord {
    Chord { key, ctrl: false, shift: true }
}

const fn ctrl_shift(key: Key) -> Chord {
    Chord { key, ctrl: true, shift: true }
}

type MakeAction = fn(&State, Context) -> Option<Action>;

/// Creates a binding that acts once per press.
const fn bind_once(chords: &'static [Chord], keys: &'static str, help: &'static str, make: MakeAction) -> Binding {
    Binding { chords, keys, help, repeats: false, make }
}

/// Creates a binding that repeats while the key is held.
const fn bind_repeating(chords: &'static [Chord], keys: &'static str, help: &'static str, make: MakeAction) -> Binding {
    Binding { chords, keys, help, repeats: true, make }
}

/// Returns the action that changes the look, or `None` if `change` has no effect. Consecutive changes with the same
/// `stroke` share one undo step.
fn edit_look(state: &State, stroke: &'static str, change: impl FnOnce(&mut Look)) -> Option<Action> {
    let mut look = state.look.clone();
    change(&mut look);
    (look != state.look).then(|| Action::Look { look: Box::new(look), stroke: Some(stroke) })
}

/// Returns the direction of a pair of opposite keys: -1 for the first chord of the pair, 1 for the second.
fn direction_sign(context: Context) -> f32 {
    if context.chord.is_multiple_of(2) { -1.0 } else { 1.0 }
}

/// Returns the action of Esc: closes the topmost open item, one per press.
fn close_topmost(state: &State) -> Option<Action> {
    if state.closing {
        Some(Action::CancelClose)
    } else if state.self_timer {
        Some(Action::SelfTimer(false))
    } else if state.help {
        Some(Action::Help(false))
    } else if state.asked_file().is_some() {
        Some(Action::DismissDropped)
    } else if state.output_failure.is_some() {
        Some(Action::DismissFailure)
    } else if let Some(depth_method) = state.method_without_plate() {
        Some(Action::SetDepthMethod(depth_method))
    } else if state.offers_depth_methods() && !state.controls_hidden {
        Some(Action::DeclineDepthOffer)
    } else if state.is_demonstration() && !state.demonstration_dismissed && !state.controls_hidden {
        Some(Action::DismissDemonstration)
    } else if state.controls_hidden {
        Some(Action::HideControls(false))
    } else if state.full_screen {
        Some(Action::FullScreen(false))
    } else if state.panel {
        Some(Action::Panel(false))
    } else {
        None
    }
}

/// Focus step of an arrow key, as a fraction of the picture.
const FOCUS_STEP: f32 = 0.02;
/// Factor of the blur amount or the f-number per key press: a third of a stop.
const THIRD_STOP: f32 = 1.122;
/// Step of the focus range, in metres.
const RANGE_STEP_M: f32 = 0.05;
/// Factor of the text scale per key press.
const TEXT_STEP: f32 = 1.1;

pub const GROUPS: [Group; 5] = [
    Group {
        name: "Look",
        bindings: &[
            bind_once(
                &[
                    key(Key::Num1),
                    key(Key::Num2),
                    key(Key::Num3),
                    key(Key::Num4),
                    key(Key::Num5),
                    key(Key::Num6),
                    key(Key::Num7),
                    key(Key::Num8),
                    key(Key::Num9),
                ],
                "1 – 9",
                "the preset of that number",
                |state, context| state.presets.get(context.chord).map(|preset| Action::Preset(preset.name.clone())),
            ),
            bind_repeating(
                &[key(Key::OpenBracket), key(Key::CloseBracket)],
                "[  ]",
                "less blur, more blur",
                |state, context| {
                    let factor = THIRD_STOP.powf(direction_sign(context));
                    edit_look(state, "key blur", |look| tweak::scale_blur(look, factor, context.size.1))
                },
            ),
            bind_repeating(
                &[key(Key::Semicolon), key(Key::Quote)],
                ";  '",
                "smaller f-number, larger f-number",
                |state, context| {
                    let factor = THIRD_STOP.powf(direction_sign(context));
                    edit_look(state, "key f-number", |look| {
                        tweak::scale_f_number(look, factor, state.focus_distance_m(), context.size)
                    })
                },
            ),
            bind_repeating(
                &[key(Key::Comma), key(Key::Period)],
                ",  .",
                "less in focus, more in focus",
                |state, context| {
                    edit_look(state, "key focal range", |look| {
                        tweak::widen_focus_range(look, RANGE_STEP_M * direction_sign(context))
                    })
                },
            ),
            bind_repeating(&[ctrl(Key::Z)], "Ctrl+Z", "undo", |_, _| Some(Action::Undo)),
            bind_repeating(&[ctrl_shift(Key::Z), ctrl(Key::Y)], "Ctrl+Shift+Z", "redo", |_, _| Some(Action::Redo)),
            bind_once(&[key(Key::R)], "R", "back to the usual look", |_, _| Some(Action::Reset)),
        ],
    },
    Group {
        name: "Focus",
        bindings: &[
            bind_once(&[key(Key::T)], "T", "take a plate (the empty room)", |_, _| Some(Action::CapturePlate)),
            bind_once(&[key(Key::A)], "A", "focus on the subject", |state, _| {
                edit_look(state, "key auto", |look| look.focus = FocusRule::Auto)
            }),
            bind_repeating(
                &[key(Key::ArrowLeft), key(Key::ArrowRight)],
                "Left, Right",
                "move the point of focus, turn the sharp band",
                |state, context| {
                    let to_the_right = if state.mirror { -direction_sign(context) } else { direction_sign(context) };
                    edit_look(state, "key arrows", |look| tweak::move_focus(look, FOCUS_STEP * to_the_right, 0.0))
                },
            ),
            bind_repeating(
                &[key(Key::ArrowUp), key(Key::ArrowDown)],
                "Up, Down",
                "move the point of focus, move the sharp band",
                |state, context| {
                    edit_look(state, "key arrows", |look| {
                        tweak::move_focus(look, 0.0, FOCUS_STEP * direction_sign(context))
                    })
                },
            ),
        ],
    },
    Group {
        name: "View",
        bindings: &[
            bind_once(&[key(Key::B)], "B", "before and after, side by side", |state, _| {
                Some(Action::Split(if state.split.is_some() { None } else { Some(0.5) }))
            }),
            bind_once(&[key(Key::Z)], "Z", "freeze the picture, pause a recording", |state, _| {
                Some(Action::Freeze(!state.frozen))
            }),
            bind_repeating(
                &[key(Key::PageUp), key(Key::PageDown)],
                "PageUp, PageDown",
                "in a recording: pause, one frame back or forward",
                |state, context| state.transport.map(|_| Action::Step(direction_sign(context) as i32)),
            ),
            bind_once(&[key(Key::Home)], "Home", "the recording's first frame", |state, _| {
                state.transport.map(|_| Action::Seek(0))
            }),
            bind_once(&[key(Key::X)], "X", "actual pixels (100 %), whole picture", |state, context| {
                Some(Action::Zoom(
                    if state.zoom.factor == 0 { state.zoom.next_factor(1, context.fit) } else { 0 },
                    None,
                ))
            }),
            bind_once(
                &[key(Key::Minus), key(Key::Plus), key(Key::Minus), key(Key::Equals)],
                "Minus, Plus",
                "smaller, larger: 100, 200, 400, 800 %",
                |state, context| {
                    Some(Action::Zoom(state.zoom.next_factor(direction_sign(context) as i32, context.fit), None))
                },
            ),
            bind_once(&[key(Key::M)], "M", "mirror the window", |state, _| Some(Action::Mirror(!state.mirror))),
            bind_once(&[key(Key::D)], "D", "show depth", |state, _| {
                Some(Action::Show(if state.shown == ViewMode::Depth { ViewMode::Picture } else { ViewMode::Depth }))
            }),
        ],
    },
    Group {
        name: "Keep",
        bindings: &[
            bind_once(&[key(Key::S)], "S", "save a snapshot", |_, _| Some(Action::Snapshot)),
            bind_once(&[shift(Key::S)], "Shift+S", "save a snapshot in three seconds", |state, _| {
                Some(Action::SelfTimer(!state.self_timer))
            }),
            bind_once(&[key(Key::V)], "V", "start or stop a recording", |state, _| {
                Some(Action::Record(state.recording().is_none()))
            }),
            bind_once(&[key(Key::O)], "O", "start or stop the virtual camera", |state, _| {
                let first = || state.virtual_cameras.first().map(|choice| choice.name.clone());
                Some(Action::VirtualCamera(if state.virtual_camera().is_some() { None } else { first() }))
            }),
            bind_once(&[key(Key::K)], "K", "copy as a command", |_, _| Some(Action::CopyCommand)),
            bind_once(&[key(Key::F5)], "F5", "reopen the source, look for new ones", |state, _| {
                let lost = matches!(state.source, Source::Lost(_) | Source::Ended);
                Some(if lost { Action::Retry } else { Action::Refresh })
            }),
        ],
    },
    Group {
        name: "Window",
        bindings: &[
            bind_once(&[key(Key::P), key(Key::Space)], "P, Space", "the panel", |state, _| {
                Some(Action::Panel(!state.panel))
            }),
            bind_once(&[key(Key::H)], "H", "only the picture", |state, _| {
                Some(Action::HideControls(!state.controls_hidden))
            }),
            bind_once(&[key(Key::F), key(Key::F11)], "F, F11", "full screen", |state, _| {
                Some(Action::FullScreen(!state.full_screen))
            }),
            // Minus is listed twice because `direction_sign` takes chords in pairs; without Shift, Plus is Equals on many
            // layouts.
            bind_repeating(
                &[ctrl(Key::Minus), ctrl(Key::Plus), ctrl(Key::Minus), ctrl(Key::Equals)],
                "Ctrl+−  Ctrl++",
                "smaller text, larger text",
                |state, context| {
                    Some(Action::TextScale(state.preferences.text_scale * TEXT_STEP.powf(direction_sign(context))))
                },
            ),
            bind_once(&[ctrl(Key::Num0)], "Ctrl+0", "normal text size", |_, _| Some(Action::TextScale(1.0))),
            bind_once(&[key(Key::F1), key(Key::Questionmark)], "F1, ?", "these keys", |state, _| {
                Some(Action::Help(!state.help))
            }),
            bind_once(&[key(Key::Escape)], "Esc", "close the open dialog, leave full screen", |state, _| {
                close_topmost(state)
            }),
            bind_once(&[key(Key::Q), ctrl(Key::Q), ctrl(Key::W)], "Q, Ctrl+Q", "close the window", |_, _| {
                Some(Action::Close)
            }),
        ],
    },
];
