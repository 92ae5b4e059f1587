//! The circle of confusion in colours: white is sharp, darker is more blurred; what lies in front is hatched, so that
//! it is told from what lies behind without colour, too.

use super::Legend;
use super::colors::diverging;
use super::sample::Field;
use crate::bokeh::Settings;
use crate::frame::ColorImage;

/// Lines of the hatching are so far apart, and so wide, in pixels of a picture with 720 rows.
const HATCH_PX: f32 = 12.0;
const LINE_SHARE: f32 = 0.25;
/// Less is not in front: a face is not hatched for the roughness of its depth.
const FRONT_FROM_PX: f32 = -0.5;
/// Steps of the table from one end of the colours to the other.
const STEPS: usize = 256;
/// Colours are for at least this radius, in pixels: a sharp picture shall look sharp.
const LEAST_PX: f32 = 2.0;

/// Draws the CoC of a field.
pub fn draw(field: &Field, columns: &[u32], settings: Option<&Settings>, image: &mut ColorImage) -> Legend {
    let most_px = settings.map_or(0.0, |settings| settings.far_max_px.max(settings.near_max_px)).max(LEAST_PX);
    let table: [[u8; 3]; STEPS] = std::array::from_fn(|k| diverging(2.0 * k as f32 / (STEPS - 1) as f32 - 1.0));
    let (scale, middle) = ((STEPS - 1) as f32 / (2.0 * most_px), (STEPS - 1) as f32 / 2.0);
    let period_px = ((HATCH_PX * image.height as f32 / 720.0) as u32).max(4);
    let line_px = (period_px as f32 * LINE_SHARE).ceil() as u32;
    let (rows, row_bytes) = (image.height, image.width as usize * 3);
    for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
        field.row(y, rows, columns, row, |x, coc_px| {
            let color = table[(coc_px * scale + middle).clamp(0.0, (STEPS - 1) as f32) as usize];
            let hatched = coc_px < FRONT_FROM_PX && (x + y) % period_px < line_px;
            if hatched { color.map(|channel| channel / 2) } else { color }
        });
    }
    Legend::Coc { most_px }
}
