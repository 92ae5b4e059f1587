//! The card: lines of text, or a poster, on a wall.

use std::str::FromStr;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use bokehcam::frame::{ColorImage, DepthMap};

use super::light::Light;

/// Roboto Regular (Apache-2.0), the font of the window.
const FONT: &[u8] = include_bytes!("../../../../window/src/fonts/Roboto-Regular.ttf");
/// Sizes of the lines of text: the em of the font, in pixels.
pub const TEXT_SIZES_PX: [u32; 5] = [14, 20, 28, 40, 56];
/// Sizes of the poster's letters.
const POSTER_SIZES_PX: [u32; 2] = [80, 112];
/// Periods of the poster's bars, in pixels.
const POSTER_PERIODS_PX: [u32; 3] = [16, 32, 64];
/// Height of a row of bars.
const BARS_HEIGHT_PX: usize = 32;
/// Top and left margin of the card.
const TOP_PX: usize = 40;
const LEFT_PX: usize = 60;
/// Gap between rows.
const GAP_PX: usize = 22;
/// Heights of a line and of what is scored of it, per font size.
const LINE_PER_SIZE: f32 = 1.5;
const SCORED_PER_SIZE: f32 = 1.25;
/// Right end of what is scored, as a fraction of the width.
const SCORED_RIGHT: f32 = 0.646;
/// The person: left and right end as fractions of the width, top as a fraction of the height.
const PERSON: [f32; 3] = [0.729, 0.9375, 0.222];

/// Distances of the wall and of the person, in metres.
pub const WALL_M: f32 = 3.0;
/// See [`WALL_M`].
pub const PERSON_M: f32 = 0.8;

/// What is on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Dark text on a light wall.
    Dark,
    /// Light text on a dark wall.
    Light,
    /// Large letters and bars.
    Poster,
}

impl Kind {
    /// All kinds, in the order of the table.
    pub const ALL: [Self; 3] = [Self::Dark, Self::Light, Self::Poster];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Light => "light",
            Self::Poster => "poster",
        }
    }

    /// Codes of paper and ink, in sRGB.
    fn codes(self) -> [f32; 2] {
        match self {
            Self::Dark | Self::Poster => [200.0, 30.0],
            Self::Light => [40.0, 220.0],
        }
    }
}

impl FromStr for Kind {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| format!("there is no card {name}: use dark, light or poster"))
    }
}

/// What a row shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Text of this size.
    Text(u32),
    /// Vertical bars of this period, half of it ink.
    Bars(u32),
}

/// A row of the card, and the pixels that are scored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// What it shows.
    pub content: Content,
    /// First row of pixels, and the one after the last.
    pub top: usize,
    /// See `top`.
    pub bottom: usize,
    /// First column, and the one after the last.
    pub left: usize,
    /// See `left`.
    pub right: usize,
}

/// A card of one size.
#[derive(Clone, Debug)]
pub struct Card {
    /// What is on it.
    pub kind: Kind,
    /// Columns and rows of the picture.
    pub size: (u32, u32),
    /// The rows, which begin at the top and end at the bottom of the picture.
    pub rows: Vec<Row>,
    words: String,
}

impl Card {
    /// Lays out a card of `size` (columns, rows) pixels with these words. Rows that do not fit are left out.
    pub fn new(kind: Kind, size: (u32, u32), words: &str) -> Self {
        let contents: Vec<Content> = match kind {
            Kind::Dark | Kind::Light => TEXT_SIZES_PX.map(Content::Text).to_vec(),
            Kind::Poster => {
                POSTER_SIZES_PX.map(Content::Text).into_iter().chain(POSTER_PERIODS_PX.map(Content::Bars)).collect()
            }
        };
        let (mut rows, mut top) = (Vec::new(), TOP_PX);
        for content in contents {
            let (line_px, scored_px) = match content {
                Content::Text(size_px) => {
                    ((size_px as f32 * LINE_PER_SIZE) as usize, (size_px as f32 * SCORED_PER_SIZE) as usize)
                }
                Content::Bars(_) => (BARS_HEIGHT_PX, BARS_HEIGHT_PX),
            };
            let (bottom, right) = (top + scored_px, (size.0 as f32 * SCORED_RIGHT) as usize);
            if bottom < size.1 as usize && LEFT_PX < right {
                rows.push(Row { content, top, bottom, left: LEFT_PX, right });
            }
            top += line_px + GAP_PX;
        }
        Self { kind, size, rows, words: words.to_owned() }
    }

