//! Sources of the preview's session: seeking in a recording, photos, offered sources, and hot-plugged devices.
#![allow(missing_docs)]

use crate::heard;
mod plug;
use crate::store;

use std::path::Path;
use std::sync::atomic::Ordering;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{Look, Strength};
use bokehcam_live::source::{self, Options, SourceName};
use bokehcam_media::recording::{snapshot, still};
use bokehcam_window::state::{Output, Request, Source, Update};

use plug::*;

#[test]
fn a_recording_is_sought_in_while_it_plays_and_what_is_written_stays_whole() {
    let (recording, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    record(recording.path());
    let mut watched = Watched::begin(&recording.path().display().to_string(), folder.path());
    watched.frame("a frame", |_| true);
    let seeker = watched.seeker.clone().expect("a recording is gone back and forth in");
    assert_eq!((seeker.frames(), seeker.length_ns()), (FRAMES, FRAMES as u64 * 40_000_000));
    let film = folder.path().join("film.y4m");
    let output = Output { name: film.display().to_string(), is_camera: false };
    watched.session.send(Request::StartOutput(output.clone()));
    let mut last_ns = 0;
    for place in [8, 3, 11, 0, 11] {
        let number = seeker.request_frame(place);
        let asked = watched.frame("the frame that was asked for", |view| view.is_seek_target && view.seek == number);
        assert_eq!(seeker.position_of(asked.stamp), place);
        let rgb = asked.picture.memory().unwrap().rgb[0];
        assert!(rgb.abs_diff(20 * place as u8) <= 1, "{rgb} of frame {place}");
        let metres = asked.depth.as_ref().unwrap().metres[5];
        // Refined, but from this frame alone.
        assert!((metres - 2.0 - 0.1 * place as f32).abs() < 0.02, "{metres} m of frame {place}");
        let asked_ns = asked.stamp.time_ns;
        assert!(asked_ns > last_ns, "media time goes on");
        drop(asked);
        let after = watched.frame("those after it", |view| !view.is_seek_target && view.seek == number);
        last_ns = after.stamp.time_ns;
        assert!(last_ns > asked_ns, "{:?}", after.stamp);
        // A busy machine leaves frames out.
        let steps = (last_ns - asked_ns) as usize / 40_000_000;
        assert_eq!(seeker.position_of(after.stamp), (place + steps) % FRAMES, "{:?}", after.stamp);
    }
    watched.session.send(Request::StopOutput(output));
    let closed = watched.heard.session.close();
    assert_eq!(closed.output_error, None);
    assert!(closed.report.unwrap().frames.is_balanced());
    assert!(film.metadata().unwrap().len() > 48 * 32 * 3 / 2, "the film is there");
}

#[test]
fn what_never_ends_has_no_places() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::begin("synthetic", folder.path());
    watched.frame("a frame", |_| true);
    assert!(watched.seeker.is_none());
    watched.heard.session.close();
}

fn is_running(told: &Update) -> bool {
    matches!(told, Update::Source(Source::Running(_)))
}

