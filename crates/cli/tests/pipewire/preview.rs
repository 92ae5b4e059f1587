//! A virtual camera of the preview's session, while the user changes sources.

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam::look::Look;
use bokehcam_live::source::{Frames, Options};
use bokehcam_window::state::{Output, Request, Source, Update};
use bokehcam_window::system::System;

use super::heard::Heard;
use super::readers::GStreamer;
use super::session::{SIZE, folder, until};
use super::store::NoStore;

/// Creates a recording of pictures in one colour.
fn plain_recording(folder: &Path, name: &str, (width, height): (u32, u32), rgb: [u8; 3]) -> PathBuf {
    let folder = folder.join(name);
    fs::create_dir_all(folder.join("rgb")).unwrap();
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(rgb));
    let mut list = String::new();
    for number in 0..4 {
        picture.save(folder.join(format!("rgb/{number}.png"))).unwrap();
        list += &format!("{:.6} rgb/{number}.png\n", f64::from(number) / 30.0);
    }
    fs::write(folder.join("rgb.txt"), list).unwrap();
    folder
}

#[test]
#[ignore = "needs PipeWire (crates/cli/tests/pipewire/session)"]
fn a_reader_gets_the_pictures_of_thirty_sources_one_after_the_other() {
    folder();
    let place = tempfile::tempdir().unwrap();
    // Dark and bright; the second one is letterboxed into the first one's size.
    let sources = [(SIZE, [20; 3]), ((200, 200), [220; 3])];
    let names: Vec<String> = sources
        .iter()
        .enumerate()
        .map(|(at, (size, rgb))| plain_recording(place.path(), &format!("r{at}"), *size, *rgb).display().to_string())
        .collect();
    let options = Options { frames: Frames { repeat: true, ..Frames::default() }, ..Options::default() };
    let system = System::new(options, Look::default(), Box::new(NoStore));
    let mut session = Heard::begin(Box::new(system), &names[0], place.path());
    session.until("it runs", |told| matches!(told, Update::Source(Source::Running(_))));
    session.session.send(Request::StartOutput(Output { name: "pipewire:Changing".into(), is_camera: true }));
    session.until("it is there", |told| matches!(told, Update::Outputs(outputs) if outputs.len() == 1));
    let mut reader = GStreamer::start("changing", 1_000_000);
    let is_bright = |frame: &Vec<u8>| frame[frame.len() / 2 - SIZE.0 as usize] > 128;
    until("the first pictures", || reader.frames().last().is_some_and(|last| !is_bright(last)).then_some(()));
    session.until("a call", |told| *told == Update::Watched(true));
    for round in 1..=30 {
        session.session.send(Request::Open(names[round % 2].clone()));
        until("pictures of the next source", || {
            (reader.frames().last().is_some_and(is_bright) == (round % 2 == 1)).then_some(())
        });
        assert!(reader.is_reading());
    }
    drop(reader);
    session.until("no call", |told| *told == Update::Watched(false));
    session.session.close();
}
