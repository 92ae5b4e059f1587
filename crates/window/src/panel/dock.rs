//! Where the panel stands: beside the picture or below it, whichever leaves it larger, and never on it.

use egui::{Context, Id, Rect, Vec2, pos2, vec2};

use super::theme::{GAP, PAD, WIDTH};

/// Height of a row of the first screen, and the gap below it.
pub const CELL: f32 = 30.0;
pub const CELL_GAP: f32 = 6.0;
/// The least width of a control of the first screen, in any language.
const LEAST_CELL: f32 = 196.0;
/// The line around the panel.
pub const LINE: f32 = 1.0;
/// The controls of the first screen stand in so many cells.
pub const CELLS: usize = 7;
/// Beside the picture it is read as a list, and stays where it is when the window grows: it stands there unless the picture would
/// be smaller than this share of what it is above the panel.
const BESIDE: f32 = 0.75;

/// The panel's place, and what it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dock {
    pub panel: Rect,
    /// For the picture, and all that is drawn over it.
    pub room: Rect,
    /// The controls of the first screen that stand side by side.
    pub columns: usize,
}

impl Dock {
    /// The place in a window for a picture of `size`; `more` is whether the panel shows all there is, and scrolls.
    pub fn of(window: Rect, size: (u32, u32), more: bool) -> Self {
        let (right, bottom) = (Self::beside(window), Self::below(window, more));
        let scale = |dock: &Self| {
            let room = dock.room.size();
            (room.x / size.0.max(1) as f32).min(room.y / size.1.max(1) as f32)
        };
        let is_wide = right.panel.width() >= LEAST_CELL + 2.0 * PAD;
        if is_wide && scale(&right) >= BESIDE * scale(&bottom) { right } else { bottom }
    }

    fn beside(window: Rect) -> Self {
        let width = (WIDTH + GAP).min(window.width() / 2.0);
        let at = window.right() - width;
        let panel = Rect::from_min_max(pos2(at, window.top() + GAP), window.max - vec2(GAP, GAP));
        Self { panel, room: Rect::from_min_max(window.min, pos2(at - GAP, window.bottom())), columns: 1 }
    }

    fn below(window: Rect, more: bool) -> Self {
        let inner = window.width() - 2.0 * (GAP + PAD);
        let columns = (((inner + CELL_GAP) / (LEAST_CELL + CELL_GAP)) as usize).clamp(1, 4);
        let rows = CELLS.div_ceil(columns) as f32;
        let least = rows * (CELL + CELL_GAP) - CELL_GAP + 2.0 * (PAD + LINE) + 2.0;
        let most = window.height() * if more { 0.6 } else { 0.5 } - GAP;
        let height = if more { most } else { least.min(most) }.max(0.0);
        let top = window.bottom() - GAP - height;
        let panel = Rect::from_min_max(pos2(window.left() + GAP, top), window.max - vec2(GAP, GAP));
        Self { panel, room: Rect::from_min_max(window.min, pos2(window.right(), top - GAP)), columns }
    }
}

fn id() -> Id {
    Id::unique("room of the picture")
}

/// Takes note of what the panel leaves.
pub fn set_room(ctx: &Context, room: Rect) {
    ctx.data_mut(|data| data.insert_temp(id(), room));
}

/// What the panel leaves of the window: for the picture, and all that is drawn over it.
pub fn room(ctx: &Context) -> Rect {
    ctx.data(|data| data.get_temp(id())).unwrap_or_else(|| ctx.content_rect())
}

/// The room's size in pixels of the window.
pub fn room_px(ctx: &Context) -> (u32, u32) {
    let Vec2 { x, y } = room(ctx).size().max(Vec2::ZERO) * ctx.pixels_per_point();
    (x.round() as u32, y.round() as u32)
}
