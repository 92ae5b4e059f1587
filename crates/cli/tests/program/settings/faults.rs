//! Commands that need no settings work beside a settings file and an environment that others refuse.

use crate::ctl::faults::{TYPO, VARIABLES};
use crate::program::{Home, Ran};

#[test]
fn commands_without_settings_work_beside_broken_ones() {
    let home = Home::new().with_settings(TYPO);
    let commands: &[(&[&str], &str)] = &[
        (&["ctl"], "nothing is running"),
        (&["ctl", "off"], "no stream or preview is running"),
        (&["ctl", "toggle"], "no stream or preview is running"),
        (&["ctl", "status"], "no stream or preview is running"),
        (&["service", "status"], "there is no systemd here"),
        (&["devices"], ""),
        #[cfg(feature = "networks")]
        (&["models"], ""),
    ];
    for (variable, value) in VARIABLES {
        for (command, said) in commands {
            // Without systemd.
            let ran = Ran::of(home.command(command).env(variable, value).env("PATH", home.path("bin")));
            assert!(ran.code < 2 && ran.stderr.contains(said), "{variable}={value} {command:?}: {}", ran.stderr);
            assert!(!ran.stderr.contains("highlihts") && !ran.stderr.contains(variable), "{command:?}: {}", ran.stderr);
        }
        let script = Ran::of(home.command(&["completions", "bash"]).env(variable, value));
        assert!(script.warning().contains("the presets of this file are left out"), "{}", script.stderr);
        assert!(script.printed().contains("cinematic"));
    }
    // Others name the fault.
    home.run(&["stream", "demo", "--to", "null"]).refused(2, &["config.toml:3: there is no setting 'highlihts'"]);
}

#[cfg(feature = "camera")]
#[test]
fn the_doctor_reports_faults_of_the_settings() {
    let findings = |home: &Home, variables: &[(&str, &str)]| -> Vec<(String, String)> {
        let told = Ran::of(home.command(&["doctor", "--json"]).envs(variables.iter().copied())).json();
        let findings = told["findings"].as_array().unwrap().iter().filter(|finding| finding["about"] == "settings");
        let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
        findings.map(|finding| (text(&finding["level"]), text(&finding["found"]))).collect()
    };
    let typo = findings(&Home::new().with_settings(TYPO), &[("BOKEHCAM_BLUR", "abc"), ("BOKEHCAM_BLURR", "1")]);
    for (finding, said) in
        typo.iter().zip(["config.toml:3: there is no setting 'highlihts'", "BOKEHCAM_BLUR=abc", "BOKEHCAM_BLURR"])
    {
        assert!(finding.0 == "note" && finding.1.contains(said), "{finding:?}");
    }
    assert_eq!(typo.len(), 3);
    let good = findings(&Home::new().with_settings("rim = 0.1\n"), &[]);
    assert!(good.len() == 1 && good[0].0 == "good" && good[0].1.ends_with("config.toml is valid"), "{good:?}");
}

#[cfg(feature = "camera")]
#[test]
fn the_doctor_says_whether_calls_are_private() {
    for (settings, variables, level, said) in [
        ("", &[][..], "good", "no filter can undo"),
        ("privacy = \"off\"\n", &[], "note", "can undo the blur of what is behind"),
        ("method = \"gather\"\n", &[], "note", "can undo the blur of what is behind"),
        ("", &[("BOKEHCAM_BLUR", "5")], "note", "5 px at 720 rows"),
        ("privacy = \"on\"\n", &[("BOKEHCAM_BLUR", "5")], "good", "no filter can undo"),
        ("preset = \"weak\"\n[presets.weak]\nblur = \"1%\"\n", &[], "note", "7.2 px at 720 rows"),
    ] {
        let home = Home::new().with_settings(settings);
        let told = Ran::of(home.command(&["doctor", "--json"]).envs(variables.iter().copied())).json();
        let findings = told["findings"].as_array().unwrap();
        let found = findings.iter().find(|finding| finding["about"] == "privacy").unwrap();
        assert_eq!(found["level"], level, "{settings}: {found}");
        assert!(found["found"].as_str().unwrap().contains(said), "{settings}: {found}");
    }
}
