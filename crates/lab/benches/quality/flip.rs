//! LDR-FLIP: the difference that a viewer sees when two pictures are flipped on a screen, 0 to 1.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Moller et al., *FLIP: a difference evaluator for alternating images*, HPG 2020,
//! for the viewing conditions of its default: 0.7 m from a screen of 0.7 m and 3840 pixels. All its filters are sums of
//! separable ones and are run as such.

use std::f32::consts::PI;

use bokehcam::color::srgb_to_linear;
use bokehcam::frame::ColorImage;

use super::picture::Plane;

/// Pixels per degree of the visual field.
const PIXELS_PER_DEGREE: f32 = 0.7 * (3840.0 / 0.7) * (PI / 180.0);
/// Exponent of the colour difference, and the point (fraction of the maximum, result) where its scale has a knee.
const COLOR_EXPONENT: f32 = 0.7;
const KNEE: (f32, f32) = (0.4, 0.95);
/// Width of the feature detectors in degrees, and the exponent of the feature difference.
const FEATURE_DEG: f32 = 0.082;
const FEATURE_EXPONENT: f32 = 0.5;
/// Reference white D65.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];
/// sRGB primaries to XYZ, and back.
const XYZ: [[f32; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
const RGB: [[f32; 3]; 3] = [
    [3.241_003_3, -1.537_398_9, -0.498_615_8],
    [-0.969_224_3, 1.875_93, 0.041_554_227],
    [0.055_639_42, -0.204_011_2, 1.057_149],
];

type Vec3 = [f32; 3];

/// Returns the mean FLIP over the picture.
pub fn mean_flip(a: &ColorImage, b: &ColorImage) -> f64 {
    let (a, b) = (to_opponent_space(a), to_opponent_space(b));
    let (lab_a, lab_b) = (filter_by_contrast_sensitivity(&a), filter_by_contrast_sensitivity(&b));
    let (features_a, features_b) = (detect_features(&a), detect_features(&b));
    let most = hyab_distance(adjust_by_hunt(rgb_to_lab([0.0, 1.0, 0.0])), adjust_by_hunt(rgb_to_lab([0.0, 0.0, 1.0])))
        .powf(COLOR_EXPONENT);
    let mut sum = 0.0;
    for k in 0..a.data.len() {
        let difference = hyab_distance(lab_a.data[k], lab_b.data[k]).powf(COLOR_EXPONENT);
        let knee = KNEE.0 * most;
        let color = if difference < knee {
            KNEE.1 / knee * difference
        } else {
            KNEE.1 + (difference - knee) / (most - knee) * (1.0 - KNEE.1)
        };
        let ([edge_a, point_a], [edge_b, point_b]) = (features_a.data[k], features_b.data[k]);
        let feature = (edge_a - edge_b).abs().max((point_a - point_b).abs());
        let feature = (std::f32::consts::FRAC_1_SQRT_2 * feature).powf(FEATURE_EXPONENT).min(1.0);
        sum += f64::from(color.powf(1.0 - feature));
    }
    sum / a.data.len() as f64
}

fn multiply(matrix: &[[f32; 3]; 3], v: Vec3) -> Vec3 {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Converts the picture to the linear opponent space YCxCz.
fn to_opponent_space(image: &ColorImage) -> Plane<Vec3> {
    let light: Vec<f32> = (0..256).map(|code| srgb_to_linear(code as f32 / 255.0)).collect();
    let pixel = |p: &[u8]| {
        let xyz = multiply(&XYZ, [0, 1, 2].map(|k| light[usize::from(p[k])]));
        let [x, y, z] = [0, 1, 2].map(|k| xyz[k] / WHITE[k]);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    };
    let data = image.rgb.chunks_exact(3).map(pixel).collect();
    Plane { width: image.width as usize, height: image.height as usize, data }
}

/// Filters by the contrast sensitivity of the eye at that distance; the result is L*a*b* with Hunt's adjustment.
fn filter_by_contrast_sensitivity(image: &Plane<Vec3>) -> Plane<Vec3> {
    // Contrast sensitivity: Gaussians a sqrt(pi/b) exp(-pi^2 x^2 / b); yellow-blue is the sum of two.
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let gaussian = |b: f32| -> Vec<f32> {
        (-radius..=radius).map(|d| (-(PI * d as f32 / PIXELS_PER_DEGREE).powi(2) / b).exp()).collect()
    };
    let mass = |taps: &[f32]| taps.iter().sum::<f32>().powi(2);
    let filters = [gaussian(0.0047), gaussian(0.0053), gaussian(0.04), gaussian(0.025)];
    let amounts = [34.1 * (PI / 0.04) * mass(&filters[2]), 13.5 * (PI / 0.025) * mass(&filters[3])];
    let unit = filters.each_ref().map(|taps| taps.iter().map(|tap| tap / mass(taps).sqrt()).collect::<Vec<_>>());
    let four = image.map(|[y, cx, cz]| [y, cx, cz, cz]);
    let along = |of: &Plane<[f32; 4]>, dx, dy| convolve(of, dx, dy, radius, |k, tap| unit[k][tap]);
    let blurred = along(&along(&four, 1, 0), 0, 1);
    blurred.map(|[y, cx, wide, narrow]| {
        let cz = (amounts[0] * wide + amounts[1] * narrow) / (amounts[0] + amounts[1]);
        let y = (y + 16.0) / 116.0;
        let xyz = [(cx / 500.0 + y) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]];
        adjust_by_hunt(rgb_to_lab(multiply(&RGB, xyz).map(|light| light.clamp(0.0, 1.0))))
    })
}

/// Returns the strength of edges and of points in the luminance.
fn detect_features(image: &Plane<Vec3>) -> Plane<[f32; 2]> {
    let sigma = 0.5 * FEATURE_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let places = || (-radius..=radius).map(|d| d as f32);
    let bell: Vec<f32> = places().map(|d| (-d * d / (2.0 * sigma * sigma)).exp()).collect();
    let total: f32 = bell.iter().sum();
    // Normalises the positive taps of a detector to a sum of 1, the negative ones to -1.
    let balanced = |raw: Vec<f32>| -> Vec<f32> {
        let sum = |sign: f32| raw.iter().map(|tap| (sign * tap).max(0.0)).sum::<f32>();
        let (positive, negative) = (sum(1.0), sum(-1.0));
        raw.iter().map(|tap| if *tap > 0.0 { tap / positive } else { tap / negative }).collect()
    };
    let weighted = |of: &dyn Fn(f32) -> f32| balanced(places().zip(&bell).map(|(d, bell)| of(d) * bell).collect());
    let edge = weighted(&|d| -d);
    let point = weighted(&|d| d * d / (sigma * sigma) - 1.0);
    let smooth: Vec<f32> = bell.iter().map(|tap| tap / total).collect();
    let gray = image.map(|[y, ..]| [(y + 16.0) / 116.0; 4]);
    // Edge and point detectors across, then down: each is a detector along one axis and smooth along the other.
    let across = [&edge, &point, &smooth, &smooth];
    let down = [&smooth, &smooth, &edge, &point];
    let first = convolve(&gray, 1, 0, radius, |k, tap| across[k][tap]);
    convolve(&first, 0, 1, radius, |k, tap| down[k][tap])
        .map(|[edge_x, point_x, edge_y, point_y]| [edge_x.hypot(edge_y), point_x.hypot(point_y)])
}

/// Applies a 1-D filter to each of four channels, the border repeated.
fn convolve(
    of: &Plane<[f32; 4]>,
    dx: i32,
    dy: i32,
    radius: i32,
    tap: impl Fn(usize, usize) -> f32 + Sync,
) -> Plane<[f32; 4]> {
    let taps: Vec<[f32; 4]> = (0..=2 * radius as usize).map(|d| [0, 1, 2, 3].map(|k| tap(k, d))).collect();
    Plane::from_fn(of.width, of.height, |x, y| {
        let mut sum = [0.0; 4];
        for (tap, d) in taps.iter().zip(-radius..) {
            let at = of.at(x as i32 + d * dx, y as i32 + d * dy);
            (0..4).for_each(|k| sum[k] += tap[k] * at[k]);
        }
        sum
    })
}

/// Converts linear light to L*a*b*.
fn rgb_to_lab(rgb: Vec3) -> Vec3 {
    let delta = 6.0f32 / 29.0;
    let xyz = multiply(&XYZ, rgb);
    let [x, y, z] = [0, 1, 2].map(|k| {
        let t = xyz[k] / WHITE[k];
        if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Applies Hunt's adjustment: dark colours look less colourful.
fn adjust_by_hunt([l, a, b]: Vec3) -> Vec3 {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// Returns the HyAB distance: city block between lightness and chroma, Euclidean within chroma.
fn hyab_distance(p: Vec3, q: Vec3) -> f32 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}
