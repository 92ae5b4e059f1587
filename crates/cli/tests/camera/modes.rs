//! Sizes and frame rates of a camera offered in the window, and the direction it faces.

use bokehcam_live::capture::Camera;
use bokehcam_live::source::modes::{faces_user, list_modes};

use super::machine::{CAMERA, Machine, open, wish};

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn each_size_and_rate_that_is_offered_is_given_also_while_it_streams() {
    let _machine = Machine::new();
    let offered = list_modes(CAMERA);
    assert!(offered.len() > 2 && offered.is_sorted_by_key(|mode| std::cmp::Reverse(mode.size.0 * mode.size.1)));
    assert!(offered.iter().all(|mode| !mode.fps.is_empty()));
    for mode in &offered {
        for fps in [mode.fps[0], mode.fps[mode.fps.len() - 1]] {
            let camera = open(CAMERA, wish(mode.size, fps, None));
            let info = camera.info();
            assert_eq!(info.size, mode.size);
            assert!((1e9 / info.period_ns as f64 - fps).abs() < 0.1, "{fps} fps, {} ns", info.period_ns);
            assert_eq!(list_modes(CAMERA), offered);
        }
    }
    assert!(faces_user(CAMERA), "vivid does not say that it is at a device's back");
}
