//! Finds tracks, tags, attachments and pictures in a Matroska file (RFC 9559), in one pass over its elements.
//!
//! The pass reads the heads of elements and skips their content: some hundred bytes per picture. It needs no index,
//! and does not believe the length of the whole, which is written last, so that a file that was cut short, or whose
//! recorder was killed, is read up to its last whole picture. The crate `matroska-demuxer` refuses such files, reads the bytes
//! of every picture to list them, and no attachments.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use super::ebml::{self, Head};
use super::track::{Block, Track};
use crate::recording::MAX_ENTRIES;
use crate::recording::slow_search::SlowSearch;
use bokehcam_files::input::MAX_CALIBRATION_BYTES;

/// The first bytes of a file: the ID of its first element.
pub(super) const MAGIC: [u8; 4] = [0x1A, 0x45, 0xDF, 0xA3];

const SEGMENT: u32 = 0x1853_8067;
const INFO: u32 = 0x1549_A966;
const TIMESTAMP_SCALE: u32 = 0x2A_D7B1;
const TRACKS: u32 = 0x1654_AE6B;
const TRACK_ENTRY: u32 = 0xAE;
const TAGS: u32 = 0x1254_C367;
const TAG: u32 = 0x7373;
const SIMPLE_TAG: u32 = 0x67C8;
const TAG_NAME: u32 = 0x45A3;
const TAG_STRING: u32 = 0x4487;
const ATTACHMENTS: u32 = 0x1941_A469;
const ATTACHED_FILE: u32 = 0x61A7;
const FILE_NAME: u32 = 0x466E;
const FILE_DATA: u32 = 0x465C;
const CLUSTER: u32 = 0x1F43_B675;
const CLUSTER_TIMESTAMP: u32 = 0xE7;
const SIMPLE_BLOCK: u32 = 0xA3;
const BLOCK_GROUP: u32 = 0xA0;
const BLOCK: u32 = 0xA1;

/// Bits of a block's flags: several frames share it.
const LACING: u8 = 0b110;

/// Bytes that are looked at of an element: its head, and that of a block.
const READ_BYTES: usize = 32;
/// Bytes that are read at once, for the heads of small elements that follow each other.
const BUFFER_BYTES: u64 = 4096;
/// Definitions of tracks and tags that are read; recorders write some thousand bytes.
const MAX_DEFINITION_BYTES: u64 = 1 << 22;
/// Number of tracks, and of attachments, that are noted.
const MAX_PARTS: usize = 64;
/// Largest picture that is read; the largest of a Kinect has 50 MB.
const MAX_PICTURE_BYTES: u64 = 1 << 28;
/// The part of a file in which recorders write what precedes the pictures, in bytes.
const MAX_START_BYTES: u64 = 1 << 20;

/// Nanoseconds per tick where a file states none, by the standard.
const DEFAULT_SCALE_NS: u64 = 1_000_000;
/// The same for a file without that part: the recorder writes microseconds, and writes that part last.
const RECORDER_SCALE_NS: u64 = 1000;

/// The fault of a file that was cut short, or of a wrong length in it.
const CUT: &str = "it ends within an element";

/// What a file contains.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// Nanoseconds per tick; 0 if not stated.
    scale_ns: u64,
    pub tracks: Vec<Track>,
    /// Names and values.
    tags: Vec<(String, String)>,
    attachments: Vec<Attachment>,
    /// What is wrong with the file, if anything.
    pub damage: Option<String>,
}

#[derive(Debug, Default)]
struct Attachment {
    name: String,
    at: u64,
    length: u64,
}

impl Contents {
    /// Returns the value of a tag.
    pub fn tag(&self, name: &str) -> Option<&str> {
        self.tags.iter().find(|(tag, _)| tag == name).map(|(_, value)| &**value)
    }

    /// Returns whether there is a tag of a Kinect.
    pub fn has_kinect_tags(&self) -> bool {
        self.tags.iter().any(|(name, _)| name.starts_with("K4A_"))
    }

    /// Returns the track that the tag `K4A_NAME_TRACK` names, else the one that has this name.
    pub fn track(&self, name: &str) -> Option<&Track> {
        let uid = self.tag(&format!("K4A_{name}_TRACK")).and_then(|uid| uid.parse().ok());
        let tagged = self.tracks.iter().find(|track| Some(track.uid) == uid);
        tagged.or_else(|| self.tracks.iter().find(|track| track.name == name))
    }

    /// Returns a time in nanoseconds.
    pub fn time_ns(&self, ticks: u64) -> u64 {
        ticks.saturating_mul(if self.scale_ns == 0 { RECORDER_SCALE_NS } else { self.scale_ns })
    }

