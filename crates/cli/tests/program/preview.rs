//! The command `preview` without a display, and with invalid arguments.
#![cfg(feature = "window")]
#![allow(missing_docs)]

use crate::program::{Home, PORTRAIT, Ran, without};

#[track_caller]
fn refused(arguments: &[&str], code: i32, what: &str) {
    let home = Home::new();
    let mut command = without(home.command(arguments), &["DISPLAY", "WAYLAND_"]);
    Ran::of(command.env("HOME", home.0.path())).refused(code, &[what]);
}

#[test]
fn what_does_not_fit_a_window_costs_one_line_and_exit_code_2() {
    refused(&["preview", "no/such/place"], 1, "no/such/place");
    refused(&["preview", PORTRAIT, "--pace", "asap"], 2, "--pace asap");
    refused(&["preview", PORTRAIT, "--on-demand"], 2, "--on-demand");
    refused(&["preview", PORTRAIT, "--to", "null"], 2, "beside a window");
    refused(&["preview", PORTRAIT, "--to", "window"], 2, "beside a window");
    refused(&["preview", PORTRAIT, "--split", "1.5"], 2, "from 0 to 1");
    refused(&["preview", PORTRAIT, "--preset", "nobody"], 2, "nobody");
    refused(&["stream", PORTRAIT, "--to", "window", "--to", "window"], 2, "given twice");
}

#[test]
fn without_a_display_one_line_says_what_does_the_same() {
    refused(&["preview", PORTRAIT], 1, "bokehcam stream SOURCE --to SINK");
    refused(&["stream", PORTRAIT, "--to", "window"], 1, "cannot open a window");
}
