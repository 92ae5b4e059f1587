//! The meaning of the lists: pairs, columns, times.

use bokehcam_media::recording::depth_file::Fit;
use bokehcam_media::recording::{Options, Unpaired};

use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

#[test]
fn colour_and_depth_are_paired_by_nearest_time() {
    let scene = Scene::new();
    for index in 0..4 {
        scene.color(&format!("rgb/{index}.png"), SIZE, index);
        scene.depth(&format!("depth/{index}.png"), SIZE, 1000 * (u16::from(index) + 1));
    }
    scene.write(
        "rgb.txt",
        "# colour\n1305031102.175304 rgb/0.png\n\n1305031102.211214 rgb/1.png\r\n\
         1305031102.243211 rgb/2.png\n1305031102.900000 rgb/3.png\n",
    );
    // Depth 1 is near colours 1 and 2, and nearer to 2; 3 is 20 ms and 1 ns away from colour 3.
    scene.write(
        "depth.txt",
        "# depth\n1305031102.160407 depth/0.png\n1305031102.230000 depth/1.png\n\
         1305031102.920000001 depth/3.png\n",
    );
    let recording = scene.open().unwrap();
    assert_eq!(recording.layout(), "TUM RGB-D");
    assert_eq!((recording.len(), recording.is_empty(), recording.has_depth()), (2, false, true));
    assert_eq!(recording.unpaired(), Unpaired { color: 2, depth: 1, right: 0 });
    assert_eq!(times_ns(&recording), [0, 67_907_000]);
    assert_eq!(color_of(&recording, 1).unwrap().rgb[0], 2);
    assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 0.4);

    let wider = Options { pair_tolerance_ns: 20_000_001, ..Options::default() };
    assert_eq!(scene.open_with(&wider).unwrap().len(), 3);
    let exact = Options { pair_tolerance_ns: 13_211_000, ..Options::default() };
    assert_eq!(scene.open_with(&exact).unwrap().len(), 1);
}

#[test]
fn a_depth_map_serves_one_picture_only() {
    let scene = Scene::with_pairs(3);
    scene.write("rgb.txt", "1.000 rgb/0.png\n1.004 rgb/1.png\n1.008 rgb/2.png\n");
    scene.write("depth.txt", "1.005 depth/1.png\n");
    let recording = scene.open().unwrap();
    assert_eq!(recording.unpaired(), Unpaired { color: 2, depth: 0, right: 0 });
    assert_eq!(recording.len(), 1);
    assert_eq!(color_of(&recording, 0).unwrap().rgb[0], 1);
}

#[test]
fn colour_alone_is_a_recording() {
    let scene = Scene::with_pairs(3);
    scene.remove("depth.txt");
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.has_depth()), (3, false));
    assert_eq!(recording.unpaired(), Unpaired::default());
    assert_eq!(color_of(&recording, 2).unwrap().rgb[..3], [2, 100, 200]);
    assert_says(depth_of(&recording, 0), &["the recording has no depth"]);
}

/// The columns are recognised by the pictures, and where these are ambiguous by the other lists.
#[test]
fn associations_are_read_in_either_order() {
    let color_first = "1.0 rgb/0.png 1.01 depth/0.png\n1.1 rgb/1.png 1.11 depth/1.png\n";
    let depth_first = "1.01 depth/0.png 1.0 rgb/0.png\n1.11 depth/1.png 1.1 rgb/1.png\n";
    for associations in [color_first, depth_first] {
        for lists in [&["rgb.txt", "depth.txt"][..], &["rgb.txt"], &["depth.txt"], &[]] {
            let scene = Scene::with_pairs(2);
            for list in ["rgb.txt", "depth.txt"] {
                if !lists.contains(&list) {
                    scene.remove(list);
                }
            }
            scene.write("associations.txt", associations);
            if !lists.is_empty() {
                // The lists suffice: a picture that looks like the other kind does not mislead.
                super::save_grey(&scene.path("rgb/0.png"), SIZE, 0);
            }
            let recording = scene.open().unwrap();
            assert_eq!((recording.len(), recording.has_depth()), (2, true));
            assert_eq!(times_ns(&recording), [0, 100_000_000]);
            assert_eq!(color_of(&recording, 1).unwrap().rgb[..3], [1, 100, 200]);
            assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 2.0);
        }
    }
}

#[test]
fn one_readable_picture_tells_the_columns() {
    let scene = Scene::with_pairs(2);
    scene.remove("rgb.txt");
    scene.remove("depth.txt");
    scene.write("associations.txt", "1.0 depth/0.png 1.0 rgb/0.png\n1.1 depth/1.png 1.1 rgb/1.png\n");
    scene.remove("depth/0.png");
    scene.remove("rgb/0.png");
    scene.remove("depth/1.png");
    let recording = scene.open().unwrap();
    assert_eq!(color_of(&recording, 1).unwrap().rgb[..3], [1, 100, 200]);
    assert_says(color_of(&recording, 0), &["associations.txt:1: rgb/0.png:", "no such file"]);
}

