//! Disparities as whole numbers, so that every executor finds the same.

/// One pixel.
pub const ONE: u16 = 64;

/// A pixel whose disparity is not known.
pub const UNKNOWN: u16 = u16::MAX;
