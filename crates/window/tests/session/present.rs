//! The window's content, painted into memory.
#![allow(missing_docs)]

use crate::common;
mod gpu;

use bokehcam::frame::ColorImage;
use bokehcam_window::panel;
use bokehcam_window::present::soft::Painter;
use bokehcam_window::present::{Area, Controls, Drawing, Image, zoomed_area};
use common::{color, noise};

const BACKGROUND: [u8; 3] = [9, 8, 7];

fn drawing(picture: &ColorImage, area: Area) -> Drawing<'_> {
    Drawing {
        area,
        picture: Image::Memory(picture),
        visible_region: None,
        before: None,
        mirror: false,
        stale: false,
        background: BACKGROUND,
    }
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
    painter(size, controls).paint(&mut pixels, drawing);
    pixels
}

fn word([r, g, b]: [u8; 3]) -> u32 {
    u32::from_be_bytes([0, r, g, b])
}

fn at(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
    image.rgb.as_chunks().0[(y * image.width + x) as usize]
}

/// Creates an egui context with the window's fonts.
fn context() -> egui::Context {
    let context = egui::Context::default();
    panel::install_theme(&context);
    context
}

/// Lays out controls of every kind, text first.
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

/// Description, picture size, window size, and the picture's area.
type Layout = (&'static str, (u32, u32), (u32, u32), Area);

fn layouts() -> [Layout; 7] {
    [
        ("as it is", (64, 48), (64, 48), area(0, 0, 64, 48)),
        ("with bars", (64, 48), (97, 60), area(16, 5, 64, 48)),
        ("enlarged", (64, 48), (200, 130), area(13, 0, 173, 130)),
        ("enlarged by little", (64, 48), (70, 52), area(0, 0, 69, 52)),
        ("shrunk by little", (64, 48), (60, 45), area(0, 0, 60, 45)),
        ("shrunk", (64, 48), (30, 25), area(1, 2, 27, 20)),
        ("shrunk by much", (331, 247), (32, 20), area(3, 0, 26, 20)),
    ]
}

/// Returns every way to show two pictures.
fn manners<'a>(picture: &'a ColorImage, before: &'a ColorImage, place: Area) -> Vec<(String, Drawing<'a>)> {
    let mut all = Vec::new();
    for (mirror, stale) in [(false, false), (true, false), (false, true)] {
        for split in [None, Some(0.0), Some(0.37), Some(1.0)] {
            let before = split.map(|split| (before, split));
            all.push((
                format!("mirror {mirror}, stale {stale}, split {split:?}"),
                Drawing { before, mirror, stale, ..drawing(picture, place) },
            ));
        }
    }
    all
}

#[test]
fn a_picture_of_the_windows_size_is_copied() {
    let picture = noise(61, 47);
    let pixels = paint((61, 47), &drawing(&picture, area(0, 0, 61, 47)), None);
    let expected: Vec<u32> = picture.rgb.as_chunks().0.iter().copied().map(word).collect();
    assert_eq!(pixels, expected);
}

#[test]
fn the_background_is_around_the_picture() {
    let picture = color(8, 6, |_, _| [200, 100, 50]);
    for (size, place) in [((20, 10), area(6, 2, 8, 6)), ((20, 10), area(3, 0, 16, 10)), ((20, 10), area(0, 4, 20, 3))] {
        let pixels = paint(size, &drawing(&picture, place), None);
        for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
            let inside =
                (place.x..place.x + place.width).contains(&x) && (place.y..place.y + place.height).contains(&y);
            let expected = word(if inside { [200, 100, 50] } else { BACKGROUND });
            assert_eq!(pixels[(y * size.0 + x) as usize], expected, "{place:?} at {x}, {y}");
        }
    }
}

#[test]
fn a_mirror_flips_the_picture_and_not_the_split() {
    let (picture, before) = (noise(40, 30), color(40, 30, |x, _| [x as u8, 0, 255]));
    let whole = area(0, 0, 40, 30);
    let shown = Drawing { mirror: true, before: Some((&before, 0.25)), ..drawing(&picture, whole) };
    let pixels = paint((40, 30), &shown, None);
    for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
        let expected = match x {
            0..8 => at(&before, 39 - x, y),
            8 | 11 => [24; 3],
            9..11 => [255; 3],
            _ => at(&picture, 39 - x, y),
        };
        // The divider: two bright columns between two dark ones.
        let expected = if x == 8 || x == 11 { [24; 3] } else { expected };
        assert_eq!(pixels[(y * 40 + x) as usize], word(expected), "{x}, {y}");
    }
}

#[test]
fn scaling_mirrored_is_mirroring_scaled() {
    let picture = noise(64, 48);
    for place in [area(0, 0, 101, 75), area(0, 0, 40, 30)] {
        let size = (place.width, place.height);
        let straight = paint(size, &drawing(&picture, place), None);
        let mut flipped = paint(size, &Drawing { mirror: true, ..drawing(&picture, place) }, None);
        flipped.chunks_exact_mut(size.0 as usize).for_each(<[u32]>::reverse);
        assert_eq!(straight, flipped);
    }
}

