//! Help texts.

use crate::program::{Home, Ran};

/// Returns the long options in a help text.
fn options(page: &str) -> Vec<&str> {
    let explained = page.lines().filter(|line| line.starts_with("  -") || line.starts_with("      --"));
    explained.filter_map(|line| line.split([' ', '=', '[', ',']).find(|word| word.starts_with("--"))).collect()
}

#[test]
fn the_first_page_has_what_most_people_need_and_another_has_all() {
    let home = Home::new();
    let page = |args: &[&str]| {
        let ran = home.run(args);
        assert_eq!((ran.code, ran.stderr.as_str()), (0, ""), "{args:?}");
        ran.stdout
    };
    let first = page(&["stream", "--help"]);
    assert!(options(&first).len() <= 25, "{:?}", options(&first));
    assert!(first.contains("more options: --help-all") && !first.contains("Window:"), "{first}");
    assert!(first.contains("\n            matte[:FILE]") && first.contains("\n            FOLDER"), "a list: {first}");
    assert_eq!(options(&page(&["stream", "-h"])), options(&first));
    let all = page(&["stream", "--help-all"]);
    for option in options(&first).into_iter().chain(["--rank", "--report", "--network-range", "--keep-going", "--name"])
    {
        assert!(options(&all).contains(&option), "{option}");
    }
    assert_eq!(all.contains("Window:"), cfg!(feature = "window"));
    let render = page(&["render", "--help-all"]);
    for word in ["--follow", "--background-memory", "--depth-calibration", "  FOLDER ", "  CAMERA "] {
        assert!(!render.contains(word), "{word}: {render}");
    }
    assert!(options(&page(&["ctl", "on", "--help"])).len() <= 5);
    // Hidden options are accepted.
    home.run(&["config", "dump", "--rank", "3", "--method", "gather"]).done();
}

#[test]
fn a_page_that_cannot_be_written_is_a_failure() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    Ran::of(Home::new().command(&["stream", "--help"]).stdout(full)).refused(1, &["standard output"]);
}

#[test]
fn shells_complete_names_where_there_are_names() {
    let home = Home::new().with_settings("[presets.evening]\nrim = 0.5\n");
    let bash = home.run(&["completions", "bash"]).stdout;
    let after = |option: &str| {
        let start = bash.find(&format!("                {option})\n")).unwrap_or_else(|| panic!("{option}"));
        bash[start..].lines().nth(1).unwrap().to_owned()
    };
    assert!(after("--preset").contains("dreamy") && after("--preset").contains("evening"), "{}", after("--preset"));
    assert!(after("--depth").contains("matte") && after("--behind").contains("blur"));
    assert!(!after("--rim").contains("compgen -f") && after("--depth-calibration").contains("compgen -f"));
}
