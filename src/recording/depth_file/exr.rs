//! OpenEXR, as renderers write depth: a channel of its own, or repeated in the colours.

use std::fs::File;
use std::io::BufReader;

use exr::error::Error;
use exr::image::FlatSamples;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read as exr_reader};

use super::values::{Samples, Values};
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
    let found = image.layer_data.iter().find_map(|layer| {
        let channels = &layer.channel_data.list;
        let named = |name: &str| {
            channels.iter().find(|channel| {
                let own = channel.name.to_string();
                own.rsplit('.').next().unwrap_or_default().eq_ignore_ascii_case(name)
                    || own.split('.').next().unwrap_or_default().eq_ignore_ascii_case(name)
            })
        };
        NAMES.iter().find_map(|name| named(name)).map(|channel| (layer.size, &channel.sample_data))
    });
    let (size, samples) =
        found.ok_or_else(|| PictureFault::NotAMap("an EXR without a channel Z, V or Y".to_owned()))?;
    let size = check_side(size.0, size.1)?;
    let numbers = match samples {
        FlatSamples::F16(stored) => stored.iter().map(|number| number.to_f32()).collect(),
        FlatSamples::F32(stored) => stored.clone(),
        FlatSamples::U32(stored) => stored.iter().map(|number| *number as f32).collect(),
    };
    Ok(Values { size, numbers, samples: Samples::Float, stated: None })
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
