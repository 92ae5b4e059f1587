//! `cargo bench --bench leak [-- SOURCE ...]`: what of a background can be read again after the blur of a call.
//!
//! | file | what |
//! |---|---|
//! | `options` | the command line |
//! | `experiment` | the attack: cards, calls, deconvolution, scores; `docs/privacy.md` explains its figures |
//! | `channel` | how a card reaches an attacker |
//! | `source` | pictures and videos of another program |
//! | `table` | the attacks on one card, as a line of the table |
//!

mod channel;
#[path = "../common/mod.rs"]
mod common;
mod experiment;
mod options;
mod source;
mod table;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::thread;

use crate::experiment::call::CallSettings;
use crate::experiment::card::{Card, Kind};
use crate::experiment::codec::has_ffmpeg;
use crate::experiment::observation::Observation;
use bokehcam_media::recording::still;

use channel::Channel;
use options::Options;
use table::Attacked;

type Outcome<T = ()> = Result<T, Box<dyn Error + Send + Sync>>;

/// Units per metre of the card's depth map.
const DEPTH_SCALE: f32 = 1000.0;

fn main() -> ExitCode {
    let options: Options = match common::options() {
        Ok(options) => options,
        Err(code) => return code,
    };
    if !options.bench {
        println!("nothing measured: run it by `cargo bench --bench leak`");
        return ExitCode::SUCCESS;
    }
    let outcome = match &options.write_card {
        Some(path) => write_card(&options.card(options.cards[0]), path),
        None if options.sources.is_empty() => attack_calls(&options),
        None => attack_sources(&options),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("leak: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes the card to `path`, and its depth beside it as `STEM-depth.png`, in millimetres.
fn write_card(card: &Card, path: &Path) -> Outcome {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let depth = path.with_file_name(format!("{stem}-depth.png"));
    still::write_color(path, &card.draw((0.0, 0.0)), true)?;
    still::write_depth(&depth, &card.depth(), DEPTH_SCALE, true)?;
    println!("{}, and its depth in millimetres: {}", path.display(), depth.display());
    Ok(())
}

/// One line of the table.
struct Case {
    radius_px: f32,
    privacy: bool,
    kind: Kind,
    channel: Channel,
}

/// Attacks bokehcam's own blur, one case per core at a time.
fn attack_calls(options: &Options) -> Outcome {
    let mut channels = options.channels.clone();
    if !has_ffmpeg() {
        eprintln!("leak: without ffmpeg no codecs are measured; install it for them");
        channels.retain(|channel| channel.codec.is_none());
    }
    let mut cases = Vec::new();
    for &radius_px in &options.radii {
        for &kind in &options.cards {
            for &channel in &channels {
                cases.extend([false, true].map(|privacy| Case { radius_px, privacy, kind, channel }));
            }
        }
    }
    table::print_head();
    for together in cases.chunks(thread::available_parallelism().map_or(1, usize::from)) {
        let lines: Vec<Outcome<Attacked>> = thread::scope(|scope| {
            let running: Vec<_> = together.iter().map(|case| scope.spawn(move || attack_call(options, case))).collect();
            let failed = || Err("an attack panicked".into());
            running.into_iter().map(|case| case.join().unwrap_or_else(|_| failed())).collect()
        });
        for (case, attacked) in together.iter().zip(lines) {
            let attacked = attacked?;
            let privacy = if case.privacy { "on" } else { "off" };
            let name = format!("{}-{privacy}-{}-{}", case.radius_px, case.kind.name(), case.channel);
            table::print_line(&[&case.radius_px.to_string(), privacy, &case.channel.to_string()], &attacked);
            attacked.save(options.out.as_deref(), &name)?;
        }
    }
    Ok(())
}

fn attack_call(options: &Options, case: &Case) -> Outcome<Attacked> {
    let card = options.card(case.kind);
    let settings =
        CallSettings { radius_px: case.radius_px, privacy: case.privacy, quality: options.quality, threads: Some(1) };
    let seen = case.channel.observe(&card, &settings, options.frames)?;
    Ok(Attacked::new(&card, &seen, Some(case.radius_px), options.iterations))
}

/// Attacks pictures of a card that another program has blurred, all of a source together.
fn attack_sources(options: &Options) -> Outcome {
    let card = options.card(options.cards[0]);
    table::print_head();
    for source in &options.sources {
        let pictures = source::read(source, card.size)?;
        let seen = Observation::new(&pictures, &vec![(0.0, 0.0); pictures.len()], card.wall_right());
        let attacked = Attacked::new(&card, &seen, None, options.iterations);
        table::print_line(&["?", "?", &format!("{}, {} frames", file_name(source), pictures.len())], &attacked);
        attacked.save(options.out.as_deref(), &file_name(source))?;
    }
    Ok(())
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
