//! Time: real, or set by a test.