    /// Reads the attached file of this name; `None` if it is missing.
    pub fn read_attachment(&self, file: &File, name: &str) -> io::Result<Option<Vec<u8>>> {
        let Some(found) = self.attachments.iter().find(|file| file.name == name) else { return Ok(None) };
        read(file, found.at, found.length.min(MAX_CALIBRATION_BYTES)).map(Some)
    }
}

/// Scans a file, which must begin with [`MAGIC`]. `name` is for messages.
///
/// # Errors
/// The system cannot read the file. Faults of the file are part of the result.
pub(super) fn scan(file: &File, name: &str) -> io::Result<Contents> {
    let end = file.metadata()?.len();
    Scanner::new(file, name, end).scan(false)
}

/// Scans what precedes the pictures.
///
/// # Errors
/// Same as for [`scan`].
pub(super) fn scan_start(file: &File) -> io::Result<Contents> {
    let end = file.metadata()?.len().min(MAX_START_BYTES);
    Scanner::new(file, "", end).scan(true)
}

/// Why a pass cannot go on.
enum Stop {
    /// A fault of the file.
    Fault(&'static str),
    /// The first picture, where only the start is scanned.
    Pictures,
    Io(io::Error),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

struct Scanner<'a> {
    found: Contents,
    file: &'a File,
    name: &'a str,
    /// Position of the next element.
    at: u64,
    /// The part of the file that was read last, from `buffer_at`.
    buffer: Vec<u8>,
    buffer_at: u64,
    end: u64,
    /// Ends of the segment, and of the cluster that `at` is in, if they are stated.
    segment_end: Option<u64>,
    cluster_end: Option<u64>,
    cluster_ticks: Option<u64>,
    definition_bytes: u64,
    block_count: usize,
    search: SlowSearch,
}

impl<'a> Scanner<'a> {
    fn new(file: &'a File, name: &'a str, end: u64) -> Self {
        Self {
            found: Contents::default(),
            file,
            name,
            at: 0,
            buffer: Vec::new(),
            buffer_at: 0,
            end,
            segment_end: None,
            cluster_end: None,
            cluster_ticks: None,
            definition_bytes: 0,
            block_count: 0,
            search: SlowSearch::begin(),
        }
    }

    fn scan(mut self, is_start: bool) -> io::Result<Contents> {
        while self.at < self.end {
            self.search.warn_if_slow(self.name, "looking through the file");
            self.cluster_end = self.cluster_end.filter(|&end| self.at < end);
            match self.scan_element(is_start) {
                Ok(next) => self.at = next,
                Err(Stop::Io(error)) => return Err(error),
                Err(Stop::Pictures) => break,
                // Anything may follow the segment.
                Err(Stop::Fault(_)) if self.segment_end == Some(self.at) => break,
                Err(Stop::Fault(what)) => {
                    self.note_damage(format!("{what} (at byte {})", self.at));
                    // What follows the cluster can be read.
                    match self.cluster_end.take().filter(|&end| end < self.end) {
                        Some(end) => self.at = end,
                        None => break,
                    }
                }
            }
        }
        if self.segment_end.is_some_and(|end| end > self.end) {
            self.note_damage("the end of the file is missing".to_owned());
        }
        Ok(self.found)
    }

    fn note_damage(&mut self, what: String) {
        self.found.damage.get_or_insert(what);
    }

    /// Reads the beginning of the element at `self.at`, into the start of `bytes`; returns how many bytes there are.
    fn read_head(&mut self, bytes: &mut [u8; READ_BYTES]) -> io::Result<usize> {
        let length = (self.end - self.at).min(READ_BYTES as u64) as usize;
        let is_buffered =
            self.at >= self.buffer_at && self.at + length as u64 <= self.buffer_at + self.buffer.len() as u64;
        if !is_buffered {
            self.buffer = read(self.file, self.at, (self.end - self.at).min(BUFFER_BYTES))?;
            self.buffer_at = self.at;
        }
        bytes[..length].copy_from_slice(&self.buffer[(self.at - self.buffer_at) as usize..][..length]);
        Ok(length)
    }

