//! Resource limits for untrusted files: memory stays within the stated bounds, and only regular files are read.
#![allow(missing_docs, unsafe_code)]

#[path = "../common/program.rs"]
mod program;

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::embedded::find;
use bokehcam_media::recording::geometry::Geometry;
use bokehcam_media::recording::still::{read_color, read_depth, read_grey, write_color};
use bokehcam_media::recording::{Options, Recording, RecordingError};
use tempfile::TempDir;

use program::{Home, Ran};

/// An allocator that tracks current and peak usage, in bytes.
struct Counting;

static TAKEN: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn took(bytes: usize) {
    let taken = TAKEN.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(taken, Ordering::Relaxed);
}

// SAFETY: every call is forwarded to the system's allocator; the counters do not touch its memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        took(layout.size());
        // SAFETY: the caller upholds the contract of the forwarded call.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of the forwarded call.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        took(size);
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller upholds the contract of the forwarded call.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Serialises the tests, because parallel allocations would be counted as well.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// Returns the peak memory that `work` allocates, in bytes, and its result.
fn most_bytes<T>(work: impl FnOnce() -> T) -> (usize, T) {
    let before = TAKEN.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = work();
    (PEAK.load(Ordering::Relaxed).saturating_sub(before), result)
}

const MIB: usize = 1 << 20;

#[track_caller]
fn assert_says<T>(result: Result<T, impl ToString>, says: &str) {
    let said = result.err().expect("an error").to_string();
    assert!(said.contains(says) && !said.contains('\n'), "{said}");
}

/// Saves a uniform 16-bit picture, which is small on disk.
fn save_wide(path: &Path, side_px: u32, color: png::ColorType) {
    let mut encoder = png::Encoder::new(File::create(path).unwrap(), side_px, side_px);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().unwrap();
    let mut rows = writer.stream_writer().unwrap();
    let row = vec![0x40; side_px as usize * color.samples() * 2];
    (0..side_px).for_each(|_| rows.write_all(&row).unwrap());
    rows.finish().unwrap();
}

#[test]
fn a_picture_takes_what_its_pixels_take() {
    let _alone = alone();
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("wide.png");
    let side_px = 2048;
    let rgb_bytes = 3 * side_px as usize * side_px as usize;
    save_wide(&path, side_px, png::ColorType::Rgba);
    assert!(fs::metadata(&path).unwrap().len() < 2 * MIB as u64);
    let (most, image) = most_bytes(|| read_color(&path).unwrap());
    // A quarter of 0x40 over white.
    assert!(image.rgb.iter().all(|&byte| byte == 0xcf), "{}", image.rgb[0]);
    assert!(most < rgb_bytes + MIB, "{most} bytes for {rgb_bytes}");
    let (most, grey) = most_bytes(|| read_grey(&path).unwrap());
    assert!(most < 4 * grey.2.len() + MIB, "{most} bytes");
    save_wide(&path, side_px, png::ColorType::Grayscale);
    let (most, map) = most_bytes(|| read_depth(&path, 5000.0, None).unwrap());
    assert!(most < 4 * map.metres.len() + MIB, "{most} bytes");

    let path = dir.path().join("photo.jpg");
    write_color(&path, &ColorImage::new(side_px, side_px), false).unwrap();
    let (most, _) = most_bytes(|| read_color(&path).unwrap());
    assert!(most < 4 * rgb_bytes, "{most} bytes for {rgb_bytes}");
}

/// Depth inside a photo takes what the documentation of `recording::embedded` states, whatever its packet is made of.
#[test]
fn depth_inside_a_photo_takes_a_few_times_the_file() {
    let _alone = alone();
    let name = b"http://ns.adobe.com/xmp/extension/\0";
    let photo = |packet: &str| {
        let mut file = b"\xff\xd8".to_vec();
        for (index, piece) in packet.as_bytes().chunks(60_000).enumerate() {
            let claim = [packet.len() as u32, index as u32 * 60_000].map(u32::to_be_bytes).concat();
            let length = (2 + name.len() + 32 + claim.len() + piece.len()) as u16;
            file.extend([b"\xff\xe1".as_slice(), &length.to_be_bytes(), name, &[b'0'; 32], &claim, piece].concat());
        }
        file
    };
    let namespace = "xmlns:GDepth='http://ns.google.com/photos/1.0/depthmap/'";
    let map = "A".repeat(16 * MIB);
    for (packet, is_fault) in [
        (
            format!("<x {namespace} GDepth:Format='RangeInverse' GDepth:Near='1' GDepth:Far='2' GDepth:Data='{map}'/>"),
            true,
        ),
        (format!("<x {namespace} GDepth:Data='{}'/>", "&#65;".repeat(3 * MIB)), true),
        (format!("<x {namespace}>{}</x>", "<a b=''/>".repeat(2 * MIB)), true),
        (format!("<x {namespace}>{}</x>", "<a b=''/>".repeat(3000)), false),
    ] {
        let file = photo(&packet);
        let (most, found) = most_bytes(|| find(&file));
        assert!(most <= 4 * file.len() + 10 * MIB, "{most} bytes for {}", file.len());
        assert_eq!(found.is_err(), is_fault);
    }
}

