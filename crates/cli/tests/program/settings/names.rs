//! Former names go on working: the blur strength has two names, equivalent in all settings, and quality levels warn.

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

#[test]
fn a_former_level_means_a_present_one_wherever_it_is_written_and_that_is_said_once() {
    for (former, name) in [("fast", "draft"), ("high", "balanced")] {
        let told = format!("warning: quality {former} is called {name} now\n");
        let settings =
            format!("quality = \"{former}\"\nrim = 0.1\n[presets.mine]\nquality = \"{former}\"\nrim = 0.2\n");
        let home = Home::new().with_settings(&settings);
        for args in [&["config", "dump"][..], &["config", "dump", "--preset", "mine"]] {
            assert_eq!(home.run(args).done(), told, "{args:?}");
        }
        let home = Home::new();
        assert_eq!(home.run(&["config", "dump", "--quality", former]).done(), told);
        assert_eq!(Ran::of(home.command(&["config", "dump"]).env("BOKEHCAM_QUALITY", former)).done(), told);
        let bench = ["bench", "--sizes", "32x24", "--frames", "1", "--backend", "cpu", "--quality", former];
        let bench = home.run(&bench);
        assert!(bench.done().contains(&told) && bench.stdout.contains(name), "{} {}", bench.stdout, bench.stderr);
    }
}
