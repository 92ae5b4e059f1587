//! Settings without effect are reported in one line.

use crate::program::Home;

#[test]
fn a_picture_without_depth_says_what_that_costs() {
    let home = Home::new().with_photo();
    let render = |more: &[&str]| {
        let args = ["render", "photo.png", "--out", "out.png", "--force", "--backend", "cpu"];
        home.run(&[&args, more].concat())
    };
    for more in [&["--preset", "portrait"][..], &[]] {
        let ran = render(more);
        let warning = ran.warning();
        assert!(warning.contains("there is no depth, so everything is blurred"), "{more:?}: {warning}");
        for way in ["`bokehcam models get`", "--effect tilt-shift", "--mask FILE", "--depth-map FILE", "NAME-depth.png"]
        {
            assert!(warning.contains(way), "{more:?}: {warning}");
        }
    }
    for (more, named) in [
        (&["--focus", "1.2"][..], "--focus 1.2"),
        (&["--refine", "on"], "--refine on"),
        (&["--focus-range", "0.3"], "--focus-range 0.3"),
        (&["--behind", "color:#00ff00"], "--behind color:#00ff00"),
        (&["--depth-scale", "1000"], "--depth-scale 1000"),
        (&["--preset", "product"], "focus-range = 0.3 of the preset"),
    ] {
        let ran = render(&[more, &["--effect", "blur"]].concat());
        let warning = ran.warning();
        assert!(warning.contains(named) && warning.contains("there is no depth"), "{more:?}: {warning}");
    }
    let behind = render(&["--behind", "color:#00ff00"]);
    assert!(behind.done().contains("--behind color:#00ff00 (there is no depth)"), "{}", behind.stderr);
    let tilt = render(&["--effect", "blur", "--tilt", "0.5", "--focus", "1"]);
    assert!(tilt.warning().contains("--tilt 0.5 (the effect is not tilt-shift)"), "{}", tilt.stderr);
    assert!(tilt.warning().contains("--focus 1 (there is no depth)"), "{}", tilt.stderr);
    render(&["--depth", "stereo"]).refused(2, &["stereo", "--depth-map"]);
    // With depth, all of these settings have an effect. The settings file applies to all runs, so its unused settings
    // are not reported.
    let all = ["--depth-map", "depth.png", "--focus", "1.2", "--refine", "on", "--focus-range", "0.3", "--depth-scale"];
    assert_eq!(render(&[&all[..], &["5000"]].concat()).warning(), "");
    assert_eq!(render(&["--effect", "blur"]).warning(), "");
    assert!(render(&["--depth-map", "depth.png", "--effect", "blur"]).warning().contains("--depth-map has no effect"));
    let pfm = render(&["--depth-map", "depth.pfm", "--depth-scale", "1000"]);
    assert!(pfm.warning().contains("--depth-scale 1000 (this depth is already in metres)"), "{}", pfm.stderr);
    let home = Home::new().with_settings("focus = 1.2\ndepth-scale = 1000\nfps = 25\n").with_photo();
    let ran = home.run(&["render", "photo.png", "--out", "out.png", "--effect", "blur", "--backend", "cpu"]);
    assert_eq!(ran.warning(), "");
}

#[test]
fn recordings_say_what_they_have_no_use_for() {
    let home = Home::new().with_recording();
    let stream = |more: &[&str]| {
        let args = ["stream", "recording", "--to", "null", "--backend", "cpu"];
        home.run(&[&args, more].concat())
    };
    assert_eq!(stream(&["--focus", "1"]).warning(), "");
    for (more, named) in [
        (&["--fps", "25"][..], "--fps 25"),
        (&["--size", "640x480"], "--size 640x480"),
        (&["--budget-ms", "3"], "--budget-ms 3 (frames do not come in real time"),
        (&["--max-disparity", "32"], "--max-disparity 32 (depth does not come from two cameras)"),
        (&["--method", "gather", "--privacy", "on"], "--privacy on (the method gather keeps all detail"),
        (&["--effect", "none", "--rim", "0.1"], "--rim 0.1, --backend cpu (nothing is blurred)"),
        (&["--effect", "tilt-shift", "--depth-scale", "5000"], "--depth-scale 5000 (the effect does not use depth)"),
    ] {
        let ran = stream(more);
        assert!(ran.warning().contains(named), "{more:?}: {}", ran.stderr);
    }
    assert_eq!(stream(&["--budget-ms", "3", "--pace", "realtime"]).warning(), "");
    stream(&["--side-by-side"]).refused(2, &["--side-by-side", "--depth stereo"]);
    assert_eq!(stream(&["-q", "--fps", "25"]).stderr, "");
    let record = home.run(&["record", "recording", "--to", "other", "--size", "640x480"]);
    assert!(record.warning().contains("--size 640x480 (a recording has its own)"), "{}", record.stderr);

    let home = Home::new().with_colours();
    let ran = home.run(&["stream", "colours", "--to", "null", "--backend", "cpu"]);
    assert!(ran.warning().contains("there is no depth, so everything is blurred"), "{}", ran.stderr);
}

#[test]
fn a_recording_is_no_camera() {
    let home = Home::new().with_recording();
    let args = ["stream", "recording", "--to", "null", "--control", "gain=1", "--format", "MJPG", "--effect", "none"];
    let ran = home.run(&args);
    assert!(ran.warning().contains("--format MJPG, --control gain=1 (the source is not a camera)"), "{}", ran.stderr);
}

#[test]
fn the_bench_says_what_it_has_no_use_for() {
    let args = ["bench", "--sizes", "32x24", "--frames", "1", "--backend", "cpu"];
    let bench = |more: &[&str]| Home::new().run(&[&args, more].concat());
    let ran = bench(&["--refine", "on", "--coc-at-infinity", "9"]);
    assert!(ran.warning().contains("--refine on (the scene has its own background and exact depth)"), "{}", ran.stderr);
    assert!(ran.warning().contains("--blur 9 (`bench` takes --coc)"), "{}", ran.stderr);
    bench(&["--depth", "stereo"]).refused(2, &["--depth is for `stream`"]);
}
