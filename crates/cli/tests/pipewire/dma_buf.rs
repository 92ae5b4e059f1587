//! Cameras as libcamera serves them: padded rows, DMA-BUFs, one size.

use std::path::Path;

use super::own_memory::{DMA_BUF, Layout, MEM_FD, NAME, OwnMemory, SIZE};
use super::session::{Run, folder, until};

const PLAIN: Layout = Layout { types: MEM_FD, stride: SIZE.0, in_two_planes: false, is_faulty: false };
/// libcamera's processing on GPUs pads rows so.
const PADDED: usize = 2048;

/// Reads `frames` pictures; returns what is in them, and the number of damaged ones.
fn read(layout: Layout, frames: usize) -> (Vec<Vec<u8>>, u64, OwnMemory) {
    let camera = OwnMemory::start(layout);
    let folder = tempfile::tempdir().unwrap();
    let to = format!("{}/", folder.path().display());
    let source = format!("pipewire:{NAME}");
    let count = frames.to_string();
    let mut run = Run::start(&["stream", &source, "--effect", "none", "--frames", &count, "--to", &to]);
    until("the pictures", || run.is_over().then_some(()));
    let report = run.ended();
    let told = report["source"].as_str().unwrap();
    assert!(told.contains(&format!("{}x{} NV12", SIZE.0, SIZE.1)), "{told}");
    let files = std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().path());
    let pictures = files.filter(|file| file.extension().is_some_and(|extension| extension == "png"));
    (
        pictures.map(|picture| decode(&picture)).collect(),
        report["frames"]["dropped"]["corrupt"].as_u64().unwrap(),
        camera,
    )
}

fn decode(path: &Path) -> Vec<u8> {
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes
}

/// Returns the picture of a camera without padding.
fn plain() -> Vec<u8> {
    let (pictures, corrupt, _) = read(PLAIN, 3);
    assert_eq!(corrupt, 0);
    let picture = pictures[0].clone();
    let [first, last] = [&picture[..3], &picture[picture.len() - 3..]];
    assert!(picture.len() == 3 * SIZE.0 * SIZE.1 && first != last, "{first:?}, {last:?}");
    picture
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn padded_rows_and_dma_bufs_give_the_same_picture() {
    folder();
    let plain = plain();
    for types in [DMA_BUF, MEM_FD] {
        for in_two_planes in [false, true] {
            let layout = Layout { types, stride: PADDED, in_two_planes, is_faulty: false };
            let (pictures, corrupt, camera) = read(layout, 10);
            assert!(!pictures.is_empty() && pictures.iter().all(|picture| *picture == plain), "{layout:?}");
            assert_eq!((corrupt, camera.asked_types() & (MEM_FD | DMA_BUF)), (0, types), "{layout:?}");
        }
    }
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_camera_that_has_both_is_asked_for_memory() {
    folder();
    let plain = plain();
    let (pictures, _, camera) = read(Layout { types: MEM_FD | DMA_BUF, stride: PADDED, ..PLAIN }, 10);
    assert!(pictures.iter().all(|picture| *picture == plain));
    assert_eq!(camera.asked_types() & (MEM_FD | DMA_BUF), MEM_FD);
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn damaged_pictures_are_counted_and_the_others_are_right() {
    folder();
    let plain = plain();
    for in_two_planes in [false, true] {
        let layout = Layout { types: DMA_BUF, stride: PADDED, in_two_planes, is_faulty: true };
        let (pictures, corrupt, _) = read(layout, 40);
        assert!(corrupt > 20, "{corrupt}");
        assert!(pictures.len() > 3 && pictures.iter().all(|picture| *picture == plain), "{layout:?}");
    }
}
