//! Depth maps in a folder of their own, one for each picture of a folder or frame of a video; and the focus in relative
//! depth.

use std::fs;
use std::path::Path;
use std::process::Command;

use bokehcam::engine::still;
use bokehcam::frame::ColorImage;
use bokehcam::frame::transform::{Flip, Rotation, Transform};
use bokehcam::look::{Look, LookFacts, Metres, Strength};
use bokehcam::optics::CocField;
use bokehcam_live::source::options::Depth;
use bokehcam_live::source::photo::read_depth_file;
use bokehcam_media::recording::DepthUnit;
use bokehcam_media::recording::still::{read_color, write_color};

use crate::common::color;
use crate::program::{Home, Ran};

const SIZE: (u32, u32) = (96, 64);
const FRAMES: usize = 5;

/// Returns the picture of a frame: a fine checkerboard whose shade grows.
fn picture(frame: usize) -> ColorImage {
    color(SIZE.0, SIZE.1, |x, y| [if (x / 2 + y / 2) % 2 == 0 { 60 + 30 * frame as u8 } else { 20 }; 3])
}

/// Creates the folder `shots` of pictures.
fn with_pictures(names: impl Fn(usize) -> String) -> Home {
    let home = Home::new();
    fs::create_dir(home.path("shots")).unwrap();
    for frame in 0..FRAMES {
        write_color(&home.path("shots").join(names(frame)), &picture(frame), false).unwrap();
    }
    home
}

/// Writes a map of 16 bits: 1000 in the left half, and more with each frame in the right one.
fn write_map(path: &Path, frame: usize) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let value = |x: u32| if x < SIZE.0 / 2 { 1000 } else { 2000 + 1000 * frame as u16 };
    image::ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, _| image::Luma([value(x)])).save(path).unwrap();
}

fn stream(home: &Home, arguments: &[&str]) -> Ran {
    home.run(&[&["stream"], arguments, &["--backend", "cpu", "--force", "--focus", "0.2,0.5"]].concat())
}

fn frames(home: &Home, folder: &str) -> Vec<ColorImage> {
    (0..FRAMES).map(|frame| read_color(&home.path(folder).join(format!("{frame:06}.png"))).unwrap()).collect()
}

/// Whether a place, as fractions of width and height, is in a part of the picture.
type Region = fn(f32, f32) -> bool;

#[test]
fn maps_are_turned_flipped_and_cut_as_their_pictures_are() {
    let home = with_pictures(|frame| format!("{frame}.png"));
    (0..FRAMES).for_each(|frame| write_map(&home.path("maps").join(format!("{frame}.png")), frame));
    let turned = |rotation, flip| Transform { rotation, flip, area: None }.transform_color(picture(2));
    let half = color(SIZE.0 / 2, SIZE.1, |x, y| [if (x / 2 + y / 2) % 2 == 0 { 120 } else { 20 }; 3]);
    // The left half is near, and in focus.
    let cases: [(&[&str], ColorImage, Region); 4] = [
        (&[], picture(2), |x, _| x < 0.5),
        (&["--flip", "horizontal"], turned(Rotation::None, Flip::Horizontal), |x, _| x > 0.5),
        (&["--rotate", "90"], turned(Rotation::Quarter, Flip::None), |_, y| y < 0.5),
        (&["--crop", "48x64+0+0"], half, |_, _| true),
    ];
    for (options, expected, is_near) in cases {
        let depth =
            ["--depth", "maps", "--depth-unit", "millimetres", "--focus", "1", "--blur", "6", "--refine", "off"];
        let ran = home
            .run(&[&["stream", "shots", "--to", "out/", "--force", "--backend", "cpu"], &depth[..], options].concat());
        ran.done();
        let shown = frames(&home, "out").swap_remove(2);
        assert_eq!(shown.size(), expected.size(), "{options:?}");
        let (width, height) = (shown.width as usize, shown.height as usize);
        // Pixels by whether they are near, and whether they have changed.
        let mut counts = [[0; 2]; 2];
        for (at, (found, own)) in shown.rgb.as_chunks::<3>().0.iter().zip(expected.rgb.as_chunks::<3>().0).enumerate() {
            let is_near = is_near((at % width) as f32 / width as f32, (at / width) as f32 / height as f32);
            counts[usize::from(is_near)][usize::from(found != own)] += 1;
        }
        let [far, near] = counts;
        assert!(near[1] * 20 < near[0] && far[1] >= far[0], "{options:?}: {near:?} near, {far:?} far");
    }
}

