//! MCAP files that claim or become more than any recording has, or other than they state.

use bokehcam_media::recording::Options;

use super::super::{Scene, assert_says};
use super::{CAMERA, LZ4, TestTopic, ZSTD, open, record, text, unchunked};

#[test]
fn a_file_of_too_many_topics_is_refused() {
    let scene = Scene::new();
    let names: Vec<String> = (0..1001).map(|number| format!("/camera{number}/image_raw")).collect();
    let topics: Vec<TestTopic> = names.iter().map(|name| (&**name, "rgb8", 1, &[0_u32][..])).collect();
    let said = ["take.mcap", "more than 1000 topics with pictures"];
    assert_says(open(&scene, "take.mcap", &unchunked(&topics, false), &Options::default()), &said);
    // Those without pictures do no harm.
    let mut file = unchunked(&CAMERA, false);
    file.extend(record(3, &[&9_u16.to_le_bytes(), &text("std_msgs/msg/String"), &text(""), &text("")]));
    for id in 10..u16::MAX {
        let ids = [id.to_le_bytes(), 9_u16.to_le_bytes()].concat();
        file.extend(record(4, &[&ids, &text(&format!("/text{id}")), &text("cdr"), &0_u32.to_le_bytes()]));
    }
    assert_eq!(open(&scene, "take.mcap", &file, &Options::default()).unwrap().len(), 3);
}

/// Returns a chunk with a record of `blocks` times 128 KiB, compressed by Zstandard (RFC 8878) to a few bytes.
fn bomb(blocks: u32) -> Vec<u8> {
    const BLOCK_BYTES: u32 = 128 << 10;
    let length = u64::from(blocks) * u64::from(BLOCK_BYTES);
    // The magic number, no stated length, a window of one block; then the record's head, as it is.
    let mut coded = vec![0x28, 0xB5, 0x2F, 0xFD, 0x00, 0x38, 9 << 3, 0, 0, 0x80];
    coded.extend(length.to_le_bytes());
    for block in 1..=blocks {
        // One byte, repeated; the last block is marked.
        let head = u32::from(block == blocks) | 1 << 1 | BLOCK_BYTES << 3;
        coded.extend(&head.to_le_bytes()[..3]);
        coded.push(0);
    }
    let [times, bytes, coded_bytes] = [0, 9 + length, coded.len() as u64].map(u64::to_le_bytes);
    record(6, &[&times, &times, &bytes, &[0; 4], &text("zstd"), &coded_bytes, &coded])
}

#[test]
fn chunks_that_grow_without_end_are_refused() {
    let scene = Scene::new();
    let fault = |bombs: usize| {
        let mut file = unchunked(&[], false);
        (0..bombs).for_each(|_| file.extend(bomb(2000)));
        open(&scene, "take.mcap", &file, &Options::default()).unwrap_err().to_string()
    };
    assert!(fault(300).contains("its chunks are compressed to less than a 200th"), "{}", fault(300));
    assert!(!fault(1).contains("compressed"), "{}", fault(1));
}

#[test]
fn a_compressed_chunk_that_is_not_what_its_record_states_is_left_out() {
    let scene = Scene::new();
    for file in [LZ4, ZSTD] {
        let chunk = file.windows(4).position(|bytes| bytes == b"lz4\x05" || bytes == b"zstd").unwrap();
        // The record states length and checksum before the name's length and the name.
        for (at, fault) in [(chunk - 16, "its length is wrong"), (chunk - 8, "its checksum is wrong")] {
            for change in [1, 0xFF] {
                let mut other = file.to_vec();
                other[at] = other[at].wrapping_add(change);
                let parts = ["no topics", "the chunk at byte 79 is left out", fault];
                assert_says(open(&scene, "take.mcap", &other, &Options::default()), &parts);
            }
        }
    }
}
