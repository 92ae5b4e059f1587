//! Start and end: the first picture, and closing at any time.

use super::picture::is_photograph;
use super::preview::Program;
use super::program::PORTRAIT;
use super::screen::Screen;

#[test]
#[ignore = "needs an X server"]
fn a_first_picture_comes_and_closing_ends_it_well() {
    let screen = Screen::new();
    for source in ["demo", PORTRAIT] {
        let mut program = Program::start(&screen, &[source]);
        let window = program.window();
        window.until("the first picture", is_photograph);
        println!("{source}: the first picture after {:?}", program.began.elapsed());
        let report = program.close().report();
        assert!(report["frames"]["delivered"].as_u64().unwrap() >= 1, "{report}");
    }
}

#[test]
#[ignore = "needs an X server"]
fn it_can_be_closed_while_it_loads() {
    let screen = Screen::new();
    for source in ["synthetic", PORTRAIT] {
        let mut program = Program::start(&screen, &[source]);
        // Close as soon as the window exists.
        let window = program.window();
        window.close();
        let ended = program.end();
        assert_eq!(ended.status.code(), Some(0), "{source}: {}", ended.said);
        assert!(!ended.said.contains("panicked"), "{}", ended.said);
        if ended.home.path("report.json").exists() {
            ended.succeeded();
        }
    }
}

#[test]
#[ignore = "needs an X server"]
fn ctrl_c_in_the_terminal_ends_it_as_well() {
    let screen = Screen::new();
    let mut program = Program::start(&screen, &[PORTRAIT]);
    program.window().until("the first picture", is_photograph);
    program.interrupt();
    program.end().succeeded();
}
