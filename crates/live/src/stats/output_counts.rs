//! Counts of pictures per output.

use std::fmt;

use serde::Serialize;

/// Counts of a PipeWire camera: each delivered picture was either shown or skipped for one of the reasons below; the
/// last one may be in flight.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NodeCounts {
    /// The node name, by which programs remember the camera.
    pub node: String,
    /// Pictures that readers received, repeats not included.
    pub shown: u64,
    /// How often readers received the last picture again, or the still card.
    pub repeats: u64,
    /// Pictures skipped without viewers.
    pub unwatched: u64,
    /// Pictures replaced by a newer one before they were shown.
    pub overtaken: u64,
    /// Pictures for which the readers had left no buffer.
    pub no_buffer: u64,
    /// How often PipeWire went away and came back.
    pub returns: u64,
}

impl fmt::Display for NodeCounts {
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

/// Counts of one of several outputs: each delivered frame was taken or lost; the last one may be in flight.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct OutputCounts {
    /// The output's kind and place.
    pub output: String,
    /// Frames taken, the still card included.
    pub frames: u64,
    /// How often the last picture was sent again because no new one came.
    pub repeats: u64,
    /// Frames replaced by a newer one while the output was busy.
    pub lost: u64,
}

impl fmt::Display for OutputCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { output, frames, lost, .. } = self;
        write!(f, "{output}: {frames} frames")?;
        if *lost > 0 { write!(f, ", {lost} lost while it was busy") } else { Ok(()) }
    }
}
