//! Where depth comes from.
