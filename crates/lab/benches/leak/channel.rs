//! How a card reaches an attacker.

use std::fmt;
use std::str::FromStr;

use crate::experiment::call::{Call, CallSettings, hand_held_shifts_px};
use crate::experiment::card::Card;
use crate::experiment::codec::Codec;
use crate::experiment::observation::Observation;

use super::Outcome;

/// A camera at rest or in a hand, and a codec or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Whether the camera moves.
    pub moves: bool,
    /// The codec; without one, pictures of 8 bits arrive as they are.
    pub codec: Option<Codec>,
}

impl Channel {
    /// Shows the card in a call, and returns what an attacker makes of up to `frames` frames: perfectly registered, and
    /// averaged. Equal frames without a codec are one.
    pub fn observe(self, card: &Card, settings: &CallSettings, frames: u16) -> Outcome<Observation> {
        let count = if self.moves || self.codec.is_some() { usize::from(frames) } else { 1 };
        let shifts_px = if self.moves { hand_held_shifts_px(count) } else { vec![(0.0, 0.0); count] };
        let mut call = Call::new(card, settings)?;
        let mut shown = Vec::with_capacity(count);
        for &shift_px in &shifts_px {
            shown.push(call.show(&card.draw(shift_px))?);
        }
        let received = match self.codec {
            Some(codec) => codec.transmit(&shown)?,
            None => shown,
        };
        Ok(Observation::new(&received, &shifts_px, card.wall_right()))
    }
}

impl FromStr for Channel {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        let (motion, codec) = name.split_once('-').map_or((name, None), |(motion, codec)| (motion, Some(codec)));
        let moves = match motion {
            "still" => false,
            "moving" => true,
            _ => return Err("use still or moving, alone or with -x264 or -vp8".to_owned()),
        };
        Ok(Self { moves, codec: codec.map(Codec::from_str).transpose()? })
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.moves { "moving" } else { "still" })?;
        self.codec.map_or(Ok(()), |codec| write!(f, "-{}", codec.name()))
    }
}
