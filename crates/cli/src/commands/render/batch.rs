//! `render` of many pictures: each on its own, several at a time.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread;

use super::listing::{Picture, list_pictures};
use super::map_folder::MapFolder;
use super::{RenderCommand, RenderedFile, input_files, render, request_look};
use crate::error::CliError;
use crate::files::{refuse_overwrite, refuse_overwriting_source, warn_of_leftovers};
use crate::log::{self, Remark};
use crate::options::Global;
use crate::settings::layers::GivenSettings;
use crate::settings::look::RequestedLook;
use crate::terminal::{Progress, print_to_stderr, stop_flag_between};
use bokehcam::compute::{Backend, memory};
use bokehcam::computing::ExecutorFactory;
use bokehcam::depth::backdrop::Background;
use bokehcam::look::Look;
use bokehcam_files::place;
use bokehcam_live::source::DepthChoice;
use bokehcam_media::recording::mask_file;
use bokehcam_media::recording::pictures::MAP_SUFFIXES;
use bokehcam_media::recording::still::PhotoFormat;

/// Peak memory per pixel of reading, blurring and encoding a picture.
const BYTES_PER_PIXEL: u64 = 120;
/// Peak memory of a network.
const NETWORK_BYTES: u64 = 1 << 30;
/// Pictures at a time on a GPU: one is blurred while others are read and written.
const AT_ONCE_ON_GPU: usize = 3;

/// Returns the format of all results, if it is not that of each picture: PNG keeps a transparent background.
fn result_format(command: &RenderCommand, look: &Look) -> Result<Option<PhotoFormat>, CliError> {
    match (look.background == Background::Transparent, command.out_format) {
        (true, Some(PhotoFormat::Jpeg)) => {
            let what = "--out-format jpg: JPEG keeps no transparency; use png, tif or webp for --behind transparent";
            Err(CliError::Usage(what.to_owned()))
        }
        (is_transparent, format) => Ok(format.or(is_transparent.then_some(PhotoFormat::Png))),
    }
}

/// What became of a picture.
enum Outcome {
    Written(RenderedFile),
    /// The result was there, perhaps older than the picture.
    Kept {
        is_older: bool,
    },
    Failed(CliError),
}

/// A finished picture: its number, what became of it, and the remarks on it.
type Done = (usize, Outcome, Vec<(Remark, String)>);

/// The folders in place of one depth map and one mask.
struct MapFolders<'a> {
    depth: Option<MapFolder<'a>>,
    mask: Option<MapFolder<'a>>,
}

