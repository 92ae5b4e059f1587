//! Pictures of a folder, found, ordered and paired by their names.

use std::collections::HashMap;
use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

use super::MAX_ENTRIES;
use super::error::{RecordingError, Result};

/// Numbers of digits of seconds since 1970, up to the year 2286.
const SECONDS_DIGITS: RangeInclusive<usize> = 9..=10;

/// Endings of pictures.
pub(super) const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "ppm", "pgm"];

/// Splits the file name of a picture into stem and ending; `None` for another name.
fn split_name(name: &str) -> Option<(&str, &str)> {
    split_known(name, &ENDINGS)
}

/// Splits the file name of a file with one of these endings.
fn split_known<'a>(name: &'a str, endings: &[&str]) -> Option<(&'a str, &'a str)> {
    let is_known = |ending: &str| endings.iter().any(|known| ending.eq_ignore_ascii_case(known));
    name.rsplit_once('.').filter(|(stem, ending)| !stem.is_empty() && !stem.starts_with('.') && is_known(ending))
}

/// Returns a stem without a suffix, in whichever case that is written.
pub(super) fn strip_suffix<'a>(stem: &'a str, suffix: &str) -> Option<&'a str> {
    let (start, end) = stem.split_at_checked(stem.len().checked_sub(suffix.len())?)?;
    end.eq_ignore_ascii_case(suffix).then_some(start)
}

/// Returns the names of the PNG, JPEG and PNM files in `folder` whose stems are `wanted`, in natural order (2 before 10).
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

/// Returns a text that sorts like `name` with its numbers compared by value: each has its length in front, but for the
/// decimals of seconds since 1970.
fn natural_key(name: &str) -> String {
    let mut key = String::with_capacity(name.len() + 3);
    let mut before = ["", ""];
    for run in split_digits(name) {
        let number = run.trim_start_matches('0');
        let are_decimals = SECONDS_DIGITS.contains(&before[0].len()) && before[1] == ".";
        match run.starts_with(|c: char| c.is_ascii_digit()) {
            true if are_decimals => key.push_str(run),
            true => key.extend([&format!("{:03}", number.len()), number]),
            false => key.push_str(&run.to_lowercase()),
        }
        before = [before[1], run];
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
        let middle = strip_suffix(stem.strip_prefix(self.prefix)?, self.suffix)?;
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
}

/// What two pictures of a pair have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PairKey {
    /// The stem, apart from prefix and suffix.
    Name,
    /// All numbers in it, by value.
    Numbers,
    /// The first number, which counts the frames where the others are times.
    FirstNumber,
}

impl PairKey {
    /// All, in order of preference.
    const ALL: [Self; 3] = [Self::Name, Self::Numbers, Self::FirstNumber];

    /// Returns what they have in common in words.
    pub(super) fn describe(self) -> &'static str {
        match self {
            Self::Name => "names",
            Self::Numbers => "numbers",
            Self::FirstNumber => "first numbers",
        }
    }

    /// Returns what a stem has of this; `None` for nothing.
    fn of(self, stem: &str) -> Option<String> {
        match self {
            Self::Name => Some(stem.to_owned()),
            Self::Numbers => number_key(stem),
            Self::FirstNumber => number_key(stem)?.split(' ').next().map(str::to_owned),
        }
    }

    /// Returns the position of each stem that has this.
    ///
    /// # Errors
    /// Returns the positions of two stems that have the same.
    fn index(self, stems: &[&str]) -> Result<HashMap<String, usize>, [usize; 2]> {
        let mut index = HashMap::new();
        for (at, stem) in stems.iter().enumerate() {
            let Some(key) = self.of(stem) else { continue };
            if let Some(other) = index.insert(key, at) {
                return Err([other, at]);
            }
        }
        Ok(index)
    }
}

/// The positions of two stems that no map can be told for, and whether they are those of maps.
pub(super) struct Ambiguous {
    pub(super) positions: [usize; 2],
    pub(super) are_maps: bool,
}

