//! Signs that the program's own fonts lack, from the system's: looked for on a thread, once a text needs them.

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

use super::theme::medium;

/// A file that is larger is not read.
const MOST_BYTES: u64 = 64 << 20;
/// Of what fontconfig proposes, so many fonts are tried.
const MOST_TRIED: usize = 12;
/// The signs of one text are missed within this time.
const TOGETHER: Duration = Duration::from_millis(20);

/// The system's fonts, as far as they were needed. Clones are the same.
#[derive(Clone)]
pub struct SystemFonts(Arc<Found>);

struct Found {
    /// By sign; `None` while its font is looked for, and where there is none.
    fonts: Mutex<HashMap<char, Option<FontInsert>>>,
    missing: Mutex<mpsc::Sender<char>>,
}

impl SystemFonts {
    /// Nothing is read yet. `found` is called, on a thread, when [`SystemFonts::install`] has something new to install.
    pub fn new(found: impl Fn() + Send + 'static) -> Self {
        Self::with(None, found)
    }

    /// With another configuration of fontconfig's.
    pub(super) fn with(config: Option<PathBuf>, found: impl Fn() + Send + 'static) -> Self {
        let (missing, asked) = mpsc::channel();
        let fonts = Arc::new(Found { fonts: Mutex::default(), missing: Mutex::new(missing) });
        let known = Arc::downgrade(&fonts);
        let search = move || {
            while let Ok(first) = asked.recv() {
                let mut signs = vec![first];
                while let Ok(next) = asked.recv_timeout(TOGETHER) {
                    signs.push(next);
                }
                let fonts = fonts_of(signs, config.as_ref());
                let Some(known) = known.upgrade().filter(|_| !fonts.is_empty()) else { continue };
                let mut all = known.fonts.lock().unwrap_or_else(PoisonError::into_inner);
                all.extend(fonts.into_iter().map(|(sign, font)| (sign, Some(font))));
                drop(all);
                found();
            }
        };
        // Without a thread, signs stay boxes.
        let _ = thread::Builder::new().name("fonts".into()).spawn(search);
        Self(fonts)
    }

    /// Lets texts be laid out with what was found, and what they lack be looked for.
    pub fn install(&self, ctx: &egui::Context) {
        let fonts = Arc::clone(&self.0);
        ctx.set_font_providers(vec![fonts as Arc<dyn FontProvider>]);
    }
}

impl FontProvider for Found {
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

/// Fonts that have these signs, as few as will do.
fn fonts_of(mut signs: Vec<char>, config: Option<&PathBuf>) -> Vec<(char, FontInsert)> {
    let mut found = Vec::new();
    while let Some(&sign) = signs.first() {
        let font = proposals(sign, config).into_iter().find_map(|(path, index)| read(&path, index, sign));
        let Some((font, has)) = font else {
            tracing::debug!("no font of the system has {sign:?}");
            signs.remove(0);
            continue;
        };
        let (new, rest) = signs.into_iter().partition(|sign| has(*sign));
        signs = rest;
        found.extend(<Vec<char>>::into_iter(new).map(|sign| (sign, font.clone())));
    }
    found
}

/// The fonts that fontconfig proposes for a sign, the best first: files, and which font of each.
fn proposals(sign: char, config: Option<&PathBuf>) -> Vec<(PathBuf, u32)> {
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
        // The upper half is the number of a variable font's named instance.
        Some((PathBuf::from(path), index.parse::<u32>().ok()? & 0xffff))
    });
    fonts.take(MOST_TRIED).collect()
}

/// Reads a font that has `sign`, and says which others it has.
fn read(path: &PathBuf, index: u32, sign: char) -> Option<(FontInsert, impl Fn(char) -> bool + use<>)> {
    if fs::metadata(path).ok()?.len() > MOST_BYTES {
        return None;
    }
    let bytes = Arc::new(fs::read(path).ok()?);
    let face = Arc::clone(&bytes);
    let has = move |sign: char| {
        skrifa::FontRef::from_index(&face, index).is_ok_and(|font| font.charmap().map(sign).is_some())
    };
    if !has(sign) {
        return None;
    }
    let families = [FontFamily::Proportional, FontFamily::Monospace, medium()];
    let families =
        families.map(|family| InsertFontFamily { family, priority: egui::epaint::text::FontPriority::Lowest });
    let name = format!("{} {index}", path.display());
    Some((FontInsert::new(&name, FontData::from_blob(bytes, index), families.to_vec()), has))
}
