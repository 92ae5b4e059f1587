//! Compares the open networks with a depth sensor on a real sequence.

use std::path::{Path, PathBuf};

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_live::source::installed::find_best_in;
use bokehcam_media::recording::{Options, Recording, Scratch};
use bokehcam_networks::network::{KNOWN_NETWORKS, Task, Tensor};
use bokehcam_networks::single_camera::{Hints, SingleCamera};

use super::read;
use crate::program::Home;

/// Returns masks of the person's and the wall's pixels by sensor depth, at least three pixels from anything else.
pub fn sure(depth: &DepthMap) -> (Vec<bool>, Vec<bool>) {
    let (width, height) = (depth.width as usize, depth.height as usize);
    let within = |range: std::ops::Range<f32>| {
        let all = |x: usize, y: usize| {
            x >= 3
                && y >= 3
                && x + 3 < width
                && y + 3 < height
                && (y - 3..=y + 3)
                    .all(|y| depth.metres[y * width + x - 3..=y * width + x + 3].iter().all(|m| range.contains(m)))
        };
        (0..width * height).map(|at| all(at % width, at / width)).collect()
    };
    (within(0.4..1.5), within(2.0..4.0))
}

fn data() -> PathBuf {
    PathBuf::from(std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data"))
}

/// Returns the file of the best known network for a task in the test data.
pub fn model(task: Task) -> PathBuf {
    find_best_in(vec![data().join("models")], task).unwrap()
}

/// A real RGB-D sequence of a turning person.
pub struct Sequence(Recording);

impl Sequence {
    pub fn open() -> Self {
        let options = Options { depth_scale: Some(1000.0), ..Options::default() };
        Self(Recording::open(&data().join("rgbd/person_turning"), &options).unwrap())
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn frame(&self, index: usize) -> (ColorImage, DepthMap) {
        let (mut scratch, mut color, mut depth) = (Scratch::default(), ColorImage::default(), DepthMap::default());
        self.0.read_color(index, &mut scratch, &mut color).unwrap();
        self.0.read_depth(index, &mut scratch, &mut depth).unwrap();
        (color, depth)
    }
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models and rgbd/person_turning"]
fn a_real_person_is_found_and_what_rests_rests() {
    let (matte, mono) = (model(Task::Matte), model(Task::Mono));
    let open = |matte: Option<&Path>, mono: Option<&Path>| SingleCamera::open(matte, mono, &Hints::default()).unwrap();
    let sequence = Sequence::open();
    let mut both = open(Some(&matte), Some(&mono));
    let mut relief = open(None, Some(&mono));
    let mut last: Option<(Vec<f32>, Vec<bool>, Vec<bool>)> = None;
    let (mut joint, mut any, mut rest, mut resting) = (0u64, 0u64, [0.0f64; 2], [0u64; 2]);
    let (mut ordered, mut pairs) = (0u64, 0u64);
    for index in 0..sequence.len() {
        let (color, depth) = sequence.frame(index);
        let (person, wall) = sure(&depth);
        let map = read(&mut both, &color, index as u64);
        let mut shares: Vec<f32> = map.metres.iter().map(|&metres| f32::from(u8::from(metres <= 1.0))).collect();
        map.matte.pixels.iter().for_each(|pixel| shares[pixel.at as usize] = pixel.alpha);
        for at in 0..shares.len() {
            joint += u64::from(person[at] && shares[at] > 0.5);
            any += u64::from(person[at] || wall[at] && shares[at] > 0.5);
        }
        if let Some((before, person_before, wall_before)) = &last {
            for at in 0..shares.len() {
                for (k, (now, then)) in [(&wall, wall_before), (&person, person_before)].into_iter().enumerate() {
                    if now[at] && then[at] {
                        rest[k] += f64::from((shares[at] - before[at]).abs());
                        resting[k] += 1;
                    }
                }
            }
        }
        last = Some((shares, person.clone(), wall.clone()));
        let near = read(&mut relief, &color, index as u64).metres;
        let (of_person, of_wall): (Vec<f32>, Vec<f32>) = {
            let pick = |is: &[bool]| {
                is.iter().zip(&near).filter(|(is, _)| **is).step_by(97).map(|(_, metres)| *metres).collect()
            };
            (pick(&person), pick(&wall))
        };
        for near_m in &of_person {
            ordered += of_wall.iter().filter(|far_m| near_m < *far_m).count() as u64;
            pairs += of_wall.len() as u64;
        }
    }
    let (overlap, order) = (joint as f64 / any as f64, ordered as f64 / pairs as f64);
    let flicker = [0, 1].map(|k| 1e3 * rest[k] / resting[k] as f64);
    eprintln!("overlap {overlap:.4}, flicker of wall and person {flicker:.3?}e-3, order of pairs {order:.4}");
    assert!(overlap >= 0.998 && flicker[0] <= 0.3 && order >= 0.99, "{overlap} {flicker:?} {order}");
}

/// With an installed network, every command blurs a photo of a person as a portrait.
#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models and rgbd/person_turning"]
fn a_photo_alone_has_the_depth_of_the_installed_network_in_every_command() {
    let home = Home::new();
    home.run(&["models", "add", model(Task::Matte).to_str().unwrap()]).done();
    let (color, _) = Sequence::open().frame(0);
    bokehcam_media::recording::still::write_color(&home.path("photo.png"), &color, false).unwrap();
    let ran = home.run(&["render", "photo.png", "--out", "r.png", "--backend", "cpu"]);
    let said = ran.done();
    assert!(said.contains("depth by selfie-landscape") && !said.contains("warning"), "{said}");
    home.run(&["stream", "photo.png", "--to", "s/", "--backend", "cpu"]).done();
    let read = |name: &str| bokehcam_media::recording::still::read_color(&home.path(name)).unwrap();
    assert!(read("r.png") == read("s/000000.png"));
}

/// A picture without a person costs a warning.
#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models and rgbd/person_turning"]
fn nobody_in_a_picture_is_said() {
    let home = Home::new();
    for task in [Task::Matte, Task::Mono] {
        home.run(&["models", "add", model(task).to_str().unwrap()]).done();
    }
    bokehcam_media::recording::still::write_color(&home.path("0.png"), &ColorImage::new(320, 240), false).unwrap();
    for depth in ["auto", "matte", "matte,mono"] {
        let ran = home.run(&["render", "0.png", "--depth", depth, "--out", "x.png", "--force"]);
        assert!(ran.warning().contains("no person was found in the picture"), "{depth}: {}", ran.stderr);
    }
}

fn shipped() -> PathBuf {
    let folder = std::env::var_os("TEST_MODELS").expect("TEST_MODELS names the folder of the network");
    PathBuf::from(folder).join(KNOWN_NETWORKS[0].file)
}

fn load(file: &Path) -> bokehcam_networks::network::Network {
    bokehcam_networks::network::load(file).unwrap().network
}

#[test]
#[ignore = "needs the network for persons, as `scripts/setup models` brings it"]
fn what_the_package_brings_is_installed_and_sees_nobody_in_a_grey_wall() {
    let home = Home::new();
    home.run(&["models", "add", shipped().to_str().unwrap()]).done();
    let mut network = load(&home.path("data/bokehcam/models").join(KNOWN_NETWORKS[0].file));
    let shape = vec![1, 144, 256, 3];
    let mut mask = Vec::new();
    network.run(&[Tensor { values: vec![0.5; 144 * 256 * 3], shape }], &mut mask).unwrap();
    assert_eq!(mask[0].shape, [1, 144, 256, 1]);
    assert!(mask[0].values.iter().all(|share| (0.0..0.5).contains(share)));
}

/// The packaged network, run by our own code, matches the library's result for the same weights.
#[test]
#[ignore = "needs BOKEHCAM_DATA and the network for persons, as `scripts/setup models` brings it"]
fn the_mask_of_what_the_package_brings_is_that_of_the_library() {
    let (mut ours, mut library) = (load(&shipped()), load(&model(Task::Matte)));
    assert_ne!(ours.runtime, library.runtime);
    let shape = [1, 144, 256, 3];
    assert_eq!(ours.inputs[0].shape, shape.map(Some));
    let sequence = Sequence::open();
    let (mut masks, mut largest) = ([Vec::new(), Vec::new()], 0.0f32);
    for index in (0..sequence.len()).step_by(4) {
        let (color, _) = sequence.frame(index);
        let at = |k: usize| {
            (k / 3 / 256 * color.height as usize / 144) * color.width as usize
                + k / 3 % 256 * color.width as usize / 256
        };
        let values = (0..144 * 256 * 3).map(|k| f32::from(color.rgb[3 * at(k) + k % 3]) / 255.0).collect();
        let input = [Tensor { shape: shape.to_vec(), values }];
        ours.run(&input, &mut masks[0]).unwrap();
        library.run(&input, &mut masks[1]).unwrap();
        let [ours, library] = [&masks[0][0].values, &masks[1][0].values];
        assert!(ours.len() == library.len() && ours.iter().any(|&share| share > 0.99));
        largest = ours.iter().zip(library).map(|(a, b)| (a - b).abs()).fold(largest, f32::max);
    }
    assert!(largest < 1e-3, "{largest}");
}