#[test]
fn each_picture_has_the_map_of_its_name_as_if_it_were_beside_it() {
    let home = with_pictures(|frame| format!("IMG_{:04}.png", 7 + frame));
    let map = |folder: &str, frame: usize| home.path(folder).join(format!("IMG_{:04}.png", 7 + frame));
    for frame in 0..FRAMES {
        write_map(&map("maps", frame), frame);
        write_map(&map("shots-depth", frame), frame);
    }
    stream(&home, &["shots", "--to", "beside/"]).done();
    fs::rename(home.path("shots-depth"), home.path("elsewhere")).unwrap();
    let given = ["--depth", "maps", "--depth-unit", "millimetres"];
    for source in ["shots", "shots/IMG_%04d.png"] {
        let ran = stream(&home, &[&[source, "--to", "given/"], &given[..]].concat());
        assert!(ran.done().contains("maps: 5 depth maps by the names of the pictures"), "{}", ran.stderr);
        assert!(frames(&home, "beside") == frames(&home, "given"), "{source}");
    }
    // From the middle on, the frames have their own maps.
    stream(&home, &[&["shots", "--start", "0.08", "--to", "late/"], &given[..]].concat()).done();
    assert_eq!(
        fs::read_dir(home.path("late"))
            .unwrap()
            .filter(|entry| entry.as_ref().unwrap().path().extension().is_some())
            .count(),
        2
    );

    // A missing map is that frame's fault, and is said before.
    fs::remove_file(map("maps", 3)).unwrap();
    let missing = [&["shots", "--to", "cut/"], &given[..]].concat();
    let ran = stream(&home, &missing);
    ran.failed(1, &["maps/IMG_0010.png: ", "maps: pictures without a depth map: 1"]);
    let ran = stream(&home, &[&missing[..], &["--keep-going"]].concat());
    assert!(ran.code == 0 && ran.stderr.contains("maps/IMG_0010.png"), "{ran:?}");

    // In order, where names have nothing in common; then the number must be the same.
    for frame in [0, 1, 2, 4] {
        fs::rename(map("maps", frame), home.path(format!("maps/d{frame}.png"))).unwrap();
    }
    let ran = stream(&home, &[&missing[..], &["--keep-going"]].concat());
    assert!(ran.code == 0 && ran.stderr.contains("maps/d3.png"), "{ran:?}");
    fs::remove_file(home.path("maps/d4.png")).unwrap();
    stream(&home, &missing).failed(1, &["maps: 3 depth maps for 5 pictures"]);
    // Pictures that are not played need none.
    for played in [&["--frames", "3"][..], &["--end", "0.09"], &["--start", "0.05", "--frames", "1"]] {
        stream(&home, &[&missing[..], played].concat()).done();
    }
    stream(&home, &[&missing[..], &["--frames", "4"]].concat()).failed(1, &["maps: 3 depth maps for 4 pictures"]);
    fs::remove_dir_all(home.path("maps")).unwrap();
    fs::create_dir(home.path("maps")).unwrap();
    stream(&home, &missing).failed(1, &["maps"]);
}

