//! Networks that would do harm: none hangs the program, aborts it, or has the terminal obey it.

use std::fs;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use super::onnx::{Side, always, constant, conv, endless_loop, integers, matte, model, node, node_with_numbers, port};
use super::{WEIGHTS, bokehcam, written};

/// What takes longer hangs.
const HANG: Duration = Duration::from_secs(120);

fn sides(channels: u64) -> [Side; 4] {
    [Side::Is(1), Side::Is(channels), Side::Is(12), Side::Is(16)]
}

/// A network that takes a picture, with these constants and nodes, whose last one gives `out`.
fn network(constants: &[Vec<u8>], nodes: &[Vec<u8>]) -> Vec<u8> {
    model(&[port("in", &sides(3))], constants, nodes, &[port("out", &sides(1))])
}

const PORTRAIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait");

/// What a run of two frames says, and how it ends.
fn streamed(folder: &TempDir, name: &str, bytes: &[u8], more: &[&str]) -> Output {
    let file = written(folder, name, bytes);
    let choice = format!("matte:{}", file.display());
    let arguments = ["stream", PORTRAIT, "--depth", &choice, "--network-runtime", "built-in", "--to", "null"];
    bokehcam(&[&arguments[..], more].concat(), folder.path())
}

#[test]
fn what_would_run_for_ever_or_take_all_memory_is_refused_in_one_line() {
    let folder = TempDir::new().unwrap();
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
        ("forever", forever, "the operator Loop, which may run for ever"),
        ("much", shape(&[1, 1, 100_000, 100_000]), "more than 4 GiB of memory"),
        ("all", shape(&[1, 1 << 40, 1 << 40, 1 << 40]), "all.onnx"),
        ("pads", padded, "pads.onnx"),
        ("escapes", escapes, "escapes.onnx"),
    ] {
        let ran = streamed(&folder, &format!("{name}.onnx"), &bytes, &["--frames", "1"]);
        let said = String::from_utf8(ran.stderr).unwrap();
        assert_eq!((ran.status.code(), said.lines().count()), (Some(1), 1), "{name}: {said}");
        assert!(said.contains(expected) && !said.contains(['\u{1b}', '\u{7}']), "{name}: {said}");
    }
}

/// It passes the trial, whose picture is grey, and asks for 100 GB once there is something to see.
#[test]
fn a_network_that_fails_in_the_run_blurs_all_and_no_frame_is_lost() {
    let folder = TempDir::new().unwrap();
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
    let ran = streamed(&folder, "later.onnx", &network(&constants, &nodes), &["--frames", "3"]);
    let said = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(0), "{said}");
    assert!(said.contains("3 of 3 frames delivered"), "{said}");
    let told: Vec<&str> = said.lines().filter(|line| line.contains("all is blurred")).collect();
    assert!(told.len() == 1 && told[0].contains("more than 4 GiB of memory"), "{said}");
}

/// The processes that a process has started.
fn children(of: &Child) -> Vec<Pid> {
    let listed = fs::read_to_string(format!("/proc/{0}/task/{0}/children", of.id())).unwrap_or_default();
    listed.split_whitespace().filter_map(|id| Pid::from_raw(id.parse().ok()?)).collect()
}

