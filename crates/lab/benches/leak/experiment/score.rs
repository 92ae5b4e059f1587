//! How much of each row of a card a picture shows.

use super::card::{Card, Row};
use super::light::Light;

/// Correlation from which people begin to read a line.
pub const LEGIBLE: f32 = 0.6;

/// The sharp pixels of a card, to compare pictures with.
pub struct Truth<'a> {
    rows: Vec<(&'a Row, Vec<f32>)>,
}

impl<'a> Truth<'a> {
    /// Draws the card.
    pub fn new(card: &'a Card) -> Self {
        let light = card.light();
        Self { rows: card.rows.iter().map(|row| (row, scored_pixels(row, &light))).collect() }
    }

    /// Returns Pearson's correlation with the sharp card in linear light, for each of its rows. The picture has the
    /// card's size.
    pub fn score(&self, seen: &Light) -> Vec<f32> {
        self.rows.iter().map(|(row, sharp)| correlate(&scored_pixels(row, seen), sharp)).collect()
    }
}

fn scored_pixels(row: &Row, light: &Light) -> Vec<f32> {
    (row.top..row.bottom).flat_map(|y| light.row(y, row.left, row.right)).copied().collect()
}

/// Returns Pearson's correlation of two series of the same length; 0 if one of them is constant.
pub fn correlate(a: &[f32], b: &[f32]) -> f32 {
    let mean = |of: &[f32]| of.iter().map(|&v| f64::from(v)).sum::<f64>() / of.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&a, &b) in a.iter().zip(b) {
        let (a, b) = (f64::from(a) - mean_a, f64::from(b) - mean_b);
        (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
    }
    if aa * bb > 0.0 { (ab / (aa * bb).sqrt()) as f32 } else { 0.0 }
}
