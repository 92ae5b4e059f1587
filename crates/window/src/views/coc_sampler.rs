//! Evaluates the circle of confusion at each pixel of the picture.

use bokehcam::frame::DepthMap;
use bokehcam::optics::{CocField, DepthCoc, Ramp};

/// Source of each pixel's CoC.
pub enum CocSampler<'a> {
    /// The same radius everywhere, in pixels.
    Uniform(f32),
    Ramp(Ramp),
    /// From depth; the map may be smaller than the picture.
    Depth(&'a DepthMap, DepthCoc),
}

impl<'a> CocSampler<'a> {
    /// Creates the sampler of a picture of `size` pixels. Fills `columns` with the depth map's column for each of the
    /// picture's. `None` if the CoC needs depth and has no map.
    pub fn new(coc: &CocField, depth: Option<&'a DepthMap>, size: (u32, u32), columns: &mut Vec<u32>) -> Option<Self> {
        let map_columns = depth.map_or(size.0, |depth| depth.width);
        columns.clear();
        columns.extend((0..size.0).map(|x| scale_index(x, size.0, map_columns)));
        match *coc {
            CocField::Uniform { radius_px } => Some(Self::Uniform(radius_px)),
            CocField::Ramp(ramp) => Some(Self::Ramp(ramp)),
            CocField::Depth(lens) => depth.filter(|depth| depth.height > 0).map(|depth| Self::Depth(depth, lens)),
        }
    }

    /// Sets each pixel of `row`, row `y` of a picture of `rows` rows, to `color(x, signed CoC in pixels)`.
    #[inline(always)]
    pub fn color_row(
        &self,
        y: u32,
        rows: u32,
        columns: &[u32],
        row: &mut [u8],
        mut color: impl FnMut(u32, f32) -> [u8; 3],
    ) {
        let pixels = (0..).zip(row.as_chunks_mut::<3>().0);
        match self {
            Self::Uniform(radius_px) => pixels.for_each(|(x, pixel)| *pixel = color(x, *radius_px)),
            Self::Ramp(ramp) => {
                let y_px = y as f32 + 0.5;
                pixels.for_each(|(x, pixel)| *pixel = color(x, ramp.coc_px(x as f32 + 0.5, y_px)));
            }
            Self::Depth(depth, lens) => {
                let depths = depth_row(depth, y, rows);
                for ((x, pixel), &column) in pixels.zip(columns) {
                    *pixel = color(x, lens.coc_px(depths[column as usize]));
                }
            }
        }
    }
}

/// Returns the row of a depth map for row `y` of a picture of `rows` rows.
pub fn depth_row(depth: &DepthMap, y: u32, rows: u32) -> &[f32] {
    let at = scale_index(y, rows, depth.height) as usize;
    &depth.metres[at * depth.width as usize..][..depth.width as usize]
}

/// Scales the index `at` of `from` pixels to an index of `to` pixels.
pub fn scale_index(at: u32, from: u32, to: u32) -> u32 {
    (u64::from(at) * u64::from(to) / u64::from(from.max(1))) as u32
}
