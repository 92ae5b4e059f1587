//! The command `render` keeps the colours of photos: 16 bits, transparency, and light mixed in the photo's colour space.
#![allow(missing_docs)]

use std::collections::BTreeSet;
use std::fs;

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageBuffer, ImageEncoder, Rgb, Rgba, RgbaImage};
use moxcms::ColorProfile;

use crate::program::{Home, Ran};

type Wide = ImageBuffer<Rgb<u16>, Vec<u16>>;

/// Runs `render` of `in.png` on the CPU.
fn render(home: &Home, arguments: &[&str]) -> Ran {
    home.run(&[&["render", "in.png", "--backend", "cpu", "--highlights", "0"], arguments].concat())
}

/// Writes `in.png` with 16 bits, or with 8, and a colour profile.
fn write_photo(home: &Home, picture: &Wide, is_16bit: bool, profile: Option<&ColorProfile>) {
    let file = fs::File::create(home.path("in.png")).unwrap();
    let mut encoder = PngEncoder::new(file);
    profile.iter().for_each(|profile| encoder.set_icc_profile(profile.encode().unwrap()).unwrap());
    let (width, height) = picture.dimensions();
    match is_16bit {
        true => {
            let bytes: Vec<u8> = picture.as_raw().iter().flat_map(|code| code.to_ne_bytes()).collect();
            encoder.write_image(&bytes, width, height, ExtendedColorType::Rgb16)
        }
        false => {
            let picture = DynamicImage::ImageRgb16(picture.clone()).into_rgb8();
            encoder.write_image(picture.as_raw(), width, height, ExtendedColorType::Rgb8)
        }
    }
    .unwrap();
}

fn open(home: &Home, name: &str) -> DynamicImage {
    image::open(home.path(name)).unwrap()
}

/// Writes a mask of 160 by 96 pixels whose left half is the subject.
fn write_mask(home: &Home) {
    let mask = image::GrayImage::from_fn(160, 96, |x, _| [if x < 80 { 255 } else { 0 }].into());
    mask.save(home.path("mask.png")).unwrap();
}

const MASKED: [&str; 6] = ["--mask", "mask.png", "--refine", "off", "--blur", "6"];

#[test]
fn sixteen_bits_take_as_many_threads_as_the_option_says() {
    let home = Home::new();
    let (width, height) = (1600, 1200);
    let picture = Wide::from_fn(width, height, |x, y| Rgb([30 * x as u16, 40 * y as u16, ((x * y) % 50_000) as u16]));
    write_photo(&home, &picture, true, None);
    let depth = |x: u32, y: u32| if (x / 100 + y / 100).is_multiple_of(2) { 5000_u16 } else { 15_000 };
    ImageBuffer::from_fn(width, height, |x, y| image::Luma([depth(x, y)])).save(home.path("depth.png")).unwrap();
    let args = ["render", "in.png", "--depth-map", "depth.png", "--refine", "on", "--out", "out.png"];
    let mut command = home.command(&[&args[..], &["--backend", "cpu", "--threads", "1", "-q"]].concat());
    let mut child = command.spawn().unwrap();
    let mut threads = BTreeSet::new();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        let tasks = fs::read_dir(format!("/proc/{}/task", child.id())).into_iter().flatten().flatten();
        threads.extend(tasks.filter_map(|task| fs::read_to_string(task.path().join("comm")).ok()));
    };
    assert!(status.success() && !threads.is_empty());
    let others: Vec<_> =
        threads.iter().filter(|name| ["blur-", "depth-"].iter().any(|pool| name.starts_with(pool))).collect();
    assert!(others.is_empty(), "beside the only thread: {others:?}");
}

#[test]
fn sixteen_bits_stay_sixteen_bits() {
    let home = Home::new();
    write_mask(&home);
    // A gradient over a seventh of the range: 37 of 256 codes.
    let gradient =
        Wide::from_fn(160, 96, |x, y| Rgb([20_000 + (x * 60 + y) as u16, 7 * x as u16, 60_000 - 31 * y as u16]));
    write_photo(&home, &gradient, true, None);
    for out in ["out.png", "out.tif"] {
        let said = render(&home, &[&MASKED[..], &["--out", out]].concat());
        assert!(said.done().contains("16 bits"), "{}", said.stderr);
        let out = open(&home, out);
        assert_eq!(out.color(), image::ColorType::Rgb16);
        let out = out.into_rgb16();
        let is_sharp = |x: u32| x < 60;
        for (x, y, pixel) in out.enumerate_pixels().filter(|(x, ..)| is_sharp(*x)) {
            assert_eq!(pixel, gradient.get_pixel(x, y), "{x} {y}");
        }
        let levels: BTreeSet<u16> =
            out.enumerate_pixels().filter(|(x, ..)| *x > 90).map(|(.., pixel)| pixel[0]).collect();
        assert!(levels.len() > 2_000, "{} levels", levels.len());
        // A linear gradient stays what it is, far from the borders.
        for (x, y, pixel) in out.enumerate_pixels().filter(|(x, y, _)| (100..140).contains(x) && (20..76).contains(y)) {
            let difference = i32::from(pixel[0]) - i32::from(gradient.get_pixel(x, y)[0]);
            assert!(difference.abs() < 30, "{x} {y}: {difference}");
        }
    }
    // What 8 bits hold is the same as of a photo of 8 bits.
    let eight = Wide::from_fn(160, 96, |x, y| Rgb([x as u16, 2 * y as u16, 255 - x as u16].map(|code| code * 257)));
    let blurred = |is_16bit: bool| {
        write_photo(&home, &eight, is_16bit, None);
        render(&home, &[&MASKED[..], &["--out", "again.png", "--force"]].concat()).done();
        open(&home, "again.png").into_rgb8()
    };
    let (of_16, of_8) = (blurred(true), blurred(false));
    let most = of_16.as_raw().iter().zip(of_8.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most <= Some(1), "{most:?}");
}

