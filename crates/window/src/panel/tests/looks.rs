//! Screenshots of the window in several states, for inspection, and contrast checks.

use std::path::Path;

use egui::{Color32, Event, Key, Modifiers, Theme, pos2};

use super::{Window, button, pressed, scrolled};
use crate::panel::theme::Colors;
use crate::present::soft::Painter;
use crate::present::{Controls, Drawing, Image};
use crate::state::{Action, Source, State, Transport, sample};
use bokehcam::depth::plate::Step;
use bokehcam::frame::ColorImage;
use bokehcam::look::Effect;
use bokehcam_media::recording::still::{read_color, write_color};

/// Returns a test picture in the given size.
fn backdrop((width, height): (u32, u32)) -> ColorImage {
    let recorded = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait/rgb/000000.png"));
    let source = read_color(recorded).unwrap();
    let mut image = ColorImage::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let from = |at: u32, of: u32, to: u32| (at * to / of) as usize;
            // Crops to the window's aspect ratio.
            let rows = (source.width * height / width).min(source.height);
            let row = from(y, height, rows) + (source.height - rows) as usize / 2;
            let pixel = (row * source.width as usize + from(x, width, source.width)) * 3;
            let to = (y as usize * width as usize + x as usize) * 3;
            image.rgb[to..to + 3].copy_from_slice(&source.rgb[pixel..pixel + 3]);
        }
    }
    image
}

/// A window and its painter, fed from the first pass on because textures are incremental.
struct Seen {
    window: Window,
    painter: Painter,
}

impl Seen {
    fn new(theme: Theme, size: (u32, u32), change: impl FnOnce(&mut State)) -> Self {
        let mut state = sample::state();
        change(&mut state);
        let window = Window::unseen(state, size);
        window.ctx.set_theme(theme);
        let mut painter = Painter::new();
        painter.resize(size);
        let mut seen = Self { window, painter };
        (0..3).for_each(|_| seen.pass(Vec::new()));
        seen
    }

    fn pass(&mut self, events: Vec<Event>) {
        let (_, output) = self.window.pass_with_output(events);
        let (textures, pixels_per_point) = (output.textures_delta, output.pixels_per_point);
        let primitives = self.window.ctx.tessellate(output.shapes, pixels_per_point);
        self.painter.set_controls(Controls { primitives, textures, pixels_per_point });
    }

    fn save(&mut self, name: &str) {
        (0..30).for_each(|_| self.pass(Vec::new()));
        let whole = self.window.canvas.area;
        let room = crate::panel::picture_area_px(&self.window.ctx);
        let area = crate::present::fitted_area((1280, 720), room);
        let image = backdrop((area.width, area.height));
        let mut pixels = vec![0; (whole.width * whole.height) as usize];
        let drawing = Drawing {
            area,
            visible_region: None,
            picture: Image::Memory(&image),
            before: None,
            mirror: false,
            stale: false,
            background: [0; 3],
        };
        self.painter.paint(&mut pixels, &drawing);
        let mut image = ColorImage::new(whole.width, whole.height);
        image.rgb = pixels.iter().flat_map(|pixel| pixel.to_be_bytes().into_iter().skip(1)).collect();
        write_color(&std::env::temp_dir().join(format!("panel-{name}.png")), &image, true).unwrap();
    }
}

