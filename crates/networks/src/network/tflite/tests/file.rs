//! Writes FlatBuffers for tests: offsets lead forwards, so a table precedes its content.

/// A field of a table.
#[derive(Clone)]
pub enum Value {
    Byte(i8),
    Int(i32),
    Bytes(Vec<u8>),
    Ints(Vec<i32>),
    Table(Vec<(usize, Value)>),
    Tables(Vec<Vec<(usize, Value)>>),
}

/// Returns a TFLite file whose root has these fields, by number.
pub fn table_file(fields: &[(usize, Value)]) -> Vec<u8> {
    let mut out = b"\0\0\0\0TFL3".to_vec();
    let root = table(&mut out, fields);
    out[..4].copy_from_slice(&(root as u32).to_le_bytes());
    out
}

/// Appends a table and its content; returns the position of the table.
fn table(out: &mut Vec<u8>, fields: &[(usize, Value)]) -> usize {
    let entries = fields.iter().map(|(number, _)| number + 1).max().unwrap_or(0);
    let back = 4 + 2 * entries;
    let mut offsets = vec![0u16; entries];
    for (k, (number, _)) in fields.iter().enumerate() {
        offsets[*number] = 4 + 4 * k as u16;
    }
    out.extend((back as u16).to_le_bytes());
    out.extend((4 + 4 * fields.len() as u16).to_le_bytes());
    offsets.iter().for_each(|offset| out.extend(offset.to_le_bytes()));
    let at = out.len();
    out.extend((back as i32).to_le_bytes());
    for (_, value) in fields {
        let number = match value {
            Value::Byte(byte) => i32::from(*byte),
            Value::Int(int) => *int,
            _ => 0,
        };
        out.extend(number.to_le_bytes());
    }
    for (k, (_, value)) in fields.iter().enumerate() {
        append_content(out, at + 4 + 4 * k, value);
    }
    at
}

/// Appends the content that a field refers to, if any.
fn append_content(out: &mut Vec<u8>, field: usize, value: &Value) {
    let mut to = out.len();
    match value {
        Value::Byte(_) | Value::Int(_) => return,
        Value::Bytes(bytes) => {
            out.extend((bytes.len() as u32).to_le_bytes());
            out.extend(bytes);
        }
        Value::Ints(ints) => {
            out.extend((ints.len() as u32).to_le_bytes());
            ints.iter().for_each(|int| out.extend(int.to_le_bytes()));
        }
        Value::Table(fields) => to = table(out, fields),
        Value::Tables(tables) => {
            out.extend((tables.len() as u32).to_le_bytes());
            out.resize(out.len() + 4 * tables.len(), 0);
            for (k, fields) in tables.iter().enumerate() {
                let (entry, at) = (to + 4 + 4 * k, table(out, fields));
                out[entry..entry + 4].copy_from_slice(&((at - entry) as u32).to_le_bytes());
            }
        }
    }
    out[field..field + 4].copy_from_slice(&((to - field) as u32).to_le_bytes());
}