    /// Draws the card moved by `shift_px` to the right and down, as an 8-bit picture.
    pub fn draw(&self, shift_px: (f32, f32)) -> ColorImage {
        let mut ink = Ink::new(self.size);
        for row in &self.rows {
            let (left, top) = (row.left as f32 + shift_px.0, row.top as f32 + shift_px.1);
            match row.content {
                Content::Text(size_px) => ink.write(&self.words, size_px as f32, (left, top)),
                Content::Bars(period_px) => {
                    ink.draw_bars(period_px as f32, (left, top), (row.bottom - row.top) as f32);
                }
            }
        }
        let [paper, full] = self.kind.codes();
        let code = |&share: &f32| (paper + (full - paper) * share.min(1.0) + 0.5) as u8;
        let rgb = ink.coverage.iter().map(code).flat_map(|code| [code; 3]).collect();
        ColorImage { width: self.size.0, height: self.size.1, rgb }
    }

    /// Returns the card's light at rest: the truth.
    pub fn light(&self) -> Light {
        Light::from_picture(&self.draw((0.0, 0.0)))
    }

    /// Returns the column where the wall ends, and the person begins.
    pub fn wall_right(&self) -> usize {
        (self.size.0 as f32 * PERSON[0]) as usize
    }

    /// Returns the depth: a person at [`PERSON_M`] before a wall at [`WALL_M`].
    pub fn depth(&self) -> DepthMap {
        let (width, height) = self.size;
        let mut map = DepthMap::new(width, height);
        map.metres.fill(WALL_M);
        let [_, right, top] = PERSON;
        let (left, right) = (self.wall_right(), (width as f32 * right) as usize);
        for row in map.metres.chunks_exact_mut(width as usize).skip((height as f32 * top) as usize) {
            row[left..right].fill(PERSON_M);
        }
        map
    }
}

/// Coverage of every pixel by ink.
struct Ink {
    width: usize,
    height: usize,
    coverage: Vec<f32>,
}

impl Ink {
    fn new((width, height): (u32, u32)) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self { width, height, coverage: vec![0.0; width * height] }
    }

    /// Adds coverage to a pixel, if it is inside.
    fn add(&mut self, x: i64, y: i64, coverage: f32) {
        let inside = (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y);
        if inside {
            self.coverage[y as usize * self.width + x as usize] += coverage;
        }
    }

    /// Writes a line whose em is `size_px`, with its upper left corner at `at_px`; what is too long is cut off.
    fn write(&mut self, words: &str, size_px: f32, (left_px, top_px): (f32, f32)) {
        let Ok(font) = FontRef::try_from_slice(FONT) else { return };
        let em_per_unit = font.units_per_em().map_or(1.0, |units| font.height_unscaled() / units);
        let scaled = font.as_scaled(PxScale::from(size_px * em_per_unit));
        let (mut x_px, baseline_px, mut before) = (left_px, top_px + size_px, None);
        for character in words.chars() {
            let id = scaled.glyph_id(character);
            x_px += before.map_or(0.0, |before| scaled.kern(before, id));
            let glyph = id.with_scale_and_position(scaled.scale(), point(x_px, baseline_px));
            if let Some(outline) = font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                outline.draw(|x, y, coverage| {
                    self.add(corner.x as i64 + i64::from(x), corner.y as i64 + i64::from(y), coverage);
                });
            }
            x_px += scaled.h_advance(id);
            before = Some(id);
        }
    }

    /// Draws vertical bars from `at_px` to the right border of what is scored, and as far again as a person's margin.
    fn draw_bars(&mut self, period_px: f32, (left_px, top_px): (f32, f32), height_px: f32) {
        // Ink up to a position, from the first bar's left edge.
        let ink_px = |x_px: f32| {
            let periods = (x_px / period_px).floor();
            periods * period_px / 2.0 + (x_px - periods * period_px).min(period_px / 2.0)
        };
        let right_px = self.width as f32 * PERSON[0] - GAP_PX as f32;
        for y in top_px.floor() as i64..=(top_px + height_px).ceil() as i64 {
            let down = ((y as f32 + 1.0).min(top_px + height_px) - (y as f32).max(top_px)).clamp(0.0, 1.0);
            for x in left_px.floor() as i64..right_px as i64 {
                let from_px = x as f32 - left_px;
                let across = ink_px((from_px + 1.0).max(0.0)) - ink_px(from_px.max(0.0));
                self.add(x, y, down * across);
            }
        }
    }
}
