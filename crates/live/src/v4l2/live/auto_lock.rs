//! Locks a camera's automatic exposure, white balance, gain and focus.

use super::OpenError;
use super::user_controls::{open_device, set_user_control};
use crate::v4l2::controls::{self, Control, Value};

/// A camera's automatic modes: the switch, its value for manual mode, and the control that the mode adjusts, whose
/// value is kept.
const AUTOMATIC: [(&str, i64, &str); 4] = [
    // In this menu, 1 is manual; 0, 2 and 3 leave part of the exposure automatic.
    ("auto_exposure", 1, "exposure_time_absolute"),
    ("white_balance_automatic", 0, "white_balance_temperature"),
    ("focus_automatic_continuous", 0, "focus_absolute"),
    ("gain_automatic", 0, "gain"),
];

/// A camera with its automatic modes switched off; dropping it restores them.
#[derive(Debug)]
pub struct AutoLock {
    camera: String,
    /// Switches and their previous values.
    previous: Vec<(String, i64)>,
}

impl AutoLock {
    /// Switches off the automatic modes that a camera has; the values they had chosen stay.
    ///
    /// # Errors
    /// The camera does not exist, or cannot be opened.
    pub fn new(camera: &str) -> Result<Self, OpenError> {
        let device = open_device(camera)?;
        let listed = controls::list_controls(&device);
        let all = listed.map_err(|error| OpenError::from_io(device.path(), "its controls cannot be listed", error))?;
        let mut lock = Self { camera: camera.to_owned(), previous: Vec::new() };
        let number = |name: &str| match controls::find_control(&all, name) {
            Some(Control { name, value: Some(Value::Number(value)), .. }) => Some((name.as_str(), *value)),
            _ => None,
        };
        for (switch, off, value) in AUTOMATIC {
            let Some((switch, previous)) = number(switch).filter(|(_, value)| *value != off) else { continue };
            // A switch that refuses is left as it is.
            if controls::set_control(&device, switch, &off.to_string()).is_err() {
                continue;
            }
            lock.previous.push((switch.to_owned(), previous));
            if let Some((name, value)) = number(value) {
                let _ = controls::set_control(&device, name, &value.to_string());
            }
        }
        Ok(lock)
    }
}

impl Drop for AutoLock {
    fn drop(&mut self) {
        for (switch, previous) in self.previous.iter().rev() {
            if let Err(error) = set_user_control(&self.camera, switch, *previous) {
                tracing::warn!("{error}: {switch} could not be set back to {previous}");
            }
        }
    }
}
