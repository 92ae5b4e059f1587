//! Characters in scripts that the built-in fonts lack.

use std::path::Path;
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

use egui::{FontFamily, FontId};

use super::super::SystemFonts;
use super::Window;
use crate::state::Source;

/// Longer than any search for a font takes.
const PATIENCE: Duration = Duration::from_secs(60);

#[test]
fn signs_of_other_scripts_come_from_the_systems_fonts_once_a_name_has_them() {
    if Command::new("fc-match").arg("--version").output().is_err() {
        return eprintln!("left out, as fc-match is not installed");
    }
    // A fontconfig configuration with a single font of three characters.
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("fonts.conf");
    let fonts = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fonts");
    let text = format!(
        "<?xml version=\"1.0\"?><fontconfig><dir>{}</dir><cachedir>{}</cachedir></fontconfig>",
        fonts.display(),
        folder.path().display()
    );
    std::fs::write(&config, text).unwrap();

    let mut window = Window::new();
    let (sender, receiver) = mpsc::channel();
    let system = SystemFonts::with_config(Some(config), move || sender.send(()).unwrap_or_default());
    system.install(&window.ctx);
    window.wait(0.2);
    assert!(receiver.try_recv().is_err(), "nothing is looked for before it is missed");
    let has = |window: &Window, sign: char| {
        let families = [FontFamily::Proportional, super::super::theme::medium_font()];
        window.ctx.fonts_mut(|fonts| families.map(|family| fonts.has_glyph(&FontId::new(13.0, family), sign)))
    };
    assert_eq!(has(&window, 'É'), [true; 2]);
    let Source::Running(running) = &mut window.state.source else { unreachable!() };
    running.label = "ДΩ中한".into();
    window.state.sources.clear();
    window.pass(Vec::new());
    receiver.recv_timeout(PATIENCE).expect("fonts are found");
    system.install(&window.ctx);
    window.wait(0.1);
    for sign in "ДΩ中".chars() {
        assert_eq!(has(&window, sign), [true; 2], "{sign}");
    }
    assert_eq!(has(&window, '한'), [false; 2], "what no font has stays a box");
    assert!(window.texts().iter().any(|text| text.contains("ДΩ中한")), "{:?}", window.texts());
}
