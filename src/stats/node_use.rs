//! What became of the pictures in each of several outputs.

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

/// What one of several outputs did with the frames that were delivered: each was taken, or lost; the last one may be on its
/// way.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct OutputUse {
    /// What it is, and where.
    pub output: String,
    /// Frames that it took, the still card included.
    pub frames: u64,
    /// Times that it was given its last picture again, because no new one came.
    pub repeats: u64,
    /// Frames that a newer one overtook while it was busy with those before.
    pub lost: u64,
}

impl fmt::Display for OutputUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { output, frames, lost, .. } = self;
        write!(f, "{output}: {frames} frames")?;
        if *lost > 0 { write!(f, ", {lost} lost as it was busy with those before") } else { Ok(()) }
    }
}
