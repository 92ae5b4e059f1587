//! Portraits from a coarse mask alone, as from one camera and a network: this crate's outlines and blur against the
//! methods of video-call programs on the same mask.
//!
//! The mask is the subject's true coverage, downsampled to a network's size, softened and hardened. All methods take
//! the background to be at one distance; `with plate` gets a picture of it, too. Rivals, after their own descriptions:
//! `threshold` cuts the mask at one half and feathers it (OBS plugins); `guided` filters it by the picture's luma
//! (live-backgroundremoval-lite); both blend the picture with a Gaussian blur of all of it.

use bokehcam::bokeh::BokehError;
use bokehcam::budget::Quality;
use bokehcam::color::srgb_to_linear_table;
use bokehcam::depth::matting::mask::{BackgroundPlate, MaskMatting};
use bokehcam::frame::{ColorImage, DepthMap, Mask, compute_luma};
use bokehcam::optics::DepthCoc;
use serde::Serialize;

use super::lens::{Scene, Surface};
use super::methods::{Blurrer, Method, Shot};
use super::metrics;
use super::picture::{Plane, Rgb, decode_srgb, encode_srgb};
use super::rivals::smooth_gaussian;
use super::texture::Rng;
use super::truth::{Views, depth_from_coc};

/// Columns and rows of the mask.
const SIZE: (usize, usize) = (256, 144);
/// Standard deviation of the network's blur, in its pixels, and slope of the hardening.
const NETWORK_SIGMA_PX: f32 = 0.85;
const HARDENING_SLOPE: f32 = 8.0;
/// Radius of the guided filter in pixels, and its regularisation.
const GUIDED_RADIUS_PX: i32 = 8;
const GUIDED_EPSILON: f32 = 1e-4;
/// Standard deviation of the camera noise for the flicker, in codes.
pub const NOISE_CODES: f32 = 2.0;
const FRAMES: u64 = 6;

/// The scores of a method that makes a portrait of a scene from a mask.
#[derive(Clone, Debug, Serialize)]
pub struct Portrait {
    pub scene: &'static str,
    pub method: &'static str,
    /// Mean error of alpha in the band around the outline, in thousandths.
    pub share_error: f64,
    /// Mean change of alpha in that band from frame to frame, with a noisy camera, in thousandths.
    pub share_flicker: f64,
    /// PSNR against the true lens, in sRGB, over the whole picture; `edge_db` is that around outlines.
    pub psnr_db: f64,
    pub edge_db: f64,
}

impl Portrait {
    pub const TABLE_HEADER: &'static str = "scene     method       share error  flicker   PSNR dB  edge dB";

    pub fn to_row(&self) -> String {
        let Self { scene, method, share_error, share_flicker, psnr_db, edge_db } = self;
        format!("{scene:9} {method:12} {share_error:11.1} {share_flicker:8.1} {psnr_db:9.2} {edge_db:8.2}")
    }
}

/// The input of all methods: the mask, and the background, which only one method uses.
struct MattingInput {
    mask: Mask,
    background: ColorImage,
    /// Depth of the background; the subject is at [`DepthMap::SUBJECT_M`].
    background_m: Vec<f32>,
}

/// A method that computes alpha for every pixel.
type MattingMethod = fn(&MattingInput, &ColorImage) -> Plane<f32>;

