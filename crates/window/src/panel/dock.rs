//! Layout of the panel: beside or below the picture, whichever leaves the picture larger; it never overlaps the
//! picture.

use egui::{Context, Id, Rect, Vec2, pos2, vec2};

use super::theme::{GAP, PAD, WIDTH};

/// Height of a row of the first screen, and the gap below it, in points.
pub const CELL: f32 = 30.0;
pub const CELL_GAP: f32 = 6.0;
/// Minimum width of a control of the first screen that fits the labels of every language, in points.
const MIN_CELL_WIDTH: f32 = 196.0;
/// Width of the panel's border, in points.
pub const LINE: f32 = 1.0;
/// Number of cells that the controls of the first screen occupy.
pub const CELLS: usize = 7;
/// Minimum ratio of the picture's scale beside the panel to its scale above it for the panel to stand beside it. The
/// side is preferred because the panel reads as a list there and keeps its position when the window grows.
const MIN_SCALE_RATIO: f32 = 0.75;

/// Areas of the panel and the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dock {
    pub panel: Rect,
    /// Area for the picture and its overlays.
    pub picture_area: Rect,
    /// Number of columns of the first screen's controls.
    pub columns: usize,
}

impl Dock {
    /// Computes the layout in a window for a picture of `size`. `expanded` is whether the panel is expanded, and
    /// scrolls.
    pub fn new(window: Rect, size: (u32, u32), expanded: bool) -> Self {
        let (right, bottom) = (Self::dock_right(window), Self::dock_bottom(window, expanded));
        let scale = |dock: &Self| {
            let area = dock.picture_area.size();
            (area.x / size.0.max(1) as f32).min(area.y / size.1.max(1) as f32)
        };
        let is_wide = right.panel.width() >= MIN_CELL_WIDTH + 2.0 * PAD;
        if is_wide && scale(&right) >= MIN_SCALE_RATIO * scale(&bottom) { right } else { bottom }
    }

    fn dock_right(window: Rect) -> Self {
        let width = (WIDTH + GAP).min(window.width() / 2.0);
        let at = window.right() - width;
        let panel = Rect::from_min_max(pos2(at, window.top() + GAP), window.max - vec2(GAP, GAP));
        Self { panel, picture_area: Rect::from_min_max(window.min, pos2(at - GAP, window.bottom())), columns: 1 }
    }

    fn dock_bottom(window: Rect, expanded: bool) -> Self {
        let inner = window.width() - 2.0 * (GAP + PAD);
        let columns = (((inner + CELL_GAP) / (MIN_CELL_WIDTH + CELL_GAP)) as usize).clamp(1, 4);
        let rows = CELLS.div_ceil(columns) as f32;
        let min_height = rows * (CELL + CELL_GAP) - CELL_GAP + 2.0 * (PAD + LINE) + 2.0;
        let max_height = window.height() * if expanded { 0.6 } else { 0.5 } - GAP;
        let height = if expanded { max_height } else { min_height.min(max_height) }.max(0.0);
        let top = window.bottom() - GAP - height;
        let panel = Rect::from_min_max(pos2(window.left() + GAP, top), window.max - vec2(GAP, GAP));
        Self { panel, picture_area: Rect::from_min_max(window.min, pos2(window.right(), top - GAP)), columns }
    }
}

fn picture_area_id() -> Id {
    Id::unique("room of the picture")
}

/// Stores the area that the panel leaves free.
pub fn set_picture_area(ctx: &Context, area: Rect) {
    ctx.data_mut(|data| data.insert_temp(picture_area_id(), area));
}

/// Returns the area that the panel leaves free, for the picture and its overlays.
pub fn picture_area(ctx: &Context) -> Rect {
    ctx.data(|data| data.get_temp(picture_area_id())).unwrap_or_else(|| ctx.content_rect())
}

/// Returns the size of the free area in pixels of the window.
pub fn picture_area_px(ctx: &Context) -> (u32, u32) {
    let Vec2 { x, y } = picture_area(ctx).size().max(Vec2::ZERO) * ctx.pixels_per_point();
    (x.round() as u32, y.round() as u32)
}
