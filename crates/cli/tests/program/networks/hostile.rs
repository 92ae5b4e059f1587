//! Malicious networks can neither hang nor abort the program, nor send control sequences to the terminal.

use std::fs;
use std::process::Stdio;
use std::time::Duration;

use rustix::process::Signal;

use super::onnx::{Side, always, constant, conv, endless_loop, integers, model, node, node_with_numbers, port};
use super::{streamed, written};
use crate::program::{Beside, Home, PORTRAIT, until};

/// Timeout against hangs.
const HANG: Duration = Duration::from_secs(120);

fn sides(channels: u64) -> [Side; 4] {
    [Side::Is(1), Side::Is(channels), Side::Is(12), Side::Is(16)]
}

/// Builds a network with a picture as its input; the last node must write `out`.
fn network(constants: &[Vec<u8>], nodes: &[Vec<u8>]) -> Vec<u8> {
    model(&[port("in", &sides(3))], constants, nodes, &[port("out", &sides(1))])
}

#[test]
fn what_would_run_for_ever_or_take_all_memory_is_refused_in_one_line() {
    let home = Home::new();
    let shape = |values: &[i64]| {
        let weights = constant("w", &[1, 3, 1, 1], &[0.1; 3]);
        let nodes = [
            node("ConstantOfShape", &["shape"], "much", &[]),
            node_with_numbers("ReduceSum", &["much"], "sum", &[("keepdims", 0)]),
            conv(&["in", "w"], "seen"),
            node("Add", &["seen", "sum"], "out", &[]),
        ];
        network(&[integers("shape", values), weights], &nodes)
    };
    let mean = |input: &str| node("ReduceMean", &[input], "out", &[("axes", &[1])]);
    let forever = network(&[always("yes")], &[endless_loop("yes", "in", "again"), mean("again")]);
    let pads = [0, 0, 0, 0, 0, 0, 100_000, 100_000];
    let padded = network(&[integers("pads", &pads)], &[node("Pad", &["in", "pads"], "much", &[]), mean("much")]);
    let named = node("Gather", &["in", "\u{1b}]0;title\u{7}\u{1b}[31m\nred"], "out", &[]);
    let escapes = network(&[integers("\u{1b}]0;title\u{7}\u{1b}[31m\nred", &[1_000_000_000])], &[named]);
    for (name, bytes, expected) in [
        ("forever", forever, "the operator Loop, which may run forever"),
        ("much", shape(&[1, 1, 100_000, 100_000]), "more than 2 GiB of memory"),
        ("all", shape(&[1, 1 << 40, 1 << 40, 1 << 40]), "all.onnx"),
        ("pads", padded, "pads.onnx"),
        ("escapes", escapes, "escapes.onnx"),
    ] {
        let ran = streamed(&home, name, &bytes, "1");
        let said = ran.refused(1, &[expected]);
        assert!(!said.contains(['\u{1b}', '\u{7}']), "{name}: {said}");
    }
}

/// The network passes the self-test on a grey picture, but allocates 100 GB on a real one.
#[test]
fn a_network_that_fails_in_the_run_blurs_all_and_no_frame_is_lost() {
    let home = Home::new();
    let numbers = |operator, output| node_with_numbers(operator, &["in"], output, &[("keepdims", 0)]);
    let nodes = [
        numbers("ReduceMax", "high"),
        numbers("ReduceMin", "low"),
        node("Sub", &["high", "low"], "contrast", &[]),
        node("Mul", &["contrast", "much"], "many", &[]),
        node_with_numbers("Cast", &["many"], "shape", &[("to", 7)]),
        node("ConstantOfShape", &["shape"], "zeros", &[]),
        node_with_numbers("ReduceSum", &["zeros"], "sum", &[("keepdims", 0)]),
        conv(&["in", "w"], "seen"),
        node("Add", &["seen", "sum"], "out", &[]),
    ];
    let constants = [constant("much", &[2], &[200_000.0; 2]), constant("w", &[1, 3, 1, 1], &[0.1; 3])];
    let ran = streamed(&home, "later", &network(&constants, &nodes), "3");
    let said = ran.done();
    assert!(said.contains("3 of 3 frames delivered"), "{said}");
    let told: Vec<&str> = said.lines().filter(|line| line.contains("everything is blurred")).collect();
    assert!(told.len() == 1 && told[0].contains("more than 2 GiB of memory"), "{said}");
}

/// Starts an endless stream with a network that passes the self-test on a grey picture, and works for minutes on a real
/// one; returns once it is at work.
fn hanging(home: &Home) -> Beside {
    let numbers = |operator, output| node_with_numbers(operator, &["in"], output, &[("keepdims", 0)]);
    let mut nodes = vec![
        numbers("ReduceMax", "high"),
        numbers("ReduceMin", "low"),
        node("Sub", &["high", "low"], "contrast", &[]),
        node("Mul", &["contrast", "many"], "more", &[]),
        node("Add", &["more", "two"], "sides", &[]),
        node_with_numbers("Cast", &["sides"], "shape", &[("to", 7)]),
        node("ConstantOfShape", &["shape"], "0", &[]),
    ];
    let names: Vec<String> = (0..100).map(|k| k.to_string()).collect();
    nodes.extend(names.windows(2).map(|pair| node("MatMul", &["0", &pair[0]], &pair[1], &[])));
    nodes.push(node_with_numbers("ReduceSum", &[&names[99]], "sum", &[("keepdims", 0)]));
    nodes.push(conv(&["in", "w"], "seen"));
    nodes.push(node("Add", &["seen", "sum"], "out", &[]));
    let constants = [
        constant("many", &[2], &[6000.0; 2]),
        constant("two", &[2], &[2.0; 2]),
        constant("w", &[1, 3, 1, 1], &[0.1; 3]),
    ];
    written(&home.0, "slow.onnx", &network(&constants, &nodes));
    let stream = ["stream", PORTRAIT, "--loop", "--pace", "realtime", "--depth", "matte:slow.onnx", "--to", "out.y4m"];
    let program = Beside::start(home.command(&stream).stderr(Stdio::piped()));
    until("a network at work", HANG, || {
        let before = program.threads("network");
        std::thread::sleep(Duration::from_secs(1));
        !before.is_empty() && program.threads("network") == before
    });
    program
}

#[test]
fn a_network_that_hangs_in_the_run_is_given_up() {
    let home = Home::new();
    let program = hanging(&home);
    let written_bytes = || {
        let files = fs::read_dir(home.0.path()).unwrap().flatten();
        let outputs = files.filter(|file| file.file_name().to_string_lossy().contains("out.y4m"));
        outputs.map(|file| file.metadata().map_or(0, |metadata| metadata.len())).sum::<u64>()
    };
    until("frames without it", HANG, || written_bytes() > 1 << 20);
    let ran = program.end_by(Signal::TERM, HANG);
    assert!(ran.done().contains("everything is blurred: it gave no answer in 10 s"), "{}", ran.stderr);
}

#[test]
fn a_signal_ends_a_run_whose_network_hangs_and_its_output_is_whole() {
    let home = Home::new();
    let ran = hanging(&home).end_by(Signal::TERM, HANG);
    let said = ran.done();
    assert!(!said.contains("in 10 s"), "nobody waited for so long: {said}");
    assert!(home.path("out.y4m").is_file(), "{said}");
    let mut left = fs::read_dir(home.0.path()).unwrap().flatten();
    assert!(!left.any(|file| file.file_name().to_string_lossy().ends_with(".part")), "{said}");
}
