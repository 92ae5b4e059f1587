//! OpenEXR, as renderers write depth: a channel of its own, or repeated in the colours.

use std::fs::File;
use std::io::BufReader;

use exr::block::reader::ChunksReader;
use exr::block::{self, lines::LineRef};
use exr::error::Error;
use exr::io::Data;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use exr::prelude::f16;

use super::values::{ColorCount, Samples, Values};
use crate::recording::MAX_PIXELS;
use crate::recording::decoders::check_size;
use crate::recording::fault::PictureFault;

/// Names of a channel with depth, in order of preference: the standard's, those of renderers, grey, and colours.
const NAMES: [&str; 6] = ["Z", "depth", "V", "Y", "R", "X"];

/// Most samples in a layer, which are decompressed to find those of one channel: a hundred channels of 19 megapixels.
const MAX_SAMPLES: u64 = 16 * MAX_PIXELS;
/// Most bytes in a block, a tile or some rows of all channels: the decoder has memory for some blocks.
const MAX_BLOCK_BYTES: usize = 256 << 20;

/// Reads the channel with depth of the first layer that has one, block by block, and no other layer.
pub(super) fn read(file: File) -> Result<Values, PictureFault> {
    let reader = block::read(BufReader::new(file), false).map_err(fault)?;
    for header in reader.headers() {
        check_side(header)?;
    }
    let (layer, channel) = find_depth(reader.headers())
        .ok_or_else(|| PictureFault::NotAMap("an EXR without a channel Z, V or Y".to_owned()))?;
    let header = &reader.headers()[layer];
    let size = check_side(header)?;
    let channels = header.channels.list.len();
    let samples = channels as u64 * u64::from(size.0) * u64::from(size.1);
    if samples > MAX_SAMPLES || header.max_block_byte_size() > MAX_BLOCK_BYTES {
        let what = format!("an EXR with {channels} channels of {}x{} pixels", size.0, size.1);
        return Err(PictureFault::NotAMap(what));
    }

    let wanted: Vec<usize> = [channel].into_iter().chain(find_colors_beside(header, channel)).collect();
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
    Ok(Values { size, numbers: numbers.swap_remove(0), samples: Samples::Float, ..Values::default() })
}

/// Returns the layer and the channel with depth. A layer of colours may come before that of depth.
fn find_depth(headers: &[Header]) -> Option<(usize, usize)> {
    NAMES.iter().find_map(|name| {
        headers.iter().enumerate().filter(|(_, header)| !header.deep).find_map(|(layer, header)| {
            let channel = header.channels.list.iter().position(|channel| is_named(channel, name))?;
            Some((layer, channel))
        })
    })
}

/// Returns whether a channel has this name, within a layer (`View.Depth.Z`) or as one (`depth.V`).
fn is_named(channel: &ChannelDescription, name: &str) -> bool {
    let own = channel.name.to_string();
    let [layer, last] = [own.split('.').next(), own.rsplit('.').next()];
    [layer, last].into_iter().flatten().any(|part| part.eq_ignore_ascii_case(name))
}

/// Returns the channels G and B beside a channel R, which is no depth if they differ from it; empty unless all are there.
fn find_colors_beside(header: &Header, found: usize) -> Vec<usize> {
    let channels = &header.channels.list;
    let own = channels[found].name.to_string();
    if !own.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case("R")) {
        return Vec::new();
    }
    let beside = |name: &str| {
        // `own` ends with `R`.
        let other = format!("{}{name}", &own[..own.len() - 1]);
        channels.iter().position(|channel| channel.name.to_string().eq_ignore_ascii_case(&other))
    };
    [beside("G"), beside("B")].into_iter().collect::<Option<_>>().unwrap_or_default()
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
