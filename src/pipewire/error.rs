use std::io;

/// Why there is no camera of PipeWire's.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum PipeWireError {
    /// Nobody listens at the socket.
    #[error(
        "PipeWire cannot be reached at {socket}: start it (`systemctl --user start pipewire wireplumber`), or run this in \
         the desktop's session; `bokehcam doctor` says more"
    )]
    NoDaemon { socket: String },
    /// It was reached, and refused.
    #[error("PipeWire refused {doing}: {cause}")]
    Refused { doing: &'static str, cause: String },
    /// It was reached, and does not answer.
    #[error("PipeWire does not answer; restart it: `systemctl --user restart pipewire`")]
    Silent,
    /// No camera is meant by the name.
    #[error(
        "there is no camera '{name}' in PipeWire{}; `bokehcam devices` lists what there is",
        if others.is_empty() { ", and no other".to_owned() } else { format!(", but {}", others.join(", ")) }
    )]
    NoCamera { name: String, others: Vec<String> },
    /// A part of more than one name.
    #[error("'{name}' may be any of these cameras of PipeWire's: {}; say which", found.join(", "))]
    Ambiguous { name: String, found: Vec<String> },
    /// The session manager is an old one, or another.
    #[error(
        "this session's manager gives no filter to who asks for a camera: it takes WirePlumber 0.5 or later (Debian 13, Fedora          40); --to pipewire is a camera of its own, which any can give"
    )]
    NoFilters,
    /// A loop.
    #[error("pipewire:{name} is what this program gives itself; take another camera")]
    Own { name: String },
    /// It offers nothing that can be used.
    #[error("pipewire:{name}: {why}")]
    NoMode { name: String, why: String },
    /// It was found, and gives nothing.
    #[error("pipewire:{name}: no pictures come; is another program using the camera, and does a session manager run?")]
    NoPictures { name: String },
    #[error("PipeWire's thread cannot be started: {0}")]
    Thread(io::Error),
}

impl PipeWireError {
    /// For `map_err`: says what was refused.
    pub(super) fn refused(doing: &'static str) -> impl FnOnce(pipewire::Error) -> Self {
        move |cause| Self::Refused { doing, cause: cause.to_string() }
    }
}