#[test]
fn grey_columns_cannot_be_told_apart() {
    let scene = Scene::with_pairs(1);
    scene.remove("rgb.txt");
    scene.remove("depth.txt");
    scene.write("associations.txt", "1.0 depth/0.png 1.0 depth/0.png\n");
    assert_says(scene.open(), &["associations.txt: cannot tell colour from depth"]);
}

#[test]
fn every_nanosecond_of_a_date_counts() {
    let scene = Scene::with_pairs(3);
    scene.remove("depth.txt");
    scene.write(
        "rgb.txt",
        "1305031102.175304000 rgb/0.png\n1305031102.175304001 rgb/1.png\n1305031102.175304003 rgb/2.png\n",
    );
    let recording = scene.open().unwrap();
    assert_eq!(times_ns(&recording), [0, 1, 3]);
    assert_eq!(recording.period_ns(), 2);
}

#[test]
fn the_period_is_the_median_or_that_of_30_frames_per_second() {
    let scene = Scene::with_pairs(4);
    scene.remove("depth.txt");
    scene.write("rgb.txt", "1.0 rgb/0.png\n1.04 rgb/1.png\n1.08 rgb/2.png\n9.0 rgb/3.png\n");
    assert_eq!(scene.open().unwrap().period_ns(), 40_000_000);
    scene.write("rgb.txt", "1.0 rgb/0.png\n");
    assert_eq!(scene.open().unwrap().period_ns(), 33_333_333);
}

#[test]
fn depth_follows_the_scale_and_the_value_for_unknown() {
    let scene = Scene::with_pairs(1);
    let options = Options { depth_scale: Some(1000.0), ..Options::default() };
    let read = |options: &Options| depth_of(&scene.open_with(options).unwrap(), 0).unwrap().metres;
    assert!(read(&options).iter().all(|&metres| metres == 5.0));
    assert!(read(&Options { depth_invalid: Some(5000), ..options.clone() }).iter().all(|&metres| metres == 0.0));
    scene.depth("depth/0.png", SIZE, 0);
    assert!(read(&options).iter().all(|&metres| metres == 0.0));
    for depth_scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_says(
            scene.open_with(&Options { depth_scale: Some(depth_scale), ..options.clone() }),
            &["depth scale", "units per metre"],
        );
    }
}

#[test]
fn depth_has_any_number_of_pixels_of_the_same_view() {
    let scene = Scene::with_pairs(1);
    scene.color("rgb/0.png", (640, 480), 0);
    for size in [(640, 480), (320, 240), (160, 120), (213, 160), (100, 75)] {
        scene.depth("depth/0.png", size, 5000);
        assert_eq!(depth_of(&scene.open().unwrap(), 0).unwrap().size(), size);
    }
    for size in [(1280, 960), (640, 481), (641, 480)] {
        scene.depth("depth/0.png", size, 5000);
        let depth = depth_of(&scene.open().unwrap(), 0).unwrap();
        assert_eq!((depth.size(), depth.metres[0]), ((640, 480), 1.0), "larger ones are reduced: {size:?}");
    }
    for size in [(640, 360), (320, 180), (480, 640), (640, 640)] {
        scene.depth("depth/0.png", size, 5000);
        for (fit, fitted) in
            [(Fit::Stretch, size), (Fit::Crop, (size.0.min(size.1 * 4 / 3), size.1.min(size.0 * 3 / 4)))]
        {
            let options = Options { depth_fit: Some(fit), ..Options::default() };
            let expected = (fitted.0.min(640), fitted.1.min(480));
            assert_eq!(depth_of(&scene.open_with(&options).unwrap(), 0).unwrap().size(), expected, "{size:?} {fit:?}");
        }
        let (width, height) = size;
        assert_says(
            depth_of(&scene.open().unwrap(), 0),
            &["depth.txt:1: depth/0.png", &format!("{width}x{height}"), "640x480"],
        );
    }
}

#[test]
fn a_million_lines_open_without_reading_their_pictures() {
    let scene = Scene::with_pairs(1);
    let list = |folder: &str| {
        (0..1_000_000).map(|index| format!("{}.{:02} {folder}/0.png\n", index / 30, index % 30 * 3)).collect::<String>()
    };
    scene.write("rgb.txt", list("rgb"));
    scene.write("depth.txt", list("depth"));
    let recording = scene.open().unwrap();
    assert_eq!(recording.len(), 1_000_000);
    assert_eq!(depth_of(&recording, 999_999).unwrap().metres[0], 1.0);
}