/// Measures all methods on a scene.
///
/// # Errors
/// This crate's executor failed.
pub fn measure_mattes(name: &'static str, scene: &Scene, views: &Views) -> Result<Vec<Portrait>, BokehError> {
    let truth = render_subject_coverage(scene);
    let background = remove_subject(scene);
    let DepthCoc { coc_at_infinity_px, focus_m, .. } = views.shot.lens;
    let background_m = depth_from_coc(&background.render_coc(), coc_at_infinity_px).metres;
    let input = MattingInput {
        mask: simulate_network_mask(&truth),
        background: encode_srgb(&background.render_pinhole()),
        background_m: background_m.iter().map(|metres| metres * DepthMap::SUBJECT_M / focus_m).collect(),
    };
    let band = find_unknown_region(&input, &truth);
    let edges = metrics::edge_band(&views.coc_px);
    let background_px = mean_background_coc_px(views, &truth);
    let noisy: Vec<ColorImage> =
        (0..FRAMES).map(|frame| add_camera_noise(&views.shot.image, NOISE_CODES, frame)).collect();
    let methods: [(&str, MattingMethod); 7] = [
        ("upscaled", upscale_mask),
        ("threshold", threshold_mask),
        ("guided", apply_guided_filter),
        ("bokehcam", |input, image| compute_own_alpha(input, None, image)),
        ("with plate", |input, image| compute_own_alpha(input, Some(&input.background), image)),
        ("room's depth", |input, image| compute_own_alpha(input, None, image)),
        ("exact depth", upscale_mask),
    ];
    let mut measured = Vec::new();
    for (method, compute_alpha) in methods {
        let alpha = compute_alpha(&input, &views.shot.image);
        let frames: Vec<Plane<f32>> = noisy.iter().map(|image| compute_alpha(&input, image)).collect();
        let flicker: f64 = frames.windows(2).map(|pair| mean_alpha_error(&pair[0], &pair[1], &band)).sum();
        let picture = match method {
            "bokehcam" => blur_portrait(&input, None, &views.shot, background_px)?,
            "with plate" => blur_portrait(&input, Some(&input.background), &views.shot, background_px)?,
            // Like depth from a network beside the mask, with an exact map of the room.
            "room's depth" => {
                let lens = Shot::lens(coc_at_infinity_px, DepthMap::SUBJECT_M, views.shot.image.height as usize);
                let mut depth = DepthMap::new(views.shot.image.width, views.shot.image.height);
                depth.metres.clone_from(&input.background_m);
                MaskMatting::default().compute_matte(&input.mask, &views.shot.image, None, &mut depth);
                let shot = Shot { depth, lens, ..views.shot.clone() };
                Blurrer::new(Method::Layered(Quality::default()), &shot)?.blur_as_is(&shot)?
            }
            // Exact depth everywhere, without a matte; its alpha is not measured.
            "exact depth" => Blurrer::new(Method::Layered(Quality::default()), &views.shot)?.blur_as_is(&views.shot)?,
            _ => encode_srgb(&composite_over_blur(&decode_srgb(&views.shot.image), &alpha, background_px)),
        };
        measured.push(Portrait {
            scene: name,
            method,
            share_error: mean_alpha_error(&alpha, &truth, &band),
            share_flicker: flicker / (FRAMES - 1) as f64,
            psnr_db: metrics::psnr(&picture, &views.truth, None),
            edge_db: metrics::psnr(&picture, &views.truth, Some(&edges)),
        });
    }
    Ok(measured)
}

/// Returns whether a surface is in focus.
fn is_subject(surface: &Surface) -> bool {
    surface.coc_px == 0.0 && surface.slope == glam::Vec2::ZERO
}

fn remove_subject(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.surfaces.retain(|surface| !is_subject(surface));
    scene
}

/// Returns the coverage of each pixel by in-focus surfaces.
fn render_subject_coverage(scene: &Scene) -> Plane<f32> {
    let mut scene = scene.clone();
    for surface in &mut scene.surfaces {
        let is_subject = is_subject(surface);
        surface.texture = surface.texture.map(|[_, _, _, alpha]| {
            let light = if is_subject { alpha } else { 0.0 };
            [light, light, light, alpha]
        });
    }
    scene.render_pinhole().map(|[alpha, _, _]| alpha)
}

