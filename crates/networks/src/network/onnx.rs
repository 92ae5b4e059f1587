//! Checks and rewrites ONNX files before `rten` reads them: rejects loops and what it would recurse into too deeply, and
//! removes the attribute `output_shape` of transposed convolutions, which it does not support.
//!
//! Converters write that attribute in addition to strides that imply it. Only the attribute is removed; if the sizes do
//! not fit without it, the network fails when it runs.

/// Protocol Buffers field numbers (onnx.proto): the path to an attribute (ModelProto.graph, GraphProto.node,
/// NodeProto.attribute), and its name. All are length-delimited.
const PATH: [u64; 3] = [7, 1, 5];
const NAME: u64 = 1;
const OUTPUT_SHAPE: &[u8] = b"output_shape";

/// Operators that repeat a part of the network as often as its data says, possibly forever. Networks for pictures do
/// not need them.
const LOOP_OPERATORS: [&[u8]; 3] = [b"Loop", b"Scan", b"SequenceMap"];
/// Maximum nesting of branches and types: networks have one or two levels, and each is a recursive call in `rten`.
const MAX_DEPTH: usize = 8;
/// Maximum number of operators, each of which may be a recursive call in `rten`; networks have some thousands.
const MAX_NODES: usize = 20_000;

/// Messages that may contain nodes or types, with the fields that lead to them (onnx.proto).
#[derive(Clone, Copy, PartialEq)]
enum MessageType {
    Model,
    Function,
    Graph,
    Node,
    Attribute,
    Value,
    Type,
    Sequence,
}

impl MessageType {
    fn child(self, number: u64) -> Option<MessageType> {
        match (self, number) {
            (MessageType::Model, 7) | (MessageType::Attribute, 6 | 11) => Some(MessageType::Graph),
            (MessageType::Model, 25) => Some(MessageType::Function),
            (MessageType::Function, 7) | (MessageType::Graph, 1) => Some(MessageType::Node),
            (MessageType::Node, 5) => Some(MessageType::Attribute),
            (MessageType::Graph, 11..=13) => Some(MessageType::Value),
            (MessageType::Value, 2) | (MessageType::Sequence, 1) => Some(MessageType::Type),
            (MessageType::Type, 4) => Some(MessageType::Sequence),
            _ => None,
        }
    }
}

/// Rejects operators that may run forever, also in branches and in the model's own functions, and models that are nested
/// too deeply or have too many operators.
///
/// # Errors
/// The model is rejected, or the file is not ONNX.
pub fn check(model: &[u8]) -> Result<(), String> {
    check_message(MessageType::Model, model, 0, &mut 0)
}

fn check_message(message_type: MessageType, message: &[u8], depth: usize, nodes: &mut usize) -> Result<(), String> {
    *nodes += usize::from(message_type == MessageType::Node);
    if depth > MAX_DEPTH {
        return Err(format!("it has branches within branches, {MAX_DEPTH} deep or more"));
    }
    if *nodes > MAX_NODES {
        return Err(format!("it has more than {MAX_NODES} operators"));
    }
    let mut rest = message;
    while !rest.is_empty() {
        let (tag, content) = read_field(&mut rest).ok_or_else(not_onnx)?;
        let Some(content) = content else { continue };
        if let (MessageType::Node, 4) = (message_type, tag >> 3)
            && let Some(name) = LOOP_OPERATORS.iter().find(|name| **name == content)
        {
            let name = String::from_utf8_lossy(name);
            return Err(format!("it has the operator {name}, which may run forever; export it without loops"));
        }
        if let Some(inner) = message_type.child(tag >> 3) {
            let is_nesting = matches!(message_type, MessageType::Attribute | MessageType::Sequence);
            check_message(inner, content, depth + usize::from(is_nesting), nodes)?;
        }
    }
    Ok(())
}

fn not_onnx() -> String {
    "it is not an ONNX file, or is incomplete".to_owned()
}

/// Reads the next field of a message: its tag, and its content if length-delimited. `None` if it is truncated.
fn read_field<'a>(rest: &mut &'a [u8]) -> Option<(u64, Option<&'a [u8]>)> {
    let tag = read_varint(rest)?;
    let content = match tag & 7 {
        0 => read_varint(rest).map(|_| None)?,
        1 => rest.split_off(..8).map(|_| None)?,
        2 => {
            let length = usize::try_from(read_varint(rest)?).ok()?;
            Some(rest.split_off(..length)?)
        }
        5 => rest.split_off(..4).map(|_| None)?,
        _ => return None,
    };
    Some((tag, content))
}

