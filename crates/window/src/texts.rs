//! Texts of the window: in English as written in the code, or translated.
//!
//! `texts.toml` next to this file lists all of them. A translation is that file with the right-hand sides filled in; it
//! is found by the environment's language or by `--language`. German is built in (`texts/de.toml`). Messages from
//! elsewhere in the program, such as file errors, are in English.

use std::cell::Cell;
use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use bokehcam_files::{data, input};

/// Translations by English text.
pub type Table = HashMap<String, String>;

thread_local! {
    /// The translation used on this thread, the window's; `None` for English.
    static TABLE: Cell<Option<&'static Table>> = const { Cell::new(None) };
}

/// Sets this thread's translation; call once, because the table is leaked.
pub fn set_translation(table: Table) {
    TABLE.set(Some(Box::leak(Box::new(table))));
}

/// Returns the translation of a text, or the text itself if it has none.
pub fn tr(english: &str) -> &str {
    #[cfg(test)]
    tests::record_text(english);
    TABLE.get().and_then(|table| table.get(english)).filter(|text| !text.is_empty()).map_or(english, String::as_str)
}

/// Returns the translation with `values` inserted at the placeholders `{}`, in order.
pub fn tr_with(english: &str, values: &[&dyn Display]) -> String {
    let mut text = String::new();
    let mut values = values.iter();
    for (index, part) in tr(english).split("{}").enumerate() {
        if let Some(value) = (index > 0).then(|| values.next()).flatten() {
            text += &value.to_string();
        }
        text += part;
    }
    text
}

/// Formats a number with this many decimal places, and the language's decimal sign.
pub fn format_number(number: impl Into<f64>, digits: usize) -> String {
    format!("{:.digits$}", number.into()).replace('.', tr("."))
}

/// Translates a complete sentence, matching table entries with the placeholders `{}` or `{name}` and inserting the
/// values into the translation. Names and error reasons are not in the table and stay unchanged.
pub fn translate_sentence(sentence: &str) -> String {
    let table = TABLE.get().into_iter().flatten();
    // Of several matching entries, the longest is the most specific.
    let said = table.filter(|(_, text)| !text.is_empty()).filter_map(|(english, text)| match english == sentence {
        true => Some((usize::MAX, text.clone())),
        false => Some((english.len(), fill_placeholders(text, &match_values(english, sentence)?))),
    });
    said.max_by_key(|(length, _)| *length).map_or_else(|| sentence.to_owned(), |(_, text)| text)
}

/// Returns the placeholders of a text, as name and the literal text that follows.
fn placeholders(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split('{').skip(1).filter_map(|part| part.split_once('}'))
}

/// Matches a sentence against a text with placeholders, and returns name and value of each; `None` if it does not
/// match. Such texts must begin with a literal part that contains a space.
fn match_values<'a>(text: &'a str, sentence: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let (before, _) = text.split_once('{').filter(|(before, _)| before.contains(' '))?;
    let mut rest = sentence.strip_prefix(before)?;
    let count = placeholders(text).count();
    let mut values = Vec::new();
    for (index, (name, after)) in placeholders(text).enumerate() {
        let end = if index + 1 == count { rest.len().checked_sub(after.len())? } else { rest.find(after)? };
        let (value, from) = (rest.get(..end)?, rest.get(end..)?);
        rest = from.strip_prefix(after)?;
        values.push((name, value));
    }
    rest.is_empty().then_some(values)
}

/// Fills a translation's placeholders by name, or in order if they are unnamed.
fn fill_placeholders(text: &str, values: &[(&str, &str)]) -> String {
    let mut filled = text.split('{').next().unwrap_or_default().to_owned();
    for (index, (name, after)) in placeholders(text).enumerate() {
        let named = values.iter().find(|(other, _)| !name.is_empty() && *other == name).or(values.get(index));
        filled.extend([named.map_or("", |(_, value)| value), after]);
    }
    filled
}

/// Returns the translation to use: of the language or file named, else of the environment's language. `None` is
/// English.
///
/// # Errors
/// Returns a one-line message if there is no such translation, or it cannot be read.
pub fn load_translation(language: Option<&str>) -> Result<Option<Table>, String> {
    let Some(name) = language else {
        let Some(language) = environment_language() else { return Ok(None) };
        // The environment's language was not requested explicitly, so errors fall back to English.
        let own = find_translation(&language).and_then(|path| {
            read_translation(&path).map_err(|line| tracing::warn!("{line}; the window is in English")).ok()
        });
        return Ok(own.or_else(|| load_built_in(&language)));
    };
    if ["en", "C", "POSIX"].contains(&name) {
        return Ok(None);
    }
    let file = name.ends_with(".toml").then(|| PathBuf::from(name));
    let none = || {
        format!(
            "there is no translation '{name}': save one as ~/.local/share/bokehcam/texts/{name}.toml, or give a file"
        )
    };
    match file.or_else(|| find_translation(name)) {
        Some(path) => read_translation(&path).map(Some),
        None => load_built_in(name).ok_or_else(none).map(Some),
    }
}

/// Returns the built-in translation into a language such as `de_AT.UTF-8` or `de`. A user's file has precedence.
pub fn load_built_in(language: &str) -> Option<Table> {
    let short = language.split(['.', '@', '_']).next()?;
    let text = match short {
        "de" => include_str!("texts/de.toml"),
        _ => return None,
    };
    toml::from_str(text).ok()
}

