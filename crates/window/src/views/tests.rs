use super::colors::VIRIDIS;
use super::*;
use bokehcam::frame::{ColorImage, DepthMap};

/// Creates a depth map of `size` whose depth grows from left to right.
fn map((width, height): (u32, u32)) -> DepthMap {
    let mut depth = DepthMap::new(width, height);
    for (k, metres) in depth.metres.iter_mut().enumerate() {
        *metres = 0.5 + 9.5 * (k as u32 % width) as f32 / width as f32;
    }
    depth
}

fn pixel(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
    image.rgb.as_chunks::<3>().0[(y * image.width + x) as usize]
}

fn lightness([r, g, b]: [u8; 3]) -> f32 {
    0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)
}

#[test]
fn the_colours_of_depth_grow_lighter_evenly() {
    let steps: Vec<f32> = VIRIDIS.iter().map(|&color| lightness(color)).collect();
    assert!(steps.windows(2).all(|pair| pair[1] > pair[0] - 0.6), "{steps:?}");
    let (first, last) = (steps[0], steps[255]);
    for (k, &step) in steps.iter().enumerate() {
        let even = first + (last - first) * k as f32 / 255.0;
        assert!((step - even).abs() < 0.12 * (last - first), "at {k}: {step}, not {even}");
    }
}

#[test]
fn near_is_light_far_is_dark_and_all_colours_are_used() {
    let mut view = DepthView::default();
    let image = view.draw(&map((32, 4)), (64, 8));
    assert_eq!(image.size(), (64, 8));
    let row: Vec<f32> = (0..64).map(|x| lightness(pixel(image, x, 3))).collect();
    assert!(row.windows(2).all(|pair| pair[1] <= pair[0] + 0.6), "{row:?}");
    let [dark, light] = [5, 250].map(|k| lightness(VIRIDIS[k]));
    assert!(row[0] >= light && row[63] <= dark, "{} to {}, not {light} to {dark}", row[0], row[63]);
}

#[test]
fn unknown_depth_is_grey() {
    let mut view = DepthView::default();
    let mut depth = map((16, 16));
    for metres in [0.0, f32::NAN, f32::INFINITY, -1.0] {
        depth.metres.fill(metres);
        let image = view.draw(&depth, (16, 16));
        assert!(image.rgb.as_chunks::<3>().0.iter().all(|[r, g, b]| r == g && g == b), "{metres}");
    }
}

#[test]
fn depth_can_be_shown_at_any_size_and_keeps_its_memory() {
    let mut view = DepthView::default();
    for size in [(1, 1), (17, 13), (640, 360)] {
        for map_size in [(0, 0), (1, 1), (8, 30), (640, 360)] {
            let image = view.draw(&map(map_size), size);
            assert_eq!((image.size(), image.rgb.len()), (size, (size.0 * size.1 * 3) as usize));
        }
    }
    let place = view.image().rgb.as_ptr();
    assert_eq!(view.draw(&map((320, 180)), (640, 360)).rgb.as_ptr(), place);
}
