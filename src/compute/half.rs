//! Light and coverage in 16 bits: half as many bytes go through the memory.
//!
//! A float without a sign, of 5 bits of exponent and 11 of mantissa: numbers from 2^-21 to 1023 with a relative error of 2^-12
//! at most, a twentieth of the step between two 8-bit codes. Smaller ones, and negative ones, become 0. Conversions are a
//! multiplication and a shift, which every instruction set has as vectors.

/// A number in 16 bits.
pub type Half = u16;

/// Bits of a float's mantissa that are left out.
const DROPPED: u32 = 12;
/// 2^-105 takes the exponents that matter to the lowest that a float has.
const DOWN: f32 = f32::from_bits((127 - 105) << 23);
const UP: f32 = f32::from_bits((127 + 105) << 23);
/// The smallest number that is not 0.
const LEAST: f32 = 1.0 / (1 << 21) as f32;
/// The largest number.
pub const MOST: f32 = 1023.0;

/// The number nearest to `value`.
#[inline(always)]
pub fn to_half(value: f32) -> Half {
    // Comparisons become single vector instructions, and take no denormal number further.
    let value = if value >= LEAST { value } else { 0.0 };
    let value = if value < MOST { value } else { MOST };
    (((value * DOWN).to_bits() + (1 << (DROPPED - 1))) >> DROPPED) as Half
}

/// The value of a number.
#[inline(always)]
pub fn from_half(half: Half) -> f32 {
    f32::from_bits(u32::from(half) << DROPPED) * UP
}

/// Converts as many values as both have.
#[inline(always)]
pub fn store_halves(halves: &mut [Half], values: &[f32]) {
    // A loop, as closures of iterators may be compiled on their own, without vectors.
    for (half, &value) in halves.iter_mut().zip(values) {
        *half = to_half(value);
    }
}

/// Converts as many values as both have.
#[inline(always)]
pub fn load_halves(values: &mut [f32], halves: &[Half]) {
    for (value, &half) in values.iter_mut().zip(halves) {
        *value = from_half(half);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_kept_and_others_become_the_nearest() {
        for half in 0..=u16::MAX {
            let value = from_half(half);
            if half == 0 || (LEAST..=MOST).contains(&value) {
                assert_eq!(to_half(value), half);
            }
        }
        for k in 1..10_000 {
            let value = (k as f32 * 0.01).powi(3) * 1e-3;
            let near = from_half(to_half(value));
            assert!((near - value).abs() <= value / 4096.0 + if value < LEAST { LEAST } else { 0.0 }, "{value} {near}");
        }
        assert_eq!([0.0, 1.0, 0.5].map(|value| from_half(to_half(value))), [0.0, 1.0, 0.5]);
    }

    #[test]
    fn what_no_light_is_becomes_none_and_too_much_the_most() {
        assert_eq!([-1.0, -0.0, 1e-9, f32::NAN].map(|value| from_half(to_half(value))), [0.0; 4]);
        assert_eq!([1e4, f32::INFINITY].map(|value| from_half(to_half(value))), [MOST; 2]);
    }
}
