//! Depth maps compressed as RVL (A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017), as
//! `compressed_depth_image_transport` writes them: width and height, then runs of zeros and of differences, each number
//! in groups of three bits with a flag for more.

use crate::recording::decode::DepthUnits;
use crate::recording::decoders::check_size;
use crate::recording::fault::{PictureFault, ReadResult};
use bokehcam::frame::DepthMap;

/// Decodes a map to metres.
pub(super) fn decode_depth(bytes: &[u8], units: DepthUnits, into: &mut DepthMap) -> ReadResult {
    let (sides, coded) = bytes.split_first_chunk::<8>().ok_or(PictureFault::Truncated)?;
    let [width, height] = [0, 4].map(|at| u32::from_le_bytes([sides[at], sides[at + 1], sides[at + 2], sides[at + 3]]));
    check_size(width, height)?;
    into.resize(width, height);
    let mut numbers = Numbers { words: coded.as_chunks().0, word: 0, nibbles: 0 };
    let mut rest = &mut into.metres[..];
    let mut value = 0_i32;
    while !rest.is_empty() {
        for is_known in [false, true] {
            let count = numbers.next().ok_or(PictureFault::Truncated)? as usize;
            let left = rest.len();
            let too_long = || PictureFault::Damaged(format!("a run of {count} depths, and {left} are left"));
            let (run, after) = rest.split_at_mut_checked(count).ok_or_else(too_long)?;
            for metres in run {
                *metres = if is_known {
                    let number = numbers.next().ok_or(PictureFault::Truncated)?;
                    // Zigzag: the lowest bit is the sign.
                    value = value.wrapping_add((number >> 1) as i32 ^ -((number & 1) as i32));
                    units.to_metres((value as u16).to_be_bytes())
                } else {
                    0.0
                };
            }
            rest = after;
        }
    }
    Ok(())
}

/// Numbers of a variable number of groups; the first group of a word is in its highest bits.
struct Numbers<'a> {
    words: &'a [[u8; 4]],
    word: u32,
    /// Groups left in `word`.
    nibbles: u32,
}

impl Numbers<'_> {
    fn next(&mut self) -> Option<u32> {
        let (mut number, mut shift) = (0_u32, 0);
        loop {
            if self.nibbles == 0 {
                let (word, words) = self.words.split_first()?;
                (self.word, self.words, self.nibbles) = (u32::from_le_bytes(*word), words, 8);
            }
            let nibble = self.word >> 28;
            (self.word, self.nibbles) = (self.word << 4, self.nibbles - 1);
            number |= (nibble & 7).checked_shl(shift)?;
            shift += 3;
            if nibble & 8 == 0 {
                return Some(number);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodes depths as the paper's program does.
    fn encode(width: u32, depths: &[u16]) -> Vec<u8> {
        let mut nibbles = Vec::new();
        let mut put = |mut number: u32| loop {
            let more = u8::from(number > 7) << 3;
            nibbles.push((number & 7) as u8 | more);
            number >>= 3;
            if more == 0 {
                break;
            }
        };
        let (mut at, mut previous) = (0, 0);
        while at < depths.len() {
            let run = |at: usize, is_known: bool| depths[at..].iter().take_while(|&&d| (d > 0) == is_known).count();
            let zeros = run(at, false);
            let known = run(at + zeros, true);
            put(zeros as u32);
            put(known as u32);
            for &depth in &depths[at + zeros..][..known] {
                let difference = i32::from(depth) - previous;
                put(((difference << 1) ^ (difference >> 31)) as u32);
                previous = i32::from(depth);
            }
            at += zeros + known;
        }
        nibbles.resize(nibbles.len().next_multiple_of(8), 0);
        let words = nibbles.chunks(8).map(|word| word.iter().fold(0, |word, &nibble| word << 4 | u32::from(nibble)));
        let sides = [width, depths.len() as u32 / width];
        sides.into_iter().chain(words).flat_map(u32::to_le_bytes).collect()
    }

    #[test]
    fn depths_come_back_and_damage_is_refused() {
        let depths: Vec<u16> = (0..64_u16).map(|k| if k % 7 < 2 { 0 } else { k * k * 11 + 1 }).collect();
        let coded = encode(8, &depths);
        let units = DepthUnits { scale: 1.0, invalid: None };
        let mut map = DepthMap::default();
        let mut decode = |bytes: &[u8]| decode_depth(bytes, units, &mut map).map(|()| map.metres.clone());
        assert_eq!(decode(&coded).unwrap(), depths.iter().map(|&depth| f32::from(depth)).collect::<Vec<_>>());
        for end in 0..coded.len() - 8 {
            assert!(decode(&coded[..end]).is_err(), "cut at {end}");
        }
        assert!(matches!(decode(&[&coded[..8], &[0xFF; 64]].concat()), Err(PictureFault::Truncated)));
        assert!(matches!(decode(&[&coded[..8], &[0, 0, 0, 0xF7]].concat()), Err(PictureFault::Truncated)));
        assert!(matches!(decode(&[&coded[..8], &[0xFF, 0xFF, 0x17, 0xFF]].concat()), Err(PictureFault::Damaged(_))));
    }
}
