//! From the lists to frames.

use std::collections::HashSet;
use std::path::Path;

use super::list::{self, Entry};
use super::{ASSOCIATIONS, COLOR_LIST, DEPTH_LIST, pair};
use crate::recording::decode::{self, Kind, Scratch};
use crate::recording::error::RecordingError;
use crate::recording::{Folder, Options, Source, Unpaired};

/// What a folder in this layout holds.
pub(in crate::recording) struct Contents {
    pub(in crate::recording) frames: Vec<Listed>,
    pub(in crate::recording) has_depth: bool,
    pub(in crate::recording) unpaired: Unpaired,
}

/// A frame as listed. The times that there are increase strictly; a colour without one is faulty.
pub(in crate::recording) struct Listed {
    pub(in crate::recording) time_ns: Option<u64>,
    pub(in crate::recording) color: Source,
    pub(in crate::recording) depth: Option<Source>,
}

/// Reads the lists in `folder`.
pub(in crate::recording) fn open(folder: &Folder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let has = |list: &str| dir.join(list).exists();
    match (has(ASSOCIATIONS), has(COLOR_LIST), has(DEPTH_LIST)) {
        (true, ..) => from_associations(folder, options),
        (false, true, has_depth) => from_lists(dir, has_depth, options),
        (false, false, true) => {
            Err(RecordingError::MissingList { dir: dir.clone(), missing: COLOR_LIST, present: DEPTH_LIST })
        }
        (false, false, false) => Err(RecordingError::NotARecording {
            dir: dir.clone(),
            looked_for: "associations.txt and rgb.txt (TUM RGB-D)",
        }),
    }
}

fn from_lists(dir: &Path, has_depth: bool, options: &Options) -> Result<Contents, RecordingError> {
    let read = |list| {
        let mut entries = list::read(dir, list)?;
        list::give_up_disorder(entries.iter_mut());
        if !options.keep_going {
            refuse_faults(dir, entries.iter())?;
        }
        Ok::<_, RecordingError>(entries)
    };
    let colors = read(COLOR_LIST)?;
    if !has_depth {
        let frame = |Entry { time_ns, source }| Listed { time_ns, color: source, depth: None };
        let frames = colors.into_iter().map(frame).collect();
        return Ok(Contents { frames, has_depth, unpaired: Unpaired::default() });
    }

    let times = |entries: &[Entry]| entries.iter().filter_map(|entry| entry.time_ns).collect::<Vec<_>>();
    let depths = read(DEPTH_LIST)?;
    let mut partners = pair::nearest(&times(&colors), &times(&depths), options.pair_tolerance_ns).into_iter();

    let mut unpaired = Unpaired { color: 0, depth: depths.len() };
    let mut timed_depths: Vec<_> =
        depths.into_iter().filter(|depth| depth.time_ns.is_some()).map(|depth| Some(depth.source)).collect();
    let mut frames = Vec::new();
    for Entry { time_ns, source: color } in colors {
        let depth = match time_ns {
            Some(_) => partners.next().flatten().and_then(|partner| timed_depths[partner].take()),
            None => None,
        };
        // A faulty line stays, to be counted where it is read.
        match (time_ns, &depth) {
            (Some(_), None) => unpaired.color += 1,
            _ => {
                unpaired.depth -= usize::from(depth.is_some());
                frames.push(Listed { time_ns, color, depth });
            }
        }
    }
    if frames.iter().all(|frame| frame.depth.is_none()) {
        return Err(RecordingError::NoPairs { dir: dir.to_owned(), tolerance_ns: options.pair_tolerance_ns });
    }
    Ok(Contents { frames, has_depth, unpaired })
}

fn from_associations(folder: &Folder, options: &Options) -> Result<Contents, RecordingError> {
    let mut pairs = list::read_pairs(&folder.dir, ASSOCIATIONS)?;
    if !is_color_first(folder, &pairs)? {
        pairs.iter_mut().for_each(|pair| pair.reverse());
    }
    list::give_up_disorder(pairs.iter_mut().map(|[color, _]| color));
    if !options.keep_going {
        refuse_faults(&folder.dir, pairs.iter().flatten())?;
    }
    let frame =
        |[color, depth]: [Entry; 2]| Listed { time_ns: color.time_ns, color: color.source, depth: Some(depth.source) };
    let frames = pairs.into_iter().map(frame).collect();
    Ok(Contents { frames, has_depth: true, unpaired: Unpaired::default() })
}

/// Whether the colour is in the first columns: told by the other lists, else by the pictures.
fn is_color_first(folder: &Folder, pairs: &[[Entry; 2]]) -> Result<bool, RecordingError> {
    for (list, is_color) in [(COLOR_LIST, true), (DEPTH_LIST, false)] {
        // Here the other lists are only a hint: what is wrong with them does no harm.
        let Ok(entries) = list::read(&folder.dir, list) else { continue };
        let files: HashSet<_> = entries.iter().filter_map(|entry| entry.source.file.as_ref().ok()).collect();
        let is_listed = |entry: &Entry| entry.source.file.as_ref().is_ok_and(|file| files.contains(file));
        for [first, second] in pairs {
            match (is_listed(first), is_listed(second)) {
                (true, false) => return Ok(is_color),
                (false, true) => return Ok(!is_color),
                _ => {}
            }
        }
    }

    let mut scratch = Scratch::default();
    for pair in pairs {
        let [first, second] = pair.each_ref().map(|entry| kind(folder, &entry.source, &mut scratch));
        match (first, second) {
            (first, second) if first == second => {}
            (Some(Kind::Color), _) | (_, Some(Kind::Depth)) => return Ok(true),
            (Some(Kind::Depth), _) | (_, Some(Kind::Color)) => return Ok(false),
            _ => {}
        }
    }
    // Broken lines say more about what is wrong than unreadable columns do.
    refuse_faults(&folder.dir, pairs.iter().flatten())?;
    Err(RecordingError::Columns { list: folder.dir.join(ASSOCIATIONS) })
}

fn kind(folder: &Folder, source: &Source, scratch: &mut Scratch) -> Option<Kind> {
    let path = folder.locate(source).ok()?;
    decode::header(&path, scratch).ok().map(|(_, kind)| kind)
}

fn refuse_faults<'a>(dir: &Path, mut entries: impl Iterator<Item = &'a Entry>) -> Result<(), RecordingError> {
    entries.try_for_each(|entry| entry.source.file(dir).map(|_| ()))
}
