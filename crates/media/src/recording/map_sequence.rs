//! Depth maps of the pictures of a video or a folder: a file for each in a folder, of any format of single maps.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::depth_file::{self, DepthFile, Distances};
use super::error::{RecordingError, Result};
use super::fault::PictureFault;
use super::folder::{Ambiguous, PairKey, find_files, has_files, pair_stems, strip_suffix};
use super::{LAYOUTS, pictures};

/// Number of maps, spread over the sequence, whose numbers decide the range of relative depth.
const RANGE_SAMPLES: usize = 16;

/// The depth maps of a sequence of pictures, a file each.
#[derive(Debug)]
pub struct MapSequence {
    dir: PathBuf,
    /// A file for each picture; those that are missing fail to read.
    files: Vec<PathBuf>,
    options: depth_file::Options,
    distances: Distances,
}

/// The pictures of a sequence.
#[derive(Clone, Copy, Debug)]
pub enum Pictured<'a> {
    /// Frames of a video: their number, if it is known.
    Frames(Option<u64>),
    /// Pictures in files, by their names without extension.
    Files(&'a [String]),
}

/// Returns whether a folder holds depth maps alone, instead of a recording.
pub fn is_map_folder(dir: &Path) -> bool {
    let is_recording = || LAYOUTS.iter().any(|layout| layout.name != pictures::LAYOUT.name && (layout.matches)(dir));
    has_files(dir, &depth_file::EXTENSIONS, |_| true) && !is_recording() && !pictures::has_own_maps(dir)
}

impl MapSequence {
    /// Opens the maps in `dir` for these pictures: by name where pictures have names, else in the order of the maps'
    /// names, where a missing number is a missing map. Only the first `played` pictures need a map; `None` means all of
    /// them. Returns it with what was assumed, a line each. The range of relative depth is that of all maps, estimated from
    /// some.
    ///
    /// # Errors
    /// There are no maps, or too few or too many for the pictures; no map can be read, or its unit is unclear.
    pub fn open(
        dir: &Path,
        pictured: Pictured,
        played: Option<u64>,
        options: depth_file::Options,
    ) -> Result<(Self, Vec<String>)> {
        let found = find_files(dir, &depth_file::EXTENSIONS, |_| true)?;
        let by_stem = match pictured {
            Pictured::Frames(_) => None,
            Pictured::Files(stems) => pair_by_stem(dir, &found, stems)?,
        };
        let count = match pictured {
            Pictured::Frames(count) => count,
            Pictured::Files(stems) => Some(stems.len() as u64),
        };
        let (names, how) = match by_stem {
            Some((names, by)) => (names, format!("by the {} of the pictures", by.describe())),
            None => (pair_by_order(dir, &found, count, played)?, "in the order of their names".to_owned()),
        };
        let missing = names.iter().collect::<HashSet<_>>().difference(&found.iter().collect()).count();
        let files: Vec<_> = names.iter().map(|name| dir.join(name)).collect();
        let (mut options, mut notes) = (options, Vec::new());
        // One scale for all, read once.
        let is_open = options.scale.is_none() && options.unit.is_none() && !options.invert;
        if let Some(units) = files
            .first()
            .filter(|_| is_open)
            .map_or(Ok(None), |file| depth_file::find_scale(file).map_err(RecordingError::picture(file)))?
        {
            options.scale = Some(units.per_m);
            options.invalid = options.invalid.filter(|&invalid| invalid != 0.0).or(units.invalid.map(f32::from));
            notes.push(units.describe());
        }
        let samples = || files.iter().step_by(files.len().div_ceil(RANGE_SAMPLES).max(1));
        let mut fault = None;
        let read = |path: &PathBuf| {
            depth_file::read_unfitted(path, &options).map_err(|new| fault = Some((path.clone(), new))).ok()
        };
        let Some(DepthFile { distances, notes: assumed, .. }) = samples().find_map(read) else {
            let (path, fault) = fault.unwrap_or((dir.to_owned(), PictureFault::Missing));
            return Err(RecordingError::picture(&path)(fault));
        };
        notes.extend(assumed);
        notes.insert(0, format!("{} depth maps {how}", files.len() - missing));
        notes.extend((missing > 0).then(|| format!("pictures without a depth map: {missing}")));
        notes.iter_mut().for_each(|note| *note = format!("{}: {note}", dir.display()));
        let is_relative = distances == Distances::Relative;
        let ranges =
            samples().filter(|_| is_relative).filter_map(|path| depth_file::read_range(path, &options).ok()?);
        let range = ranges.reduce(|all, new| (all.0.min(new.0), all.1.max(new.1)));
        let options = depth_file::Options { range, ..options };
        Ok((Self { dir: dir.to_owned(), files, options, distances }, notes))
    }

