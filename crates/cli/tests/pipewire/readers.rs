//! Programs that read from a PipeWire camera.

use std::process::{Command, Stdio};

use super::program::Beside;
use super::session::{SIZE, until};

const FRAME_BYTES: usize = 2 * (SIZE.0 * SIZE.1) as usize;

/// The pictures that GStreamer received.
pub struct Got {
    /// YUYV data of each picture.
    pub frames: Vec<Vec<u8>>,
    /// Sequence numbers.
    pub sequence: Vec<u64>,
    /// Time stamps in nanoseconds.
    pub times_ns: Vec<u64>,
}

/// A GStreamer process that reads some pictures and ends.
pub struct GStreamer {
    program: Beside,
    folder: tempfile::TempDir,
}

impl GStreamer {
    /// Starts to read `pictures` pictures of a node.
    pub fn start(node: &str, pictures: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let caps = format!("video/x-raw,format=YUY2,width={},height={}", SIZE.0, SIZE.1);
        let mut command = Command::new("gst-launch-1.0");
        command
            .args(["-v", "pipewiresrc", &format!("target-object={node}"), &format!("num-buffers={pictures}")])
            .args(["!", &caps, "!", "identity", "silent=false", "!", "filesink"])
            .arg(format!("location={}", folder.path().join("frames").display()))
            .stdout(std::fs::File::create(folder.path().join("said")).unwrap())
            .stderr(Stdio::null());
        Self { program: Beside::start(&mut command), folder }
    }

    pub fn is_reading(&mut self) -> bool {
        self.program.runs()
    }

    /// Returns the complete pictures received so far.
    pub fn frames(&self) -> Vec<Vec<u8>> {
        let bytes = std::fs::read(self.folder.path().join("frames")).unwrap_or_default();
        // The last one may be incomplete in the file.
        bytes.chunks_exact(FRAME_BYTES).map(<[u8]>::to_vec).collect()
    }

    /// Waits for the process to end.
    pub fn end(mut self) -> Got {
        until("the reader's end", || (!self.is_reading()).then_some(()));
        let bytes = std::fs::read(self.folder.path().join("frames")).unwrap();
        let said = std::fs::read_to_string(self.folder.path().join("said")).unwrap();
        let chained: Vec<&str> = said.lines().filter(|line| line.contains("chain   *")).collect();
        let field = |line: &str, name: &str| {
            let value = line.split_once(name).unwrap().1;
            value.split([',', ' ']).next().unwrap().to_owned()
        };
        Got {
            frames: bytes.chunks(FRAME_BYTES).map(<[u8]>::to_vec).collect(),
            sequence: chained.iter().map(|line| field(line, "offset: ").parse().unwrap()).collect(),
            times_ns: chained.iter().map(|line| nanoseconds(&field(line, "pts: "))).collect(),
        }
    }
}

/// Parses a time in GStreamer's format: hours, minutes, and seconds with nine decimals.
fn nanoseconds(text: &str) -> u64 {
    let seconds = text.split(':').fold(0.0, |sum, part| 60.0 * sum + part.parse::<f64>().unwrap());
    (seconds * 1e9).round() as u64
}
