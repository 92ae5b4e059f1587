use super::*;

#[test]
fn what_is_no_virtual_camera_is_refused_with_what_to_do() {
    let open = |path: &str| Output::open(Path::new(path), (640, 480), (30, 1)).unwrap_err().to_string();
    for path in ["/dev/video199", "/dev/null", "/dev", "/dev/no-such"] {
        let message = open(path);
        assert!(message.contains(path) && message.contains("modprobe v4l2loopback devices=1"), "{message}");
        assert_eq!(message.lines().count(), 1);
    }
    assert!(open("/dev/video199").contains("video_nr=199"));
    assert!(open("/dev/null").contains("not a video device"));
}

#[test]
fn a_frame_has_the_bytes_of_its_layout() {
    for (layout, fourcc, bytes) in [
        (Layout::Yuyv, "YUYV", 1_843_200),
        (Layout::Yu12, "YU12", 1_382_400),
        (Layout::Nv12, "NV12", 1_382_400),
        (Layout::Rgb24, "RGB3", 2_764_800),
        (Layout::Bgr24, "BGR3", 2_764_800),
    ] {
        assert_eq!((layout.fourcc(), layout.frame_bytes((1280, 720))), (fourcc, bytes));
    }
}

#[test]
fn a_layout_takes_sizes_in_which_shared_colours_come_out_even() {
    let fits = |layout: Layout| [(4, 2), (4, 3), (3, 2), (3, 3)].map(|size| layout.fits_size(size));
    assert_eq!(fits(Layout::Yuyv), [true, true, false, false]);
    for layout in [Layout::Yu12, Layout::Nv12] {
        assert_eq!(fits(layout), [true, false, false, false]);
    }
    for layout in [Layout::Rgb24, Layout::Bgr24] {
        assert_eq!(fits(layout), [true; 4]);
    }
}