#[test]
#[ignore = "writes pictures to look at"]
fn pictures() {
    let size = (1280, 720);
    let shot = |name: &str, theme: Theme, change: &dyn Fn(&mut State)| Seen::new(theme, size, change).save(name);
    shot("dark", Theme::Dark, &|_| {});
    shot("light", Theme::Light, &|_| {});
    // The first screen, folded and expanded, in several window sizes and languages.
    for (language, table) in [("en", None), ("de", crate::texts::load_built_in("de"))] {
        table.into_iter().for_each(crate::texts::set_translation);
        for size in [(1280, 720), (500, 700), (480, 320)] {
            for (theme, called) in [(Theme::Dark, "dark"), (Theme::Light, "light")] {
                for more in [false, true] {
                    let mut seen = Seen::new(theme, size, |state| {
                        state.apply(Action::Section("More", more));
                        state.note("Saved ~/Pictures/bokehcam 2026-11-23 21-14-05.png");
                    });
                    let (width, height) = size;
                    seen.save(&format!("{language}-{width}x{height}-{called}{}", if more { "-more" } else { "" }));
                }
            }
        }
    }
    crate::texts::set_translation(crate::texts::Table::new());
    shot("split", Theme::Dark, &|state| {
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
        state.apply(Action::Record(true));
        state.apply(Action::VirtualCamera(Some("/dev/video9".into())));
    });
    // From the offer of depth methods to the capture.
    for (name, step) in [("offer", None), ("step-out", Some(Step::StepOut(3))), ("taking", Some(Step::Capturing(60)))] {
        shot(&format!("plate-{name}"), Theme::Dark, &|state| {
            (state.source, state.plate, state.panel) = (sample::running(false), step, false);
        });
    }
    shot("large", Theme::Dark, &|state| {
        state.preferences.text_scale = 1.8;
        state.look.strength = bokehcam::look::Strength::Lens(crate::state::tweak::DEFAULT_LENS);
    });
    shot("help", Theme::Dark, &|state| state.help = true);
    shot("help-light", Theme::Light, &|state| state.help = true);
    shot("lost", Theme::Light, &|state| {
        state.source = Source::Lost("the camera was unplugged (/dev/video0)".into());
    });
    for (name, theme) in [("recording", Theme::Dark), ("recording-light", Theme::Light)] {
        shot(name, theme, &|state| {
            let (length_ns, time_ns) = (61_500_000_000, 23_456_000_000);
            state.transport = Some(Transport { frame: 280, frames: 738, time_ns, length_ns });
            state.note("holiday.jpg: a photo, a single still frame, with its own depth");
        });
    }
    let mut seen = Seen::new(Theme::Dark, size, |state| {
        state.look.aperture.shape =
            bokehcam::bokeh::aperture::Shape::Polygon { blades: 6, rotation_deg: 10.0, curvature: 0.2 };
    });
    seen.pass(vec![Event::PointerMoved(pos2(1120.0, 400.0))]);
    for part in 1..=3 {
        (0..40).for_each(|_| seen.pass(vec![scrolled(egui::MouseWheelUnit::Point, -12.0, Modifiers::NONE)]));
        seen.save(&format!("scrolled-{part}"));
    }
    for down in [true, false].repeat(20) {
        seen.pass(vec![pressed(Key::Tab, Modifiers::NONE, down)]);
    }
    seen.save("focused");
    let at = pos2(300.0, 300.0);
    [Event::PointerMoved(at), button(at, true), button(at, false)].into_iter().for_each(|event| seen.pass(vec![event]));
    seen.save("clicked");
}

/// Returns the relative luminance (WCAG 2) of an sRGB colour, 0 to 255 per channel.
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

/// Composites a colour over a grey picture.
fn over(color: Color32, grey: u8) -> [f32; 3] {
    let [r, g, b, a] = color.to_array().map(f32::from);
    [r, g, b].map(|channel| channel + f32::from(grey) * (1.0 - a / 255.0))
}

#[test]
fn text_can_be_read_over_any_picture() {
    let solid = |color: Color32| over(color, 0);
    for theme in [Theme::Dark, Theme::Light] {
        let colors = Colors::for_theme(theme);
        for picture in [0, 60, 128, 200, 255] {
            let card = over(colors.card, picture);
            let texts =
                [("text", colors.text), ("weak", colors.weak), ("accent", colors.accent), ("alarm", colors.alarm)];
            for (name, text) in texts {
                let contrast = contrast(solid(text), card);
                assert!(contrast >= 4.5, "{theme:?} {name} over {picture}: {contrast}");
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
