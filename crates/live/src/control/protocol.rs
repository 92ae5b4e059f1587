//! The messages of the control protocol: requests and answers.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Maximum length of a request in bytes, its line feed included.
pub const MAX_REQUEST_BYTES: usize = 16 * 1024;

/// A request to a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// Shows pictures again.
    On,
    /// Shows the still card in place of pictures.
    Off,
    /// Switches between on and off.
    Toggle,
    /// Applies a preset's look.
    Preset {
        /// The preset's name.
        name: String,
    },
    /// Changes settings of the look: all of them, or none if one is invalid.
    Set {
        /// Each as `NAME=VALUE`, named like the flag without its dashes.
        settings: Vec<String>,
    },
    /// Changes nothing; returns the status.
    Status,
    /// Switches to another source of depth.
    Depth {
        /// The value, as for `--depth`.
        from: String,
    },
    /// Saves the next picture.
    Snapshot {
        /// The file, which must not exist; `None` lets the run choose a name.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<PathBuf>,
    },
}

/// The answer of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Answer {
    /// The request was carried out.
    Done {
        /// The run's status afterwards.
        status: Box<Status>,
        /// A note on the effect, one line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        note: Option<String>,
    },
    /// A picture was saved.
    Saved {
        /// The file.
        saved: PathBuf,
    },
    /// Nothing was changed.
    Refused {
        /// Why, and what to do, in one line.
        error: String,
        /// Whether the request itself is invalid.
        usage: bool,
    },
}

impl Answer {
    /// Creates a refusal because the request is invalid.
    pub fn invalid_request(error: impl Into<String>) -> Self {
        Self::Refused { error: error.into(), usage: true }
    }

    /// Creates a refusal because the request cannot be carried out now.
    pub fn failed(error: impl Into<String>) -> Self {
        Self::Refused { error: error.into(), usage: false }
    }
}

/// The status of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Its name.
    pub name: String,
    /// Its process number.
    pub pid: u32,
    /// The command: `stream` or `preview`.
    pub command: String,
    /// Whether pictures are shown; otherwise the still card is.
    pub on: bool,
    /// The source, as on the command line.
    pub source: String,
    /// Width and height of its pictures, in pixels; `None` before the first one.
    pub size: Option<(u32, u32)>,
    /// The outputs, as on the command line.
    pub sinks: Vec<String>,
    /// The source of depth, as for `--depth`; `None` without depth, or if it cannot be changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Whether there are viewers; `None` if that is unknown.
    pub watched: Option<bool>,
    /// The quality level of the blur; `None` if nothing is blurred.
    pub quality: Option<String>,
    /// Whether the blur of what is behind cannot be undone.
    #[serde(default)]
    pub private: bool,
    /// Current frames per second.
    pub fps: f64,
    /// The settings of the look, by name.
    pub look: BTreeMap<String, String>,
    /// Seconds since the start.
    pub uptime_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_what_is_documented_and_nothing_else() {
        for (text, request) in [
            (r#"{"do":"off"}"#, Request::Off),
            (r#"{"do":"preset","name":"dreamy"}"#, Request::Preset { name: "dreamy".into() }),
            (r#"{"do":"set","settings":["rim=0.1"]}"#, Request::Set { settings: vec!["rim=0.1".into()] }),
            (r#"{"do":"depth","from":"matte"}"#, Request::Depth { from: "matte".into() }),
            (r#"{"do":"snapshot"}"#, Request::Snapshot { to: None }),
            (r#"{"do":"snapshot","to":"/tmp/x.png"}"#, Request::Snapshot { to: Some("/tmp/x.png".into()) }),
        ] {
            assert_eq!(serde_json::from_str::<Request>(text).unwrap(), request);
            assert_eq!(serde_json::to_string(&request).unwrap(), text);
        }
        for bad in [r#"{"do":"dance"}"#, r#"{"do":"set"}"#, r#"{"do":"preset","name":"x","y":1}"#, "[]", "off"] {
            assert!(serde_json::from_str::<Request>(bad).is_err(), "{bad}");
        }
        let refused = Answer::invalid_request("no");
        let text = serde_json::to_string(&refused).unwrap();
        assert_eq!(text, r#"{"error":"no","usage":true}"#);
        assert_eq!(serde_json::from_str::<Answer>(&text).unwrap(), refused);
    }
}
