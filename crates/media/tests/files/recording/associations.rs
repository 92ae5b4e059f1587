//! Lists that pair colour with depth, as people name and make them.

use super::{SIZE, Scene, assert_says, color_of, depth_of};

/// Creates two pairs without lists.
fn without_lists() -> Scene {
    let scene = Scene::with_pairs(2);
    scene.remove("rgb.txt");
    scene.remove("depth.txt");
    scene
}

const PAIRS: [&str; 2] = ["1.0 rgb/0.png 1.01 depth/0.png", "1.1 rgb/1.png 1.11 depth/1.png"];
const POSE: &str = "1.005 1.3405 0.6266 1.6575 0.6574 0.6126 -0.2949 -0.3248";

#[test]
fn the_usual_names_are_known() {
    for name in ["association.txt", "associate.txt", "associated.txt", "assoc.txt", "rgbd_assoc.txt"] {
        let scene = without_lists();
        scene.write("groundtruth.txt", format!("# ground truth\n{POSE}\n"));
        scene.write(name, PAIRS.join("\n"));
        let recording = scene.open().unwrap();
        assert_eq!((recording.layout(), recording.len()), ("TUM RGB-D", 2), "{name}");
        assert_eq!(color_of(&recording, 1).unwrap().rgb[0], 1);
        assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 2.0);
        // Its own name is in messages.
        scene.write(name, format!("{}\nsoon rgb/1.png 1.11 depth/1.png\n", PAIRS[0]));
        assert_says(scene.open(), &[&format!("{name}:2:"), "\"soon\" is not a time"]);
    }
    // The first of several names counts.
    let scene = without_lists();
    scene.write("associations.txt", PAIRS[1]);
    scene.write("assoc.txt", PAIRS.join("\n"));
    assert_eq!(scene.open().unwrap().len(), 1);
}

/// As ORB-SLAM names them.
#[test]
fn any_other_name_counts_if_it_is_the_only_list_of_pairs() {
    let scene = without_lists();
    scene.write("accelerometer.txt", "1.0 0.1 9.8 0.2\n1.1 0.1 9.8 0.2\n");
    scene.write("fr1_desk.txt", format!("# made by associate.py\n{}", PAIRS.join("\n")));
    assert_eq!(scene.open().unwrap().len(), 2);
    // Two of them are ambiguous.
    scene.write("fr1_desk2.txt", PAIRS[0]);
    assert_says(scene.open(), &["fr1_desk.txt and fr1_desk2.txt both pair pictures", "associations.txt"]);
    // The benchmark's own lists are preferred.
    scene.write("rgb.txt", "1.0 rgb/0.png\n");
    scene.remove("fr1_desk2.txt");
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.has_depth()), (1, false));
    // A folder full of texts holds poses.
    let scene = without_lists();
    scene.write("fr1_desk.txt", PAIRS[0]);
    (0..8).for_each(|index| scene.write(&format!("{index}.pose.txt"), POSE));
    assert!(scene.open().map_or(true, |recording| recording.layout() != "TUM RGB-D"));
}

#[test]
fn a_pose_before_or_after_the_pair_is_skipped() {
    let depth_first = PAIRS.map(|pair| {
        let columns: Vec<&str> = pair.split(' ').collect();
        [&columns[2..], &columns[..2]].concat().join(" ")
    });
    for pairs in [PAIRS.map(str::to_owned), depth_first] {
        for line in [|pair: &String| format!("{pair} {POSE}\n"), |pair: &String| format!("{POSE} {pair}\n")] {
            let scene = without_lists();
            scene.write("associations.txt", pairs.iter().map(line).collect::<String>());
            let recording = scene.open().unwrap();
            assert_eq!(recording.len(), 2);
            assert_eq!(color_of(&recording, 1).unwrap().rgb[..3], [1, 100, 200]);
            assert_eq!(depth_of(&recording, 1).unwrap().size(), SIZE);
        }
    }
}

#[test]
fn other_columns_are_named_with_their_line() {
    let no_files = format!("{POSE} 1.0 2.0 1.1 3.0");
    for (line, found) in [("1.0 rgb/0.png", 2), (POSE, 8), (no_files.as_str(), 12)] {
        let scene = without_lists();
        scene.write("associations.txt", format!("{}\n{line}\n", PAIRS[0]));
        assert_says(scene.open(), &["associations.txt:2:", "time file time file", &format!("found {found} column")]);
    }
}
