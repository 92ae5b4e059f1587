//! Classification of nodes, and resolution of names.

use super::*;

fn capability(driver: &str, card: &[u8], device_caps: u32) -> sys::v4l2_capability {
    let mut capability: sys::v4l2_capability = zeroed();
    capability.driver[..driver.len()].copy_from_slice(driver.as_bytes());
    capability.card[..card.len()].copy_from_slice(card);
    // A real driver lists here what its other nodes can do.
    capability.capabilities = sys::V4L2_CAP_DEVICE_CAPS | sys::V4L2_CAP_VIDEO_CAPTURE | device_caps;
    capability.device_caps = device_caps;
    capability
}

fn node(index: u32, driver: &str, card: &str, device_caps: u32) -> Node {
    let mut node = Node {
        path: format!("/dev/video{index}").into(),
        index: Some(index),
        card: String::new(),
        driver: String::new(),
        bus: String::new(),
        kind: Kind::Other,
        captures: false,
        outputs: false,
        links: Vec::new(),
        usb: None,
        denied: false,
        problem: None,
    };
    node.apply_capability(&capability(driver, card.as_bytes(), device_caps));
    node
}

const CAMERA: u32 = sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_STREAMING;
const OUTPUT: u32 = sys::V4L2_CAP_VIDEO_OUTPUT | sys::V4L2_CAP_STREAMING;

#[test]
fn a_node_is_what_its_own_capabilities_say() {
    let cases = [
        ("uvcvideo", CAMERA, Kind::Capture, true),
        ("rkisp1", sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE | sys::V4L2_CAP_STREAMING, Kind::Capture, true),
        ("uvcvideo", sys::V4L2_CAP_META_CAPTURE | sys::V4L2_CAP_STREAMING, Kind::Metadata, false),
        ("old", sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_READWRITE, Kind::Other, false),
        ("codec", sys::V4L2_CAP_VIDEO_M2M_MPLANE | CAMERA, Kind::MemoryToMemory, false),
        ("vivid", OUTPUT, Kind::Output, false),
        (LOOPBACK_DRIVER, OUTPUT, Kind::Virtual, false),
        (LOOPBACK_DRIVER, CAMERA, Kind::Virtual, true),
    ];
    for (driver, caps, kind, captures) in cases {
        let node = node(0, driver, "card", caps);
        assert_eq!((node.kind, node.captures), (kind, captures), "{driver} {caps:#x}");
    }
}

#[test]
fn names_that_are_no_text_do_not_stop_the_list() {
    let mut broken = node(0, "uvcvideo", "", CAMERA);
    broken.apply_capability(&capability("uvcvideo", b"Cam\xff\xfe\0rest", CAMERA));
    assert_eq!(broken.card, "Cam\u{fffd}\u{fffd}");
    assert_eq!(decode_text(b"full"), "full");
}

#[test]
fn a_name_that_is_said_twice_is_said_once_and_both_find_the_camera() {
    for (card, name) in [
        ("UVC Test Webcam: UVC Test Webca", "UVC Test Webcam"),
        ("Integrated Camera: Integrated C", "Integrated Camera"),
        ("HD Webcam: HD Webcam", "HD Webcam"),
        ("HD Webcam: Front", "HD Webcam: Front"),
        ("Cam: HD Cam", "Cam: HD Cam"),
        ("Brio", "Brio"),
        ("", ""),
    ] {
        assert_eq!(short_name(card), name);
        let nodes = [node(0, "uvcvideo", card, CAMERA)];
        for wanted in [card, name].into_iter().filter(|wanted| !wanted.is_empty()) {
            assert!(find_by_card(wanted, &nodes).is_ok(), "{wanted}");
        }
    }
}

#[test]
fn a_part_of_the_cards_name_finds_the_camera_and_only_cameras() {
    let nodes = [
        node(0, "uvcvideo", "HD Webcam: Front", CAMERA),
        node(1, "uvcvideo", "HD Webcam: Front", sys::V4L2_CAP_META_CAPTURE),
        node(2, "uvcvideo", "Brio", CAMERA),
        node(3, "uvcvideo", "Brio", CAMERA),
        node(10, LOOPBACK_DRIVER, "Webcam that is none", CAMERA),
        node(11, LOOPBACK_DRIVER, "Phone", CAMERA),
        node(12, LOOPBACK_DRIVER, "Idle", OUTPUT),
    ];
    let found = |name| find_by_card(name, &nodes).map(|node| node.index.unwrap());
    assert_eq!(found("front"), Ok(0));
    assert_eq!(found("webcam"), Ok(0), "a real camera goes before a virtual one");
    assert_eq!(found("pHONE"), Ok(11));
    let error = found("Brio").unwrap_err().to_string();
    assert_eq!(error, "'Brio' matches /dev/video2 (Brio), /dev/video3 (Brio); use the path of one");
    for name in ["idle", "laptop", ""] {
        let error = found(name).unwrap_err().to_string();
        assert!(error.contains("/dev/video0 (HD Webcam: Front)") && !error.contains("Idle"), "{error}");
    }
    let error = find_by_card("x", &[]).unwrap_err().to_string();
    assert!(error.contains("no camera is connected") && !error.contains('\n'), "{error}");
}

#[test]
fn paths_numbers_and_links_lead_to_nodes() {
    let root = tempfile::tempdir().unwrap();
    let dev = root.path().join("dev");
    let class = root.path().join("class");
    fs::create_dir_all(dev.join("v4l/by-id")).unwrap();
    fs::create_dir_all(class.join("video7")).unwrap();
    fs::create_dir_all(class.join("video8")).unwrap();
    fs::write(class.join("video7/name"), "Cam\n").unwrap();
    fs::write(dev.join("video7"), "").unwrap();
    std::os::unix::fs::symlink("../../video7", dev.join("v4l/by-id/usb-Cam_1-video-index0")).unwrap();
    let paths = SystemPaths { class, dev: fs::canonicalize(&dev).unwrap() };

    let nodes = paths.list_nodes();
    assert_eq!(nodes.iter().map(|node| node.index.unwrap()).collect::<Vec<_>>(), [7, 8]);
    assert_eq!((nodes[0].card.as_str(), nodes[0].links.len()), ("Cam", 1), "known although it does not answer");
    assert!(nodes[0].problem.is_some());
    assert!(nodes[1].problem.as_ref().unwrap().contains("missing"));

    assert_eq!(paths.resolve_node("7").unwrap(), paths.dev.join("video7"));
    assert_eq!(paths.resolve_node("video7").unwrap(), paths.dev.join("video7"));
    assert_eq!(
        paths.resolve_node("usb-Cam_1-video-index0").unwrap(),
        paths.dev.join("v4l/by-id/usb-Cam_1-video-index0")
    );
    assert_eq!(paths.resolve_node("/dev/null").unwrap(), PathBuf::from("/dev/null"));
    for wrong in ["9", "/dev/video4711", "v4l", "."] {
        assert!(matches!(paths.resolve_node(wrong), Err(NodeError::NotFound { .. })), "{wrong}");
    }
    let file = dev.join("video7");
    assert_eq!(paths.resolve_node(file.to_str().unwrap()), Err(NodeError::NotADevice(file)));
}
