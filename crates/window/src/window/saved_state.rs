//! State that persists between previews: window size, preferences, source and look.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::state::Preferences;
use bokehcam::look::{Look, LookError, Patch};
use bokehcam_files::{atomic_file, input};
use bokehcam_live::source::{Kind, SourceName, devices};

/// State saved at the end of a preview.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct SavedState {
    /// The source's name on the command line.
    pub source: Option<String>,
    /// The user's preferences.
    #[serde(rename = "habits")]
    pub preferences: Preferences,
    /// Settings of the look, by name.
    pub look: BTreeMap<String, String>,
    /// The window's size, if known.
    pub size: Option<WindowSize>,
}

/// A window's size in logical pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowSize {
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
    /// Whether the window was maximized.
    #[serde(default)]
    pub maximized: bool,
}

/// Valid range of a side, in logical pixels; values outside are ignored.
const MIN_SIDE: f64 = 200.0;
const MAX_SIDE: f64 = 16_384.0;

/// Height of a title bar and of the desktop's own bars, in logical pixels.
const BARS_HEIGHT: f64 = 48.0;

impl WindowSize {
    /// Returns the size limited to a screen of this width and height in logical pixels, with its title bar.
    pub fn limited_to(self, (width, height): (f64, f64)) -> Self {
        let limit = |side: f64, screen: f64| side.min(screen.max(MIN_SIDE));
        Self { width: limit(self.width, width), height: limit(self.height, height - BARS_HEIGHT), ..self }
    }
}

impl SavedState {
    /// Reads the file; `None` if it is missing or invalid, without an error, because users do not edit it.
    pub fn read(path: &Path) -> Option<Self> {
        let saved: Self = toml::from_str(&input::read_text(path, input::MAX_SETTINGS_BYTES).ok()?).ok()?;
        let sides = MIN_SIDE..=MAX_SIDE;
        let size = saved.size.filter(|size| sides.contains(&size.width) && sides.contains(&size.height));
        Some(Self { size, preferences: saved.preferences.into_valid(), ..saved })
    }

    /// Returns the source, if its devices still exist; a stream on standard input is gone.
    pub fn restore_source(&self) -> Option<String> {
        let is_there = |name: &&String| {
            SourceName::from_str(name).is_ok_and(|parsed| {
                let is_listed = || devices::list_pipewire_cameras().iter().any(|camera| camera.name == **name);
                parsed.kind() != Kind::Stdin
                    && parsed.device_nodes().iter().all(|node| node.exists())
                    && (parsed.pipewire_name().is_none() || is_listed())
            })
        };
        self.source.as_ref().filter(is_there).cloned()
    }

    /// Sets the source, by a name that is valid in any working directory.
    pub fn set_source(&mut self, name: &str) {
        self.source = Some(absolute_name(name)).filter(|name| !name.is_empty());
    }

    /// Returns the look, without pictures that cannot be read any more, each of which is reported to `on_missing`; `None` if
    /// no valid look is saved.
    pub fn restore_look(&self, mut on_missing: impl FnMut(String)) -> Option<Look> {
        let settings = self.look.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let mut patch = Patch::parse(settings).ok().filter(|_| !self.look.is_empty())?;
        let mut is_missing = |read: Result<(), LookError>| read.map_err(|error| on_missing(error.to_string())).is_err();
        patch.behind = patch.behind.filter(|name| !is_missing(name.load().map(drop)));
        patch.aperture = patch.aperture.filter(|name| !is_missing(name.load().map(drop)));
        patch.apply_to(&Look::default()).ok()
    }

    /// Sets the look.
    pub fn set_look(&mut self, look: &Look) {
        let portable = |value: String| match value.split_once(':') {
            Some((kind @ ("image" | "video"), file)) => format!("{kind}:{}", absolute_name(file)),
            _ => value,
        };
        let values = Patch::from_look(look).values().into_iter();
        self.look = values.map(|(name, value)| (name.to_owned(), portable(value))).collect();
    }

    /// Writes the file atomically. On failure, the next preview starts with defaults.
    pub fn write(&self, path: &Path) {
        let Ok(text) = toml::to_string(self) else { return };
        let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
        let written = folder.and_then(|()| atomic_file::write(path, text.as_bytes(), true));
        if let Err(error) = written {
            tracing::info!("the state of the window was not saved: {}: {error}", path.display());
        }
    }
}

/// Returns a name that is valid in any working directory: the absolute path of an existing file or folder, else `name`.
fn absolute_name(name: &str) -> String {
    let is_here = Path::new(name).is_relative() && Path::new(name).exists();
    let absolute = std::path::absolute(name).ok().filter(|_| is_here);
    absolute.map_or_else(|| name.to_owned(), |path| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_no_larger_than_the_screen() {
        let stored = WindowSize { width: 3836.0, height: 2120.0, maximized: false };
        let on = |screen| {
            let WindowSize { width, height, .. } = stored.limited_to(screen);
            (width, height)
        };
        assert_eq!(on((3840.0, 2160.0)), (3836.0, 2112.0), "with its title bar");
        assert_eq!(on((1920.0, 1080.0)), (1920.0, 1032.0), "the same screen at scale 2");
        assert_eq!(on((0.0, 0.0)), (MIN_SIDE, MIN_SIDE), "a screen of unknown size");
        let small = WindowSize { width: 640.0, height: 480.0, maximized: true };
        assert_eq!(small.limited_to((1280.0, 800.0)), small);
    }

    #[test]
    fn what_is_written_is_read_and_nonsense_is_nothing() {
        bokehcam_live::source::register_look_files();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/window.toml");
        assert_eq!(SavedState::read(&path), None);
        let look = Look { rim: 0.3, highlights: 4.0, ..Look::default() };
        let mut preferences = Preferences { text_scale: 1.5, single_keys: false, ..Preferences::default() };
        preferences.sections.insert("For experts".into(), true);
        let size = Some(WindowSize { width: 1280.0, height: 720.5, maximized: true });
        let mut saved = SavedState { source: Some("0".into()), preferences, size, ..SavedState::default() };
        let never = |line: String| panic!("{line}");
        assert_eq!(saved.restore_look(never), None);
        saved.set_look(&look);
        saved.write(&path);
        let read = SavedState::read(&path).unwrap();
        assert_eq!((read.restore_look(never), &read), (Some(look.clone()), &saved));
        for text in ["width", "[size]\nwidth = 3\n", "[habits]\ntext-scale = \"big\"\n"] {
            fs::write(&path, text).unwrap();
            assert_eq!(SavedState::read(&path), None, "{text}");
        }
        // Invalid values are dropped, and the others remain.
        fs::write(
            &path,
            "source = \"1\"\n[habits]\ntext-scale = 1e9\n[size]\nwidth = nan\nheight = 7\n[look]\nrim = \"9\"\n",
        )
        .unwrap();
        let read = SavedState::read(&path).unwrap();
        assert_eq!((read.source.as_deref(), read.size, read.restore_look(never)), (Some("1"), None, None));
        assert_eq!(read.preferences.text_scale, 3.0);
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "nothing is left beside it");
        saved.look.insert("behind".into(), "image:/no/such/wall.jpg".into());
        let mut gone = Vec::new();
        assert_eq!(saved.restore_look(|line| gone.push(line)), Some(look), "without the picture that is gone");
        assert!(gone.len() == 1 && gone[0].contains("/no/such/wall.jpg"), "{gone:?}");
    }
}
