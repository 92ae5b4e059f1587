//! Finds the messages with pictures in a file, in one pass over its records.
//!
//! The pass needs no summary at the end of the file, so that a file that was cut short is read up to its last whole
//! record. It skips the messages' content: in a file without compression it reads some hundred bytes per picture.
//! Compressed chunks are decompressed, because only a message itself has the time at which its picture was taken. The crate
//! `mcap` reads every message whole, ends at the first damage, and brings 15 packages.

use std::fs::File;
use std::io::{self, BufReader, Cursor, ErrorKind, Read, Seek};

use super::cameras;
use super::channels::{Channels, Contents, MAX_TOPICS};
use super::chunk::Chunk;
use super::fields::Fields;
use super::message::{MAX_MESSAGE_BYTES, Preview};
use super::topic::Message;
use crate::recording::MAX_ENTRIES;
use crate::recording::fault::PictureFault;
use crate::recording::slow_search::SlowSearch;

/// The first and the last bytes of a file.
pub(super) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Operation codes of records.
pub(super) const SCHEMA: u8 = 3;
pub(super) const CHANNEL: u8 = 4;
pub(super) const MESSAGE: u8 = 5;
pub(super) const CHUNK: u8 = 6;
pub(super) const DATA_END: u8 = 15;

/// Bytes of a record before its content: operation code and length.
const HEAD_BYTES: u64 = 9;
/// Bytes of a message's record before the message.
const MESSAGE_HEAD_BYTES: u64 = 22;
/// Bytes of a chunk's record up to the name of its compression.
const CHUNK_HEAD_BYTES: u64 = 32;

/// Longest name of a compression.
const MAX_COMPRESSION_BYTES: usize = 16;

/// Largest schema or channel that is read; others have no pictures.
const MAX_DEFINITION_BYTES: u64 = 1 << 20;
/// Decompressed bytes of all chunks together: a part that any file may have, and a multiple of the compressed file.
const MAX_DECOMPRESSED_BYTES: u64 = 1 << 30;
const MAX_RATIO: u64 = 200;

/// Buffer of the pass, small because most of a file is skipped.
const BUFFER_BYTES: usize = 1 << 13;

/// The end of a part of the file.
type End = Result<(), Damage>;

/// The fault of a file that was cut short, or of a wrong length in it.
const CUT: &str = "it ends within a record";

enum Damage {
    /// A fault of the file.
    Fault(String),
    Io(io::Error),
}

impl From<io::Error> for Damage {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::UnexpectedEof => Self::Fault(CUT.to_owned()),
            _ => Self::Io(error),
        }
    }
}

/// Scans a file, which must begin with [`MAGIC`]. `name` is for messages.
///
/// # Errors
/// The system cannot read the file. Faults of the file are part of the result.
pub(super) fn scan(file: &File, name: &str) -> io::Result<Contents> {
    let bytes = file.metadata()?.len();
    let mut scanner = Scanner {
        found: Contents::default(),
        file,
        name,
        channels: Channels::default(),
        message_count: 0,
        bytes_left: MAX_DECOMPRESSED_BYTES.saturating_add(bytes.saturating_mul(MAX_RATIO)),
        search: SlowSearch::begin(),
    };
    let mut reader = BufReader::with_capacity(BUFFER_BYTES, file);
    reader.seek(io::SeekFrom::Start(MAGIC.len() as u64))?;
    let mut position = MAGIC.len() as u64;
    match scanner.scan_records(&mut reader, &mut position, bytes, None) {
        Ok(()) => {}
        Err(Damage::Fault(what)) => scanner.note_damage(format!("{what} (at byte {position})")),
        Err(Damage::Io(error)) => return Err(error),
    }
    Ok(scanner.found)
}

struct Scanner<'a> {
    found: Contents,
    file: &'a File,
    name: &'a str,
    channels: Channels,
    message_count: usize,
    /// Bytes that the chunks may still have after decompression.
    bytes_left: u64,
    search: SlowSearch,
}

