//! Sinks: what they write, and that it appears whole or not at all.

use std::fs;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

use bokehcam::frame::ColorImage;
use bokehcam::sink::yuv::{Converter, Matrix};
use bokehcam::sink::{Options, Sink, SinkError, Target, Y4m};

const PERIOD_NS: u64 = 40_000_000;

fn options(size: (u32, u32)) -> Options {
    Options::new(size, PERIOD_NS)
}

fn flat(width: u32, height: u32, rgb: [u8; 3]) -> ColorImage {
    let mut image = ColorImage::new(width, height);
    image.rgb.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&rgb));
    image
}

/// Smooth colours that change from frame to frame.
fn picture(width: u32, height: u32, frame: u32) -> ColorImage {
    let mut image = ColorImage::new(width, height);
    for (index, pixel) in image.rgb.chunks_exact_mut(3).enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let ramp = |at: u32, of: u32| (30 + 190 * at / of.max(1)) as u8;
        pixel.copy_from_slice(&[ramp(x, width), ramp(y, height), (60 + 20 * (frame % 8)) as u8]);
    }
    image
}

fn open(name: &Path, options: &Options) -> Result<Box<dyn Sink>, SinkError> {
    name.to_str().unwrap().parse::<Target>()?.open(options)
}

fn put_all(sink: &mut dyn Sink, frames: &[ColorImage]) {
    for frame in frames {
        assert_eq!(sink.put(frame).unwrap(), ControlFlow::Continue(()));
    }
}

/// Names in a folder, hidden ones included, sorted.
fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Back from limited-range planes to RGB by the definition of the matrix, in floating point.
fn decode(matrix: Matrix, width: usize, height: usize, planes: &[u8]) -> Vec<[f64; 3]> {
    let (kr, kb) = matrix.weights();
    let half = width.div_ceil(2);
    let (luma, chroma) = planes.split_at(width * height);
    let (cb, cr) = chroma.split_at(half * height.div_ceil(2));
    let rgb_at = |x: usize, y: usize| {
        let at = y / 2 * half + x / 2;
        let l = (f64::from(luma[y * width + x]) - 16.0) / 219.0;
        let r = l + 2.0 * (1.0 - kr) * (f64::from(cr[at]) - 128.0) / 224.0;
        let b = l + 2.0 * (1.0 - kb) * (f64::from(cb[at]) - 128.0) / 224.0;
        [r, (l - kr * r - kb * b) / (1.0 - kr - kb), b].map(|value| value * 255.0)
    };
    (0..width * height).map(|index| rgb_at(index % width, index / width)).collect()
}

#[test]
fn names_become_sinks() {
    for (name, target) in [
        ("null", Target::Null),
        ("-", Target::Stdout),
        ("window", Target::Window),
        ("./window", Target::Folder("./window".into())),
        ("window/", Target::Folder("window/".into())),
        ("out/", Target::Folder("out/".into())),
        ("clip.mp4/", Target::Folder("clip.mp4/".into())),
        ("out", Target::Folder("out".into())),
        ("a/b.Y4M", Target::Y4m("a/b.Y4M".into())),
        ("b.mp4", Target::Video("b.mp4".into())),
        ("b.mkv", Target::Video("b.mkv".into())),
        ("b.webm", Target::Video("b.webm".into())),
        ("/dev/video10", Target::Device("/dev/video10".into())),
        ("/dev/null", Target::Device("/dev/null".into())),
        ("/dev/shm/out", Target::Folder("/dev/shm/out".into())),
        ("/dev/video10.mp4", Target::Video("/dev/video10.mp4".into())),
    ] {
        assert_eq!(name.parse::<Target>().unwrap(), target);
    }
    for name in ["", "clip.avi", "a.png"] {
        let error = name.parse::<Target>().unwrap_err().to_string();
        assert!(error.contains(&format!("'{name}'")) && error.contains("FILE.y4m"), "{error}");
    }
}

#[test]
fn a_device_has_many_names() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("camera");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    let target: Target = link.to_str().unwrap().parse().unwrap();
    assert_eq!(target, Target::Device(link.clone()));
    assert!(target.is_device(Path::new("/dev/null")) && !target.is_device(Path::new("/dev/zero")));
    assert!(target.collides_with(&Target::Device("/dev/null".into())));
    assert!(!target.collides_with(&Target::Null) && !Target::Null.collides_with(&Target::Null));
}

