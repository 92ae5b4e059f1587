//! The aperture's shape, selected from thumbnails of its bokeh for a point light.

use egui::{
    Color32, ColorImage, CornerRadius, Rect, Sense, Stroke, StrokeKind, TextureHandle, TextureOptions, Ui, Vec2,
};
use egui::{Role, WidgetInfo, pos2};

use super::PanelForm;
use crate::panel::theme::Colors;
use crate::panel::widgets::{Number, RadioGroup, Tooltip, add_number};
use crate::texts::tr;
use bokehcam::bokeh::aperture::{Aperture, Shape};

/// Side of a thumbnail's texture in pixels; filtered when displayed larger.
const TEXTURE_SIDE_PX: usize = 56;
/// Side of a displayed thumbnail, in points.
const SIDE: f32 = 40.0;

const SHAPES: [&str; 6] = ["Disc", "Ring", "Blades", "Heart", "Star", "Picture"];

/// Cached thumbnail textures, each with the aperture and the rim it was rendered for.
#[derive(Default)]
pub struct Thumbnails {
    cached: [Option<(Aperture, f32, TextureHandle)>; SHAPES.len()],
}

/// Adds the shape, its parameters, and the highlights that reveal it.
pub fn show(ui: &mut Ui, form: &mut PanelForm, thumbnails: &mut Thumbnails) {
    shape_row(ui, form, thumbnails);
    let mut shape = form.look.aperture.shape.clone();
    let changed = match &mut shape {
        Shape::Disc | Shape::Heart | Shape::Picture(_) => false,
        Shape::Ring { inner } => add_number(ui, &Number::new("Hole", "Its radius", 0.0..=0.95, 2), inner),
        Shape::Polygon { blades, rotation_deg, curvature } => {
            let turn = Number::new("Rotation", "Clockwise", -180.0..=180.0, 0).with_affixes("", "°");
            let curve = Number::new("Curvature", "From straight blades to a circle", 0.0..=1.0, 2);
            // `|` instead of `||`, so that every number is drawn.
            add_integer(ui, "Blades", blades) | add_number(ui, &turn, rotation_deg) | add_number(ui, &curve, curvature)
        }
        Shape::Star { points } => add_integer(ui, "Points", points),
    };
    if changed {
        form.look.aperture.shape = shape;
        form.stroke = Some("aperture");
    }
    let hint = "-1: soap bubbles; 1: bright in the middle, soft at the rim";
    let (intensity, rim, highlights) = (form.look.aperture.intensity, form.look.rim, form.look.highlights);
    let how = Number::new("Bubble to soft", hint, -1.0..=1.0, 2);
    form.add_number(ui, &how, intensity, |look, intensity| look.aperture.intensity = intensity);
    let how = Number::new("Soft edge", "As a share of the radius", 0.0..=1.0, 2);
    form.add_number(ui, &how, rim, |look, rim| look.rim = rim);
    let hint = "Brightness of lights, as a multiple of white; 0 is off";
    let how = Number::new("Brighter lights", hint, 0.0..=50.0, 1).with_affixes("", "×");
    form.add_number(ui, &how, highlights, |look, highlights| look.highlights = highlights);
}

/// Adds an integer number of blades or points. Returns whether it changed.
fn add_integer(ui: &mut Ui, label: &str, value: &mut u32) -> bool {
    let mut real = *value as f32;
    let changed = add_number(ui, &Number::new(label, "How many", 3.0..=16.0, 0), &mut real);
    *value = real.round() as u32;
    changed
}