#[test]
fn a_stale_picture_is_grey_and_darker() {
    let picture = color(3, 1, |x, _| [[255, 255, 255], [0, 0, 0], [10, 200, 30]][x as usize]);
    let pixels = paint((3, 1), &Drawing { stale: true, ..drawing(&picture, area(0, 0, 3, 1)) }, None);
    assert_eq!(pixels, [word([153; 3]), 0, word([74; 3])]);
}

#[test]
fn what_does_not_fit_is_cut_and_what_is_nothing_shows_nothing() {
    let picture = noise(64, 48);
    let beyond = paint((40, 30), &drawing(&picture, area(10, 10, 64, 48)), None);
    assert_eq!(beyond[10 * 40 + 10], word(at(&picture, 0, 0)));
    assert_eq!(beyond[29 * 40 + 39], word(at(&picture, 29, 19)));
    let empty = ColorImage::default();
    for (picture, place) in [(&empty, area(0, 0, 4, 3)), (&picture, area(0, 0, 0, 0)), (&picture, area(0, 0, 4, 0))] {
        assert_eq!(paint((4, 3), &drawing(picture, place), None), [word(BACKGROUND); 12]);
    }
}

#[test]
fn text_and_controls_are_painted_over_the_picture() {
    let (size, context) = ((480, 480), context());
    let picture = color(480, 480, |_, _| [90, 140, 60]);
    let shown = drawing(&picture, area(0, 0, 480, 480));
    // An egui window grows to its content during the first frames.
    let mut painter = painter(size, Some(controls(&context, size, 1.0)));
    painter.set_controls(controls(&context, size, 1.0));
    let mut pixels = vec![0; 480 * 480];
    painter.paint(&mut pixels, &shown);
    let plain = word([90, 140, 60]);
    let changed = pixels.iter().filter(|&&pixel| pixel != plain).count();
    assert!(changed > 480 * 480 / 10, "{changed}");
    assert_eq!(pixels[480 * 480 - 1], plain, "the corner is free");
    let kinds: std::collections::HashSet<u32> = pixels.iter().copied().collect();
    assert!(kinds.len() > 40, "text has smooth edges: {} colours", kinds.len());
    // Without controls, the picture is fully visible again.
    painter.set_controls(Controls {
        primitives: Vec::new(),
        textures: egui::TexturesDelta::default(),
        pixels_per_point: 1.0,
    });
    painter.paint(&mut pixels, &shown);
    assert!(pixels.iter().all(|&pixel| pixel == plain));
}

/// Returns a picture zoomed around several points, in smaller and larger windows, in every way.
fn enlargements<'a>(picture: &'a ColorImage, before: &'a ColorImage) -> Vec<(String, (u32, u32), Drawing<'a>)> {
    let mut all = Vec::new();
    for window in [(40, 30), (97, 60)] {
        for (factor, center) in [(1, [0.5, 0.5]), (1, [0.9, 0.1]), (2, [0.3, 0.6]), (4, [1.0, 1.0]), (8, [0.37, 0.71])]
        {
            let (place, part) = zoomed_area(picture.size(), window, factor, center);
            for (manner, drawing) in manners(picture, before, place) {
                let what = format!("{window:?} at {factor} around {center:?}, {manner}");
                all.push((what, window, Drawing { visible_region: Some(part), ..drawing }));
            }
        }
    }
    all
}

#[test]
fn an_enlarged_picture_shows_its_pixels_as_they_are() {
    let (picture, before) = (noise(64, 48), noise(64, 48));
    for (what, window, shown) in enlargements(&picture, &before).into_iter().filter(|(.., shown)| !shown.stale) {
        let pixels = paint(window, &shown, None);
        let (place, part) = (shown.area, shown.visible_region.unwrap());
        let whole = 64 * part.factor;
        let divider = shown.before.map(|(_, at)| (at * whole as f32).round() as i64 - i64::from(part.origin.0));
        for y in 0..window.1 {
            for x in 0..window.0 {
                let there = (x >= place.x && y >= place.y).then(|| (x - place.x, y - place.y));
                let inside = there.filter(|(x, y)| *x < place.width && *y < place.height);
                let expected = inside.map_or(BACKGROUND, |(x, y)| {
                    let seen = x + part.origin.0;
                    let column = if shown.mirror { whole - 1 - seen } else { seen };
                    let is_before = divider.is_some_and(|at| i64::from(x) < at);
                    let source = if is_before { &before } else { &picture };
                    at(source, column / part.factor, (y + part.origin.1) / part.factor)
                });
                let near_divider =
                    inside.zip(divider).is_some_and(|((x, _), at)| (at - 2..at + 2).contains(&i64::from(x)));
                assert!(near_divider || pixels[(y * window.0 + x) as usize] == word(expected), "{what}: {x}, {y}");
            }
        }
    }
}
