//! The protocol between the two processes: a line of JSON preceded by its length, then raw numbers.

use std::io::{self, ErrorKind, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::network::{LoadFailure, MAX_VALUES, Port, Tensor};

/// Maximum length of a line; names of ports and sizes are short.
const MAX_LINE_BYTES: u32 = 1 << 20;

/// A request to the process.
#[derive(Debug, Serialize, Deserialize)]
pub enum Request {
    /// Load a network with a runtime; `bytes` bytes of the file follow.
    Load { runtime: String, bytes: usize },
    /// Run it on inputs of these shapes; their values follow.
    Run(Vec<Vec<usize>>),
}

/// A reply of the process.
#[derive(Debug, Serialize, Deserialize)]
pub enum Reply {
    Loaded(Ports),
    NotLoaded(LoadFailure),
    /// The outputs have these shapes; their values follow.
    Ran(Vec<Vec<usize>>),
    Failed(String),
}

/// Inputs and outputs of a network, and its runtime.
#[derive(Debug, Serialize, Deserialize)]
pub struct Ports {
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    pub runtime: String,
}

pub fn send(to: &mut impl Write, message: &impl Serialize) -> io::Result<()> {
    let line = serde_json::to_vec(message)?;
    let length = u32::try_from(line.len()).ok().filter(|length| *length <= MAX_LINE_BYTES);
    let length = length.ok_or_else(|| {
        io::Error::new(
            ErrorKind::InvalidData,
            "it has too many inputs, outputs or \
             sizes",
        )
    })?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(&line)
}

pub fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<T> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    if length > MAX_LINE_BYTES {
        return Err(io::Error::new(ErrorKind::InvalidData, "its message is too long"));
    }
    let mut line = vec![0; length as usize];
    from.read_exact(&mut line)?;
    Ok(serde_json::from_slice(&line)?)
}

pub fn tensor_shapes(tensors: &[Tensor]) -> Vec<Vec<usize>> {
    tensors.iter().map(|tensor| tensor.shape.clone()).collect()
}

pub fn send_values(to: &mut impl Write, tensors: &[Tensor], bytes: &mut Vec<u8>) -> io::Result<()> {
    for tensor in tensors {
        bytes.clear();
        bytes.extend(tensor.values.iter().flat_map(|value| value.to_le_bytes()));
        to.write_all(bytes)?;
    }
    Ok(())
}

/// Reads the values of tensors of these shapes; refuses tensors above [`MAX_VALUES`].
pub fn receive_values(
    from: &mut impl Read,
    shapes: Vec<Vec<usize>>,
    tensors: &mut Vec<Tensor>,
    bytes: &mut Vec<u8>,
) -> io::Result<()> {
    tensors.resize_with(shapes.len(), Tensor::default);
    for (tensor, shape) in tensors.iter_mut().zip(shapes) {
        let count = shape.iter().try_fold(1usize, |all, &side| all.checked_mul(side));
        let count = count.filter(|count| *count <= MAX_VALUES);
        let count = count.ok_or_else(|| io::Error::new(ErrorKind::InvalidData, "it has too many values"))?;
        bytes.resize(4 * count, 0);
        from.read_exact(bytes)?;
        tensor.set(shape, bytes.as_chunks::<4>().0.iter().map(|value| f32::from_le_bytes(*value)));
    }
    Ok(())
}
