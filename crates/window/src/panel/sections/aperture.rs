//! The shape of the aperture, chosen from thumbnails of the bokeh of a point of light.

use egui::{
    Color32, ColorImage, CornerRadius, Rect, Sense, Stroke, StrokeKind, TextureHandle, TextureOptions, Ui, Vec2,
};
use egui::{Role, WidgetInfo, pos2};

use super::Sheet;
use crate::panel::parts::{Group, Hinted, Number, number};
use crate::panel::theme::Colors;
use crate::texts::tr;
use bokehcam::bokeh::aperture::{Aperture, Shape};

/// Pixels along a side of a thumbnail's picture, which is smoothed where it is shown larger.
const CELLS: usize = 56;
/// Side of a thumbnail, in points.
const SIDE: f32 = 40.0;

const SHAPES: [&str; 6] = ["Disc", "Ring", "Blades", "Heart", "Star", "Picture"];

/// Thumbnails of apertures, each with the aperture and the rim that it was made of.
#[derive(Default)]
pub struct Thumbs {
    made: [Option<(Aperture, f32, TextureHandle)>; SHAPES.len()],
}

/// The shape, its numbers, and the highlights that show it.
pub fn show(ui: &mut Ui, sheet: &mut Sheet, thumbs: &mut Thumbs) {
    shape_row(ui, sheet, thumbs);
    let mut shape = sheet.look.aperture.shape.clone();
    let changed = match &mut shape {
        Shape::Disc | Shape::Heart | Shape::Picture(_) => false,
        Shape::Ring { inner } => number(ui, &Number::new("Hole", "Its radius", 0.0..=0.95, 2), inner),
        Shape::Polygon { blades, rotation_deg, curvature } => {
            let turn = Number::new("Rotation", "Clockwise", -180.0..=180.0, 0).unit("", "°");
            let curve = Number::new("Curvature", "Straight blades to a circle", 0.0..=1.0, 2);
            // All of them are drawn, whichever changed.
            whole(ui, "Blades", blades) | number(ui, &turn, rotation_deg) | number(ui, &curve, curvature)
        }
        Shape::Star { points } => whole(ui, "Points", points),
    };
    if changed {
        sheet.look.aperture.shape = shape;
        sheet.changed(true, "aperture");
    }
    let hint = "-1: soap bubbles; 1: bright in the middle, soft at the rim";
    let (intensity, rim, highlights) = (sheet.look.aperture.intensity, sheet.look.rim, sheet.look.highlights);
    let how = Number::new("Bubble to soft", hint, -1.0..=1.0, 2);
    sheet.number(ui, &how, intensity, |look, intensity| look.aperture.intensity = intensity);
    let how = Number::new("Soft edge", "As a share of the radius", 0.0..=1.0, 2);
    sheet.number(ui, &how, rim, |look, rim| look.rim = rim);
    let hint = "How much brighter lights are than white; 0 is off";
    let how = Number::new("Brighter lights", hint, 0.0..=50.0, 1).unit("", "×");
    sheet.number(ui, &how, highlights, |look, highlights| look.highlights = highlights);
}

/// A number of edges or points, without a fraction.
fn whole(ui: &mut Ui, label: &str, value: &mut u32) -> bool {
    let mut real = *value as f32;
    let changed = number(ui, &Number::new(label, "How many", 3.0..=16.0, 0), &mut real);
    *value = real.round() as u32;
    changed
}

/// The shapes to choose from, side by side, as thumbnails.
fn shape_row(ui: &mut Ui, sheet: &mut Sheet, thumbs: &mut Thumbs) {
    let chosen = index_of(&sheet.look.aperture.shape);
    let no_drag = !ui.input(|input| input.pointer.any_down());
    let mut shapes = Group::default();
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = Vec2::splat(4.0);
        for (index, name) in SHAPES.into_iter().enumerate() {
            let Some(shape) = shape_at(index, &sheet.look) else { continue };
            let (rect, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::click());
            let is_chosen = index == chosen;
            response.widget_info(|| WidgetInfo::selected(Role::RadioButton, true, is_chosen, tr(name)));
            let aperture = Aperture { shape, intensity: sheet.look.aperture.intensity };
            // Thumbnails take a while to make: during a drag only that of the chosen shape is made anew.
            let texture = thumbs.of(ui, index, &aperture, sheet.look.rim, no_drag || is_chosen);
            thumbnail(ui, rect, texture, is_chosen, response.hovered());
            shapes.add(response.hint(name), aperture);
        }
    });
    if let Some(aperture) = shapes.chosen(ui) {
        sheet.look.aperture = aperture;
        sheet.changed(true, "shape");
    }
}