    /// Returns what the distances of all maps are worth.
    pub fn distances(&self) -> Distances {
        self.distances
    }

    /// Reads the map of the picture `index`, of `color` (columns, rows) pixels.
    ///
    /// # Errors
    /// Same as for [`depth_file::read`]; or the sequence has no such map, or its distances are of another kind than those
    /// of the first.
    pub fn read(&self, index: usize, color: (u32, u32)) -> Result<DepthFile> {
        self.read_by(index, |file| depth_file::read(file, &self.options, color))
    }

    /// Reads the map of the picture `index` in its own size and view.
    ///
    /// # Errors
    /// Same as for [`MapSequence::read`].
    pub fn read_unfitted(&self, index: usize) -> Result<DepthFile> {
        self.read_by(index, |file| {
            depth_file::read_unfitted(file, &self.options).map_err(RecordingError::picture(file))
        })
    }

    fn read_by(&self, index: usize, read: impl Fn(&Path) -> Result<DepthFile>) -> Result<DepthFile> {
        let count = self.files.len() as u64;
        let file = self.files.get(index).ok_or_else(|| map_count(&self.dir, count, index as u64 + 1))?;
        let map = read(file)?;
        if map.distances != self.distances {
            let what = "a map of another unit than the others";
            return Err(RecordingError::picture(file)(PictureFault::NotAMap(what.to_owned())));
        }
        Ok(map)
    }
}

fn map_count(dir: &Path, maps: u64, pictures: u64) -> RecordingError {
    RecordingError::MapCount { dir: dir.to_owned(), maps, pictures }
}

/// Returns the name of the map of each of `frames` frames, or of the first `played` of them at least: in this order, or by
/// number if some are missing.
fn pair_by_order(dir: &Path, names: &[String], frames: Option<u64>, played: Option<u64>) -> Result<Vec<String>> {
    let filled = fill_gaps(names);
    let Some(frames) = frames else { return Ok(filled) };
    let needed = played.map_or(frames, |played| played.min(frames));
    let suffices = |names: &[String]| (needed..=frames).contains(&(names.len() as u64));
    match names.len() as u64 {
        count if count == frames => Ok(names.to_vec()),
        _ if suffices(&filled) => Ok(filled),
        _ if suffices(names) => Ok(names.to_vec()),
        count => Err(map_count(dir, count, needed)),
    }
}

/// Adds the names of missing numbers to those of a numbered series; returns other names unchanged.
fn fill_gaps(names: &[String]) -> Vec<String> {
    let split = |name: &'_ String| -> Option<(String, u64, usize, String)> {
        let stem_length = name.rfind('.')?;
        let end = name[..stem_length].rfind(|c: char| c.is_ascii_digit())? + 1;
        let before = name[..end].trim_end_matches(|c: char| c.is_ascii_digit());
        let number = &name[before.len()..end];
        Some((before.to_owned(), number.parse().ok()?, number.len(), name[end..].to_owned()))
    };
    let parts: Option<Vec<_>> = names.iter().map(split).collect();
    let Some(parts) = parts else { return names.to_vec() };
    let is_series = parts.windows(2).all(|pair| {
        let [(before, number, _, after), (next_before, next, _, next_after)] = pair else { return false };
        (before, after) == (next_before, next_after) && number < next
    });
    let (Some((before, first, digits, after)), Some((_, last, ..))) = (parts.first(), parts.last()) else {
        return names.to_vec();
    };
    // With more gaps than maps, the numbers are no frames.
    if !is_series || last - first >= 2 * names.len() as u64 {
        return names.to_vec();
    }
    let mut present = parts.iter().zip(names).peekable();
    let name = |number| match present.next_if(|((_, own, ..), _)| *own == number) {
        Some((_, name)) => name.clone(),
        None => format!("{before}{number:0digits$}{after}"),
    };
    (*first..=*last).map(name).collect()
}