/// Returns the mask that a network would give.
fn simulate_network_mask(truth: &Plane<f32>) -> Mask {
    let small = Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
        let edge = |at: usize, small: usize, size: usize| at * size / small;
        let (xs, ys) = (
            edge(x, SIZE.0, truth.width)..edge(x + 1, SIZE.0, truth.width),
            edge(y, SIZE.1, truth.height)..edge(y + 1, SIZE.1, truth.height),
        );
        let count = (xs.len() * ys.len()) as f32;
        ys.flat_map(|y| xs.clone().map(move |x| (x, y))).map(|(x, y)| truth.at(x as i32, y as i32)).sum::<f32>() / count
    });
    let soft = smooth_gaussian(&small.map(|alpha| [alpha; 3]), NETWORK_SIGMA_PX);
    let alpha = soft.map(|[alpha, _, _]| 1.0 / (1.0 + (-HARDENING_SLOPE * (alpha - 0.5)).exp())).data;
    Mask { width: SIZE.0 as u32, height: SIZE.1 as u32, alpha }
}

/// Returns where the mask or the truth is fractional.
fn find_unknown_region(input: &MattingInput, truth: &Plane<f32>) -> Plane<bool> {
    let wide = upscale_mask(input, &ColorImage::new(truth.width as u32, truth.height as u32));
    let undecided = |alpha: f32| alpha > 0.02 && alpha < 0.98;
    Plane::from_fn(truth.width, truth.height, |x, y| {
        (-2..=2).any(|dy| {
            (-2..=2).any(|dx| {
                let (x, y) = (x as i32 + dx, y as i32 + dy);
                undecided(wide.at(x, y)) || undecided(truth.at(x, y))
            })
        })
    })
}

fn mean_alpha_error(a: &Plane<f32>, b: &Plane<f32>, band: &Plane<bool>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for ((a, b), _) in a.data.iter().zip(&b.data).zip(&band.data).filter(|(_, counts)| **counts) {
        sum += f64::from((a - b).abs());
        count += 1.0;
    }
    1000.0 * sum / count
}

/// Returns the mean CoC of the background.
fn mean_background_coc_px(views: &Views, truth: &Plane<f32>) -> f32 {
    let background: Vec<f32> =
        views.coc_px.data.iter().zip(&truth.data).filter(|(_, alpha)| **alpha < 0.5).map(|(coc, _)| *coc).collect();
    background.iter().sum::<f32>() / background.len() as f32
}

/// Adds camera noise of this standard deviation to a picture.
pub fn add_camera_noise(image: &ColorImage, codes: f32, seed: u64) -> ColorImage {
    let mut rng = Rng::new(seed + 1);
    let noisy = |code: &u8| (f32::from(*code) + codes * rng.normal()).round().clamp(0.0, 255.0) as u8;
    ColorImage { rgb: image.rgb.iter().map(noisy).collect(), ..*image }
}

fn upscale_mask(input: &MattingInput, image: &ColorImage) -> Plane<f32> {
    let small = Plane { width: SIZE.0, height: SIZE.1, data: input.mask.alpha.clone() };
    let (width, height) = (image.width as usize, image.height as usize);
    Plane::from_fn(width, height, |x, y| {
        let place = |at: usize, of: usize, from: usize| (at as f32 + 0.5) * from as f32 / of as f32 - 0.5;
        let (u, v) = (place(x, width, SIZE.0), place(y, height, SIZE.1));
        let (column, row, fu, fv) = (u.floor() as i32, v.floor() as i32, u - u.floor(), v - v.floor());
        let across = |row| small.at(column, row) * (1.0 - fu) + small.at(column + 1, row) * fu;
        across(row) * (1.0 - fv) + across(row + 1) * fv
    })
}

fn threshold_mask(input: &MattingInput, image: &ColorImage) -> Plane<f32> {
    let cut = upscale_mask(input, image).map(|alpha| [f32::from(u8::from(alpha > 0.5)); 3]);
    smooth_gaussian(&cut, 2.0).map(|[alpha, _, _]| alpha)
}

