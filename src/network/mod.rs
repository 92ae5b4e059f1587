//! Loads and runs neural networks from TFLite and ONNX files, without trusting the files.
//!
//! The fastest person segmentation, which comes with the packages, is a TFLite file, run by our own code (`tflite`).
//! ONNX files are run by ONNX Runtime if installed, or else by a library. Files are not trusted: their size and that of
//! all inputs and outputs is limited, loops are rejected, and failures become one-line errors. No runtime limits memory
//! and time of a network, so a program may run unknown networks in a separate process ([`isolation`]).

mod built_in;
mod installed;
pub mod isolation;
mod known;
mod onnx;
mod onnx_runtime;
mod tflite;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use installed::{find_best, find_best_in, installed_networks, model_folders};
pub use known::{KNOWN_NETWORKS, KnownNetwork, Scaling, Task};
pub use onnx_runtime::installed_version as onnx_runtime_version;

use crate::compute::catch_panic;
use crate::files::input;
use crate::names::named;

/// Maximum size of a file: networks that a CPU can run live have less than 100 MB.
pub const MAX_BYTES: u64 = 200 << 20;
/// Maximum number of values of an input or output: more than any picture that a network receives.
pub const MAX_VALUES: usize = 4 << 20;

named! {
    /// What runs networks.
    pub enum Runtime default Auto {
        /// ONNX Runtime where it is installed, else the built-in runtime
        Auto = "auto",
        /// The built-in one: slower, but nothing to install
        BuiltIn = "built-in",
        /// ONNX Runtime, from ORT_DYLIB_PATH or its usual place
        OnnxRuntime = "onnx-runtime",
    }
}

/// An input or output of a network.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Port {
    /// Its name in the file.
    pub name: String,
    /// Its shape; `None` is a size that the caller chooses.
    pub shape: Vec<Option<usize>>,
}

/// An array of numbers in row-major order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensor {
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its values; their number is the product of the shape.
    pub values: Vec<f32>,
}

impl Tensor {
    /// Creates a tensor of zeros.
    pub fn zeros(shape: &[usize]) -> Self {
        Self { shape: shape.to_vec(), values: vec![0.0; shape.iter().product()] }
    }

    /// Replaces shape and values, and reuses the memory if it suffices.
    fn set(&mut self, shape: impl IntoIterator<Item = usize>, values: impl IntoIterator<Item = f32>) {
        self.shape.clear();
        self.shape.extend(shape);
        self.values.clear();
        self.values.extend(values);
    }
}

/// A runtime with a loaded network.
trait Engine: Send {
    /// Does the same as [`Network::run`]; may panic.
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String>;
}

/// A loaded network.
pub struct Network {
    engine: Box<dyn Engine>,
    /// Its inputs.
    pub inputs: Vec<Port>,
    /// Its outputs.
    pub outputs: Vec<Port>,
    /// The runtime, such as `ONNX Runtime 1.21.0`.
    pub runtime: String,
}

impl Network {
    /// Runs the network on one value per input, in order; `outputs` receives one value per output.
    ///
    /// # Errors
    /// Returns the error of the runtime.
    pub fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        run_guarded(|| self.engine.run(inputs, outputs))?;
        match outputs.iter().find(|output| output.values.len() > MAX_VALUES) {
            Some(output) => Err(format!("it gave more than {MAX_VALUES} values: {:?}", output.shape)),
            None => Ok(()),
        }
    }
}

/// An error in loading a network.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The network cannot be run here.
    #[error("{}: this network cannot be run: {why}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// ONNX Runtime is not available.
    #[error("ONNX Runtime: {0}")]
    NoRuntime(String),
}

/// A loaded network, and what is known about its file.
pub struct LoadedNetwork {
    /// The network, ready to run.
    pub network: Network,
    /// The known network with this content, if any.
    pub known: Option<&'static KnownNetwork>,
}

/// Loads the network in the file `path`.
///
/// # Errors
/// The file is unreadable, not a network, has loops or operators that the runtime does not support, or the requested
/// runtime is not available.
pub fn load(path: &Path, runtime: Runtime) -> Result<LoadedNetwork, NetworkError> {
    let bytes = input::read(path, MAX_BYTES).map_err(|source| NetworkError::Read { path: path.into(), source })?;
    let known = KnownNetwork::identify(&bytes);
    let refused = |why: String| NetworkError::Refused { path: path.into(), why };
    if !tflite::is_tflite(&bytes) {
        onnx::reject_loops(&bytes).map_err(refused)?;
    }
    let loaded = match isolation::is_enabled() && known.is_none() {
        true => isolation::load(&bytes, runtime),
        false => load_in_process(bytes, runtime),
    };
    let network = loaded.map_err(|failure| match failure {
        LoadFailure::NoRuntime(why) => NetworkError::NoRuntime(why),
        LoadFailure::Refused(why) => refused(why),
    })?;
    for port in network.inputs.iter().chain(&network.outputs) {
        if port
            .shape
            .iter()
            .try_fold(1usize, |all, side| all.checked_mul(side.unwrap_or(1)))
            .is_none_or(|all| all > MAX_VALUES)
        {
            return Err(refused(format!("{} has more than {MAX_VALUES} values: {:?}", port.name, port.shape)));
        }
    }
    Ok(LoadedNetwork { network, known })
}

/// An error of a runtime in loading a network.
#[derive(Debug, Serialize, Deserialize)]
enum LoadFailure {
    /// The runtime is not available.
    NoRuntime(String),
    /// The network is rejected.
    Refused(String),
}

/// Loads a network in this process.
fn load_in_process(bytes: Vec<u8>, runtime: Runtime) -> Result<Network, LoadFailure> {
    if tflite::is_tflite(&bytes) {
        return match runtime {
            Runtime::OnnxRuntime => Err(LoadFailure::Refused(
                "a .tflite runs on the built-in runtime: leave --network-runtime out".to_owned(),
            )),
            _ => run_guarded(|| tflite::Tflite::load(&bytes)).map_err(LoadFailure::Refused),
        };
    }
    let other = match runtime {
        Runtime::BuiltIn => None,
        Runtime::Auto => onnx_runtime::environment().ok(),
        Runtime::OnnxRuntime => Some(onnx_runtime::environment().map_err(LoadFailure::NoRuntime)?),
    };
    run_guarded(|| match other {
        Some(environment) => onnx_runtime::OnnxRuntime::load(&environment, &bytes),
        None => built_in::BuiltIn::load(bytes),
    })
    .map_err(LoadFailure::Refused)
}

/// Calls a runtime; turns panics into errors.
fn run_guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_panic(work).unwrap_or_else(|| Err("its runtime panicked".to_owned()))
}

/// Returns a runtime's message as one line of at most 300 characters.
fn to_one_line(error: impl ToString) -> String {
    let text = error.to_string();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(300) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}