/// Returns the name of the map of each picture by the picture's own, and what they have in common; `None` if no picture has
/// one.
///
/// # Errors
/// Two maps have the name of one picture.
fn pair_by_stem(dir: &Path, names: &[String], stems: &[String]) -> Result<Option<(Vec<String>, PairKey)>> {
    let stem = |name: &'_ String| -> String {
        let stem = name.rsplit_once('.').map_or(&**name, |(stem, _)| stem);
        pictures::MAP_SUFFIXES.iter().find_map(|suffix| strip_suffix(stem, suffix)).unwrap_or(stem).to_owned()
    };
    let maps: Vec<String> = names.iter().map(stem).collect();
    let [pictured, maps] = [stems, &maps].map(|stems| stems.iter().map(String::as_str).collect::<Vec<_>>());
    let (partners, by) = match pair_stems(&pictured, &maps) {
        Ok(paired) => paired,
        Err(Ambiguous { positions: [first, second], are_maps: true }) => {
            return Err(RecordingError::SameNumber { path: dir.join(&names[second]), other: names[first].clone() });
        }
        Err(_) => return Ok(None),
    };
    // Numbers may count from another one than those of the pictures.
    if by != PairKey::Name && partners.contains(&None) {
        return Ok(None);
    }
    let ending = names.first().and_then(|name| name.rsplit_once('.')).map_or("png", |(_, ending)| ending);
    let name = |(stem, map): (&String, &Option<usize>)| {
        map.map_or_else(|| format!("{stem}.{ending}"), |map| names[map].clone())
    };
    Ok(partners.iter().any(Option::is_some).then(|| (stems.iter().zip(&partners).map(name).collect(), by)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owned(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn frames_pair_in_order_and_a_missing_number_is_a_missing_map() {
        let pair_some =
            |names: &[&str], frames, played| pair_by_order(Path::new("maps"), &owned(names), frames, played);
        let pair = |names: &[&str], frames| pair_some(names, frames, None);
        let whole = ["d-01.png", "d-02.png", "d-03.png"];
        assert_eq!(pair(&whole, Some(3)).unwrap(), whole);
        assert_eq!(pair(&whole, None).unwrap(), whole);
        let gap = ["d-01.png", "d-03.png", "d-04.png"];
        let filled = ["d-01.png", "d-02.png", "d-03.png", "d-04.png"];
        assert_eq!(pair(&gap, Some(4)).unwrap(), filled);
        assert_eq!(pair(&gap, None).unwrap(), filled);
        // As many as frames: the numbers are not those of frames.
        assert_eq!(pair(&gap, Some(3)).unwrap(), gap);
        // Times, and names without numbers, are in order.
        for names in [&["10.npy", "20.npy", "40.npy"][..], &["a.png", "b.png"], &["1.png", "b.png"], &[]] {
            assert_eq!(pair(names, None).unwrap(), names);
        }
        let said = pair(&gap, Some(9)).unwrap_err().to_string();
        assert!(said.contains("3 depth maps") && said.contains('9'), "{said}");
        // Frames that are not played need none.
        assert_eq!(pair_some(&whole, Some(180), Some(3)).unwrap(), whole);
        assert_eq!(pair_some(&whole, Some(180), Some(2)).unwrap(), whole);
        for played in [3, 4] {
            assert_eq!(pair_some(&gap, Some(180), Some(played)).unwrap(), filled, "the numbers are those of frames");
        }
        assert_eq!(pair_some(&gap, Some(3), Some(2)).unwrap(), gap);
        let times = ["10.npy", "20.npy", "31.npy"];
        assert_eq!(pair_some(&times, Some(4), Some(2)).unwrap(), times);
        assert_eq!(pair_some(&whole, Some(3), Some(9)).unwrap(), whole);
        let said = pair_some(&whole, Some(180), Some(5)).unwrap_err().to_string();
        assert!(said.contains("3 depth maps for 5 pictures"), "{said}");
        assert!(pair_some(&whole, Some(2), Some(1)).is_err(), "maps of something longer");
    }

    #[test]
    fn pictures_with_names_have_maps_of_these() {
        let pair = |names: &[&str], stems: &[&str]| pair_by_stem(Path::new("maps"), &owned(names), &owned(stems));
        let found = pair(&["IMG_2.npy", "IMG_1-depth.npy"], &["IMG_1", "IMG_2", "IMG_3"]).unwrap();
        assert_eq!(found.unwrap().0, ["IMG_1-depth.npy", "IMG_2.npy", "IMG_3.npy"]);
        assert_eq!(pair(&["0.png"], &["IMG_1"]).unwrap(), None);
        assert!(matches!(pair(&["a.png", "a.npy"], &["a"]), Err(RecordingError::SameNumber { .. })));
    }
}
