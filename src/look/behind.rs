//! What stands behind the subject as it is written: its picture, if any, not yet read.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use crate::depth::backdrop::{Behind, BehindPicture};
use crate::recording::RecordingError;
use crate::recording::still::read_color;

/// What is behind the subject as it is written: its picture, if any, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub enum BehindName {
    /// What needs no reading, or was read.
    Known(Behind),
    /// `image:FILE`, not read.
    Image(PathBuf),
}

impl FromStr for BehindName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "use blur, color:#RRGGBB or image:FILE";
        match text.split_once(':') {
            None if text == "blur" => Some(Self::Known(Behind::Blur)),
            Some(("color", color)) => rgb(color).map(|rgb| Self::Known(Behind::Color(rgb))),
            Some(("image", file)) if !file.is_empty() => Some(Self::Image(file.into())),
            None if let Some((_, rgb)) = COLORS.iter().find(|(name, _)| *name == text) => {
                Some(Self::Known(Behind::Color(*rgb)))
            }
            None if text.starts_with('#') => rgb(text).map(|rgb| Self::Known(Behind::Color(rgb))),
            // What can be nothing else.
            _ if is_picture(text) => Some(Self::Image(text.into())),
            _ => None,
        }
        .ok_or_else(|| FORMS.to_string())
    }
}

/// Colours by name. Green is that of screens that are replaced.
const COLORS: [(&str, [u8; 3]); 6] = [
    ("black", [0; 3]),
    ("white", [255; 3]),
    ("grey", [128; 3]),
    ("gray", [128; 3]),
    ("green", [0, 177, 64]),
    ("blue", [0, 71, 187]),
];

/// Whether a text is the name of a picture.
fn is_picture(text: &str) -> bool {
    let ending = Path::new(text).extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// The colour `#RRGGBB`; the sign, which shells take for a comment, may be missing.
fn rgb(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'))?;
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
}

impl fmt::Display for BehindName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(file) => write!(f, "image:{}", file.display()),
            Self::Known(Behind::Blur) => f.write_str("blur"),
            Self::Known(Behind::Color([red, green, blue])) => write!(f, "color:#{red:02x}{green:02x}{blue:02x}"),
            Self::Known(Behind::Picture(picture)) => match &picture.file {
                Some(file) => write!(f, "image:{}", file.display()),
                None => f.write_str("image"),
            },
        }
    }
}

impl BehindName {
    /// The name of what is behind; a picture of which no file is known has none.
    pub fn of(behind: &Behind) -> Option<Self> {
        match behind {
            Behind::Picture(picture) if picture.file.is_none() => None,
            behind => Some(Self::Known(behind.clone())),
        }
    }

    /// What is behind.
    ///
    /// # Errors
    /// The picture of `image:FILE` cannot be read.
    pub fn load(&self) -> Result<Behind, RecordingError> {
        Ok(match self {
            Self::Known(behind) => behind.clone(),
            Self::Image(file) => {
                Behind::Picture(Arc::new(BehindPicture { file: Some(file.clone()), image: read_color(file)? }))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Follow;
    use super::*;

    #[test]
    fn what_is_behind_reads_back_what_it_prints() {
        for text in ["blur", "color:#00b140", "color:#ffffff", "image:a:b.png"] {
            assert_eq!(text.parse::<BehindName>().unwrap().to_string(), text);
        }
        assert_eq!("color:00B140".parse::<BehindName>(), "color:#00b140".parse());
        for (short, whole) in [("#00ff00", "color:#00ff00"), ("green", "color:#00b140"), ("wall.JPG", "image:wall.JPG")]
        {
            assert_eq!(short.parse::<BehindName>(), whole.parse());
        }
        for text in ["off", "1.5", "4"] {
            assert_eq!(text.parse::<Follow>().unwrap().to_string(), text);
        }
        assert_eq!("1".parse(), Ok(Follow::OFF));
    }

    #[test]
    fn wrong_values_say_what_is_accepted() {
        for text in [
            "",
            "greenish",
            "color",
            "#12345",
            "wall",
            ".png",
            "file:wall",
            "color:#12345",
            "color:#1234567",
            "color:+12345",
            "color:#gg0000",
            "image:",
        ] {
            assert!(text.parse::<BehindName>().unwrap_err().contains("color:#RRGGBB"), "{text}");
        }
        for text in ["", "on", "0.5", "4.1", "nan", "-2"] {
            assert!(text.parse::<Follow>().unwrap_err().contains("1 to 4"), "{text}");
        }
    }
}
