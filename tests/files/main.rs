//! Rules for the source itself, its scripts and its documents.
#![allow(missing_docs)]

mod examples;
mod layering;
mod licences;
mod promises;
mod scripts;
mod style;
