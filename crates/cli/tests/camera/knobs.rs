//! Changing a camera's controls while it streams.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::v4l2::live::user_controls;

use super::machine::{CAMERA, Ends, Machine, frame, open, sh, until, wish};

fn knob<'a>(knobs: &'a [CameraControl], name: &str) -> &'a CameraControl {
    knobs.iter().find(|knob| knob.name == name).unwrap_or_else(|| panic!("no {name} in {knobs:?}"))
}

/// Reads a control's value with another program.
fn told(name: &str) -> i64 {
    sh(&format!("v4l2-ctl -d {CAMERA} -C {name}")).trim().rsplit_once(' ').unwrap().1.parse().unwrap()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn knobs_are_listed_turned_and_read_back_while_the_camera_streams() {
    let _machine = Machine::new();
    let mut camera = open(CAMERA, wish((320, 180), 25.0, None));
    // The mean byte of the latest picture, in thousandths, and the number of pictures.
    let (mean, count, over) = (AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
    thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(Ordering::SeqCst) {
                let (image, _) = frame(&mut camera);
                let sum: u64 = image.rgb.iter().map(|byte| u64::from(*byte)).sum();
                mean.store(1000 * sum / image.rgb.len() as u64, Ordering::SeqCst);
                count.fetch_add(1, Ordering::SeqCst);
            }
        });
        let _ends = Ends(&over);
        let wait = |what: &str, is: &mut dyn FnMut() -> bool| until(what, is);
        wait("pictures", &mut || count.load(Ordering::SeqCst) > 2);

        let all = user_controls::list_user_controls("vivid").unwrap();
        // While it is automatic, the gain changes by itself.
        let settled =
            |all: Vec<_>| all.into_iter().filter(|knob: &CameraControl| knob.name != "gain").collect::<Vec<_>>();
        assert_eq!(settled(all.clone()), settled(user_controls::list_user_controls(CAMERA).unwrap()));
        assert!(all.iter().all(|knob| !["mute", "volume", "test_pattern", "button", "string"].contains(&&*knob.name)));
        let brightness = knob(&all, "brightness");
        assert_eq!((brightness.range, brightness.value), ((0, 255, 1), told("brightness")));
        assert!(brightness.is_active && !brightness.is_boolean && brightness.menu.is_empty());
        let automatic = knob(&all, "gain_automatic");
        assert!(automatic.is_boolean && automatic.range == (0, 1, 1));

        let before = mean.load(Ordering::SeqCst);
        let all = user_controls::set_user_control("0", "brightness", 200).unwrap();
        assert_eq!((knob(&all, "brightness").value, told("brightness")), (200, 200));
        wait("a lighter picture", &mut || mean.load(Ordering::SeqCst) > before + 30_000);

        // An overridden control is reported as inactive, and becomes active when the overriding one is turned off.
        let all = user_controls::set_user_control("0", "gain_automatic", 1).unwrap();
        assert!(!knob(&all, "gain").is_active);
        let said = user_controls::set_user_control("0", "gain", 3).unwrap_err().to_string();
        assert!(said.starts_with(CAMERA) && said.contains("another control overrides it"), "{said}");
        let all = user_controls::set_user_control("0", "gain_automatic", 0).unwrap();
        assert!(knob(&all, "gain").is_active);
        let all = user_controls::set_user_control("0", "gain", 3).unwrap();
        assert_eq!((knob(&all, "gain").value, told("gain")), (3, 3));

        let said = user_controls::set_user_control("0", "brightness", 256).unwrap_err().to_string();
        assert!(said.contains("use 0 to 255") && !said.contains('\n'), "{said}");
        assert_eq!(told("brightness"), 200, "a refused value changes nothing");
        let streamed = count.load(Ordering::SeqCst);
        wait("more pictures", &mut || count.load(Ordering::SeqCst) > streamed + 2);
    });
}
