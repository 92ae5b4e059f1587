//! The bins view: colours each pixel by the depth bin in which it is blurred.

use super::Legend;
use super::coc_sampler::CocSampler;
use super::colors::BIN_COLORS;
use bokehcam::bokeh::aperture::Aperture;
use bokehcam::bokeh::plan::{MAX_BINS, Plan};
use bokehcam::bokeh::{Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocField;

/// Maximum number of bins.
pub const MAX: usize = MAX_BINS;

/// Splits frames into bins like the blur does. Caches its plan while settings and size stay the same.
#[derive(Default)]
pub struct PlanCache {
    /// The plan, with the settings and size that it was made for.
    cached: Option<(Settings, (u32, u32), Plan)>,
}

impl PlanCache {
    /// Returns a plan with the bins of this frame. Rebuilds the plan only if settings that affect the bins' bounds
    /// changed.
    pub fn plan_for_frame(
        &mut self,
        settings: &Settings,
        size: (u32, u32),
        level: Option<Quality>,
        depth: Option<&DepthMap>,
        coc: &CocField,
    ) -> &Plan {
        let is_current = |(planned, planned_size, _): &(Settings, (u32, u32), Plan)| {
            let kind = |settings: &Settings| (settings.coc, settings.method);
            let radii_px = |settings: &Settings| [settings.far_max_px, settings.near_max_px];
            kind(planned) == kind(settings) && radii_px(planned) == radii_px(settings) && *planned_size == size
        };
        self.cached = self.cached.take().filter(is_current);
        let (.., plan) = self.cached.get_or_insert_with(|| {
            // The bins do not depend on the aperture's kernels, so cheap ones suffice.
            let aperture = Aperture::default();
            let cheap = Settings { aperture, rank: Some(Rank::Terms(1)), adaptive: true, ..settings.clone() };
            let plan = Plan::new(&cheap, size.0, size.1);
            (cheap, size, plan)
        });
        plan.set_quality(level.unwrap_or(settings.quality));
        plan.split_by_depth(depth, coc);
        plan
    }
}

/// Colours each pixel by the bin of `plan` that contains its CoC. `columns` comes from [`CocSampler::new`].
pub fn draw(sampler: &CocSampler, columns: &[u32], plan: &Plan, image: &mut ColorImage) -> Legend {
    let mut high_px = [f32::INFINITY; MAX];
    let count = plan.bins.len().min(MAX);
    for (high_px, bin) in high_px.iter_mut().zip(&plan.bins) {
        *high_px = bin.high_px;
    }
    let borders = &high_px[..count.saturating_sub(1)];
    let (rows, row_bytes) = (image.height, image.width as usize * 3);
    for (y, row) in (0..).zip(image.rgb.chunks_exact_mut(row_bytes.max(1))) {
        sampler.color_row(y, rows, columns, row, |_, coc_px| {
            BIN_COLORS[borders.iter().filter(|&&border| coc_px >= border).count()]
        });
    }
    Legend::Bins { count, high_px }
}
