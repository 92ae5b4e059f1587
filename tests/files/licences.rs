//! Dependencies have licences that deny.toml allows, and come from the registry that it names: the checks of `cargo
//! deny`, which is not installed everywhere.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Returns whether the allowed licences satisfy an expression (SPDX; `/` is an old way to write OR).
fn is_met(expression: &str, allowed: &[&str]) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    any_of(&mut rest, allowed) && rest.is_empty()
}

fn any_of(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut met = all_of(words, allowed);
    while let ["OR", rest @ ..] = *words {
        *words = rest;
        met |= all_of(words, allowed);
    }
    met
}

fn all_of(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut met = one(words, allowed);
    while let ["AND", rest @ ..] = *words {
        *words = rest;
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut &[&str], allowed: &[&str]) -> bool {
    match *words {
        ["(", rest @ ..] => {
            *words = rest;
            let met = any_of(words, allowed);
            *words = words.get(1..).unwrap_or_default();
            met
        }
        [licence, "WITH", exception, rest @ ..] => {
            *words = rest;
            allowed.contains(&format!("{licence} WITH {exception}").as_str())
        }
        [licence, rest @ ..] => {
            *words = rest;
            allowed.contains(licence)
        }
        [] => false,
    }
}

#[test]
fn licence_expressions_are_understood() {
    let allowed = ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"];
    for met in
        ["MIT", "GPL-2.0 OR MIT", "MIT/Apache-2.0", "(GPL-2.0 OR MIT) AND Zlib", "Apache-2.0 WITH LLVM-exception"]
    {
        assert!(is_met(met, &allowed), "{met}");
    }
    for not in ["", "GPL-2.0", "MIT AND GPL-2.0", "(GPL-2.0 OR MIT) AND ISC", "Apache-2.0", "MIT Zlib"] {
        assert!(!is_met(not, &allowed), "{not}");
    }
}

/// All packages of the lock file that were fetched are allowed by deny.toml.
#[test]
#[ignore = "needs all crates: cargo fetch"]
fn dependencies_are_under_licences_and_from_sources_that_are_allowed() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let rules: toml::Table = std::fs::read_to_string(here.join("deny.toml")).unwrap().parse().unwrap();
    let list = |table: &str, key: &str| -> Vec<String> {
        rules[table][key].as_array().unwrap().iter().map(|entry| entry.as_str().unwrap().to_owned()).collect()
    };
    let (licences, registries) = (list("licenses", "allow"), list("sources", "allow-registry"));
    let exceptions = rules["licenses"]["exceptions"].as_array().unwrap();

    let version = Command::new(env!("CARGO")).arg("-vV").output().unwrap().stdout;
    let version = String::from_utf8(version).unwrap();
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let arguments =
        ["metadata", "--format-version=1", "--locked", "--offline", "--all-features", "--filter-platform", host];
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(here).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 50, "{}", packages.len());
    for package in packages {
        let licence = package["license"].as_str().unwrap_or_default();
        let of_it = exceptions.iter().filter(|exception| exception["crate"].as_str() == package["name"].as_str());
        let excepted =
            of_it.flat_map(|exception| exception["allow"].as_array().unwrap()).filter_map(toml::Value::as_str);
        let allowed: Vec<&str> = licences.iter().map(String::as_str).chain(excepted).collect();
        assert!(is_met(licence, &allowed), "{} is under {licence:?}, which deny.toml does not allow", package["id"]);
        let source = package["source"].as_str().unwrap_or_default();
        let known = registries.iter().any(|registry| source == format!("registry+{registry}"));
        let own = Path::new(package["manifest_path"].as_str().unwrap()).starts_with(here);
        assert!(known || own, "{} comes from {source:?}", package["id"]);
    }
}