fn wait_until<T>(what: &str, mut is_there: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(there) = is_there() {
            return there;
        }
        assert!(begun.elapsed() < HANG, "{what}: not after {HANG:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A stream without an end by a network of the test's own, and the process that runs that.
fn endless(folder: &TempDir) -> (Child, Pid) {
    let file = written(folder, "good.onnx", &matte(16, 12, WEIGHTS, 0.0));
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.args(["stream", PORTRAIT, "--loop", "--pace", "realtime", "--network-runtime", "built-in"]);
    command.arg("--depth").arg(format!("matte:{}", file.display())).arg("--to").arg(folder.path().join("out.y4m"));
    let program = command.env("XDG_CONFIG_HOME", folder.path()).stderr(Stdio::piped()).spawn().unwrap();
    let worker = wait_until("the network's process", || children(&program).first().copied());
    let written_bytes = || {
        let files = fs::read_dir(folder.path()).unwrap().flatten();
        let outputs = files.filter(|file| file.file_name().to_string_lossy().contains("out.y4m"));
        outputs.map(|file| file.metadata().map_or(0, |metadata| metadata.len())).sum::<u64>()
    };
    wait_until("frames", || (written_bytes() > 1 << 20).then_some(()));
    (program, worker)
}

fn ended(mut program: Child) -> (Option<i32>, String) {
    let status = wait_until("the end", || program.try_wait().unwrap());
    let mut said = String::new();
    program.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (status.code(), said)
}

fn signal(program: &Child, signal: Signal) {
    kill_process(Pid::from_child(program), signal).unwrap();
}

#[test]
fn a_network_that_hangs_in_the_run_is_given_up() {
    let folder = TempDir::new().unwrap();
    let (program, worker) = endless(&folder);
    kill_process(worker, Signal::STOP).unwrap();
    wait_until("its end", || children(&program).is_empty().then_some(()));
    signal(&program, Signal::TERM);
    let (code, said) = ended(program);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("all is blurred: it gave no answer in 10 s"), "{said}");
}

#[test]
fn a_signal_ends_a_run_whose_network_hangs_and_its_output_is_whole() {
    let folder = TempDir::new().unwrap();
    let (program, worker) = endless(&folder);
    kill_process(worker, Signal::STOP).unwrap();
    signal(&program, Signal::TERM);
    let (code, said) = ended(program);
    assert_eq!(code, Some(0), "{said}");
    assert!(!said.contains("in 10 s"), "nobody waited for so long: {said}");
    assert!(folder.path().join("out.y4m").is_file(), "{said}");
    let left = fs::read_dir(folder.path())
        .unwrap()
        .flatten()
        .any(|file| file.file_name().to_string_lossy().ends_with(".part"));
    assert!(!left && kill_process(worker, Signal::CONT).is_err(), "{said}");
}

#[test]
fn the_process_of_a_network_goes_with_the_program() {
    let folder = TempDir::new().unwrap();
    let (mut program, worker) = endless(&folder);
    // It gets no chance to clean up.
    program.kill().unwrap();
    program.wait().unwrap();
    let state = || fs::read_to_string(format!("/proc/{}/stat", worker.as_raw_nonzero())).ok();
    let is_gone = || state().is_none_or(|stat| stat.contains(") Z ")).then_some(());
    wait_until("the network's process", is_gone);
}

/// A named pipe in the place of ONNX Runtime: who opens it waits for ever.
fn trap(root: &Path) {
    let capi = root.join("lib/python3/site-packages/onnxruntime/capi");
    fs::create_dir_all(&capi).unwrap();
    mknodat(CWD, capi.join("libonnxruntime.so.1"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
}

#[test]
fn code_is_not_loaded_from_the_working_folder_or_from_where_others_write() {
    let folder = TempDir::new().unwrap();
    trap(folder.path());
    trap(&folder.path().join(".local"));
    let doctor = |variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
        command.arg("doctor").current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.env("HOME", "/nonexistent").env_remove("VIRTUAL_ENV").env_remove("ORT_DYLIB_PATH");
        let mut program = command.envs(variables.iter().copied()).spawn().unwrap();
        wait_until(&format!("the end with {variables:?}"), || program.try_wait().unwrap());
        let mut said = String::new();
        program.stdout.take().unwrap().read_to_string(&mut said).unwrap();
        program.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        said
    };
    for variable in ["HOME", "VIRTUAL_ENV"] {
        for value in ["", "."] {
            doctor(&[(variable, value)]);
        }
    }
    assert!(doctor(&[("ORT_DYLIB_PATH", "./lib/libonnxruntime.so.1")]).contains("name it from the root"));
    let library = written(&folder, "libonnxruntime.so", b"nothing");
    fs::set_permissions(&library, fs::Permissions::from_mode(0o666)).unwrap();
    let said = doctor(&[("ORT_DYLIB_PATH", library.to_str().unwrap())]);
    assert!(said.contains("can be written to by others"), "{said}");
}
