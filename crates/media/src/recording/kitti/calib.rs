//! Parses KITTI's `calib.txt`: rows of 12 numbers, each the 3x4 projection matrix of a camera, `P0:` to `P3:` or
//! `P_rect_00:` and so on. Four rows without keys are P0 to P3; fewer are the left and the right camera.

use crate::recording::fault::GeometryFault;
use crate::recording::geometry::{Geometry, GeometryError, create_rig, parse_numbers};

/// A camera's projection matrix: `P[0]` is the focal length and `P[2]` the column of the principal point, both in
/// pixels; `P[3]` is minus the focal length times the camera's offset to the right in metres.
type Projection = [f64; 12];

/// A line with a projection matrix.
struct Row {
    line: u32,
    /// The camera's number; `None` for a row without a key.
    camera: Option<usize>,
    projection: Result<Projection, GeometryFault>,
}

/// Parses the geometry of the cameras `left` and `left + 1`. If `left` is `None`, these are the colour cameras 2 and 3
/// if present, or else 0 and 1.
pub(in crate::recording) fn parse(text: &str, left: Option<usize>) -> Result<Geometry, GeometryError> {
    let rows: Vec<Row> = (1..).zip(text.lines()).filter_map(|(line, text)| parse_row(line, text)).collect();
    if rows.is_empty() {
        return Err((None, GeometryFault::Unknown));
    }
    let keyed = |camera: usize| rows.iter().find(|row| row.camera == Some(camera));
    let keyless = |nth: usize| rows.iter().filter(|row| row.camera.is_none()).nth(nth);
    let left = left.unwrap_or_else(|| if keyed(3).or(keyless(3)).is_some() { 2 } else { 0 });
    let projection_of = |camera: usize| {
        // Four rows without keys are P0 to P3; fewer are the left and the right camera.
        let row = match (keyed(camera), keyless(3)) {
            (Some(row), _) => Some(row),
            (None, Some(_)) => keyless(camera),
            (None, None) => keyless(camera - left),
        };
        let row = row.ok_or_else(|| (None, GeometryFault::Missing(format!("P{camera}"))))?;
        let projection = row.projection.as_ref().map_err(|fault| (Some(row.line), fault.clone()))?;
        Ok((row.line, projection))
    };
    let ((_, left), (line, right)) = (projection_of(left)?, projection_of(left + 1)?);
    let baseline_m = (left[3] - right[3]) / left[0];
    let rig = create_rig([left[0], right[0]], right[2] - left[2], baseline_m).map_err(|fault| (Some(line), fault))?;
    Ok(Geometry { rig, size: None, disparity_count: None })
}

/// Parses the projection matrix in a line; `None` if the line is something else.
fn parse_row(line: u32, text: &str) -> Option<Row> {
    let (key, values) = match text.split_once(':') {
        Some((key, values)) => (key.trim(), values),
        None => ("", text),
    };
    let camera = key.strip_prefix("P_rect_").or_else(|| key.strip_prefix('P')).and_then(|number| number.parse().ok());
    let starts_with_number = text.split_whitespace().next().is_some_and(|word| word.parse::<f64>().is_ok());
    if camera.is_none() && !(key.is_empty() && starts_with_number) {
        return None;
    }
    let projection = parse_numbers(values).filter(|projection: &Projection| projection[0] > 0.0);
    let fault = || GeometryFault::Value {
        key: if key.is_empty() { "the row".to_owned() } else { key.to_owned() },
        expected: "a projection: 12 numbers, the first of them > 0",
        found: values.trim().chars().take(40).collect(),
    };
    Some(Row { line, camera, projection: projection.ok_or_else(fault) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey cameras 0.5 m apart, colour cameras 0.55 m apart, as KITTI writes them.
    const FOUR: &str = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n\
                        P2: 7.0e+02 0 610 42 0 700 180 0.2 0 0 1 0.003\nP3: 700 0 612 -343 0 700 180 0 0 0 1 0\n\
                        Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";

    #[test]
    fn the_baseline_is_the_difference_of_the_cameras() {
        for (left, baseline_m, doffs_px) in [(Some(0), 0.5, 0.0), (Some(2), 0.55, 2.0), (None, 0.55, 2.0)] {
            let rig = parse(FOUR, left).unwrap().rig;
            assert_eq!((rig.focal_px, rig.baseline_m, rig.doffs_px, rig.metric), (700.0, baseline_m, doffs_px, true));
        }
        let raw = FOUR.replace("P2:", "calib_time: 09-Jan-2012\nP_rect_02:").replace("P3:", "P_rect_03:");
        assert_eq!(parse(&raw, Some(2)), parse(FOUR, Some(2)));
        let keyless: String = FOUR.lines().take(4).map(|line| format!("{}\n", &line[4..])).collect();
        assert_eq!(parse(&keyless, None), parse(FOUR, Some(2)));
        assert_eq!(parse(&keyless, Some(0)), parse(FOUR, Some(0)));
        let two: String = keyless.lines().take(2).map(|line| format!("{line}\n")).collect();
        for left in [None, Some(0), Some(2)] {
            assert_eq!(parse(&two, left), parse(FOUR, Some(0)));
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let refusal = |text: &str| parse(text, Some(2)).unwrap_err();
        let (line, fault) = refusal(&FOUR.replace("-343", "42"));
        assert_eq!((line, fault), (Some(4), GeometryFault::NoBaseline));
        let (line, fault) = refusal(&FOUR.replace("-343", "427"));
        assert_eq!((line, fault), (Some(4), GeometryFault::Swapped(0.55)));
        assert_eq!(refusal(&FOUR.replace("P3", "Q3")), (None, GeometryFault::Missing("P3".into())));
        assert_eq!(refusal(&FOUR.replace("P3: 700", "P3: 720")), (Some(4), GeometryFault::UnequalFocal(700.0, 720.0)));
        for wrong in ["P2: 700 0 610", "P2: -7.0e+02", "P2: nan", "P2: seven"] {
            let (line, fault) = refusal(&FOUR.replace("P2: 7.0e+02", wrong));
            assert_eq!(line, Some(3));
            assert!(matches!(fault, GeometryFault::Value { ref key, .. } if key == "P2"), "{fault}");
        }
        for other in ["", "focal 700\nbaseline 0.5\n"] {
            assert_eq!(refusal(other), (None, GeometryFault::Unknown));
        }
    }
}