#[test]
fn a_virtual_background_goes_behind_a_subject_of_16_bits() {
    let home = Home::new();
    write_mask(&home);
    let picture = Wide::from_fn(160, 96, |x, y| Rgb([777 + x as u16, 30_000 + y as u16, 12_345]));
    write_photo(&home, &picture, true, Some(&ColorProfile::new_adobe_rgb()));
    render(&home, &[&MASKED[..], &["--behind", "color:#00b140", "--out", "out.png"]].concat()).done();
    let out = open(&home, "out.png").into_rgb16();
    assert_eq!(out.get_pixel(30, 40), picture.get_pixel(30, 40));
    // The same colour in the primaries of Adobe RGB.
    let expected = [99, 175, 75].map(|code: u16| code * 257);
    let found = out.get_pixel(140, 40).0;
    assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 700), "{found:?}, expected {expected:?}");
}

#[test]
fn transparency_stays_as_it_is() {
    let home = Home::new();
    write_mask(&home);
    let picture =
        RgbaImage::from_fn(160, 96, |x, y| Rgba([(x / 4 + y / 4) as u8 % 2 * 200, x as u8, y as u8, (x + y) as u8]));
    picture.save(home.path("in.png")).unwrap();
    for (out, lost) in
        [("out.png", ""), ("out.tif", ""), ("out.webp", ""), ("out.jpg", "note: not in out.jpg: transparency\n")]
    {
        let said = render(&home, &[&MASKED[..], &["--out", out]].concat()).done().to_owned();
        assert!(said.starts_with(lost) && said.lines().count() == 1 + usize::from(!lost.is_empty()), "{said}");
        if lost.is_empty() {
            let found = open(&home, out);
            assert_eq!(found.color(), image::ColorType::Rgba8, "{out}");
            let found = found.into_rgba8();
            assert!(found.enumerate_pixels().all(|(x, y, pixel)| pixel[3] == picture.get_pixel(x, y)[3]), "{out}");
            assert_eq!(found.get_pixel(20, 50), picture.get_pixel(20, 50), "{out}");
            assert_ne!(found.get_pixel(120, 50), picture.get_pixel(120, 50), "{out}");
        }
    }
    // 16 bits of it, turned with the picture.
    let wide = ImageBuffer::<Rgba<u16>, _>::from_fn(160, 96, |x, y| Rgba([1, 2, 3, (400 * x + y) as u16]));
    DynamicImage::from(wide.clone()).save(home.path("in.png")).unwrap();
    render(&home, &[&MASKED[..], &["--out", "wide.tif"]].concat()).done();
    let found = open(&home, "wide.tif").into_rgba16();
    assert!(found.pixels().zip(wide.pixels()).all(|(found, pixel)| found[3] == pixel[3]));
    // Where all is opaque, there is nothing to keep or to lose.
    RgbaImage::from_pixel(160, 96, Rgba([9, 8, 7, 255])).save(home.path("in.png")).unwrap();
    assert_eq!(render(&home, &[&MASKED[..], &["--out", "opaque.jpg"]].concat()).done().lines().count(), 1);
}

/// Returns XYZ of a colour relative to the white of ICC profiles (D50), by its own colour management.
fn xyz(profile: &ColorProfile, rgb: Rgb<u16>) -> [f64; 3] {
    let curves = [&profile.red_trc, &profile.green_trc, &profile.blue_trc];
    let light: [f64; 3] = std::array::from_fn(|channel| {
        let evaluator = curves[channel].as_ref().unwrap().make_linear_evaluator().unwrap();
        f64::from(evaluator.evaluate_value(f32::from(rgb[channel]) / 65535.0))
    });
    let matrix = profile.colorant_matrix().v;
    matrix.map(|row| (0..3).map(|k| row[k] * light[k]).sum())
}

