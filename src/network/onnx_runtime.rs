//! ONNX Runtime, loaded dynamically from the user's installation.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use ort::environment::{Environment, EnvironmentBuilder};
use ort::logging::LogLevel;
use ort::session::{Session, SessionInputValue};
use ort::value::{TensorRef, ValueType};

use super::{Engine, Network, Port, Tensor, run_guarded, to_one_line};
use crate::files::trusted;

/// Its library names, for the dynamic loader.
const NAMES: [&str; 2] = ["libonnxruntime.so.1", "libonnxruntime.so"];

/// A network run by ONNX Runtime.
pub struct OnnxRuntime(Session);

/// Returns the runtime, which is opened at the first call.
///
/// # Errors
/// It is not installed, or cannot be used.
pub fn environment() -> Result<Environment, String> {
    static OPENED: OnceLock<Result<Environment, String>> = OnceLock::new();
    OPENED.get_or_init(|| run_guarded(load_library)).clone()
}

fn load_library() -> Result<Environment, String> {
    let mut why = "not installed (Debian 13: apt install libonnxruntime1.21; anywhere: pip install onnxruntime, and \
                   ORT_DYLIB_PATH naming its capi/libonnxruntime.so.*)"
        .to_owned();
    for library in candidate_libraries()? {
        let opened = resolve_library(&library).and_then(|place| ort::init_from(&place).map_err(to_one_line));
        // Its own log would go to stderr unfiltered, including names from the network; errors are returned by calls
        // anyway.
        let quiet = |builder: EnvironmentBuilder| {
            let log =
                |_, _: &str, _: &str, _: &str, message: &str| tracing::debug!("ONNX Runtime: {}", to_one_line(message));
            let environment = builder.with_telemetry(false).with_logger(Arc::new(log)).build().map_err(to_one_line)?;
            environment.set_log_level(LogLevel::Error);
            Ok(environment)
        };
        match opened.and_then(quiet) {
            Ok(environment) => return Ok(environment),
            // The error of a bare name that the loader does not find is not informative.
            Err(error) if library.is_absolute() => why = error,
            Err(_) => {}
        }
    }
    Err(why)
}

/// Returns what the loader opens: a bare name, which it searches among the system's libraries, or a trusted file.
fn resolve_library(library: &Path) -> Result<PathBuf, String> {
    if library.is_absolute() { trusted::resolve_code_path(library) } else { Ok(library.to_owned()) }
}

/// Returns the libraries to try; only the user's choice if there is one.
///
/// # Errors
/// The user's choice is a relative path.
fn candidate_libraries() -> Result<Vec<PathBuf>, String> {
    if let Some(chosen) = env::var_os("ORT_DYLIB_PATH").filter(|chosen| !chosen.is_empty()) {
        let chosen = PathBuf::from(chosen);
        let is_name = chosen.components().count() == 1 && chosen.file_name() == Some(chosen.as_os_str());
        return match chosen.is_absolute() || is_name {
            true => Ok(vec![chosen]),
            false => Err(format!(
                "ORT_DYLIB_PATH is {}, a relative path: give an absolute path, such as /usr/lib/...",
                chosen.display()
            )),
        };
    }
    let mut found: Vec<PathBuf> = NAMES.iter().map(PathBuf::from).collect();
    // Installed by pip, for the user or in the active virtual environment.
    let roots =
        [trusted::absolute_env_path("VIRTUAL_ENV"), trusted::absolute_env_path("HOME").map(|home| home.join(".local"))];
    for python in roots.into_iter().flatten().flat_map(|root| list_folder(&root.join("lib"))) {
        let capi = python.join("site-packages/onnxruntime/capi");
        found.extend(list_folder(&capi).into_iter().filter(|file| {
            file.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libonnxruntime.so"))
        }));
    }
    Ok(found)
}

fn list_folder(folder: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.map(|entry| entry.path()).collect()
}

/// Returns name and version of the installed ONNX Runtime.
///
/// # Errors
/// Returns why it is not available.
pub fn installed_version() -> Result<String, String> {
    environment().map(|_| runtime_name())
}

fn runtime_name() -> String {
    // "ORT Build Info: git-branch=rel-1.21.0, ...".
    let version = ort::info().split("rel-").nth(1).and_then(|rest| rest.split(',').next());
    version.map_or_else(|| "ONNX Runtime".to_owned(), |version| format!("ONNX Runtime {version}"))
}

impl OnnxRuntime {
    pub fn load(environment: &Environment, bytes: &[u8]) -> Result<Network, String> {
        let builder = Session::builder(environment).map_err(to_one_line)?;
        // One thread, without busy waiting; the other cores are for the blur.
        let builder = builder.with_intra_threads(1).map_err(to_one_line)?.with_inter_threads(1).map_err(to_one_line)?;
        let mut builder = builder.with_intra_op_spinning(false).map_err(to_one_line)?;
        let session = builder.commit_from_memory(bytes).map_err(to_one_line)?;
        let ports = |outlets: &[ort::value::Outlet]| outlets.iter().map(read_port).collect::<Result<Vec<_>, _>>();
        let (inputs, outputs) = (ports(session.inputs())?, ports(session.outputs())?);
        Ok(Network { engine: Box::new(Self(session)), inputs, outputs, runtime: runtime_name() })
    }
}

fn read_port(outlet: &ort::value::Outlet) -> Result<Port, String> {
    let ValueType::Tensor { shape, .. } = outlet.dtype() else {
        return Err(format!("{} is not a tensor", outlet.name()));
    };
    let shape = shape.iter().map(|&side| usize::try_from(side).ok()).collect();
    Ok(Port { name: outlet.name().to_owned(), shape })
}

impl Engine for OnnxRuntime {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let given = inputs.iter().map(|tensor| {
            let view = TensorRef::from_array_view((tensor.shape.as_slice(), tensor.values.as_slice()));
            view.map(SessionInputValue::from).map_err(to_one_line)
        });
        let given = given.collect::<Result<Vec<_>, String>>()?;
        let results = self.0.run(given.as_slice()).map_err(to_one_line)?;
        outputs.resize_with(results.len(), Tensor::default);
        for (k, output) in outputs.iter_mut().enumerate() {
            let (shape, values) = results[k].try_extract_tensor::<f32>().map_err(to_one_line)?;
            output.set(shape.iter().map(|&side| side as usize), values.iter().copied());
        }
        Ok(())
    }
}
