//! Neural networks in files, TFLite's and ONNX's: read, run, and kept from doing harm.
//!
//! What finds persons in the least time, and comes with the packages, is a TFLite file, which is run by code of our own
//! (`tflite`). An ONNX file is run by ONNX Runtime where that is installed, and else by a library. No file is trusted: its size and
//! those of all it takes and gives are bounded, it may have no loops, and what fails in it, fails with a line of text. No
//! runtime bounds the memory and the time of what it runs, so that a program may let networks that are not known run in a
//! process of their own ([`apart`]).

pub mod apart;
mod built_in;
mod known;
mod onnx;
mod onnx_runtime;
mod place;
mod tflite;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use known::{KNOWN, Known, Scaling, Task};
pub use onnx_runtime::installed as onnx_runtime_installed;
pub use place::{best, best_in, folders, installed};

use crate::compute::catch_panic;
use crate::files::input;
use crate::names::named;

/// Most bytes of a file: the networks that a processor can run live have less than 100 MB.
pub const MOST_BYTES: u64 = 200 << 20;
/// Most values of an input or output: more than any picture that a network is shown.
pub const MOST_VALUES: usize = 4 << 20;

named! {
    /// What runs networks.
    pub enum Runtime default Auto {
        /// ONNX Runtime where it is installed, else what is built in
        Auto = "auto",
        /// What is built in: slower, and nothing to install
        BuiltIn = "built-in",
        /// ONNX Runtime, from where ORT_DYLIB_PATH says or where it is usually installed
        OnnxRuntime = "onnx-runtime",
    }
}

/// What a network takes or gives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Port {
    /// Its name in the file.
    pub name: String,
    /// Its sizes; `None` where the caller chooses.
    pub shape: Vec<Option<usize>>,
}

/// Numbers in some dimensions, the last one varying fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensor {
    /// Sizes.
    pub shape: Vec<usize>,
    /// As many values as the product of the sizes.
    pub values: Vec<f32>,
}

impl Tensor {
    /// Zeros.
    pub fn zeros(shape: &[usize]) -> Self {
        Self { shape: shape.to_vec(), values: vec![0.0; shape.iter().product()] }
    }

    /// Takes other sizes and values, keeping its memory where that suffices.
    fn set(&mut self, shape: impl IntoIterator<Item = usize>, values: impl IntoIterator<Item = f32>) {
        self.shape.clear();
        self.shape.extend(shape);
        self.values.clear();
        self.values.extend(values);
    }
}

/// What runs a network that it has loaded.
trait Engine: Send {
    /// As [`Network::run`]; it may panic.
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String>;
}

/// A network that was loaded.
pub struct Network {
    engine: Box<dyn Engine>,
    /// What it takes.
    pub inputs: Vec<Port>,
    /// What it gives.
    pub outputs: Vec<Port>,
    /// What runs it, such as `ONNX Runtime 1.21.0`.
    pub runtime: String,
}

impl Network {
    /// Runs it on one value of each input, in their order; `outputs` then holds one of each output.
    ///
    /// # Errors
    /// What the runtime says.
    pub fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        guarded(|| self.engine.run(inputs, outputs))?;
        match outputs.iter().find(|output| output.values.len() > MOST_VALUES) {
            Some(output) => Err(format!("it gave more than {MOST_VALUES} values: {:?}", output.shape)),
            None => Ok(()),
        }
    }
}

/// Why a network is not used.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no network that can be run here.
    #[error("{}: no network that can be run here: {why}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// There is no ONNX Runtime.
    #[error("ONNX Runtime: {0}")]
    NoRuntime(String),
}

/// A network and how its file begins.
pub struct Loaded {
    /// Ready to run.
    pub network: Network,
    /// What is known of this very file.
    pub known: Option<&'static Known>,
}

/// Loads the network in the file `path`.
///
/// # Errors
/// It cannot be read, is no ONNX file, has loops, needs what the runtime has not, or the runtime asked for is not there.
pub fn load(path: &Path, runtime: Runtime) -> Result<Loaded, NetworkError> {
    let bytes = input::read(path, MOST_BYTES).map_err(|source| NetworkError::Read { path: path.into(), source })?;
    let known = Known::of(&bytes);
    let refused = |why: String| NetworkError::Refused { path: path.into(), why };
    if !tflite::is_tflite(&bytes) {
        onnx::refuse_repeating(&bytes).map_err(refused)?;
    }
    let loaded = match apart::is_possible() && known.is_none() {
        true => apart::load(&bytes, runtime),
        false => load_here(bytes, runtime),
    };
    let network = loaded.map_err(|failure| match failure {
        Failure::NoRuntime(why) => NetworkError::NoRuntime(why),
        Failure::Refused(why) => refused(why),
    })?;
    for port in network.inputs.iter().chain(&network.outputs) {
        if port
            .shape
            .iter()
            .try_fold(1usize, |all, side| all.checked_mul(side.unwrap_or(1)))
            .is_none_or(|all| all > MOST_VALUES)
        {
            return Err(refused(format!("{} has more than {MOST_VALUES} values: {:?}", port.name, port.shape)));
        }
    }
    Ok(Loaded { network, known })
}

/// Why a runtime does not run a network.
#[derive(Debug, Serialize, Deserialize)]
enum Failure {
    /// It is not there.
    NoRuntime(String),
    /// It cannot.
    Refused(String),
}

/// Lets a runtime in this process load a network.
fn load_here(bytes: Vec<u8>, runtime: Runtime) -> Result<Network, Failure> {
    if tflite::is_tflite(&bytes) {
        return match runtime {
            Runtime::OnnxRuntime => {
                Err(Failure::Refused("a .tflite is run by what is built in: leave --network-runtime out".to_owned()))
            }
            _ => guarded(|| tflite::Tflite::load(&bytes)).map_err(Failure::Refused),
        };
    }
    let other = match runtime {
        Runtime::BuiltIn => None,
        Runtime::Auto => onnx_runtime::environment().ok(),
        Runtime::OnnxRuntime => Some(onnx_runtime::environment().map_err(Failure::NoRuntime)?),
    };
    guarded(|| match other {
        Some(environment) => onnx_runtime::OnnxRuntime::load(&environment, &bytes),
        None => built_in::BuiltIn::load(bytes),
    })
    .map_err(Failure::Refused)
}

/// Calls a runtime, whose panics are errors.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_panic(work).unwrap_or_else(|| Err("its runtime panicked".to_owned()))
}

/// One line of what a runtime says.
fn one_line(error: impl ToString) -> String {
    let text = error.to_string();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(300) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}
