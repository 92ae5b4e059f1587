//! Parses Middlebury's `calib.txt`: `key=value` lines; `cam0` and `cam1` are 3x3 matrices, `baseline` is in
//! millimetres, `doffs` is the column of the right principal point minus that of the left one, `ndisp` bounds the
//! disparities.

use crate::recording::MAX_SIDE_PX;
use crate::recording::fault::GeometryFault;
use crate::recording::geometry::{Geometry, GeometryError, create_rig, parse_numbers};

const MM_PER_M: f64 = 1000.0;

/// Returns whether the text has a key of this format.
pub(in crate::recording) fn is_middlebury(text: &str) -> bool {
    let keys = ["cam0", "cam1", "baseline", "doffs"];
    text.lines().any(|line| line.split_once('=').is_some_and(|(key, _)| keys.contains(&key.trim())))
}

/// Parses the geometry of the pair. Either `cam1` or `doffs` may be missing. An `ndisp` of the full width, as in ETH3D,
/// is ignored, as it bounds nothing.
pub(in crate::recording) fn parse(text: &str) -> Result<Geometry, GeometryError> {
    let find = |wanted: &str| {
        let mut lines = (1..).zip(text.lines());
        lines.find_map(|(line, text)| {
            let (key, value) = text.split_once('=')?;
            (key.trim() == wanted).then(|| (line, value.trim()))
        })
    };
    let wrong = |line: u32, key: &str, expected, found: &str| {
        let found = found.chars().take(40).collect();
        (Some(line), GeometryFault::Value { key: key.to_owned(), expected, found })
    };
    let missing = |key: &str| (None, GeometryFault::Missing(key.to_owned()));
    let number = |key: &str| match find(key) {
        None => Ok(None),
        Some((line, value)) => match parse_numbers(value) {
            Some([number]) => Ok(Some((line, number))),
            None => Err(wrong(line, key, "a number", value)),
        },
    };
    let pixels = |key: &str| match find(key) {
        None => Ok(None),
        Some((line, value)) => match value.parse::<u32>() {
            Ok(number) if (1..=MAX_SIDE_PX).contains(&number) => Ok(Some(number)),
            _ => Err(wrong(line, key, "a whole number of pixels", value)),
        },
    };
    // Line, focal length, and column of the principal point, in pixels.
    let camera = |key: &str| match find(key) {
        None => Ok(None),
        Some((line, value)) => match parse_numbers::<9>(value).filter(|matrix| matrix[0] > 0.0) {
            Some(matrix) => Ok(Some((line, matrix[0], matrix[2]))),
            None => Err(wrong(line, key, "`[f 0 cx; 0 f cy; 0 0 1]` with f > 0", value)),
        },
    };

    let (left_line, left_px, left_x_px) = camera("cam0")?.ok_or_else(|| missing("cam0"))?;
    let right = camera("cam1")?;
    let (right_line, right_px, right_x_px) = right.unwrap_or((left_line, left_px, left_x_px));
    let doffs_px = match number("doffs")? {
        Some((_, doffs_px)) => doffs_px,
        None if right.is_some() => right_x_px - left_x_px,
        None => return Err(missing("doffs")),
    };
    let (baseline_line, baseline_mm) = number("baseline")?.ok_or_else(|| missing("baseline"))?;
    let size = pixels("width")?.zip(pixels("height")?);
    let bound = size.map_or(MAX_SIDE_PX, |(width, _)| width);
    let disparity_count = pixels("ndisp")?.filter(|&count| count < bound).map(|count| count.next_multiple_of(16));
    let rig = create_rig([left_px, right_px], doffs_px, baseline_mm / MM_PER_M).map_err(|fault| match fault {
        GeometryFault::UnequalFocal(..) => (Some(right_line), fault),
        fault => (Some(baseline_line), fault),
    })?;
    Ok(Geometry { rig, size, disparity_count })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]\ncam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]\n\
                        doffs=31.086\nbaseline=193.001\nwidth=741\nheight=497\nndisp=70\nisint=0\nvmin=7\nvmax=61\n";

    #[test]
    fn a_calibration_is_read() {
        let read = parse(GOOD).unwrap();
        assert_eq!((read.rig.focal_px, read.rig.baseline_m, read.rig.doffs_px), (994.978, 0.193_001, 31.086));
        assert_eq!((read.size, read.disparity_count, read.rig.metric), (Some((741, 497)), Some(80), true));
        // Without doffs, it follows from the cameras.
        assert_eq!(parse(&GOOD.replace("doffs", "#doffs")).unwrap().rig.doffs_px, 31.086);
        // ETH3D: the width as ndisp.
        assert_eq!(parse(&GOOD.replace("ndisp=70", "ndisp=741")).unwrap().disparity_count, None);
        assert_eq!(parse(&GOOD.replace("width", "w")).unwrap().size, None);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for key in ["cam0", "baseline"] {
            let without = GOOD.replace(key, "other");
            assert_eq!(parse(&without), Err((None, GeometryFault::Missing(key.into()))));
        }
        let neither = GOOD.replace("doffs", "other").replace("cam1", "other");
        assert_eq!(parse(&neither), Err((None, GeometryFault::Missing("doffs".into()))));
        for (from, to, line) in [
            ("cam0=[994.978 0", "cam0=[994.978", 1),
            ("cam1=[994.978", "cam1=[0", 2),
            ("doffs=31.086", "doffs=far", 3),
            ("baseline=193.001", "baseline=1 2", 4),
            ("width=741", "width=0", 5),
            ("height=497", "height=49.7", 6),
            ("ndisp=70", "ndisp=-1", 7),
        ] {
            let (found, fault) = parse(&GOOD.replace(from, to)).unwrap_err();
            assert_eq!(found, Some(line), "{to}");
            assert!(matches!(fault, GeometryFault::Value { .. }), "{fault}");
        }
        let refusal = |from: &str, to: &str| parse(&GOOD.replace(from, to)).unwrap_err();
        assert_eq!(refusal("193.001", "0"), (Some(4), GeometryFault::NoBaseline));
        assert_eq!(refusal("193.001", "-193"), (Some(4), GeometryFault::Swapped(0.193)));
        assert_eq!(refusal("cam1=[994.978", "cam1=[900"), (Some(2), GeometryFault::UnequalFocal(994.978, 900.0)));
    }
}
