//! The pipeline with stages that are slow, fail or panic: every frame is accounted for, and the cause is the error.

mod accounting;
mod changes;
mod clocked;
#[path = "../../../../tests/common/mod.rs"]
mod common;
#[path = "../../../../tests/common/fakes.rs"]
mod fakes;
mod fallback;
mod faults;
mod frames;
mod ladder;
mod live;
#[path = "../../../../tests/common/onnx.rs"]
#[allow(dead_code)]
mod onnx;
#[path = "../../../../tests/common/planes.rs"]
mod planes;
#[path = "../../../../tests/common/portrait.rs"]
mod portrait;
mod replay;
mod room;
mod seek;
mod setup;
mod staging;
mod stepper;
mod stereo;
#[path = "../../../../tests/common/until.rs"]
mod until;
mod yuyv;
mod yuyv_codes;
