//! Fallback glyphs from the system's fonts for characters that the built-in fonts lack; a thread searches on first use.

use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use egui::epaint::text::{FallbackRequest, FontInsert, FontProvider, InsertFontFamily};
use egui::{FontData, FontFamily};
use skrifa::MetadataProvider;

use super::theme::medium_font;

/// Size above which a font file is not read, in bytes.
const MAX_BYTES: u64 = 64 << 20;
/// Number of fontconfig's suggestions that are tried.
const MAX_TRIED: usize = 12;
/// Missing characters that arrive within this time are searched together.
const BATCH_WINDOW: Duration = Duration::from_millis(20);

/// The system fonts loaded so far. Clones share their state.
#[derive(Clone)]
pub struct SystemFonts(Arc<FontCache>);

struct FontCache {
    /// Font by character; `None` while the search is pending, or if no font has it.
    fonts: Mutex<HashMap<char, Option<FontInsert>>>,
    missing: Mutex<mpsc::Sender<char>>,
}

impl SystemFonts {
    /// Creates the provider without reading anything. A thread calls `found` when new fonts are available to
    /// [`SystemFonts::install`].
    pub fn new(found: impl Fn() + Send + 'static) -> Self {
        Self::with_config(None, found)
    }

    /// Creates the provider with a different fontconfig configuration.
    pub(super) fn with_config(config: Option<PathBuf>, found: impl Fn() + Send + 'static) -> Self {
        let (missing, requests) = mpsc::channel();
        let fonts = Arc::new(FontCache { fonts: Mutex::default(), missing: Mutex::new(missing) });
        let weak_cache = Arc::downgrade(&fonts);
        let search = move || {
            while let Ok(first) = requests.recv() {
                let mut signs = vec![first];
                while let Ok(next) = requests.recv_timeout(BATCH_WINDOW) {
                    signs.push(next);
                }
                let fonts = find_fonts(signs, config.as_ref());
                let Some(cache) = weak_cache.upgrade().filter(|_| !fonts.is_empty()) else { continue };
                let found_fonts = fonts.into_iter().map(|(sign, font)| (sign, Some(font)));
                cache.fonts.lock().unwrap_or_else(PoisonError::into_inner).extend(found_fonts);
                found();
            }
        };
        // Without a thread, missing characters remain boxes.
        let _ = thread::Builder::new().name("fonts".into()).spawn(search);
        Self(fonts)
    }

    /// Registers the provider: egui lays text out with the fonts found, and requests a search for missing characters.
    pub fn install(&self, ctx: &egui::Context) {
        let fonts = Arc::clone(&self.0);
        ctx.set_font_providers(vec![fonts as Arc<dyn FontProvider>]);
    }
}

impl FontProvider for FontCache {
    fn font_for(&self, request: &FallbackRequest<'_>) -> Option<FontInsert> {
        let sign = request.cluster.chars().next()?;
        let mut fonts = self.fonts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(font) = fonts.get(&sign) {
            return font.clone();
        }
        fonts.insert(sign, None);
        let _ = self.missing.lock().unwrap_or_else(PoisonError::into_inner).send(sign);
        None
    }
}

/// Returns fonts that cover `signs`, greedily with as few fonts as possible.
fn find_fonts(mut signs: Vec<char>, config: Option<&PathBuf>) -> Vec<(char, FontInsert)> {
    let mut found = Vec::new();
    while let Some(&sign) = signs.first() {
        let font = suggest_fonts(sign, config).into_iter().find_map(|(path, index)| read_font(&path, index, sign));
        let Some((font, has_glyph)) = font else {
            tracing::debug!("no font of the system has {sign:?}");
            signs.remove(0);
            continue;
        };
        let (new, rest) = signs.into_iter().partition(|sign| has_glyph(*sign));
        signs = rest;
        found.extend(<Vec<char>>::into_iter(new).map(|sign| (sign, font.clone())));
    }
    found
}

/// Returns fontconfig's suggestions for a character, best first: file path and face index.
fn suggest_fonts(sign: char, config: Option<&PathBuf>) -> Vec<(PathBuf, u32)> {
    let pattern = format!("sans-serif:charset={:x}:scalable=true:color=false", u32::from(sign));
    let mut command = Command::new("fc-match");
    command.args(["--sort", "--format=%{index} %{file}\n", &pattern]).stdin(Stdio::null()).stderr(Stdio::null());
    if let Some(config) = config {
        command.env("FONTCONFIG_FILE", config);
    }
    let Ok(output) = command.output() else { return Vec::new() };
    let text = String::from_utf8_lossy(&output.stdout);
    let fonts = text.lines().filter_map(|line| {
        let (index, path) = line.split_once(' ')?;
        // The upper 16 bits are the named instance of a variable font.
        Some((PathBuf::from(path), index.parse::<u32>().ok()? & 0xffff))
    });
    fonts.take(MAX_TRIED).collect()
}

/// Reads a font if it has `sign`. Returns it with a predicate for further characters.
fn read_font(path: &PathBuf, index: u32, sign: char) -> Option<(FontInsert, impl Fn(char) -> bool + use<>)> {
    if fs::metadata(path).ok()?.len() > MAX_BYTES {
        return None;
    }
    let bytes = Arc::new(fs::read(path).ok()?);
    let face = Arc::clone(&bytes);
    let has_glyph = move |sign: char| {
        skrifa::FontRef::from_index(&face, index).is_ok_and(|font| font.charmap().map(sign).is_some())
    };
    if !has_glyph(sign) {
        return None;
    }
    let families = [FontFamily::Proportional, FontFamily::Monospace, medium_font()];
    let families =
        families.map(|family| InsertFontFamily { family, priority: egui::epaint::text::FontPriority::Lowest });
    let name = format!("{} {index}", path.display());
    Some((FontInsert::new(&name, FontData::from_blob(bytes, index), families.to_vec()), has_glyph))
}
