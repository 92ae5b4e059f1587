//! The preview: a window that shows a source with live background blur, with controls for the look.
//!
//! Three threads run besides those of the pipeline: the main thread (events, controls, presenting), the session's
//! (opens sources, creates executors, starts and stops outputs), and one that runs the pipeline. User input becomes a
//! [`state::Action`]; [`state::State::apply`] turns it into the new state and the [`state::Request`]s for the side
//! effects.

// Internal to the program: public items are documented only where their names do not suffice.
#![allow(missing_docs)]

/// For tests and benches, which speak of its keys and events.
#[doc(hidden)]
pub use egui;

mod dialog;
pub mod keys;
pub mod panel;
pub mod present;
mod remote_changes;
pub mod services;
pub mod session;
pub mod state;
pub mod system;
pub mod texts;
pub mod views;
pub mod window;
