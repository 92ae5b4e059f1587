//! What is asked, and what is answered.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The longest request, its end of line included.
pub const MOST_REQUEST_BYTES: usize = 16 * 1024;

/// What a run is asked to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// Show pictures again.
    On,
    /// Show the still card in place of pictures.
    Off,
    /// One or the other.
    Toggle,
    /// Blur as a preset says.
    Preset {
        /// Its name.
        name: String,
    },
    /// Change settings of the look: all of them, or none where one cannot be.
    Set {
        /// Each as `NAME=VALUE`, as behind the dashes of the command line.
        settings: Vec<String>,
    },
    /// Change nothing.
    Status,
    /// Make depth another way.
    Depth {
        /// The way, as behind `--depth`.
        from: String,
    },
    /// Save the next picture.
    Snapshot {
        /// The file, which must not exist; a name of the run's own choice where none is said.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<PathBuf>,
    },
}

/// What the run answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Answer {
    /// It was done: this is how the run is now.
    Done {
        /// How the run is.
        status: Box<Status>,
        /// What is to be said about it: one line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        note: Option<String>,
    },
    /// A picture was saved.
    Saved {
        /// The file.
        saved: PathBuf,
    },
    /// Nothing was done.
    Refused {
        /// Why, and what to do: one line.
        error: String,
        /// Whether it has to be asked for differently.
        usage: bool,
    },
}

impl Answer {
    /// It has to be asked for differently.
    pub fn usage(error: impl Into<String>) -> Self {
        Self::Refused { error: error.into(), usage: true }
    }

    /// It cannot be done now.
    pub fn failed(error: impl Into<String>) -> Self {
        Self::Refused { error: error.into(), usage: false }
    }
}

/// How a run is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// What it is called.
    pub name: String,
    /// Its process.
    pub pid: u32,
    /// The command: `stream` or `preview`.
    pub command: String,
    /// Whether it shows pictures; otherwise the still card.
    pub on: bool,
    /// What the source is called on the command line.
    pub source: String,
    /// Width and height of its pictures, in pixels; `None` before there are any.
    pub size: Option<(u32, u32)>,
    /// Where pictures go, as on the command line.
    pub sinks: Vec<String>,
    /// Where depth comes from, as behind `--depth`; `None` where there is none, or it cannot be changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Whether anybody watches; `None` where that is not noticed.
    pub watched: Option<bool>,
    /// The rung that frames are blurred at; `None` where nothing is blurred.
    pub quality: Option<String>,
    /// Frames per second now.
    pub fps: f64,
    /// The settings of the look, by their names.
    pub look: BTreeMap<String, String>,
    /// Seconds since it began.
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
        let refused = Answer::usage("no");
        let text = serde_json::to_string(&refused).unwrap();
        assert_eq!(text, r#"{"error":"no","usage":true}"#);
        assert_eq!(serde_json::from_str::<Answer>(&text).unwrap(), refused);
    }
}
