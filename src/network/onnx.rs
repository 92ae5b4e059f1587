//! A change to ONNX files that the built-in runtime needs: transposed convolutions without the attribute `output_shape`.
//!
//! Converters write it beside strides that say the same. Only its message is left out; where the sizes do not fit
//! without it, the network fails when it runs.

/// Tags of Protocol Buffers: the fields on the way to an attribute (onnx.proto: ModelProto.graph, GraphProto.node,
/// NodeProto.attribute), and its name. All are length-delimited.
const PATH: [u64; 3] = [7, 1, 5];
const NAME: u64 = 1;
const LEFT_OUT: &[u8] = b"output_shape";

/// The model without such attributes.
///
/// # Errors
/// It is no ONNX file.
pub fn without_output_shapes(model: Vec<u8>) -> Result<Vec<u8>, String> {
    if !model.windows(LEFT_OUT.len()).any(|bytes| bytes == LEFT_OUT) {
        return Ok(model);
    }
    let mut changed = Vec::with_capacity(model.len());
    copy(&model, &PATH, &mut changed).ok_or("it is no ONNX file, or not whole")?;
    Ok(changed)
}

/// Copies a message; `path` leads to the attributes. `None` where it ends too early.
fn copy(message: &[u8], path: &[u64], to: &mut Vec<u8>) -> Option<()> {
    let mut rest = message;
    while !rest.is_empty() {
        let start = rest;
        let tag = varint(&mut rest)?;
        let content = match tag & 7 {
            0 => varint(&mut rest).map(|_| None)?,
            1 => rest.split_off(..8).map(|_| None)?,
            2 => {
                let length = usize::try_from(varint(&mut rest)?).ok()?;
                Some(rest.split_off(..length)?)
            }
            5 => rest.split_off(..4).map(|_| None)?,
            _ => return None,
        };
        match (content, path) {
            (Some(content), [next, further @ ..]) if *next == tag >> 3 => {
                if further.is_empty() && is_left_out(content)? {
                    continue;
                }
                let mut inner = Vec::new();
                match further {
                    [] => inner.extend_from_slice(content),
                    _ => copy(content, further, &mut inner)?,
                }
                put_varint(tag, to);
                put_varint(inner.len() as u64, to);
                to.extend_from_slice(&inner);
            }
            _ => to.extend_from_slice(&start[..start.len() - rest.len()]),
        }
    }
    Some(())
}

/// Whether an attribute is the one to leave out.
fn is_left_out(mut attribute: &[u8]) -> Option<bool> {
    // The name is written first.
    if varint(&mut attribute)? != NAME << 3 | 2 {
        return Some(false);
    }
    let length = usize::try_from(varint(&mut attribute)?).ok()?;
    Some(attribute.get(..length)? == LEFT_OUT)
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
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

fn put_varint(mut value: u64, to: &mut Vec<u8>) {
    while value >= 0x80 {
        to.push(value as u8 | 0x80);
        value >>= 7;
    }
    to.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: u64, content: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        put_varint(number << 3 | 2, &mut bytes);
        put_varint(content.len() as u64, &mut bytes);
        bytes.extend_from_slice(content);
        bytes
    }

    fn model(attributes: &[&[u8]]) -> Vec<u8> {
        let attributes: Vec<u8> = attributes.iter().flat_map(|name| field(5, &field(1, name))).collect();
        let node = [field(4, b"ConvTranspose"), attributes].concat();
        // A number before the graph, and a graph long enough for lengths of two bytes.
        [vec![8, 9], field(7, &[field(1, &node), field(2, &[b'x'; 300])].concat())].concat()
    }

    #[test]
    fn only_that_attribute_is_left_out() {
        let with = model(&[b"strides", b"output_shape", b"pads"]);
        assert_eq!(without_output_shapes(with).unwrap(), model(&[b"strides", b"pads"]));
        let without = model(&[b"strides"]);
        assert_eq!(without_output_shapes(without.clone()).unwrap(), without);
    }

    #[test]
    fn what_is_cut_off_is_refused() {
        let whole = model(&[b"output_shape", b"strides"]);
        for end in whole.len() - 280..whole.len() {
            without_output_shapes(whole[..end].to_vec()).unwrap_err();
        }
    }
}
