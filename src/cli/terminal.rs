//! What the user sees while a command runs: log lines, one-line messages, progress.

use std::io::{self, IsTerminal, Write};

use tracing_subscriber::EnvFilter;

use super::options::Global;
use super::values::LogFormat;

/// Sends log lines to stderr: warnings, or as `-v`, `-q` and `RUST_LOG` say.
pub fn start_log(global: &Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (_, 0) => "warn",
        (_, 1) => "bokehcam=info,warn",
        (_, _) => "bokehcam=debug,info",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr);
    let log = log.with_ansi(io::stderr().is_terminal());
    // A second log in one process changes nothing.
    let _ = match global.log_format {
        LogFormat::Text => log.try_init(),
        LogFormat::Json => log.json().try_init(),
    };
}

/// One line on stderr; a closed stderr is no reason to fail.
pub fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}
