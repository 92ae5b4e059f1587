use std::fmt;

use serde::Serialize;

/// What became of the pictures in a camera that was given to PipeWire: each that was delivered there was shown, or was
/// not for one of the reasons here; the last one may be on its way.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NodeUse {
    /// What programs remember the camera by.
    pub node: String,
    /// Pictures that readers were given, those that are shown again not included.
    pub shown: u64,
    /// Times that readers were given the last picture again, or the still card.
    pub repeats: u64,
    /// Pictures while nobody watched.
    pub unwatched: u64,
    /// Pictures that a newer one overtook on its way.
    pub overtaken: u64,
    /// Pictures for which the readers left no buffer.
    pub no_buffer: u64,
    /// Times that PipeWire went and came back.
    pub returns: u64,
}

impl fmt::Display for NodeUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PipeWire camera {}: {} pictures shown", self.node, self.shown)?;
        let others = [
            (self.repeats, "repeats"),
            (self.unwatched, "unwatched"),
            (self.overtaken, "overtaken"),
            (self.no_buffer, "without a buffer"),
            (self.returns, "returns of PipeWire"),
        ];
        others.iter().filter(|(count, _)| *count > 0).try_for_each(|(count, what)| write!(f, ", {count} {what}"))
    }
}
