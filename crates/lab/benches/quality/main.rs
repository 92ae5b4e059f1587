//! `cargo bench --bench quality -- [OPTIONS]`: how close the blur comes to a real lens, against other methods.
//!
//! | file | what |
//! |---|---|
//! | `scenes`, `builder`, `texture` | scenes made by code |
//! | `lens`, `truth` | the exact renderer, and its pictures kept between runs |
//! | `damage` | depth maps as sensors give them |
//! | `methods`, `rivals`, `masks`, `situations` | what is compared |
//! | `metrics`, `flip`, `highlight` | how it is measured |
//! | `report`, `markdown`, `sheet` | what comes out |
//!
//! Every method gets the same 8-bit picture and the same depth map. `crates/lab/tests/lab/quality.rs` tests the bench itself.

mod builder;
#[path = "../common/mod.rs"]
mod common;
mod damage;
mod flip;
mod highlight;
mod lens;
mod markdown;
mod masks;
mod methods;
mod metrics;
mod options;
mod picture;
mod report;
mod rivals;
mod scenes;
mod sheet;
mod situations;
mod texture;
mod truth;

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use bokehcam::budget::Quality;
use bokehcam::frame::{ColorImage, DepthMap};

use damage::Damage;
use methods::{Blurrer, Method, Shot};
use options::{Options, Part};
use report::{Flicker, Highlight, Record, Results};
use scenes::{KINDS, SceneKind};
use truth::{Views, load_or_render_views};

/// Scenes that are also measured with damaged depth.
const DAMAGED: [&str; 3] = ["hair", "fence", "depths"];
/// Scenes that are portraits, with nothing in front of the subject.
const MASKED: [&str; 3] = ["slant", "hair", "pentagon"];
/// The scene in which flicker is measured, and its number of frames.
const STATIC: &str = "depths";
const STATIC_FRAMES: u64 = 8;
/// Moving scenes: frames before the first that counts, step between those that count, and their number.
const PLAYED: usize = 60;
const PLAYED_STEP: usize = 10;
const PLAYED_FRAMES: usize = 6;
/// Seed of all damage.
const SEED: u64 = 1;
/// Folder in which truths are cached.
const CACHE: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/quality");

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let options: Options = match common::options() {
        Ok(options) => options,
        Err(code) => return code,
    };
    if options.list {
        KINDS.iter().for_each(|kind| println!("{:16} {}", kind.name, kind.what));
        Method::all().into_iter().for_each(|method| println!("{method}"));
        return ExitCode::SUCCESS;
    }
    if !options.bench {
        println!("nothing measured: run it by `cargo bench --bench quality`");
        return ExitCode::SUCCESS;
    }
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Outcome<()> {
    let mut results = Results::default();
    print_record(options, Record::TABLE_HEADER.to_owned(), None::<&Record>)?;
    for kind in KINDS.iter().filter(|kind| options.selects_scene(kind.name)) {
        let frames = if kind.moves { usize::from(options.frames) } else { 1 };
        let shots = (0..frames)
            .map(|frame| load_or_render_views(&(kind.at)(frame), &format!("{}-{frame}", kind.name), Path::new(CACHE)));
        let shots = shots.collect::<Result<Vec<_>, _>>()?;
        if options.parts.contains(&Part::Moving) && kind.moves {
            measure_moving_scene(options, kind, &mut results)?;
        }
        if options.parts.contains(&Part::Exact) {
            measure_scene(options, kind, None, &shots, &mut results)?;
        }
        if options.parts.contains(&Part::Damaged) && DAMAGED.contains(&kind.name) {
            for damage in Damage::KINDS {
                let shots: Vec<Views> = shots.iter().map(|views| damage_views(views, damage, SEED)).collect();
                measure_scene(options, kind, Some(damage), &shots, &mut results)?;
            }
        }
        if options.parts.contains(&Part::Masks) && MASKED.contains(&kind.name) {
            let portraits = masks::measure_mattes(kind.name, &(kind.at)(0), &shots[0])?;
            print_record(options, masks::Portrait::TABLE_HEADER.to_owned(), None::<&Record>)?;
            for portrait in &portraits {
                print_record(options, portrait.to_row(), Some(portrait))?;
            }
            results.portraits.extend(portraits);
        }
        if options.parts.contains(&Part::Flicker) && kind.name == STATIC {
            measure_flicker(options, &shots[0], &mut results)?;
        }
    }
    if options.parts.contains(&Part::Highlight) {
        measure_highlights(options, &mut results)?;
    }
    if options.parts.contains(&Part::Situations) {
        print_record(options, situations::Outcome::TABLE_HEADER.to_owned(), None::<&Record>)?;
        let mut told = Ok(());
        situations::measure_situations(|outcome| {
            let line = print_record(options, outcome.to_row(), Some(&outcome));
            told = std::mem::replace(&mut told, Ok(())).and(line);
            results.situations.push(outcome);
        })?;
        told?;
    }
    if options.markdown {
        print!("{}", markdown::format_report(&results));
    }
    Ok(())
}

