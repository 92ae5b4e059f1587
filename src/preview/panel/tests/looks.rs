//! Pictures of the window in several states, to look at, and contrasts, to compute.

use std::path::Path;

use egui::{Event, Theme, pos2};

use super::paint::{Painter, over};
use super::{Window, button};
use crate::depth::plate::Step;
use crate::frame::ColorImage;
use crate::look::Effect;
use crate::preview::panel::theme::{Colors, rung};
use crate::preview::state::{Source, Transport, sample};
use crate::preview::views::Legend;
use crate::recording::still::{read_color, write_color};

/// The picture as large as the window.
fn backdrop((width, height): (u32, u32)) -> ColorImage {
    let recorded = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/portrait/rgb/000000.png");
    let source = read_color(&recorded).unwrap();
    let mut image = ColorImage::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let from = |at: u32, of: u32, to: u32| (at * to / of) as usize;
            // As much of it as has the window's shape.
            let rows = (source.width * height / width).min(source.height);
            let row = from(y, height, rows) + (source.height - rows) as usize / 2;
            let pixel = (row * source.width as usize + from(x, width, source.width)) * 3;
            let to = (y as usize * width as usize + x as usize) * 3;
            image.rgb[to..to + 3].copy_from_slice(&source.rgb[pixel..pixel + 3]);
        }
    }
    image
}

fn save(window: &mut Window, painter: &mut Painter, name: &str) {
    let mut image = backdrop((window.size.x as u32, window.size.y as u32));
    let mut last = None;
    for _ in 0..30 {
        let (_, output) = window.pass_with_output(Vec::new());
        last = Some(painter.learn(output));
    }
    let output = last.unwrap();
    let primitives = window.ctx.tessellate(output.shapes.clone(), output.pixels_per_point);
    painter.paint(&primitives, output.pixels_per_point, &mut image);
    output.drop_without_applying_deltas();
    write_color(&std::env::temp_dir().join(format!("panel-{name}.png")), &image, true).unwrap();
}

/// A window whose textures are known from the beginning.
fn window(theme: Theme, size: (u32, u32), change: impl FnOnce(&mut crate::preview::state::State)) -> (Window, Painter) {
    let mut state = sample::state();
    change(&mut state);
    let mut window = Window {
        ctx: egui::Context::default(),
        panel: Default::default(),
        state,
        canvas: super::Canvas {
            area: crate::preview::present::Area { x: 0, y: 0, width: size.0, height: size.1 },
            size: (1280, 720),
            part: None,
        },
        size: egui::vec2(size.0 as f32, size.1 as f32),
        native: 1.0,
        time_s: 0.0,
    };
    window.ctx.set_theme(theme);
    let mut painter = Painter::default();
    for _ in 0..3 {
        let (_, output) = window.pass_with_output(Vec::new());
        painter.learn(output).drop_without_applying_deltas();
    }
    (window, painter)
}

