//! Holding what a camera otherwise changes by itself: exposure, white balance, gain and focus.

use super::OpenError;
use super::knobs::{open, turn};
use crate::v4l2::controls::{self, Control, Value};

/// What switches a camera's own decisions off: the switch, whether it is off at 1 rather than at 0, and the value that it
/// decides on, which is kept.
const AUTOMATIC: [(&str, i64, &str); 4] = [
    // Of the menu, 1 is manual; 0, 2 and 3 leave the camera a part of the decision.
    ("auto_exposure", 1, "exposure_time_absolute"),
    ("white_balance_automatic", 0, "white_balance_temperature"),
    ("focus_automatic_continuous", 0, "focus_absolute"),
    ("gain_automatic", 0, "gain"),
];

/// A camera that decides nothing by itself, until this is dropped: then it is as it was.
#[derive(Debug)]
pub struct Held {
    camera: String,
    /// Switches and what they were.
    before: Vec<(String, i64)>,
}

impl Held {
    /// Switches the decisions of a camera off, as far as it has any; what it has decided stays.
    ///
    /// # Errors
    /// There is no such camera, or it cannot be opened.
    pub fn new(camera: &str) -> Result<Self, OpenError> {
        let device = open(camera)?;
        let listed = controls::list(&device);
        let all = listed.map_err(|error| OpenError::at(device.path(), "its controls cannot be listed", error))?;
        let mut held = Self { camera: camera.to_owned(), before: Vec::new() };
        let number = |name: &str| match controls::find(&all, name) {
            Some(Control { name, value: Some(Value::Number(value)), .. }) => Some((name.as_str(), *value)),
            _ => None,
        };
        for (switch, off, value) in AUTOMATIC {
            let Some((switch, before)) = number(switch).filter(|(_, value)| *value != off) else { continue };
            // One that refuses is left alone.
            if controls::set(&device, switch, &off.to_string()).is_err() {
                continue;
            }
            held.before.push((switch.to_owned(), before));
            if let Some((name, value)) = number(value) {
                let _ = controls::set(&device, name, &value.to_string());
            }
        }
        Ok(held)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        for (switch, before) in self.before.iter().rev() {
            if let Err(error) = turn(&self.camera, switch, *before) {
                tracing::warn!("{error}: {switch} is not {before} again, as it was");
            }
        }
    }
}
