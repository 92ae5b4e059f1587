//! Lists of pictures and their times: text files with one entry per line.

use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::MAX_ENTRIES;
use super::contents::{ListPosition, PictureSource};
use super::error::{RecordingError, Result};
use super::fault::LineFault;
use super::timeline::MAX_LENGTH_NS;
use bokehcam_files::{atomic_file, input};

/// Maximum number of characters that messages quote of faulty text.
const QUOTED_CHARS: usize = 40;

/// A picture and its time.
#[derive(Debug)]
pub(super) struct Entry {
    /// In nanoseconds; `None` if unknown or invalid. If a line states an invalid one, `source` has the fault.
    pub(super) time_ns: Option<u64>,
    pub(super) source: PictureSource,
}

impl Entry {
    /// Creates the entry of a line. A fault of the time replaces the file, because it is reported when the file is
    /// read.
    pub(super) fn new(
        position: ListPosition,
        time_ns: Result<u64, LineFault>,
        file: Result<PathBuf, LineFault>,
    ) -> Self {
        match time_ns {
            Ok(time_ns) => Self { time_ns: Some(time_ns), source: PictureSource { position: Some(position), file } },
            Err(fault) => Self { time_ns: None, source: PictureSource { position: Some(position), file: Err(fault) } },
        }
    }
}

/// Reads the list `list` in `dir`; `parse` converts the position and text of a line to an entry.
///
/// # Errors
/// The list is unreadable, empty, or has more than [`MAX_ENTRIES`] lines.
pub(super) fn read_list<T>(
    dir: &Path,
    list: &str,
    parse: impl Fn(ListPosition, Result<&str, LineFault>) -> T,
) -> Result<Vec<T>> {
    let path = dir.join(list);
    let bytes = input::read(&path, input::MAX_TEXT_BYTES).map_err(RecordingError::io("read the list", &path))?;
    // The last line of an interrupted list may be cut.
    let bytes = if atomic_file::is_part_name(list.as_ref()) { whole_lines(&bytes) } else { &bytes };
    // Count before parsing: an entry takes far more memory than its line.
    if split_lines(bytes).nth(MAX_ENTRIES).is_some() {
        return Err(RecordingError::LongList { list: path, most: MAX_ENTRIES });
    }
    let list: Arc<str> = list.into();
    let position = |line| ListPosition { list: Arc::clone(&list), line };
    let entries: Vec<T> = split_lines(bytes).map(|(line, text)| parse(position(line), text)).collect();
    if entries.is_empty() { Err(RecordingError::EmptyList { list: path }) } else { Ok(entries) }
}

/// Returns the first faulty entry as an error.
pub(super) fn refuse_faults<'a>(dir: &Path, mut entries: impl Iterator<Item = &'a Entry>) -> Result<()> {
    entries.try_for_each(|entry| entry.source.file(dir).map(|_| ()))
}

/// Clears the times that violate the increasing order or lie more than ten years from most others, and marks their
/// entries as faulty. Clears as few as possible: one wrong time far ahead does not invalidate all that follow, and of
/// equal times the first is kept.
pub(super) fn clear_unordered_times<'a>(entries: impl Iterator<Item = &'a mut Entry>) {
    let entries: Vec<_> = entries.filter(|entry| entry.time_ns.is_some()).collect();
    let times: Vec<_> = entries.iter().filter_map(|entry| entry.time_ns).collect();
    let is_kept = longest_increasing(&times);
    let kept: Vec<_> = times.iter().zip(&is_kept).filter(|(_, is_kept)| **is_kept).map(|(&time, _)| time).collect();
    let range = densest_range(&kept);
    for (entry, is_kept) in entries.into_iter().zip(is_kept) {
        if is_kept && entry.time_ns.is_some_and(|time| range.contains(&time)) {
            continue;
        }
        entry.time_ns = None;
        match &entry.source.file {
            _ if !is_kept => entry.source.file = Err(LineFault::OutOfOrder),
            Ok(_) => entry.source.file = Err(LineFault::TooFar),
            // An existing fault is more informative.
            Err(_) => {}
        }
    }
}

/// Returns the range of length [`MAX_LENGTH_NS`] with the most of some increasing times; the first of several.
fn densest_range(times: &[u64]) -> RangeInclusive<u64> {
    let range_from = |&first_ns: &u64| first_ns..=first_ns.saturating_add(MAX_LENGTH_NS);
    let count = |range: &RangeInclusive<u64>| {
        times.partition_point(|time| time <= range.end()) - times.partition_point(|time| time < range.start())
    };
    // `max_by_key` returns the last of equal elements, so iterate in reverse.
    times.iter().map(range_from).rev().max_by_key(count).unwrap_or(0..=0)
}