impl Scanner<'_> {
    fn note_damage(&mut self, what: String) {
        self.found.damage.get_or_insert(what);
    }

    /// Scans records up to `end`; `chunk` is the number of the compressed chunk that they are in.
    fn scan_records(&mut self, reader: &mut (impl Read + Seek), at: &mut u64, end: u64, chunk: Option<u32>) -> End {
        // End of the chunk without compression that these records are in.
        let mut chunk_end = None;
        while *at < end {
            self.search.warn_if_slow(self.name, "looking through the file");
            if end - *at < HEAD_BYTES {
                return Err(Damage::Fault(CUT.to_owned()));
            }
            chunk_end = chunk_end.filter(|&chunk_end| *at < chunk_end);
            let mut head = [0; HEAD_BYTES as usize];
            reader.read_exact(&mut head)?;
            let (content_at, length) = (*at + HEAD_BYTES, Fields::packed(&head[1..]).u64().unwrap_or_default());
            let next = content_at.saturating_add(length);
            let is_chunk = head[0] == CHUNK && chunk.is_none() && chunk_end.is_none();
            // No record has the code 0: a file that was not written to its end may go on with zeros.
            if head[0] == 0 || next > chunk_end.unwrap_or(end).min(end) && !is_chunk {
                let what = if head[0] == 0 { "something that is no record" } else { CUT };
                let Some(chunk_end) = chunk_end.take().filter(|&chunk_end| chunk_end <= end) else {
                    return Err(Damage::Fault(what.to_owned()));
                };
                // What follows the chunk can be read.
                self.note_damage(format!("{what} at byte {at}"));
                // The record may begin before the end of the chunk, and its content behind.
                reader.seek_relative(chunk_end as i64 - content_at as i64)?;
                *at = chunk_end;
                continue;
            }
            let mut read = content_at;
            match head[0] {
                // The rest of the file repeats what came before.
                DATA_END if chunk.is_none() => return Ok(()),
                CHUNK if is_chunk => {
                    // Without compression, its records follow as if there were no chunk.
                    if let Some(records_at) = self.scan_chunk(reader, content_at, next, end)? {
                        (*at, chunk_end) = (records_at, Some(next));
                        continue;
                    }
                    read = next;
                }
                SCHEMA | CHANNEL if length <= MAX_DEFINITION_BYTES => {
                    self.scan_definition(reader, head[0], length, *at)?;
                    read = next;
                }
                MESSAGE => read += self.scan_message(reader, content_at, length, chunk)?,
                _ => {}
            }
            reader.seek_relative((next - read) as i64)?;
            *at = next;
        }
        match chunk {
            Some(_) => Ok(()),
            None => Err(Damage::Fault("the end of the file is missing".to_owned())),
        }
    }

    /// Notes a schema or a channel.
    fn scan_definition(&mut self, reader: &mut impl Read, code: u8, length: u64, at: u64) -> End {
        let mut content = vec![0; length as usize];
        reader.read_exact(&mut content)?;
        let defined = match code {
            SCHEMA => self.channels.define_schema(&content),
            _ => self.channels.define(&content, &mut self.found),
        };
        if self.found.topics.len() > MAX_TOPICS {
            return Err(Damage::Fault(format!("more than {MAX_TOPICS} topics with pictures")));
        }
        if defined.is_none() {
            self.note_damage(format!("a schema or channel at byte {at} is damaged"));
        }
        Ok(())
    }

    /// Notes a message with a picture; returns the number of bytes read.
    fn scan_message(
        &mut self,
        reader: &mut impl Read,
        at: u64,
        length: u64,
        chunk: Option<u32>,
    ) -> Result<u64, Damage> {
        let mut bytes = [0; MESSAGE_HEAD_BYTES as usize + Preview::BYTES];
        let mut read = length.min(MESSAGE_HEAD_BYTES) as usize;
        reader.read_exact(&mut bytes[..read])?;
        let mut fields = Fields::packed(&bytes[..read]);
        let (Some(channel), Some(_), Some(log_ns)) = (fields.u16(), fields.u32(), fields.u64()) else {
            self.note_damage(format!("a message at byte {at} is too short"));
            return Ok(read as u64);
        };
        let Some(length) = length.checked_sub(MESSAGE_HEAD_BYTES) else { return Ok(read as u64) };
        let Some(topic) = self.channels.topic(channel) else {
            return Ok(read as u64 + self.scan_cameras(reader, channel, length)?);
        };
        let previewed = length.min(Preview::BYTES as u64) as usize;
        reader.read_exact(&mut bytes[read..read + previewed])?;
        read += previewed;
        let topic = &mut self.found.topics[topic];
        match Preview::parse(&bytes[MESSAGE_HEAD_BYTES as usize..read], topic.kind, topic.encoding) {
            Some(preview) if length <= MAX_MESSAGE_BYTES => {
                self.message_count += 1;
                if self.message_count > MAX_ENTRIES {
                    return Err(Damage::Fault(format!("more than {MAX_ENTRIES} pictures; split the file")));
                }
                let message = Message {
                    stamp_ns: preview.stamp_ns,
                    log_ns,
                    at: at + MESSAGE_HEAD_BYTES,
                    length: length as u32,
                    chunk,
                };
                topic.add(message, &preview);
            }
            _ => {
                let what = format!("a message of {topic} at byte {at} is damaged");
                self.note_damage(what);
            }
        }
        Ok(read as u64)
    }

    /// Reads a message that may describe cameras; returns the number of bytes read.
    fn scan_cameras(&mut self, reader: &mut impl Read, channel: u16, length: u64) -> Result<u64, Damage> {
        let Some((topic, kind, encoding)) = self.channels.camera(channel) else { return Ok(0) };
        let cameras = &mut self.found.cameras;
        if length > cameras::MAX_BYTES || cameras.knows(topic, *kind) {
            return Ok(0);
        }
        let mut bytes = vec![0; length as usize];
        reader.read_exact(&mut bytes)?;
        if cameras.add(topic, *kind, *encoding, &bytes).is_none() {
            let what = format!("a message of {} is damaged", topic.escape_debug());
            self.note_damage(what);
        }
        Ok(length)
    }

    /// Scans a chunk whose record has its content from `at` to `next`. Returns the position of its records in the file
    /// if they are not compressed.
    fn scan_chunk(
        &mut self,
        reader: &mut (impl Read + Seek),
        at: u64,
        next: u64,
        end: u64,
    ) -> Result<Option<u64>, Damage> {
        let mut head = [0; CHUNK_HEAD_BYTES as usize];
        reader.read_exact(&mut head)?;
        // After two times (16 bytes): decompressed bytes, their CRC-32, and the length of the compression's name, which
        // follows, with the length of the records.
        let mut fields = Fields::packed(&head[16..]);
        let (bytes, crc) = (fields.u64().unwrap_or_default(), fields.u32().unwrap_or_default());
        let name_bytes = fields.u32().unwrap_or_default() as usize;
        let mut name = vec![0; name_bytes.min(MAX_COMPRESSION_BYTES) + 8];
        reader.read_exact(&mut name)?;
        let coded_bytes = Fields::packed(&name.split_off(name.len() - 8)).u64().unwrap_or_default();
        let coded_at = at + CHUNK_HEAD_BYTES + name.len() as u64 + 8;
        let is_whole = name_bytes <= MAX_COMPRESSION_BYTES && coded_at.checked_add(coded_bytes) == Some(next);
        if is_whole && name.is_empty() {
            return Ok(Some(coded_at));
        }
        if next > end {
            return Err(Damage::Fault(CUT.to_owned()));
        }
        if !is_whole {
            self.note_damage(format!("the chunk at byte {at} is left out: its lengths contradict each other"));
            reader.seek(io::SeekFrom::Start(next))?;
            return Ok(None);
        }
        self.bytes_left = self.bytes_left.checked_sub(bytes).ok_or_else(|| {
            Damage::Fault(format!("its chunks are compressed to less than a {MAX_RATIO}th, as no recording is"))
        })?;
        let chunk = Chunk::new(&String::from_utf8_lossy(&name), coded_at, coded_bytes, bytes, crc);
        if let Err(fault) = chunk.and_then(|chunk| self.scan_compressed(chunk, at)) {
            // The chunks after it can be read.
            self.note_damage(format!("the chunk at byte {at} is left out: {fault}"));
        }
        reader.seek(io::SeekFrom::Start(next))?;
        Ok(None)
    }

    /// Decompresses a chunk, whose record has its content at `at`, and scans its records.
    fn scan_compressed(&mut self, chunk: Chunk, at: u64) -> Result<(), PictureFault> {
        let records = chunk.read(self.file)?;
        let number = self.found.chunks.len() as u32;
        self.found.chunks.push(chunk);
        let scanned = self.scan_records(&mut Cursor::new(&records), &mut 0, records.len() as u64, Some(number));
        if let Err(Damage::Fault(what)) = scanned {
            self.note_damage(format!("{what} in the chunk at byte {at}"));
        }
        Ok(())
    }
}