#[test]
fn a_photo_is_opened_with_the_depth_beside_it_and_follows_the_look() {
    let folder = tempfile::tempdir().unwrap();
    let (mut color, mut depth) = (ColorImage::new(40, 30), DepthMap::new(40, 30));
    for (at, pixel) in color.rgb.chunks_exact_mut(3).enumerate() {
        pixel.fill(if at % 40 < 20 { 40 } else { 200 });
        depth.metres[at] = if at % 40 < 20 { 1.0 } else { 4.0 };
    }
    let photo = folder.path().join("holiday.jpg");
    still::write_color(&photo, &color, false).unwrap();
    still::write_depth(&folder.path().join("holiday-depth.png"), &depth, 1000.0, false).unwrap();
    let name = photo.display().to_string();
    let mut watched = Watched::begin(&name, folder.path());
    watched.until("what it is", |told| {
        matches!(told, Update::Note(line) if line.contains("a photo, a single still \
        frame") && line.contains("its own depth"))
    });
    let Update::Source(Source::Running(running)) = watched.until("it runs", is_running) else { unreachable!() };
    assert!(running.size == (40, 30) && running.has_depth);
    let first = watched.frame("a frame", |_| true);
    let map = first.depth.as_ref().unwrap();
    assert!((map.metres[15 * 40 + 5] - 1.0).abs() < 0.05 && (map.metres[15 * 40 + 35] - 4.0).abs() < 0.2);
    let change = first.change;
    drop(first);
    let stronger = Look { strength: Strength::AtInfinity(5.0), ..Look::default() };
    watched.session.send(Request::Look(Box::new(stronger)));
    watched.frame("another look", |view| view.change > change && !view.is_transitional);
    assert!(watched.heard.session.close().report.unwrap().frames.is_balanced());

    // Other names, a snapshot, and files that are no photos.
    let open = |path: &Path| {
        let name: SourceName =
            path.display().to_string().parse().map_err(|error: source::SourceError| error.to_string())?;
        source::Source::open(&name, &Options::default(), None).map_err(|error| error.to_string())
    };
    let other = folder.path().join("other.png");
    still::write_color(&other, &color, false).unwrap();
    assert!(!open(&other).unwrap().has_depth());
    std::fs::rename(folder.path().join("holiday-depth.png"), folder.path().join("other.depth.png")).unwrap();
    assert!(open(&other).unwrap().has_depth());
    let kept = snapshot::Snapshot {
        picture: &ColorImage::new(40, 30),
        sources: Some((&color, Some(&depth))),
        settings: &[],
        source: "camera",
    };
    let kept = snapshot::save(folder.path(), "kept", &kept).unwrap();
    let mut opened = open(&kept).unwrap();
    assert!(opened.has_depth());
    let (mut into, mut no_depth, mut right) = Default::default();
    let shot = bokehcam_live::capture::FrameBuffers { color: &mut into, depth: &mut no_depth, right: &mut right };
    opened.camera.next(shot).unwrap();
    assert!(into == color, "the picture before the blur");
    still::write_depth(&folder.path().join("kept-2-depth.pfm"), &DepthMap::new(80, 30), 1000.0, true).unwrap();
    let small = folder.path().join("kept-2.png");
    still::write_color(&small, &color, false).unwrap();
    let error = open(&small).err().unwrap();
    assert!(error.contains("kept-2-depth.pfm") && !error.contains('\n'), "{error}");
    let text = folder.path().join("text.png");
    std::fs::write(&text, "no picture").unwrap();
    let error = open(&text).err().unwrap();
    assert!(error.contains("neither a folder, a photo nor a video"), "{error}");
}

#[test]
fn what_is_offered_is_opened_only_if_it_can_be_and_stays_on_the_list() {
    let (recording, empty) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    record(recording.path());
    let mut watched = Watched::begin("synthetic", empty.path());
    watched.until("it runs", is_running);
    let name = recording.path().display().to_string();
    for nothing in [empty.path().display().to_string(), format!("{name}/missing"), format!("{name}/rgb.txt")] {
        watched.session.send(Request::Offer(nothing.clone()));
        watched.until("why not", |told| matches!(told, Update::Note(line) if line.contains(&nothing)));
    }
    watched.frame("what ran goes on", |view| view.picture.size().0 == 640);
    assert!(!watched.told.iter().any(|told| matches!(told, Update::Source(_))));
    watched.session.send(Request::Offer(name.clone()));
    watched.until("it is good", |told| *told == Update::Offered(name.clone()));
    // The window requests this in response.
    watched.session.send(Request::Open(name.clone()));
    let listed = |told: &Update, first: &str| match told {
        Update::Choices { sources, .. } => sources.first().is_some_and(|choice| choice.name == first),
        _ => false,
    };
    watched.until("it is listed", |told| listed(told, &name));
    watched.until("it runs", is_running);
    let again = recording.path().join(".").display().to_string();
    watched.session.send(Request::Open(again.clone()));
    watched.until("the last one is first", |told| listed(told, &again));
    watched.session.send(Request::Open("synthetic".into()));
    let told = watched.until("both stay", |told| matches!(told, Update::Choices { .. }));
    let Update::Choices { sources, .. } = told else { unreachable!() };
    let names: Vec<&str> =
        sources.iter().map(|choice| choice.name.as_str()).filter(|name| !name.starts_with("/dev/video")).collect();
    assert_eq!(names, ["synthetic", again.as_str(), name.as_str(), "demo"]);
    watched.heard.session.close();
}

#[test]
fn a_camera_that_comes_is_offered_and_opened_where_it_was_missing_and_its_pictures_are_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::begin(CAMERA, folder.path());
    watched.until("it is not there", |told| matches!(told, Update::Source(Source::Lost(_))));
    watched.services.store(true, Ordering::SeqCst);
    let has_it = |told: &Update| match told {
        Update::Choices { sources, .. } => sources.iter().any(|choice| choice.name == CAMERA),
        _ => false,
    };
    // Within the test's timeout, without any request.
    watched.until("it is offered", has_it);
    watched.until("its sizes", |told| matches!(told, Update::Camera(camera) if camera.modes.len() == 2));
    watched.until("it runs", is_running);
    watched.frame("a frame", |view| view.picture.size() == (64, 48));
    watched.session.send(Request::Mode((32, 24), 60.0));
    let Update::Source(Source::Running(running)) = watched.until("it runs", is_running) else { unreachable!() };
    assert_eq!((running.size, running.period_ns), ((32, 24), 16_666_667));
    watched.frame("a frame of the other size", |view| view.picture.size() == (32, 24));
    watched.services.store(false, Ordering::SeqCst);
    watched.until("it has gone", |told| matches!(told, Update::Choices { .. }) && !has_it(told));
    watched.heard.session.close();
}

