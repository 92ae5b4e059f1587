//! The calibration file of a depth camera relative to the colour camera.

use std::path::Path;

use glam::{Mat3, Vec3};
use serde::Deserialize;
use toml::Spanned;

use super::SourceError;
use crate::depth::registration::{Calibration, CalibrationError, Pinhole, Registration};
use crate::files::input;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    depth: Spanned<Camera>,
    color: Spanned<Camera>,
    #[serde(rename = "depth-to-color")]
    pose: Spanned<Pose>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Camera {
    width: u32,
    height: u32,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    rotation: [f32; 9],
    translation_m: [f32; 3],
}

impl Camera {
    fn to_pinhole(&self) -> Pinhole {
        let &Self { width, height, fx, fy, cx, cy } = self;
        Pinhole { width, height, fx, fy, cx, cy }
    }
}

/// Reads the calibration file `path`.
///
/// # Errors
/// The file is unreadable, has a wrong or missing key, or invalid numbers.
pub fn load_registration(path: &Path) -> Result<Registration, SourceError> {
    parse_registration(
        path,
        &input::read_text(path, input::MAX_CALIBRATION_BYTES)
            .map_err(|source| SourceError::Io { path: path.to_owned(), source })?,
    )
}

/// Parses the text of the calibration file `path`.
///
/// # Errors
/// The text is not a depth calibration.
pub fn parse_registration(path: &Path, text: &str) -> Result<Registration, SourceError> {
    let refuse = |at: usize, what: String| SourceError::Registration {
        path: path.to_owned(),
        line: text[..at.min(text.len())].matches('\n').count() + 1,
        what,
    };
    let file: File = toml::from_str(text).map_err(|error| {
        refuse(error.span().map_or(0, |span| span.start), error.message().trim().replace('\n', ", "))
    })?;
    let pose = file.pose.get_ref();
    let calibration = Calibration {
        depth: file.depth.get_ref().to_pinhole(),
        color: file.color.get_ref().to_pinhole(),
        rotation: Mat3::from_cols_array(&pose.rotation).transpose(),
        translation_m: Vec3::from_array(pose.translation_m),
    };
    Registration::new(calibration).map_err(|error| {
        let table = match error {
            CalibrationError::Depth(_) => file.depth.span(),
            CalibrationError::Color(_) => file.color.span(),
            CalibrationError::Pose(_) => file.pose.span(),
        };
        refuse(table.start, error.to_string())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::DepthMap;

    const GOOD: &str = "\
# measured
[depth]
width = 4
height = 2
fx = 4
fy = 4.0
cx = 1.5
cy = 0.5
[color]
width = 4
height = 2
fx = 4.0
fy = 4.0
cx = 1.5
cy = 0.5
[depth-to-color]
rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]
translation_m = [0.5, 0, 0]
";

    fn refusal(text: &str) -> String {
        parse_registration(Path::new("c.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn a_calibration_is_read() {
        let from = DepthMap { width: 4, height: 2, metres: vec![1.0; 8], ..DepthMap::default() };
        let mut into = DepthMap::default();
        parse_registration(Path::new("c.toml"), GOOD).unwrap().register(&from, &mut into);
        assert_eq!(into.metres, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0], "half a metre to the right is two pixels");
        // Row by row: a quarter turn about the optical axis maps x to y.
        let turned = GOOD.replace("1, 0, 0, 0, 1, 0, 0, 0, 1", "0, -1, 0, 1, 0, 0, 0, 0, 1").replace("[0.5", "[0");
        let from = DepthMap {
            width: 4,
            height: 2,
            metres: vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..DepthMap::default()
        };
        parse_registration(Path::new("c.toml"), &turned).unwrap().register(&from, &mut into);
        assert_eq!(into.metres, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, line, what) in [
            (GOOD.replace("cx = 1.5\ncy = 0.5\n[color]", "cx = 1.5\n[color]"), 2, "cy"),
            (GOOD.replacen("fy = 4.0\ncx", "fyy = 4.0\ncx", 1), 6, "fyy"),
            (GOOD.replace("[depth-to-color]", "[pose]"), 16, "pose"),
            (GOOD.replace("fx = 4\n", "fx = 0\n"), 2, "fx and fy"),
            (GOOD.replace("fx = 4\n", "fx = \"wide\"\n"), 5, "wide"),
            (GOOD.replace("[1, 0, 0,", "[2, 0, 0,"), 16, "rotation"),
            (GOOD.replace("[1, 0, 0,", "["), 17, "9"),
            (GOOD.replace("[0.5,", "[500,"), 16, "metres"),
            (GOOD.replacen("width = 4\n", "width = -4\n", 1), 3, "-4"),
            ("fx = ".to_string(), 1, ""),
            (String::new(), 1, "depth"),
        ] {
            let refusal = refusal(&text);
            assert!(refusal.starts_with(&format!("c.toml:{line}: ")), "{refusal}");
            assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}");
        }
    }
}
