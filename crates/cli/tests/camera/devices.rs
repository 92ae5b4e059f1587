//! Device discovery, controls, and messages.

use std::fs;
use std::process::Command;

use bokehcam_live::v4l2::Device;
use bokehcam_live::v4l2::controls::{self, Value};
use bokehcam_live::v4l2::holders::list_holders;
use bokehcam_live::v4l2::node::{NodeError, resolve_node};

use super::machine::{CAMERA, Machine, VERSIONS, VIRTUAL, beside, run, sh, until};

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn only_nodes_that_give_pictures_are_listed() {
    // All node types of the driver, including outputs, metadata, touch, radio and teletext.
    let _machine = Machine::with("n_devs=1 node_types=0xe1d3d vid_cap_nr=0", VERSIONS[0]);
    let nodes = fs::read_dir("/sys/class/video4linux").unwrap().count();
    assert!(nodes > 6, "{nodes} nodes");
    let list = run("devices --json").json();
    let paths = |group: &str| -> Vec<String> {
        list[group].as_array().unwrap().iter().map(|device| device["path"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(paths("cameras"), [CAMERA]);
    assert_eq!(paths("virtual_cameras"), [VIRTUAL]);
    let camera = &list["cameras"][0];
    let yuyv = camera["formats"].as_array().unwrap().iter().find(|format| format["fourcc"] == "YUYV").unwrap();
    let size =
        yuyv["sizes"]["discrete"].as_array().unwrap().iter().find(|s| s["size_px"][0] == 640 && s["size_px"][1] == 480);
    assert_eq!(size.unwrap()["rates"]["discrete"][0]["fps"], 25.0);
    assert_eq!(
        (list["virtual_cameras"][0]["captures"].as_bool(), list["virtual_cameras"][0]["outputs"].as_bool()),
        (Some(false), Some(true))
    );
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_camera_has_several_names() {
    let machine = Machine::new();
    for name in ["0", "video0", CAMERA, "vivid", "VIV"] {
        assert_eq!(resolve_node(name).unwrap().to_str(), Some(CAMERA), "{name}");
    }
    // Without a writer, the virtual camera is not a source.
    assert!(matches!(resolve_node("bokehcam-test"), Err(NodeError::NotFound { .. })));
    assert!(run("devices bokehcam-test").stdout.contains(VIRTUAL));
    drop(machine);

    let _machine = Machine::with("n_devs=2 node_types=0x1,0x1 vid_cap_nr=0,1", VERSIONS[0]);
    // The name is ambiguous here, so the message lists both cameras.
    run("stream vivid --to null").refused(1, &["/dev/video0", "/dev/video1"]);
}

/// Reads a control's value with another program.
fn told(name: &str) -> String {
    let line = sh(&format!("v4l2-ctl -d {CAMERA} -C {name}"));
    line.trim().split_once(": ").unwrap().1.to_owned()
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn controls_of_every_type_are_set_by_name() {
    let _machine = Machine::new();
    let device = Device::open(CAMERA.as_ref()).unwrap();
    for (name, value, said) in [
        ("brightness", "200", "200"),
        ("hue", "-5", "-5"),
        ("boolean", "off", "0"),
        ("menu", "Menu Item 4", "4 (Menu Item 4)"),
        ("menu", "1", "1 (Menu Item 1)"),
        ("integer_menu", "42", "8 (42 0x2a)"),
        ("integer_menu", "3", "3 (3 0x3)"),
        ("integer_64_bits", "-9223372036854775808", "-9223372036854775808"),
        ("bitmask", "0x80002000", "-2147475456"),
        ("bitmask", "0x400010", "4194320"),
        ("string", "abc", "abc"),
    ] {
        controls::set_control(&device, name, value).unwrap_or_else(|error| panic!("{error}"));
        assert!(told(name).trim_matches('\'').starts_with(said.split(' ').next().unwrap()), "{name}: {}", told(name));
    }
    assert_eq!(controls::read_control(&device, "bitmask").unwrap(), Value::Number(0x40_0010));
    assert_eq!(controls::read_control(&device, "string").unwrap(), Value::Text("abc".into()));
    controls::set_control(&device, "button", "1").unwrap();

    for (name, value, said) in [
        ("brightness", "256", "use 0 to 255"),
        ("menu", "2", "3 (Menu Item 3)"),
        ("bitmask", "1", "bits of"),
        ("string", "abcde", "2 to 4 bytes"),
        ("read_only_integer_32_bits", "1", "read-only"),
        ("gain", "3", "another control overrides it"),
        ("brightnes", "1", "did you mean brightness?"),
    ] {
        let error = controls::set_control(&device, name, value).unwrap_err().to_string();
        assert!(error.contains(said) && error.lines().count() == 1, "{error}");
    }
    assert_eq!(
        controls::read_control(&device, "brightness").unwrap(),
        Value::Number(200),
        "a refused value changes nothing"
    );
    // First turn off the control that overrides it.
    controls::set_control(&device, "gain_automatic", "no").unwrap();
    controls::set_control(&device, "gain", "3").unwrap();
    assert_eq!(told("gain"), "3");
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn controls_are_listed_as_another_program_lists_them() {
    let _machine = Machine::new();
    let list = run("devices --controls --json vivid").json();
    let ours: Vec<String> = list["cameras"][0]["controls"]
        .as_array()
        .unwrap()
        .iter()
        .map(|control| format!("{} {:#010x}", control["name"].as_str().unwrap(), control["id"].as_u64().unwrap()))
        .collect();
    let theirs: Vec<String> = sh(&format!("v4l2-ctl -d {CAMERA} -l"))
        .lines()
        .filter_map(|line| line.split_once(" ("))
        .map(|(name, _)| name.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    assert!(theirs.len() > 40);
    for control in &theirs {
        assert!(ours.contains(control), "{control} is not among {ours:?}");
    }
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn options_set_controls() {
    let _machine = Machine::new();
    run("stream 0 --to null --frames 1 --effect none --control brightness=7 --control menu=4").done();
    assert_eq!((told("brightness").as_str(), told("menu").as_str()), ("7", "4 (Menu Item 4)"));
    run("stream 0 --to null --frames 1 --control brightness=999").refused(1, &["use 0 to 255"]);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn a_busy_camera_names_who_has_it() {
    let _machine = Machine::new();
    let mut other = Command::new("v4l2-ctl");
    other.args(["-d", CAMERA, "--stream-mmap", "--stream-count=1000"]);
    let other = beside(other);
    until("the other program takes pictures", || list_holders(CAMERA.as_ref()).iter().any(|holder| holder.has_buffers));
    let name = format!("v4l2-ctl (process {})", other.0.id());
    run("stream 0 --to null --frames 1").refused(1, &[&name]);
    let list = run("devices --json 0").json();
    assert_eq!(list["cameras"][0]["holders"][0]["pid"], other.0.id());
    assert_eq!(list["cameras"][0]["holders"][0]["has_buffers"], true);
    let said = run("doctor").printed();
    assert!(said.contains(&format!("{name} takes pictures")), "{said}");
    drop(other);
    let open = fs::File::open(CAMERA).unwrap();
    let said = run("doctor").printed();
    let watching = format!("(process {}) has it open and takes no pictures", std::process::id());
    assert!(said.contains(&watching) && !said.contains("takes pictures"), "{said}");
    drop(open);
}

#[test]
#[ignore = "needs the camera VM (tests/vm/run)"]
fn the_doctor_knows_a_machine_that_is_ready_from_one_that_is_not() {
    let _machine = Machine::new();
    let said = run("doctor").printed();
    assert!(said.contains("/dev/video20 (bokehcam-test): free"), "{said}");
    sh("rmmod v4l2loopback");
    let without = run("doctor");
    let said = &without.stdout;
    assert_eq!(without.code, 1, "{said}");
    assert!(
        said.contains("MISSING") && said.contains("modprobe v4l2loopback") && said.contains("exclusive_caps=1"),
        "{said}"
    );
}
