//! The window's texts: in English, as they are where they are used, or as a translation has them.
//!
//! `texts.toml` beside this file is the table of all of them. A translation is that file with the right sides filled in: it
//! is found by the language of the environment or by `--language`. German comes with the program, in `texts/de.toml`. What the program says elsewhere, such as why a
//! file cannot be read, is in English.

use std::cell::Cell;
use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use bokehcam::files::{data, input};

/// Texts by their English.
pub type Table = HashMap<String, String>;

thread_local! {
    /// What this thread, the window's, speaks; English where there is none.
    static TABLE: Cell<Option<&'static Table>> = const { Cell::new(None) };
}

/// Speaks by this table from now on, on this thread, which is to be called once.
pub fn speak(table: Table) {
    TABLE.set(Some(Box::leak(Box::new(table))));
}

/// A text in the language that is spoken; itself where that has none for it.
pub fn tr(english: &str) -> &str {
    #[cfg(test)]
    tests::saw(english);
    TABLE.get().and_then(|table| table.get(english)).filter(|text| !text.is_empty()).map_or(english, String::as_str)
}

/// The same with values in the places `{}`, in their order.
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

/// A sentence in the language that is spoken: where the table has it, as it is or with values in its places `{}` or `{name}`,
/// which then are in those of the translation. Names and reasons of errors are in no table, and stay.
pub fn translated(sentence: &str) -> String {
    let table = TABLE.get().into_iter().flatten();
    // What has values says most itself where it is longest.
    let said = table.filter(|(_, text)| !text.is_empty()).filter_map(|(english, text)| match english == sentence {
        true => Some((usize::MAX, text.clone())),
        false => Some((english.len(), filled(text, &values_in(english, sentence)?))),
    });
    said.max_by_key(|(length, _)| *length).map_or_else(|| sentence.to_owned(), |(_, text)| text)
}

/// The places of a text with values, and what follows each of them.
fn places(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split('{').skip(1).filter_map(|part| part.split_once('}'))
}

/// What a sentence has in the places of a text; `None` where that is another one. Such a text begins with words of its own.
fn values_in<'a>(text: &'a str, sentence: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let (before, _) = text.split_once('{').filter(|(before, _)| before.contains(' '))?;
    let mut rest = sentence.strip_prefix(before)?;
    let count = places(text).count();
    let mut values = Vec::new();
    for (index, (name, after)) in places(text).enumerate() {
        let end = if index + 1 == count { rest.len().checked_sub(after.len())? } else { rest.find(after)? };
        let (value, from) = (rest.get(..end)?, rest.get(end..)?);
        rest = from.strip_prefix(after)?;
        values.push((name, value));
    }
    rest.is_empty().then_some(values)
}

/// A translation with values in its places: by their names, or in order where they have none.
fn filled(text: &str, values: &[(&str, &str)]) -> String {
    let mut filled = text.split('{').next().unwrap_or_default().to_owned();
    for (index, (name, after)) in places(text).enumerate() {
        let named = values.iter().find(|(other, _)| !name.is_empty() && *other == name).or(values.get(index));
        filled.extend([named.map_or("", |(_, value)| value), after]);
    }
    filled
}

/// The table to speak by: of the language that was chosen, or of a file; else of the environment's language. `None` is
/// English.
///
/// # Errors
/// There is no translation into the language that was chosen, or it cannot be read: one line.
pub fn chosen(language: Option<&str>) -> Result<Option<Table>, String> {
    let Some(name) = language else {
        let Some(language) = usual_language() else { return Ok(None) };
        // Nobody asked for this one: the window is in English then.
        let own = find(&language)
            .and_then(|path| read(&path).map_err(|line| tracing::warn!("{line}; the window is in English")).ok());
        return Ok(own.or_else(|| built_in(&language)));
    };
    if ["en", "C", "POSIX"].contains(&name) {
        return Ok(None);
    }
    let is_file = name.ends_with(".toml").then(|| PathBuf::from(name));
    let none = || {
        format!(
            "there is no translation '{name}': put one at ~/.local/share/bokehcam/texts/{name}.toml, or name a file"
        )
    };
    match is_file.or_else(|| find(name)) {
        Some(path) => read(&path).map(Some),
        None => built_in(name).ok_or_else(none).map(Some),
    }
}

