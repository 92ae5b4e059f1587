//! Parses and prints the aperture setting; its picture, if any, is not read yet.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use super::LookError;
use super::files::readers_for;
use super::number::parse_in_range;
use crate::bokeh::aperture::Shape;

/// The aperture as a setting.
#[derive(Clone, Debug, PartialEq)]
pub enum ApertureSetting {
    /// A shape by name and numbers, or a picture that was read.
    Loaded(Shape),
    /// `image:FILE`, not read yet.
    Image(PathBuf),
}

impl FromStr for ApertureSetting {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "use disc, ring:INNER (0 to below 1), polygon:N[:ROTATION_DEG[:CURVATURE]] (N 3 to 16, \
                             CURVATURE 0 to 1), heart, star:N (3 to 16) or image:FILE";
        if let Some(file) = text.strip_prefix("image:").filter(|file| !file.is_empty()) {
            return Ok(ApertureSetting::Image(file.into()));
        }
        let parts: Vec<&str> = text.split(':').collect();
        let corners = |text: &str| text.parse().ok().filter(|n| (3..=16).contains(n));
        let shape = match parts[..] {
            ["disc"] => Some(Shape::Disc),
            ["heart"] => Some(Shape::Heart),
            ["ring", inner] => parse_in_range(inner, 0.0, 1.0).filter(|r| *r < 1.0).map(|inner| Shape::Ring { inner }),
            ["star", points] => corners(points).map(|points| Shape::Star { points }),
            ["polygon", blades, ref rest @ ..] if rest.len() <= 2 => (|| {
                Some(Shape::Polygon {
                    blades: corners(blades)?,
                    rotation_deg: rest.first().map_or(Some(0.0), |text| parse_in_range(text, -360.0, 360.0))?,
                    curvature: rest.get(1).map_or(Some(0.0), |text| parse_in_range(text, 0.0, 1.0))?,
                })
            })(),
            _ => None,
        };
        shape.map(ApertureSetting::Loaded).ok_or_else(|| FORMS.to_string())
    }
}

impl fmt::Display for ApertureSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shape = match self {
            ApertureSetting::Image(file) => return write!(f, "image:{}", file.display()),
            ApertureSetting::Loaded(shape) => shape,
        };
        match shape {
            Shape::Disc => f.write_str("disc"),
            Shape::Ring { inner } => write!(f, "ring:{inner}"),
            Shape::Polygon { blades, rotation_deg, curvature } => {
                write!(f, "polygon:{blades}")?;
                if *rotation_deg != 0.0 || *curvature != 0.0 {
                    write!(f, ":{rotation_deg}")?;
                }
                if *curvature != 0.0 {
                    write!(f, ":{curvature}")?;
                }
                Ok(())
            }
            Shape::Heart => f.write_str("heart"),
            Shape::Star { points } => write!(f, "star:{points}"),
            Shape::Picture(picture) => match &picture.file {
                Some(file) => write!(f, "image:{}", file.display()),
                None => f.write_str("image"),
            },
        }
    }
}

impl ApertureSetting {
    /// Returns the name of a shape; `None` for a picture without a known file.
    pub fn from_shape(shape: &Shape) -> Option<Self> {
        match shape {
            Shape::Picture(picture) if picture.file.is_none() => None,
            shape => Some(Self::Loaded(shape.clone())),
        }
    }

    /// Returns the shape, and reads its picture if needed.
    ///
    /// # Errors
    /// The picture of `image:FILE` cannot be read.
    pub fn load(&self) -> Result<Shape, LookError> {
        Ok(match self {
            Self::Loaded(shape) => shape.clone(),
            Self::Image(file) => Shape::Picture(Arc::new((readers_for(file)?.aperture)(file)?)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apertures_read_back_what_they_print() {
        for text in
            ["disc", "ring:0.5", "polygon:5", "polygon:6:15", "polygon:8:0:0.5", "heart", "star:5", "image:a:b.png"]
        {
            assert_eq!(text.parse::<ApertureSetting>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn wrong_apertures_say_what_is_accepted() {
        for text in ["", "circle", "ring", "ring:1", "ring:nan", "polygon:2", "polygon:5:0:2", "star:99", "image:"] {
            assert!(text.parse::<ApertureSetting>().unwrap_err().contains("polygon:N"), "{text}");
        }
    }
}
