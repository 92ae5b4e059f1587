//! The blur strength has two names, which are equivalent in all settings.

use crate::program::{Home, Ran};

use super::pictures::text;

const NAMES: [&str; 2] = ["blur", "coc-at-infinity"];

/// Returns the dump's line of the blur strength.
fn strength(ran: &Ran) -> String {
    assert_eq!(ran.done(), "");
    let is_it = |line: &&str| NAMES.iter().any(|name| line.starts_with(&format!("{name} =")));
    let line = ran.stdout.lines().find(is_it).unwrap_or_else(|| panic!("{}", ran.stdout));
    line.to_owned()
}

#[test]
fn both_names_are_read_everywhere_and_one_is_written() {
    for name in NAMES {
        let dump = Home::new().run(&["config", "dump", &format!("--{name}"), "3%"]);
        assert_eq!(strength(&dump), "blur = \"3%\" # flag");
        let variable = format!("BOKEHCAM_{}", name.replace('-', "_").to_uppercase());
        let dump = Ran::of(Home::new().command(&["config", "dump"]).env(variable, "3%"));
        assert_eq!(strength(&dump), "blur = \"3%\" # environment");
        let settings = format!("{name} = \"3%\"\n[presets.mine]\n{name} = 7\n");
        let home = Home::new().with_settings(&settings);
        assert_eq!(strength(&home.run(&["config", "dump"])), "blur = \"3%\" # file");
        assert_eq!(strength(&home.run(&["config", "dump", "--preset", "mine"])), "blur = 7 # preset");
        // Saving changes the existing line in place.
        home.run(&["config", "save", "--blur", "5"]).done();
        assert_eq!(text(&home.settings()), settings.replacen("\"3%\"", "5", 1));
        let bad = Home::new().run(&["config", "dump", &format!("--{name}"), "much"]);
        bad.refused(2, &["use pixels from 0 to 20000"]);
    }
    let both = Home::new().with_settings("blur = 1\ncoc-at-infinity = 2\n");
    both.run(&["config", "dump"]).refused(2, &["config.toml:2: ", "given twice, also by its other name"]);
    Home::new().run(&["config", "dump", "--blur", "1", "--coc-at-infinity", "2"]).refused(2, &["multiple times"]);
}
