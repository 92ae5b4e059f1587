//! Colour spaces of pictures: what their files state, as an ICC profile (ICC.1:2022), its tone curves, and conversions
//! between it and sRGB.

use std::sync::Arc;

use moxcms::{
    Chromaticity, CicpColorPrimaries, CicpProfile, ColorPrimaries, ColorProfile, Layout, MatrixCoefficients,
    ToneReprCurve, TransferCharacteristics, TransformOptions,
};
use png::chunk::ChunkType;

use bokehcam::color::{ToneCurve, ToneCurves, linear_to_srgb};
use bokehcam::compute::catch_panic;

/// What a profile without usable tone curves means for the blur, for a message.
pub(super) const NO_CURVES: &str = "its colour profile has tables instead of tone curves, or is damaged; it is kept, and \
                                    the blur uses sRGB's tone curve";

/// Position of the colour space in a profile.
const SPACE: std::ops::Range<usize> = 16..20;

/// The gamma that a PNG states for sRGB's curve, which is no power.
const SRGB_GAMMA: f32 = 0.45455;

/// Difference of colorants (XYZ of the primaries) that counts as rounding.
const COLORANT_TOLERANCE: f64 = 0.003;

/// Returns whether a profile is for RGB values.
pub(super) fn is_rgb(profile: &[u8]) -> bool {
    profile.get(SPACE) == Some(b"RGB ")
}

/// Returns the profile of a PNG: of its chunks, the first of cICP, iCCP, sRGB and gAMA with cHRM that is there (PNG,
/// third edition, section 4.3). `None` is sRGB.
pub(super) fn of_png(info: &png::Info) -> Option<Vec<u8>> {
    let from_code_points = |points: png::CodingIndependentCodePoints| {
        let cicp = CicpProfile {
            color_primaries: CicpColorPrimaries::try_from(points.color_primaries).ok()?,
            transfer_characteristics: TransferCharacteristics::try_from(points.transfer_function).ok()?,
            matrix_coefficients: MatrixCoefficients::Identity,
            full_range: points.is_video_full_range_image,
        };
        let profile = ColorProfile::new_from_cicp(cicp);
        profile.red_trc.is_some().then_some(profile)
    };
    let stated = |profile: ColorProfile| catch_panic(|| profile.encode().ok()).flatten();
    if let Some(profile) = info.coding_independent_code_points.and_then(from_code_points) {
        return stated(profile);
    }
    if info.icc_profile.is_some() || info.srgb.is_some() {
        return info.icc_profile.as_deref().map(<[u8]>::to_vec);
    }
    let gamma = info.gama_chunk.map_or(SRGB_GAMMA, png::ScaledFloat::into_value);
    let mut profile = ColorProfile::new_srgb();
    if (gamma / SRGB_GAMMA - 1.0).abs() > 0.02 {
        let curve = Some(ToneReprCurve::Parametric(vec![1.0 / gamma.clamp(0.05, 20.0)]));
        (profile.red_trc, profile.green_trc, profile.blue_trc, profile.cicp) =
            (curve.clone(), curve.clone(), curve, None);
    }
    if let Some(stated) = info.chrm_chunk {
        let at = |(x, y): (png::ScaledFloat, png::ScaledFloat)| Chromaticity::new(x.into_value(), y.into_value());
        let primaries = ColorPrimaries { red: at(stated.red), green: at(stated.green), blue: at(stated.blue) };
        profile.update_rgb_colorimetry(at(stated.white).to_xyyb(), primaries);
    }
    (!has_srgb_primaries(&profile) || profile.cicp.is_none() && !has_srgb_curves(&profile))
        .then(|| stated(profile))
        .flatten()
}

/// Returns the chunks of a PNG that state its colours other than by a profile, and its print size, to be written again.
pub(super) fn chunks_of_png(info: &png::Info) -> Vec<([u8; 4], Vec<u8>)> {
    // A profile and sRGB have priority over these two.
    let counts = info.icc_profile.is_none() && info.srgb.is_none();
    let gamma =
        info.gama_chunk.filter(|_| counts).map(|gamma| (png::chunk::gAMA, gamma.into_scaled().to_be_bytes().to_vec()));
    let primaries =
        info.chrm_chunk.filter(|_| counts).map(|primaries| (png::chunk::cHRM, primaries.to_be_bytes().to_vec()));
    let points = info.coding_independent_code_points.map(|points| {
        let range = u8::from(points.is_video_full_range_image);
        (png::chunk::cICP, vec![points.color_primaries, points.transfer_function, points.matrix_coefficients, range])
    });
    let size = info.pixel_dims.map(|size| {
        let unit = matches!(size.unit, png::Unit::Meter);
        (png::chunk::pHYs, [&size.xppu.to_be_bytes()[..], &size.yppu.to_be_bytes(), &[u8::from(unit)]].concat())
    });
    [gamma, primaries, points, size].into_iter().flatten().map(|(ChunkType(name), data)| (name, data)).collect()
}

/// Returns the profile of Adobe RGB (1998).
pub(super) fn adobe_rgb() -> Option<Vec<u8>> {
    ColorProfile::new_adobe_rgb().encode().ok()
}

/// Returns whether a chunk of a PNG states colours.
pub(super) fn is_color_chunk(name: [u8; 4]) -> bool {
    name != png::chunk::pHYs.0
}

/// Converts 8-bit codes of a profile to sRGB; returns whether they were of another colour space. A damaged profile is
/// ignored.
pub(super) fn convert_to_srgb(profile: &[u8], rgb: &mut [u8]) -> bool {
    let converted = catch_panic(|| {
        let profile = ColorProfile::new_from_slice(profile).ok()?;
        let is_srgb = has_srgb_primaries(&profile) && has_srgb_curves(&profile);
        (!is_srgb).then(|| convert(&profile, &ColorProfile::new_srgb(), rgb))?
    });
    converted.flatten().is_some()
}

