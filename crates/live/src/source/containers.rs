//! Recordings in a single file, which other programs turn into what can be read.

use std::ffi::OsStr;
use std::path::Path;

/// Returns whether a file is such a recording, by its extension.
pub(super) fn is_container(path: &Path) -> bool {
    ["bag", "db3", "svo", "svo2"].contains(&extension(path).as_str())
}

/// Describes in one line how the recording becomes a folder that can be read.
pub(super) fn describe_conversion(path: &Path) -> String {
    let folder = path.with_extension("");
    let (file, dir) = (path.display(), folder.display());
    match extension(path).as_str() {
        "bag" => format!(
            "a ROS bag must become a folder of pictures first; RealSense's does with Open3D (pip install open3d): \
             python3 -c \"import open3d; open3d.t.io.RSBagReader.create('{file}').save_frames('{dir}')\" writes \
             {dir}/color and {dir}/depth; others: pip install rosbags && rosbags-convert --src '{file}' --dst '{dir}' \
             --dst-storage mcap --dst-typestore ros2_humble; {dir} is then the source"
        ),
        "db3" => format!(
            "a ROS 2 recording in a database must become an MCAP file first: pip install rosbags && rosbags-convert \
             --src '{bag}' --dst '{dir}-mcap' --dst-storage mcap; {dir}-mcap is then the source",
            bag = path.parent().filter(|bag| !bag.as_os_str().is_empty()).unwrap_or(Path::new(".")).display()
        ),
        _ => format!(
            "a ZED recording must become a folder of pictures first: mkdir '{dir}' && ZED_SVO_Export '{file}' '{dir}' \
             4 (of the ZED SDK's samples) writes {dir}/left000000.png and {dir}/depth000000.png; {dir} is then the \
             source"
        ),
    }
}

fn extension(path: &Path) -> String {
    path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::source::SourceName;

    #[test]
    fn each_kind_of_file_is_told_its_converter() {
        let dir = tempfile::tempdir().unwrap();
        for (name, content, converter) in [
            ("take.bag", "#ROSBAG V2.0", "RSBagReader"),
            ("TAKE.BAG", "", "rosbags-convert"),
            ("take.db3", "SQLite format 3", "rosbags"),
            ("take.svo", "", "ZED_SVO_Export"),
            ("take.svo2", "", "ZED_SVO_Export"),
        ] {
            let path = dir.path().join(name);
            fs::write(&path, content).unwrap();
            let error = SourceName::parse_os(path.as_os_str()).unwrap_err();
            assert!(error.is_wrong_argument());
            let message = error.to_string();
            assert!(!message.contains('\n') && message.contains(converter), "{message}");
            assert!(message.contains(&path.with_extension("").display().to_string()), "{message}");
        }
        // A folder may have any name.
        fs::create_dir(dir.path().join("folder.bag")).unwrap();
        assert!(SourceName::parse_os(dir.path().join("folder.bag").as_os_str()).is_ok());
    }
}