/// Adds the row of shape thumbnails.
fn shape_row(ui: &mut Ui, form: &mut PanelForm, thumbnails: &mut Thumbnails) {
    let chosen = index_of(&form.look.aperture.shape);
    let no_drag = !ui.input(|input| input.pointer.any_down());
    let mut shapes = RadioGroup::default();
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = Vec2::splat(4.0);
        for (index, name) in SHAPES.into_iter().enumerate() {
            let Some(shape) = shape_at(index, &form.look) else { continue };
            let (rect, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::click());
            let is_chosen = index == chosen;
            response.widget_info(|| WidgetInfo::selected(Role::RadioButton, true, is_chosen, tr(name)));
            let aperture = Aperture { shape, intensity: form.look.aperture.intensity };
            // Rendering thumbnails is slow: during a drag, only the selected shape's is updated.
            let texture = thumbnails.get_or_render(ui, index, &aperture, form.look.rim, no_drag || is_chosen);
            draw_thumbnail(ui, rect, texture, is_chosen, response.hovered());
            shapes.add(response.tooltip(name), aperture);
        }
    });
    if let Some(aperture) = shapes.selection(ui) {
        form.look.aperture = aperture;
        form.stroke = Some("shape");
    }
}

/// Draws a thumbnail, highlighted while it is selected or hovered.
fn draw_thumbnail(ui: &Ui, rect: Rect, texture: Option<egui::TextureId>, chosen: bool, hovered: bool) {
    let colors = Colors::for_ui(ui);
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

/// Returns the index of a shape's kind in [`SHAPES`].
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

/// Returns the shape offered at an index of [`SHAPES`]: the current one unchanged, others with default parameters. A
/// picture is offered only if the look has one.
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

impl Thumbnails {
    /// Returns the thumbnail for the shape at `index`. An outdated one is re-rendered only if `renew` is set.
    fn get_or_render(
        &mut self,
        ui: &Ui,
        index: usize,
        aperture: &Aperture,
        rim: f32,
        renew: bool,
    ) -> Option<egui::TextureId> {
        let cached = &mut self.cached[index];
        let is_current = cached.as_ref().is_some_and(|(of, cached_rim, _)| of == aperture && *cached_rim == rim);
        if !is_current && (renew || cached.is_none()) {
            let image = render_thumbnail(aperture, rim);
            match cached {
                Some((of, cached_rim, texture)) => {
                    texture.set(image, TextureOptions::LINEAR);
                    (*of, *cached_rim) = (aperture.clone(), rim);
                }
                None => {
                    let texture = ui.ctx().load_texture(SHAPES[index], image, TextureOptions::LINEAR);
                    *cached = Some((aperture.clone(), rim, texture));
                }
            }
        }
        cached.as_ref().map(|(.., texture)| texture.id())
    }
}

/// Renders a thumbnail: white, with the aperture's brightness as opacity.
fn render_thumbnail(aperture: &Aperture, rim: f32) -> ColorImage {
    let mask = aperture.to_mask(TEXTURE_SIDE_PX, rim);
    let brightest = mask.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pixel = |light: &f64| {
        // Approximates a display's gamma, so that the opacity looks like the light.
        let opacity = ((light / brightest).powf(1.0 / 1.8) * 255.0).round() as u8;
        Color32::from_rgba_premultiplied(opacity, opacity, opacity, opacity)
    };
    ColorImage::new([TEXTURE_SIDE_PX, TEXTURE_SIDE_PX], mask.values.iter().map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_show_the_shape() {
        let light = |shape: Shape, intensity: f32, (x, y): (usize, usize)| {
            render_thumbnail(&Aperture { shape, intensity }, 0.1).pixels[y * TEXTURE_SIDE_PX + x].a()
        };
        let middle = (TEXTURE_SIDE_PX / 2, TEXTURE_SIDE_PX / 2);
        assert_eq!((light(Shape::Disc, 0.0, middle), light(Shape::Disc, 0.0, (0, 0))), (255, 0));
        assert_eq!(light(Shape::Ring { inner: 0.5 }, 0.0, middle), 0);
        let rim = (4, TEXTURE_SIDE_PX / 2);
        assert!(light(Shape::Disc, -1.0, rim) > light(Shape::Disc, -1.0, middle), "a soap bubble is bright at its rim");
    }
}
