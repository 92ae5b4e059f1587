//! Depth by a background plate, as commands take and use it.
#![allow(missing_docs)]

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still;

use crate::program::Home;
use crate::room::{PERSON, ROOM};

#[test]
fn commands_take_plates_and_use_them() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    let (color, covered) = PERSON.picture();
    still::write_color(&at("me.png"), &color, false).unwrap();
    still::write_color(&at("room.png"), &ROOM.picture().0, false).unwrap();
    still::write_color(&at("small.png"), &ColorImage::new(64, 36), false).unwrap();
    let options = ["--depth", "plate:room.png", "--coc-at-infinity", "12", "--out", "out.png"];
    home.run(&[&["render", "me.png"], &options[..]].concat()).done();
    let out = still::read_color(&at("out.png")).unwrap();
    let change = |of: bool| {
        let differ = |at: &usize| out.rgb[3 * at].abs_diff(color.rgb[3 * at]) as f32;
        let all: Vec<f32> = (0..covered.len()).filter(|&at| covered[at] == of).map(|at| differ(&at)).collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    assert!(change(true) < 0.5 && change(false) > 1.5, "{} {}", change(true), change(false));

    for (arguments, code, part) in [
        (&["render", "me.png", "--depth", "plate", "--out", "a.png"][..], 2, "give the picture"),
        (
            &["render", "me.png", "--depth", "plate:small.png", "--out", "a.png"],
            2,
            "64 x 36, and the pictures are 640 x 360",
        ),
        (&["render", "me.png", "--depth", "plate:none.png", "--out", "a.png"], 1, "none.png"),
        (&["render", "me.png", "--depth", "plate:", "--out", "a.png"], 2, "name a file after the colon"),
        (&["render", "me.png", "--depth", "plate:room.png", "--focus", "1.2", "--out", "a.png"], 2, "--focus"),
        (&["render", "me.png", "--depth", "plate:room.png", "--force", "--out", "room.png"], 2, "which is the input"),
        (&["stream", "synthetic", "--depth", "plate", "--to", "null"], 2, "leave --depth out"),
        (&["render", "me.png", "--depth", "defocus", "--out", "a.png"], 2, "equally sharp"),
        (&["stream", "synthetic", "--depth", "defocus", "--to", "null"], 2, "leave --depth out"),
        (&["plate", "synthetic", "--frames", "3", "--to", "room.png"], 1, "exists"),
        (&["plate", "synthetic", "--frames", "3", "--to", "room.gif"], 2, "room.gif"),
    ] {
        home.run(arguments).refused(code, &[part]);
        assert!(!at("a.png").exists(), "{arguments:?}");
    }
    // A plate without a person before it is reported.
    let ran = home.run(&["render", "me.png", "--depth", "plate:me.png", "--force", "--out", "b.png"]);
    let said = ran.done();
    assert!(said.contains("me.png: nothing in the picture differs from the plate"), "{said}");
    assert_eq!(said.matches("warning").count(), 1, "{said}");
    let ran = home.run(&["plate", "me.png", "--to", "photo.png"]);
    assert!(ran.done().contains("a person in it becomes part of the plate"), "{}", ran.stderr);
    let ran = home.run(&["plate", "synthetic", "--frames", "24", "--size", "160x120", "--to", "new/plate.png"]);
    assert!(ran.done().contains("--depth plate:new/plate.png"), "{}", ran.stderr);
    assert_eq!(still::read_color(&at("new/plate.png")).unwrap().size(), (160, 120));
}
