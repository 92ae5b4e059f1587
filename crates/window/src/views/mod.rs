//! Diagnostic views of the blur: depth, circle of confusion and bins, in false colours with a legend.

mod bins;
mod coc;
mod coc_sampler;
mod colors;
mod depth;
mod probe;
#[cfg(test)]
mod tests;

pub use bins::MAX as MAX_BINS;
pub use colors::{BIN_COLORS, diverging_color, viridis};
pub use depth::depth_fraction;
pub use probe::Probe;

use bokehcam::bokeh::Settings;
use bokehcam::frame::ColorImage;
use bokehcam::names::named;
use bokehcam::pipeline::View;

named! {
    /// What of a frame is shown.
    pub enum ViewMode default Picture {
        /// The picture
        Picture = "picture",
        /// Its depth, in colours
        Depth = "depth",
        /// Its circle of confusion
        Coc = "coc",
        /// The bins that it is split into
        Bins = "bins",
    }
}

/// Meaning of a view's colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Legend {
    /// Depth: [`viridis`] colours, linear in dioptres, light is near.
    Depth {
        /// Distance of the lightest colour, in metres; nearer depths have the same colour.
        near_m: f32,
        /// Distance of the darkest colour, in metres.
        far_m: f32,
    },
    /// Circle of confusion: [`diverging_color`] colours, hatched in front.
    Coc {
        /// Radius of the darkest colours, in front and behind, in pixels.
        max_px: f32,
    },
    /// Bins, front to back, in [`BIN_COLORS`].
    Bins {
        /// Number of bins.
        count: usize,
        /// Signed CoC at which each bin ends, in pixels; infinite for the last.
        high_px: [f32; MAX_BINS],
    },
}

/// Draws views. Keeps their buffers, and the depth view's colour range, which is smoothed over time.
#[derive(Default)]
pub struct Views {
    image: ColorImage,
    legend: Option<Legend>,
    depth_range: depth::ColorRange,
    /// The depth map's column for each column of the picture.
    columns: Vec<u32>,
    plans: bins::PlanCache,
}

impl Views {
    /// Draws the view `shown` of a frame, in its picture's size; `None` for the picture itself or if the frame lacks
    /// the data. `settings` are those of the frame's blur. Allocates only if the size or the bins change.
    pub fn draw(&mut self, shown: ViewMode, view: &View, settings: Option<&Settings>) -> Option<&ColorImage> {
        self.legend = None;
        let size = view.picture.size();
        let depth = view.depth.as_deref();
        let sampler = coc_sampler::CocSampler::new(&view.coc, depth, size, &mut self.columns);
        let (image, columns) = (&mut self.image, &self.columns[..]);
        image.resize(size.0, size.1);
        self.legend = match shown {
            ViewMode::Picture => None,
            ViewMode::Depth => depth.map(|depth| depth::draw(depth, columns, &mut self.depth_range, image)),
            ViewMode::Coc => sampler.map(|sampler| coc::draw(&sampler, columns, settings, image)),
            ViewMode::Bins => {
                let level = view.trace.quality;
                let plan = settings.map(|settings| self.plans.plan_for_frame(settings, size, level, depth, &view.coc));
                sampler.zip(plan).map(|(sampler, plan)| bins::draw(&sampler, columns, plan, image))
            }
        };
        self.legend.map(|_| &self.image)
    }

    /// Returns the view drawn last.
    pub fn image(&self) -> &ColorImage {
        &self.image
    }

    /// Returns the legend of the view drawn last.
    pub fn legend(&self) -> Option<Legend> {
        self.legend
    }
}
