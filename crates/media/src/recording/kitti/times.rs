//! Times of the pictures, one per line, beginning with picture 0: `times.txt` in seconds (odometry), or `timestamps.txt`
//! beside the pictures with dates (raw drives).

use std::path::{Path, PathBuf};

use jiff::{civil::DateTime, tz::TimeZone};

use crate::recording::Options;
use crate::recording::contents::PictureSource;
use crate::recording::error::{RecordingError, Result};
use crate::recording::fault::LineFault;
use crate::recording::list::{self, Entry, quote};
use crate::recording::timeline::given_period_ns;

const LIST: &str = "times.txt";
const DATED_LIST: &str = "timestamps.txt";

/// Period without a list of times: 10 frames per second, the trigger rate of KITTI's cameras.
const PERIOD_NS: u64 = 100_000_000;

/// Upper bound of a valid time in seconds: beyond any date.
const LAST_S: f64 = 1e10;

/// Returns the list of times of the pictures in the folder `left` of `dir`, relative to `dir`, if there is one.
pub(super) fn find_list(dir: &Path, left: &str) -> Option<String> {
    let dated = left.strip_suffix("/data").map(|camera| format!("{camera}/{DATED_LIST}"));
    [Some(LIST.to_owned()), dated].into_iter().flatten().find(|list| dir.join(list).exists())
}

/// Returns entries with times for `pictures` (name, file). A picture named by the number n has the time in line n (from
/// 0) of `list`, so that an excerpt may keep the full list; other names count by position. Without a list, the
/// pictures are [`Options::period_ns`] apart, else [`PERIOD_NS`].
///
/// # Errors
/// A picture has no time, and `keep_going` is not set.
pub(super) fn timed_entries(
    dir: &Path,
    list: Option<&str>,
    pictures: Vec<(&str, PathBuf)>,
    options: &Options,
) -> Result<Vec<Entry>> {
    let Some(list) = list else {
        let period_ns = given_period_ns(options).unwrap_or(PERIOD_NS);
        let entry = |(index, (_, file)): (u64, (&str, PathBuf))| Entry {
            time_ns: Some(index * period_ns),
            source: PictureSource::from_path(file),
        };
        return Ok((0..).zip(pictures).map(entry).collect());
    };
    let parse = if list == LIST { parse_ns } else { parse_date_ns };
    let times = list::read_list(dir, list, |position, text| (position, text.and_then(parse)))?;
    let entries = pictures.into_iter().enumerate().map(|(index, (name, file))| {
        let number = name.split('.').next().and_then(|stem| stem.parse().ok()).unwrap_or(index);
        match times.get(number) {
            Some((position, time_ns)) => Ok(Entry::new(position.clone(), time_ns.clone(), Ok(file))),
            None if options.keep_going => Ok(Entry { time_ns: None, source: PictureSource::from_path(file) }),
            None => Err(RecordingError::TooFewTimes {
                list: dir.join(list),
                times: times.len(),
                picture: file.display().to_string(),
            }),
        }
    });
    entries.collect()
}

/// Parses a date and time such as `2011-09-26 13:02:25.964389445` to nanoseconds after 1970.
fn parse_date_ns(text: &str) -> Result<u64, LineFault> {
    let parse = || {
        // A day alone is no time.
        let date: DateTime = text.parse().ok().filter(|_| text.contains(':'))?;
        u64::try_from(TimeZone::UTC.to_timestamp(date).ok()?.as_nanosecond()).ok()
    };
    parse().ok_or_else(|| LineFault::Date(quote(text)))
}

/// Parses seconds >= 0, with or without an exponent (KITTI writes `1.037359e-01`), to nanoseconds. `f64` is precise
/// enough, as times count from the first picture.
fn parse_ns(text: &str) -> Result<u64, LineFault> {
    let seconds = text.parse().ok().filter(|seconds| (0.0..LAST_S).contains(seconds));
    seconds.map(|seconds: f64| (seconds * 1e9).round() as u64).ok_or_else(|| LineFault::Time(quote(text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_nanoseconds_after_1970() {
        for (text, ns) in [
            ("1970-01-01 00:00:00.000000001", 1),
            ("2000-03-01 00:00:00", 951_868_800_000_000_000),
            ("2011-09-26 13:02:25.964389445", 1_317_042_145_964_389_445),
            ("2012-02-29 23:59:59.5", 1_330_559_999_500_000_000),
        ] {
            assert_eq!(parse_date_ns(text), Ok(ns));
        }
        for text in ["", "2011-09-26", "2011-13-26 00:00:00", "2011-09-26 24:00:00", "1.5", "2011-09-26 1:1:-1"] {
            assert_eq!(parse_date_ns(text), Err(LineFault::Date(text.into())));
        }
    }

    #[test]
    fn times_are_seconds_in_any_writing() {
        for (text, ns) in
            [("0.000000e+00", 0), ("1.037359e-01", 103_735_900), ("2.5", 2_500_000_000), ("7", 7_000_000_000)]
        {
            assert_eq!(parse_ns(text), Ok(ns));
        }
        for text in ["", "-1.0", "nan", "inf", "1e99", "1,5", "soon", "1.0 2.0"] {
            assert_eq!(parse_ns(text), Err(LineFault::Time(text.into())));
        }
    }
}
