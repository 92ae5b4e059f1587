//! Loads and runs neural networks from TFLite and ONNX files, without trusting the files.
//!
//! The fastest person segmentation, which comes with the packages, is a TFLite file, run by our own code (`tflite`).
//! ONNX files are run by a library, `rten`. Files are not trusted: their size and that of all inputs and outputs is
//! limited, loops are rejected, and failures become one-line errors. Memory and work of a TFLite file are known before it
//! runs; an unknown ONNX file runs in a thread with limits (`bounded`).

mod bounded;
mod built_in;
mod known;
mod onnx;
mod tflite;

use std::path::{Path, PathBuf};

pub use bounded::shorten_timeouts;
pub use known::{KNOWN_NETWORKS, KnownNetwork, Scaling, Task};

use bokehcam::compute::catch_panic;
use bokehcam_files::input;

/// Maximum size of a file: networks that a CPU can run live have less than 100 MB.
pub const MAX_BYTES: u64 = 200 << 20;
/// Maximum number of values of an input or output: more than any picture that a network receives.
const MAX_VALUES: usize = 4 << 20;

/// An input or output of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
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
    /// The runtime, such as `rten`.
    pub runtime: &'static str,
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
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    /// The network cannot be run here.
    #[error("{}: this network cannot be run: {why}", path.display())]
    Refused { path: PathBuf, why: String },
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
/// The file is unreadable, not a network, or has loops or operators that its runtime does not support.
pub fn load(path: &Path) -> Result<LoadedNetwork, NetworkError> {
    let bytes = input::read(path, MAX_BYTES).map_err(|source| NetworkError::Read { path: path.into(), source })?;
    let known = KnownNetwork::identify(&bytes);
    let refused = |why: String| NetworkError::Refused { path: path.into(), why };
    let network = load_bytes(bytes, known.is_some()).map_err(refused)?;
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

/// Loads a network by the runtime for its format.
fn load_bytes(bytes: Vec<u8>, is_known: bool) -> Result<Network, String> {
    if tflite::is_tflite(&bytes) {
        return run_guarded(|| tflite::Tflite::load(&bytes));
    }
    onnx::check(&bytes)?;
    if is_known { run_guarded(|| built_in::BuiltIn::load(bytes, true)) } else { bounded::load(bytes) }
}

/// The error of a runtime that panics.
const PANICKED: &str = "its runtime panicked";

/// Calls a runtime; turns panics into errors.
fn run_guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_panic(work).unwrap_or_else(|| Err(PANICKED.to_owned()))
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
