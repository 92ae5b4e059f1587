//! Writes a recording as an MCAP file of ROS 2.

use std::fs::File;
use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};

use super::definitions::{CAMERA_INFO, COMPRESSED_IMAGE, MessageWriter};
use super::file_writer::FileWriter;
use crate::recording::encode;
use crate::recording::error::{RecordingError, Result};
use crate::recording::writer::Storage;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_files::atomic_file::{self, PartFile};

/// The namespaces of colour and depth, as RealSense names them: depth has the view of the colour camera.
const COLOR: &str = "/camera/color";
const DEPTH: &str = "/camera/aligned_depth_to_color";
/// The coordinate frame of both.
const FRAME_ID: &str = "camera_color_optical_frame";

/// Formats as `image_transport` names them. The PNG itself is in RGB; OpenCV decodes it as `bgr8`.
const COLOR_FORMAT: &str = "rgb8; png compressed bgr8";
const DEPTH_FORMAT: &str = "16UC1; compressedDepth png";

/// What precedes the PNG of a depth map: a format, and two parameters that millimetres do not need.
const COMPRESSED_DEPTH_HEAD: [u8; 12] = [0; 12];

/// Time of the first frame in nanoseconds: in ROS, 0 means that it is unknown.
const FIRST_NS: u64 = 1_000_000_000;

/// The program that writes, as the file states it.
const LIBRARY: &str = concat!("bokehcam ", env!("CARGO_PKG_VERSION"));

/// A file that gets its name when it is whole. Times count from the first frame, which is at 1 s.
pub(in crate::recording) struct Writer {
    path: PathBuf,
    part: PartFile,
    overwrite: bool,
    file: FileWriter<BufWriter<File>>,
    /// Definitions of the pictures and of the camera.
    schemas: [u16; 2],
    /// Channels of the pictures and of the camera.
    color: [u16; 2],
    /// The same for depth; created with the first depth map.
    depth: Option<[u16; 2]>,
    /// The time of the source that [`FIRST_NS`] stands for.
    begin_ns: Option<u64>,
    message: MessageWriter,
    /// Working memory for encoding.
    units: Vec<u8>,
    picture: Vec<u8>,
}

impl Writer {
    /// Starts the file `path`.
    pub fn create(path: &Path, overwrite: bool) -> Result<Self> {
        if !overwrite && path.symlink_metadata().is_ok() {
            return Err(RecordingError::Exists { path: path.to_owned() });
        }
        atomic_file::keep_leftovers(path).map_err(RecordingError::io("write", path))?;
        let part = PartFile::create(path).map_err(RecordingError::io("create", path))?;
        let stream = part.file().try_clone().map_err(RecordingError::io("create", path))?;
        let begun = FileWriter::begin(BufWriter::new(stream), "ros2", LIBRARY);
        let mut file = begun.map_err(RecordingError::io("write", path))?;
        let schemas = [
            file.add_schema("sensor_msgs/msg/CompressedImage", COMPRESSED_IMAGE),
            file.add_schema("sensor_msgs/msg/CameraInfo", CAMERA_INFO),
        ];
        let color = add_channels(&mut file, schemas, COLOR, "compressed");
        Ok(Self {
            path: path.to_owned(),
            part,
            overwrite,
            file,
            schemas,
            color,
            depth: None,
            begin_ns: None,
            message: MessageWriter::default(),
            units: Vec::new(),
            picture: Vec::new(),
        })
    }

    /// Writes `self.picture` of this size after `head`, and the camera that took it.
    fn write_pair(
        &mut self,
        [picture, camera]: [u16; 2],
        (sequence, time_ns, size): (u32, u64, (u32, u32)),
        format: &str,
        head: &[u8],
    ) -> Result<()> {
        self.message.begin(time_ns, FRAME_ID);
        self.message.text(format);
        self.message.data(&[head, &self.picture]);
        let written = self.file.write_message(picture, sequence, time_ns, self.message.bytes());
        written.map_err(RecordingError::io("write", &self.path))?;
        self.message.begin(time_ns, FRAME_ID);
        self.message.uncalibrated_camera(size);
        let written = self.file.write_message(camera, sequence, time_ns, self.message.bytes());
        written.map_err(RecordingError::io("write", &self.path))
    }
}

impl Storage for Writer {
    fn add(&mut self, number: usize, time_ns: u64, color: &ColorImage, depth: Option<&DepthMap>) -> Result<()> {
        let time_ns = FIRST_NS + (time_ns - *self.begin_ns.get_or_insert(time_ns));
        let sequence = number as u32;
        self.picture.clear();
        encode::encode_color_png(color, &mut self.picture).map_err(RecordingError::unrecordable(number))?;
        self.write_pair(self.color, (sequence, time_ns, color.size()), COLOR_FORMAT, &[])?;
        if let Some(depth) = depth {
            let (file, schemas) = (&mut self.file, self.schemas);
            let channels = *self.depth.get_or_insert_with(|| add_channels(file, schemas, DEPTH, "compressedDepth"));
            self.picture.clear();
            encode::encode_png_16bit(
                depth.size(),
                &depth.metres,
                super::DEPTH_SCALE,
                None,
                &mut self.units,
                &mut self.picture,
            )
            .map_err(RecordingError::unrecordable(number))?;
            self.write_pair(channels, (sequence, time_ns, depth.size()), DEPTH_FORMAT, &COMPRESSED_DEPTH_HEAD)?;
        }
        Ok(())
    }

    fn max_depth_m(&self) -> f32 {
        encode::max_value(super::DEPTH_SCALE)
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        let Self { path, part, overwrite, file, .. } = *self;
        file.finish().map_err(RecordingError::io("write", &path))?;
        let replaced = u64::from(path.exists());
        part.commit(overwrite).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => RecordingError::Exists { path: path.clone() },
            _ => RecordingError::io("write", &path)(error),
        })?;
        Ok(replaced)
    }

    fn keep(self: Box<Self>) -> Result<PathBuf> {
        let Self { path, part, file, .. } = *self;
        // Where its end cannot be written, what came before can be read all the same.
        if let Err(error) = file.finish() {
            tracing::warn!("{}", RecordingError::io("write", &path)(error));
        }
        part.keep_incomplete().map_err(RecordingError::io("keep", &path))
    }
}

/// Adds the channels of a camera: its pictures, and its `CameraInfo`.
fn add_channels(
    file: &mut FileWriter<BufWriter<File>>,
    [picture, info]: [u16; 2],
    camera: &str,
    transport: &str,
) -> [u16; 2] {
    [
        file.add_channel(&format!("{camera}/image_raw/{transport}"), picture),
        file.add_channel(&format!("{camera}/camera_info"), info),
    ]
}
