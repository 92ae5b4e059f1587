//! Files that settings name, and what relative ones count from: the folder that they are written in.

use std::any::TypeId;
use std::path::{Path, PathBuf};

use super::table::all_settings;
use bokehcam::look::{Patch, settings};
use bokehcam::source::DepthChoice;

/// The value of the setting `name` with every relative path in it counted from `folder`; any other value as it is.
pub fn counted_from(folder: &Path, name: &str, value: &str) -> String {
    let whole = |file: &str| folder.join(file).to_str().map_or_else(|| file.to_owned(), str::to_owned);
    let name = settings::name_of(name);
    if settings::setting(name).is_some() {
        let mut patch = Patch::parse([(name, value)]).unwrap_or_default();
        let files = patch.files_mut().map(|file| *file = folder.join(&*file)).count();
        let whole = patch.values().pop().filter(|_| files > 0);
        return whole.map_or_else(|| value.to_owned(), |(_, value)| value);
    }
    let every = all_settings();
    let Some(arg) = every.get_arguments().find(|arg| arg.get_long() == Some(name)) else { return value.to_owned() };
    let kind = arg.get_value_parser().type_id();
    if kind == TypeId::of::<PathBuf>() && value != "-" {
        let delimiter = arg.get_value_delimiter().unwrap_or('\0');
        return value.split(delimiter).map(whole).collect::<Vec<_>>().join(&delimiter.to_string());
    }
    if kind == TypeId::of::<DepthChoice>() {
        return match value.parse() {
            Ok(DepthChoice::OneCamera(mut chosen)) => {
                chosen.files_mut().for_each(|file| *file = folder.join(&*file));
                chosen.to_string()
            }
            Ok(DepthChoice::Folder(_) | DepthChoice::Device(_)) if folder.join(value).is_dir() => whole(value),
            _ => value.to_owned(),
        };
    }
    // A language is a name, or a file.
    if name == "language" && value.ends_with(".toml") { whole(value) } else { value.to_owned() }
}

/// The file that a value names, if that is a whole path: `image:/a/b.png` names `/a/b.png`.
pub fn file_in(value: &str) -> Option<&str> {
    let file = value.get(value.find('/')?..)?;
    let is_whole = value.strip_suffix(file).is_some_and(|before| before.is_empty() || before.ends_with(':'));
    is_whole.then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_count_from_a_folder_by_the_type_of_their_setting() {
        let home = tempfile::tempdir().unwrap();
        std::fs::create_dir(home.path().join("room")).unwrap();
        let at = |file: &str| format!("{}/{file}", home.path().display());
        for (name, value, whole) in [
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
            assert_eq!(counted_from(home.path(), name, value), whole, "{name}={value}");
        }
        assert_eq!(file_in("image:/a:b.png"), Some("/a:b.png"));
        assert_eq!((file_in("/a/b"), file_in("a/b"), file_in("disc")), (Some("/a/b"), None, None));
    }
}