/// Pairs the stems of pictures and maps by what pairs all of either, or else some. Returns the position of each picture's
/// map, and what the two have in common.
///
/// # Errors
/// No picture has a map, and two pictures or maps have the same name or number.
pub(super) fn pair_stems(pictures: &[&str], maps: &[&str]) -> Result<(Vec<Option<usize>>, PairKey), Ambiguous> {
    let pair_by = |by: PairKey| {
        let index = by.index(maps).map_err(|positions| Ambiguous { positions, are_maps: true })?;
        // Numbers that occur twice must not take the first map that fits.
        by.index(pictures).map_err(|positions| Ambiguous { positions, are_maps: false })?;
        Ok(pictures.iter().map(|stem| index.get(&by.of(stem)?).copied()).collect::<Vec<_>>())
    };
    let (mut best, mut ambiguous) = (None, None);
    for by in PairKey::ALL {
        match pair_by(by) {
            Ok(pairs) => match pairs.iter().flatten().count() {
                count if count == pictures.len().min(maps.len()) => return Ok((pairs, by)),
                0 => {}
                _ => best = best.or(Some((pairs, by))),
            },
            // A first number that occurs twice counts no frames.
            Err(_) if by == PairKey::FirstNumber => {}
            Err(error) => ambiguous = ambiguous.or(Some(error)),
        }
    }
    match (best, ambiguous) {
        (None, Some(error)) => Err(error),
        (best, _) => Ok(best.unwrap_or_else(|| (vec![None; pictures.len()], PairKey::Name))),
    }
}

/// Pairs pictures as [`pair_stems`] does. Returns pairs in the order of `names`, and what they have in common.
///
/// # Errors
/// No picture has a map, and two pictures or maps have the same name or number.
pub(super) fn pair_by_name(
    dir: &Path,
    (color, names): (Pictures, Vec<String>),
    (depth, maps): (Pictures, Vec<String>),
) -> Result<(Vec<(String, String)>, PairKey)> {
    let middles = |kind: &Pictures, names: &'_ [String]| -> Vec<String> {
        let middle = |name: &String| kind.middle(split_name(name)?.0).map(str::to_owned);
        names.iter().map(|name| middle(name).unwrap_or_default()).collect()
    };
    let [pictures, stems] = [middles(&color, &names), middles(&depth, &maps)];
    let [pictures, stems] = [&pictures, &stems].map(|stems| stems.iter().map(String::as_str).collect::<Vec<_>>());
    let (partners, by) =
        pair_stems(&pictures, &stems).map_err(|Ambiguous { positions: [first, second], are_maps }| {
            let (folder, names) = if are_maps { (depth.folder, &maps) } else { (color.folder, &names) };
            RecordingError::SameNumber { path: dir.join(folder).join(&names[second]), other: names[first].clone() }
        })?;
    let pairs = names.into_iter().zip(partners);
    Ok((pairs.filter_map(|(name, map)| Some((name, maps[map?].clone()))).collect(), by))
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
        // As Python writes them, without zeros at the end.
        let times =
            ["1700000000.0.png", "1700000000.05.png", "1700000000.1.png", "1700000000.15.png", "1700000001.0.png"];
        assert_eq!(sorted(&[times[3], times[1], times[4], times[2], times[0]]), times);
        for burst in [["1.9", "1.10"], ["20240115123000.2", "20240115123000.10"]] {
            assert_eq!(sorted(&[burst[1], burst[0]]), burst);
        }
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
    fn what_pairs_all_decides() {
        let pair = |pictures: &[&str], maps: &[&str]| {
            let (maps, by) = pair_stems(pictures, maps).map_err(|error| error.positions)?;
            Ok((maps.into_iter().map(|map| map.map_or(9, |map| map)).collect::<Vec<_>>(), by))
        };
        assert_eq!(pair(&["a1", "b2"], &["b2", "a1"]), Ok((vec![1, 0], PairKey::Name)));
        assert_eq!(pair(&["rgb1", "rgb2"], &["d01", "d02"]), Ok((vec![0, 1], PairKey::Numbers)));
        // One equal name among times that differ.
        let pictures = ["1-000", "2-331", "3-662"];
        assert_eq!(pair(&pictures, &["1-000", "2-322", "3-655"]), Ok((vec![0, 1, 2], PairKey::FirstNumber)));
        assert_eq!(pair(&["a", "b"], &["c"]), Ok((vec![9, 9], PairKey::Name)));
        // Some have a map.
        assert_eq!(pair(&["a1", "a2", "a3"], &["a2", "b7"]), Ok((vec![9, 0, 9], PairKey::Name)));
        // Two of a number are never told apart by their order.
        assert_eq!(pair(&["a1", "b1"], &["c1"]), Err([0, 1]));
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