/// Prints a measurement.
fn print_record(options: &Options, line: String, record: Option<&impl serde::Serialize>) -> Outcome<()> {
    match record {
        Some(record) if options.json => println!("{}", serde_json::to_string(record)?),
        None if options.json => {}
        _ if options.markdown => eprintln!("{line}"),
        _ => println!("{line}"),
    }
    Ok(())
}

/// Measures every method on a scene's frames, and keeps the mean over the frames.
fn measure_scene(
    options: &Options,
    kind: &SceneKind,
    damage: Option<Damage>,
    frames: &[Views],
    results: &mut Results,
) -> Outcome<()> {
    let mut pictures = Vec::new();
    let bands: Vec<_> = frames.iter().map(|views| metrics::edge_band(&views.coc_px)).collect();
    for method in options.methods() {
        let mut blurrer = Blurrer::new(method, &frames[0].shot)?;
        let mut records = Vec::new();
        for (views, band) in frames.iter().zip(&bands) {
            let picture = blurrer.blur(&views.shot)?;
            let truth = &views.truth;
            records.push(Record::score((kind.name, damage.map(Damage::name)), method, &picture, truth, band));
            pictures.push((method, picture));
        }
        if let Some(record) = Record::mean(&records.iter().collect::<Vec<_>>()) {
            print_record(options, record.to_row(), Some(&record))?;
            results.records.push(record);
        }
    }
    let Some(out) = &options.out else { return Ok(()) };
    let case = (kind.name, damage.map(Damage::name));
    let folder = case.1.map_or(kind.name.to_owned(), |damage| format!("{}-{damage}", kind.name));
    let rival = results.best_rival(case).map_or(Method::None, |rival| rival.method);
    write_pictures(options, rival, &out.join(folder), frames, &pictures)
}

/// Measures the benefit of background memory in a moving scene: some later frames of a sequence count.
fn measure_moving_scene(options: &Options, kind: &SceneKind, results: &mut Results) -> Outcome<()> {
    let counts = |frame: usize| frame >= PLAYED && (frame - PLAYED).is_multiple_of(PLAYED_STEP);
    let methods = [Method::Layered(Quality::default()), Method::Remembered];
    let mut records = methods.map(|_| Vec::new());
    let mut blurrers: Vec<Blurrer> = Vec::new();
    for frame in 0..=PLAYED + PLAYED_STEP * (PLAYED_FRAMES - 1) {
        let scene = (kind.at)(frame);
        let views = match counts(frame) {
            true => load_or_render_views(&scene, &format!("{}-{frame}", kind.name), Path::new(CACHE))?,
            false => truth::render_without_truth(&scene),
        };
        if blurrers.is_empty() {
            blurrers = methods.map(|method| Blurrer::new(method, &views.shot)).into_iter().collect::<Result<_, _>>()?;
        }
        if !counts(frame) {
            blurrers.iter_mut().for_each(|blurrer| blurrer.update_memory(&views.shot));
            continue;
        }
        let band = metrics::edge_band(&views.coc_px);
        for (k, method) in methods.into_iter().enumerate() {
            let picture = blurrers[k].blur(&views.shot)?;
            if let Some(out) = &options.out {
                fs::create_dir_all(out)?;
                sheet::write_png(&out.join(format!("{}-{frame}-{method}.png", kind.name)), &picture)?;
                sheet::write_png(&out.join(format!("{}-{frame}-truth.png", kind.name)), &views.truth)?;
            }
            records[k].push(Record::score((kind.name, Some("moving")), method, &picture, &views.truth, &band));
        }
    }
    for records in &records {
        if let Some(record) = Record::mean(&records.iter().collect::<Vec<_>>()) {
            print_record(options, record.to_row(), Some(&record))?;
            results.moving.push(record);
        }
    }
    Ok(())
}

