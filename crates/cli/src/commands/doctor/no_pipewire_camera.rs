//! PipeWire's cameras in a build without the feature `pipewire`.

use super::finding::{Finding, PipeWireResults};
use super::system::System;

pub fn check_pipewire(_: &System) -> PipeWireResults {
    let note = Finding::note("PipeWire", "this program was built without it", "build it with the feature pipewire");
    PipeWireResults { findings: vec![note], can_publish: false, cameras: Vec::new() }
}
