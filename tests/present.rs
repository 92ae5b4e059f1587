//! What the window shows, painted into memory.
#![cfg(feature = "window")]
#![allow(missing_docs)]

mod common;

use bokehcam::frame::ColorImage;
use bokehcam::preview::present::soft::Painter;
use bokehcam::preview::present::{Area, Controls, Drawing, Image};
use common::{color, noise};

const BACKGROUND: [u8; 3] = [9, 8, 7];

fn drawing(picture: &ColorImage, area: Area) -> Drawing<'_> {
    Drawing { area, picture: Image::Memory(picture), before: None, mirror: false, stale: false, background: BACKGROUND }
}

fn area(x: u32, y: u32, width: u32, height: u32) -> Area {
    Area { x, y, width, height }
}

fn painter(size: (u32, u32), controls: Option<Controls>) -> Painter {
    let mut painter = Painter::new();
    painter.resize(size);
    controls.into_iter().for_each(|controls| painter.set_controls(controls));
    painter
}

fn paint(size: (u32, u32), drawing: &Drawing, controls: Option<Controls>) -> Vec<u32> {
    let mut pixels = vec![0xdead_beef; (size.0 * size.1) as usize];
    painter(size, controls).paint(&mut pixels, 0, drawing);
    pixels
}

fn word([r, g, b]: [u8; 3]) -> u32 {
    u32::from_be_bytes([0, r, g, b])
}

fn at(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
    image.rgb.as_chunks().0[(y * image.width + x) as usize]
}

/// Controls of every kind, text first.
fn controls(context: &egui::Context, size: (u32, u32), pixels_per_point: f32) -> Controls {
    let points = egui::vec2(size.0 as f32, size.1 as f32) / pixels_per_point;
    let mut input = egui::RawInput {
        screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, points)),
        ..egui::RawInput::default()
    };
    input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(pixels_per_point);
    let mut value = 0.4;
    let output = context.run_ui(input, |ui| {
        egui::Window::new("Look").default_width(280.0).show(ui.ctx(), |ui| {
            ui.heading("Aperture");
            for line in 0..12 {
                ui.add(egui::Slider::new(&mut value, 0.0..=1.0).text("f-number"));
                ui.horizontal(|ui| {
                    ui.label("The quick brown fox jumps over");
                    let _ = ui.button(format!("Button {line}"));
                });
                ui.checkbox(&mut (line % 2 == 0), "mirror");
            }
        });
    });
    Controls {
        primitives: context.tessellate(output.shapes, output.pixels_per_point),
        textures: output.textures_delta,
        pixels_per_point: output.pixels_per_point,
    }
}

#[test]
#[ignore = "prints times"]
fn times() {
    let size = (1280, 720);
    let (picture, context) = (noise(1280, 720), egui::Context::default());
    let _ = controls(&context, size, 1.0);
    let mut painter = painter(size, None);
    let mut pixels = vec![0; 1280 * 720];
    let mut time = |what: &str, painter: &mut Painter, drawing: &Drawing| {
        let mut all: Vec<f64> = (0..60)
            .map(|n| {
                let began = std::time::Instant::now();
                painter.paint(&mut pixels, (n > 3).into(), drawing);
                began.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        all.sort_by(f64::total_cmp);
        eprintln!("{what}: {:.2} ms, worst {:.2} ms", all[30], all[59]);
    };
    let context = egui::Context::default();
    let whole = area(0, 0, 1280, 720);
    time("1:1", &mut painter, &drawing(&picture, whole));
    painter.set_controls(controls(&context, size, 1.0));
    let began = std::time::Instant::now();
    painter.set_controls(controls(&context, size, 1.0));
    eprintln!("controls: {:?}", began.elapsed());
    time("1:1 and controls", &mut painter, &drawing(&picture, whole));
    time("mirrored", &mut painter, &Drawing { mirror: true, ..drawing(&picture, whole) });
    time("stale", &mut painter, &Drawing { stale: true, ..drawing(&picture, whole) });
    let small = noise(640, 360);
    time("enlarged", &mut painter, &drawing(&small, whole));
    let large = noise(1920, 1080);
    time("shrunk", &mut painter, &drawing(&large, whole));
    let _ = (word([0; 3]), at(&small, 0, 0), color(1, 1, |_, _| [0; 3]), paint((1, 1), &drawing(&small, whole), None));
}
