//! Pictures of a folder, found, ordered and paired by their names.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs;
use std::path::Path;

use super::MAX_ENTRIES;
use super::error::{RecordingError, Result};

/// Endings of pictures.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Splits the file name of a PNG or JPEG into stem and ending; `None` for another name.
fn split_name(name: &str) -> Option<(&str, &str)> {
    split_known(name, &ENDINGS)
}

/// Splits the file name of a file with one of these endings.
fn split_known<'a>(name: &'a str, endings: &[&str]) -> Option<(&'a str, &'a str)> {
    let is_known = |ending: &str| endings.iter().any(|known| ending.eq_ignore_ascii_case(known));
    name.rsplit_once('.').filter(|(stem, ending)| !stem.is_empty() && !stem.starts_with('.') && is_known(ending))
}

/// Returns the names of the PNG and JPEG files in `folder` whose stems are `wanted`, in natural order (2 before 10).
///
/// # Errors
/// The folder cannot be listed, or contains more than [`MAX_ENTRIES`] of them.
pub(super) fn find_pictures(folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<Vec<String>> {
    find_files(folder, &ENDINGS, wanted)
}

/// Does the same for files with these endings.
///
/// # Errors
/// Same as for [`find_pictures`].
pub(super) fn find_files(folder: &Path, endings: &[&str], wanted: impl Fn(&str) -> bool) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(RecordingError::io("list", folder))? {
        let Ok(name) = entry.map_err(RecordingError::io("list", folder))?.file_name().into_string() else { continue };
        if split_known(&name, endings).is_some_and(|(stem, _)| wanted(stem)) {
            names.push(name);
        }
        if names.len() > MAX_ENTRIES {
            return Err(RecordingError::CrowdedFolder { folder: folder.to_owned(), most: MAX_ENTRIES });
        }
    }
    names.sort_by_cached_key(|name| (natural_key(name), name.clone()));
    Ok(names)
}

/// Returns whether `folder` has a picture whose stem is `wanted`.
pub(super) fn has_pictures(folder: &Path, wanted: impl Fn(&str) -> bool) -> bool {
    has_files(folder, &ENDINGS, wanted)
}

/// Returns whether `folder` has a file with one of these endings whose stem is `wanted`.
pub(super) fn has_files(folder: &Path, endings: &[&str], wanted: impl Fn(&str) -> bool) -> bool {
    let mut names =
        fs::read_dir(folder).into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.any(|name| split_known(&name, endings).is_some_and(|(stem, _)| wanted(stem)))
}

/// Returns the names of the pictures whose stems consist of digits and `_`, in numeric order.
///
/// # Errors
/// Same as for [`find_pictures`]; or there are no such pictures.
pub(super) fn find_numbered_pictures(folder: &Path) -> Result<Vec<String>> {
    let is_number = |stem: &str| stem.bytes().all(|byte| byte.is_ascii_digit() || byte == b'_');
    let names = find_pictures(folder, is_number)?;
    if names.is_empty() { Err(RecordingError::EmptyFolder { folder: folder.to_owned() }) } else { Ok(names) }
}

/// Returns a text that sorts like `name` with its numbers compared by value: each has its length in front.
fn natural_key(name: &str) -> String {
    let mut key = String::with_capacity(name.len() + 3);
    for run in split_digits(name) {
        let number = run.trim_start_matches('0');
        match run.starts_with(|c: char| c.is_ascii_digit()) {
            true => key.extend([&format!("{:03}", number.len()), number]),
            false => key.push_str(&run.to_lowercase()),
        }
    }
    key
}

/// Returns the numbers in a stem, without leading zeros; `None` for a stem without numbers.
fn number_key(stem: &str) -> Option<String> {
    let numbers = split_digits(stem).filter(|run| run.starts_with(|c: char| c.is_ascii_digit()));
    let numbers: Vec<&str> = numbers.map(|run| run.trim_start_matches('0')).collect();
    (!numbers.is_empty()).then(|| numbers.join(" "))
}

/// Splits a text into runs of digits and runs of other characters.
fn split_digits(text: &str) -> impl Iterator<Item = &str> {
    let runs = text.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit());
    let mut at = 0;
    runs.map(move |run| {
        at += run.len();
        &text[at - run.len()..at]
    })
}

/// A kind of pictures in a folder: those whose stems begin and end like this, with a number between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pictures<'a> {
    pub(super) folder: &'a Path,
    pub(super) prefix: &'a str,
    pub(super) suffix: &'a str,
    /// Whether any text may be between.
    pub(super) is_any: bool,
}

impl<'a> Pictures<'a> {
    /// Creates the kind of all pictures in `folder`.
    pub(super) const fn all_in(folder: &'a Path) -> Self {
        Self { folder, prefix: "", suffix: "", is_any: true }
    }