#[test]
fn a_file_is_known_by_its_first_bytes() {
    let _alone = alone();
    let dir = TempDir::new().unwrap();
    let begin = |name: &str, start: &[u8]| {
        let path = dir.path().join(name);
        let mut file = File::create(&path).unwrap();
        file.write_all(start).unwrap();
        // A sparse file, which uses no disk space.
        file.set_len(1 << 30).unwrap();
        path
    };
    for (name, start, says) in [
        ("zeros.png", &b""[..], "not a PNG, JPEG, TIFF, WebP, BMP, PNM or GIF file"),
        ("zeros.jpg", b"\xff\xd8\xff\xe0\0\x04", "no frame where one should be"),
        ("png.png", b"\x89PNG\r\n\x1a\n", "damaged"),
        ("zeros.pfm", b"", "not a PNG, JPEG, TIFF, PFM, PGM, NPY, NPZ or EXR file"),
        ("large.pfm", b"Pf\n4 4\n-1\n", "the file has 1073741824 bytes"),
    ] {
        let path = begin(name, start);
        let (most, read) = match name.ends_with("pfm") {
            true => most_bytes(|| read_depth(&path, 1.0, None).map(drop)),
            false => most_bytes(|| read_color(&path).map(drop)),
        };
        let said = read.unwrap_err().to_string();
        assert!(said.contains(says), "{said}");
        assert!(most < MIB, "{name}: {most} bytes");
    }
}

fn recording(lists: &[(&str, &str)]) -> TempDir {
    let dir = TempDir::new().unwrap();
    for (name, text) in lists {
        fs::write(dir.path().join(name), text).unwrap();
    }
    dir
}

fn open(dir: &TempDir) -> Result<Recording, RecordingError> {
    Recording::open(dir.path(), &Options { keep_going: true, ..Options::default() })
}

#[test]
fn lists_have_a_length_that_recordings_have() {
    let _alone = alone();
    let dir = recording(&[]);
    let list = File::create(dir.path().join("associations.txt")).unwrap();
    list.set_len(100 << 20).unwrap();
    let (most, refused) = most_bytes(|| open(&dir));
    assert_says(refused, "too large");
    assert!(most < MIB, "{most} bytes");

    let lines = "x\n".repeat(3 * MIB);
    for list in ["associations.txt", "rgb.txt"] {
        let dir = recording(&[(list, &lines)]);
        let (most, refused) = most_bytes(|| open(&dir));
        assert_says(refused, "more than 1000000 lines");
        assert!(most < 8 * MIB, "{most} bytes");
    }
}

/// Only headers are read, and an unreadable file is not tried again.
#[test]
fn a_file_that_many_lines_name_is_looked_at_once() {
    let _alone = alone();
    let lines: String = (0..50_000).map(|line| format!("{line} a.png {line} a.png\n")).collect();
    let dir = recording(&[("associations.txt", &lines)]);
    let file = File::create(dir.path().join("a.png")).unwrap();
    (&file).write_all(b"\x89PNG\r\n\x1a\n").unwrap();
    file.set_len(50 << 20).unwrap();
    let (most, refused) = most_bytes(|| open(&dir));
    assert_says(refused, "cannot tell colour from depth");
    assert!(most < 50 * MIB, "{most} bytes");
    let dir = recording(&[("rgb.txt", &lines.replace(" a.png\n", "\n").replace("a.png 1", "a.png"))]);
    assert!(open(&dir).is_err());
}

/// Reading a pipe would block, and a device never ends.
#[test]
fn only_files_are_read() {
    let _alone = alone();
    let dir = TempDir::new().unwrap();
    let pipe = dir.path().join("pipe");
    rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR).unwrap();
    for (target, what) in [(pipe.as_path(), "a pipe"), (Path::new("/dev/zero"), "a device")] {
        let folder = TempDir::new().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["rgb.txt", "left.yaml", "photo.png", "map.pfm", "calib.txt"] {
            symlink(target, at(name)).unwrap();
        }
        assert_says(open(&folder), what);
        assert_says(bokehcam_calibration::load_calibration(&[&at("left.yaml")]), what);
        assert_says(Geometry::read(&at("calib.txt"), &at("photo.png")), what);
        assert_says(read_color(&at("photo.png")), "not a regular file");
        assert_says(read_depth(&at("map.pfm"), 1.0, None), "not a regular file");
    }
}

#[test]
fn settings_are_a_file_of_a_sensible_size() {
    let _alone = alone();
    let home = Home::new();
    let at = |name: &str| home.path(name);
    let presets: String = (0..60_000).map(|n| format!("[presets.p{n}]\nrim = 0.1\n")).collect();
    fs::write(at("long.toml"), presets).unwrap();
    rustix::fs::mkfifoat(rustix::fs::CWD, at("pipe.toml"), rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR).unwrap();
    symlink("/dev/zero", at("zeros.toml")).unwrap();
    for (file, says) in
        [("long.toml", "it is too large"), ("pipe.toml", "it is a pipe"), ("zeros.toml", "it is a device")]
    {
        let ran = home.run(&["config", "dump", "--config", file]);
        assert_ne!(ran.code, 0);
        ran.refused(ran.code, &[file, says]);
    }
}

/// Blur and matching need many times the picture's memory, and a stream has several pictures in flight.
#[test]
fn a_picture_that_is_larger_than_memory_is_refused() {
    let _alone = alone();
    let home = Home::new();
    for name in ["wide.png", "right.png"] {
        save_wide(&home.path(name), 5000, png::ColorType::Grayscale);
    }
    let blur = "--effect blur --coc-at-infinity 2 --backend cpu";
    for (limit_kb, size, command) in [
        (1_500_000, "5000x5000", format!("render wide.png {blur} --out out.png")),
        (1_200_000, "5000x5000", "depth wide.png right.png --max-disparity 64 --backend cpu --out out.png".to_owned()),
        // A limit above the memory of one blur, and below that of a stream.
        (3_000_000, "5000x5000", format!("stream synthetic --size 5000x5000 {blur} --frames 1 --to out.y4m")),
    ] {
        let ran = Ran::of(&mut home.shell(&format!("ulimit -v {limit_kb};"), &command));
        ran.refused(1, &[size, "MB are free"]);
        assert!(!home.path("out.png").exists() && !home.path("out.y4m").exists());
    }
}
