//! The machine report of `doctor`, meant for publication.

use std::fs;

use crate::program::{Home, Ran};

/// The report contains neither user nor host names, even if they occur in the collected information.
#[test]
fn a_report_names_no_user_and_no_machine() {
    let home = Home::at(tempfile::Builder::new().prefix("planted-user").tempdir().unwrap());
    let user = home.0.path().file_name().unwrap().to_str().unwrap();
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    // The session type is printed verbatim.
    let planted = format!("x11 {} {user} {} /home/somebody/x", home.0.path().display(), host.trim());
    let file = home.path("report.md");
    let report = |args: &[&str]| {
        let mut command = home.command(args);
        Ran::of(command.env("HOME", home.0.path()).env("USER", user).env("XDG_SESSION_TYPE", &planted))
    };
    assert!(report(&["doctor"]).stdout.contains(&planted), "it is not where it would be told");

    let written = report(&["doctor", "--report", "report.md"]);
    assert!(written.done().contains("report.md"), "{}", written.stderr);
    assert_eq!(fs::read_to_string(&file).unwrap(), written.stdout);
    assert!(written.stdout.contains("session x11 ~ (user)"), "{}", written.stdout);
    for name in [home.0.path().to_str().unwrap(), user, "somebody"] {
        assert!(!written.stdout.contains(name), "{name}: {}", written.stdout);
    }
    // A host name that equals a common word, such as the distribution's name, is not redacted.
    let is_common = ["localhost", "linux", "debian", "ubuntu", "fedora"].contains(&host.trim());
    let is_told = written.stdout.split_whitespace().any(|word| word == host.trim());
    assert!(is_common || !is_told, "{}", written.stdout);
    for part in ["### Machine", "### Cameras", "### What doctor found", "### Time of the blur\n\n```text\nsize "] {
        assert!(written.stdout.contains(part), "{part}: {}", written.stdout);
    }

    fs::write(&file, "mine").unwrap();
    let refused = report(&["doctor", "--report", "report.md"]);
    assert_eq!((refused.code, refused.stdout.as_str()), (1, ""), "{}", refused.stderr);
    assert!(refused.stderr.contains("report.md exists") && !refused.stderr.contains("--force"), "{}", refused.stderr);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
}
