//! Parses TFLite files: tensors and operators (schema.fbs of TensorFlow Lite, version 3).

use half::f16;

use super::table::{TRUNCATED, Table};
use crate::network::MAX_VALUES;

/// Maximum number of values of all tensors together: a network for single pictures has a few millions.
pub const MAX_TOTAL_VALUES: usize = 16 * MAX_VALUES;
/// Maximum number of tensors, and of operators.
const MAX_PARTS: usize = 2000;

/// A tensor: a picture `[1, rows, columns, channels]`, or constants.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensor {
    pub name: String,
    pub shape: Vec<usize>,
    /// Its values, if it is constant.
    pub constant: Option<Vec<f32>>,
}

/// The activation applied to a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    #[default]
    None,
    Relu,
    HardSwish,
    Logistic,
}

/// A filter's strides, and whether the picture is zero-padded at its edges ("same" padding).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strides {
    pub down: usize,
    pub across: usize,
    pub is_padded: bool,
}

/// An operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperatorKind {
    /// Input, weights `[out, rows, columns, in]`, bias.
    Convolution(Strides),
    /// Input, weights `[1, rows, columns, channels]`, bias.
    Depthwise(Strides),
    /// Input, weights `[out, 2, 2, in]`, bias: transposed convolution with stride 2, each pixel becomes four (a custom
    /// operator of MediaPipe).
    TransposedConvolution,
    Activation(Activation),
    /// The mean of each channel over the picture (global average pooling).
    Mean,
    /// The product of a picture and one value per channel.
    Scale,
    Sum,
    /// Bilinear upsampling to twice the size, with half-pixel centres.
    Upsample,
}

/// An operator, with the indices of its tensors.
#[derive(Clone, Debug)]
pub struct Operator {
    pub kind: OperatorKind,
    pub activation: Activation,
    pub inputs: Vec<usize>,
    pub output: usize,
}

/// A network.
#[derive(Clone, Debug)]
pub struct Model {
    pub tensors: Vec<Tensor>,
    /// In order of execution.
    pub operators: Vec<Operator>,
    pub input: usize,
    pub output: usize,
}

/// Returns whether a file is TFLite.
pub fn is_tflite(bytes: &[u8]) -> bool {
    bytes.get(4..8) == Some(b"TFL3")
}

impl Model {
    /// Parses a file.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let root = Table::root(bytes)?;
        let codes = root.tables(1)?.iter().map(parse_code).collect::<Result<Vec<_>, String>>()?;
        let buffers = root.tables(4)?;
        let [graph] = root.tables(2)?[..] else { return Err("it does not have exactly one graph".to_owned()) };
        let tables = graph.tables(0)?;
        let steps = graph.tables(3)?;
        if tables.len().max(steps.len()) > MAX_PARTS {
            return Err(format!("it has more than {MAX_PARTS} tensors or operators"));
        }
        // Before the next one is read, as tensors may share a buffer.
        let mut left = MAX_TOTAL_VALUES;
        let tensor = |table| parse_tensor(table, &buffers, &mut left);
        let mut tensors = tables.iter().map(tensor).collect::<Result<Vec<_>, String>>()?;
        let mut operators = Vec::new();
        for step in steps {
            let code = codes.get(step.int(0)? as usize).ok_or(TRUNCATED)?;
            let index =
                |k: i32| usize::try_from(k).ok().filter(|&k| k < tensors.len()).ok_or_else(|| TRUNCATED.to_owned());
            let inputs = step.ints(1)?.into_iter().map(index).collect::<Result<Vec<_>, String>>()?;
            let [output] = step.ints(2)?[..] else { return Err("an operator gives more than one tensor".to_owned()) };
            let output = index(output)?;
            let Some((kind, activation)) = parse_kind(code, &step)? else {
                // Dequantisation: 16-bit constants become 32-bit ones here.
                let [from] = inputs[..] else { return Err(TRUNCATED.to_owned()) };
                let values = tensors[from].constant.take().unwrap_or_default();
                if values.len() != tensors[output].shape.iter().product::<usize>() {
                    return Err(TRUNCATED.to_owned());
                }
                tensors[output].constant = Some(values);
                continue;
            };
            operators.push(Operator { kind, activation, inputs, output });
        }
        let port = |ports: Vec<i32>| match ports[..] {
            [port] if (port as usize) < tensors.len() => Ok(port as usize),
            _ => Err("it does not have exactly one input and one output".to_owned()),
        };
        Ok(Self { input: port(graph.ints(1)?)?, output: port(graph.ints(2)?)?, operators, tensors })
    }
}

