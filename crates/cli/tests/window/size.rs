//! Resizing, minimising and restoring the window.

use std::thread;
use std::time::Duration;

use super::input::sym;
use super::picture::is_photograph;
use super::preview::Program;
use super::program::PORTRAIT;
use super::screen::{SIZE, Screen, until};
use super::window::PATIENCE;

#[test]
#[ignore = "needs an X server"]
fn it_outlives_a_storm_of_sizes() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    for turn in 0..120u32 {
        window.resize(320 + turn * 37 % 900, 240 + turn * 53 % 600);
        thread::sleep(Duration::from_millis(u64::from(turn % 4) * 5));
    }
    window.resize(200, 120);
    window.resize(900, 600);
    let image = window.until("a picture of the last size", |image| image.size() == (900, 600) && is_photograph(image));
    assert_eq!(window.size(), image.size());
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn it_can_be_put_away_and_brought_back() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    for _ in 0..2 {
        window.minimise();
        thread::sleep(Duration::from_millis(700));
        assert!(program.runs(), "{}", program.said());
        window.bring_back();
        window.until("a picture again", is_photograph);
    }
    // The program also ends when closed while minimised.
    window.minimise();
    program.close();
}

#[test]
#[ignore = "needs an X server"]
fn a_key_fills_the_screen_and_gives_it_back() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    let window = program.window();
    window.until("the first picture", is_photograph);
    let before = window.size();
    window.key(&[], sym::F11);
    until("full screen", PATIENCE, || window.is_full_screen());
    let whole = (u32::from(SIZE.0), u32::from(SIZE.1));
    window.until("the picture fills the screen", |image| image.size() == whole && is_photograph(image));
    window.key(&[], sym::ESCAPE);
    until("no full screen any more", PATIENCE, || !window.is_full_screen() && window.size() == before);
    window.until("the picture as before", is_photograph);
    program.close();
}
