//! The effect of the rank on an aperture's shape (after McGraw's figures 3 to 5).

mod analysis;
mod plot;
mod sheet;

pub use analysis::{Analysis, Approximation, RankErrors};
pub use plot::plot_error_by_rank;
pub use sheet::draw_sheet;
