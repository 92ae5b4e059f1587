//! The pipeline with stages that are slow, fail or panic: every frame is accounted for, and the cause is the error.

mod accounting;
mod changes;
mod clocked;
#[path = "../common/mod.rs"]
mod common;
#[path = "../common/fakes.rs"]
mod fakes;
mod fallback;
mod faults;
mod frames;
mod handover;
mod live;
#[path = "../common/planes.rs"]
mod planes;
#[path = "../common/portrait.rs"]
mod portrait;
mod replay;
mod seek;
mod setup;
mod staging;
mod stepper;
mod stereo;
#[path = "../common/until.rs"]
mod until;
mod yuyv;
