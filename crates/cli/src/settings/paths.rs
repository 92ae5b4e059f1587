//! Paths in settings, relative to the folder in which the setting is written.

use std::any::TypeId;
use std::path::{Path, PathBuf};

use clap::Arg;

use super::table::all_settings_command;
use bokehcam::look::{Patch, settings};
use bokehcam_live::source::DepthChoice;

/// Makes the relative paths in a setting's value absolute, relative to `folder`; other values stay.
pub fn resolve_paths(folder: &Path, name: &str, value: &str) -> String {
    let absolute = |file: &str| folder.join(file).to_str().map_or_else(|| file.to_owned(), str::to_owned);
    let name = settings::resolve_alias(name);
    if settings::find_setting(name).is_some() {
        let mut patch = Patch::parse([(name, value)]).unwrap_or_default();
        let files = patch.unread_files_mut().map(|file| *file = folder.join(&*file)).count();
        let absolute = patch.values().pop().filter(|_| files > 0);
        return absolute.map_or_else(|| value.to_owned(), |(_, value)| value);
    }
    let every = all_settings_command();
    let Some(arg) = every.get_arguments().find(|arg| arg.get_long() == Some(name)) else { return value.to_owned() };
    let kind = arg.get_value_parser().type_id();
    if kind == TypeId::of::<PathBuf>() && value != "-" {
        let delimiter = arg.get_value_delimiter().unwrap_or('\0');
        return value.split(delimiter).map(absolute).collect::<Vec<_>>().join(&delimiter.to_string());
    }
    if kind == TypeId::of::<DepthChoice>() {
        return match value.parse() {
            Ok(DepthChoice::SingleCamera(mut chosen)) => {
                chosen.files_mut().for_each(|file| *file = folder.join(&*file));
                chosen.to_string()
            }
            Ok(DepthChoice::Folder(_) | DepthChoice::Device(_)) if folder.join(value).is_dir() => absolute(value),
            Ok(DepthChoice::Video(_) | DepthChoice::Device(_)) if folder.join(value).is_file() => absolute(value),
            _ => value.to_owned(),
        };
    }
    // A language is a name or a file.
    if name == "language" && value.ends_with(".toml") { absolute(value) } else { value.to_owned() }
}

/// Returns the files that a setting reads, as written in its value.
pub fn input_files(name: &str, value: &str) -> Vec<PathBuf> {
    /// Settings for results.
    const OUTPUTS: [&str; 2] = ["report", "save-to"];
    let name = settings::resolve_alias(name);
    if settings::find_setting(name).is_some() {
        return Patch::parse([(name, value)]).unwrap_or_default().unread_files_mut().map(|file| file.clone()).collect();
    }
    let every = all_settings_command();
    let is_file = |arg: &&Arg| arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    let arg = every.get_arguments().find(|arg| arg.get_long() == Some(name) && !OUTPUTS.contains(&name));
    let delimiter = arg.filter(is_file).map(|arg| arg.get_value_delimiter().unwrap_or('\0'));
    delimiter.map_or(Vec::new(), |delimiter| value.split(delimiter).map(PathBuf::from).collect())
}

/// Returns the file in a value if its path is absolute: `image:/a/b.png` contains `/a/b.png`.
pub fn absolute_file_in(value: &str) -> Option<&str> {
    let file = value.get(value.find('/')?..)?;
    let is_complete = value.strip_suffix(file).is_some_and(|before| before.is_empty() || before.ends_with(':'));
    is_complete.then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_count_from_a_folder_by_the_type_of_their_setting() {
        let home = tempfile::tempdir().unwrap();
        std::fs::create_dir(home.path().join("room")).unwrap();
        let at = |file: &str| format!("{}/{file}", home.path().display());
        for (name, value, absolute) in [
            ("behind", "image:wall.jpg", format!("image:{}", at("wall.jpg"))),
            ("behind", "image:/wall.jpg", "image:/wall.jpg".into()),
            ("behind", "blur", "blur".into()),
            ("aperture", "image:a.png", format!("image:{}", at("a.png"))),
            ("aperture", "heart", "heart".into()),
            ("rim", "0.50", "0.50".into()),
            ("coc-at-infinity", "3%", "3%".into()),
            ("calib", "l.yaml,r.yaml", format!("{},{}", at("l.yaml"), at("r.yaml"))),
            ("depth-calibration", "d.toml", at("d.toml")),
            ("report", "-", "-".into()),
            ("depth", "plate:p.png,matte", format!("plate:{},matte", at("p.png"))),
            ("depth", "mono:m.onnx", format!("mono:{}", at("m.onnx"))),
            ("depth", "auto", "auto".into()),
            ("depth", "room", at("room")),
            ("depth", "video4", "video4".into()),
            ("nothing", "x", "x".into()),
        ] {
            assert_eq!(resolve_paths(home.path(), name, value), absolute, "{name}={value}");
        }
        for (name, value, files) in [
            ("behind", "image:/wall,1.jpg", &["/wall,1.jpg"][..]),
            ("aperture", "heart", &[]),
            ("calib", "/l.yaml,/r.yaml", &["/l.yaml", "/r.yaml"]),
            ("report", "/r.json", &[]),
            ("depth", "matte", &[]),
        ] {
            assert_eq!(input_files(name, value), files.iter().map(PathBuf::from).collect::<Vec<_>>(), "{name}={value}");
        }
        assert_eq!(absolute_file_in("image:/a:b.png"), Some("/a:b.png"));
        assert_eq!(absolute_file_in("/a/b"), Some("/a/b"));
        assert_eq!((absolute_file_in("a/b"), absolute_file_in("disc")), (None, None));
    }
}
