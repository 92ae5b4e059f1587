//! Messages without PipeWire, and for invalid PipeWire arguments.

use super::program::{Ran, run};

fn stream(arguments: &[&str]) -> Ran {
    run(&[&["stream", "synthetic", "--frames", "2"], arguments].concat())
}

#[test]
fn without_a_daemon_one_line_says_so() {
    let said = ["PipeWire cannot be reached at", "systemctl --user start pipewire"];
    stream(&["--to", "pipewire"]).refused(1, &said);
}

#[test]
fn two_cameras_need_two_names_and_a_name_can_be_read() {
    for (arguments, told) in [
        (&["--to", "pipewire:Desk", "--to", "pipewire:Desk"][..], "given twice"),
        (&["--to", "pipewire:"], "needs a readable name"),
        (&["--to", "pipewire", "--out-size", "321x180"], "even width"),
    ] {
        stream(arguments).failed(2, &[told]);
    }
}
