//! The attacks on one card, as a line of the table.

use std::fs;
use std::path::Path;

use crate::experiment::attack::{Guess, Guesses, Restored};
use crate::experiment::attack::{restore_by_richardson_lucy, restore_by_wiener, search_by_wiener};
use crate::experiment::card::{Card, Content};
use crate::experiment::light::Light;
use crate::experiment::observation::Observation;
use crate::experiment::score::Truth;
use bokehcam_media::recording::still;

use super::Outcome;

/// A card after all attacks.
pub struct Attacked {
    rows: String,
    light: Light,
    blurred: Vec<f32>,
    /// By Wiener with the known radius, if it is known.
    known: Option<Restored>,
    searched: Restored,
    richardson_lucy: Restored,
}

impl Attacked {
    /// Attacks an observation. Richardson-Lucy continues from the best guess of the Wiener filters.
    pub fn new(card: &Card, seen: &Observation, radius_px: Option<f32>, iterations: u16) -> Self {
        let (truth, light) = (Truth::new(card), seen.light());
        let known = radius_px.map(|radius_px| restore_by_wiener(seen, &truth, &Guesses::for_known_radius(radius_px)));
        let searched = search_by_wiener(seen, &truth);
        let guess = known.as_ref().unwrap_or(&searched).guess;
        let richardson_lucy = restore_by_richardson_lucy(seen, &truth, guess, usize::from(iterations));
        Self { rows: describe_rows(card), blurred: truth.score(&light), light, known, searched, richardson_lucy }
    }

    /// Writes the picture before and after the best attack to `NAME-seen.png` and `NAME-restored.png`, if there is a
    /// folder for them.
    pub fn save(&self, folder: Option<&Path>, name: &str) -> Outcome {
        let Some(folder) = folder else { return Ok(()) };
        let sum = |restored: &Restored| restored.scores.iter().sum::<f32>();
        let all = [Some(&self.searched), Some(&self.richardson_lucy), self.known.as_ref()];
        let best = all.into_iter().flatten().max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap_or(&self.searched);
        fs::create_dir_all(folder)?;
        for (light, kind) in [(&self.light, "seen"), (&best.light, "restored")] {
            still::write_color(&folder.join(format!("{name}-{kind}.png")), &light.to_picture(), true)?;
        }
        Ok(())
    }
}

/// Prints the head of the table.
pub fn print_head() {
    println!(
        "| radius | privacy | channel | rows of the card, px | blurred | Wiener, known radius | Wiener, searched | \
         Richardson-Lucy | found |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
}

/// Prints one line.
pub fn print_line([radius, privacy, channel]: &[&str; 3], attacked: &Attacked) {
    let Attacked { rows, blurred, known, searched, richardson_lucy, .. } = attacked;
    let known = known.as_ref().map_or_else(String::new, |known| join(&known.scores));
    let Guess { radius_px, rim, cell_px, noise } = searched.guess;
    println!(
        "| {radius} | {privacy} | {channel} | {rows} | {} | {known} | {} | {} | {radius_px} px, rim {rim}, cells {cell_px} \
         px, noise {noise:e} |",
        join(blurred),
        join(&searched.scores),
        join(&richardson_lucy.scores),
    );
}

/// Returns correlations without their leading zeros, such as `.35 .40`.
fn join(scores: &[f32]) -> String {
    let short = |score: &f32| format!("{score:.2}").replacen("0.", ".", 1);
    scores.iter().map(short).collect::<Vec<_>>().join(" ")
}

fn describe_rows(card: &Card) -> String {
    let describe = |content| match content {
        Content::Text(size_px) => format!("{size_px}"),
        Content::Bars(period_px) => format!("bars {period_px}"),
    };
    let rows: Vec<String> = card.rows.iter().map(|row| describe(row.content)).collect();
    format!("{}: {}", card.kind.name(), rows.join(" "))
}
