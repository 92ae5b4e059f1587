//! The preview's session: sources, looks and outputs change while frames continue.
#![allow(missing_docs)]

#[path = "../../../../tests/common/mod.rs"]
mod common;
#[path = "../../../../tests/common/heard.rs"]
mod heard;
mod held;
#[path = "../../../../tests/common/on_gpu.rs"]
mod on_gpu;
mod present;
mod shader;
mod sources;
#[path = "../../../../tests/common/store.rs"]
mod store;
#[path = "../../../../tests/common/until.rs"]
mod until;
mod watched;

use std::sync::Arc;
use std::sync::atomic::Ordering;

use bokehcam::depth::plate::Step;
use bokehcam::frame::DepthMap;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Effect, Look, Strength};
use bokehcam::optics::CocField;
use bokehcam_files::user_folders::is_recording_name;
use bokehcam_window::state::{Output, Request, Source, Update};

use heard::{PATIENCE, look};
use until::until;
use watched::{Watched, is_running, radius_px};

#[test]
fn a_look_takes_effect_while_frames_go_on() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    watched.until("the note", |told| *told == Update::Note("a note".into()) || matches!(told, Update::Outputs(_)));
    let first = watched.frame("a frame", |view| radius_px(view) == 2.0);
    assert!(first.picture.memory().is_some() && first.color.is_some() && first.depth.is_some());
    let made = watched.services.executors.load(Ordering::SeqCst);

    let stronger = Look { strength: Strength::AtInfinity(5.0), ..look() };
    watched.session.send(Request::Look(Box::new(stronger.clone())));
    watched.frame("more blur", |view| radius_px(view) == 5.0);
    let near = Look { focus: bokehcam::depth::focus::FocusRule::Metres(0.7), ..stronger };
    watched.session.send(Request::Look(Box::new(near.clone())));
    watched.frame("another focus", |view| matches!(view.coc, CocField::Depth(coc) if (coc.focus_m - 0.7).abs() < 0.02));
    assert!(watched.services.executors.load(Ordering::SeqCst) <= made + 1, "another focus needs no other executor");

    let even = Look { effect: Effect::Blur, ..near.clone() };
    watched.session.send(Request::Look(Box::new(even)));
    watched.frame("an even blur", |view| radius_px(view) == -5.0);
    watched.session.send(Request::Look(Box::new(Look { effect: Effect::None, ..near })));
    watched.frame("no blur", |view| view.color.is_none());
    let report = watched.heard.session.close().report.unwrap();
    assert!(report.frames.is_balanced(), "{:?}", report.frames);
}

#[test]
fn sources_come_and_go_and_one_that_is_lost_can_be_tried_again() {
    let mut watched = Watched::begin("nothing");
    watched.until("why", |told| *told == Update::Source(Source::Lost("no such source: nothing".into())));
    watched.session.send(Request::StartOutput(Output { name: "film".into(), is_camera: false }));
    watched.until("nothing to write", |told| matches!(told, Update::Note(line) if line.contains("no source")));
    watched.session.send(Request::Open("32".into()));
    watched.until("it runs", |told| is_running(told, 32));
    watched.frame("a frame", |view| view.picture.size().0 == 32);
    watched.session.send(Request::Open("48".into()));
    watched.until("the other runs", |told| is_running(told, 48));
    watched.frame("a frame of the other", |view| view.picture.size().0 == 48);
    watched.session.send(Request::Open("24 then no more".into()));
    watched.until("its end", |told| *told == Update::Source(Source::Ended));
    watched.session.send(Request::Open("24 then no more".into()));
    watched.until("it runs again", |told| is_running(told, 24));
    watched.until("and ends", |told| *told == Update::Source(Source::Ended));
    let report = watched.heard.session.close().report.unwrap();
    assert!(report.frames.is_balanced() && report.frames.captured == 2, "{:?}", report.frames);
}

#[test]
fn a_plate_is_taken_where_there_was_no_depth_and_again_without_a_new_run() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    assert!(watched.guide.is_none());
    watched.session.send(Request::CapturePlate);
    watched.until("it runs again", |told| is_running(told, 32));
    let guide = watched.guide.clone().expect("how far the plate is");
    watched.frame("all is far until there is a plate", |view| {
        view.depth.as_ref().is_some_and(|depth| depth.metres.iter().all(|&metres| metres == DepthMap::FAR_M))
    });
    assert!(matches!(guide.step(), Step::StepOut(1..=3)), "{:?}", guide.step());
    watched.frame("the countdown is over", |_| !matches!(guide.step(), Step::StepOut(_)));
    watched.session.send(Request::CapturePlate);
    watched.frame("the countdown has begun again", |_| matches!(guide.step(), Step::StepOut(_)));
    assert!(!watched.told.iter().any(|told| is_running(told, 32)), "no new run");
    // Another source has no plate, nor has this one when it is reopened.
    for width in [48, 32] {
        watched.session.send(Request::Open(width.to_string()));
        watched.until("it runs", |told| is_running(told, width));
        assert!(watched.guide.is_none());
    }
    assert!(watched.heard.session.close().report.unwrap().frames.is_balanced());
}

