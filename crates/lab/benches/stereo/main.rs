//! `cargo bench --bench stereo -- COMMAND [OPTIONS]`: the cost of stereo depth, its stability, and the blur from it.
//!
//! | file | what |
//! |---|---|
//! | `times` | time of the matcher |
//! | `flicker` | how steady the disparity is where nothing moves, and how right where something does |
//! | `picture` | the blur from stereo depth against a real lens |
//! | `steps` | pictures of every step, for the documentation |
//! | `matcher` | the matchers under test |
//! | `sequence` | recordings of two eyes |
//! | `quality` | parts of the bench of that name |
//!
//! `benches/opencv_stereo.py` scores its disparity against OpenCV's.

#[path = "../common/mod.rs"]
mod common;
mod flicker;
mod matcher;
mod options;
mod picture;
mod quality;
mod sequence;
mod steps;
mod times;

use std::error::Error;
use std::process::ExitCode;

use options::{Command, Options};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let options: Options = match common::options() {
        Ok(options) => options,
        Err(code) => return code,
    };
    let (true, Some(command)) = (options.bench, &options.command) else {
        println!("nothing measured: run it by `cargo bench --bench stereo -- times`, flicker, picture or steps");
        return ExitCode::SUCCESS;
    };
    let outcome = match command {
        Command::Times(times) => times::run(times, &options),
        Command::Flicker(flicker) => flicker::run(flicker, &options),
        Command::Picture(picture) => picture::run(picture, &options),
        Command::Steps { out } => steps::run(out, &options),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("stereo: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints a line of a table, or of JSON.
fn print_record(options: &Options, line: &str, record: &impl serde::Serialize) -> Outcome {
    if options.json {
        println!("{}", serde_json::to_string(record)?);
    } else {
        println!("{line}");
    }
    Ok(())
}
