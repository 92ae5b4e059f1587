//! Recordings of Record3D (record3d.app), the scanner for iPhones: a zip with `rgbd/0.jpg`, `rgbd/0.depth` (LZFSE of
//! 32-bit floats, in metres) and so on, and `metadata`, a JSON.

mod metadata;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use lzfse_rust::LzfseRingDecoder;
use zip::ZipArchive;

use super::contents::{
    Container, Contents, DepthFormat, Layout, ListedFrame, PictureSource, RecordingFolder, StoredColor,
};
use super::decode::{DepthUnits, Scratch};
use super::decoders::{guard, guard_as};
use super::error::RecordingError;
use super::fault::{PictureFault, ReadResult, damaged_fault};
use super::{MAX_ENTRIES, MAX_SIDE_PX, Options, Unpaired};
use bokehcam::frame::DepthMap;
use bokehcam_files::input;
use metadata::Metadata;

pub(super) const LAYOUT: Layout =
    Layout { name: "Record3D", expected_files: "a file .r3d of Record3D", matches: is_named, open };

/// Largest picture that is read.
const MAX_PICTURE_BYTES: u64 = 96 << 20;
/// Largest depth map, decompressed: 4 bytes per pixel.
const MAX_DEPTH_BYTES: u64 = 4 * (MAX_SIDE_PX as u64 * MAX_SIDE_PX as u64);

/// Frames are numbered below this: the times of all can be computed.
const MAX_NUMBER: u32 = 100_000_000;

fn is_named(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("r3d"))
}

/// Lists the frames in the zip.
fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let path = &folder.dir;
    let fault = |what: String| RecordingError::File { path: path.clone(), what };
    let file = input::open(path).map_err(RecordingError::io("open the recording", path))?;
    let zip = guard_as(From::from, || ZipArchive::new(BufReader::new(file)).map_err(|error| error.to_string()));
    let mut archive = zip.map_err(|what| {
        fault(format!("not a whole recording of Record3D, which is a zip ({}); copy it again", what.replace('\n', " ")))
    })?;
    if archive.len() > 4 * MAX_ENTRIES {
        return Err(fault(format!("it has {} files, too many; split it", archive.len())));
    }
    let metadata = guard_as(From::from, || Metadata::read(&mut archive)).map_err(fault)?;

    // Colour and depth of each number.
    let mut numbered: BTreeMap<u32, [Option<String>; 2]> = BTreeMap::new();
    for name in archive.file_names().flatten() {
        let number = |ending| name.strip_prefix("rgbd/")?.strip_suffix(ending)?.parse().ok();
        for (place, ending) in [".jpg", ".depth"].into_iter().enumerate() {
            if let Some(number) = number(ending).filter(|&number| number < MAX_NUMBER) {
                numbered.entry(number).or_default()[place] = Some(name.clone().into_owned());
            }
        }
    }
    let counts = [0, 1].map(|place| numbered.values().filter(|names| names[place].is_some()).count());
    let has_depth = counts[1] > 0;
    let whole = numbered.into_iter().filter_map(|(number, [color, depth])| match depth {
        None if has_depth => None,
        depth => Some((number, color?, depth)),
    });
    let frames: Vec<(u32, String, Option<String>)> = whole.collect();
    if frames.is_empty() {
        return Err(fault("no frame in it has both rgbd/N.jpg and rgbd/N.depth; export it again as .r3d".to_owned()));
    }
    let unpaired = Unpaired::beside(frames.len(), counts[0], has_depth.then_some(counts[1]));
    let source = |name: &str| PictureSource::from_path(name.into());
    let times_ns = metadata.times_ns(frames.iter().map(|&(number, ..)| number));
    let listed = frames.iter().zip(times_ns).map(|((_, color, depth), time_ns)| ListedFrame {
        time_ns: Some(time_ns),
        color: source(color),
        right: None,
        depth: depth.as_deref().map(source),
    });
    // Floats, so that the scale does not count.
    let units = DepthUnits { scale: 1.0, invalid: options.depth_invalid };
    Ok(Contents {
        frames: listed.collect(),
        depth: has_depth.then_some(DepthFormat::StatedUnits(units)),
        unpaired,
        has_times: true,
        container: Some(Box::new(Archive {
            archive: Mutex::new(archive),
            frames: frames.into_iter().map(|(_, color, depth)| (color, depth)).collect(),
            depth_size: metadata.depth_size(),
        })),
        ..Contents::default()
    })
}

/// An opened recording.
#[derive(Debug)]
struct Archive {
    /// Locked while the bytes of a picture are read, not while they are decoded.
    archive: Mutex<ZipArchive<BufReader<File>>>,
    /// Names of colour and depth in the archive.
    frames: Vec<(String, Option<String>)>,
    /// Width and height of the depth maps, if stated.
    depth_size: Option<(u32, u32)>,
}

impl Archive {
    fn read<'a>(&self, name: &str, bytes: &'a mut Vec<u8>) -> ReadResult<&'a [u8]> {
        let mut archive = self.archive.lock().unwrap_or_else(PoisonError::into_inner);
        bytes.clear();
        guard(|| {
            let entry = archive.by_name(name).map_err(|error| damaged_fault(&error))?;
            if entry.size() > MAX_PICTURE_BYTES {
                return Err(PictureFault::FileSize { bytes: entry.size(), max_bytes: MAX_PICTURE_BYTES });
            }
            entry.take(MAX_PICTURE_BYTES).read_to_end(bytes).map_err(|error| damaged_fault(&error))
        })?;
        Ok(bytes)
    }

    /// Returns width and height of a map of `count` depths: in the proportions of the colour picture, else as stated.
    fn find_depth_size(&self, count: usize, color: (u32, u32)) -> Option<(u32, u32)> {
        let is_of = |&(width, height): &(u32, u32)| width as usize * height as usize == count && count > 0;
        let height = (count as f64 * f64::from(color.1) / f64::from(color.0)).sqrt().round() as u32;
        let width = (count as u32).checked_div(height).unwrap_or(0);
        [Some((width, height)), self.depth_size].into_iter().flatten().find(is_of)
    }
}

impl Container for Archive {
    fn read_stored_color<'a>(&self, frame: usize, bytes: &'a mut Vec<u8>) -> ReadResult<StoredColor<'a>> {
        self.read(&self.frames[frame].0, bytes).map(StoredColor::Encoded)
    }

    fn read_depth(&self, frame: usize, size: (u32, u32), scratch: &mut Scratch, into: &mut DepthMap) -> ReadResult {
        let name = self.frames[frame].1.as_ref().ok_or(PictureFault::Missing)?;
        let coded = self.read(name, &mut scratch.file)?;
        scratch.pixels.clear();
        guard(|| {
            let mut decoder = LzfseRingDecoder::default();
            let decoded = decoder.reader_bytes(coded).take(MAX_DEPTH_BYTES).read_to_end(&mut scratch.pixels);
            decoded.map_err(|error| damaged_fault(&error))
        })?;
        let values = scratch.pixels.as_chunks::<4>().0;
        let (width, height) = self
            .find_depth_size(values.len(), size)
            .ok_or_else(|| PictureFault::Damaged(format!("{} depths, which is no size of a map", values.len())))?;
        into.resize(width, height);
        for (metres, &value) in into.metres.iter_mut().zip(values) {
            let value = f32::from_le_bytes(value);
            *metres = if DepthMap::is_known(value) { value } else { 0.0 };
        }
        Ok(())
    }
}
