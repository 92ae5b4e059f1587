//! Reads the lists of pictures and their times.

use std::path::Path;

use super::time::parse_ns;
use crate::recording::contents::Place;
use crate::recording::error::RecordingError;
use crate::recording::fault::LineFault;
use crate::recording::list::{self, Entry, inside, quoted};

fn parse_entry(place: Place, time: &str, file: &str) -> Entry {
    Entry::new(place, parse_ns(time).ok_or_else(|| LineFault::Time(quoted(time))), inside(file))
}

fn faulty_entry(place: Place, fault: LineFault) -> Entry {
    Entry::new(place, Err(fault.clone()), Err(fault))
}

/// Reads lines of `time file`.
pub(super) fn read(dir: &Path, list: &'static str) -> Result<Vec<Entry>, RecordingError> {
    let expected = "time file";
    list::read(dir, list, |place, text| match text.map(columns) {
        Ok((_, [Some(time), Some(file), None, ..])) => parse_entry(place, time, file),
        Ok((found, _)) => faulty_entry(place, LineFault::Columns { expected, found }),
        Err(fault) => faulty_entry(place, fault),
    })
}

/// Reads lines of `time file time file`. A faulty line makes two faulty entries.
pub(super) fn read_pairs(dir: &Path, list: &'static str) -> Result<Vec<[Entry; 2]>, RecordingError> {
    let expected = "time file time file";
    let both_faulty = |place, fault: LineFault| [faulty_entry(place, fault.clone()), faulty_entry(place, fault)];
    list::read(dir, list, |place, text| match text.map(columns) {
        Ok((_, [Some(time), Some(file), Some(other_time), Some(other_file), None])) => {
            [parse_entry(place, time, file), parse_entry(place, other_time, other_file)]
        }
        Ok((found, _)) => both_faulty(place, LineFault::Columns { expected, found }),
        Err(fault) => both_faulty(place, fault),
    })
}

/// Returns the number of columns, and the first five.
fn columns(text: &str) -> (usize, [Option<&str>; 5]) {
    let mut columns = text.split_ascii_whitespace();
    (columns.clone().count(), std::array::from_fn(|_| columns.next()))
}
