//! Saving, renaming and deleting presets in the settings file.

use std::path::Path;

use toml_edit::{DocumentMut, Item, Table, TableLike};

use super::file::{PRESETS, check_name};
use super::paths::resolve_paths;
use super::save;
use crate::error::CliError;
use bokehcam::look::{Value, settings as table};

/// Saves settings ([`Patch::from_look`] a look, so that the preset is self-contained) as the preset `name` in the file at
/// `path`, replacing one of that name. The rest of the file stays; the file is replaced atomically, and created with
/// its folder if missing.
///
/// # Errors
/// Fails if the name is invalid, or the file is not a settings file or cannot be read or written.
pub fn save(path: &Path, name: &str, settings: &[Value]) -> Result<(), CliError> {
    check_name(name).map_err(CliError::Usage)?;
    let cwd = std::env::current_dir().map_err(CliError::io(".".as_ref()))?;
    let settings: Vec<Value> = settings.iter().map(|(name, value)| (*name, resolve_paths(&cwd, name, value))).collect();
    save::edit_file(path, |document| set_preset(document, name, &settings))
}

/// Renames the user's preset `name`; its settings and their comments stay.
///
/// # Errors
/// Fails if the file lacks the preset or already has one of the new name, or like [`save`].
pub fn rename(path: &Path, name: &str, new: &str) -> Result<(), CliError> {
    check_name(new).map_err(CliError::Usage)?;
    edit_preset(path, name, |presets| {
        if presets.contains_key(new) {
            return Err(CliError::Usage(format!("there is a preset '{new}' already: choose another name")));
        }
        presets.insert(new, presets.get(name).cloned().unwrap_or_default());
        presets.remove(name);
        Ok(())
    })
}

/// Deletes the user's preset `name`.
///
/// # Errors
/// Fails if the file lacks the preset, or like [`save`].
pub fn delete(path: &Path, name: &str) -> Result<(), CliError> {
    edit_preset(path, name, |presets| {
        presets.remove(name);
        Ok(())
    })
}

/// Edits the table of presets of a file that contains the preset `name`.
fn edit_preset(
    path: &Path,
    name: &str,
    change: impl FnOnce(&mut dyn TableLike) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let mut changed = Ok(());
    save::edit_file(path, |document| {
        changed = match document.get_mut(PRESETS).and_then(Item::as_table_like_mut) {
            Some(presets) if presets.contains_key(name) => change(presets),
            _ => Err(CliError::Usage(format!("{}: there is no preset '{name}' in it", path.display()))),
        };
        Some(())
    })
    .and(changed)
}

