//! Runs the fuzz targets on their seeds and 200 deterministic mutations of each: the part of `scripts/fuzz` that needs
//! no nightly toolchain.
#![allow(missing_docs)]

#[path = "../../../../fuzz/src/lib.rs"]
#[allow(dead_code)]
mod promises;
use std::fs;
use std::path::Path;

/// Mutations per seed.
const MUTATIONS: u64 = 200;

/// Tokens that are significant to at least one parser.
const TELLING: [&[u8]; 16] = [
    b"\n",
    b" ",
    b"-",
    b"\"",
    b"1e400",
    b"nan",
    b"4294967296",
    b"18446744073709551615",
    b"../",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xff\xd8",
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"[[",
];

/// A deterministic pseudo-random generator (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % end.max(1) as u64) as usize
    }
}

/// Applies one to four typical corruptions.
fn mutation(seed: &[u8], other: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut data = seed.to_vec();
    for _ in 0..=numbers.below(4) {
        let at = numbers.below(data.len() + 1);
        let end = (at + 1 + numbers.below(16)).min(data.len());
        match numbers.below(7) {
            0 => data.truncate(at),
            1 => drop(data.drain(at..end)),
            2 => drop(data.splice(at..at, TELLING[numbers.below(TELLING.len())].iter().copied())),
            3 => drop(data.splice(at..end, TELLING[numbers.below(TELLING.len())].iter().copied())),
            4 => {
                let again = data[at..end].to_vec();
                drop(data.splice(at..at, again));
            }
            5 => {
                let from = numbers.below(other.len() + 1);
                data.truncate(at);
                data.extend_from_slice(&other[from..]);
            }
            _ => {
                if let Some(byte) = data.get_mut(at) {
                    *byte ^= 1 << numbers.below(8);
                }
            }
        }
    }
    data
}

/// Runs a target on its seeds and their mutations; saves and names the input of a panic.
fn holds(name: &str) {
    let (_, target) = promises::TARGETS.into_iter().find(|target| target.0 == name).unwrap();
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/seeds")).join(name);
    let mut seeds: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    seeds.sort();
    assert!(!seeds.is_empty(), "{} is empty", folder.display());
    let contents: Vec<Vec<u8>> = seeds.iter().map(|path| fs::read(path).unwrap()).collect();
    let mut numbers = Numbers(7);
    for (seed, path) in contents.iter().zip(&seeds) {
        for mutated in 0..=MUTATIONS {
            let other = &contents[numbers.below(contents.len())];
            let data = if mutated == 0 { seed.clone() } else { mutation(seed, other, &mut numbers) };
            if std::panic::catch_unwind(|| target(&data)).is_err() {
                let kept = std::env::temp_dir().join(format!("bokehcam-fuzz-{name}"));
                fs::write(&kept, &data).unwrap();
                panic!("mutation {mutated} of {} panics: it is kept as {}", path.display(), kept.display());
            }
        }
    }
}

macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            holds(stringify!($name));
        })*

        #[test]
        fn every_target_is_here_and_has_a_binary() {
            let manifest = include_str!("../../../../fuzz/Cargo.toml");
            assert_eq!(promises::TARGETS.map(|target| target.0), [$(stringify!($name)),*]);
            for name in [$(stringify!($name)),*] {
                assert!(manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\"")), "{name}");
            }
        }
    };
}

targets! { calibration command_line depth_calibration depth_map embedded_depth mjpeg picture raw_pixels recording recording_file settings snapshot }