/// Removes the attributes named `output_shape` from a model.
///
/// # Errors
/// The file is not ONNX.
pub fn remove_output_shapes(model: Vec<u8>) -> Result<Vec<u8>, String> {
    if !model.windows(OUTPUT_SHAPE.len()).any(|bytes| bytes == OUTPUT_SHAPE) {
        return Ok(model);
    }
    let mut changed = Vec::with_capacity(model.len());
    copy_without_output_shapes(&model, &PATH, &mut changed).ok_or_else(not_onnx)?;
    Ok(changed)
}

/// Copies a message without `output_shape` attributes; `path` leads to the attributes. `None` if it is truncated.
fn copy_without_output_shapes(message: &[u8], path: &[u64], to: &mut Vec<u8>) -> Option<()> {
    let mut rest = message;
    while !rest.is_empty() {
        let start = rest;
        let (tag, content) = read_field(&mut rest)?;
        match (content, path) {
            (Some(content), [next, further @ ..]) if *next == tag >> 3 => {
                if further.is_empty() && is_output_shape(content)? {
                    continue;
                }
                let mut inner = Vec::new();
                match further {
                    [] => inner.extend_from_slice(content),
                    _ => copy_without_output_shapes(content, further, &mut inner)?,
                }
                write_varint(tag, to);
                write_varint(inner.len() as u64, to);
                to.extend_from_slice(&inner);
            }
            _ => to.extend_from_slice(&start[..start.len() - rest.len()]),
        }
    }
    Some(())
}

/// Returns whether an attribute is `output_shape`.
fn is_output_shape(mut attribute: &[u8]) -> Option<bool> {
    // The name is always written first.
    if read_varint(&mut attribute)? != NAME << 3 | 2 {
        return Some(false);
    }
    let length = usize::try_from(read_varint(&mut attribute)?).ok()?;
    Some(attribute.get(..length)? == OUTPUT_SHAPE)
}

fn read_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let byte = *bytes.split_off_first()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

fn write_varint(mut value: u64, to: &mut Vec<u8>) {
    while value >= 0x80 {
        to.push(value as u8 | 0x80);
        value >>= 7;
    }
    to.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(number: u64, content: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_varint(number << 3 | 2, &mut bytes);
        write_varint(content.len() as u64, &mut bytes);
        bytes.extend_from_slice(content);
        bytes
    }

    fn model(attributes: &[&[u8]]) -> Vec<u8> {
        let attributes: Vec<u8> = attributes.iter().flat_map(|name| with(5, &with(1, name))).collect();
        let node = [with(4, b"ConvTranspose"), attributes].concat();
        // A number before the graph, and a graph long enough for two-byte lengths.
        [vec![8, 9], with(7, &[with(1, &node), with(2, &[b'x'; 300])].concat())].concat()
    }

    #[test]
    fn only_that_attribute_is_left_out() {
        let with = model(&[b"strides", b"output_shape", b"pads"]);
        assert_eq!(remove_output_shapes(with).unwrap(), model(&[b"strides", b"pads"]));
        let without = model(&[b"strides"]);
        assert_eq!(remove_output_shapes(without.clone()).unwrap(), without);
    }

    #[test]
    fn what_runs_over_and_over_is_found_wherever_it_is() {
        let node = |operator: &[u8], attributes: &[u8]| with(1, &[with(4, operator), attributes.to_vec()].concat());
        let branch = |inner: &[u8]| node(b"If", &with(5, &with(6, inner)));
        for name in LOOP_OPERATORS {
            let within = node(name, &[]);
            let function = with(25, &with(7, &with(4, name)));
            let models = [with(7, &within), with(7, &branch(&within)), [with(7, &branch(&[])), function].concat()];
            for model in models {
                assert!(check(&model).unwrap_err().contains("may run forever"), "{model:?}");
            }
        }
        // A node's name is not its operator.
        check(&with(7, &with(1, &[with(4, b"Conv"), with(3, b"Loop")].concat()))).unwrap();
        let nested = |count: usize| (0..count).fold(Vec::new(), |inner, _| branch(&inner));
        check(&with(7, &nested(MAX_DEPTH))).unwrap();
        check(&with(7, &nested(50))).unwrap_err();
        let types = (0..50).fold(Vec::new(), |inner, _| with(4, &with(1, &inner)));
        check(&with(7, &with(11, &with(2, &types)))).unwrap_err();
        let many = |count| with(7, &with(1, &[]).repeat(count));
        check(&many(MAX_NODES)).unwrap();
        assert!(check(&many(MAX_NODES + 1)).unwrap_err().contains("operators"));
    }

    #[test]
    fn what_is_cut_off_is_refused() {
        let whole = model(&[b"output_shape", b"strides"]);
        for end in whole.len() - 280..whole.len() {
            remove_output_shapes(whole[..end].to_vec()).unwrap_err();
        }
    }
}
