//! Files that are read and written, and rules for the source itself.
#![allow(missing_docs)]

mod examples;
mod layering;
mod licences;
mod matching;
mod promises;
mod recording;
mod scripts;
mod sinks;
mod style;
mod video;
