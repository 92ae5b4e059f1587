//! Compressed parts of a file, and a cache of them.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::os::unix::fs::FileExt;
use std::sync::{Arc, Mutex, PoisonError};

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use crate::recording::decoders::guard;
use crate::recording::fault::PictureFault;

/// Largest chunk that is decompressed: far more than recorders collect, and enough for the largest picture.
const MAX_CHUNK_BYTES: u64 = 320 << 20;

/// Number of chunks that are kept: colour and depth of a frame may be in neighbouring ones.
const MAX_CACHED: usize = 2;

/// A compressed chunk.
#[derive(Debug)]
pub(super) struct Chunk {
    compression: Compression,
    /// Position of the compressed bytes in the file.
    at: u64,
    coded_bytes: u64,
    bytes: u64,
    /// Checksum of the decompressed bytes (CRC-32); 0 if it is not stated.
    crc: u32,
}

#[derive(Clone, Copy, Debug)]
enum Compression {
    Lz4,
    Zstd,
}

impl Chunk {
    /// Creates a chunk that claims `bytes` bytes after decompression.
    ///
    /// # Errors
    /// The compression is unknown, or there are too many bytes.
    pub fn new(compression: &str, at: u64, coded_bytes: u64, bytes: u64, crc: u32) -> Result<Self, PictureFault> {
        let compression = match compression {
            "lz4" => Compression::Lz4,
            "zstd" => Compression::Zstd,
            other => return Err(PictureFault::Unsupported(format!("compression {other:?}"))),
        };
        match bytes {
            0..=MAX_CHUNK_BYTES => Ok(Self { compression, at, coded_bytes, bytes, crc }),
            _ => Err(PictureFault::FileSize { bytes, max_bytes: MAX_CHUNK_BYTES }),
        }
    }

    /// Decompresses the chunk.
    ///
    /// # Errors
    /// The file cannot be read, or the chunk is damaged.
    pub fn read(&self, file: &File) -> Result<Vec<u8>, PictureFault> {
        let mut coded = BufReader::new(Part { file, at: self.at, end: self.at + self.coded_bytes });
        let mut bytes = Vec::new();
        let damaged = |what: &str| PictureFault::Damaged(what.replace('\n', " "));
        guard(|| {
            let read = match self.compression {
                Compression::Lz4 => FrameDecoder::new(coded).take(self.bytes + 1).read_to_end(&mut bytes),
                Compression::Zstd => StreamingDecoder::new(&mut coded)
                    .map_err(|error| io::Error::other(error.to_string()))
                    .and_then(|decoder| decoder.take(self.bytes + 1).read_to_end(&mut bytes)),
            };
            read.map_err(|error| damaged(&error.to_string()))
        })?;
        if bytes.len() as u64 != self.bytes {
            return Err(damaged("its length is wrong"));
        }
        if self.crc != 0 && crc32fast::hash(&bytes) != self.crc {
            return Err(damaged("its checksum is wrong"));
        }
        Ok(bytes)
    }
}

/// A part of a file, read without moving the position that threads share.
struct Part<'a> {
    file: &'a File,
    at: u64,
    end: u64,
}

impl Read for Part<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let most = into.len().min(usize::try_from(self.end - self.at).unwrap_or(usize::MAX));
        let read = self.file.read_at(&mut into[..most], self.at)?;
        self.at += read as u64;
        Ok(read)
    }
}

/// The chunks read last, the newest first. Threads share it; none waits while another one decompresses.
#[derive(Debug, Default)]
pub(super) struct ChunkCache(Mutex<Vec<(u32, Arc<Vec<u8>>)>>);

impl ChunkCache {
    /// Returns the bytes of a chunk.
    ///
    /// # Errors
    /// Same as for [`Chunk::read`].
    pub fn read(&self, chunks: &[Chunk], number: u32, file: &File) -> Result<Arc<Vec<u8>>, PictureFault> {
        let cached = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, bytes)) = cached().iter().find(|(cached, _)| *cached == number) {
            return Ok(Arc::clone(bytes));
        }
        let bytes = Arc::new(chunks[number as usize].read(file)?);
        let mut cached = cached();
        cached.insert(0, (number, Arc::clone(&bytes)));
        cached.truncate(MAX_CACHED);
        Ok(bytes)
    }
}
