//! Files that are read and written: recordings, photos and calibrations.
#![allow(missing_docs)]

mod calibration;
mod matching;
mod pair_check;
mod recording;
