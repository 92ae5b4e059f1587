//! What a frame costs that is painted on the CPU: pixel for pixel and scaled.

use std::time::Instant;

use bokehcam::frame::ColorImage;
use bokehcam::preview::present::soft::Painter;
use bokehcam::preview::present::{Area, Drawing, Image};

const SIZE: (u32, u32) = (1280, 720);
const FRAMES: usize = 60;

/// Measures and prints: the median of many, and the best, in which others on the machine do not count.
pub fn measure() {
    let [same, small, large] = [SIZE, (640, 360), (1920, 1080)].map(|(width, height)| {
        let mut picture = ColorImage::new(width, height);
        (0_u32..).zip(&mut picture.rgb).for_each(|(k, byte)| *byte = (k.wrapping_mul(2_654_435_761) >> 24) as u8);
        picture
    });
    let area = Area { x: 0, y: 0, width: SIZE.0, height: SIZE.1 };
    let shown = |picture| {
        let (picture, background) = (Image::Memory(picture), [0; 3]);
        Drawing { area, picture, before: None, mirror: false, stale: false, background }
    };
    let cases = [
        ("pixel for pixel", shown(&same)),
        ("mirrored", Drawing { mirror: true, ..shown(&same) }),
        ("grey, because it is old", Drawing { stale: true, ..shown(&same) }),
        ("enlarged from 640x360", shown(&small)),
        ("shrunk from 1920x1080", shown(&large)),
    ];
    let mut painter = Painter::new();
    painter.resize(SIZE);
    let mut pixels = vec![0; SIZE.0 as usize * SIZE.1 as usize];
    for (name, drawing) in cases {
        let mut paint = |_| {
            let began = Instant::now();
            painter.paint(&mut pixels, 1, &drawing);
            began.elapsed().as_secs_f64() * 1e3
        };
        let mut took_ms: Vec<f64> = (0..FRAMES).map(&mut paint).collect();
        took_ms.sort_by(f64::total_cmp);
        println!("{name}: median {:.2} ms, best {:.2} ms", took_ms[FRAMES / 2], took_ms[0]);
    }
}
