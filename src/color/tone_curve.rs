//! Tone curves of RGB colour spaces (their TRC, or "gamma"), as tables of 16-bit codes.

use std::sync::{Arc, LazyLock};

use super::{encode_srgb, linear_to_srgb, srgb_to_linear};

/// Number of 16-bit codes.
const CODES: usize = 1 << 16;
/// The table for encoding has a bucket for each 2048th of an octave of light (the upper bits of a float), from
/// [`MIN_LIGHT`] on: at most a few codes of common curves share one.
const BUCKET_SHIFT: u32 = 12;
/// Light in the first bucket; 2^-32, far below the first code of common curves.
const MIN_LIGHT: f32 = 1.0 / 4_294_967_296.0;

/// The linear light of every 16-bit code of one channel, 0 to 1, which never falls.
#[derive(PartialEq)]
pub struct ToneCurve {
    light: Box<[f32]>,
    /// Per bucket of light, the number of codes below it.
    codes_below: Box<[u32]>,
}

/// The tone curves of red, green and blue.
#[derive(Clone, Debug, PartialEq)]
pub struct ToneCurves(pub [Arc<ToneCurve>; 3]);

impl ToneCurve {
    /// Creates a curve from a function of codes in 0 to 1. Its values are clamped to 0 to 1, and to never fall.
    pub fn from_fn(light_of: impl Fn(f32) -> f32) -> Self {
        let mut highest = 0.0_f32;
        let light: Box<[f32]> = (0..CODES)
            .map(|code| {
                // NaN leaves the highest light unchanged.
                highest = highest.max(light_of(code as f32 / 65535.0)).min(1.0);
                highest
            })
            .collect();
        let codes_below = (0..=bucket(1.0) + 1).map(|k| light.partition_point(|&light| bucket(light) < k) as u32);
        Self { codes_below: codes_below.collect(), light }
    }

    /// Returns the linear light of a code.
    #[inline(always)]
    pub fn decode(&self, code: u16) -> f32 {
        self.light[usize::from(code)]
    }

    /// Returns the code whose light is nearest; clamps to 0..1 first.
    #[inline(always)]
    pub fn encode(&self, light: f32) -> u16 {
        let light = if light > 0.0 { light.min(1.0) } else { 0.0 };
        let k = bucket(light);
        let (first, end) = (self.codes_below[k] as usize, self.codes_below[k + 1] as usize);
        // The first code that is at least as light; the bucket ends above the light.
        let above = first + self.light[first..end].partition_point(|&other| other < light);
        match above {
            0 => 0,
            CODES => u16::MAX,
            _ if self.light[above] - light <= light - self.light[above - 1] => above as u16,
            _ => (above - 1) as u16,
        }
    }

    /// Returns the code of the light that an 8-bit sRGB code has.
    pub fn encode_srgb(&self, code: u8) -> u16 {
        self.encode(srgb_to_linear(f32::from(code) / 255.0))
    }

    /// Returns a table of 8-bit sRGB codes with the light of each code.
    pub(super) fn srgb_table(&self) -> Box<[u8]> {
        self.light.iter().map(|&light| encode_srgb(light)).collect()
    }

    /// Returns whether it rises from dark to light at all.
    pub fn is_usable(&self) -> bool {
        self.light[CODES - 1] - self.light[0] > 0.5
    }

    /// Returns whether it equals sRGB's curve, up to a tenth of an 8-bit code.
    pub fn is_srgb(&self) -> bool {
        (0..=255_u16).all(|code| (linear_to_srgb(self.decode(code * 257)) * 255.0 - f32::from(code)).abs() < 0.1)
    }
}

impl std::fmt::Debug for ToneCurve {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ToneCurve({} at half)", self.decode(32768))
    }
}

/// Returns the bucket of light in 0 to 1.
#[inline(always)]
fn bucket(light: f32) -> usize {
    (light.to_bits() >> BUCKET_SHIFT).saturating_sub(MIN_LIGHT.to_bits() >> BUCKET_SHIFT) as usize
}

impl ToneCurves {
    /// Returns sRGB's curve for all channels.
    pub fn srgb() -> &'static Self {
        static SRGB: LazyLock<ToneCurves> = LazyLock::new(|| {
            let curve = Arc::new(ToneCurve::from_fn(srgb_to_linear));
            ToneCurves([curve.clone(), curve.clone(), curve])
        });
        &SRGB
    }

    /// Returns whether all equal sRGB's curve, up to a tenth of an 8-bit code.
    pub fn are_srgb(&self) -> bool {
        self.0.iter().all(|curve| curve.is_srgb())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_common_curves_survives_decoding_and_encoding() {
        let pure = |gamma: f32| ToneCurve::from_fn(move |code| code.powf(gamma));
        let srgb = ToneCurves::srgb().0[0].clone();
        for curve in [&*srgb, &pure(1.0), &pure(563.0 / 256.0), &pure(1.8)] {
            for code in 0..=u16::MAX {
                // The darkest codes of a steep curve may have equal light.
                let again = curve.encode(curve.decode(code));
                assert_eq!(curve.decode(again), curve.decode(code), "{code} {curve:?}");
                assert!(again == code || curve.decode(code) < 1e-9, "{code} {curve:?}");
            }
            assert_eq!([f32::NAN, -1.0, 0.0, 1.0, 2.0].map(|light| curve.encode(light)), [0, 0, 0, 65535, 65535]);
        }
        assert!(srgb.is_srgb() && !pure(2.2).is_srgb());
    }

    #[test]
    fn light_between_two_codes_becomes_the_nearer() {
        let curve = ToneCurve::from_fn(|code| code * code);
        for code in (1..65535).step_by(97) {
            let (here, next) = (curve.decode(code), curve.decode(code + 1));
            assert_eq!(curve.encode(here + 0.4 * (next - here)), code);
            assert_eq!(curve.encode(here + 0.6 * (next - here)), code + 1);
        }
    }

    #[test]
    fn a_curve_of_nonsense_stays_a_curve() {
        let curve = ToneCurve::from_fn(|code| if code < 0.3 { f32::NAN } else { (code * 40.0).sin() * 7.0 });
        let codes: Vec<u16> = (0..100).map(|step| curve.encode(step as f32 / 100.0)).collect();
        assert!(codes.is_sorted());
        assert!(!ToneCurve::from_fn(|_| f32::NAN).is_usable() && !ToneCurve::from_fn(|_| 1.0).is_usable());
    }
}
