//! OpenEXR, as renderers write depth: a channel of its own, or repeated in the colours.

use std::fs::File;
use std::io::BufReader;

use exr::error::Error;
use exr::image::{AnyChannel, FlatSamples};
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read as exr_reader};

use super::values::{ColorCount, Samples, Values};
use crate::recording::coded::check_size;
use crate::recording::fault::PictureFault;

/// Names of a channel with depth, in order of preference: the standard's, those of renderers, grey, and colours.
const NAMES: [&str; 6] = ["Z", "depth", "V", "Y", "R", "X"];

/// Reads the first layer that has a channel with depth.
pub(super) fn read(mut file: File) -> Result<Values, PictureFault> {
    // The size is checked before the pixels take memory.
    let meta = MetaData::read_from_buffered(BufReader::new(&mut file), false).map_err(fault)?;
    for header in &meta.headers {
        check_side(header.layer_size.0, header.layer_size.1)?;
    }
    std::io::Seek::rewind(&mut file)?;
    let image = exr_reader().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_buffered(BufReader::new(file)).map_err(fault)?;
    // A layer of colours may come before that of depth.
    let found = NAMES.iter().find_map(|name| {
        image.layer_data.iter().find_map(|layer| {
            let channels = &layer.channel_data.list;
            channels.iter().find(|channel| is_named(channel, name)).map(|channel| (layer.size, channels, channel))
        })
    });
    let (size, channels, channel) =
        found.ok_or_else(|| PictureFault::NotAMap("an EXR without a channel Z, V or Y".to_owned()))?;
    check_grey(channels, channel)?;
    let size = check_side(size.0, size.1)?;
    let numbers = channel.sample_data.values_as_f32().collect();
    Ok(Values { size, numbers, samples: Samples::Float, ..Values::default() })
}

/// Returns whether a channel has this name, within a layer (`View.Depth.Z`) or as one (`depth.V`).
fn is_named(channel: &AnyChannel<FlatSamples>, name: &str) -> bool {
    let own = channel.name.to_string();
    let [layer, last] = [own.split('.').next(), own.rsplit('.').next()];
    [layer, last].into_iter().flatten().any(|part| part.eq_ignore_ascii_case(name))
}

/// Refuses a channel R if G and B beside it differ from it.
fn check_grey(channels: &[AnyChannel<FlatSamples>], found: &AnyChannel<FlatSamples>) -> Result<(), PictureFault> {
    let own = found.name.to_string();
    let beside = |name: &str| {
        // `own` ends with `R`.
        let other = format!("{}{name}", &own[..own.len() - 1]);
        channels.iter().find(|channel| channel.name.to_string().eq_ignore_ascii_case(&other))
    };
    if !own.rsplit('.').next().is_some_and(|last| last.eq_ignore_ascii_case("R")) {
        return Ok(());
    }
    let (Some(green), Some(blue)) = (beside("G"), beside("B")) else { return Ok(()) };
    let mut colors = ColorCount::new(Samples::Float.white());
    let [red, green, blue] = [found, green, blue].map(|channel| channel.sample_data.values_as_f32());
    red.zip(green.zip(blue)).for_each(|(red, (green, blue))| colors.add([red, green, blue]));
    colors.check(found.sample_data.len())
}

fn check_side(width: usize, height: usize) -> Result<(u32, u32), PictureFault> {
    let [width, height] = [width, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    check_size(width, height)?;
    Ok((width, height))
}

fn fault(error: Error) -> PictureFault {
    match error {
        Error::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => PictureFault::Damaged(other.to_string().replace('\n', " ")),
    }
}