/// Writes a scene's first frame, and the crops of every frame.
fn write_pictures(
    options: &Options,
    rival: Method,
    out: &Path,
    frames: &[Views],
    pictures: &[(Method, ColorImage)],
) -> Outcome<()> {
    fs::create_dir_all(out)?;
    sheet::write_png(&out.join("image.png"), &frames[0].shot.image)?;
    sheet::write_png(&out.join("truth.png"), &frames[0].truth)?;
    for pictures in pictures.chunks(frames.len()) {
        sheet::write_png(&out.join(format!("{}.png", pictures[0].0)), &pictures[0].1)?;
    }
    let of = |method, frame: usize| {
        let all = pictures.iter().filter(|picture| picture.0 == method);
        all.map(|picture| &picture.1).nth(frame).unwrap_or(&frames[frame].shot.image)
    };
    let ours = options.shown_method().unwrap_or(Method::None);
    let crop = |frame: usize| sheet::draw_crops(of(ours, frame), &frames[frame].truth, of(rival, frame));
    let crops: Vec<ColorImage> = (0..frames.len()).map(crop).collect();
    Ok(sheet::write_png(&out.join(format!("crops-{ours}-truth-{rival}.png")), &sheet::stack_vertically(&crops))?)
}

/// Returns the same views with a damaged depth map.
fn damage_views(views: &Views, damage: Damage, seed: u64) -> Views {
    let (coc_px, known) = damage.apply(&views.coc_px, seed);
    let mut depth: DepthMap = truth::depth_from_coc(&coc_px, views.shot.lens.coc_at_infinity_px);
    depth.metres.iter_mut().zip(&known.data).filter(|(_, known)| !**known).for_each(|(z_m, _)| *z_m = 0.0);
    Views { shot: Shot { depth, ..views.shot.clone() }, coc_px: views.coc_px.clone(), truth: views.truth.clone() }
}

fn measure_flicker(options: &Options, views: &Views, results: &mut Results) -> Outcome<()> {
    let band = metrics::edge_band(&views.coc_px);
    for method in options.methods() {
        let mut blurrer = Blurrer::new(method, &views.shot)?;
        let frame = |seed| blurrer.blur(&damage_views(views, Damage::Noise, SEED + seed).shot);
        let frames = (0..STATIC_FRAMES).map(frame).collect::<Result<Vec<_>, _>>()?;
        // Camera noise on the picture, too: the outline is found in the picture as well as in the map.
        let mut blurrer = Blurrer::new(method, &views.shot)?;
        let noisy = |seed| {
            let shot = damage_views(views, Damage::Noise, SEED + seed).shot;
            blurrer.blur(&Shot { image: masks::add_camera_noise(&shot.image, masks::NOISE_CODES, seed), ..shot })
        };
        let noisy = (0..STATIC_FRAMES).map(noisy).collect::<Result<Vec<_>, _>>()?;
        let flicker = Flicker {
            method: method.name(),
            flicker_codes: metrics::mean_flicker(&frames, |at| metrics::is_blurred(&views.coc_px, at)),
            outline_codes: metrics::mean_flicker(&noisy, |at| band.data[at]),
        };
        print_record(options, flicker.to_row(), Some(&flicker))?;
        results.flicker.push(flicker);
    }
    Ok(())
}

fn measure_highlights(options: &Options, results: &mut Results) -> Outcome<()> {
    let views = load_or_render_views(&highlight::create_scene(), "highlight", Path::new(CACHE))?;
    let truth = Highlight { method: None, profile: highlight::measure_profile(&views.truth) };
    print_record(options, truth.to_row(), Some(&truth))?;
    results.highlights.push(truth);
    for method in options.methods().into_iter().filter(|method| *method != Method::None) {
        let picture = Blurrer::new(method, &views.shot)?.blur(&views.shot)?;
        let highlight = Highlight { method: Some(method.name()), profile: highlight::measure_profile(&picture) };
        print_record(options, highlight.to_row(), Some(&highlight))?;
        results.highlights.push(highlight);
        if let Some(out) = &options.out {
            fs::create_dir_all(out.join("highlight"))?;
            sheet::write_png(&out.join(format!("highlight/{method}.png")), &picture)?;
        }
    }
    Ok(())
}
