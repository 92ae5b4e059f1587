//! Presets: the looks that they make of another one, and saving one's own.

use std::path::Path;

use clap::FromArgMatches;
use toml_edit::{DocumentMut, Item, Table, TableLike};

use super::config;
use super::error::CliError;
use super::options::Every;
use super::save;
use super::settings::{PRESETS, SettingsFile, Values, check_name, excluded_by, parse_flags};
use crate::look::{Look, flags::Flag, presets};

/// A preset upon another look.
#[derive(Clone, Debug, PartialEq)]
pub struct Upon {
    /// Its name.
    pub name: String,
    /// The other look with its settings; what it does not set is as before.
    pub look: Look,
    /// Whether it is the person's own.
    pub own: bool,
}

/// Every preset upon `base`, those in the file last. Those that cannot be, such as one whose aperture is a picture that
/// is gone, are left out with a warning.
pub fn all_upon(file: &SettingsFile, base: &Look, has_depth: bool) -> Vec<Upon> {
    let built_in = presets::BUILT_IN.iter().map(|preset| (preset.name, false));
    let own = file.presets.keys().map(|name| (name.as_str(), true));
    let upon = |(name, own): (&str, bool)| match look_of(upon(file, name, base), has_depth) {
        Ok(look) => Some(Upon { name: name.to_owned(), look, own }),
        Err(error) => {
            tracing::warn!("preset {name}: {error}");
            None
        }
    };
    built_in.chain(own).filter_map(upon).collect()
}

/// The settings of `base`, those of a preset going before.
fn upon(file: &SettingsFile, preset: &str, base: &Look) -> Values {
    let settings = file.preset(preset).unwrap_or_default();
    let excluded = excluded_by(&settings.keys().cloned().collect::<Vec<_>>());
    let mut values: Values = base.every_flag().into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    values.retain(|name, _| !excluded.contains(name));
    values.extend(settings);
    values
}

/// The look that settings make.
fn look_of(values: Values, has_depth: bool) -> Result<Look, CliError> {
    let refuse = |error: clap::Error| CliError::Usage(super::arguments::one_line(&error));
    let every = parse_flags(&values).and_then(|matches| Every::from_arg_matches(&matches)).map_err(refuse)?;
    config::look(&every.blur, &every.aperture, every.computing.quality, has_depth)
}

/// Saves settings ([`Look::every_flag`], so that the preset depends on nothing else) as the preset `name` in the file
/// at `path`, in place of one of that name. All else in the file stays as it is, and the file changes as a whole or
/// not at all; it and its folder are made where they are missing.
///
/// # Errors
/// The name cannot be one; the file is no settings file, or cannot be read or written.
pub fn save(path: &Path, name: &str, flags: &[Flag]) -> Result<(), CliError> {
    check_name(name).map_err(CliError::Usage)?;
    save::edit(path, |document| with_preset(document, name, flags))
}

