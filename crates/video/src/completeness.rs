//! Whether ffmpeg has delivered a whole file: by what the file states and what ffmpeg says is lost.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use super::VideoFile;
use bokehcam_files::input;

/// What ffmpeg says when pictures or parts of them are lost. Its other errors may be harmless: `mmco: unref short failure`
/// begins every recording that was cut at an open group of pictures.
const LOSSES: [&str; 5] = [
    "corrupt input packet",
    "corrupt decoded frame",
    "Error while decoding stream",
    // ffmpeg 6 and later.
    "Error submitting packet to decoder",
    "File ended prematurely",
];

/// The last byte of a GIF (section 27 of GIF89a), which ffmpeg does not miss.
const GIF_TRAILER: u8 = 0x3b;

/// What a whole file delivers, as far as it states that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// Number of pictures, if all are decoded.
    frames: Option<u64>,
    /// Length in seconds.
    length_s: Option<f64>,
    period_ns: u64,
}

impl Expected {
    pub fn of(file: &VideoFile, is_all: bool) -> Self {
        Self { frames: file.frames.filter(|_| is_all), length_s: file.length_s, period_ns: file.period_ns }
    }

    /// Returns whether nothing is missing at the end, after `frames` pictures, the last of them at `last_ns`.
    pub fn is_reached(self, frames: u64, last_ns: Option<i64>) -> bool {
        // The length may include the time of the last picture, or be rounded.
        let reaches = |length_s: f64| {
            last_ns.is_some_and(|last_ns| (last_ns as f64 + 2.0 * self.period_ns as f64) / 1e9 >= length_s)
        };
        match self.frames {
            Some(stated) => frames >= stated,
            None => self.length_s.is_some_and(reaches),
        }
    }
}

/// Returns whether a line states that something of the pictures is lost.
pub(super) fn is_loss(line: &str) -> bool {
    // The text of a file's tags is of level `info`.
    !line.contains("[info]") && LOSSES.iter().any(|loss| line.contains(loss))
}

/// Returns whether a file is a GIF without its last byte.
pub(super) fn is_cut_gif(path: &Path) -> bool {
    let read = || {
        let (mut file, mut head, mut last) = (input::open(path)?, [0; 4], [0]);
        file.read_exact(&mut head)?;
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        io::Result::Ok((head, last))
    };
    read().is_ok_and(|(head, last)| head == *b"GIF8" && last != [GIF_TRAILER])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_counts_only_where_something_is_missing() {
        for line in [
            "[warning] cut.mp4: corrupt input packet in stream 0",
            "[error] Error while decoding stream #0:0: Invalid data found when processing input",
            "[matroska,webm @ 0x563af72e4940] [error] File ended prematurely",
        ] {
            assert!(is_loss(line), "{line}");
        }
        for line in
            ["[h264 @ 0x558b7f4324c0] [error] mmco: unref short failure", "[info]   title : corrupt input packet"]
        {
            assert!(!is_loss(line), "{line}");
        }
        let stated = Expected { frames: Some(40), length_s: Some(2.0), period_ns: 50_000_000 };
        assert!(stated.is_reached(40, None) && !stated.is_reached(39, Some(1_950_000_000)));
        let by_length = Expected { frames: None, ..stated };
        assert!(by_length.is_reached(3, Some(1_950_000_000)) && by_length.is_reached(3, Some(1_900_000_000)));
        assert!(!by_length.is_reached(38, Some(1_800_000_000)) && !by_length.is_reached(38, None));
        let unstated = Expected { length_s: None, ..by_length };
        assert!(!unstated.is_reached(40, Some(1_950_000_000)), "then every error counts");
    }
}