/// Returns the difference of two colours (CIE 1976).
fn delta_e(a: [f64; 3], b: [f64; 3]) -> f64 {
    let lab = |xyz: [f64; 3]| {
        let [x, y, z] = [xyz[0] / 0.9642, xyz[1], xyz[2] / 0.8249]
            .map(|t| if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    };
    let (a, b) = (lab(a), lab(b));
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Light of two colours mixes in XYZ, whatever the colour space of the photo.
#[test]
fn light_mixes_in_the_colour_space_of_the_photo() {
    let (left, right) = (Rgb([52_000, 9_000, 14_000]), Rgb([6_000, 30_000, 61_000]));
    let picture = Wide::from_fn(160, 96, |x, _| if x < 80 { left } else { right });
    let mut of_first: Option<Vec<f64>> = None;
    for (name, profile) in [
        ("sRGB", ColorProfile::new_srgb()),
        ("Display P3", ColorProfile::new_display_p3()),
        ("Adobe RGB", ColorProfile::new_adobe_rgb()),
        ("ProPhoto", ColorProfile::new_pro_photo_rgb()),
    ] {
        for is_16bit in [true, false] {
            let home = Home::new();
            write_mask(&home);
            write_photo(&home, &picture, is_16bit, Some(&profile));
            let before = open(&home, "in.png").into_rgb16();
            let said = render(&home, &["--effect", "blur", "--blur", "12", "--out", "blurred.png"]);
            assert_eq!(said.done().lines().count(), 1, "{}", said.stderr);
            let mut decoder = image::ImageReader::open(home.path("blurred.png")).unwrap().into_decoder().unwrap();
            let kept = image::ImageDecoder::icc_profile(&mut decoder).unwrap().unwrap();
            let profile = ColorProfile::new_from_slice(&kept).unwrap();
            let blurred = open(&home, "blurred.png").into_rgb16();
            // Filters are clamped channel by channel; half of an 8-bit code is up to 0.5 in dark colours.
            let tolerance = if is_16bit { 0.15 } else { 0.7 };
            let [a, b] = [0, 159].map(|x| xyz(&profile, *before.get_pixel(x, 48)));
            for x in [10, 150] {
                let change = delta_e(xyz(&profile, *blurred.get_pixel(x, 48)), xyz(&profile, *before.get_pixel(x, 48)));
                assert!(change < 0.5, "{name}: a uniform area changes by {change}");
            }
            let mut most_off = 0.0_f64;
            let fractions: Vec<f64> = (60..100)
                .map(|x| {
                    let mixed = xyz(&profile, *blurred.get_pixel(x, 48));
                    // The nearest of all mixes.
                    let mixes = (0..=2000).map(|step| {
                        let fraction = f64::from(step) / 2000.0;
                        (delta_e(mixed, std::array::from_fn(|k| a[k] + fraction * (b[k] - a[k]))), fraction)
                    });
                    let (off, fraction) = mixes.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap();
                    most_off = most_off.max(off);
                    fraction
                })
                .collect();
            println!("{name}, 16 bits {is_16bit}: at most {most_off:.3} from the mix");
            assert!(most_off < tolerance, "{name}, 16 bits {is_16bit}: up to {most_off} from the mix");
            let rises = fractions.is_sorted_by(|a, b| *b > a - 0.01);
            assert!(rises && (fractions[19] + fractions[20] - 1.0).abs() < 0.02, "{fractions:?}");
            let first = of_first.get_or_insert_with(|| fractions.clone());
            let most = first.iter().zip(&fractions).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(most < if is_16bit { 0.002 } else { 0.02 }, "{name}: fractions differ by {most}");
            // In focus, colours are the photo's own.
            render(&home, &[&MASKED[..], &["--out", "portrait.png"]].concat()).done();
            let portrait = open(&home, "portrait.png").into_rgb16();
            assert!((0..70).all(|x| portrait.get_pixel(x, 48) == before.get_pixel(x, 48)), "{name}");
        }
    }
}

#[test]
fn a_profile_without_curves_is_said() {
    let home = Home::new();
    let mut profile = vec![7; 200];
    profile[16..20].copy_from_slice(b"RGB ");
    let write = |profile: Vec<u8>| {
        let mut encoder = PngEncoder::new(fs::File::create(home.path("in.png")).unwrap());
        encoder.set_icc_profile(profile).unwrap();
        encoder.write_image(&[40; 30 * 20 * 3], 30, 20, ExtendedColorType::Rgb8).unwrap();
    };
    let blur = |out: &str| render(&home, &["--effect", "blur", "--blur", "2", "--out", out]).done().to_owned();
    write(profile);
    let said = blur("out.png");
    assert!(said.starts_with("note: in.png: its colour profile has tables instead of tone curves"), "{said}");
    assert_eq!(said.lines().count(), 2);
    write(ColorProfile::new_gray_with_gamma(1.8).encode().unwrap());
    let said = blur("grey.png");
    assert!(
        said.starts_with("note: not in grey.png: a colour profile that is not of RGB (the blur uses sRGB"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 2);
}
