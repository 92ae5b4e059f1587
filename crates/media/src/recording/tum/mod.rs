//! The layout of the TUM RGB-D benchmark.
//!
//! `rgb.txt` and `depth.txt` have lines of `time file`, `associations.txt` has lines of `time file time file`, colour
//! or depth first; a pose of eight numbers before or after them, from running the benchmark's `associate.py` twice, is
//! skipped. Times are decimal seconds, file names are relative to the folder, `#` begins a comment.
//! `associations.txt`, or one of its usual other names, is a ready pairing, used if it exists; otherwise `rgb.txt` is
//! paired with `depth.txt` by nearest time, like the benchmark's own tool; `rgb.txt` alone is a recording without depth.

mod associations;
mod growing;
mod list;
mod open;
mod writer;

use std::path::Path;

use super::contents::Layout;
pub(super) use writer::Writer;

/// Lists of colour pictures and depth maps.
pub(super) const LAYOUT: Layout = Layout {
    name: "TUM RGB-D",
    expected_files: "associations.txt or rgb.txt",
    matches: open::is_tum_folder,
    open: open::open,
};

/// Units per metre of the benchmark's depth pictures.
pub(super) const DEPTH_SCALE: f32 = 5000.0;

const COLOR_LIST: &str = "rgb.txt";
const DEPTH_LIST: &str = "depth.txt";
const ASSOCIATIONS: &str = "associations.txt";

/// Endings of the pictures that lists name.
const PICTURE_ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Returns whether a file name ends like that of a picture.
fn is_picture(file: &Path) -> bool {
    let is = |known: &str| file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(known));
    PICTURE_ENDINGS.into_iter().any(is)
}
