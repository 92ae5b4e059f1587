//! Helpers of all benches.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Returns the parsed options, or the exit code after printing help or a one-line error.
pub fn options<O: clap::Parser>() -> Result<O, ExitCode> {
    match O::try_parse() {
        Ok(options) => Ok(options),
        Err(error) if error.use_stderr() => {
            eprintln!("{}", error.to_string().lines().next().unwrap_or("error: bad options"));
            Err(ExitCode::from(2))
        }
        Err(help) => help.exit(),
    }
}

/// Runs a bench that needs the recorded sequence and the networks in the folder of `BOKEHCAM_DATA`; prints its error.
#[allow(dead_code)] // Most benches need none.
pub fn measure_person_turning<O: clap::Parser>(
    measure: impl FnOnce(&O, &Path) -> Result<(), Box<dyn std::error::Error>>,
) -> ExitCode {
    let options = match options::<O>() {
        Ok(options) => options,
        Err(code) => return code,
    };
    let Some(data) = std::env::var_os("BOKEHCAM_DATA").map(PathBuf::from) else {
        eprintln!("error: BOKEHCAM_DATA is not set: it names the folder with rgbd/person_turning and models");
        return ExitCode::from(2);
    };
    match measure(&options, &data) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