fn apply_guided_filter(input: &MattingInput, image: &ColorImage) -> Plane<f32> {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut luma = vec![0; width * height];
    compute_luma(&image.rgb, &mut luma);
    let luma = Plane { width, height, data: luma.iter().map(|&code| f32::from(code) / 255.0).collect() };
    let alpha = upscale_mask(input, image);
    let mean = |of: &(dyn Fn(usize) -> f32 + Sync)| {
        let own = Plane::from_fn(width, height, |x, y| of(y * width + x));
        let line = |plane: &Plane<f32>, dx: i32, dy: i32| {
            Plane::from_fn(width, height, |x, y| {
                let sum: f32 = (-GUIDED_RADIUS_PX..=GUIDED_RADIUS_PX)
                    .map(|d| plane.at(x as i32 + d * dx, y as i32 + d * dy))
                    .sum();
                sum / (2 * GUIDED_RADIUS_PX + 1) as f32
            })
        };
        line(&line(&own, 1, 0), 0, 1)
    };
    let (of_luma, of_fraction) = (mean(&|k| luma.data[k]), mean(&|k| alpha.data[k]));
    let (product, square) = (mean(&|k| luma.data[k] * alpha.data[k]), mean(&|k| luma.data[k] * luma.data[k]));
    let slope = |k: usize| {
        (product.data[k] - of_luma.data[k] * of_fraction.data[k])
            / (square.data[k] - of_luma.data[k] * of_luma.data[k] + GUIDED_EPSILON)
    };
    let (slopes, offsets) = (mean(&slope), mean(&|k| of_fraction.data[k] - slope(k) * of_luma.data[k]));
    Plane::from_fn(width, height, |x, y| {
        let k = y * width + x;
        (slopes.data[k] * luma.data[k] + offsets.data[k]).clamp(0.0, 1.0)
    })
}

fn compute_matte(input: &MattingInput, background: Option<&ColorImage>, image: &ColorImage) -> DepthMap {
    let light = srgb_to_linear_table();
    let light = [*light; 3];
    let backdrop = background.map(|color| BackgroundPlate { color, light: &light, shift_px: [0; 2] });
    let mut map = DepthMap::new(image.width, image.height);
    map.metres.fill(DepthMap::FAR_M);
    MaskMatting::default().compute_matte(&input.mask, image, backdrop.as_ref(), &mut map);
    map
}

fn compute_own_alpha(input: &MattingInput, background: Option<&ColorImage>, image: &ColorImage) -> Plane<f32> {
    let map = compute_matte(input, background, image);
    let mut alpha: Vec<f32> =
        map.metres.iter().map(|&metres| f32::from(u8::from(metres <= DepthMap::SUBJECT_M))).collect();
    map.matte.pixels.iter().for_each(|pixel| alpha[pixel.at as usize] = pixel.alpha);
    Plane { width: image.width as usize, height: image.height as usize, data: alpha }
}

/// Blurs by this crate's portrait mode, at the default quality.
fn blur_portrait(
    input: &MattingInput,
    background: Option<&ColorImage>,
    shot: &Shot,
    background_px: f32,
) -> Result<ColorImage, BokehError> {
    let lens = Shot::lens(background_px, DepthMap::SUBJECT_M, shot.image.height as usize);
    let shot = Shot { depth: compute_matte(input, background, &shot.image), lens, ..shot.clone() };
    Blurrer::new(Method::Layered(Quality::default()), &shot)?.blur_as_is(&shot)
}

/// Blends the picture, by alpha, over a Gaussian blur of all of it.
fn composite_over_blur(image: &Plane<Rgb>, alpha: &Plane<f32>, background_px: f32) -> Plane<Rgb> {
    let blurred = smooth_gaussian(image, 0.5 * background_px);
    Plane::from_fn(image.width, image.height, |x, y| {
        let k = y * image.width + x;
        let alpha = alpha.data[k];
        [0, 1, 2].map(|p| alpha * image.data[k][p] + (1.0 - alpha) * blurred.data[k][p])
    })
}
