//! Networks in the preview window.

use std::fs;

use bokehcam::look::Look;
use bokehcam_live::source::{DepthChoice, Options};
use bokehcam_window::services::Services;
use bokehcam_window::state::DepthMethod;
use bokehcam_window::system::System;
use tempfile::TempDir;

use crate::program::{PORTRAIT, STEREO};
use crate::store;

use super::onnx::{Side, matte, model, node, port};
use super::{WEIGHTS, written};
use store::NoStore;

#[test]
fn the_window_says_in_one_line_why_a_network_cannot_be_used_and_goes_on() {
    let folder = TempDir::new().unwrap();
    let good = matte(32, 24, WEIGHTS, 0.0);
    let huge = folder.path().join("huge.onnx");
    fs::File::create(&huge).unwrap().set_len(1 << 40).unwrap();
    let line = [port("in", &[Side::Is(7)])];
    let shapeless = model(&line, &[], &[node("Relu", &["in"], "out", &[])], &[port("out", &[Side::Is(7)])]);
    let files = [
        folder.path().join("missing.onnx"),
        written(&folder, "cut.onnx", &good[..good.len() / 2]),
        written(&folder, "shapeless.onnx", &shapeless),
        huge,
        written(&folder, "good.onnx", &good),
    ];
    for file in files {
        let depth_choice: DepthChoice = format!("matte:{}", file.display()).parse().unwrap();
        let options = Options { depth_choice, ..Options::default() };
        let mut system = System::new(options, Look::default(), Box::new(NoStore));
        match system.open(PORTRAIT, None) {
            Ok(opened) => assert!(file.ends_with("good.onnx") && opened.source.has_depth(), "{}", file.display()),
            Err(line) => {
                let name = file.file_name().unwrap().to_str().unwrap();
                assert!(line.contains(name) && !line.contains('\n') && name != "good.onnx", "{line}");
            }
        }
    }
}

#[test]
fn a_source_has_the_ways_to_depth_that_it_brings_and_the_command_names_the_one_that_was_chosen() {
    let mut system = System::new(Options::default(), Look::default(), Box::new(NoStore));
    for (name, usual) in [(PORTRAIT, DepthMethod::Measured), (STEREO, DepthMethod::Stereo)] {
        let opened = system.open(name, None).unwrap();
        assert_eq!(
            (opened.depth_method, opened.depth_methods.first(), opened.has_depth),
            (Some(usual), Some(&usual), true),
            "{name}"
        );
        assert!(!opened.depth_methods.contains(&DepthMethod::Plate), "nobody in a recording steps aside");
        assert_ne!(opened.camera.metres, bokehcam::look::Metres::Missing);
        // Selecting the default method by name gives the same result.
        let again = system.open(name, Some(usual)).unwrap();
        assert_eq!((again.depth_method, &again.depth_methods), (Some(usual), &opened.depth_methods), "{name}");
    }
    let none = system.check_depth_method(PORTRAIT, DepthMethod::PersonAndMonoDepth);
    let is_installed = system.open(PORTRAIT, None).unwrap().depth_methods.contains(&DepthMethod::PersonAndMonoDepth);
    assert_eq!(none.is_ok(), is_installed);
    assert!(is_installed || none.unwrap_err().contains("`bokehcam models get`"));
    assert!(system.check_depth_method(PORTRAIT, DepthMethod::Stereo).is_err(), "it has one camera");
    let flags = [DepthMethod::Measured, DepthMethod::Stereo, DepthMethod::Person, DepthMethod::PersonAndMonoDepth]
        .map(DepthMethod::depth_option);
    assert_eq!(flags, ["recorded", "stereo", "matte", "matte,mono"]);
}
