//! The message bus of a build without the feature `desktop`: a run is not on it.

use std::sync::Arc;

use super::Handler;

/// Never there.
pub enum Bus {}

/// Refuses.
///
/// # Errors
/// Always.
pub fn serve(_: Arc<Handler>, _: Vec<String>) -> Result<(Bus, Arc<Handler>), String> {
    Err("this program was built without it; build it with the feature desktop".to_owned())
}
