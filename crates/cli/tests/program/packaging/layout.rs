//! Names of packages, and the files in them.

use super::*;

/// `cargo binstall` expects certain names of the archive and of the program in it.
#[test]
fn binstall_finds_the_archive_that_is_made() {
    let manifest: toml::Table = here("crates/cli/Cargo.toml").parse().unwrap();
    let binstall = &manifest["package"]["metadata"]["binstall"];
    let filled = |key: &str| {
        let mut text = binstall[key].as_str().unwrap().to_owned();
        for (name, value) in [
            ("name", "bokehcam-cli"),
            ("bin", "bokehcam"),
            ("version", "$version"),
            ("target", "$host"),
            ("binary-ext", ""),
        ] {
            text = text.replace(&format!("{{ {name} }}"), value);
        }
        text
    };
    let package = here("scripts/package");
    assert!(package.contains("name=\"bokehcam-$version-$host\"") && package.contains("\"$out/$name.tar.gz\""));
    assert_eq!(filled("pkg-url"), "{ repo }/releases/download/v$version/bokehcam-$version-$host.tar.gz");
    assert_eq!(filled("bin-dir"), "bokehcam-$version-$host/bin/bokehcam");
    assert_eq!(binstall["pkg-fmt"].as_str(), Some("tgz"));
}

/// A package contains the networks of the build tree, each with its licence.
#[test]
fn networks_are_given_to_others_with_their_licence() {
    let tree = tempfile::tempdir().unwrap();
    let copy = |path: &str| {
        let to = tree.path().join(path);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(Path::new(ROOT).join(path), to).unwrap();
    };
    for path in ["packaging/install", "packaging/licences.py", "README.md", "CHANGELOG.md", "LICENSE-MIT"] {
        copy(path);
    }
    for name in ["bokehcam.desktop", "bokehcam.svg", "bokehcam.service", "io.github.bokehcam.bokehcam.metainfo.xml"] {
        copy(&format!("packaging/{name}"));
    }
    copy("packaging/examples/udev.rules");
    copy("docs/call.md");
    // The script for the crates' licences needs cargo, so a fake replaces it here.
    fs::write(tree.path().join("packaging/licences.py"), "#!/bin/sh\necho licences\n").unwrap();
    let models = tree.path().join("target/models");
    fs::create_dir_all(&models).unwrap();
    fs::write(models.join("person.tflite"), "network").unwrap();
    let install = || {
        let mut command = Command::new(tree.path().join("packaging/install"));
        command.arg(PROGRAM).arg(tree.path().join("root")).arg("/usr/local");
        Ran::of(command.env_remove("CARGO_TARGET_DIR"))
    };
    let refused = install();
    assert!(refused.code == 1 && refused.stderr.contains("person.licence.txt"), "{}", refused.stderr);

    fs::write(models.join("person.licence.txt"), "Apache-2.0").unwrap();
    install().done();
    let share = tree.path().join("root/usr/local/share");
    assert_eq!(fs::read(share.join("bokehcam/models/person.tflite")).unwrap(), b"network");
    assert_eq!(fs::read(share.join("licenses/bokehcam/person.licence.txt")).unwrap(), b"Apache-2.0");
    // The unit names the installed program.
    let unit = fs::read_to_string(tree.path().join("root/usr/local/lib/systemd/user/bokehcam.service")).unwrap();
    assert!(unit.contains("ExecStart=/usr/local/bin/bokehcam "), "{unit}");
}
