//! Settings from environment variables.

use crate::program::{Home, Ran};

fn with(variables: &[(&str, &str)], args: &[&str]) -> Ran {
    Ran::of(Home::new().command(args).envs(variables.iter().copied()))
}

#[test]
fn what_is_wrong_in_the_environment_is_said_to_be_there() {
    let ran = with(&[("BOKEHCAM_RIM", "7")], &["config", "dump"]);
    ran.refused(2, &["from 0 to 1", "(in the environment: BOKEHCAM_RIM=7)"]);
    let both = [("BOKEHCAM_COC_AT_INFINITY", "3"), ("BOKEHCAM_F_NUMBER", "2")];
    with(&both, &["config", "dump"]).refused(2, &["BOKEHCAM_COC_AT_INFINITY=3", "BOKEHCAM_F_NUMBER=2"]);
    let late = with(&[("BOKEHCAM_DEPTH", "stereo")], &["stream", "synthetic", "--frames", "1", "--to", "null"]);
    late.refused(2, &["one camera", "BOKEHCAM_DEPTH=stereo"]);
    // An empty variable counts as unset.
    assert!(
        with(&[("BOKEHCAM_RIM", ""), ("BOKEHCAM_CONFIG", "")], &["config", "dump"]).printed().contains("# default")
    );
    // A flag overrides the environment, so its error does not mention it.
    let flag = with(&[("BOKEHCAM_RIM", "0.1")], &["config", "dump", "--rim", "7"]);
    assert!(flag.code == 2 && !flag.stderr.contains("environment"), "{}", flag.stderr);
}

#[test]
fn switches_are_whatever_people_write() {
    for (value, expected) in [("1", true), ("yes", true), ("true", true), ("0", false), ("no", false), ("false", false)]
    {
        let home = Home::new().with_photo();
        std::fs::write(home.path("there.png"), "").unwrap();
        let args = ["render", "photo.png", "--out", "there.png", "--effect", "none"];
        let ran = Ran::of(home.command(&args).env("BOKEHCAM_FORCE", value));
        assert_eq!(ran.code == 0, expected, "{value}: {}", ran.stderr);
    }
    with(&[("BOKEHCAM_FORCE", "perhaps")], &["config", "dump"]).refused(2, &["perhaps", "BOKEHCAM_FORCE=perhaps"]);
}

#[test]
fn unknown_variables_are_named_with_what_may_have_been_meant() {
    let ran = with(&[("BOKEHCAM_RIMM", "1"), ("BOKEHCAM_NO_VM", "1"), ("BOKEHCAM_DATA", "x")], &["config", "dump"]);
    let told = "warning: in the environment there is BOKEHCAM_RIMM, which is not a setting, did you mean \
                BOKEHCAM_RIM?\n";
    assert_eq!(ran.done(), told);
    assert_eq!(with(&[("BOKEHCAM_RIMM", "1")], &["-q", "config", "dump"]).done(), "");
}

#[test]
fn what_has_no_effect_is_named_as_it_was_given() {
    let args = ["stream", "synthetic", "--size", "32x24", "--frames", "1", "--to", "null", "--effect", "none"];
    let ran = with(&[("BOKEHCAM_RIM", "0.1")], &args);
    assert!(ran.warning().contains("BOKEHCAM_RIM=0.1 (nothing is blurred)"), "{}", ran.stderr);
}
