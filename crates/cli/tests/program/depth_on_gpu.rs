//! Depth refinement and matting run on the device that blurs.

use serde_json::Value;

use crate::program::{Home, PORTRAIT, Ran, json};

/// Streams the recording to `null` with these arguments; returns stderr and the report.
fn streamed(arguments: &[&str]) -> (String, Value) {
    let home = Home::new();
    let stream = ["stream", PORTRAIT, "--frames", "6", "--pace", "asap", "--to", "null", "--report", "report.json"];
    let ran = Ran::of(&mut home.with_drivers(&[&stream, arguments].concat()));
    (ran.done().to_owned(), json(home.path("report.json")))
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_stream_is_refined_where_it_is_blurred() {
    for (backend, refine, expected) in [("gpu", "on", "gpu"), ("cpu", "on", "cpu"), ("cpu", "off", "none")] {
        let (told, report) = streamed(&["--backend", backend, "--refine", refine]);
        assert!(!told.contains("the CPU refines"), "{told}");
        assert_eq!((&report["refined_by"], &report["backend"]), (&expected.into(), &backend.into()), "{report}");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_stream_is_matted_where_it_is_blurred() {
    for (backend, effect, expected) in [("gpu", "dof", "gpu"), ("cpu", "dof", "cpu"), ("cpu", "blur", "none")] {
        let (told, report) = streamed(&["--backend", backend, "--effect", effect]);
        assert!(!told.contains("the CPU finds mattes"), "{told}");
        assert_eq!((&report["matted_by"], &report["backend"]), (&expected.into(), &backend.into()), "{report}");
    }
}
