//! Every key binding.

use std::thread;
use std::time::Duration;

use bokehcam_window::egui::Key;
use bokehcam_window::keys::{Chord, GROUPS};

use super::input::sym;
use super::picture::{distance, is_photograph};
use super::preview::Program;
use super::program::{PORTRAIT, run};
use super::screen::{Screen, until};
use super::window::{PATIENCE, Window};

/// Returns the X keysym of a key in the table of bindings.
fn symbol(key: Key) -> u32 {
    match key {
        Key::ArrowLeft => 0xff51,
        Key::ArrowUp => 0xff52,
        Key::ArrowRight => 0xff53,
        Key::ArrowDown => 0xff54,
        Key::Home => 0xff50,
        Key::PageUp => 0xff55,
        Key::PageDown => 0xff56,
        Key::Escape => sym::ESCAPE,
        Key::Space => u32::from(' '),
        Key::F1 => sym::F1,
        Key::F5 => sym::F1 + 4,
        Key::F11 => sym::F11,
        Key::OpenBracket => u32::from('['),
        Key::CloseBracket => u32::from(']'),
        Key::Semicolon => u32::from(';'),
        Key::Quote => u32::from('\''),
        Key::Comma => u32::from(','),
        Key::Period => u32::from('.'),
        Key::Minus => u32::from('-'),
        Key::Plus => u32::from('+'),
        Key::Equals => u32::from('='),
        Key::Questionmark => u32::from('?'),
        key => match key.name().as_bytes() {
            [byte] => u32::from(byte.to_ascii_lowercase()),
            _ => panic!("{}: the test has no symbol for this key", key.name()),
        },
    }
}

fn press(window: &Window, chord: Chord) {
    let held: Vec<u32> = [(chord.ctrl, sym::CONTROL), (chord.shift, sym::SHIFT)]
        .into_iter()
        .filter_map(|(held, symbol)| held.then_some(symbol))
        .collect();
    window.key(&held, symbol(chord.key));
}

/// Whether a chord closes the window.
fn closes(chord: &Chord) -> bool {
    chord.key == Key::Q || (chord.ctrl && chord.key == Key::W)
}

#[test]
#[ignore = "needs an X server"]
fn every_key_leaves_it_alive() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    // Twice, so that toggles return to their initial state.
    for _ in 0..2 {
        for binding in GROUPS.iter().flat_map(|group| group.bindings) {
            for chord in binding.chords.iter().filter(|chord| !closes(chord)) {
                press(&window, *chord);
                thread::sleep(Duration::from_millis(60));
                assert!(program.runs(), "{}: {}", binding.keys, program.said());
            }
        }
    }
    until("it reacts", PATIENCE, || {
        window.key(&[], sym::F11);
        thread::sleep(Duration::from_millis(500));
        window.is_full_screen()
    });
    press(&window, Chord { key: Key::Q, ctrl: true, shift: false });
    program.end().succeeded();
}

#[test]
#[ignore = "needs an X server"]
fn keys_that_close_close() {
    let screen = Screen::new();
    let chords = GROUPS.iter().flat_map(|group| group.bindings).flat_map(|binding| binding.chords);
    let closing: Vec<Chord> = chords.filter(|chord| closes(chord)).copied().collect();
    assert!(closing.len() > 1);
    for chord in closing {
        let mut program = Program::start(&screen, &[PORTRAIT]);
        let window = program.window();
        window.until("the first picture", is_photograph);
        press(&window, chord);
        program.end().succeeded();
    }
}

#[test]
#[ignore = "needs an X server"]
fn what_is_seen_follows_the_keys_and_comes_back() {
    // A looped single frame at a fixed quality level gives a static picture on a machine of any speed.
    let folder = tempfile::tempdir().unwrap();
    let frame = folder.path().join("frame");
    let frame = frame.to_str().unwrap();
    run(&["record", PORTRAIT, "--frames", "1", "--to", frame]).done();
    let screen = Screen::new();
    let still = [frame, "--quality", "draft", "--panel=false"];
    let mut program = Program::start(&screen, &still);
    let window = program.window();
    window.until("the first picture", is_photograph);
    let mut last = None;
    let before = window.until("the notes and the controls of the start are gone", |image| {
        // Longer than controls stay visible, or two consecutive pictures would both show them.
        thread::sleep(Duration::from_secs(6));
        let same = last.as_ref().is_some_and(|last| distance(last, image) < 0.01);
        last = Some(image.clone());
        same
    });
    for (name, c) in [("mirrored", 'm'), ("depth", 'd'), ("before and after", 'b')] {
        window.key(&[], u32::from(c));
        window.until(name, |image| distance(image, &before) > 1.0);
        window.key(&[], u32::from(c));
        window.until(&format!("not {name} any more"), |image| distance(image, &before) < 0.5);
    }
    window.key(&[], u32::from('p'));
    window.until("the panel", |image| distance(image, &before) > 1.0);
    window.key(&[], u32::from('h'));
    window.until("only the picture", |image| distance(image, &before) < 0.5);
    program.close();
}