/// Draws a thumbnail on its field, marked where it is chosen or under the pointer.
fn thumbnail(ui: &Ui, rect: Rect, texture: Option<egui::TextureId>, chosen: bool, hovered: bool) {
    let colors = Colors::here(ui);
    let painter = ui.painter();
    painter.rect_filled(rect, CornerRadius::same(8), colors.fill(false, hovered));
    let light = if chosen { colors.accent } else { colors.text };
    if let Some(texture) = texture {
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        painter.image(texture, rect.shrink(6.0), whole, light);
    }
    if chosen {
        painter.rect_stroke(rect, CornerRadius::same(8), Stroke::new(2.0, colors.accent), StrokeKind::Inside);
    }
}

/// The index of a shape's kind in [`SHAPES`].
fn index_of(shape: &Shape) -> usize {
    match shape {
        Shape::Disc => 0,
        Shape::Ring { .. } => 1,
        Shape::Polygon { .. } => 2,
        Shape::Heart => 3,
        Shape::Star { .. } => 4,
        Shape::Picture(_) => 5,
    }
}

/// The shape that is offered at an index of [`SHAPES`]: the chosen one as it is, others with default numbers. A picture
/// is offered only where the look has one.
fn shape_at(index: usize, look: &bokehcam::look::Look) -> Option<Shape> {
    if index == index_of(&look.aperture.shape) {
        return Some(look.aperture.shape.clone());
    }
    Some(match index {
        0 => Shape::Disc,
        1 => Shape::Ring { inner: 0.5 },
        2 => Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.15 },
        3 => Shape::Heart,
        4 => Shape::Star { points: 5 },
        _ => return None,
    })
}

impl Thumbs {
    /// The thumbnail of an aperture, by the index of its shape. An outdated one is made anew only with `renew`.
    fn of(&mut self, ui: &Ui, index: usize, aperture: &Aperture, rim: f32, renew: bool) -> Option<egui::TextureId> {
        let made = &mut self.made[index];
        let is_current = made.as_ref().is_some_and(|(of, made_rim, _)| of == aperture && *made_rim == rim);
        if !is_current && (renew || made.is_none()) {
            let image = picture(aperture, rim);
            match made {
                Some((of, made_rim, texture)) => {
                    texture.set(image, TextureOptions::LINEAR);
                    (*of, *made_rim) = (aperture.clone(), rim);
                }
                None => {
                    let texture = ui.ctx().load_texture(SHAPES[index], image, TextureOptions::LINEAR);
                    *made = Some((aperture.clone(), rim, texture));
                }
            }
        }
        made.as_ref().map(|(.., texture)| texture.id())
    }
}

/// A thumbnail: white, as opaque as the aperture is bright there.
fn picture(aperture: &Aperture, rim: f32) -> ColorImage {
    let mask = aperture.mask(CELLS, rim);
    let brightest = mask.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pixel = |light: &f64| {
        // About the gamma of a display, so that the opacity looks like the light.
        let opacity = ((light / brightest).powf(1.0 / 1.8) * 255.0).round() as u8;
        Color32::from_rgba_premultiplied(opacity, opacity, opacity, opacity)
    };
    ColorImage::new([CELLS, CELLS], mask.values.iter().map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_show_the_shape() {
        let light = |shape: Shape, intensity: f32, (x, y): (usize, usize)| {
            picture(&Aperture { shape, intensity }, 0.1).pixels[y * CELLS + x].a()
        };
        let middle = (CELLS / 2, CELLS / 2);
        assert_eq!((light(Shape::Disc, 0.0, middle), light(Shape::Disc, 0.0, (0, 0))), (255, 0));
        assert_eq!(light(Shape::Ring { inner: 0.5 }, 0.0, middle), 0);
        let rim = (4, CELLS / 2);
        assert!(light(Shape::Disc, -1.0, rim) > light(Shape::Disc, -1.0, middle), "a soap bubble is bright at its rim");
    }
}
