//! Reads the lists of pictures and their times.

use std::path::Path;

use super::is_picture;
use crate::recording::contents::ListPosition;
use crate::recording::error::RecordingError;
use crate::recording::fault::LineFault;
use crate::recording::list::{self, Entry, parse_relative_path, quote};
use crate::recording::time::parse_ns;

fn parse_entry(position: ListPosition, time: &str, file: &str) -> Entry {
    Entry::new(position, parse_ns(time).ok_or_else(|| LineFault::Time(quote(time))), parse_relative_path(file))
}

fn faulty_entry(position: ListPosition, fault: LineFault) -> Entry {
    Entry::new(position, Err(fault.clone()), Err(fault))
}

/// Reads lines of `time file`.
pub(super) fn read_list(dir: &Path, list: &str) -> Result<Vec<Entry>, RecordingError> {
    let expected = "time file";
    list::read_list(dir, list, |position, text| match text.map(split_columns::<3>) {
        Ok((_, [Some(time), Some(file), None])) => parse_entry(position, time, file),
        Ok((found, _)) => faulty_entry(position, LineFault::Columns { expected, found }),
        Err(fault) => faulty_entry(position, fault),
    })
}

/// Reads lines of `time file time file`, with or without a pose. A faulty line makes two faulty entries.
pub(super) fn read_pairs(dir: &Path, list: &str) -> Result<Vec<[Entry; 2]>, RecordingError> {
    let expected = "time file time file";
    let both_faulty = |position: ListPosition, fault: LineFault| {
        [faulty_entry(position.clone(), fault.clone()), faulty_entry(position, fault)]
    };
    list::read_list(dir, list, |position, text| match text.map(split_pair) {
        Ok(Ok([time, file, other_time, other_file])) => {
            [parse_entry(position.clone(), time, file), parse_entry(position, other_time, other_file)]
        }
        Ok(Err(found)) => both_faulty(position, LineFault::Columns { expected, found }),
        Err(fault) => both_faulty(position, fault),
    })
}

/// Returns the four columns of a pair: all of them, or of twelve the first or last four, whichever name pictures; the
/// others are a time and a pose. Otherwise returns the number of columns.
pub(super) fn split_pair(text: &str) -> Result<[&str; 4], usize> {
    let columns = split_columns::<13>(text);
    let pair_from = |first: usize| Some([0, 1, 2, 3].map(|column| columns.1[first + column].unwrap_or_default()));
    let names_pictures = |pair: &[&str; 4]| [pair[1], pair[3]].iter().all(|file| is_picture(Path::new(file)));
    let pair = match columns.0 {
        4 => pair_from(0),
        12 => [0, 8].into_iter().filter_map(pair_from).find(names_pictures),
        _ => None,
    };
    pair.ok_or(columns.0)
}

/// Returns the number of columns, and the first `N`.
fn split_columns<const N: usize>(text: &str) -> (usize, [Option<&str>; N]) {
    let mut columns = text.split_ascii_whitespace();
    (columns.clone().count(), std::array::from_fn(|_| columns.next()))
}