#[test]
fn outputs_are_begun_and_completed_and_one_that_cannot_be_is_told() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    let output = |name: &str, is_camera| Output { name: name.into(), is_camera };
    watched.session.send(Request::StartOutput(output("full", false)));
    watched.until("why not", |told| *told == Update::Note("the disk is full".into()));
    watched.until("none is written", |told| *told == Update::Outputs(Vec::new()));
    watched.session.send(Request::StartOutput(output("film", false)));
    watched.session.send(Request::StartOutput(output("camera", true)));
    watched.until("two", |told| *told == Update::Outputs(vec![output("film", false), output("camera", true)]));
    watched.session.copy_command(vec![("split".into(), "0.5".into())]);
    watched.until("the command", |told| matches!(told, Update::Note(line) if line.starts_with("Copied: show 32")));
    watched.hear();
    // The film's file exists already: the command names another one.
    let (copied, end) = (watched.copied.clone().unwrap(), r#"", "camera"] [("split", "0.5")]"#);
    let film = copied.strip_prefix("show 32 [\"").and_then(|rest| rest.strip_suffix(end));
    assert!(film.is_some_and(|film| is_recording_name(film.rsplit('/').next().unwrap())), "{copied}");
    let has =
        |watched: &Watched, line: &str| watched.services.written.lock().unwrap().iter().any(|written| written == line);
    until("both are written", PATIENCE, || has(&watched, "film 32") && has(&watched, "camera 32"));
    watched.session.send(Request::StopOutput(output("film", false)));
    watched
        .until("the film is complete", |told| matches!(told, Update::Note(line) if line.starts_with("Complete: film")));
    // A virtual camera and a recording go on with the next source.
    watched.session.send(Request::StartOutput(output("take", false)));
    until("it is written", PATIENCE, || has(&watched, "take 32"));
    watched.session.send(Request::Open("48".into()));
    watched.until("the other runs", |told| is_running(told, 48));
    until("the camera goes on", PATIENCE, || has(&watched, "camera 48"));
    let written = Arc::clone(&watched.services.written);
    let opened = written.lock().unwrap().iter().filter(|line| line.ends_with("opened")).count();
    assert_eq!(opened, 3, "each was opened once");
    assert!(!has(&watched, "take 48") && !has(&watched, "take complete"), "a recording keeps its size");
    // Without a source, a recording ends, and a virtual camera shows the card.
    let cards = written.lock().unwrap().iter().filter(|line| *line == "camera card").count();
    watched.session.send(Request::Open("nothing".into()));
    until("the card", PATIENCE, || {
        written.lock().unwrap().iter().filter(|line| *line == "camera card").count() > cards
    });
    until("the recording is complete", PATIENCE, || has(&watched, "take complete"));
    assert!(!has(&watched, "camera complete"));
    watched.heard.session.close().report.unwrap();
    assert_eq!(written.lock().unwrap().iter().filter(|line| *line == "camera complete").count(), 1);
}

#[test]
fn what_a_call_sees_is_private_and_nothing_else() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    let is_private = Arc::clone(&watched.services.is_private);
    let output = |name: &str, is_camera| Output { name: name.into(), is_camera };
    let has = |told: &Update, count: usize| matches!(told, Update::Outputs(outputs) if outputs.len() == count);
    watched.session.send(Request::StartOutput(output("film", false)));
    watched.until("a recording", |told| has(told, 1));
    assert!(!is_private.load(Ordering::SeqCst), "a recording is no call");
    watched.session.send(Request::StartOutput(output("camera", true)));
    watched.until("a camera", |told| has(told, 2));
    assert!(is_private.load(Ordering::SeqCst));
    let even = Look { effect: Effect::Blur, ..look() };
    watched.session.send(Request::Look(Box::new(even)));
    watched.frame("another look", |view| radius_px(view) < 0.0);
    assert!(is_private.load(Ordering::SeqCst), "every look of the call is");
    watched.session.send(Request::StopOutput(output("camera", true)));
    watched.until("no camera", |told| has(told, 1));
    assert!(!is_private.load(Ordering::SeqCst));
    watched.session.send(Request::StartOutput(output("camera", true)));
    watched.session.send(Request::Open("48".into()));
    watched.until("the other runs", |told| is_running(told, 48));
    assert!(is_private.load(Ordering::SeqCst), "the call goes on with another source");
    watched.heard.session.close();
}

