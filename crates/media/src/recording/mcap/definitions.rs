//! The messages that are written: their definitions (`common_interfaces` of ROS 2), and their fields in CDR.

/// The definition of `sensor_msgs/msg/CompressedImage`, with those that it contains.
pub(super) const COMPRESSED_IMAGE: &str = include_str!("CompressedImage.msg");

/// The definition of `sensor_msgs/msg/CameraInfo`, with those that it contains.
pub(super) const CAMERA_INFO: &str = include_str!("CameraInfo.msg");

/// A message under construction: little-endian CDR.
#[derive(Debug, Default)]
pub(super) struct MessageWriter {
    bytes: Vec<u8>,
}

/// Bytes in front of the fields, which state the byte order; alignment begins after them.
const FRONT: [u8; 4] = [0, 1, 0, 0];

impl MessageWriter {
    /// Begins a message with its header.
    pub fn begin(&mut self, time_ns: u64, frame_id: &str) {
        const NS_PER_S: u64 = 1_000_000_000;
        self.bytes.clear();
        self.bytes.extend(FRONT);
        self.u32((time_ns / NS_PER_S) as u32);
        self.u32((time_ns % NS_PER_S) as u32);
        self.text(frame_id);
    }

    fn align(&mut self, bytes: usize) {
        let end = FRONT.len() + (self.bytes.len() - FRONT.len()).next_multiple_of(bytes);
        self.bytes.resize(end, 0);
    }

    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    pub fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// Adds a sequence of bytes, given in parts.
    pub fn data(&mut self, parts: &[&[u8]]) {
        self.u32(parts.iter().map(|part| part.len() as u32).sum());
        parts.iter().for_each(|part| self.bytes.extend(*part));
    }

    /// Adds the fields of a `CameraInfo` after its header: the size, and zeros, which mean that the camera is not
    /// calibrated.
    pub fn uncalibrated_camera(&mut self, (width, height): (u32, u32)) {
        /// Numbers of the matrices `k`, `r` and `p`.
        const MATRICES: usize = 9 + 9 + 12;
        self.u32(height);
        self.u32(width);
        self.text("");
        // No coefficients.
        self.u32(0);
        self.align(8);
        self.bytes.resize(self.bytes.len() + 8 * MATRICES, 0);
        // Binning, and the region of interest: the whole picture.
        (0..6).for_each(|_| self.u32(0));
        self.bytes.push(0);
    }

    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
