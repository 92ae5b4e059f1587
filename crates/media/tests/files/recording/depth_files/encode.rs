//! Files of maps, as other tools write them.

use std::path::Path;

use super::SIZE;

pub fn bytes_of(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

pub fn npy(descr: &str, is_column_major: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if is_column_major { "True" } else { "False" };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({shape}), }}");
    header += &" ".repeat(63 - (10 + header.len()) % 64);
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.bytes());
    file.extend(data);
    file
}

/// Stores `arrays` in a zip without compression, as `numpy.savez` does.
pub fn npz(arrays: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, data) in arrays {
        let crc = !data.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
        });
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0x5a];
        common.extend(crc.to_le_bytes());
        (0..2).for_each(|_| common.extend((data.len() as u32).to_le_bytes()));
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((file.len() as u32).to_le_bytes());
        directory.extend(name.bytes());
        file.extend(b"PK\x03\x04");
        file.extend(&common);
        file.extend(name.bytes());
        file.extend(*data);
    }
    let start = file.len() as u32;
    file.extend(&directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    (0..2).for_each(|_| file.extend((arrays.len() as u16).to_le_bytes()));
    file.extend((directory.len() as u32).to_le_bytes());
    file.extend(start.to_le_bytes());
    file.extend([0, 0]);
    file
}

/// A TIFF with one strip of `bits` per sample; `format` is 1 for whole numbers and 3 for floats.
pub fn tiff(bits: u16, format: u16, orientation: u32, data: &[u8]) -> Vec<u8> {
    let mut file = b"II\x2a\x00\x08\x00\x00\x00".to_vec();
    let entries: [(u16, u16, u32); 11] = [
        (256, 4, SIZE.0),
        (257, 4, SIZE.1),
        (258, 3, u32::from(bits)),
        (259, 3, 1),
        (262, 3, 1),
        (273, 4, 8 + 2 + 11 * 12 + 4),
        (274, 3, orientation),
        (277, 3, 1),
        (278, 4, SIZE.1),
        (279, 4, data.len() as u32),
        (339, 3, u32::from(format)),
    ];
    file.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, value) in entries {
        file.extend(tag.to_le_bytes());
        file.extend(kind.to_le_bytes());
        file.extend(1u32.to_le_bytes());
        file.extend(value.to_le_bytes());
    }
    file.extend([0; 4]);
    file.extend(data);
    file
}

/// The beginning of an EXR of floats that claims `channels` channels of `width` x `height` pixels: its header.
pub fn exr_that_claims(channels: u32, width: i32, height: i32) -> Vec<u8> {
    let mut list = Vec::new();
    for channel in 0..channels {
        // A float, not linear, without subsampling.
        list.extend(format!("Z.{channel:04}\0").bytes());
        list.extend([2_u32, 0, 1, 1].map(u32::to_le_bytes).as_flattened());
    }
    list.push(0);
    let window = [0, 0, width - 1, height - 1].map(i32::to_le_bytes);
    let mut file = b"\x76\x2f\x31\x01\x02\0\0\0".to_vec();
    for (name, kind, value) in [
        ("channels", "chlist", &list[..]),
        // ZIP of 16 rows.
        ("compression", "compression", &[3]),
        ("dataWindow", "box2i", window.as_flattened()),
        ("displayWindow", "box2i", window.as_flattened()),
        ("lineOrder", "lineOrder", &[0]),
        ("pixelAspectRatio", "float", &1_f32.to_le_bytes()),
        ("screenWindowCenter", "v2f", &[0; 8]),
        ("screenWindowWidth", "float", &1_f32.to_le_bytes()),
    ] {
        file.extend(format!("{name}\0{kind}\0").bytes());
        file.extend((value.len() as u32).to_le_bytes());
        file.extend(value);
    }
    file.push(0);
    file
}

/// Writes an EXR of layers, each with these channels.
pub fn exr(path: &Path, layers: &[&[(&str, &[f32])]]) {
    use exr::prelude::*;
    let size = (SIZE.0 as usize, SIZE.1 as usize);
    let channel = |(name, values): &(&str, &[f32])| AnyChannel::new(*name, FlatSamples::F32(values.to_vec()));
    let layers = layers.iter().enumerate().map(|(at, channels)| {
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        let attributes = LayerAttributes::named(format!("scene {at}").as_str());
        Layer::new(size, attributes, Encoding::SMALL_FAST_LOSSLESS, channels)
    });
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    Image::from_layers(attributes, layers.collect::<Vec<_>>()).write().to_file(path).unwrap();
}

/// Writes an EXR of one layer without a name, whose data lie at this place of a display window of these columns and rows.
pub fn exr_in_window(path: &Path, channels: &[(&str, &[f32])], at: (i32, i32), display: (u32, u32)) {
    use exr::prelude::*;
    let size = (SIZE.0 as usize, SIZE.1 as usize);
    let channel = |(name, values): &(&str, &[f32])| AnyChannel::new(*name, FlatSamples::F32(values.to_vec()));
    let layer = LayerAttributes { layer_position: Vec2(at.0, at.1), ..LayerAttributes::default() };
    let channels = AnyChannels::sort(channels.iter().map(channel).collect());
    let layer = Layer::new(size, layer, Encoding::SMALL_FAST_LOSSLESS, channels);
    let window = IntegerBounds::from_dimensions((display.0 as usize, display.1 as usize));
    Image::new(ImageAttributes::new(window), layer).write().to_file(path).unwrap();
}