    /// Returns the part of a stem between prefix and suffix; `None` for another kind of picture.
    fn middle<'b>(&self, stem: &'b str) -> Option<&'b str> {
        let middle = stem.strip_prefix(self.prefix)?.strip_suffix(self.suffix)?;
        let is_number = || !middle.is_empty() && middle.bytes().all(|byte| byte.is_ascii_digit());
        (self.is_any || is_number()).then_some(middle)
    }

    /// Returns whether `dir` has such pictures.
    pub(super) fn exist_in(&self, dir: &Path) -> bool {
        has_pictures(&dir.join(self.folder), |stem| self.middle(stem).is_some())
    }

    /// Returns their names in `dir`, in natural order.
    pub(super) fn find_in(&self, dir: &Path) -> Result<Vec<String>> {
        find_pictures(&dir.join(self.folder), |stem| self.middle(stem).is_some())
    }

    fn key(&self, name: &str, by: PairKey) -> Option<String> {
        let middle = self.middle(split_name(name)?.0)?;
        match by {
            PairKey::Name => Some(middle.to_owned()),
            PairKey::Number => number_key(middle),
        }
    }
}

/// What two pictures of a pair have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PairKey {
    /// The stem, apart from prefix and suffix.
    Name,
    /// All numbers in it, by value.
    Number,
}

/// Pairs pictures by name, or if that gives no pair by number. Returns pairs in the order of `names`, and what they
/// have in common.
///
/// # Errors
/// Two pictures of one kind have the same number.
pub(super) fn pair_by_name(
    dir: &Path,
    (color, names): (Pictures, Vec<String>),
    (depth, maps): (Pictures, Vec<String>),
) -> Result<(Vec<(String, String)>, PairKey)> {
    let pair_by = |by| {
        let mut partners = index_by_key(dir, depth, &maps, by)?;
        // Numbers that occur twice must not take the first map that fits.
        index_by_key(dir, color, &names, by)?;
        let pairs =
            names.iter().filter_map(|name| Some((name.clone(), partners.remove(&color.key(name, by)?)?.clone())));
        Ok::<Vec<_>, RecordingError>(pairs.collect())
    };
    let by_name = pair_by(PairKey::Name)?;
    if by_name.is_empty() { Ok((pair_by(PairKey::Number)?, PairKey::Number)) } else { Ok((by_name, PairKey::Name)) }
}

fn index_by_key<'a>(
    dir: &Path,
    pictures: Pictures,
    names: &'a [String],
    by: PairKey,
) -> Result<HashMap<String, &'a String>> {
    let mut index = HashMap::new();
    for name in names {
        let Some(key) = pictures.key(name, by) else { continue };
        match index.entry(key) {
            Entry::Vacant(free) => free.insert(name),
            Entry::Occupied(other) => {
                let path = dir.join(pictures.folder).join(name);
                return Err(RecordingError::SameNumber { path, other: (*other.get()).clone() });
            }
        };
    }
    Ok(index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_by_the_value_of_their_numbers() {
        let sorted = |names: &[&str]| {
            let mut names: Vec<_> = names.iter().map(|name| (natural_key(name), (*name).to_owned())).collect();
            names.sort();
            names.into_iter().map(|(_, name)| name).collect::<Vec<_>>()
        };
        assert_eq!(sorted(&["10.png", "9.png", "1.png"]), ["1.png", "9.png", "10.png"]);
        assert_eq!(sorted(&["IMG_10.jpg", "img_9.jpg", "IMG_011.jpg"]), ["img_9.jpg", "IMG_10.jpg", "IMG_011.jpg"]);
        assert_eq!(sorted(&["b1", "a2", "a1x2", "a1x10", "é3"]), ["a1x2", "a1x10", "a2", "b1", "é3"]);
        assert_eq!(sorted(&["000001_10", "000000_11", "000000_10"]), ["000000_10", "000000_11", "000001_10"]);
        let long = "9".repeat(250);
        assert_eq!(sorted(&[&long, "10"]), ["10", &long]);
    }

    #[test]
    fn numbers_are_equal_by_value() {
        assert_eq!(number_key("frame000017"), number_key("depth17"));
        assert_eq!(number_key("0"), number_key("000"));
        assert_ne!(number_key("1_10"), number_key("11_0"));
        assert_ne!(number_key("1305031102.175304"), number_key("1305031102.160407"));
        assert_eq!(number_key("thumb"), None);
    }

    #[test]
    fn only_pictures_are_found() {
        for (name, stem) in [("a.png", "a"), ("a.b.JPG", "a.b"), ("0001.jpeg", "0001")] {
            assert_eq!(split_name(name).map(|(stem, _)| stem), Some(stem));
        }
        for name in [".png", ".hidden.png", "a.txt", "png", "a.png.part", ""] {
            assert_eq!(split_name(name), None, "{name}");
        }
    }
}