/// Whatever the source does, a call sees pictures or the card without an end, in time.
#[test]
fn a_call_goes_on_through_thirty_changes_of_source_and_depth() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    watched.session.send(Request::StartOutput(Output { name: "camera".into(), is_camera: true }));
    watched.until("it is there", |told| matches!(told, Update::Outputs(outputs) if outputs.len() == 1));
    let reader = watched.services.readers.lock().unwrap().as_ref().map(Demand::watch);
    watched.until("a call", |told| *told == Update::Watched(true));
    let written = Arc::clone(&watched.services.written);
    for round in 0..30 {
        let request = match round % 3 {
            0 => Request::Open("48".into()),
            1 => Request::CapturePlate,
            _ => Request::Open("32".into()),
        };
        let width = if round % 3 == 2 { 32 } else { 48 };
        let before = written.lock().unwrap().len();
        watched.session.send(request);
        watched.until("it runs", |told| is_running(told, width));
        until("pictures of it", PATIENCE, || {
            written.lock().unwrap()[before..].iter().any(|line| *line == format!("camera {width}"))
        });
    }
    drop(reader);
    watched.until("no call", |told| *told == Update::Watched(false));
    let told = written.lock().unwrap().clone();
    assert_eq!(told.iter().filter(|line| line.ends_with("opened")).count(), 1);
    assert!(!told.iter().any(|line| line.ends_with("complete")));
    assert!(watched.heard.session.close().report.unwrap().frames.is_balanced());
}

#[test]
fn a_camera_switched_off_in_a_call_shows_the_card_until_the_call_lets_go_of_it() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    let camera = || Output { name: "camera".into(), is_camera: true };
    let written = Arc::clone(&watched.services.written);
    let last = || written.lock().unwrap().last().cloned().unwrap_or_default();
    watched.session.send(Request::StartOutput(camera()));
    until("pictures", PATIENCE, || last() == "camera 32");
    let reader = watched.services.readers.lock().unwrap().as_ref().map(Demand::watch);
    watched.session.send(Request::StopOutput(camera()));
    watched.until("it is off", |told| *told == Update::Outputs(Vec::new()));
    until("the card", PATIENCE, || last() == "camera card");
    watched.frame("frames go on", |_| true);
    assert_eq!(last(), "camera card");
    watched.session.send(Request::StartOutput(camera()));
    watched.until("it is on", |told| *told == Update::Outputs(vec![camera()]));
    until("pictures again", PATIENCE, || last() == "camera 32");
    watched.session.send(Request::StopOutput(camera()));
    until("the card again", PATIENCE, || last() == "camera card");
    drop(reader);
    until("it is gone", PATIENCE, || last() == "camera complete");
    let opened = written.lock().unwrap().iter().filter(|line| line.ends_with("opened")).count();
    assert_eq!(opened, 1, "the call kept its camera");
    watched.heard.session.close();
}

#[test]
fn an_output_that_fails_is_told_for_good_and_is_not_forgotten_at_the_end() {
    for (name, why) in [("fills up", "full now"), ("no end", "full at the end")] {
        let mut watched = Watched::begin("32");
        watched.until("it runs", |told| is_running(told, 32));
        watched.session.send(Request::StartOutput(Output { name: name.into(), is_camera: false }));
        if name == "fills up" {
            watched.until("why", |told| matches!(told, Update::OutputFailure(line) if line.contains(why)));
            watched.until("none is written", |told| *told == Update::Outputs(Vec::new()));
        } else {
            watched.until("it is written", |told| matches!(told, Update::Outputs(outputs) if outputs.len() == 1));
            watched.frame("a frame", |_| true);
        }
        let closed = watched.heard.session.close();
        assert!(closed.output_error.as_ref().is_some_and(|line| line.contains(why)), "{closed:?}");
        assert!(closed.report.unwrap().frames.is_balanced());
    }
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    assert_eq!(watched.heard.session.close().output_error, None);
}

#[test]
fn a_recording_that_was_broken_off_is_found_at_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at(".bokehcam-3.mp4.77-0.part"), "take").unwrap();
    std::fs::write(at(".bokehcam 2026-11-23 21-14-05.mp4.77-1.part"), "another take").unwrap();
    std::fs::write(at(".holiday.mp4.77-0.part"), "mine").unwrap();
    let mut watched = Watched::begin_in("32", folder.path());
    watched
        .until("it is told", |told| matches!(told, Update::Note(line) if line.contains("bokehcam-3.incomplete.mp4")));
    watched.heard.session.close();
    assert_eq!(std::fs::read(at("bokehcam-3.incomplete.mp4")).unwrap(), b"take");
    assert_eq!(std::fs::read(at("bokehcam 2026-11-23 21-14-05.incomplete.mp4")).unwrap(), b"another take");
    assert_eq!(std::fs::read(at(".holiday.mp4.77-0.part")).unwrap(), b"mine");
}