#[test]
fn relative_maps_of_a_sequence_have_one_range() {
    let home = with_pictures(|frame| format!("{frame}.png"));
    fs::create_dir(home.path("maps")).unwrap();
    // Numbers of any scale, as networks write them; the second frame shows less of the range.
    for frame in 0..FRAMES {
        let right = if frame == 1 { 30.0 } else { 10.0 };
        let numbers = (0..SIZE.0 * SIZE.1).map(|at| if at % SIZE.0 < SIZE.0 / 2 { 50.0f32 } else { right });
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", SIZE.1, SIZE.0);
        let header = format!("{header:<117}\n");
        let file = [&b"\x93NUMPY\x01\0"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &bytes].concat();
        fs::write(home.path(format!("maps/{frame}.npy")), file).unwrap();
    }
    let arguments = ["shots", "--depth", "maps", "--depth-unit", "inverse", "--blur", "6", "--to", "out/"];
    stream(&home, &arguments).done();
    let contrast = |picture: &ColorImage| {
        let right = (0..SIZE.1).flat_map(|y| (70..90).map(move |x| (y * SIZE.0 + x) as usize * 3));
        let codes: Vec<u8> = right.map(|at| picture.rgb[at]).collect();
        f32::from(*codes.iter().max().unwrap() - *codes.iter().min().unwrap())
    };
    let blurred = frames(&home, "out");
    // Half the disparity, half the radius: the checks remain visible.
    assert!(
        contrast(&blurred[1]) > 2.0 * contrast(&blurred[0]).max(1.0),
        "{:?}",
        blurred.iter().map(contrast).collect::<Vec<_>>()
    );
}

#[test]
#[ignore = "needs ffmpeg"]
fn each_frame_of_a_video_has_its_map() {
    let home = with_pictures(|frame| format!("{frame}.png"));
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-i"]).arg(home.path("shots/%d.png"));
    Ran::of(ffmpeg.args(["-c:v", "libx264rgb", "-qp", "0"]).arg(home.path("clip.mp4"))).done();
    let maps = || (0..FRAMES).map(|frame| home.path(format!("maps/frame_{:04}.png", frame + 1)));
    maps().enumerate().for_each(|(frame, path)| write_map(&path, frame));
    // The focus follows with some inertia: a radius that shows, and not one that is nearly sharp.
    let given = ["--depth", "maps", "--depth-unit", "millimetres", "--coc-at-infinity", "12"];
    stream(&home, &[&["shots", "--to", "pictures/"], &given[..]].concat()).done();
    stream(&home, &[&["clip.mp4", "--to", "video/"], &given[..]].concat()).done();
    assert!(frames(&home, "pictures") == frames(&home, "video"));
    // A gap in the numbers is a missing map; the other frames keep theirs.
    fs::remove_file(maps().nth(2).unwrap()).unwrap();
    let ran = stream(&home, &[&["clip.mp4", "--keep-going", "--to", "video/"], &given[..]].concat());
    assert!(ran.code == 0 && ran.stderr.contains("maps/frame_0003.png"), "{ran:?}");
    let (whole, cut) =
        (frames(&home, "pictures"), |at: usize| read_color(&home.path(format!("video/{at:06}.png"))).unwrap());
    assert!(whole[1] == cut(1) && whole[3] == cut(2) && whole[4] == cut(3));
    fs::remove_file(maps().nth(4).unwrap()).unwrap();
    let short = [&["clip.mp4", "--to", "video/"], &given[..]].concat();
    stream(&home, &short).failed(1, &["maps: 3 depth maps for 5 pictures"]);
    stream(&home, &[&short[..], &["--frames", "2"]].concat()).done();
    stream(&home, &[&short[..], &["--fps", "10"]].concat()).refused(2, &["--fps changes the number of frames"]);
}

