//! Scenes that are hard for one camera: the portraits that a plate and networks give of a person who wears, holds and
//! sits on objects, against a true lens.
//!
//! Networks come from the folder `models` of `BOKEHCAM_DATA`, else from the installed ones; without any, the plate is
//! measured alone. The plate is the median of noisy pictures of the same room without the person.

use std::path::PathBuf;

use bokehcam::bokeh::BokehError;
use bokehcam::bokeh::aperture::{Aperture, lens_points};
use bokehcam::budget::Quality;
use bokehcam::compute::thread_pool::core_count;
use bokehcam::depth::plate::{Capture, CaptureResult, Companion, PlateDepth};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Mask, Stamp};
use bokehcam_lab::scene::{Scene, Situation, ThinLens, View};
use bokehcam_live::source::installed::{find_best, find_best_in};
use bokehcam_networks::network::Task;
use bokehcam_networks::single_camera::{Hints, SingleCamera};
use serde::Serialize;

use super::masks::add_camera_noise;
use super::methods::{Blurrer, Method, Shot};
use super::metrics;
use super::picture::Plane;

const SIZE: (u32, u32) = (640, 360);
/// Rays per pixel of the pinhole and of the lens.
const PINHOLE_RAYS: u32 = 16;
const LENS_RAYS: usize = 160;
const COC_AT_INFINITY_PX: f32 = 10.0;
/// Radii below this count as sharp.
const SHARP_PX: f32 = 2.0;
/// Noise of a camera by day, and in low light, in codes.
const NOISE: f32 = 2.0;
const LOW_LIGHT_NOISE: f32 = 10.0;
/// Frames that a source gets before its picture counts.
const FRAMES: u64 = 8;

/// The scores of a source in a situation.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    pub situation: String,
    pub source: &'static str,
    /// Percentages of the person's pixels that are blurred, and of the others that are not.
    pub missed: f64,
    pub mistaken: f64,
    /// PSNR against the true lens, in sRGB, over the whole picture; `edge_db` is that around outlines.
    pub psnr_db: f64,
    pub edge_db: f64,
}

impl Outcome {
    pub const TABLE_HEADER: &'static str = "situation  source       missed %  mistaken %  PSNR dB  edge dB";

    pub fn to_row(&self) -> String {
        let Self { situation, source, missed, mistaken, psnr_db, edge_db } = self;
        format!("{situation:10} {source:12} {missed:8.2} {mistaken:11.2} {psnr_db:8.2} {edge_db:8.2}")
    }
}

/// A situation, rendered.
#[derive(Clone)]
struct RenderedSituation {
    name: String,
    color: ColorImage,
    room: ColorImage,
    depth: DepthMap,
    coverage: Mask,
    truth: ColorImage,
    noise: f32,
    /// Depth of the face.
    focus_m: f32,
}

/// Measures every source in every situation.
///
/// # Errors
/// Fails if this crate's executor fails.
pub fn measure_situations(mut report: impl FnMut(Outcome)) -> Result<(), BokehError> {
    for situation in Situation::ALL {
        let rendered = render_situation(situation);
        let dark = RenderedSituation { name: "low light".into(), noise: LOW_LIGHT_NOISE, ..rendered.clone() };
        let dark = (situation == Situation::Sits).then_some(dark);
        for rendered in [Some(rendered), dark].into_iter().flatten() {
            for (source, depth) in estimate_depths(&rendered) {
                report(score_depth(&rendered, source, depth)?);
            }
        }
    }
    Ok(())
}

fn render_situation(situation: Situation) -> RenderedSituation {
    let (view, threads) = (View::new(SIZE.0, SIZE.1), core_count());
    let scene = Scene::in_situation(situation);
    let (mut color, mut room) = (ColorImage::default(), ColorImage::default());
    let (mut depth, mut ignored) = (DepthMap::default(), DepthMap::default());
    scene.render_pinhole(&view, 0.3, PINHOLE_RAYS, threads, &mut color, &mut depth);
    Scene::empty_room(situation).render_pinhole(&view, 0.3, PINHOLE_RAYS, threads, &mut room, &mut ignored);
    let points = lens_points(&Aperture::default(), LENS_RAYS);
    let focus_m = scene.focus_m();
    let lens = ThinLens { coc_at_infinity_px: COC_AT_INFINITY_PX, focus_m, aperture: &points };
    RenderedSituation {
        name: situation.name().into(),
        coverage: scene.render_coverage(&view, 0.3, PINHOLE_RAYS, threads),
        truth: scene.render_thin_lens(&view, 0.3, &lens, threads).clipped.to_srgb(),
        color,
        room,
        depth,
        noise: NOISE,
        focus_m,
    }
}

