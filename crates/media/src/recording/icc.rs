//! The tone curves in ICC colour profiles of the kind matrix and TRC (ICC.1:2022, section 8.3.3).

use std::sync::Arc;

use moxcms::{ColorProfile, ToneReprCurve};

use bokehcam::color::{ToneCurve, ToneCurves};
use bokehcam::compute::catch_panic;

/// What a profile without usable tone curves means for the blur, for a message.
pub(super) const NO_CURVES: &str = "its colour profile has tables instead of tone curves, or is damaged; it is kept, and \
                                    the blur uses sRGB's tone curve";

/// Position of the colour space in a profile.
const SPACE: std::ops::Range<usize> = 16..20;

/// Returns whether a profile is for RGB values.
pub(super) fn is_rgb(profile: &[u8]) -> bool {
    profile.get(SPACE) == Some(b"RGB ")
}

/// Returns the tone curves of an RGB profile; `None` if it has none.
pub(super) fn read_tone_curves(profile: &[u8]) -> Option<ToneCurves> {
    catch_panic(|| read_curves(profile)).flatten()
}

fn read_curves(profile: &[u8]) -> Option<ToneCurves> {
    let profile = ColorProfile::new_from_slice(profile).ok()?;
    let red = read_curve(profile.red_trc.as_ref()?)?;
    // Most profiles have one curve for all.
    let other = |curve: &Option<ToneReprCurve>| match curve == &profile.red_trc {
        true => Some(red.clone()),
        false => read_curve(curve.as_ref()?),
    };
    Some(ToneCurves([red.clone(), other(&profile.green_trc)?, other(&profile.blue_trc)?]))
}

fn read_curve(curve: &ToneReprCurve) -> Option<Arc<ToneCurve>> {
    let evaluator = curve.make_linear_evaluator().ok()?;
    Some(ToneCurve::from_fn(|code| evaluator.evaluate_value(code))).filter(ToneCurve::is_usable).map(Arc::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_of_common_profiles_are_theirs() {
        for (profile, gamma) in [
            (ColorProfile::new_srgb(), None),
            (ColorProfile::new_display_p3(), None),
            (ColorProfile::new_adobe_rgb(), Some(563.0 / 256.0)),
        ] {
            let profile = profile.encode().unwrap();
            let curves = read_tone_curves(&profile).unwrap();
            assert_eq!((is_rgb(&profile), curves.are_srgb()), (true, gamma.is_none()));
            for code in (0..=65535).step_by(257) {
                let (light, code) = (curves.0[1].decode(code), code as f32 / 65535.0);
                let expected = gamma.map_or_else(|| bokehcam::color::srgb_to_linear(code), |gamma| code.powf(gamma));
                assert!((light - expected).abs() < 1e-4, "{code}: {light} instead of {expected}");
            }
        }
    }

    #[test]
    fn profiles_without_curves_are_known() {
        let p3 = ColorProfile::new_display_p3().encode().unwrap();
        assert!(
            (0..p3.len())
                .step_by(7)
                .all(|length| read_tone_curves(&p3[..length]).is_none_or(|curves| curves.are_srgb()))
        );
        let grey = ColorProfile::new_gray_with_gamma(2.2).encode().unwrap();
        assert!(!is_rgb(&grey) && read_tone_curves(&grey).is_none() && read_tone_curves(&[7; 200]).is_none());
    }
}
