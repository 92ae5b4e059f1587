//! Small ONNX files, encoded by hand: networks of a layer or two, whose output is known exactly.

/// Encodes a length-delimited field of Protocol Buffers.
fn field(number: u64, content: &[u8]) -> Vec<u8> {
    [varint(number << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
}

fn number(field: u64, value: u64) -> Vec<u8> {
    [varint(field << 3), varint(value)].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A dimension of a port: fixed, or chosen by the caller.
#[derive(Clone, Copy)]
pub enum Side {
    Is(u64),
    Any(&'static str),
}

/// A port of 32-bit floats.
pub fn port(name: &str, shape: &[Side]) -> Vec<u8> {
    let sides = shape.iter().map(|side| match side {
        Side::Is(size) => field(1, &number(1, *size)),
        Side::Any(name) => field(1, &field(2, name.as_bytes())),
    });
    let tensor = [number(1, 1), field(2, &sides.collect::<Vec<_>>().concat())].concat();
    [field(1, name.as_bytes()), field(2, &field(1, &tensor))].concat()
}

/// A constant of floats.
pub fn constant(name: &str, shape: &[u64], values: &[f32]) -> Vec<u8> {
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let dims = shape.iter().flat_map(|&side| number(1, side)).collect();
    [dims, number(2, 1), field(8, name.as_bytes()), field(9, &raw)].concat()
}

/// A node with attributes of integers.
pub fn node(operator: &str, inputs: &[&str], output: &str, attributes: &[(&str, &[u64])]) -> Vec<u8> {
    let inputs = inputs.iter().flat_map(|name| field(1, name.as_bytes())).collect();
    let attributes = attributes.iter().flat_map(|(name, values)| {
        let ints = values.iter().flat_map(|&value| number(8, value)).collect();
        field(5, &[field(1, name.as_bytes()), ints, number(20, 7)].concat())
    });
    [inputs, field(2, output.as_bytes()), field(4, operator.as_bytes()), attributes.collect()].concat()
}

/// A node with attributes of one integer each.
pub fn node_with_numbers(operator: &str, inputs: &[&str], output: &str, attributes: &[(&str, u64)]) -> Vec<u8> {
    let attributes = attributes
        .iter()
        .flat_map(|(name, value)| field(5, &[field(1, name.as_bytes()), number(3, *value), number(20, 2)].concat()));
    [node(operator, inputs, output, &[]), attributes.collect()].concat()
}

/// A constant of 64-bit integers in a row.
pub fn integers(name: &str, values: &[i64]) -> Vec<u8> {
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    [number(1, values.len() as u64), number(2, 7), field(8, name.as_bytes()), field(9, &raw)].concat()
}

/// A constant that is true.
pub fn always(name: &str) -> Vec<u8> {
    [number(2, 9), field(8, name.as_bytes()), field(9, &[1])].concat()
}

/// Encodes a loop that returns `input` after a practically endless number of iterations, while `condition` is true.
pub fn endless_loop(condition: &str, input: &str, output: &str) -> Vec<u8> {
    let value = |name: &str, kind: u64, shape: &[u8]| {
        [field(1, name.as_bytes()), field(2, &field(1, &[number(1, kind), shape.to_vec()].concat()))].concat()
    };
    // The iteration number and the condition are scalars.
    let scalar = field(2, &[]);
    let nodes = [node("Identity", &["c"], "c2", &[]), node("Identity", &["x"], "x2", &[])];
    let all = |number: u64, parts: &[Vec<u8>]| parts.iter().flat_map(|part| field(number, part)).collect::<Vec<u8>>();
    let body = [
        all(1, &nodes),
        field(2, b"body"),
        all(11, &[value("round", 7, &scalar), value("c", 9, &scalar), value("x", 1, &[])]),
        all(12, &[value("c2", 9, &scalar), value("x2", 1, &[])]),
    ];
    let attribute = [field(1, b"body"), field(6, &body.concat()), number(20, 5)].concat();
    [node("Loop", &["", condition, input], output, &[]), field(5, &attribute)].concat()
}

/// Encodes a 1x1 convolution.
pub fn conv(inputs: &[&str], output: &str) -> Vec<u8> {
    let attributes: [(&str, &[u64]); 4] =
        [("kernel_shape", &[1, 1]), ("strides", &[1, 1]), ("dilations", &[1, 1]), ("pads", &[0; 4])];
    node("Conv", inputs, output, &attributes)
}

/// Encodes a file: its inputs, constants, nodes and outputs.
pub fn model(inputs: &[Vec<u8>], constants: &[Vec<u8>], nodes: &[Vec<u8>], outputs: &[Vec<u8>]) -> Vec<u8> {
    let all = |number: u64, parts: &[Vec<u8>]| parts.iter().flat_map(|part| field(number, part)).collect::<Vec<u8>>();
    let graph = [all(1, nodes), field(2, b"test"), all(5, constants), all(11, inputs), all(12, outputs)].concat();
    [number(1, 8), field(7, &graph), field(8, &[field(1, b""), number(2, 13)].concat())].concat()
}

/// Encodes a matting network: for planes of 0 to 1 it returns the sigmoid of `weights` times red, green and blue, plus
/// `bias`.
pub fn matte(width: u64, height: u64, weights: [f32; 3], bias: f32) -> Vec<u8> {
    let sides = |channels| [Side::Is(1), Side::Is(channels), Side::Is(height), Side::Is(width)];
    model(
        &[port("picture", &sides(3))],
        &[constant("w", &[1, 3, 1, 1], &weights), constant("b", &[1], &[bias])],
        &[conv(&["picture", "w", "b"], "sum"), node("Sigmoid", &["sum"], "mask", &[])],
        &[port("mask", &sides(1))],
    )
}
