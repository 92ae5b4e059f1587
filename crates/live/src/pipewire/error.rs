use std::io;

/// Result of what PipeWire is asked for.
pub type Result<T, E = PipeWireError> = std::result::Result<T, E>;

/// Why a PipeWire camera is not available.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum PipeWireError {
    /// The daemon cannot be reached at its socket.
    #[error(
        "PipeWire cannot be reached at {socket}: start it (`systemctl --user start pipewire wireplumber`), or run this in \
         the desktop's session; `bokehcam doctor` says more"
    )]
    NoDaemon { socket: String },
    /// The daemon refused a request.
    #[error("PipeWire refused {doing}: {cause}")]
    Refused { doing: &'static str, cause: String },
    /// The daemon does not answer.
    #[error("PipeWire does not answer; restart it: `systemctl --user restart pipewire`")]
    Silent,
    /// No camera matches the name.
    #[error(
        "there is no camera '{name}' in PipeWire{}; `bokehcam devices` lists the cameras",
        if others.is_empty() { ", and no other".to_owned() } else { format!(", but {}", others.join(", ")) }
    )]
    NoCamera { name: String, others: Vec<String> },
    /// The name is a part of several cameras' names.
    #[error("'{name}' matches several PipeWire cameras: {}; give the full name of one", found.join(", "))]
    Ambiguous { name: String, found: Vec<String> },
    /// The session manager does not support filters.
    #[error(
        "this session manager does not support filters for cameras: use WirePlumber 0.5 or later (Debian 13, Fedora \
         40); or use --to pipewire, a separate camera, which any session manager supports"
    )]
    NoFilters,
    /// The camera is provided by this program: a loop.
    #[error("pipewire:{name} is a camera that bokehcam itself provides; use another camera")]
    Own { name: String },
    /// The camera offers no usable mode.
    #[error("pipewire:{name}: {why}")]
    NoMode { name: String, why: String },
    /// The camera was found, but delivers no pictures.
    #[error("pipewire:{name}: no pictures come; is another program using the camera, and does a session manager run?")]
    NoPictures { name: String },
    #[error("PipeWire's thread cannot be started: {0}")]
    Thread(io::Error),
}

impl PipeWireError {
    /// Creates the error of a refused call, for `map_err`.
    pub(super) fn refused(doing: &'static str) -> impl FnOnce(pipewire::Error) -> Self {
        move |cause| Self::Refused { doing, cause: cause.to_string() }
    }
}