/// Parses an operator code: its number, and its name if it is a custom one.
fn parse_code(table: &Table<'_>) -> Result<(i32, String), String> {
    let number = i32::from(table.byte(0)?).max(table.int(3)?);
    Ok((number, String::from_utf8_lossy(table.bytes(1)?).into_owned()))
}

/// Parses a tensor, and subtracts its values from those that are `left`.
fn parse_tensor(table: &Table<'_>, buffers: &[Table<'_>], left: &mut usize) -> Result<Tensor, String> {
    let shape = table.ints(0)?.into_iter().map(|side| usize::try_from(side).map_err(|_| TRUNCATED.to_owned()));
    let shape = shape.collect::<Result<Vec<_>, String>>()?;
    let name = String::from_utf8_lossy(table.bytes(3)?).into_owned();
    let count = shape.iter().try_fold(1usize, |all, &side| all.checked_mul(side)).filter(|&all| all <= MAX_VALUES);
    let count = count.ok_or_else(|| format!("{name:?} has more than {MAX_VALUES} values: {shape:?}"))?;
    let rest = left.checked_sub(count);
    *left = rest.ok_or_else(|| format!("its tensors have more than {MAX_TOTAL_VALUES} values"))?;
    let bytes = buffers.get(table.int(2)? as usize).ok_or(TRUNCATED)?.bytes(0)?;
    let values: Vec<f32> = match table.byte(1)? {
        0 => bytes.as_chunks().0.iter().map(|four| f32::from_le_bytes(*four)).collect(),
        1 => bytes.as_chunks().0.iter().map(|two| f16::from_le_bytes(*two).to_f32()).collect(),
        // Shapes and axes.
        2 => bytes.as_chunks().0.iter().map(|four| i32::from_le_bytes(*four) as f32).collect(),
        _ => return Err(format!("{name:?} has elements that are neither floats nor sizes")),
    };
    if !values.is_empty() && values.len() != count {
        return Err(TRUNCATED.to_owned());
    }
    Ok(Tensor { name, shape, constant: (!values.is_empty()).then_some(values) })
}

/// Parses an operator and its activation; `None` if it only converts constants.
fn parse_kind((code, name): &(i32, String), step: &Table<'_>) -> Result<Option<(OperatorKind, Activation)>, String> {
    let options = step.table(4)?;
    let byte = |number: usize| options.map_or(Ok(0), |options| options.byte(number));
    let int = |number: usize| options.map_or(Ok(0), |options| options.int(number));
    let steps = || -> Result<Strides, String> {
        let side = |number: usize| Ok::<_, String>(usize::try_from(int(number)?.max(1)).expect("at least 1"));
        Ok(Strides { is_padded: byte(0)? == 0, across: side(1)?, down: side(2)? })
    };
    let activation = |number: usize| match byte(number)? {
        0 => Ok(Activation::None),
        1 => Ok(Activation::Relu),
        other => Err(format!("activation {other} of an operator is not supported")),
    };
    Ok(Some(match code {
        0 => (OperatorKind::Sum, activation(0)?),
        3 => (OperatorKind::Convolution(steps()?), activation(3)?),
        4 => (OperatorKind::Depthwise(steps()?), activation(4)?),
        6 => return Ok(None),
        14 => (OperatorKind::Activation(Activation::Logistic), Activation::None),
        18 => (OperatorKind::Scale, activation(0)?),
        19 => (OperatorKind::Activation(Activation::Relu), Activation::None),
        23 if byte(2)? == 0 && byte(3)? != 0 => (OperatorKind::Upsample, Activation::None),
        32 if name == "Convolution2DTransposeBias" => (OperatorKind::TransposedConvolution, Activation::None),
        40 => (OperatorKind::Mean, Activation::None),
        117 => (OperatorKind::Activation(Activation::HardSwish), Activation::None),
        _ => return Err(format!("operator {code} {name:?} is not supported")),
    }))
}
