//! Reads the lists of pictures and their times.

use std::path::Path;

use super::time::parse_ns;
use crate::recording::contents::ListPosition;
use crate::recording::error::RecordingError;
use crate::recording::fault::LineFault;
use crate::recording::list::{self, Entry, parse_relative_path, quote};

fn parse_entry(position: ListPosition, time: &str, file: &str) -> Entry {
    Entry::new(position, parse_ns(time).ok_or_else(|| LineFault::Time(quote(time))), parse_relative_path(file))
}

fn faulty_entry(position: ListPosition, fault: LineFault) -> Entry {
    Entry::new(position, Err(fault.clone()), Err(fault))
}

/// Reads lines of `time file`.
pub(super) fn read_list(dir: &Path, list: &'static str) -> Result<Vec<Entry>, RecordingError> {
    let expected = "time file";
    list::read_list(dir, list, |position, text| match text.map(split_columns) {
        Ok((_, [Some(time), Some(file), None, ..])) => parse_entry(position, time, file),
        Ok((found, _)) => faulty_entry(position, LineFault::Columns { expected, found }),
        Err(fault) => faulty_entry(position, fault),
    })
}

/// Reads lines of `time file time file`. A faulty line makes two faulty entries.
pub(super) fn read_pairs(dir: &Path, list: &'static str) -> Result<Vec<[Entry; 2]>, RecordingError> {
    let expected = "time file time file";
    let both_faulty =
        |position, fault: LineFault| [faulty_entry(position, fault.clone()), faulty_entry(position, fault)];
    list::read_list(dir, list, |position, text| match text.map(split_columns) {
        Ok((_, [Some(time), Some(file), Some(other_time), Some(other_file), None])) => {
            [parse_entry(position, time, file), parse_entry(position, other_time, other_file)]
        }
        Ok((found, _)) => both_faulty(position, LineFault::Columns { expected, found }),
        Err(fault) => both_faulty(position, fault),
    })
}

/// Returns the number of columns, and the first five.
fn split_columns(text: &str) -> (usize, [Option<&str>; 5]) {
    let mut columns = text.split_ascii_whitespace();
    (columns.clone().count(), std::array::from_fn(|_| columns.next()))
}
