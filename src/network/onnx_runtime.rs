//! ONNX Runtime, loaded when the program runs, from where the user has it.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use ort::environment::{Environment, EnvironmentBuilder};
use ort::logging::LogLevel;
use ort::session::{Session, SessionInputValue};
use ort::value::{TensorRef, ValueType};

use super::{Engine, Network, Port, Tensor, guarded, one_line};
use crate::files::trusted;

/// What its library is called, where the loader finds it.
const NAMES: [&str; 2] = ["libonnxruntime.so.1", "libonnxruntime.so"];

/// A network that ONNX Runtime runs.
pub struct OnnxRuntime(Session);

/// The runtime: opened once, at the first call.
///
/// # Errors
/// There is none, or it cannot be used.
pub fn environment() -> Result<Environment, String> {
    static OPENED: OnceLock<Result<Environment, String>> = OnceLock::new();
    OPENED.get_or_init(|| guarded(open)).clone()
}

fn open() -> Result<Environment, String> {
    let mut why = "not installed (Debian 13: apt install libonnxruntime1.21; anywhere: pip install onnxruntime, and \
                   ORT_DYLIB_PATH naming its capi/libonnxruntime.so.*)"
        .to_owned();
    for library in candidates()? {
        let opened = place(&library).and_then(|place| ort::init_from(&place).map_err(one_line));
        // Its own log goes to stderr raw, whatever is in a network's names; what fails is told by the call that fails.
        let quiet = |builder: EnvironmentBuilder| {
            let log =
                |_, _: &str, _: &str, _: &str, message: &str| tracing::debug!("ONNX Runtime: {}", one_line(message));
            let environment = builder.with_telemetry(false).with_logger(Arc::new(log)).build().map_err(one_line)?;
            environment.set_log_level(LogLevel::Error);
            Ok(environment)
        };
        match opened.and_then(quiet) {
            Ok(environment) => return Ok(environment),
            // A bare name that the loader does not know says nothing.
            Err(error) if library.is_absolute() => why = error,
            Err(_) => {}
        }
    }
    Err(why)
}

/// What the loader is asked for: a bare name, which it looks for where the system's libraries are, or a file that is nobody
/// else's.
fn place(library: &Path) -> Result<PathBuf, String> {
    if library.is_absolute() { trusted::code(library) } else { Ok(library.to_owned()) }
}

/// The libraries that may be tried, the user's choice alone where there is one.
///
/// # Errors
/// The user's choice depends on the folder that the program was started in.
fn candidates() -> Result<Vec<PathBuf>, String> {
    if let Some(chosen) = env::var_os("ORT_DYLIB_PATH").filter(|chosen| !chosen.is_empty()) {
        let chosen = PathBuf::from(chosen);
        let is_name = chosen.components().count() == 1 && chosen.file_name() == Some(chosen.as_os_str());
        return match chosen.is_absolute() || is_name {
            true => Ok(vec![chosen]),
            false => Err(format!(
                "ORT_DYLIB_PATH is {}, which means another file in every folder: name it from the root, as /usr/lib/...",
                chosen.display()
            )),
        };
    }
    let mut found: Vec<PathBuf> = NAMES.iter().map(PathBuf::from).collect();
    // What pip installs for the user, or in the virtual environment that is active.
    let roots = [trusted::absolute("VIRTUAL_ENV"), trusted::absolute("HOME").map(|home| home.join(".local"))];
    for python in roots.into_iter().flatten().flat_map(|root| entries(&root.join("lib"))) {
        let capi = python.join("site-packages/onnxruntime/capi");
        found.extend(entries(&capi).into_iter().filter(|file| {
            file.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libonnxruntime.so"))
        }));
    }
    Ok(found)
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.map(|entry| entry.path()).collect()
}

/// Which ONNX Runtime there is.
///
/// # Errors
/// Why there is none.
pub fn installed() -> Result<String, String> {
    environment().map(|_| name())
}

fn name() -> String {
    // "ORT Build Info: git-branch=rel-1.21.0, ...".
    let version = ort::info().split("rel-").nth(1).and_then(|rest| rest.split(',').next());
    version.map_or_else(|| "ONNX Runtime".to_owned(), |version| format!("ONNX Runtime {version}"))
}

impl OnnxRuntime {
    pub fn load(environment: &Environment, bytes: &[u8]) -> Result<Network, String> {
        let builder = Session::builder(environment).map_err(one_line)?;
        // One thread, which does not wait busily: the others are for the blur.
        let builder = builder.with_intra_threads(1).map_err(one_line)?.with_inter_threads(1).map_err(one_line)?;
        let mut builder = builder.with_intra_op_spinning(false).map_err(one_line)?;
        let session = builder.commit_from_memory(bytes).map_err(one_line)?;
        let ports = |outlets: &[ort::value::Outlet]| outlets.iter().map(port).collect::<Result<Vec<_>, _>>();
        let (inputs, outputs) = (ports(session.inputs())?, ports(session.outputs())?);
        Ok(Network { engine: Box::new(Self(session)), inputs, outputs, runtime: name() })
    }
}

fn port(outlet: &ort::value::Outlet) -> Result<Port, String> {
    let ValueType::Tensor { shape, .. } = outlet.dtype() else {
        return Err(format!("{} is no tensor", outlet.name()));
    };
    let shape = shape.iter().map(|&side| usize::try_from(side).ok()).collect();
    Ok(Port { name: outlet.name().to_owned(), shape })
}

impl Engine for OnnxRuntime {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let given = inputs.iter().map(|tensor| {
            let view = TensorRef::from_array_view((tensor.shape.as_slice(), tensor.values.as_slice()));
            view.map(SessionInputValue::from).map_err(one_line)
        });
        let given = given.collect::<Result<Vec<_>, String>>()?;
        let results = self.0.run(given.as_slice()).map_err(one_line)?;
        outputs.resize_with(results.len(), Tensor::default);
        for (k, output) in outputs.iter_mut().enumerate() {
            let (shape, values) = results[k].try_extract_tensor::<f32>().map_err(one_line)?;
            output.set(shape.iter().map(|&side| side as usize), values.iter().copied());
        }
        Ok(())
    }
}
