//! The connected cameras.

use std::str::FromStr;

use bokehcam_live::source::SourceName;
use bokehcam_live::source::devices::{self, Choice};

/// Returns all cameras, those that only PipeWire has last.
pub fn list_cameras() -> Vec<Choice> {
    devices::list_cameras().into_iter().chain(devices::list_pipewire_cameras()).collect()
}

/// Returns the name of the first one.
pub fn first_camera() -> Option<String> {
    list_cameras().into_iter().next().map(|camera| camera.name)
}

/// Whether a source that was opened is still there: a file, or one of the `cameras`.
pub fn is_there(name: &str, cameras: &[Choice]) -> bool {
    SourceName::from_str(name).is_ok_and(|parsed| match parsed.pipewire_name().map(str::to_lowercase) {
        // As the name of a device, it was just resolved.
        None => true,
        Some(part) => {
            let has_part = |text: &str| text.to_lowercase().contains(&part);
            cameras.iter().any(|camera| has_part(&camera.name) || has_part(&camera.label))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_has_gone_is_not_there_and_a_file_is() {
        let camera = |name: &str, label: &str| Choice { name: name.into(), label: label.into() };
        let cameras = [camera("pipewire:laptop_cam", "Integrated Webcam")];
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().display().to_string();
        for name in ["pipewire:laptop_cam", "pipewire:Webcam", "pipewire:laptop", "demo", &file] {
            assert!(is_there(name, &cameras), "{name}");
        }
        for name in ["pipewire:monkey", "/dev/video999", "/no/such/folder"] {
            assert!(!is_there(name, &cameras), "{name}");
        }
        assert!(!is_there("pipewire:laptop_cam", &[]));
    }
}