/// Marks a longest strictly increasing subsequence (patience sorting, from the end).
fn longest_increasing(times: &[u64]) -> Vec<bool> {
    // heads[k]: among the increasing runs of k + 1 elements found so far, the first element of the run that starts
    // latest.
    let mut heads: Vec<usize> = Vec::new();
    let mut next = vec![None; times.len()];
    for (index, &time) in times.iter().enumerate().rev() {
        let length = heads.partition_point(|&head| times[head] > time);
        next[index] = length.checked_sub(1).map(|shorter| heads[shorter]);
        match heads.get_mut(length) {
            Some(head) => *head = index,
            None => heads.push(index),
        }
    }
    let mut is_kept = vec![false; times.len()];
    let mut at = heads.last().copied();
    while let Some(index) = at {
        is_kept[index] = true;
        at = next[index];
    }
    is_kept
}

/// Returns the lines that have their end.
pub(super) fn whole_lines(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1)]
}

/// Returns number (from 1) and text of the lines that are neither blank nor comments.
pub(super) fn split_lines(bytes: &[u8]) -> impl Iterator<Item = (u32, Result<&str, LineFault>)> {
    // Some editors write a byte order mark.
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let lines = (1..).zip(bytes.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii));
    lines
        .filter(|(_, text)| !text.is_empty() && !text.starts_with(b"#"))
        .map(|(line, text)| (line, str::from_utf8(text).map_err(|_| LineFault::NotUtf8)))
}

/// Checks that a file name stays within its folder, by its text only: links are resolved when it is opened.
pub(super) fn parse_relative_path(file: &str) -> Result<PathBuf, LineFault> {
    if file.contains(char::is_control) {
        return Err(LineFault::FileName(quote(file)));
    }
    let path = PathBuf::from(file);
    let is_inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if is_inside { Ok(path) } else { Err(LineFault::Outside(path)) }
}

pub(super) fn quote(text: &str) -> String {
    text.chars().take(QUOTED_CHARS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(times: &[u64]) -> Vec<u64> {
        times.iter().zip(longest_increasing(times)).filter(|(_, is_kept)| *is_kept).map(|(&time, _)| time).collect()
    }

    #[test]
    fn as_few_times_as_possible_are_given_up() {
        assert!(kept(&[]).is_empty());
        assert_eq!(kept(&[1, 2, 3]), [1, 2, 3]);
        assert_eq!(kept(&[1, 99, 2, 3, 4]), [1, 2, 3, 4]);
        assert_eq!(kept(&[5, 6, 0, 7, 8]), [5, 6, 7, 8]);
        assert_eq!(kept(&[3, 2, 1]), [3]);
    }

    #[test]
    fn a_date_of_another_age_costs_only_itself() {
        assert_eq!(densest_range(&[]), 0..=0);
        assert_eq!(densest_range(&[7, 8]), 7..=7 + MAX_LENGTH_NS);
        let now_ns = 5 * MAX_LENGTH_NS;
        assert_eq!(densest_range(&[0, now_ns, now_ns + 9, u64::MAX]), now_ns..=now_ns + MAX_LENGTH_NS);
        assert_eq!(densest_range(&[0, u64::MAX]), 0..=MAX_LENGTH_NS);
    }

    #[test]
    fn the_first_of_equal_times_is_kept() {
        assert_eq!(longest_increasing(&[1, 2, 2, 3]), [true, true, false, true]);
        assert_eq!(longest_increasing(&[4, 4, 4]), [true, false, false]);
    }

    #[test]
    fn names_stay_inside() {
        for name in ["rgb/1.png", "1.png", "./rgb/1.png", "rgb/..1.png"] {
            assert_eq!(parse_relative_path(name), Ok(PathBuf::from(name)));
        }
        for name in ["../1.png", "rgb/../../1.png", "/somewhere/1.png", "rgb/..", ".."] {
            assert_eq!(parse_relative_path(name), Err(LineFault::Outside(PathBuf::from(name))));
        }
        assert!(matches!(parse_relative_path("rgb/\u{1b}[2J.png"), Err(LineFault::FileName(_))));
    }
}