/// Converts 8-bit sRGB codes to the primaries of a profile, in sRGB's tone curve.
pub(super) fn convert_to_primaries(profile: &[u8], rgb: &mut [u8]) {
    catch_panic(|| {
        let profile = ColorProfile::new_from_slice(profile).ok()?;
        let srgb = ColorProfile::new_srgb();
        let mut target = srgb.clone();
        target.cicp = None;
        (target.red_colorant, target.green_colorant, target.blue_colorant) =
            (profile.red_colorant, profile.green_colorant, profile.blue_colorant);
        (!has_srgb_primaries(&target)).then(|| convert(&srgb, &target, rgb))?
    });
}

fn convert(from: &ColorProfile, to: &ColorProfile, rgb: &mut [u8]) -> Option<()> {
    let transform = from.create_transform_8bit(Layout::Rgb, to, Layout::Rgb, TransformOptions::default()).ok()?;
    let mut converted = vec![0; rgb.len().min(3 << 16)];
    for codes in rgb.chunks_mut(3 << 16) {
        let converted = &mut converted[..codes.len()];
        transform.transform(codes, converted).ok()?;
        codes.copy_from_slice(converted);
    }
    Some(())
}

/// Returns whether the primaries of a profile are those of sRGB, or not stated.
fn has_srgb_primaries(profile: &ColorProfile) -> bool {
    let srgb = ColorProfile::new_srgb();
    let all = |profile: &ColorProfile| [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
    let pairs = all(profile).into_iter().zip(all(&srgb));
    let is_stated = all(profile).iter().any(|color| color.y != 0.0);
    let far = |a: f64, b: f64| (a - b).abs() > COLORANT_TOLERANCE;
    !is_stated || !pairs.into_iter().any(|(a, b)| far(a.x, b.x) || far(a.y, b.y) || far(a.z, b.z))
}

/// Returns whether the tone curves of a profile, if it has any, are sRGB's up to a tenth of an 8-bit code. Some codes tell
/// that, as every frame of a folder of pictures may have a profile.
fn has_srgb_curves(profile: &ColorProfile) -> bool {
    const STEPS: u8 = 64;
    let is_srgb = |curve: &ToneReprCurve| {
        let Ok(evaluator) = curve.make_linear_evaluator() else { return false };
        let mut codes = (0..=STEPS).map(|step| f32::from(step) / f32::from(STEPS));
        codes.all(|code| (linear_to_srgb(evaluator.evaluate_value(code)) - code).abs() * 255.0 < 0.1)
    };
    [&profile.red_trc, &profile.green_trc, &profile.blue_trc].into_iter().flatten().all(is_srgb)
}

/// Returns the tone curves of an RGB profile; `None` if it has none.
pub(super) fn read_tone_curves(profile: &[u8]) -> Option<ToneCurves> {
    catch_panic(|| curves_of(&ColorProfile::new_from_slice(profile).ok()?)).flatten()
}

fn curves_of(profile: &ColorProfile) -> Option<ToneCurves> {
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

    #[test]
    fn colours_of_another_space_are_converted_both_ways() {
        let adobe = ColorProfile::new_adobe_rgb().encode().unwrap();
        // A colour within both, by the matrices of Adobe RGB (1998).
        let mut rgb = [99, 175, 75];
        assert!(convert_to_srgb(&adobe, &mut rgb));
        assert!(rgb.iter().zip([0, 177, 64]).all(|(a, b)| a.abs_diff(b) <= 3), "{rgb:?}");
        for profile in [ColorProfile::new_srgb().encode().unwrap(), vec![7; 200]] {
            let mut rgb = [1, 2, 3];
            assert!(!convert_to_srgb(&profile, &mut rgb));
            convert_to_primaries(&profile, &mut rgb);
            assert_eq!(rgb, [1, 2, 3]);
        }
        let p3 = ColorProfile::new_display_p3().encode().unwrap();
        let mut there = [200, 40, 90];
        convert_to_primaries(&p3, &mut there);
        assert_ne!(there, [200, 40, 90]);
        // Display P3 has sRGB's curve.
        convert_to_srgb(&p3, &mut there);
        assert!(there.iter().zip([200, 40, 90]).all(|(a, b)| a.abs_diff(b) <= 2), "{there:?}");
    }

    #[test]
    fn a_png_states_its_colours_in_four_ways() {
        let mut info = png::Info::with_size(1, 1);
        assert_eq!(of_png(&info), None);
        info.gama_chunk = Some(png::ScaledFloat::from_scaled(45455));
        assert_eq!(of_png(&info), None, "as sRGB states it");
        info.gama_chunk = Some(png::ScaledFloat::from_scaled(100_000));
        let linear = read_tone_curves(&of_png(&info).unwrap()).unwrap();
        assert!((linear.0[0].decode(32768) - 0.5).abs() < 1e-3);
        info.srgb = Some(png::SrgbRenderingIntent::Perceptual);
        assert_eq!(of_png(&info), None, "sRGB has priority");
        info.coding_independent_code_points = Some(png::CodingIndependentCodePoints {
            color_primaries: 9,
            transfer_function: 16,
            matrix_coefficients: 0,
            is_video_full_range_image: true,
        });
        let pq = read_tone_curves(&of_png(&info).unwrap()).unwrap();
        assert!(pq.0[0].decode(32768) < 0.02, "half of PQ's codes are 92 of 10000 cd/m2");
        assert_eq!(chunks_of_png(&info).len(), 1, "gamma counts for nothing");
    }
}
