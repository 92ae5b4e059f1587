//! Fits a map to the size of its picture.

use super::DepthFile;
use crate::recording::fault::PictureFault;
use bokehcam::frame::DepthMap;
use bokehcam::names;

names::named! {
    /// How a depth map of another aspect ratio belongs to its picture.
    pub enum Fit default Stretch {
        /// Both show the same view, so the map is stretched
        Stretch = "stretch",
        /// The picture shows the middle of the map's view, so the map is cropped
        Crop = "crop",
    }
}

/// Relative difference of aspect ratios up to which both show the same view: networks round sizes to multiples of 14 or
/// 32, cameras to those of their sensors.
const MAX_SKEW: f64 = 0.02;

/// Returns whether a map, or a scaled picture, has the aspect ratio of its picture, within 2 % or one pixel.
pub fn has_same_view(depth: (u32, u32), color: (u32, u32)) -> bool {
    let [depth_width, depth_height, width, height] = [depth.0, depth.1, color.0, color.1].map(f64::from);
    // Compare by cross-multiplication: one pixel of the map changes the products by at most the longer colour side.
    let (a, b) = (depth_width * height, depth_height * width);
    depth.0 > 0 && depth.1 > 0 && (a - b).abs() <= (MAX_SKEW * a.max(b)).max(width.max(height))
}

/// Returns whether a map or mask is stretched to its picture without being asked: it has the same view, or is a square, as
/// networks make of every picture.
pub fn is_stretchable(found: (u32, u32), color: (u32, u32)) -> bool {
    has_same_view(found, color) || found.0 == found.1
}

/// Returns whether a depth map of this size covers the view of a colour picture: it is not larger, and has the same
/// aspect ratio within 2 % or one pixel.
pub fn covers(depth: (u32, u32), color: (u32, u32)) -> bool {
    depth.0 <= color.0 && depth.1 <= color.1 && has_same_view(depth, color)
}

/// Fits the map of a file as [`fit_map`], and notes it.
///
/// # Errors
/// Same as for [`fit_map`].
pub(super) fn fit_to(file: &mut DepthFile, fit: Option<Fit>, color: (u32, u32)) -> Result<(), PictureFault> {
    let size = fit_map(&mut file.map, fit, color)?;
    file.notes.extend(describe_stretch(size, color));
    Ok(())
}

/// Fits a map to a picture of `color` (columns, rows) pixels: it then covers it with at most as many pixels. Returns its
/// size before it is stretched.
///
/// # Errors
/// It has another aspect ratio, is not [`is_stretchable`], and `fit` does not say what to do.
pub(in crate::recording) fn fit_map(
    map: &mut DepthMap,
    fit: Option<Fit>,
    color: (u32, u32),
) -> Result<(u32, u32), PictureFault> {
    let found = map.size();
    if fit == Some(Fit::Crop) && !has_same_view(found, color) {
        crop(map, color);
    } else if fit.is_none() && !is_stretchable(found, color) {
        return Err(PictureFault::DepthSize { found, color });
    }
    let (width, height) = map.size();
    if width > color.0 || height > color.1 {
        reduce(map, (width.min(color.0), height.min(color.1)));
    }
    Ok((width, height))
}

/// Describes the change of a map's aspect ratio to that of its picture, if there is one.
pub fn describe_stretch((width, height): (u32, u32), color: (u32, u32)) -> Option<String> {
    let is_exact = u64::from(width) * u64::from(color.1) == u64::from(height) * u64::from(color.0);
    (!is_exact).then(|| format!("{width}x{height} pixels, stretched to the picture's {}x{}", color.0, color.1))
}

/// Crops the map to the aspect ratio of the picture, equally on both sides.
fn crop(map: &mut DepthMap, color: (u32, u32)) {
    let (width, height) = map.size();
    let scaled = |side: u32, to: u32, of: u32| (u64::from(side) * u64::from(to) / u64::from(of)).max(1) as u32;
    let (new_width, new_height) =
        (width.min(scaled(height, color.0, color.1)), height.min(scaled(width, color.1, color.0)));
    let (left, top) = ((width - new_width) / 2, (height - new_height) / 2);
    *map = pick(map, (new_width, new_height), |x| x + left, |y| y + top);
}

/// Picks the nearest depth for each pixel of a smaller map: a mean of two surfaces would lie between them.
fn reduce(map: &mut DepthMap, (width, height): (u32, u32)) {
    let nearest =
        |at: u32, from: u32, to: u32| ((2 * u64::from(at) + 1) * u64::from(from) / (2 * u64::from(to))) as u32;
    let (from_width, from_height) = map.size();
    *map = pick(map, (width, height), |x| nearest(x, from_width, width), |y| nearest(y, from_height, height));
}

fn pick(map: &DepthMap, (width, height): (u32, u32), x: impl Fn(u32) -> u32, y: impl Fn(u32) -> u32) -> DepthMap {
    let row = |line: u32| &map.metres[(y(line) * map.width) as usize..][..map.width as usize];
    let metres = (0..height).flat_map(|line| (0..width).map(move |column| (line, column)));
    let metres = metres.map(|(line, column)| row(line)[x(column) as usize]).collect();
    DepthMap { width, height, metres, ..DepthMap::default() }
}

#[cfg(test)]
mod tests {
    use super::super::Distances;
    use super::*;

    fn fitted(size: (u32, u32), fit: Option<Fit>, color: (u32, u32)) -> Result<DepthFile, PictureFault> {
        let metres = (0..size.0 * size.1).map(|k| (k % size.0 + 1) as f32).collect();
        let map = DepthMap { width: size.0, height: size.1, metres, ..DepthMap::default() };
        let mut file = DepthFile { map, distances: Distances::Metres, notes: Vec::new() };
        fit_to(&mut file, fit, color).map(|()| file)
    }

    #[test]
    fn sizes_of_networks_and_sensors_fit_and_other_views_are_asked_about() {
        for (depth, color, notes) in [
            ((640, 480), (640, 480), 0),
            ((320, 240), (640, 480), 0),
            ((640, 480), (1296, 968), 1),
            ((252, 140), (320, 180), 1),
            ((518, 294), (640, 360), 1),
            ((256, 256), (320, 180), 1),
            ((1280, 960), (640, 480), 0),
            ((1, 1), (640, 480), 1),
        ] {
            let file = fitted(depth, None, color).unwrap();
            assert!(file.map.width <= color.0 && file.map.height <= color.1, "{depth:?}");
            assert_eq!(file.notes.len(), notes, "{depth:?}: {:?}", file.notes);
        }
        for (depth, color) in [((640, 480), (640, 360)), ((48, 64), (64, 48)), ((100, 50), (100, 55))] {
            assert!(matches!(fitted(depth, None, color), Err(PictureFault::DepthSize { .. })), "{depth:?}");
            assert_eq!(fitted(depth, Some(Fit::Stretch), color).unwrap().notes.len(), 1);
        }
    }

    #[test]
    fn a_larger_map_keeps_its_depths_and_a_cropped_one_its_middle() {
        assert_eq!(fitted((6, 3), None, (2, 1)).unwrap().map.metres, [2.0, 5.0]);
        let cropped = fitted((8, 3), Some(Fit::Crop), (4, 3)).unwrap();
        assert_eq!((cropped.map.size(), &cropped.map.metres[..4]), ((4, 3), &[3.0, 4.0, 5.0, 6.0][..]));
        let tall = fitted((4, 8), Some(Fit::Crop), (4, 4)).unwrap();
        assert_eq!(tall.map.size(), (4, 4));
    }
}
