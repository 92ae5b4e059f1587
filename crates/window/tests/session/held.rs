//! Held frames, and paused sources.

use std::time::{Duration, Instant};

use bokehcam::computing::ComputeOptions;
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::Images;
use bokehcam::engine::still::{self as engine_still, Depth};
use bokehcam::frame::ColorImage;
use bokehcam::look::{Effect, Look, Strength};
use bokehcam::optics::CocField;
use bokehcam_live::pipeline::View;
use bokehcam_window::session::Still;
use bokehcam_window::state::{Output, Request, Update};

use super::heard::{PATIENCE, look};
use super::until::found;
use super::watched::{Watched, is_running};

const GREEN: [u8; 3] = [0, 177, 64];

/// Creates a session whose first frame is held.
fn holding(source: &str) -> (Watched, View) {
    let mut watched = Watched::begin(source);
    watched.until("it runs", |told| is_running(told, 32));
    let view = watched.frame("a frame", |_| true);
    hold(&watched, &view);
    (watched, view)
}

fn hold(watched: &Watched, view: &View) {
    let (color, depth) = (view.color.as_deref().unwrap().clone(), view.depth.as_deref().cloned());
    watched.session.hold_frame(still(7, Images { color, depth, ..Images::default() }, view.coc), false);
}

fn still(number: u64, images: Images, coc: CocField) -> Still {
    Still { number, images, coc, change: 0, quality: None }
}

/// Returns the held frame blurred with another look.
fn in_look(watched: &mut Watched, look: &Look) -> Still {
    watched.session.send(Request::Look(Box::new(look.clone())));
    found("it is blurred anew", PATIENCE, || {
        watched.hear();
        watched.blurred.pop()
    })
}

#[test]
fn a_frame_that_stays_is_blurred_as_each_look_says() {
    let (mut watched, view) = holding("32");
    let CocField::Depth(coc) = view.coc else { panic!("{:?}", view.coc) };
    let color = view.color.as_deref().unwrap();
    let looks = [
        Look { strength: Strength::AtInfinity(4.0), ..look() },
        Look { strength: Strength::AtInfinity(4.0), focus: FocusRule::Metres(0.9), ..look() },
        Look { background: Background::Color(GREEN), ..look() },
        Look { effect: Effect::Blur, ..look() },
    ];
    let mut last = 0;
    for wanted in &looks {
        let blurred = in_look(&mut watched, wanted);
        assert!(blurred.number == 7 && blurred.change > last, "{} after {last}", blurred.change);
        last = blurred.change;
        // The focus distance stays fixed until another focus is chosen.
        let focus = if wanted.focus == look().focus { FocusRule::Metres(coc.focus_m) } else { wanted.focus };
        let depth = view.depth.as_deref().cloned().map(Depth::Final);
        let same = Look { focus, ..wanted.clone() };
        let (picture, _) = engine_still::blur_picture(&same, color.clone(), depth, &ComputeOptions::default()).unwrap();
        assert_eq!(blurred.images.blurred.rgb, picture.rgb, "{wanted:?}");
        assert_ne!(blurred.images.blurred.rgb, view.picture.memory().unwrap().rgb);
    }
    let plain = in_look(&mut watched, &Look { effect: Effect::None, ..look() });
    assert_eq!((plain.images.blurred.rgb, plain.quality), (color.rgb.clone(), None));
    watched.session.release_frame();
    watched.session.send(Request::Look(Box::new(look())));
    watched.frame("the next frames come in the look", |view| matches!(view.coc, CocField::Depth(_)));
    assert!(watched.blurred.is_empty());
}

#[test]
fn what_stood_behind_a_frame_that_stays_is_taken_away_again() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    watched.session.send(Request::Look(Box::new(Look { background: Background::Color(GREEN), ..look() })));
    let is_green = |picture: &ColorImage| picture.rgb.as_chunks().0.contains(&GREEN);
    let view = watched.frame("a green one", |view| is_green(view.picture.memory().unwrap()));
    assert!(!is_green(view.color.as_deref().unwrap()), "the picture as the camera gave it");
    hold(&watched, &view);
    assert!(!is_green(&in_look(&mut watched, &look()).images.blurred));
    let other = [200, 0, 99];
    let blurred = in_look(&mut watched, &Look { background: Background::Color(other), ..look() });
    assert!(blurred.images.blurred.rgb.as_chunks().0.contains(&other) && !is_green(&blurred.images.blurred));
}

#[test]
fn a_frame_without_depth_says_so_when_depth_is_needed() {
    let (mut watched, view) = holding("32");
    let color = view.color.as_deref().unwrap().clone();
    let images = Images { color, ..Images::default() };
    watched.session.hold_frame(still(8, images, view.coc), false);
    watched.session.send(Request::Look(Box::new(Look { strength: Strength::AtInfinity(3.0), ..look() })));
    watched.until("why not", |told| matches!(told, Update::Note(line) if line.contains("without depth")));
    let even = in_look(&mut watched, &Look { effect: Effect::Blur, ..look() });
    assert_eq!(even.number, 8);
}

#[test]
fn the_last_frame_of_a_source_that_ended_follows_the_look() {
    let (mut watched, _) = holding("32 no more");
    watched.until("its end", |told| matches!(told, Update::Source(bokehcam_window::state::Source::Ended)));
    let blurred = in_look(&mut watched, &Look { strength: Strength::AtInfinity(4.0), ..look() });
    assert!(blurred.images.depth.is_some());
}

#[test]
fn nothing_is_captured_while_nobody_watches_unless_it_is_written() {
    let mut watched = Watched::begin("32");
    watched.until("it runs", |told| is_running(told, 32));
    watched.frame("a frame", |_| true);
    watched.watch = None;
    // Frames in flight still arrive, and then nothing for a second.
    let rests = |watched: &mut Watched| {
        let (began, mut last) = (Instant::now(), Instant::now());
        while last.elapsed() < Duration::from_secs(1) {
            assert!(began.elapsed() < PATIENCE, "frames go on");
            if watched.views.as_mut().is_some_and(|views| views.try_recv().is_some()) {
                last = Instant::now();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    rests(&mut watched);
    let film = Output { name: "film".into(), is_camera: false };
    watched.session.send(Request::StartOutput(film.clone()));
    watched.frame("frames come for the film", |_| true);
    watched.session.send(Request::StopOutput(film));
    watched
        .until("the film is complete", |told| matches!(told, Update::Note(line) if line.starts_with("Complete: film")));
    rests(&mut watched);
    watched.watch = Some(watched.demand.watch());
    watched.frame("frames come again", |_| true);
}