/// Pictures go into a pipe one by one; each is whole at its other end before the next one comes.
#[test]
fn a_picture_is_not_held_back() {
    let (mut reader, writer) = io::pipe().unwrap();
    let mut stream = Y4m::new(writer, Path::new("pipe"), &options((16, 12)));
    let mut bytes = [0; 1024];
    for frame in 0..3 {
        stream.write(&picture(16, 12, frame)).unwrap();
        // Less than a pipe holds: all that was written is there, or it never comes.
        let read = io::Read::read(&mut reader, &mut bytes).unwrap();
        let whole = b"FRAME\n".len() + 16 * 12 * 3 / 2;
        let header = bytes[..read].windows(6).position(|bytes| bytes == b"FRAME\n").unwrap();
        assert_eq!(read - header, whole, "frame {frame}");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_player_shows_pictures_as_they_come() {
    // Decodes each picture as soon as it has it, and writes it on.
    let mut player = Command::new("ffmpeg")
        .args(["-v", "error", "-probesize", "32", "-analyzeduration", "0"])
        .args(["-threads", "1", "-f", "yuv4mpegpipe", "-i", "pipe:0"])
        .args(["-f", "rawvideo", "-flush_packets", "1", "pipe:1"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut stream = Y4m::new(player.stdin.take().unwrap(), Path::new("player"), &options((64, 48)));
    let mut shown = player.stdout.take().unwrap();
    let mut picture_shown = vec![0; 64 * 48 * 3 / 2];
    // It may keep a few in hand; what it does not have, it cannot show: the second half would never come.
    const IN_HAND: u32 = 4;
    for frame in 0..20 {
        stream.write(&picture(64, 48, frame)).unwrap();
        if frame >= IN_HAND {
            io::Read::read_exact(&mut shown, &mut picture_shown).unwrap();
        }
    }
    drop(stream);
    let mut rest = Vec::new();
    io::Read::read_to_end(&mut shown, &mut rest).unwrap();
    assert_eq!(rest.len(), IN_HAND as usize * picture_shown.len());
    assert!(player.wait().unwrap().success());
}

#[test]
fn a_grey_picture_is_this_y4m_to_the_byte() {
    let mut stream = Y4m::new(Vec::new(), Path::new("memory"), &options((3, 3)));
    stream.write(&flat(3, 3, [128; 3])).unwrap();
    stream.write(&flat(3, 3, [255; 3])).unwrap();
    let mut expected = b"YUV4MPEG2 W3 H3 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n".to_vec();
    for luma in [126, 235] {
        expected.extend_from_slice(b"FRAME\n");
        expected.extend_from_slice(&[luma; 9]);
        expected.extend_from_slice(&[128; 8]);
    }
    assert_eq!(stream.into_inner().unwrap(), expected);
}

#[test]
fn colours_survive_within_two_levels() {
    for matrix in [Matrix::Bt601, Matrix::Bt709] {
        let converter = Converter::new(matrix);
        for (width, height) in [(4, 2), (5, 3), (1, 1), (1, 6)] {
            for code in 0..125u32 {
                let rgb = [code % 5, code / 5 % 5, code / 25].map(|step| (step * 255 / 4) as u8);
                let mut planes = Vec::new();
                converter.append(&flat(width, height, rgb), &mut planes);
                for pixel in decode(matrix, width as usize, height as usize, &planes) {
                    let off = pixel.iter().zip(rgb).map(|(value, exact)| (value - f64::from(exact)).abs());
                    assert!(off.fold(0.0, f64::max) <= 2.0, "{matrix:?} {rgb:?} came back as {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn chroma_is_the_mean_of_its_four_pixels() {
    let mut image = flat(2, 2, [0; 3]);
    image.rgb[..3].copy_from_slice(&[255, 0, 0]);
    image.rgb[9..].copy_from_slice(&[255, 0, 0]);
    let mut mixed = Vec::new();
    Converter::new(Matrix::Bt709).append(&image, &mut mixed);
    let mut mean = Vec::new();
    Converter::new(Matrix::Bt709).append(&flat(2, 2, [127, 0, 0]), &mut mean);
    assert!(mixed[4].abs_diff(mean[4]) <= 1 && mixed[5].abs_diff(mean[5]) <= 1);
    assert_eq!((mixed[0], mixed[1]), (63, 16));
}

#[test]
fn a_file_appears_only_when_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("made/clip.y4m");
    let frames: Vec<_> = (0..3).map(|frame| picture(6, 4, frame)).collect();

    let mut given_up = open(&name, &options((6, 4))).unwrap();
    put_all(&mut *given_up, &frames);
    assert!(!name.exists());
    drop(given_up);
    assert!(listing(name.parent().unwrap()).is_empty(), "nothing is left of it");

    let mut sink = open(&name, &options((6, 4))).unwrap();
    put_all(&mut *sink, &frames);
    sink.finish().unwrap();
    assert_eq!(listing(name.parent().unwrap()), ["clip.y4m"]);
    let header = b"YUV4MPEG2 W6 H4 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
    assert_eq!(fs::read(&name).unwrap().len(), header.len() + 3 * (6 + 24 + 12), "header and three frames of 4:2:0");

    assert!(matches!(open(&name, &options((6, 4))), Err(SinkError::Exists { .. })));
    let force = Options { force: true, ..options((6, 4)) };
    let mut sink = open(&name, &force).unwrap();
    put_all(&mut *sink, &frames[..1]);
    sink.finish().unwrap();
    assert_eq!(fs::read(&name).unwrap().len(), header.len() + 42);
}

#[test]
fn what_appeared_meanwhile_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let sink = open(&name, &options((6, 4))).unwrap();
    fs::write(&name, "mine").unwrap();
    assert!(matches!(sink.finish(), Err(SinkError::Exists { .. })));
    assert_eq!(fs::read(&name).unwrap(), b"mine");
}

#[test]
fn a_stream_of_no_frames_has_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("empty.y4m");
    open(&name, &options((6, 4))).unwrap().finish().unwrap();
    assert!(fs::read(&name).unwrap().starts_with(b"YUV4MPEG2 W6 H4 F25:1"));
}

#[test]
fn a_stream_keeps_its_size() {
    let mut stream = Y4m::new(Vec::new(), Path::new("memory"), &options((6, 4)));
    let error = stream.write(&flat(4, 6, [0; 3])).unwrap_err();
    assert_eq!(error.to_string(), "the stream is 6 x 4 pixels, and a frame has 4 x 6");
    stream.write(&flat(6, 4, [0; 3])).unwrap();
}

/// Takes some bytes, then has nobody to read them.
struct ClosedPipe(usize);

impl Write for ClosedPipe {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_reader_that_goes_ends_the_stream_cleanly() {
    let mut sink: Box<dyn Sink> = Box::new(Y4m::new(ClosedPipe(150), Path::new("pipe"), &options((6, 4))));
    assert_eq!(sink.put(&picture(6, 4, 0)).unwrap(), ControlFlow::Continue(()));
    assert_eq!(sink.put(&picture(6, 4, 1)).unwrap(), ControlFlow::Continue(()));
    assert_eq!(sink.put(&picture(6, 4, 2)).unwrap(), ControlFlow::Break(()));
    sink.finish().unwrap();
}

#[test]
fn pictures_are_numbered_and_exact() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("made/out/");
    let frames: Vec<_> = (0..3).map(|frame| picture(17, 13, frame)).collect();
    let mut sink = open(&out, &options((17, 13))).unwrap();
    put_all(&mut *sink, &frames);
    sink.finish().unwrap();
    assert_eq!(listing(&out), ["000000.png", "000001.png", "000002.png"]);
    for (name, frame) in listing(&out).iter().zip(&frames) {
        assert_eq!(image::open(out.join(name)).unwrap().into_rgb8().into_raw(), frame.rgb);
    }
}

#[test]
fn a_folder_with_something_in_it_is_written_only_by_force() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["000000.png", "000003.png", "000007.png", "7.png", "notes.txt"] {
        fs::write(folder.path().join(name), "old").unwrap();
    }
    assert!(matches!(open(folder.path(), &options((6, 4))), Err(SinkError::NotEmpty { .. })));
    let mut sink = open(folder.path(), &Options { force: true, ..options((6, 4)) }).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0), picture(6, 4, 1)]);
    sink.finish().unwrap();
    assert_eq!(listing(folder.path()), ["000000.png", "000001.png", "7.png", "notes.txt"], "no tail of the old ones");
    assert!(image::open(folder.path().join("000000.png")).is_ok());
}

#[test]
fn a_failed_picture_leaves_no_partial_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = open(folder.path(), &options((6, 4))).unwrap();
    put_all(&mut *sink, &[picture(6, 4, 0)]);
    // Fewer bytes than its size says: the encoder refuses after the file was made.
    let broken = ColorImage { width: 0, height: 4, rgb: Vec::new() };
    assert!(sink.put(&broken).is_err());
    // The next name is taken by a folder: the picture is encoded, and cannot be renamed.
    fs::create_dir(folder.path().join("000001.png")).unwrap();
    assert!(matches!(sink.put(&picture(6, 4, 1)), Err(SinkError::Exists { .. })));
    drop(sink);
    assert_eq!(listing(folder.path()), ["000000.png", "000001.png"]);
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for name in ["file/clip.y4m", "file/out/"] {
        let error = open(&folder.path().join(name), &options((6, 4))).err().unwrap().to_string();
        assert!(error.starts_with("cannot write ") && error.contains("file"), "{error}");
    }
}

/// Width, height, frames, colour tags as `ffprobe` reads them.
fn probe(name: &Path) -> String {
    let entries = "stream=width,height,nb_read_frames,color_range,color_space,color_transfer,color_primaries";
    let probe = Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-of", "csv=p=0", "-show_entries", entries])
        .arg(name)
        .output()
        .unwrap();
    String::from_utf8(probe.stdout).unwrap().trim().to_owned()
}

#[test]
#[ignore = "needs ffmpeg"]
fn ffmpeg_makes_whole_tagged_files() {
    let folder = tempfile::tempdir().unwrap();
    for (extension, width, height, expected) in [
        ("mp4", 64, 48, "64,48,tv,smpte170m,smpte170m,smpte170m,5"),
        ("mkv", 33, 721, "32,720,tv,bt709,bt709,bt709,5"),
        ("webm", 64, 48, "64,48,tv,smpte170m,smpte170m,smpte170m,5"),
    ] {
        let name = folder.path().join(format!("a: clip.{extension}"));
        let mut sink = open(&name, &options((width, height))).unwrap();
        let frames: Vec<_> = (0..5).map(|frame| picture(width, height, frame)).collect();
        put_all(&mut *sink, &frames);
        assert!(!name.exists());
        sink.finish().unwrap();
        assert_eq!(probe(&name), expected, "{extension}");
        fs::remove_file(&name).unwrap();
        assert!(listing(folder.path()).is_empty(), "{extension}: no partial names");
    }
}

#[test]
#[ignore = "needs ffmpeg"]
fn ffmpeg_keeps_the_colours() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.mp4");
    let shown = picture(64, 48, 3);
    let mut sink = open(&name, &options((64, 48))).unwrap();
    put_all(&mut *sink, std::slice::from_ref(&shown));
    sink.finish().unwrap();
    let decoded = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&name)
        .args(["-vf", "scale=flags=accurate_rnd", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .output()
        .unwrap();
    assert_eq!(decoded.stdout.len(), shown.rgb.len());
    let off = decoded.stdout.iter().zip(&shown.rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
    assert!(off / (shown.rgb.len() as f64) < 2.0, "mean difference {}", off / shown.rgb.len() as f64);
}

#[test]
#[ignore = "needs ffmpeg"]
fn a_failing_ffmpeg_is_the_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // One column cannot be encoded as 4:2:0, which ffmpeg finds when the first frame comes.
    let mut sink = open(&folder.path().join("clip.mp4"), &options((1, 1000))).unwrap();
    let error = loop {
        match sink.put(&picture(1, 1000, 0)) {
            Ok(flow) => assert_eq!(flow, ControlFlow::Continue(())),
            Err(error) => break error,
        }
    };
    let SinkError::Ffmpeg { status, said, .. } = &error else { panic!("{error}") };
    assert!(status.contains('1') && !said.is_empty(), "{error}");
    drop(sink);
    assert!(listing(folder.path()).is_empty());
}