/// The translation into a language, such as `de_AT.UTF-8` or `de`, that comes with the program. A file of the person's has
/// precedence.
pub fn built_in(language: &str) -> Option<Table> {
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
/// It cannot be read, or is no list of texts: one line.
fn read(path: &Path) -> Result<Table, String> {
    let at = |what: &dyn Display| format!("{}: {what}", path.display()).replace('\n', ", ");
    let text = input::read_text(path, input::MOST_SETTINGS_BYTES).map_err(|error| at(&error))?;
    toml::from_str(&text).map_err(|error: toml::de::Error| at(&error.message()))
}

/// The file of the translation into `language`, such as `de_AT` or `de`, in the folders for data of the environment; `None`
/// where there is none, as for English.
fn find(language: &str) -> Option<PathBuf> {
    let language = language.split(['.', '@']).next().filter(|name| is_name(name))?;
    let short = language.split('_').next().unwrap_or(language);
    let folders: Vec<PathBuf> = data::own().into_iter().chain(data::system()).collect();
    let named = |name: &str| {
        folders.iter().map(|folder| folder.join(format!("bokehcam/texts/{name}.toml"))).find(|path| path.is_file())
    };
    named(language).or_else(|| named(short))
}

/// The language of the environment, as POSIX has it.
fn usual_language() -> Option<String> {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    set("LC_ALL").or_else(|| set("LC_MESSAGES")).or_else(|| set("LANG"))
}

/// Whether this names a language, and no place among files.
fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

#[cfg(test)]
pub mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeSet;

    use super::*;

    thread_local! {
        static SEEN: RefCell<BTreeSet<String>> = const { RefCell::new(BTreeSet::new()) };
    }

    pub fn saw(text: &str) {
        SEEN.with_borrow_mut(|seen| seen.insert(text.to_owned()));
    }

    /// What was asked for on this thread.
    pub fn seen() -> BTreeSet<String> {
        SEEN.with_borrow(Clone::clone)
    }

    /// The table that translators begin with.
    pub fn english() -> Table {
        toml::from_str(include_str!("texts.toml")).unwrap()
    }

    #[test]
    fn a_text_is_translated_and_one_without_translation_stays() {
        assert_eq!(tr("Mirror"), "Mirror");
        speak(
            [("Mirror", "Spiegel"), ("{} of {}", "von {} {}"), ("Depth", "")].map(|(a, b)| (a.into(), b.into())).into(),
        );
        assert_eq!([tr("Mirror"), tr("Depth"), tr("Focus")], ["Spiegel", "Depth", "Focus"]);
        assert_eq!(tr_with("{} of {}", &[&2, &"3"]), "von 2 3");
        assert_eq!(tr_with("{} m", &[]), " m");
    }

    #[test]
    fn sentences_with_values_are_translated_and_those_of_others_stay() {
        speak(
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
            assert_eq!(translated(english), german);
        }
    }

    #[test]
    fn a_translation_is_read_or_said_to_be_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("xx.toml");
        std::fs::write(&path, "\"Mirror\" = \"Spiegel\"\n").unwrap();
        assert_eq!(read(&path).unwrap()["Mirror"], "Spiegel");
        std::fs::write(&path, "Mirror = 3\n").unwrap();
        let line = read(&path).unwrap_err();
        assert!(line.contains("xx.toml: ") && !line.contains('\n'), "{line}");
        assert!(read(&folder.path().join("none.toml")).is_err());
        for odd in ["", "../etc", "C.UTF-8", "zz_ZZ"] {
            assert_eq!(find(odd), None, "{odd}");
        }
        assert_eq!(chosen(Some("en")), Ok(None));
        assert!(chosen(Some("zz")).unwrap_err().contains("no translation 'zz'"));
        assert!(chosen(Some("/nowhere/zz.toml")).unwrap_err().contains("/nowhere/zz.toml: "));
    }
}
