//! Errors as Python exceptions.

use std::ffi::CString;
use std::fmt::Display;

use bokehcam::budget::Quality;
use bokehcam::look::settings::find_setting;
use bokehcam::look::{Look, Patch};
use bokehcam::names::describe_former_name;
use pyo3::exceptions::{PyFutureWarning, PyOSError, PyValueError};
use pyo3::{PyErr, Python};

/// Converts a library error to a `ValueError`. Its messages name command-line flags, which are arguments here.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(as_arguments(&error.to_string()))
}

/// Converts a file error to an `OSError`.
pub fn os(error: impl Display) -> PyErr {
    PyOSError::new_err(as_arguments(&error.to_string()))
}

/// Replaces flags such as `--max-coc` by arguments such as `max_coc`.
fn as_arguments(text: &str) -> String {
    let mut parts = text.split("--");
    let mut out = parts.next().unwrap_or_default().to_string();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        out += &part[..end].replace('-', "_");
        out += &part[end..];
    }
    out
}

/// Returns the default look with some settings, named like the flags.
pub fn look(settings: &[(String, String)]) -> Result<Look, PyErr> {
    let pairs = settings.iter().map(|(name, text)| (name.as_str(), text.as_str()));
    for (name, _) in settings {
        let excluded = find_setting(name).map_or(&[][..], |setting| setting.excluded_settings());
        if let Some((other, _)) = settings.iter().find(|(other, _)| excluded.contains(&other.as_str())) {
            return Err(value(format!("--{name} and --{other} exclude each other: leave one of them out")));
        }
    }
    let former = settings.iter().find(|(name, _)| name == "quality");
    if let Some(line) = former.and_then(|(_, level)| describe_former_name::<Quality>(level)) {
        let line = CString::new(line).map_err(value)?;
        Python::attach(|py| PyErr::warn(py, &py.get_type::<PyFutureWarning>(), &line, 1))?;
    }
    let patch = Patch::parse(pairs).map_err(|(name, what)| value(format!("--{name}: {what}")))?;
    patch.apply_to(&Look::default()).map_err(value)
}