/// Sets the preset `name` to exactly `settings`. Returns `None` if `presets` or the preset exists but is not a table.
fn set_preset(document: &mut DocumentMut, name: &str, settings: &[Value]) -> Option<()> {
    let mut new_presets = Table::new();
    // No line `[presets]` of its own.
    new_presets.set_implicit(true);
    let presets = document.entry(PRESETS).or_insert(Item::Table(new_presets)).as_table_like_mut()?;
    if presets.get(name).is_none() {
        presets.insert(name, Item::Table(Table::new()));
    }
    let preset: &mut dyn TableLike = presets.get_mut(name)?.as_table_like_mut()?;
    let old: Vec<String> = preset.iter().map(|(key, _)| key.to_owned()).collect();
    let stays = |key: &&String| settings.iter().any(|(name, _)| *name == table::resolve_alias(key));
    old.iter().filter(|key| !stays(key)).for_each(|key| drop(preset.remove(key)));
    settings.iter().for_each(|(name, text)| save::set_key(preset, name, text));
    Some(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::file::SettingsFile;
    use super::*;
    use bokehcam::bokeh::Rank;
    use bokehcam::bokeh::aperture::{Aperture, Shape};
    use bokehcam::depth::focus::FocusRule;
    use bokehcam::look::{Effect, Look, Patch, Strength};

    fn parse(text: &str) -> SettingsFile {
        SettingsFile::parse(Path::new("c.toml"), text).unwrap()
    }

    #[test]
    fn a_preset_changes_what_it_sets_and_nothing_else() {
        let base = Look {
            focus: FocusRule::Point { x: 0.25, y: 0.5 },
            rank: Some(Rank::Full),
            strength: Strength::AtInfinity(9.0),
            ..Look::with_effect(Effect::TiltShift)
        };
        let file = parse(
            "rim = 0.9\n[presets.lens]\neffect = \"auto\"\nf-number = 2\nfocal-length = 50\nsensor-width = 36\n[presets.\"no\"]\n",
        );
        let all = file.all_presets();
        let names: Vec<_> = all.iter().map(|preset| (preset.name.as_str(), preset.is_user_defined)).collect();
        let built_in = ["portrait", "cinematic", "dreamy", "product", "miniature"].map(|name| (name, false));
        assert_eq!(names, [&built_in[..], &[("lens", true), ("no", true)]].concat());
        let looks: Vec<Look> = all.iter().map(|preset| preset.patch.apply_to(&base).unwrap()).collect();
        assert!(looks.iter().all(|look| look.focus == base.focus && look.rank == base.rank));
        assert_eq!(looks[0], Look { focus: base.focus, rank: base.rank, ..Look::default() });
        assert_eq!(looks[6], base);
        assert!(matches!(looks[5], Look { strength: Strength::Lens(_), effect: Effect::Auto, .. }));
        assert_eq!(looks[4].effect, Effect::TiltShift);
        // Changing from any preset to another gives the same look as from the default.
        for from in &looks[..5] {
            for (to, straight) in all.iter().zip(&looks[..5]) {
                let look = to.patch.apply_to(from).unwrap();
                assert_eq!(Look { tilt: straight.tilt, ..look }, *straight, "to {}", to.name);
            }
        }
    }

    #[test]
    fn a_preset_that_cannot_be_is_left_out() {
        bokehcam_live::source::register_look_files();
        let all = parse("[presets.gone]\naperture = \"image:/nowhere.png\"\n[presets.here]\nrim = 0\n").all_presets();
        assert_eq!(
            all.iter().filter(|preset| preset.is_user_defined).map(|preset| preset.name.as_str()).collect::<Vec<_>>(),
            ["here"]
        );
    }

    #[test]
    fn saving_keeps_what_is_there_and_gives_the_look_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/config.toml");
        let look = Look { rim: 0.3, ..Look::default() };
        save(&path, "first", &Patch::from_look(&look).values()).unwrap();
        let text = "# mine\nrim   = 0.9 # wide\n\n[presets.old] # dear\n# soft\nrim = 0.8 # so\nrank = 3\n\n[presets.z]\nrim = 0\n";
        fs::write(&path, text).unwrap();
        let look = Look {
            strength: Strength::Percent(3.5),
            aperture: Aperture { shape: Shape::Heart, intensity: -0.5 },
            ..look
        };
        save(&path, "Abend, \"warm\"", &Patch::from_look(&look).values()).unwrap();
        let saved = fs::read_to_string(&path).unwrap();
        assert!(saved.starts_with(text), "{saved}");
        assert!(saved.contains("rim = 0.3\n") && saved.contains("blur = \"3.5%\"\n"), "{saved}");
        let all = parse(&saved).all_presets();
        let preset = all.iter().find(|preset| preset.name.starts_with("Abend")).unwrap();
        assert_eq!(preset.patch.apply_to(&Look::with_effect(Effect::Blur)).unwrap(), look);

        save(&path, "old", &[("rim", "0.5".to_string()), ("aperture", "heart".to_string())]).unwrap();
        let again = fs::read_to_string(&path).unwrap();
        assert!(again.contains("[presets.old] # dear\n# soft\nrim = 0.5 # so\n"), "{again}");
        let settings = &parse(&again).presets["old"];
        assert_eq!(settings.iter().map(|(k, v)| format!("{k}={v}")).collect::<Vec<_>>(), ["aperture=heart", "rim=0.5"]);
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no leftovers");
    }

    #[test]
    fn a_preset_is_renamed_or_deleted_and_all_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.toml");
        let text = "# mine\nrim = 0.9\n\n[presets.old] # dear\n# soft\nrim = 0.8 # so\n\n[presets.z]\nrim = 0\n";
        fs::write(&path, text).unwrap();
        rename(&path, "old", "evening").unwrap();
        let renamed = fs::read_to_string(&path).unwrap();
        assert_eq!(renamed.matches("evening").count(), 1, "{renamed}");
        assert!(renamed.contains("# soft\nrim = 0.8 # so\n") && !renamed.contains("old"), "{renamed}");
        for (from, to, said) in
            [("old", "new", "no preset 'old'"), ("z", "evening", "already"), ("z", "dreamy", "built in")]
        {
            let refused = rename(&path, from, to).unwrap_err().to_string();
            assert!(refused.contains(said), "{refused}");
        }
        assert!(delete(&path, "dreamy").unwrap_err().to_string().contains("no preset 'dreamy'"));
        assert_eq!(fs::read_to_string(&path).unwrap(), renamed);
        delete(&path, "evening").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "# mine\nrim = 0.9\n\n[presets.z]\nrim = 0\n");
    }

    #[test]
    fn what_cannot_be_saved_leaves_the_file_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.toml");
        let flags = [("rim", "0.5".to_string())];
        for (name, said) in [("", "needs a name"), ("a\nb", "control characters"), ("dreamy", "is built in")] {
            let refused = save(&path, name, &flags).unwrap_err().to_string();
            assert!(refused.contains(said) && !refused.contains('\n'), "{refused}");
        }
        for text in ["rim = \n", "rim = 7\n", "presets = 1\n"] {
            fs::write(&path, text).unwrap();
            let refused = save(&path, "mine", &flags).unwrap_err().to_string();
            assert!(refused.contains("config.toml:1: ") && !refused.contains('\n'), "{refused}");
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        fs::write(&path, "").unwrap();
        assert!(save(&path, "mine", &[("rim", "9".to_string())]).is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "");
    }

    #[test]
    fn a_link_stays_one_and_tables_may_be_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real.toml"), folder.path().join("link.toml"));
        fs::write(&real, "presets = { a = { rim = 0.1 } }\n").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        save(&link, "b", &[("rim", "0.5".to_string())]).unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        let file = parse(&fs::read_to_string(&real).unwrap());
        assert_eq!((file.presets["a"]["rim"].as_str(), file.presets["b"]["rim"].as_str()), ("0.1", "0.5"));
    }
}