/// Returns the depth of every source, and the exact one.
fn estimate_depths(rendered: &RenderedSituation) -> Vec<(&'static str, DepthMap)> {
    let [matte, mono] = [Task::Matte, Task::Mono].map(find_model);
    let networks = |matte: &Option<PathBuf>, mono: &Option<PathBuf>| {
        SingleCamera::open(matte.as_deref(), mono.as_deref(), &Hints::default()).ok()
    };
    let alone = |networks: Option<SingleCamera>| networks.map(|networks| Box::new(networks) as Box<dyn DepthSource>);
    let with_plate = |companion: Option<SingleCamera>| -> Option<Box<dyn DepthSource>> {
        let companion = companion.map(|networks| Box::new(networks) as Box<dyn Companion>);
        Some(Box::new(PlateDepth::new(Some(capture_plate(rendered)), None, companion)))
    };
    let mut sources = vec![("plate", with_plate(None))];
    if matte.is_some() {
        sources.push(("matte", alone(networks(&matte, &None))));
        sources.push(("plate,matte", with_plate(networks(&matte, &None))));
    }
    if mono.is_some() {
        sources.push(("mono", alone(networks(&None, &mono))));
    }
    if matte.is_some() && mono.is_some() {
        sources.push(("matte,mono", alone(networks(&matte, &mono))));
        sources.push(("all three", with_plate(networks(&matte, &mono))));
    }
    let mut depths = vec![("exact depth", rendered.depth.clone())];
    for (name, source) in sources {
        let Some(mut source) = source else { continue };
        let mut map = DepthMap::default();
        for frame in 0..FRAMES {
            let color = add_camera_noise(&rendered.color, rendered.noise, 100 + frame);
            let stamp = Stamp { index: frame as usize, time_ns: frame * 33_333_333, captured_ns: None };
            // A source that fails is not measured.
            if source.read(FrameInput { stamp, color: &color, right: None }, &mut map).is_err() {
                break;
            }
        }
        depths.push((name, map));
    }
    depths
}

/// Captures the plate in the product's way.
fn capture_plate(rendered: &RenderedSituation) -> ColorImage {
    let mut capture = Capture::default();
    (0..)
        .find_map(|frame| match capture.add_unchecked(&add_camera_noise(&rendered.room, rendered.noise, frame)) {
            CaptureResult::Finished(plate) => Some(plate),
            CaptureResult::Collecting(_) | CaptureResult::Rejected(_) => None,
        })
        .unwrap_or_default()
}

/// Returns a known network for a task.
fn find_model(task: Task) -> Option<PathBuf> {
    let data = std::env::var_os("BOKEHCAM_DATA").map(PathBuf::from);
    data.and_then(|data| find_best_in(vec![data.join("models")], task)).or_else(|| find_best(task))
}

fn score_depth(rendered: &RenderedSituation, source: &'static str, depth: DepthMap) -> Result<Outcome, BokehError> {
    let height = SIZE.1 as usize;
    let real = Shot::lens(COC_AT_INFINITY_PX, rendered.focus_m, height);
    let lens = match depth.subject_m {
        _ if source == "exact depth" => real,
        // Without a mask, the nearest object of a depth network is the subject.
        _ => Shot::lens(COC_AT_INFINITY_PX, DepthMap::SUBJECT_M, height),
    };
    let (mut counts, mut wrong) = ([0.0; 2], [0.0; 2]);
    for ((metres, true_m), alpha) in depth.metres.iter().zip(&rendered.depth.metres).zip(&rendered.coverage.alpha) {
        let is_sharp = lens.coc_px(*metres).abs() < SHARP_PX;
        let is_person = *alpha > 0.5;
        if !is_person && real.coc_px(*true_m).abs() < SHARP_PX {
            continue;
        }
        counts[usize::from(is_person)] += 1.0;
        wrong[usize::from(is_person)] += f64::from(u8::from(is_sharp != is_person));
    }
    let true_px = rendered.depth.metres.iter().map(|&metres| real.coc_px(metres)).collect();
    let edges = metrics::edge_band(&Plane { width: SIZE.0 as usize, height, data: true_px });
    let image = add_camera_noise(&rendered.color, rendered.noise, 100 + FRAMES - 1);
    let shot = Shot { image, depth, lens, aperture: Aperture::default() };
    let picture = Blurrer::new(Method::Layered(Quality::default()), &shot)?.blur_as_is(&shot)?;
    Ok(Outcome {
        situation: rendered.name.clone(),
        source,
        missed: 100.0 * wrong[1] / counts[1],
        mistaken: 100.0 * wrong[0] / counts[0],
        psnr_db: metrics::psnr(&picture, &rendered.truth, None),
        edge_db: metrics::psnr(&picture, &rendered.truth, Some(&edges)),
    })
}
