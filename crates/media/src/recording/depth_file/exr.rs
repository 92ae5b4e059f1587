//! OpenEXR, as renderers write depth: a channel of its own, or repeated in the colours.

use std::fs::File;
use std::io::BufReader;

use exr::block::reader::ChunksReader;
use exr::block::{self, lines::LineRef};
use exr::error::Error;
use exr::io::Data;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::f16;

use super::layers::{self, Choice};
use super::values::{ColorCount, Samples, Values};
use crate::recording::MAX_PIXELS;
use crate::recording::decoders::check_size;
use crate::recording::fault::PictureFault;

/// Most samples in a layer, which are decompressed to find those of one channel: a hundred channels of 19 megapixels.
const MAX_SAMPLES: u64 = 16 * MAX_PIXELS;
/// Most bytes in a block, a tile or some rows of all channels: the decoder has memory for some blocks.
const MAX_BLOCK_BYTES: usize = 256 << 20;

/// Reads the layer with depth that [`layers::choose`] chooses, block by block, and no other one.
pub(super) fn read(file: File) -> Result<Values, PictureFault> {
    let reader = block::read(BufReader::new(file), false).map_err(fault)?;
    for header in reader.headers() {
        check_side(header)?;
    }
    let Choice { layer, role, channels: wanted, note } = layers::choose(reader.headers())
        .ok_or_else(|| PictureFault::NotAMap("an EXR without a layer of depth (Z, or one named depth)".to_owned()))?;
    let header = &reader.headers()[layer].clone();
    let size = check_side(header)?;
    let channels = header.channels.list.len();
    let samples = channels as u64 * u64::from(size.0) * u64::from(size.1);
    if samples > MAX_SAMPLES || header.max_block_byte_size() > MAX_BLOCK_BYTES {
        let what = format!("an EXR with {channels} channels of {}x{} pixels", size.0, size.1);
        return Err(PictureFault::NotAMap(what));
    }

    let (width, pixels) = (size.0 as usize, size.0 as usize * size.1 as usize);
    let mut numbers = vec![vec![0.0; pixels]; wanted.len()];
    let chunks =
        reader.filter_chunks(false, |_, tile, block| block.layer == layer && tile.is_largest_resolution_level());
    let read = chunks.and_then(|chunks| {
        chunks.decompress_sequential(false, |meta, block| {
            let channels = &meta.headers[layer].channels;
            for line in block.lines(channels) {
                let Some(place) = wanted.iter().position(|&wanted| wanted == line.location.channel) else { continue };
                let from = line.location.position.y() * width + line.location.position.x();
                let row = numbers[place].get_mut(from..from + line.location.sample_count);
                let row = row.ok_or_else(|| Error::Invalid("block position".into()))?;
                read_line(&line, channels.list[line.location.channel].sample_type, row)?;
            }
            Ok(())
        })
    });
    read.map_err(fault)?;
    if let [red, green, blue] = &numbers[..] {
        let mut colors = ColorCount::new(Samples::Float.white());
        red.iter().zip(green.iter().zip(blue)).for_each(|(red, (green, blue))| colors.add([*red, *green, *blue]));
        colors.check(pixels)?;
    }
    let (size, numbers) = place_in_display(header, numbers.swap_remove(0))?;
    Ok(Values { size, numbers, role, notes: note.into_iter().collect(), ..Values::default() })
}

/// Places the numbers of the data window in the display window, the frame that all layers and renderings of a scene share:
/// beyond the data they are unknown, and what lies outside of the frame (overscan) is left out.
fn place_in_display(header: &Header, numbers: Vec<f32>) -> Result<((u32, u32), Vec<f32>), PictureFault> {
    let (data, position) = (header.layer_size, header.own_attributes.layer_position);
    let display = header.shared_attributes.display_window;
    let [width, height] = [display.size.0, display.size.1].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    check_size(width, height)?;
    let first = [position.0, position.1].map(i64::from);
    let origin = [display.position.0, display.position.1].map(i64::from);
    let [left, top] = [first[0] - origin[0], first[1] - origin[1]];
    let size = (width, height);
    if (data, [left, top]) == (display.size, [0, 0]) {
        return Ok((size, numbers));
    }
    let mut placed = vec![f32::NAN; width as usize * height as usize];
    let columns = left.max(0)..(left + data.0 as i64).min(i64::from(width));
    for (row, stored) in (top..).zip(numbers.chunks_exact(data.0)) {
        if (0..i64::from(height)).contains(&row) && !columns.is_empty() {
            let from = (row * i64::from(width) + columns.start) as usize;
            let count = (columns.end - columns.start) as usize;
            placed[from..from + count].copy_from_slice(&stored[(columns.start - left) as usize..][..count]);
        }
    }
    Ok((size, placed))
}

/// Reads the samples of a line as floats.
fn read_line(line: &LineRef, kind: SampleType, row: &mut [f32]) -> Result<(), Error> {
    fn fill<T: Data>(line: &LineRef, row: &mut [f32], to_float: fn(T) -> f32) -> Result<(), Error> {
        row.iter_mut().zip(line.read_samples()).try_for_each(|(number, sample)| {
            *number = to_float(sample?);
            Ok(())
        })
    }
    match kind {
        SampleType::F16 => fill(line, row, f16::to_f32),
        SampleType::F32 => fill(line, row, |sample: f32| sample),
        SampleType::U32 => fill(line, row, |sample: u32| sample as f32),
    }
}

fn check_side(header: &Header) -> Result<(u32, u32), PictureFault> {
    let size = header.layer_size;
    let [width, height] = [size.0, size.1].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    check_size(width, height)?;
    Ok((width, height))
}

fn fault(error: Error) -> PictureFault {
    match error {
        Error::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => PictureFault::Damaged(other.to_string().replace('\n', " ")),
    }
}
