//! JPEG files, of which the crates `image` and `zune-jpeg` leave out what photos and cameras need: pictures with a missing
//! part are refused, Motion JPEG gets its tables, large pictures are encoded on several threads, and segments are found.

mod intervals;
mod repair;
mod segments;
mod strict;

pub use intervals::encode;
pub use repair::{Fault, repair_jpeg};
pub use segments::{find_end, find_exif, insert_application_segment, is_complete, segments};
pub use strict::StrictJpeg;