    /// Scans the element at `self.at`; returns where the next one is: after it, or inside.
    fn scan_element(&mut self, is_start: bool) -> Result<u64, Stop> {
        let mut bytes = [0; READ_BYTES];
        let length = self.read_head(&mut bytes)?;
        let bytes = &bytes[..length];
        let is_whole = bytes.len() >= ebml::MAX_HEAD_BYTES;
        let no_element = if is_whole { "something that is no element" } else { CUT };
        let head = Head::parse(bytes).ok_or(Stop::Fault(no_element))?;
        let inside = self.at + head.bytes as u64;
        let after = head.length.map(|length| inside.saturating_add(length));
        match head.id {
            SEGMENT => {
                self.segment_end = after;
                return Ok(inside);
            }
            CLUSTER if is_start => return Err(Stop::Pictures),
            CLUSTER => {
                (self.cluster_end, self.cluster_ticks) = (after, None);
                return Ok(inside);
            }
            ATTACHED_FILE => {
                self.found.attachments.truncate(MAX_PARTS);
                self.found.attachments.push(Attachment::default());
                return Ok(inside);
            }
            ATTACHMENTS | BLOCK_GROUP => return Ok(inside),
            _ => {}
        }
        let (Some(length), Some(after)) = (head.length, after) else {
            return Err(Stop::Fault("an element of unknown length"));
        };
        if after > self.cluster_end.unwrap_or(self.end).min(self.end) {
            return Err(Stop::Fault(CUT));
        }
        match head.id {
            INFO | TRACKS | TAGS | FILE_NAME => {
                self.definition_bytes += length;
                if self.definition_bytes > MAX_DEFINITION_BYTES {
                    return Err(Stop::Fault("too many definitions"));
                }
                self.define(head.id, &read(self.file, inside, length)?);
            }
            FILE_DATA => {
                if let Some(file) = self.found.attachments.last_mut() {
                    (file.at, file.length) = (inside, length);
                }
            }
            CLUSTER_TIMESTAMP if length <= 8 => {
                self.cluster_ticks = Some(ebml::big_endian(&bytes[head.bytes..][..length as usize]));
            }
            SIMPLE_BLOCK | BLOCK => self.add_block(&bytes[head.bytes..], inside, after)?,
            _ => {}
        }
        Ok(after)
    }

    fn define(&mut self, id: u32, content: &[u8]) {
        let found = &mut self.found;
        match id {
            INFO => {
                let scale = ebml::children(content).find(|&(id, _)| id == TIMESTAMP_SCALE);
                found.scale_ns = scale.map_or(DEFAULT_SCALE_NS, |(_, scale)| ebml::big_endian(scale));
            }
            TRACKS => {
                let entries = ebml::children(content).filter(|&(id, _)| id == TRACK_ENTRY);
                found.tracks.extend(entries.take(MAX_PARTS - found.tracks.len()).map(|(_, entry)| Track::parse(entry)));
            }
            TAGS => {
                let tags = ebml::children(content).filter(|&(id, _)| id == TAG);
                for (_, tag) in tags.flat_map(|(_, tag)| ebml::children(tag)).filter(|&(id, _)| id == SIMPLE_TAG) {
                    let text =
                        |wanted| ebml::children(tag).find(|&(id, _)| id == wanted).map(|(_, text)| ebml::text(text));
                    found.tags.extend(text(TAG_NAME).zip(text(TAG_STRING)));
                }
            }
            _ => found.attachments.last_mut().into_iter().for_each(|file| file.name = ebml::text(content)),
        }
    }

    /// Notes a block whose content is from `at` to `end`, and begins with `bytes`.
    fn add_block(&mut self, bytes: &[u8], at: u64, end: u64) -> Result<(), Stop> {
        let no_block = Stop::Fault("a block is damaged");
        let Some((number, number_bytes)) = ebml::parse_number(bytes) else { return Err(no_block) };
        let Some(&[high, low, flags]) = bytes[number_bytes..].first_chunk() else { return Err(no_block) };
        let picture_at = at + number_bytes as u64 + 3;
        let Some((ticks, length)) = self.cluster_ticks.zip(end.checked_sub(picture_at)) else { return Err(no_block) };
        let Some(track) = self.found.tracks.iter_mut().find(|track| track.number == number) else { return Ok(()) };
        if track.color_format().is_none() && !track.is_grey16() {
            return Ok(());
        }
        if flags & LACING != 0 || length > MAX_PICTURE_BYTES {
            let what = if length > MAX_PICTURE_BYTES { "is too long" } else { "has several pictures (lacing)" };
            self.note_damage(format!("the block at byte {at} {what}"));
            return Ok(());
        }
        self.block_count += 1;
        if self.block_count > 3 * MAX_ENTRIES {
            return Err(Stop::Fault("too many pictures; split the file"));
        }
        let ticks = ticks.saturating_add_signed(i16::from_be_bytes([high, low]).into());
        track.blocks.push(Block { ticks, at: picture_at, length: length as u32 });
        Ok(())
    }
}

/// Reads a part of a file that is not longer than the file was.
fn read(file: &File, at: u64, length: u64) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; length as usize];
    file.read_exact_at(&mut bytes, at).map(|()| bytes)
}
