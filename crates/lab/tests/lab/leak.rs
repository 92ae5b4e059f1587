//! Laws of privacy: text behind the focal plane cannot be restored, and the attack that fails works on a plain blur.

#[path = "../../benches/leak/experiment/mod.rs"]
mod experiment;

use bokehcam::budget::Quality;
use experiment::attack::{Guesses, restore_by_wiener};
use experiment::call::{Call, CallSettings, hand_held_shifts_px};
use experiment::card::{Card, Content, Kind};
use experiment::observation::Observation;
use experiment::score::{LEGIBLE, Truth, correlate};

/// Room for the lines up to 40 px.
const SIZE: (u32, u32) = (640, 300);
const WORDS: &str = "MEETING WITH ACME 14:30  pin 4821";

fn card(kind: Kind) -> Card {
    Card::new(kind, SIZE, WORDS)
}

/// Returns the restored correlation of each line, by the size of its text in pixels.
fn restore(kind: Kind, radius_px: f32, privacy: bool, shifts_px: &[(f32, f32)]) -> Vec<(u32, f32)> {
    let card = card(kind);
    let settings = CallSettings { radius_px, privacy, quality: Quality::Balanced, threads: None };
    let mut call = Call::new(&card, &settings).unwrap();
    let shown: Vec<_> = shifts_px.iter().map(|&shift_px| call.show(&card.draw(shift_px)).unwrap()).collect();
    let seen = Observation::new(&shown, shifts_px, card.wall_right());
    let restored = restore_by_wiener(&seen, &Truth::new(&card), &Guesses::for_known_radius(radius_px));
    let sizes = card.rows.iter().map(|row| match row.content {
        Content::Text(size_px) => size_px,
        Content::Bars(period_px) => panic!("bars of {period_px} px on a card of text"),
    });
    let scores: Vec<(u32, f32)> = sizes.zip(restored.scores).collect();
    assert_eq!(scores.len(), 4, "the lines of 14, 20, 28 and 40 px");
    scores
}

/// Asserts that lines with text of up to `max_size_px` cannot be read.
fn assert_hidden(kind: Kind, radius_px: f32, max_size_px: f32) {
    let scores = restore(kind, radius_px, true, &[(0.0, 0.0)]);
    let legible = scores.iter().any(|&(size_px, score)| size_px as f32 <= max_size_px && score > LEGIBLE);
    assert!(!legible, "{kind:?}, radius {radius_px} px: {scores:?}");
}

#[test]
fn private_text_of_up_to_40_px_is_not_restored_behind_16_px() {
    assert_hidden(Kind::Dark, 16.0, 40.0);
    assert_hidden(Kind::Light, 16.0, 40.0);
}

#[test]
fn private_text_of_up_to_two_and_a_half_radii_is_not_restored() {
    for radius_px in [8.0, 11.0, 24.0] {
        assert_hidden(Kind::Dark, radius_px, 2.5 * radius_px);
    }
}

#[test]
fn a_camera_that_moves_does_not_bring_private_text_back() {
    let scores = restore(Kind::Dark, 16.0, true, &hand_held_shifts_px(24));
    let limit = |size_px: u32| if size_px <= 28 { LEGIBLE } else { 0.65 };
    assert!(scores.iter().all(|&(size_px, score)| score <= limit(size_px)), "{scores:?}");
}

#[test]
fn a_plain_blur_is_undone() {
    for radius_px in [8.0, 11.0, 16.0] {
        let scores = restore(Kind::Dark, radius_px, false, &[(0.0, 0.0)]);
        let (size_px, score) = scores[3];
        assert!(size_px == 40 && score > 0.75, "radius {radius_px} px: {scores:?}");
    }
}

#[test]
fn registered_pictures_of_a_moving_camera_agree_with_one_at_rest() {
    let card = card(Kind::Dark);
    let shifts_px = hand_held_shifts_px(8);
    let drawn: Vec<_> = shifts_px.iter().map(|&shift_px| card.draw(shift_px)).collect();
    let scores = Truth::new(&card).score(&Observation::new(&drawn, &shifts_px, card.wall_right()).light());
    assert!(scores.iter().all(|&score| score > 0.95), "{scores:?}");
    let unregistered = Truth::new(&card).score(&Observation::new(&drawn, &[(0.0, 0.0); 8], card.wall_right()).light());
    assert!(unregistered[0] < 0.5, "{unregistered:?}");
}

#[test]
fn correlation_is_pearsons() {
    let a = [1.0, 2.0, 3.0, 4.0];
    assert!((correlate(&a, &[5.0, 7.0, 9.0, 11.0]) - 1.0).abs() < 1e-6);
    assert!((correlate(&a, &[4.0, 3.0, 2.0, 1.0]) + 1.0).abs() < 1e-6);
    assert!((correlate(&a, &[1.0, -1.0, -1.0, 1.0])).abs() < 1e-6);
    assert_eq!(correlate(&a, &[2.0; 4]), 0.0);
}
