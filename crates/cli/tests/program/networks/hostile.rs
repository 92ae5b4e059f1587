//! Malicious networks can neither hang nor abort the program, nor send control sequences to the terminal.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::{Pid, Signal, kill_process};

use super::onnx::{Side, always, constant, conv, endless_loop, integers, matte, model, node, node_with_numbers, port};
use super::{WEIGHTS, streamed, written};
use crate::program::{Beside, Home, PORTRAIT, found, until};

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
        ("much", shape(&[1, 1, 100_000, 100_000]), "more than 4 GiB of memory"),
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
    assert!(told.len() == 1 && told[0].contains("more than 4 GiB of memory"), "{said}");
}

/// Starts an endless stream with a network; returns it and the worker process that runs the network.
fn endless(home: &Home) -> (Beside, Pid) {
    written(&home.0, "good.onnx", &matte(16, 12, WEIGHTS, 0.0));
    let stream = ["stream", PORTRAIT, "--loop", "--pace", "realtime", "--network-runtime", "built-in"];
    let mut command = home.command(&[&stream[..], &["--depth", "matte:good.onnx", "--to", "out.y4m"]].concat());
    let program = Beside::start(command.stderr(Stdio::piped()));
    let worker = found("the network's process", HANG, || program.children().first().copied());
    let written_bytes = || {
        let files = fs::read_dir(home.0.path()).unwrap().flatten();
        let outputs = files.filter(|file| file.file_name().to_string_lossy().contains("out.y4m"));
        outputs.map(|file| file.metadata().map_or(0, |metadata| metadata.len())).sum::<u64>()
    };
    until("frames", HANG, || written_bytes() > 1 << 20);
    (program, worker)
}

#[test]
fn a_network_that_hangs_in_the_run_is_given_up() {
    let home = Home::new();
    let (program, worker) = endless(&home);
    kill_process(worker, Signal::STOP).unwrap();
    until("its end", HANG, || program.children().is_empty());
    let ran = program.end_by(Signal::TERM, HANG);
    assert!(ran.done().contains("everything is blurred: it gave no answer in 10 s"), "{}", ran.stderr);
}

#[test]
fn a_signal_ends_a_run_whose_network_hangs_and_its_output_is_whole() {
    let home = Home::new();
    let (program, worker) = endless(&home);
    kill_process(worker, Signal::STOP).unwrap();
    let ran = program.end_by(Signal::TERM, HANG);
    let said = ran.done();
    assert!(!said.contains("in 10 s"), "nobody waited for so long: {said}");
    assert!(home.path("out.y4m").is_file(), "{said}");
    let mut left = fs::read_dir(home.0.path()).unwrap().flatten();
    let left = left.any(|file| file.file_name().to_string_lossy().ends_with(".part"));
    assert!(!left && kill_process(worker, Signal::CONT).is_err(), "{said}");
}

#[test]
fn the_process_of_a_network_goes_with_the_program() {
    let home = Home::new();
    let (program, worker) = endless(&home);
    // The program is killed without a chance to clean up.
    drop(program);
    let state = || fs::read_to_string(format!("/proc/{}/stat", worker.as_raw_nonzero())).ok();
    until("the network's process goes", HANG, || state().is_none_or(|stat| stat.contains(") Z ")));
}

/// Puts a named pipe in the place of ONNX Runtime; opening it blocks for ever.
fn trap(root: &Path) {
    let capi = root.join("lib/python3/site-packages/onnxruntime/capi");
    fs::create_dir_all(&capi).unwrap();
    mknodat(CWD, capi.join("libonnxruntime.so.1"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
}

#[test]
fn code_is_not_loaded_from_the_working_folder_or_from_where_others_write() {
    let home = Home::new();
    trap(home.0.path());
    trap(&home.path(".local"));
    let doctor = |variables: &[(&str, &str)]| {
        println!("with {variables:?}");
        let mut command = home.command(&["doctor"]);
        command.env("HOME", "/nonexistent").env_remove("VIRTUAL_ENV").env_remove("ORT_DYLIB_PATH");
        command.envs(variables.iter().copied()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let ran = Beside::start(&mut command).end(HANG);
        ran.stdout + &ran.stderr
    };
    for variable in ["HOME", "VIRTUAL_ENV"] {
        for value in ["", "."] {
            doctor(&[(variable, value)]);
        }
    }
    assert!(doctor(&[("ORT_DYLIB_PATH", "./lib/libonnxruntime.so.1")]).contains("give an absolute path"));
    let library = written(&home.0, "libonnxruntime.so", b"nothing");
    fs::set_permissions(&library, fs::Permissions::from_mode(0o666)).unwrap();
    let said = doctor(&[("ORT_DYLIB_PATH", library.to_str().unwrap())]);
    assert!(said.contains("can be written to by others"), "{said}");
}