/// Puts a preset into a settings file.
fn with_preset(document: &mut DocumentMut, name: &str, flags: &[Flag]) -> Option<()> {
    let mut tables = Table::new();
    tables.set_implicit(true);
    let presets = document.entry(PRESETS).or_insert(Item::Table(tables)).as_table_like_mut()?;
    if presets.get(name).is_none() {
        presets.insert(name, Item::Table(Table::new()));
    }
    let preset: &mut dyn TableLike = presets.get_mut(name)?.as_table_like_mut()?;
    let gone: Vec<String> = preset.iter().map(|(key, _)| key.to_owned()).collect();
    gone.iter().filter(|key| !flags.iter().any(|(flag, _)| flag == key)).for_each(|key| drop(preset.remove(key)));
    flags.iter().for_each(|(flag, text)| save::set(preset, flag, text));
    Some(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::bokeh::aperture::Shape;
    use crate::bokeh::{Effect, Rank};
    use crate::depth::focus::FocusRule;
    use crate::look::Strength;

    fn parsed(text: &str) -> SettingsFile {
        SettingsFile::parse(Path::new("c.toml"), text).unwrap()
    }

    #[test]
    fn a_preset_changes_what_it_sets_and_nothing_else() {
        let base = Look {
            focus: FocusRule::Point { x: 0.25, y: 0.5 },
            rank: Some(Rank::Full),
            strength: Strength::AtInfinity(9.0),
            ..Look::plain(Some(Effect::TiltShift))
        };
        let file = parsed(
            "rim = 0.9\n[presets.lens]\neffect = \"auto\"\nf-number = 2\nfocal-length = 50\nsensor-width = 36\n[presets.\"no\"]\n",
        );
        let all = all_upon(&file, &base, true);
        let names: Vec<_> = all.iter().map(|preset| (preset.name.as_str(), preset.own)).collect();
        let built_in = ["portrait", "cinematic", "dreamy", "product", "miniature"].map(|name| (name, false));
        assert_eq!(names, [&built_in[..], &[("lens", true), ("no", true)]].concat());
        assert!(all.iter().all(|preset| preset.look.focus == base.focus && preset.look.rank == base.rank));
        assert_eq!(all[0].look, Look { focus: base.focus, rank: base.rank, ..Look::plain(Some(Effect::Dof)) });
        assert_eq!(all[6].look, base);
        assert!(matches!(all[5].look, Look { strength: Strength::Lens(_), effect: Some(Effect::Dof), .. }));
        assert_eq!(all[4].look.effect, Some(Effect::TiltShift));
        // From any preset to any other is the same as from the start.
        for from in &all[..5] {
            for (to, straight) in all_upon(&file, &from.look, true).iter().zip(&all[..5]) {
                let look = Look { tilt: straight.look.tilt, ..to.look.clone() };
                assert_eq!(look, straight.look, "{} to {}", from.name, to.name);
            }
        }
        // Without depth they blur evenly.
        assert!(all_upon(&file, &base, false)[..4].iter().all(|preset| preset.look.effect == Some(Effect::Blur)));
    }

    #[test]
    fn a_preset_that_cannot_be_is_left_out() {
        let file = parsed("[presets.gone]\naperture = \"image:/nowhere.png\"\n[presets.here]\nrim = 0\n");
        let all = all_upon(&file, &Look::plain(Some(Effect::Dof)), true);
        assert_eq!(
            all.iter().filter(|preset| preset.own).map(|preset| preset.name.as_str()).collect::<Vec<_>>(),
            ["here"]
        );
    }

    #[test]
    fn saving_keeps_what_is_there_and_gives_the_look_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/config.toml");
        let look = Look { rim: 0.3, ..Look::plain(Some(Effect::Dof)) };
        save(&path, "first", &look.every_flag()).unwrap();
        let text = "# mine\nrim   = 0.9 # wide\n\n[presets.old] # dear\n# soft\nrim = 0.8 # so\nrank = 3\n\n[presets.z]\nrim = 0\n";
        fs::write(&path, text).unwrap();
        let look = Look {
            strength: Strength::Percent(3.5),
            aperture: crate::bokeh::aperture::Aperture { shape: Shape::Heart, intensity: -0.5 },
            ..look
        };
        save(&path, "Abend, \"warm\"", &look.every_flag()).unwrap();
        let saved = fs::read_to_string(&path).unwrap();
        assert!(saved.starts_with(text), "{saved}");
        assert!(saved.contains("rim = 0.3\n") && saved.contains("coc-at-infinity = \"3.5%\"\n"), "{saved}");
        let all = all_upon(&parsed(&saved), &Look::plain(Some(Effect::Blur)), true);
        assert_eq!(all.iter().find(|preset| preset.name.starts_with("Abend")).unwrap().look, look);

        save(&path, "old", &[("rim", "0.5".to_string()), ("aperture", "heart".to_string())]).unwrap();
        let again = fs::read_to_string(&path).unwrap();
        assert!(again.contains("[presets.old] # dear\n# soft\nrim = 0.5 # so\n"), "{again}");
        let settings = &parsed(&again).presets["old"];
        assert_eq!(settings.iter().map(|(k, v)| format!("{k}={v}")).collect::<Vec<_>>(), ["aperture=heart", "rim=0.5"]);
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no leftovers");
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
        let file = parsed(&fs::read_to_string(&real).unwrap());
        assert_eq!((file.presets["a"]["rim"].as_str(), file.presets["b"]["rim"].as_str()), ("0.1", "0.5"));
    }
}
