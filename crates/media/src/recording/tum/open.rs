//! Builds frames from the lists, which have hidden names if the recording was interrupted.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::associations::find_associations;
use super::growing::find_interrupted;
use super::{COLOR_LIST, DEPTH_LIST, list};
use crate::recording::contents::{Contents, DepthFormat, ListedFrame, Locator, PictureSource, RecordingFolder};
use crate::recording::decode::{self, PictureKind};
use crate::recording::error::RecordingError;
use crate::recording::list::{Entry, clear_unordered_times, refuse_faults};
use crate::recording::{Options, Unpaired, pair, timeline};

/// Maximum number of pictures that are inspected to tell the columns of the associations apart.
const MAX_PICTURES: usize = 1000;

/// Returns whether `dir` has a list of this layout.
pub(super) fn is_tum_folder(dir: &Path) -> bool {
    [COLOR_LIST, DEPTH_LIST].iter().any(|list| dir.join(list).exists())
        || !find_associations(dir).is_empty()
        || find_interrupted(dir, COLOR_LIST).is_some()
}

/// Reads the lists in `folder`.
pub(super) fn open(folder: &RecordingFolder, options: &Options) -> Result<Contents, RecordingError> {
    let dir = &folder.dir;
    let has = |list: &str| dir.join(list).exists();
    match (&find_associations(dir)[..], has(COLOR_LIST), has(DEPTH_LIST)) {
        ([list], ..) => from_associations(folder, list, options),
        ([one, other, ..], ..) => {
            Err(RecordingError::TwoLists { dir: dir.clone(), lists: [one.clone(), other.clone()] })
        }
        ([], true, has_depth) => from_lists(dir, COLOR_LIST, has_depth.then_some(DEPTH_LIST), options),
        ([], false, has_depth) => {
            let color = find_interrupted(dir, COLOR_LIST).ok_or_else(|| RecordingError::MissingList {
                dir: dir.clone(),
                missing: COLOR_LIST,
                present: DEPTH_LIST,
            })?;
            // The list of depth is finished first.
            let depth = if has_depth { Some(DEPTH_LIST.to_owned()) } else { find_interrupted(dir, DEPTH_LIST) };
            let contents = from_lists(dir, &color, depth.as_deref(), options)?;
            let frames = contents.frames.len();
            tracing::warn!("{}: the recording was interrupted; {frames} frames are played", dir.display());
            Ok(contents)
        }
    }
}

/// Pairs the list of colour pictures with that of depth, if there is one, by nearest time.
fn from_lists(dir: &Path, color: &str, depth: Option<&str>, options: &Options) -> Result<Contents, RecordingError> {
    let read = |list| {
        let mut entries = list::read_list(dir, list)?;
        clear_unordered_times(entries.iter_mut());
        if !options.keep_going {
            refuse_faults(dir, entries.iter())?;
        }
        Ok::<_, RecordingError>(entries)
    };
    let colors = read(color)?;
    let Some(depth) = depth else {
        let frames = colors.into_iter().map(|color| to_frame(color, None)).collect();
        return Ok(to_contents(frames, None, Unpaired::default()));
    };
    let paired = pair::pair_by_time(colors, read(depth)?, options.pair_tolerance_ns);
    if paired.frames.iter().all(|(_, depth)| depth.is_none()) {
        return Err(RecordingError::NoPairs { dir: dir.to_owned(), tolerance_ns: options.pair_tolerance_ns });
    }
    let unpaired = Unpaired { color: paired.unpaired, depth: paired.unpaired_others, ..Unpaired::default() };
    let frames = paired.frames.into_iter().map(|(color, depth)| to_frame(color, depth)).collect();
    Ok(to_contents(frames, Some(options), unpaired))
}

fn to_frame(color: Entry, depth: Option<PictureSource>) -> ListedFrame {
    ListedFrame { time_ns: color.time_ns, color: color.source, right: None, depth }
}

