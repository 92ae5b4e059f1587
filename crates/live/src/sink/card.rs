//! The still card that a live output shows while there is no picture.

use bokehcam::frame::ColorImage;

/// Background colour at the top and at the bottom, and colour of the icon; sRGB.
const TOP: [f32; 3] = [44.0, 48.0, 56.0];
const BOTTOM: [f32; 3] = [24.0, 26.0, 31.0];
const ICON: [f32; 3] = [150.0, 158.0, 170.0];

/// Half-width and half-height of the icon, in units.
const HALF_SIZE: (f32, f32) = (2.2, 1.8);

/// Draws a crossed-out camera in the centre of a dark picture: the camera is off.
pub fn draw_card(picture: &mut ColorImage) {
    let (width, height) = (picture.width as usize, picture.height as usize);
    // The icon is about four units wide and two high.
    let unit_px = 0.09 * width.min(height) as f32;
    let middle = (width as f32 / 2.0, height as f32 / 2.0);
    let pixel_range = |middle: f32, half_size: f32| {
        // The edge is antialiased over one pixel: half a pixel to either side.
        let half_size_px = half_size * unit_px + 1.0;
        (middle - half_size_px).max(0.0) as usize..(middle + half_size_px) as usize
    };
    let (columns, rows) = (pixel_range(middle.0, HALF_SIZE.0), pixel_range(middle.1, HALF_SIZE.1));
    for (y, row) in picture.rgb.chunks_exact_mut((3 * width).max(1)).enumerate() {
        let down_fraction = (y as f32 + 0.5) / height as f32;
        let background: [f32; 3] =
            std::array::from_fn(|channel| TOP[channel] + (BOTTOM[channel] - TOP[channel]) * down_fraction);
        let pixels = row.as_chunks_mut::<3>().0;
        pixels.fill(background.map(|value| value.round() as u8));
        if !rows.contains(&y) {
            continue;
        }
        for (x, pixel) in pixels.iter_mut().enumerate().take(columns.end).skip(columns.start) {
            let point = ((x as f32 + 0.5 - middle.0) / unit_px, (y as f32 + 0.5 - middle.1) / unit_px);
            let coverage = (0.5 - icon_distance(point) * unit_px).clamp(0.0, 1.0);
            *pixel = std::array::from_fn(|channel| {
                (background[channel] + (ICON[channel] - background[channel]) * coverage).round() as u8
            });
        }
    }
}

/// Returns the signed distance to the crossed-out camera, in units, negative inside: its body, its lens at the right,
/// and a stroke across, with a gap to both.
fn icon_distance(point: (f32, f32)) -> f32 {
    let body = rectangle_distance((point.0 + 0.55, point.1), (1.35, 1.0), 0.3);
    // A trapezium that opens to the right; 0.9 converts the height above a sloping side to a distance.
    let beside = point.0 - 1.0;
    let lens = (-beside).max(beside - 0.9).max((point.1.abs() - 0.3 - 0.5 * beside.clamp(0.0, 0.9)) * 0.9);
    let stroke = segment_distance(point, (-2.0, -1.55), (2.0, 1.55));
    body.min(lens).max(0.34 - stroke).min(stroke - 0.13)
}

/// Returns the signed distance to a rectangle around the origin with rounded corners.
fn rectangle_distance(point: (f32, f32), half: (f32, f32), corner: f32) -> f32 {
    let (x, y) = (point.0.abs() - half.0 + corner, point.1.abs() - half.1 + corner);
    x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0) - corner
}

/// Returns the distance to the line segment from `from` to `to`.
fn segment_distance(point: (f32, f32), from: (f32, f32), to: (f32, f32)) -> f32 {
    let (line, offset) = ((to.0 - from.0, to.1 - from.1), (point.0 - from.0, point.1 - from.1));
    let along = (offset.0 * line.0 + offset.1 * line.1) / (line.0 * line.0 + line.1 * line.1);
    let along = along.clamp(0.0, 1.0);
    (offset.0 - along * line.0).hypot(offset.1 - along * line.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_card_is_dark_with_a_light_sign_in_the_middle() {
        for (width, height) in [(1280, 720), (640, 480), (320, 240), (90, 160)] {
            let mut card = ColorImage::new(width, height);
            draw_card(&mut card);
            let light = |pixel: &&[u8; 3]| pixel[1] > 120;
            let pixels = card.rgb.as_chunks::<3>().0;
            let fraction = pixels.iter().filter(light).count() as f32 / pixels.len() as f32;
            assert!((0.01..0.1).contains(&fraction), "{width} x {height}: {fraction}");
            // No light pixels in the outer quarter.
            for (at, pixel) in pixels.iter().enumerate() {
                let (x, y) = (at as u32 % width, at as u32 / width);
                let outside = |at: u32, of: u32| at < of / 4 || at >= of - of / 4;
                if outside(y, height) && outside(x, width) {
                    assert!(pixel.iter().all(|&value| value < 70), "{x}, {y}: {pixel:?}");
                }
            }
        }
    }

    #[test]
    fn no_size_is_too_small() {
        for size in [(0, 0), (1, 1), (2, 1), (2, 400)] {
            let mut card = ColorImage::new(size.0, size.1);
            draw_card(&mut card);
            assert_eq!(card.size(), size);
        }
    }
}
