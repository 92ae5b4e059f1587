//! Lookup tables that convert a camera's RGB codes to sRGB, by its transfer curve and range.

use crate::layout::{Range, Transfer};
use bokehcam::color::linear_to_srgb;

/// A new byte for each byte.
pub(super) type Table = [u8; 256];

/// Builds the table for red, green and blue on the curve `transfer`; `None` if it would change nothing.
pub(super) fn build_table(transfer: Transfer, range: Range) -> Option<Box<Table>> {
    // Exponent that yields linear light; `None` for curves that are shown unchanged.
    let exponent = match transfer {
        Transfer::Linear => Some(1.0),
        Transfer::Gamma(tenths) => Some(f64::from(tenths) / 10.0),
        Transfer::Display | Transfer::Pq => None,
    };
    if exponent.is_none() && range == Range::Full {
        return None;
    }
    let mut table = Box::new([0; 256]);
    for (code, byte) in table.iter_mut().enumerate() {
        let value = match range {
            Range::Full => code as f64 / 255.0,
            Range::Limited => ((code as f64 - 16.0) / 219.0).clamp(0.0, 1.0),
        };
        let shown = exponent.map_or(value, |power| f64::from(linear_to_srgb(value.powf(power) as f32)));
        *byte = (shown * 255.0).round() as u8;
    }
    Some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_light_becomes_brighter_and_the_ends_stay() {
        assert!(build_table(Transfer::Display, Range::Full).is_none());
        let linear = build_table(Transfer::Linear, Range::Full).unwrap();
        // Middle grey reflects 18 to 22 per cent.
        assert_eq!((linear[0], linear[55], linear[255]), (0, 128, 255));
        let near = build_table(Transfer::Gamma(22), Range::Full).unwrap();
        assert!(near.iter().zip(0..=255u8).all(|(&byte, code)| byte.abs_diff(code) <= 9), "{near:?}");
        let limited = build_table(Transfer::Display, Range::Limited).unwrap();
        assert_eq!((limited[0], limited[16], limited[126], limited[235], limited[255]), (0, 0, 128, 255, 255));
    }
}