#[test]
fn the_demonstration_gives_way_to_a_camera_that_it_stands_in_for() {
    let folder = tempfile::tempdir().unwrap();
    let found = |told: &Update| *told == Update::CameraFound(CAMERA.into());
    let listed = |told: &Update| match told {
        Update::Choices { sources, .. } => sources.iter().any(|choice| choice.name == CAMERA),
        _ => false,
    };
    let mut watched = Watched::begin("", folder.path());
    watched.until("the demonstration", is_running);
    watched.services.store(true, Ordering::SeqCst);
    watched.until("the camera", found);
    watched.session.send(Request::Open(CAMERA.into()));
    watched.until("it runs", is_running);
    watched.frame("its picture", |view| view.picture.size() == (64, 48));
    watched.heard.session.close();
    // Who chose the demonstration keeps it, and who records keeps the recording.
    for (source, records) in [("demo", false), ("", true)] {
        let mut watched = Watched::begin(source, folder.path());
        watched.until("the demonstration", is_running);
        if records {
            let film = folder.path().join("film.y4m").display().to_string();
            watched.session.send(Request::StartOutput(Output { name: film, is_camera: false }));
            watched.until("it records", |told| matches!(told, Update::Outputs(outputs) if outputs.len() == 1));
        }
        watched.services.store(true, Ordering::SeqCst);
        watched.until("it is listed", listed);
        watched.services.store(false, Ordering::SeqCst);
        watched.until("it has gone", |told| {
            assert!(!found(told), "{source}: nothing is taken away");
            matches!(told, Update::Choices { .. }) && !listed(told)
        });
        watched.heard.session.close();
    }
}

#[test]
fn a_folder_of_pictures_plays_is_sought_in_and_repeats() {
    let folder = tempfile::tempdir().unwrap();
    for frame in 0..FRAMES {
        let mut color = ColorImage::new(48, 32);
        color.rgb.fill(20 * frame as u8);
        still::write_color(&folder.path().join(format!("IMG_{frame:04}.png")), &color, false).unwrap();
    }
    plays_sought_in_and_repeats(&folder.path().display().to_string());
    plays_sought_in_and_repeats(&folder.path().join("IMG_%04d.png").display().to_string());
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_video_plays_is_sought_in_and_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let film = folder.path().join("film.mp4");
    let mut ffmpeg = std::process::Command::new("ffmpeg");
    // Each frame is 20 brighter than the one before.
    ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", "color=black:s=48x32:r=25,geq=r=20*N:g=20*N:b=20*N"]);
    ffmpeg.args(["-frames:v", &FRAMES.to_string(), "-c:v", "libx264", "-pix_fmt", "yuv420p"]).arg(&film);
    assert!(ffmpeg.status().unwrap().success());
    plays_sought_in_and_repeats(&film.display().to_string());
}

/// Plays a source whose frames are each 20 brighter than the one before, and seeks in it.
fn plays_sought_in_and_repeats(source: &str) {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::begin(source, folder.path());
    watched.session.send(Request::Look(Box::new(Look::with_effect(bokehcam::look::Effect::None))));
    watched.frame("a frame", |_| true);
    let seeker = watched.seeker.clone().expect("it is gone back and forth in");
    assert_eq!(seeker.frames(), FRAMES);
    let mut last_ns = 0;
    for place in [8, 3, 11, 0, 11] {
        let number = seeker.request_frame(place);
        let asked = watched.frame("the frame that was asked for", |view| view.is_seek_target && view.seek == number);
        assert_eq!(seeker.position_of(asked.stamp), place);
        let rgb = asked.picture.memory().unwrap().rgb[0];
        assert!(rgb.abs_diff(20 * place as u8) <= 4, "{rgb} of frame {place}");
        assert!(asked.stamp.time_ns > last_ns || last_ns == 0, "media time goes on");
        last_ns = asked.stamp.time_ns;
    }
    // After the last frame comes the first again.
    watched.frame("the next lap", |view| !view.is_seek_target && view.stamp.index < 8 && view.stamp.time_ns > last_ns);
    assert!(watched.heard.session.close().report.unwrap().frames.is_balanced());
}
