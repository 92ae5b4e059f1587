//! The accounting and the report.
