//! Parses and prints the setting of the background behind the subject; its picture or video, if any, is not read yet.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use super::LookError;
use super::files::readers_for;
use crate::depth::backdrop::{Background, BackgroundPicture};

/// The background behind the subject as a setting.
#[derive(Clone, Debug, PartialEq)]
pub enum BackgroundSetting {
    /// Blur, a colour, nothing, or a picture or video that was read.
    Loaded(Background),
    /// `image:FILE`, not read yet.
    Image(PathBuf),
    /// `video:FILE`, not opened yet.
    Video(PathBuf),
}

impl FromStr for BackgroundSetting {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "use blur, color:#RRGGBB, image:FILE, video:FILE or transparent";
        match text.split_once(':') {
            None if text == "blur" => Some(Self::Loaded(Background::Blur)),
            None if text == "transparent" => Some(Self::Loaded(Background::Transparent)),
            Some(("color", color)) => parse_rgb(color).map(|rgb| Self::Loaded(Background::Color(rgb))),
            Some(("image", file)) if !file.is_empty() => Some(Self::Image(file.into())),
            Some(("video", file)) if !file.is_empty() => Some(Self::Video(file.into())),
            None if let Some((_, rgb)) = COLORS.iter().find(|(name, _)| *name == text) => {
                Some(Self::Loaded(Background::Color(*rgb)))
            }
            None if text.starts_with('#') => parse_rgb(text).map(|rgb| Self::Loaded(Background::Color(rgb))),
            // A file name with a picture's extension needs no `image:`.
            _ if is_picture(text) => Some(Self::Image(text.into())),
            _ => None,
        }
        .ok_or_else(|| FORMS.to_string())
    }
}

/// Colours by name. Green and blue are those of chroma-key screens.
const COLORS: [(&str, [u8; 3]); 6] = [
    ("black", [0; 3]),
    ("white", [255; 3]),
    ("grey", [128; 3]),
    ("gray", [128; 3]),
    ("green", [0, 177, 64]),
    ("blue", [0, 71, 187]),
];

/// Returns whether a text is the file name of a picture.
fn is_picture(text: &str) -> bool {
    let ending = Path::new(text).extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Parses `#RRGGBB`; the `#`, with which comments begin in a shell, may be missing.
fn parse_rgb(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'))?;
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
}

impl fmt::Display for BackgroundSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(file) => write!(f, "image:{}", file.display()),
            Self::Video(file) => write!(f, "video:{}", file.display()),
            Self::Loaded(Background::Video(video)) => write!(f, "video:{}", video.file().display()),
            Self::Loaded(Background::Transparent) => f.write_str("transparent"),
            Self::Loaded(Background::Blur) => f.write_str("blur"),
            Self::Loaded(Background::Color([red, green, blue])) => write!(f, "color:#{red:02x}{green:02x}{blue:02x}"),
            Self::Loaded(Background::Picture(picture)) => match &picture.file {
                Some(file) => write!(f, "image:{}", file.display()),
                None => f.write_str("image"),
            },
        }
    }
}

impl BackgroundSetting {
    /// Returns the setting for a background; `None` for a picture without a known file.
    pub fn from_background(behind: &Background) -> Option<Self> {
        match behind {
            Background::Picture(picture) if picture.file.is_none() => None,
            behind => Some(Self::Loaded(behind.clone())),
        }
    }

    /// Returns the file that it names, if there is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Image(file) | Self::Video(file) => Some(file),
            Self::Loaded(Background::Picture(picture)) => picture.file.as_deref(),
            Self::Loaded(Background::Video(video)) => Some(video.file()),
            Self::Loaded(_) => None,
        }
    }

    /// Returns whether results have an alpha channel.
    pub fn is_transparent(&self) -> bool {
        *self == Self::Loaded(Background::Transparent)
    }

    /// Returns the background, and reads its picture, or the first one of its video, if needed.
    ///
    /// # Errors
    /// The picture of `image:FILE` or `video:FILE` cannot be read.
    pub fn load(&self) -> Result<Background, LookError> {
        Ok(match self {
            Self::Loaded(behind) => behind.clone(),
            Self::Image(file) => {
                let image = (readers_for(file)?.picture)(file)?;
                Background::Picture(Arc::new(BackgroundPicture { file: Some(file.clone()), image }))
            }
            Self::Video(file) => Background::Video((readers_for(file)?.video)(file)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::FramingZoom;
    use super::*;

    #[test]
    fn what_is_behind_reads_back_what_it_prints() {
        for text in ["blur", "color:#00b140", "color:#ffffff", "image:a:b.png", "video:a:b.mp4", "transparent"] {
            assert_eq!(text.parse::<BackgroundSetting>().unwrap().to_string(), text);
        }
        assert_eq!("color:00B140".parse::<BackgroundSetting>(), "color:#00b140".parse());
        for (short, whole) in [("#00ff00", "color:#00ff00"), ("green", "color:#00b140"), ("wall.JPG", "image:wall.JPG")]
        {
            assert_eq!(short.parse::<BackgroundSetting>(), whole.parse());
        }
        for text in ["off", "1.5", "4"] {
            assert_eq!(text.parse::<FramingZoom>().unwrap().to_string(), text);
        }
        assert_eq!("1".parse(), Ok(FramingZoom::OFF));
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
            "video:",
            "transparent:1",
        ] {
            assert!(text.parse::<BackgroundSetting>().unwrap_err().contains("color:#RRGGBB"), "{text}");
        }
        for text in ["", "on", "0.5", "4.1", "nan", "-2"] {
            assert!(text.parse::<FramingZoom>().unwrap_err().contains("1 to 4"), "{text}");
        }
    }
}
