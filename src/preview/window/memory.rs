//! What is remembered from one preview to the next: how large the window was.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::files::{input, whole};

/// The window's size in points, as it was last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    pub width: f64,
    pub height: f64,
    #[serde(default)]
    pub maximized: bool,
}

/// A side beyond these is taken for a mistake.
const LEAST: f64 = 200.0;
const MOST: f64 = 16_384.0;

impl Memory {
    /// What the file remembers; `None` if it is missing or not sensible, without an error, as it is no setting.
    pub fn read(path: &Path) -> Option<Self> {
        let memory: Self = toml::from_str(&input::read_text(path, input::MOST_SETTINGS_BYTES).ok()?).ok()?;
        let sides = LEAST..=MOST;
        (sides.contains(&memory.width) && sides.contains(&memory.height)).then_some(memory)
    }

    /// Writes the file, whole or not at all. If that fails, the next window just has its initial size again.
    pub fn write(self, path: &Path) {
        let Ok(text) = toml::to_string(&self) else { return };
        let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
        let written = folder.and_then(|()| whole::write(path, text.as_bytes(), true));
        if let Err(error) = written {
            tracing::info!("the window's size is not remembered: {}: {error}", path.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_nonsense_is_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/window.toml");
        assert_eq!(Memory::read(&path), None);
        let memory = Memory { width: 1280.0, height: 720.5, maximized: true };
        memory.write(&path);
        assert_eq!(Memory::read(&path), Some(memory));
        for text in ["", "width = 3\nheight = 4\n", "width = nan\nheight = 700\n", "width"] {
            fs::write(&path, text).unwrap();
            assert_eq!(Memory::read(&path), None, "{text}");
        }
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "nothing is left beside it");
    }
}
