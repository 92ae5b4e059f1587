//! Which bin each pixel falls in.

use super::Legend;
use super::colors::BINS;
use super::sample::Field;
use crate::bokeh::aperture::Aperture;
use crate::bokeh::plan::{MAX_BINS, Plan};
use crate::bokeh::{Rank, Settings};
use crate::budget::Quality;
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// Most bins that there can be.
pub const MOST: usize = MAX_BINS;

/// The plan that splits frames, as long as settings and size are the same.
#[derive(Default)]
pub struct Bins {
    made: Option<(Settings, (u32, u32), Plan)>,
}

impl Bins {
    /// The plan of this frame.
    pub fn of(
        &mut self,
        settings: &Settings,
        size: (u32, u32),
        level: Option<Quality>,
        depth: Option<&DepthMap>,
        coc: &CocField,
    ) -> &Plan {
        let is_current = |(planned, at, _): &(Settings, (u32, u32), Plan)| {
            let what = |settings: &Settings| (settings.coc, settings.method);
            let radii_px = |settings: &Settings| [settings.far_max_px, settings.near_max_px];
            what(planned) == what(settings) && radii_px(planned) == radii_px(settings) && *at == size
        };
        self.made = self.made.take().filter(is_current);
        let (.., plan) = self.made.get_or_insert_with(|| {
            // Borders are the same whatever the filters; these are made fastest.
            let aperture = Aperture::default();
            let light = Settings { aperture, rank: Some(Rank::Terms(1)), adaptive: true, ..settings.clone() };
            let plan = Plan::new(&light, size.0, size.1);
            (light, size, plan)
        });
        plan.set_quality(level.unwrap_or(settings.quality));
        plan.split(depth, coc);
        plan
    }
}

/// Draws the bins of a plan.
pub fn draw(field: &Field, columns: &[u32], plan: &Plan, image: &mut ColorImage) -> Legend {
    let mut high_px = [f32::INFINITY; MOST];
    let count = plan.bins.len().min(MOST);
    for (high_px, bin) in high_px.iter_mut().zip(&plan.bins) {
        *high_px = bin.high_px;
    }
    let borders = &high_px[..count.saturating_sub(1)];
    let (rows, row_bytes) = (image.height, image.width as usize * 3);
    for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
        field.row(y, rows, columns, row, |_, coc_px| BINS[borders.iter().filter(|&&border| coc_px >= border).count()]);
    }
    Legend::Bins { count, high_px }
}
