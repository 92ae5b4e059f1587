//! Windows of all sizes, texts of all sizes, everything open: nothing panics, and nothing is nowhere.

use egui::Rect;

use super::{Window, sample};
use crate::look::Effect;
use crate::preview::state::{Shown, Source, State};
use crate::preview::views::Legend;

fn states() -> Vec<State> {
    let base = sample::state();
    let mut all = vec![base.clone()];
    let mut full = base.clone();
    full.meters.fill_for_looks();
    (full.instruments, full.help, full.split) = (true, true, Some(0.5));
    full.legend = Some(Legend::Depth { near_m: 0.5, far_m: 0.50001 });
    full.note("A long line for the person ".repeat(30));
    all.push(full);
    let mut tilt = base.clone();
    (tilt.look.effect, tilt.mirror, tilt.source) = (Effect::TiltShift, true, sample::running(false));
    tilt.legend = Some(Legend::Coc { most_px: 0.0 });
    all.push(tilt);
    let mut off = base.clone();
    (off.look.effect, off.shown, off.source) = (Effect::None, Shown::Bins, Source::Lost("why ".repeat(200)));
    off.legend = Some(Legend::Bins { count: 13, high_px: [f32::INFINITY; 13] });
    off.focus_m = Some(f32::INFINITY);
    all.push(off);
    let mut empty = State::new(sample::look(), String::new());
    empty.source = Source::Ended;
    all.push(empty);
    all
}

#[test]
fn any_window_and_any_text() {
    for size in [(1, 1), (100, 80), (320, 1000), (1280, 720), (4096, 2304)] {
        for text_scale in [0.75, 1.0, 3.0] {
            for mut state in states() {
                state.habits.text_scale = text_scale;
                let mut window = Window::of(state, size);
                window.wait(0.1);
            }
        }
    }
}

#[test]
fn the_panel_is_within_the_window() {
    for (size, text_scale) in [((1280, 720), 1.0), ((640, 480), 1.0), ((1280, 720), 3.0), ((4096, 2304), 2.0)] {
        let mut state = sample::state();
        state.habits.text_scale = text_scale;
        let mut window = Window::of(state, size);
        window.wait(0.5);
        let rect = window.panel.sheet.rect().expect("the panel is shown");
        let whole = window.ctx.content_rect();
        assert!(whole.expand(1.0).contains_rect(rect), "{size:?} at {text_scale}: {rect} in {whole}");
    }
}

#[test]
fn a_canvas_without_pixels_is_no_picture() {
    let mut window = Window::new();
    window.canvas = crate::preview::panel::Canvas::default();
    assert!(window.click(egui::pos2(200.0, 200.0)).is_empty());
}

#[test]
fn in_the_instruments_no_text_runs_over_another() {
    for text_scale in [1.0, 1.6] {
        let mut state = sample::state();
        (state.instruments, state.panel, state.habits.text_scale) = (true, false, text_scale);
        state.meters.fill_for_looks();
        let mut window = Window::of(state, (1280, 720));
        window.wait(0.5);
        let texts = window.boxes();
        for wanted in ["150 of 300:", "every 2nd frame", "Play-out delay", "Between stages"] {
            assert!(texts.iter().any(|(text, _)| text.contains(wanted)), "{wanted}: {texts:?}");
        }
        let over = |a: &Rect, b: &Rect| a.shrink(0.5).intersects(b.shrink(0.5));
        for (k, (text, at)) in texts.iter().enumerate() {
            let under = texts[..k].iter().find(|(_, other)| over(at, other));
            assert!(under.is_none(), "{text} at {at} runs over {under:?}");
        }
    }
}
