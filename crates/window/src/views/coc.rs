//! The view of the circle of confusion: white is sharp, darker is more blurred. Pixels in front are hatched, to differ
//! from those behind by more than colour.

use super::Legend;
use super::coc_sampler::CocSampler;
use super::colors::diverging_color;
use bokehcam::bokeh::Settings;
use bokehcam::frame::ColorImage;

/// Period of the hatching in pixels for a picture of 720 rows, and a line's fraction of it.
const HATCH_PX: f32 = 12.0;
const LINE_FRACTION: f32 = 0.25;
/// Signed CoC below which a pixel counts as in front; below 0 so that depth noise does not hatch a sharp face.
const FRONT_THRESHOLD_PX: f32 = -0.5;
/// Number of entries in the colour table.
const COLORMAP_SIZE: usize = 256;
/// Minimum radius of the darkest colour, in pixels, so that a nearly sharp picture looks sharp.
const MIN_SCALE_END_PX: f32 = 2.0;

/// Colours each pixel by its signed CoC. `columns` comes from [`CocSampler::new`].
pub fn draw(sampler: &CocSampler, columns: &[u32], settings: Option<&Settings>, image: &mut ColorImage) -> Legend {
    let max_px = settings.map_or(0.0, |settings| settings.far_max_px.max(settings.near_max_px)).max(MIN_SCALE_END_PX);
    let table: [[u8; 3]; COLORMAP_SIZE] =
        std::array::from_fn(|k| diverging_color(2.0 * k as f32 / (COLORMAP_SIZE - 1) as f32 - 1.0));
    let (scale, middle) = ((COLORMAP_SIZE - 1) as f32 / (2.0 * max_px), (COLORMAP_SIZE - 1) as f32 / 2.0);
    let period_px = ((HATCH_PX * image.height as f32 / 720.0) as u32).max(4);
    let line_px = (period_px as f32 * LINE_FRACTION).ceil() as u32;
    let (rows, row_bytes) = (image.height, image.width as usize * 3);
    for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
        sampler.color_row(y, rows, columns, row, |x, coc_px| {
            let color = table[(coc_px * scale + middle).clamp(0.0, (COLORMAP_SIZE - 1) as f32) as usize];
            let hatched = coc_px < FRONT_THRESHOLD_PX && (x + y) % period_px < line_px;
            if hatched { color.map(|channel| channel / 2) } else { color }
        });
    }
    Legend::Coc { max_px }
}
