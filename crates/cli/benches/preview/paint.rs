//! Time to paint a frame on the CPU: unscaled, scaled, and with the panel over it.

use std::time::Instant;

use bokehcam::frame::ColorImage;
use bokehcam::look::Look;
use bokehcam_window::egui::{self, Event, Pos2, RawInput, Rect, pos2, vec2};
use bokehcam_window::panel::{Canvas, Panel};
use bokehcam_window::present::soft::Painter;
use bokehcam_window::present::{Area, Controls, Drawing, Image};
use bokehcam_window::state::State;

const SIZE: (u32, u32) = (1280, 720);
const FRAMES: usize = 60;

/// Prints the median and the minimum, which is the least affected by other programs.
pub fn measure() {
    let [same, small, large] = [SIZE, (640, 360), (1920, 1080)].map(|(width, height)| {
        let mut picture = ColorImage::new(width, height);
        (0_u32..).zip(&mut picture.rgb).for_each(|(k, byte)| *byte = (k.wrapping_mul(2_654_435_761) >> 24) as u8);
        picture
    });
    let area = Area { x: 0, y: 0, width: SIZE.0, height: SIZE.1 };
    let shown = |picture| {
        let (picture, background) = (Image::Memory(picture), [0; 3]);
        Drawing { area, picture, visible_region: None, before: None, mirror: false, stale: false, background }
    };
    let cases: [(&str, Drawing); 5] = [
        ("pixel for pixel", shown(&same)),
        ("mirrored", Drawing { mirror: true, ..shown(&same) }),
        ("grey, because it is old", Drawing { stale: true, ..shown(&same) }),
        ("enlarged from 640x360", shown(&small)),
        ("shrunk from 1920x1080", shown(&large)),
    ];
    let mut painter = Painter::new();
    painter.resize(SIZE);
    let mut pixels = vec![0; SIZE.0 as usize * SIZE.1 as usize];
    let mut time =
        |name: &str, painter: &mut Painter, drawing: &Drawing, prepare: &mut dyn FnMut(usize, &mut Painter)| {
            let mut paint = |frame| {
                prepare(frame, painter);
                let began = Instant::now();
                painter.paint(&mut pixels, drawing);
                began.elapsed().as_secs_f64() * 1e3
            };
            let mut took_ms: Vec<f64> = (0..FRAMES).map(&mut paint).collect();
            took_ms.sort_by(f64::total_cmp);
            println!("{name}: median {:.2} ms, best {:.2} ms", took_ms[FRAMES / 2], took_ms[0]);
        };
    for (name, drawing) in &cases {
        time(name, &mut painter, drawing, &mut |_, _| {});
    }
    // The pointer moves to and fro over the panel, so that every pass changes something.
    let mut passes = Passes::default();
    for frame in 0..WARM_UP {
        painter.set_controls(passes.next(frame, area));
    }
    time("with the panel", &mut painter, &cases[0].1, &mut |_, _| {});
    time("with the panel, painted anew", &mut painter, &cases[0].1, &mut |frame, painter| {
        painter.set_controls(passes.next(frame, area));
    });
}

/// Number of passes until fonts, layout and animations are stable.
const WARM_UP: usize = 30;

/// The panel of a window, laid out once per pass.
struct Passes {
    context: egui::Context,
    panel: Panel,
    state: State,
    time_s: f64,
}

impl Default for Passes {
    fn default() -> Self {
        let state = State::new(Look::default(), "demo".into());
        Self { context: egui::Context::default(), panel: Panel::default(), state, time_s: 0.0 }
    }
}

impl Passes {
    fn next(&mut self, frame: usize, area: Area) -> Controls {
        self.time_s += 0.02;
        let mut input = RawInput {
            time: Some(self.time_s),
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(SIZE.0 as f32, SIZE.1 as f32))),
            events: vec![Event::PointerMoved(pos2(1150.0, [200.0, 430.0][frame % 2]))],
            ..RawInput::default()
        };
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(1.0);
        let (panel, state, canvas) = (&mut self.panel, &self.state, Canvas { area, size: SIZE, ..Canvas::default() });
        let output = self.context.run_ui(input, |ui| panel.show(ui, state, canvas, &mut Vec::new()));
        let primitives = self.context.tessellate(output.shapes, 1.0);
        Controls { primitives, textures: output.textures_delta, pixels_per_point: 1.0 }
    }
}