/// Runs the command.
///
/// # Errors
/// Fails if the command line does not fit many pictures, before anything is written; and at the end if a picture
/// failed, or was not begun because of Ctrl-C.
pub(super) fn run(command: &RenderCommand, global: &Global, given: &GivenSettings) -> Result<(), CliError> {
    let requested = request_look(command, given)?;
    let (depth, mask) = (command.depth_map.as_deref(), command.mask.as_deref());
    let maps = MapFolders {
        depth: depth.map(|dir| MapFolder::read("--depth-map", dir, &MAP_SUFFIXES)).transpose()?,
        mask: mask.map(|dir| MapFolder::read("--mask", dir, &mask_file::SUFFIXES)).transpose()?,
    };
    let format = result_format(command, &requested.look)?;
    let pictures = list_pictures(&command.images, &command.out, format)?;
    refuse_overwriting_inputs(command, &maps, &pictures)?;
    fs::create_dir_all(&command.out).map_err(CliError::io(&command.out))?;
    warn_of_leftovers([command.out.as_path()]);
    let (command, at_once) = divide_work(command, &pictures)?;
    let stop = stop_flag_between("pictures")?;
    let bar = Progress::with_items("pictures", Some(pictures.len() as u64), global);
    let (next, finished) = (AtomicUsize::new(0), AtomicU64::new(0));
    let work = || {
        let mut done: Vec<Done> = Vec::new();
        while !stop.load(Ordering::Relaxed)
            && let at = next.fetch_add(1, Ordering::Relaxed)
            && let Some(picture) = pictures.get(at)
        {
            let (outcome, remarks) = log::hold_remarks(|| process(&command, &maps, picture, &requested, given));
            if let (Outcome::Written(RenderedFile { executor, depth_by }), 1..) = (&outcome, global.verbose) {
                let by = depth_by.as_ref().map_or(String::new(), |by| format!(", depth by {by}"));
                print_to_stderr(&format!("{}: written ({executor}{by})", picture.target.display()));
            }
            bar.set_delivered(finished.fetch_add(1, Ordering::Relaxed) + 1);
            done.push((at, outcome, remarks));
        }
        done
    };
    let mut done: Vec<Done> = thread::scope(|scope| {
        let threads: Vec<_> = (0..at_once).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    drop(bar);
    done.sort_by_key(|(at, ..)| *at);
    report(&pictures, &done, global)
}

/// Refuses results that would replace any input, also through links.
fn refuse_overwriting_inputs(command: &RenderCommand, maps: &MapFolders, pictures: &[Picture]) -> Result<(), CliError> {
    let identity = |path: &Path| fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
    let (mut paths, mut files) = (HashMap::new(), HashMap::new());
    // A picture without a map fails later; here it counts as an input, like the others.
    let inputs_of = |picture: &Picture| {
        let command = maps.command_for(command, picture);
        command.map_or_else(|_| vec![picture.path.clone()], |command| input_files(&command))
    };
    for source in pictures.iter().flat_map(inputs_of) {
        paths.entry(place::resolve_links(&source)).or_insert_with(|| source.clone());
        if let Some(file) = identity(&source) {
            files.entry(file).or_insert(source);
        }
    }
    for Picture { target, .. } in pictures {
        let by_file = || files.get(&identity(target)?);
        if let Some(source) = paths.get(&place::resolve_links(target)).or_else(by_file) {
            refuse_overwriting_source("--out", target, source)?;
        }
    }
    Ok(())
}

/// Returns the command for each picture, with its number of threads; and the number of pictures at a time, for which
/// there is memory.
fn divide_work(command: &RenderCommand, pictures: &[Picture]) -> Result<(RenderCommand, usize), CliError> {
    let mut command = command.clone();
    let computing = command.computing.to_compute_options();
    let threads = computing.thread_count();
    let has_gpu = ExecutorFactory::new(computing).open_device()?.is_some();
    if !has_gpu {
        // The others need not look for one.
        command.computing.backend = Backend::Cpu;
    }
    let pixels = pictures.iter().map(|picture| picture.pixels).max().unwrap_or(0);
    let needs_network =
        command.depth_map.is_none() && command.mask.is_none() && command.blur.depth != DepthChoice::None;
    let bytes = (pixels * BYTES_PER_PIXEL + if needs_network { NETWORK_BYTES } else { 0 }).max(1);
    // Half of the memory is left to others.
    let fitting = memory::free_bytes().map_or(1, |free| free / 2 / bytes);
    let most = if has_gpu { threads.min(AT_ONCE_ON_GPU) } else { threads };
    let at_once = most.min(pictures.len()).min(fitting.try_into().unwrap_or(usize::MAX)).max(1);
    command.computing.threads = Some(threads.div_ceil(at_once));
    Ok((command, at_once))
}

impl MapFolders<'_> {
    /// Returns the command for one of the pictures.
    ///
    /// # Errors
    /// A folder has no file for it, or several.
    fn command_for(&self, command: &RenderCommand, picture: &Picture) -> Result<RenderCommand, CliError> {
        let find = |folder: &Option<MapFolder>| folder.as_ref().map(|folder| folder.find(&picture.path)).transpose();
        Ok(RenderCommand {
            image: Some(picture.path.clone()),
            out: picture.target.clone(),
            depth_map: find(&self.depth)?,
            mask: find(&self.mask)?,
            ..command.clone()
        })
    }
}

/// Renders a picture, unless its result is there.
fn process(
    command: &RenderCommand,
    maps: &MapFolders,
    picture: &Picture,
    requested: &RequestedLook,
    given: &GivenSettings,
) -> Outcome {
    // A panic fails this picture only.
    let rendered = CliError::catch_panic(|| {
        refuse_overwrite([picture.target.as_path()], command.output.force)?;
        render(&maps.command_for(command, picture)?, requested, given)
    });
    let changed = |path: &Path| fs::metadata(path).and_then(|file| file.modified()).ok();
    match rendered {
        Ok(rendered) => Outcome::Written(rendered),
        Err(CliError::Exists(_)) => Outcome::Kept { is_older: changed(&picture.target) < changed(&picture.path) },
        Err(error) => Outcome::Failed(error),
    }
}

/// Prints the remarks, each once; then the failures, and the counts.
fn report(pictures: &[Picture], done: &[Done], global: &Global) -> Result<(), CliError> {
    // The first picture of a remark, and the number of pictures.
    let mut remarks: BTreeMap<&(Remark, String), (&Path, usize)> = BTreeMap::new();
    for (at, _, of_picture) in done {
        let path = pictures[*at].path.as_path();
        of_picture.iter().for_each(|remark| remarks.entry(remark).or_insert((path, 0)).1 += 1);
    }
    for ((remark, text), (first, count)) in remarks {
        let text = match count {
            1 => name_picture(first, text),
            _ => format!("{text} ({count} pictures, the first is {})", first.display()),
        };
        match remark {
            Remark::Warning => log::warn(&text),
            Remark::Note => log::note(&text),
        }
    }
    let [mut written, mut kept, mut older, mut failed] = [0; 4];
    for (at, outcome, _) in done {
        match outcome {
            Outcome::Written(_) => written += 1,
            Outcome::Kept { is_older } => (kept, older) = (kept + 1, older + usize::from(*is_older)),
            Outcome::Failed(error) => {
                failed += 1;
                log::error(&name_picture(&pictures[*at].path, &error.to_string()));
            }
        }
    }
    let aside = match (kept, older) {
        (0, _) => String::new(),
        (_, 0) => " (the result is there; --force renders it again)".to_owned(),
        _ => format!(" (the result is there, and of {older} older than the picture; --force renders it again)"),
    };
    let mut counts = format!("{written} written, {kept} skipped{aside}, {failed} failed");
    let left = pictures.len() - done.len();
    if left > 0 {
        counts += &format!(", {left} not begun: the same command renders the rest");
    }
    if left + failed > 0 {
        return Err(CliError::Incomplete(counts));
    }
    if !global.quiet {
        print_to_stderr(&counts);
    }
    Ok(())
}

/// Puts the picture in front of a text that does not name it.
fn name_picture(picture: &Path, text: &str) -> String {
    let picture = picture.display().to_string();
    if text.contains(&picture) { text.to_owned() } else { format!("{picture}: {text}") }
}
