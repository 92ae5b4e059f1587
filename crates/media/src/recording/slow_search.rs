//! Says once of a search that it takes long.

use std::fmt::Display;
use std::time::{Duration, Instant};

/// A search that takes longer is reported.
const SLOW: Duration = Duration::from_secs(2);

/// A search that has begun.
pub(super) struct SlowSearch(Option<Instant>);

impl SlowSearch {
    pub fn begin() -> Self {
        Self(Some(Instant::now()))
    }

    /// Warns once if the search in `name`, for `what`, takes long.
    pub fn warn_if_slow(&mut self, name: impl Display, what: &str) {
        if self.0.take_if(|began| began.elapsed() > SLOW).is_some() {
            tracing::warn!("{name}: {what}; this takes long");
        }
    }
}