/// `depth_options` must be given if the frames have depth.
fn to_contents(frames: Vec<ListedFrame>, depth_options: Option<&Options>, unpaired: Unpaired) -> Contents {
    let depth = depth_options.map(|options| DepthFormat::of_pictures(options, super::DEPTH_SCALE));
    Contents { frames, depth, unpaired, has_times: true, ..Contents::default() }
}

/// Takes the pairs of the list of associations as they are; the colour picture determines the time of a frame.
fn from_associations(folder: &RecordingFolder, list: &str, options: &Options) -> Result<Contents, RecordingError> {
    let mut pairs = list::read_pairs(&folder.dir, list)?;
    if !is_color_first(folder, list, &pairs)? {
        pairs.iter_mut().for_each(|pair| pair.reverse());
    }
    clear_unordered_times(pairs.iter_mut().map(|[color, _]| color));
    if !options.keep_going {
        refuse_faults(&folder.dir, pairs.iter().flatten())?;
    }
    let frames = pairs.into_iter().map(|[color, depth]| to_frame(color, Some(depth.source))).collect();
    let mut contents = to_contents(frames, Some(options), Unpaired::default());
    if are_numbers(&contents.frames) {
        let rate = timeline::describe_rate(options);
        tracing::warn!("{}: the times in {list} are the numbers of the frames; {rate}", folder.dir.display());
        (0..).zip(&mut contents.frames).for_each(|(index, frame)| {
            frame.time_ns = Some(timeline::numbered_time_ns(index, options));
        });
        contents.has_times = false;
    }
    Ok(contents)
}

/// Returns whether times count the frames from 0 or 1, as in the renderings of ICL-NUIM.
fn are_numbers(frames: &[ListedFrame]) -> bool {
    const SECOND_NS: u64 = 1_000_000_000;
    let first = frames.first().and_then(|frame| frame.time_ns).filter(|first| [0, SECOND_NS].contains(first));
    let mut counted = (0..).zip(frames);
    frames.len() > 2
        && first.is_some_and(|first| counted.all(|(n, frame)| frame.time_ns == Some(first + n * SECOND_NS)))
}

/// Returns whether colour is in the first two columns and depth in the last two, decided by a file that another list
/// names, or else by a pair of pictures of different kinds.
fn is_color_first(folder: &RecordingFolder, associations: &str, pairs: &[[Entry; 2]]) -> Result<bool, RecordingError> {
    for (list, is_color) in [(COLOR_LIST, true), (DEPTH_LIST, false)] {
        // The other lists are only a hint here: ignore their faults.
        let Ok(entries) = list::read_list(&folder.dir, list) else { continue };
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

    let (mut kinds, mut locator) = (HashMap::new(), Locator::new(folder));
    for pair in pairs {
        let [first, second] = pair.each_ref().map(|entry| cached_kind(&mut locator, &entry.source, &mut kinds));
        match (first, second) {
            (first, second) if first == second => {}
            (Some(PictureKind::Color), _) | (_, Some(PictureKind::Depth)) => return Ok(true),
            (Some(PictureKind::Depth), _) | (_, Some(PictureKind::Color)) => return Ok(false),
            _ => {}
        }
        if kinds.len() > MAX_PICTURES {
            break;
        }
    }
    // Broken lines are a better explanation than unreadable columns.
    refuse_faults(&folder.dir, pairs.iter().flatten())?;
    Err(RecordingError::Columns { list: folder.dir.join(associations) })
}

/// Returns the kind of a picture, if readable. Each file is read once and cached in `kinds`.
fn cached_kind<'a>(
    locator: &mut Locator,
    source: &'a PictureSource,
    kinds: &mut HashMap<&'a Path, Option<PictureKind>>,
) -> Option<PictureKind> {
    let file = source.file.as_deref().ok()?;
    let look = || decode::read_header(&locator.locate(source).ok()?).ok().map(|(_, kind)| kind);
    *kinds.entry(file).or_insert_with(look)
}
