//! The preview: a window that shows a source in portrait mode, live, and lets a person find their look.
//!
//! Three threads beside the pipeline's own: the window's (the main thread: events, controls, presenting), the
//! session's (opens sources, makes executors, takes outputs up and down), and the one that runs the pipeline. What the
//! person does is an [`state::Action`]; [`state::State::apply`] makes of it another state and the
//! [`state::Request`]s that only others can bring about.

// For the program alone: what its names do not say, comments do.
#![allow(missing_docs)]

pub mod dialog;
pub mod keys;
pub mod lent;
pub mod meters;
pub mod panel;
pub mod present;
pub mod services;
pub mod session;
pub mod state;
pub mod system;
pub mod texts;
pub mod views;
pub mod window;
