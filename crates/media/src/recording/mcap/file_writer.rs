//! Writes the records of an MCAP file: chunks without compression, with an index of their messages, and a summary.
//!
//! The crate `mcap` does this, too, but brings `binrw`, `enumset`, `bimap` and what they need, and its readers do not fit:
//! they read every byte of a file to find the times of its pictures.

use std::collections::BTreeMap;
use std::io::{self, Write};

use super::scan::{CHANNEL, CHUNK, DATA_END, MAGIC, MESSAGE, SCHEMA};

/// Operation codes of records that are not read.
const HEADER: u8 = 1;
const FOOTER: u8 = 2;
const MESSAGE_INDEX: u8 = 7;
const CHUNK_INDEX: u8 = 8;
const STATISTICS: u8 = 11;

/// Bytes of messages that are collected in a chunk: some frames, so that a reader can jump.
const CHUNK_BYTES: usize = 4 << 20;
/// Length of a chunk in nanoseconds: what is lost at most if the program is killed.
const CHUNK_NS: u64 = 500_000_000;

/// First and last time in nanoseconds.
type TimeRange = (u64, u64);

/// A file under construction.
pub(super) struct FileWriter<W> {
    stream: W,
    /// Bytes written so far.
    position: u64,
    /// Records of the chunk that is collected, the times of its messages, and time and position of those by channel.
    chunk: Vec<u8>,
    chunk_times: Option<TimeRange>,
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    /// Records of the summary: schemas and channels, and the chunks.
    definitions: Vec<u8>,
    chunks: Vec<u8>,
    chunk_count: u32,
    /// The number of schemas, and of messages by channel.
    schema_count: u16,
    message_counts: BTreeMap<u16, u64>,
    times: Option<TimeRange>,
}

impl<W: Write> FileWriter<W> {
    /// Begins a file of a profile, such as `ros2`.
    pub fn begin(mut stream: W, profile: &str, library: &str) -> io::Result<Self> {
        let mut start = MAGIC.to_vec();
        add_record(&mut start, HEADER, &[&text(profile), &text(library)]);
        stream.write_all(&start)?;
        Ok(Self {
            stream,
            position: start.len() as u64,
            chunk: Vec::new(),
            chunk_times: None,
            index: BTreeMap::new(),
            definitions: Vec::new(),
            chunks: Vec::new(),
            chunk_count: 0,
            schema_count: 0,
            message_counts: BTreeMap::new(),
            times: None,
        })
    }

    /// Adds a message definition of ROS 2; returns its number.
    pub fn add_schema(&mut self, name: &str, definition: &str) -> u16 {
        self.schema_count += 1;
        let content = [&self.schema_count.to_le_bytes()[..], &text(name), &text("ros2msg"), &text(definition)];
        self.define(SCHEMA, &content);
        self.schema_count
    }

    /// Adds a topic of messages in CDR; returns the number of its channel.
    pub fn add_channel(&mut self, topic: &str, schema: u16) -> u16 {
        let channel = self.message_counts.len() as u16 + 1;
        self.message_counts.insert(channel, 0);
        let no_metadata = 0_u32.to_le_bytes();
        let content = [&channel.to_le_bytes()[..], &schema.to_le_bytes(), &text(topic), &text("cdr"), &no_metadata];
        self.define(CHANNEL, &content);
        channel
    }

    fn define(&mut self, code: u8, content: &[&[u8]]) {
        add_record(&mut self.definitions, code, content);
        add_record(&mut self.chunk, code, content);
    }

    /// Adds a message to a channel.
    ///
    /// # Errors
    /// The stream cannot be written.
    pub fn write_message(&mut self, channel: u16, sequence: u32, time_ns: u64, message: &[u8]) -> io::Result<()> {
        let time = time_ns.to_le_bytes();
        let at = self.chunk.len() as u64;
        add_record(&mut self.chunk, MESSAGE, &[&channel.to_le_bytes(), &sequence.to_le_bytes(), &time, &time, message]);
        self.index.entry(channel).or_default().push((time_ns, at));
        *self.message_counts.entry(channel).or_default() += 1;
        for times in [&mut self.chunk_times, &mut self.times] {
            let (first, last) = times.unwrap_or((time_ns, time_ns));
            *times = Some((first.min(time_ns), last.max(time_ns)));
        }
        let (first, last) = self.chunk_times.unwrap_or_default();
        // The first one is short, so that there is something to keep from the beginning.
        let is_full = self.chunk.len() > CHUNK_BYTES || last - first >= CHUNK_NS || self.chunk_count == 0;
        if is_full { self.write_chunk() } else { Ok(()) }
    }