/// Reads a translation.
///
/// # Errors
/// Returns a one-line message if it cannot be read or is no list of texts.
fn read_translation(path: &Path) -> Result<Table, String> {
    let at = |what: &dyn Display| format!("{}: {what}", path.display()).replace('\n', ", ");
    let text = input::read_text(path, input::MAX_SETTINGS_BYTES).map_err(|error| at(&error))?;
    toml::from_str(&text).map_err(|error: toml::de::Error| at(&error.message()))
}

/// Finds the file of a translation into `language`, such as `de_AT` or `de`, in the XDG data folders; `None` if no file
/// exists, as for English.
fn find_translation(language: &str) -> Option<PathBuf> {
    let language = language.split(['.', '@']).next().filter(|name| is_language_name(name))?;
    let short = language.split('_').next().unwrap_or(language);
    let folders: Vec<PathBuf> = data::user_data_dir().into_iter().chain(data::system_data_dirs()).collect();
    let named = |name: &str| {
        folders.iter().map(|folder| folder.join(format!("bokehcam/texts/{name}.toml"))).find(|path| path.is_file())
    };
    named(language).or_else(|| named(short))
}

/// Returns the environment's language, in POSIX's order of precedence.
fn environment_language() -> Option<String> {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    set("LC_ALL").or_else(|| set("LC_MESSAGES")).or_else(|| set("LANG"))
}

/// Whether this is a language name and not a path.
fn is_language_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

#[cfg(test)]
pub mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeSet;

    use super::*;

    thread_local! {
        static RECORDED: RefCell<BTreeSet<String>> = const { RefCell::new(BTreeSet::new()) };
    }

    pub fn record_text(text: &str) {
        RECORDED.with_borrow_mut(|seen| seen.insert(text.to_owned()));
    }

    /// Returns the texts requested on this thread.
    pub fn recorded_texts() -> BTreeSet<String> {
        RECORDED.with_borrow(Clone::clone)
    }

    /// Returns the template for translators.
    pub fn english_table() -> Table {
        toml::from_str(include_str!("texts.toml")).unwrap()
    }

    #[test]
    fn a_text_is_translated_and_one_without_translation_stays() {
        assert_eq!(tr("Mirror"), "Mirror");
        set_translation(
            [("Mirror", "Spiegel"), ("{} of {}", "von {} {}"), ("Depth", "")].map(|(a, b)| (a.into(), b.into())).into(),
        );
        assert_eq!([tr("Mirror"), tr("Depth"), tr("Focus")], ["Spiegel", "Depth", "Focus"]);
        assert_eq!(tr_with("{} of {}", &[&2, &"3"]), "von 2 3");
        assert_eq!(tr_with("{} m", &[]), " m");
        assert_eq!((format_number(1.25f32, 1), format_number(-0.5, 2)), ("1.2".to_owned(), "-0.50".to_owned()));
        set_translation([(".".to_owned(), ",".to_owned())].into());
        assert_eq!((format_number(1.25f32, 1), format_number(40.0, 0)), ("1,2".to_owned(), "40".to_owned()));
    }

    #[test]
    fn sentences_with_values_are_translated_and_those_of_others_stay() {
        set_translation(
            [
                ("Saved {}", "{} ist gesichert"),
                ("Saved as preset '{name}'", "Als Vorlage „{name}“ gesichert"),
                ("Preset '{name}' is called '{new}' now", "„{new}“ hieß „{name}“"),
                ("{} of {}", "von {} {}"),
                ("No source.", "Keine Quelle."),
            ]
            .map(|(a, b)| (a.into(), b.into()))
            .into(),
        );
        for (english, german) in [
            ("Saved ~/x y.png", "~/x y.png ist gesichert"),
            ("Saved as preset 'dusk'", "Als Vorlage „dusk“ gesichert"),
            ("Preset 'a' is called 'b' now", "„b“ hieß „a“"),
            ("No source.", "Keine Quelle."),
            ("x.png: no such file of yours", "x.png: no such file of yours"),
            ("Preset 'a' is called 'b' no", "Preset 'a' is called 'b' no"),
            ("", ""),
        ] {
            assert_eq!(translate_sentence(english), german);
        }
    }

    #[test]
    fn a_translation_is_read_or_said_to_be_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("xx.toml");
        std::fs::write(&path, "\"Mirror\" = \"Spiegel\"\n").unwrap();
        assert_eq!(read_translation(&path).unwrap()["Mirror"], "Spiegel");
        std::fs::write(&path, "Mirror = 3\n").unwrap();
        let line = read_translation(&path).unwrap_err();
        assert!(line.contains("xx.toml: ") && !line.contains('\n'), "{line}");
        assert!(read_translation(&folder.path().join("none.toml")).is_err());
        for odd in ["", "../etc", "C.UTF-8", "zz_ZZ"] {
            assert_eq!(find_translation(odd), None, "{odd}");
        }
        assert_eq!(load_translation(Some("en")), Ok(None));
        assert!(load_translation(Some("zz")).unwrap_err().contains("no translation 'zz'"));
        assert!(load_translation(Some("/nowhere/zz.toml")).unwrap_err().contains("/nowhere/zz.toml: "));
    }
}
