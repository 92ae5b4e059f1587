//! Errors of loopback nodes, with advice on what to do.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::v4l2::holders::Holder;

/// Why frames cannot be written to a node.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum LoopbackError {
    /// The node does not exist.
    #[error("there is no {}: {}", path.display(), format_remedy(path))]
    Missing { path: PathBuf },
    /// It is not a Video4Linux node.
    #[error("{} is not a video device: {}", path.display(), format_remedy(path))]
    NotVideo { path: PathBuf },
    /// It belongs to another driver.
    #[error("{} is '{card}', not a virtual camera: {}", path.display(), format_remedy(Path::new("")))]
    NotLoopback { path: PathBuf, card: String },
    /// The user may not open it.
    #[error(
        "you have no permission for {}: join the group that owns it with `sudo usermod -aG video $USER`, and log in \
         again",
        path.display()
    )]
    Denied { path: PathBuf },
    /// Another program writes to it, or the limit of openers is reached.
    #[error("{} is in use{}: stop that program, or use another virtual camera", path.display(), By(by))]
    InUse { path: PathBuf, by: Vec<Holder> },
    /// Its format is fixed to one that cannot be written.
    #[error(
        "{} is fixed to {fourcc} of {width} x {height} pixels{}: stop that program, or free the format with `v4l2-ctl \
         -d {} -c keep_format=0`",
        path.display(), By(by), path.display()
    )]
    FormatFixed { path: PathBuf, fourcc: String, width: u32, height: u32, by: Vec<Holder> },
    /// It accepts no frames and delivers none.
    #[error(
        "{} takes no frames since its last writer left, a fault of v4l2loopback before 0.13: reload the module with \
         `{}`",
        path.display(), modprobe_command(path)
    )]
    Stuck { path: PathBuf },
    #[error("{}: {doing}: {cause}", path.display())]
    System { path: PathBuf, doing: &'static str, cause: io::Error },
}

/// Displays ` by this, that`, or nothing if no holder is known.
struct By<'a>(&'a [Holder]);

impl fmt::Display for By<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, holder) in self.0.iter().enumerate() {
            write!(f, "{} {holder}", if at == 0 { " by" } else { "," })?;
        }
        Ok(())
    }
}

/// Returns the command that makes `path` a virtual camera; `/dev/video10` if it is not a node's name.
pub fn modprobe_command(path: &Path) -> String {
    let number = path.to_str().and_then(|path| path.strip_prefix("/dev/video")?.parse::<u32>().ok()).unwrap_or(10);
    // The module takes its options only when it is loaded, so a loaded one must be removed first.
    let unload = if Path::new("/sys/module/v4l2loopback").exists() { "sudo modprobe -r v4l2loopback && " } else { "" };
    format!(
        "{unload}sudo modprobe v4l2loopback devices=1 video_nr={number} card_label=\"bokehcam\" exclusive_caps=1 \
         max_buffers=4"
    )
}

/// Lists all nodes of v4l2loopback by number, whether or not they can be opened, recognized by their attribute
/// `max_openers` in sysfs.
pub fn list_nodes() -> Vec<PathBuf> {
    let entries = fs::read_dir("/sys/class/video4linux").into_iter().flatten().flatten();
    let loopbacks = entries.filter(|entry| entry.path().join("max_openers").exists());
    let mut numbers: Vec<u32> =
        loopbacks.filter_map(|entry| entry.file_name().to_str()?.strip_prefix("video")?.parse().ok()).collect();
    numbers.sort_unstable();
    numbers.into_iter().map(|number| PathBuf::from(format!("/dev/video{number}"))).collect()
}

/// Advises a user whose `path` is not a virtual camera: use an existing one, or create one.
fn format_remedy(path: &Path) -> String {
    let there: Vec<String> = list_nodes().iter().map(|node| node.display().to_string()).collect();
    match there.is_empty() {
        true => format!("make a virtual camera with `{}`", modprobe_command(path)),
        // Creating one is the second choice: it reloads the module, which removes the existing nodes.
        false => format!("use {}, or make others with `{}`", there.join(" or "), modprobe_command(path)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_holds_a_node_is_named() {
        let by =
            [(7, "obs"), (8, "mpv")].map(|(pid, name)| Holder { pid, name: name.into(), has_buffers: true }).into();
        let taken = LoopbackError::InUse { path: "/dev/video9".into(), by };
        assert_eq!(
            taken.to_string(),
            "/dev/video9 is in use by obs (process 7), mpv (process 8): stop that program, or use another virtual \
             camera"
        );
    }
}