    /// Writes the collected messages as a chunk without compression, and their index.
    fn write_chunk(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let (first, last) = self.chunk_times.take().unwrap_or_default();
        let [first, last, bytes] = [first, last, self.chunk.len() as u64].map(u64::to_le_bytes);
        let crc = crc32fast::hash(&self.chunk).to_le_bytes();
        let no_compression = text("");
        let (chunk_at, mut record) = (self.position, Vec::new());
        add_record(&mut record, CHUNK, &[&first, &last, &bytes, &crc, &no_compression, &bytes, &self.chunk]);
        let chunk_bytes = record.len() as u64;
        let mut offsets = Vec::new();
        for (channel, entries) in std::mem::take(&mut self.index) {
            offsets.extend(channel.to_le_bytes());
            offsets.extend((chunk_at + record.len() as u64).to_le_bytes());
            let entries: Vec<u8> =
                entries.iter().flat_map(|&(time, at)| [time, at]).flat_map(u64::to_le_bytes).collect();
            add_record(&mut record, MESSAGE_INDEX, &[&channel.to_le_bytes(), &length(&entries), &entries]);
        }
        let [at, coded, indexed] = [chunk_at, chunk_bytes, record.len() as u64 - chunk_bytes].map(u64::to_le_bytes);
        let content =
            [&first[..], &last, &at, &coded, &length(&offsets), &offsets, &indexed, &no_compression, &bytes, &bytes];
        add_record(&mut self.chunks, CHUNK_INDEX, &content);
        self.chunk_count += 1;
        self.chunk.clear();
        self.write(&record)?;
        self.stream.flush()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.stream.write_all(bytes)
    }

    /// Writes the rest, and the summary.
    ///
    /// # Errors
    /// The stream cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.write_chunk()?;
        let mut end = Vec::new();
        // Without a checksum of all that was written.
        add_record(&mut end, DATA_END, &[&0_u32.to_le_bytes()]);
        self.write(&end)?;

        let (first, last) = self.times.unwrap_or_default();
        let counts: Vec<u8> = self
            .message_counts
            .iter()
            .flat_map(|(channel, count)| [&channel.to_le_bytes()[..], &count.to_le_bytes()].concat())
            .collect();
        let [messages, first, last] = [self.message_counts.values().sum(), first, last].map(u64::to_le_bytes);
        // Channels, attachments, metadata, chunks.
        let numbers = [self.message_counts.len() as u32, 0, 0, self.chunk_count].map(u32::to_le_bytes);
        let schemas = self.schema_count.to_le_bytes();
        let mut summary = std::mem::take(&mut self.definitions);
        let content = [&messages[..], &schemas, numbers.as_flattened(), &first, &last, &length(&counts), &counts];
        add_record(&mut summary, STATISTICS, &content);
        summary.append(&mut self.chunks);

        // The checksum covers the summary, and the footer up to itself.
        let mut footer = Vec::new();
        add_record(&mut footer, FOOTER, &[&self.position.to_le_bytes(), &0_u64.to_le_bytes(), &0_u32.to_le_bytes()]);
        footer.truncate(footer.len() - 4);
        summary.extend(footer);
        summary.extend(crc32fast::hash(&summary).to_le_bytes());
        summary.extend(MAGIC);
        self.write(&summary)?;
        self.stream.flush()
    }
}

/// Appends a record to `into`.
fn add_record(into: &mut Vec<u8>, code: u8, content: &[&[u8]]) {
    into.push(code);
    into.extend(content.iter().map(|part| part.len() as u64).sum::<u64>().to_le_bytes());
    content.iter().for_each(|part| into.extend(*part));
}

fn length(bytes: &[u8]) -> [u8; 4] {
    (bytes.len() as u32).to_le_bytes()
}

fn text(text: &str) -> Vec<u8> {
    [&length(text.as_bytes()), text.as_bytes()].concat()
}
