//! Names of runs.

use std::fmt;
use std::str::FromStr;

/// The name of a run. It is part of a file name, so it has only letters, digits, `-`, `_` and `.`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name(String);

/// Maximum length in bytes: a socket's path has at most 107.
const MAX_BYTES: usize = 32;

impl Name {
    /// Returns the default names, to be tried in order: `base`, `base-2` and so on.
    pub(super) fn default_names(base: &'static str) -> impl Iterator<Item = Self> {
        (1..=u16::MAX).map(move |number| Self(if number == 1 { base.into() } else { format!("{base}-{number}") }))
    }

    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
        match text.as_bytes() {
            [first, ..] if *first != b'.' && *first != b'-' && text.len() <= MAX_BYTES && text.bytes().all(fits) => {
                Ok(Self(text.to_owned()))
            }
            _ => Err(format!("use up to {MAX_BYTES} letters, digits, - _ and ., a letter or digit first")),
        }
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_plain_file_name() {
        for good in ["stream", "stream-2", "Desk_cam.1", "7", &"x".repeat(32)] {
            assert_eq!(good.parse::<Name>().unwrap().as_str(), good);
        }
        for bad in ["", ".", "..", ".hidden", "-n", "a/b", "a b", "café", "x\n", &"x".repeat(33)] {
            assert!(bad.parse::<Name>().unwrap_err().contains("letters"), "{bad:?}");
        }
        let names: Vec<String> = Name::default_names("stream").take(3).map(|name| name.to_string()).collect();
        assert_eq!(names, ["stream", "stream-2", "stream-3"]);
    }
}
