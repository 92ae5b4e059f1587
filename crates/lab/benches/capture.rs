//! Decoding of camera pictures against plain implementations, interleaved: the ratios hold on a busy machine, too.
#![allow(missing_docs)]

use std::time::Instant;

use bokehcam::frame::ColorImage;
use bokehcam_live::capture::pixels::Decoder;
use bokehcam_live::v4l2::{FourCc, Layout};

const SIZE: (u32, u32) = (1280, 720);
const ROUNDS: usize = 60;

/// Returns the median milliseconds of each, run in turns.
fn median_times_ms<const N: usize>(mut runs: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    for _ in 0..ROUNDS {
        for (run, times) in runs.iter_mut().zip(&mut times) {
            let start = Instant::now();
            run();
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    })
}

/// The usual way: each pixel in floating point, with the chroma of its pair.
fn decode_yuyv_float(yuyv: &[u8], rgb: &mut [u8]) {
    for (bytes, pixels) in yuyv.chunks_exact(4).zip(rgb.chunks_exact_mut(6)) {
        let (cb, cr) = (f32::from(bytes[1]) - 128.0, f32::from(bytes[3]) - 128.0);
        for (pixel, luma) in pixels.chunks_exact_mut(3).zip([bytes[0], bytes[2]]) {
            let luma = 1.164_383 * (f32::from(luma) - 16.0);
            pixel[0] = (luma + 1.596_027 * cr + 0.5).clamp(0.0, 255.0) as u8;
            pixel[1] = (luma - 0.391_762 * cb - 0.812_968 * cr + 0.5).clamp(0.0, 255.0) as u8;
            pixel[2] = (luma + 2.017_232 * cb + 0.5).clamp(0.0, 255.0) as u8;
        }
    }
}

fn main() {
    let mut seed = 1u32;
    let mut byte = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 24) as u8
    };
    for fourcc in [FourCc::YUYV, FourCc::UYVY, FourCc::NV12, FourCc::YU12, FourCc::RGB3, FourCc::BGR3, FourCc::GREY] {
        let layout = Layout::packed(fourcc, SIZE.0, SIZE.1).unwrap();
        let memory: Vec<u8> = (0..layout.planes()[0].size_bytes).map(|_| byte()).collect();
        let yuyv: Vec<u8> = (0..2 * SIZE.0 * SIZE.1).map(|_| byte()).collect();
        let (mut decoder, mut out) = (Decoder::new(&layout).unwrap(), ColorImage::default());
        let mut other = ColorImage::new(SIZE.0, SIZE.1);
        let [ours, plain] = median_times_ms([&mut || decoder.decode(&[&memory], &mut out).unwrap(), &mut || {
            decode_yuyv_float(&yuyv, &mut other.rgb)
        }]);
        println!("{fourcc:>5}: {ours:6.3} ms; YUYV by floating point {plain:6.3} ms; ratio {:5.1}", plain / ours);
    }
    // A JPEG of this size, such as `ffmpeg -i PICTURE -vf scale=1280:720 -c:v mjpeg -pix_fmt yuvj422p -q:v 5 x.jpg`.
    let Some(path) = std::env::args().skip(1).find(|argument| !argument.starts_with('-')) else {
        println!(" MJPG: give a JPEG of {} x {} pixels to measure it", SIZE.0, SIZE.1);
        return;
    };
    let jpeg = std::fs::read(&path).unwrap();
    let layout = Layout::packed(FourCc::MJPG, SIZE.0, SIZE.1).unwrap();
    let (mut decoder, mut out) = (Decoder::new(&layout).unwrap(), ColorImage::default());
    let [ours, image] = median_times_ms([&mut || decoder.decode(&[&jpeg], &mut out).unwrap(), &mut || {
        image::load_from_memory_with_format(&jpeg, image::ImageFormat::Jpeg).unwrap();
    }]);
    println!(
        " MJPG: {ours:6.3} ms of {} kB; crate image {image:6.3} ms; ratio {:5.2}",
        jpeg.len() / 1000,
        image / ours
    );
    // JPEGs that lost a piece, as over a bad cable.
    let (mut refused, mut tried) = (0, 0);
    for piece in [512, 3072, 24_000] {
        for at in (1000..jpeg.len() - piece - 1000).step_by(jpeg.len() / 60) {
            let lost = [&jpeg[..at], &jpeg[at + piece..]].concat();
            refused += usize::from(decoder.decode(&[&lost], &mut out).is_err());
            tried += 1;
        }
    }
    println!("       of {tried} that lost a piece, {refused} were refused");
}
