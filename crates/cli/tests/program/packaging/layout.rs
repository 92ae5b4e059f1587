//! Names of packages, and the files in them.

use std::os::unix::fs::PermissionsExt;

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

/// After `cargo build --release`, a package takes that program, if it is up to date and has the parts of a package.
#[test]
fn a_package_takes_the_program_that_is_there() {
    let tree = tempfile::tempdir().unwrap();
    let at = |path: &str| tree.path().join(path);
    let put = |path: &str, text: &str| {
        fs::create_dir_all(at(path).parent().unwrap()).unwrap();
        fs::write(at(path), text).unwrap();
        fs::set_permissions(at(path), PermissionsExt::from_mode(0o755)).unwrap();
    };
    for path in ["scripts/package", "crates/cli/Cargo.toml"] {
        put(path, &here(path));
    }
    for source in ["Cargo.toml", "Cargo.lock", "src/lib.rs", "recordings/demo/color.mjpeg"] {
        put(source, "");
    }
    put("scripts/setup", "#!/bin/sh\n");
    put("packaging/install", "#!/bin/sh\nmkdir -p \"$2/usr/local\"\necho \"installs $1\" >&2\n");
    put(
        "programs/cargo",
        "#!/bin/sh\n[ \"$1\" != pkgid ] || echo 'x#1.0.0'\n[ \"$1\" != build ] || echo 'cargo builds' >&2\n",
    );
    put("programs/rustc", "#!/bin/sh\necho 'host: here'\n");
    let program = "target/release/bokehcam";
    let built_with =
        |parts: &str| put(program, &format!("#!/bin/sh\necho 'bokehcam 1.0.0'\necho 'built with {parts}'\n"));
    let package = |more: &[&str]| {
        let mut command = Command::new(at("scripts/package"));
        let path = format!("{}:{}", at("programs").display(), std::env::var("PATH").unwrap());
        let ran = Ran::of(command.arg("tar").args(more).env("PATH", path).env_remove("CARGO_TARGET_DIR"));
        ran.done();
        let said = ran.stdout + &ran.stderr;
        assert!(said.contains(&format!("installs {program}\n")), "{said}");
        assert_ne!(said.contains("cargo builds"), said.contains("takes target/release/bokehcam"), "{said}");
        said.contains("cargo builds")
    };
    let all = "avx512, camera, desktop, gpu, lab, networks, pipewire, window";
    built_with(all);
    assert!(!package(&[]), "it is up to date");
    assert!(package(&["--profile", "release"]), "this asks for a build");
    built_with("avx512, camera, desktop, gpu, lab, networks, window");
    assert!(package(&[]), "a part is missing");
    built_with(all);
    let later = std::time::SystemTime::now() + std::time::Duration::from_secs(60);
    fs::File::options().write(true).open(at("src/lib.rs")).unwrap().set_modified(later).unwrap();
    assert!(package(&[]), "a source is newer");
    fs::remove_file(at(program)).unwrap();
    assert!(package(&[]), "it is missing");
}

/// A program in a build's folder has the network of `scripts/setup build`.
#[test]
#[cfg(feature = "networks")]
fn a_program_that_was_built_looks_for_networks_beside_it() {
    let home = Home::new();
    let program = home.path("target/release/bokehcam");
    fs::create_dir_all(program.parent().unwrap()).unwrap();
    fs::hard_link(PROGRAM, &program).or_else(|_| fs::copy(PROGRAM, &program).map(drop)).unwrap();
    let folders = |folder: Option<&str>| {
        let mut command = home.within(Command::new(&program));
        command.arg("models").env_remove("BOKEHCAM_MODELS");
        if let Some(folder) = folder {
            command.env("BOKEHCAM_MODELS", folder);
        }
        let listed = Ran::of(&mut command).printed();
        listed.lines().find(|line| line.starts_with("looked for in ")).unwrap().to_owned()
    };
    let beside = home.path("target").canonicalize().unwrap().join("models").display().to_string();
    assert!(folders(None).contains(&beside), "{}", folders(None));
    let named = folders(Some("/elsewhere"));
    assert!(!named.contains(&beside) && named.contains("/elsewhere"), "{named}");
}
