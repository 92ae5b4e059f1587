//! Patterns of file names, such as `IMG_%04d.jpg`, as C's `printf` and ffmpeg have them.

use std::path::Path;

/// The names of numbered pictures: text, a number, text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pattern {
    before: String,
    /// Minimum number of digits; fewer are filled with zeros.
    digits: usize,
    after: String,
}

impl Pattern {
    /// Parses a file name with one `%d` or `%0Nd`; `%%` is a percent sign. `None` for another name.
    pub(super) fn parse(name: &str) -> Option<Self> {
        let (before, rest) = split_number(name)?;
        let (width, after) = rest.split_once('d')?;
        let digits = match width.strip_prefix('0') {
            Some(digits) => digits.parse().ok().filter(|digits| (1..=19).contains(digits))?,
            None if width.is_empty() => 1,
            None => return None,
        };
        // A second number would be ambiguous.
        split_number(after).is_none().then(|| Self { before, digits, after: after.replace("%%", "%") })
    }

    /// Returns the number in a file name; `None` if the pattern never gives this name.
    pub(super) fn number(&self, name: &str) -> Option<u64> {
        let number = name.strip_prefix(&self.before)?.strip_suffix(&self.after)?;
        let is_filled = number.len() == self.digits || (number.len() > self.digits && !number.starts_with('0'));
        // `parse` alone would accept a sign.
        number.parse().ok().filter(|_| is_filled && number.bytes().all(|byte| byte.is_ascii_digit()))
    }
}

/// Splits a text at its first single `%`; `%%` before it becomes `%`.
fn split_number(text: &str) -> Option<(String, &str)> {
    let mut before = String::new();
    let mut rest = text;
    loop {
        let (text, after) = rest.split_once('%')?;
        before.push_str(text);
        match after.strip_prefix('%') {
            Some(after) => {
                before.push('%');
                rest = after;
            }
            None => return Some((before, after)),
        }
    }
}

/// Splits the path of a pattern into its folder and the pattern; `None` for another path, or one that exists.
pub(super) fn split_pattern(path: &Path) -> Option<(&Path, Pattern)> {
    let pattern = Pattern::parse(path.file_name()?.to_str()?)?;
    let folder = path.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder })?;
    (folder.is_dir() && path.symlink_metadata().is_err()).then_some((folder, pattern))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_that_printf_writes() {
        let number = |pattern: &str, name: &str| Pattern::parse(pattern).unwrap().number(name);
        assert_eq!(number("IMG_%04d.jpg", "IMG_0012.jpg"), Some(12));
        assert_eq!(number("IMG_%04d.jpg", "IMG_12345.jpg"), Some(12345));
        assert_eq!(number("%d.png", "0.png"), Some(0));
        assert_eq!(number("100%%_%03d", "100%_007"), Some(7));
        for name in
            ["IMG_12.jpg", "IMG_012345.jpg", "IMG_0012.png", "img_0012.jpg", "IMG_+012.jpg", "IMG_.jpg", "IMG_0"]
        {
            assert_eq!(number("IMG_%04d.jpg", name), None, "{name}");
        }
        assert_eq!(number("%d", "99999999999999999999999"), None);
    }

    #[test]
    fn other_names_are_no_patterns() {
        for name in ["", "a.png", "100%.png", "100%%.png", "%s.png", "%4d.png", "%00d.png", "%099d.png", "%d_%d.png"] {
            assert_eq!(Pattern::parse(name), None, "{name}");
        }
    }
}