#[test]
fn a_focus_without_metres_is_a_place_and_refocusing_keeps_the_lens() {
    let home = Home::new();
    let (width, height) = (240u32, 160);
    // Three bands of nearness 1, 1/2 and 0.
    let checks = color(width, height, |x, y| [if (x / 2 + y / 2) % 2 == 0 { 200 } else { 40 }; 3]);
    write_color(&home.path("in.png"), &checks, false).unwrap();
    let codes = |x: u32| [255, 128, 1][(3 * x / width) as usize];
    image::GrayImage::from_fn(width, height, |x, _| [codes(x)].into()).save(home.path("map.png")).unwrap();
    let given = ["render", "in.png", "--depth-map", "map.png", "--backend", "cpu", "--force"];
    let inverse = Depth { depth_unit: Some(DepthUnit::Inverse), ..Depth::default() };
    let map = read_depth_file(&home.path("map.png"), &inverse, (width, height)).unwrap().map;
    for focus in ["0", "0.25", "0.5", "1"] {
        let wanted = ["--depth-unit", "inverse", "--blur", "8", "--focus", focus, "--out", "out.png"];
        let ran = home.run(&[&given[..], &wanted].concat());
        let note = format!("--focus {focus}: a place in relative depth, from 0 (nearest) to 1 (farthest)");
        assert!(ran.done().contains(&note), "{}", ran.stderr);
        let look = Look { focus: focus.parse().unwrap(), strength: Strength::AtInfinity(8.0), ..Look::default() };
        let facts =
            LookFacts { has_depth: true, metres: Metres::Missing, size: (width, height), ..LookFacts::default() };
        let look = look.for_source(&facts);
        let measured = still::Depth::Measured(map.clone());
        let (field, map) = still::compute_coc_and_depth(&look, &mut checks.clone(), Some(measured), Some(1)).unwrap();
        let CocField::Depth(lens) = field else { panic!("{field:?}") };
        let radii_px = map.unwrap().metres.into_iter().map(|metres| f64::from(lens.coc_px(metres)));
        let (low, high) = radii_px.fold((0.0, 0.0), |(low, high): (f64, f64), px| (low.min(px), high.max(px)));
        let place: f64 = focus.parse().unwrap();
        assert!(
            (low + 8.0 * place).abs() < 0.1 && (high - 8.0 * (1.0 - place)).abs() < 0.1,
            "{focus}: {low} to {high}"
        );
    }
    let refused = |arguments: &[&str], said: &str| {
        let ran = home.run(&[&given[..], arguments, &["--out", "no.png"]].concat());
        ran.refused(2, &[said]);
    };
    refused(&["--depth-unit", "inverse", "--focus", "1.5"], "use --focus auto, X,Y or a place from 0 (nearest) to 1");
    // Metres stay metres.
    refused(&["--depth-unit", "scale:100", "--focus", "0"], "--focus 0: use METRES above 0");
    let metric = home.run(&[&given[..], &["--depth-unit", "scale:100", "--focus", "0.5", "--out", "out.png"]].concat());
    assert!(metric.code == 0 && !metric.stderr.contains("a place"), "{metric:?}");
}

#[test]
fn a_map_gives_the_same_picture_whether_it_is_found_or_named() {
    let home = Home::new();
    let portrait = |name: &str| format!("{}/{name}/000000.png", crate::program::PORTRAIT);
    fs::copy(portrait("rgb"), home.path("a.png")).unwrap();
    // One that fits, and one that does not: it has fewer pixels.
    for is_small in [false, true] {
        let map = image::open(portrait("depth")).unwrap();
        let map = if is_small { map.resize(160, 90, image::imageops::FilterType::Nearest) } else { map };
        map.save(home.path("a-depth.png")).unwrap();
        let run = |arguments: &[&str]| {
            home.run(&[arguments, &["--backend", "cpu", "--quality", "draft", "--force"]].concat()).done();
        };
        run(&["render", "a.png", "--out", "found.png"]);
        run(&["render", "a.png", "--depth-map", "a-depth.png", "--out", "named.png"]);
        run(&["stream", "a.png", "--to", "streamed/"]);
        let [found, named, streamed] =
            ["found.png", "named.png", "streamed/000000.png"].map(|name| read_color(&home.path(name)).unwrap());
        assert!(found == named, "small: {is_small}");
        assert!(found == streamed, "small: {is_small}");
    }
}