#[test]
#[ignore = "writes pictures to look at"]
fn pictures() {
    let size = (1280, 720);
    let shot = |name: &str, theme: Theme, change: &dyn Fn(&mut crate::preview::state::State)| {
        let (mut window, mut painter) = window(theme, size, |state| change(state));
        save(&mut window, &mut painter, name);
    };
    shot("dark", Theme::Dark, &|_| {});
    shot("light", Theme::Light, &|_| {});
    shot("instruments", Theme::Dark, &|state| {
        state.instruments = true;
        state.meters.fill_for_looks();
        state.split = Some(0.4);
        state.note("Saved snapshot-0001.png");
    });
    shot("tilt", Theme::Dark, &|state| {
        state.look.effect = Effect::TiltShift;
        state.look.tilt.angle_deg = -12.0;
        state.source = sample::running(false);
    });
    shot("badges", Theme::Dark, &|state| {
        state.panel = false;
        state.frozen = true;
        state.apply(crate::preview::state::Action::Record(true));
        state.apply(crate::preview::state::Action::VirtualCamera(Some("/dev/video9".into())));
    });
    // From the offer to the portrait.
    for (name, step) in [("offer", None), ("step-out", Some(Step::StepOut(3))), ("taking", Some(Step::Taking(60)))] {
        shot(&format!("plate-{name}"), Theme::Dark, &|state| {
            (state.source, state.plate, state.panel) = (sample::running(false), step, false);
        });
    }
    shot("large", Theme::Dark, &|state| {
        state.habits.text_scale = 1.8;
        state.look.strength = crate::look::Strength::Lens(crate::preview::state::tweak::LENS);
    });
    shot("help", Theme::Dark, &|state| state.help = true);
    shot("help-light", Theme::Light, &|state| state.help = true);
    shot("lost", Theme::Light, &|state| {
        state.source = Source::Lost("the camera was unplugged (/dev/video0)".into());
    });
    for (name, theme) in [("recording", Theme::Dark), ("recording-light", Theme::Light)] {
        shot(name, theme, &|state| {
            let (length_ns, time_ns) = (61_500_000_000, 23_456_000_000);
            state.transport = Some(Transport { place: 280, frames: 738, time_ns, length_ns });
            state.legend = Some(Legend::Depth { near_m: 0.9, far_m: 5.2 });
            state.note("holiday.jpg: a photo, one frame that stands still, with the depth beside it");
        });
    }
    shot("depth", Theme::Dark, &|state| {
        state.legend = Some(Legend::Depth { near_m: 0.9, far_m: 5.2 });
        state.panel = false;
    });
    shot("coc", Theme::Light, &|state| {
        state.legend = Some(Legend::Coc { most_px: 43.0 });
        state.panel = false;
    });
    shot("bins", Theme::Dark, &|state| {
        let mut high_px = [f32::INFINITY; crate::preview::views::MOST_BINS];
        high_px[..4].copy_from_slice(&[-9.0, -2.5, 2.0, 11.5]);
        state.legend = Some(Legend::Bins { count: 5, high_px });
        state.instruments = true;
        state.meters.fill_for_looks();
    });
    let (mut window, mut painter) = window(Theme::Dark, size, |state| {
        state.look.aperture.shape =
            crate::bokeh::aperture::Shape::Polygon { blades: 6, rotation_deg: 10.0, curvature: 0.2 };
    });
    let at = pos2(1120.0, 400.0);
    window.pass(vec![Event::PointerMoved(at)]);
    for part in 1..=3 {
        for _ in 0..40 {
            let scroll = Event::MouseWheel {
                unit: egui::MouseWheelUnit::Point,
                delta: egui::vec2(0.0, -12.0),
                phase: egui::TouchPhase::Move,
                source: egui::MouseWheelSource::Unknown,
                modifiers: egui::Modifiers::NONE,
            };
            let (_, output) = window.pass_with_output(vec![scroll]);
            painter.learn(output).drop_without_applying_deltas();
        }
        save(&mut window, &mut painter, &format!("scrolled-{part}"));
    }
    for _ in 0..20 {
        for down in [true, false] {
            let (_, output) =
                window.pass_with_output(vec![super::pressed(egui::Key::Tab, egui::Modifiers::NONE, down)]);
            painter.learn(output).drop_without_applying_deltas();
        }
    }
    save(&mut window, &mut painter, "focused");
    window.pass(vec![Event::PointerMoved(pos2(300.0, 300.0))]);
    window.pass(vec![button(pos2(300.0, 300.0), true)]);
    window.pass(vec![button(pos2(300.0, 300.0), false)]);
    save(&mut window, &mut painter, "clicked");
}

/// Relative luminance (WCAG 2) of an sRGB colour, 0 to 255.
fn luminance(color: [f32; 3]) -> f32 {
    let [r, g, b] = color.map(|channel| {
        let value = channel / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn contrast(text: [f32; 3], behind: [f32; 3]) -> f32 {
    let (a, b) = (luminance(text), luminance(behind));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[test]
fn text_can_be_read_over_any_picture() {
    let solid = |color: egui::Color32| over(color, 0);
    for theme in [Theme::Dark, Theme::Light] {
        let colors = Colors::of(theme);
        for picture in [0, 60, 128, 200, 255] {
            let card = over(colors.card, picture);
            let texts =
                [("text", colors.text), ("weak", colors.weak), ("accent", colors.accent), ("alarm", colors.alarm)];
            for (name, text) in texts {
                let contrast = contrast(solid(text), card);
                assert!(contrast >= 4.5, "{theme:?} {name} over {picture}: {contrast}");
            }
            for quality in [None].into_iter().chain(crate::budget::Quality::ALL.map(Some)) {
                let contrast = contrast(solid(rung(quality, theme).0), card);
                assert!(contrast >= 4.5, "{theme:?} {quality:?} over {picture}: {contrast}");
            }
        }
        for (name, text, behind) in [
            ("text on controls", colors.text, colors.field),
            ("text on hovered ones", colors.text, colors.hover),
            ("weak text on controls", colors.weak, colors.field),
            ("text on what is chosen", colors.on_accent, colors.accent),
        ] {
            let contrast = contrast(solid(text), solid(behind));
            assert!(contrast >= 4.5, "{theme:?} {name}: {contrast}");
        }
    }
}
