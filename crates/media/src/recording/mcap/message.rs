//! The messages of ROS that have pictures: `sensor_msgs/Image` and `sensor_msgs/CompressedImage`.

use super::fields::Fields;
use crate::recording::MAX_SIDE_PX;
use crate::recording::raw_image::RawImage;

/// Largest message that is read: four bytes per pixel, and room for a header.
pub(super) const MAX_MESSAGE_BYTES: u64 = 4 * (MAX_SIDE_PX as u64 * MAX_SIDE_PX as u64) + (1 << 16);

/// The type of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// Pixels row by row.
    Image,
    /// A PNG or JPEG.
    CompressedImage,
}

impl Kind {
    /// Returns the kind with a name of ROS 2 or ROS 1.
    pub fn from_type(name: &str) -> Option<Self> {
        match name {
            "sensor_msgs/msg/Image" | "sensor_msgs/Image" => Some(Self::Image),
            "sensor_msgs/msg/CompressedImage" | "sensor_msgs/CompressedImage" => Some(Self::CompressedImage),
            _ => None,
        }
    }
}

/// The encoding of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    Cdr,
    Ros1,
}

impl Encoding {
    /// Returns the encoding with a name of MCAP's registry.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "cdr" => Some(Self::Cdr),
            "ros1" => Some(Self::Ros1),
            _ => None,
        }
    }
}

/// What precedes the picture in a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Preview<'a> {
    /// The time at which the picture was taken, in nanoseconds; 0 if it is not stated.
    pub stamp_ns: u64,
    /// The camera, or its coordinate frame.
    pub frame_id: &'a str,
    /// Width and height in pixels; 0 for a PNG or JPEG.
    pub size: (u32, u32),
    /// The encoding of an image, such as `rgb8`, or the format of a compressed one.
    pub format: &'a str,
}

impl<'a> Preview<'a> {
    /// Number of bytes of a message in which all this is.
    pub const BYTES: usize = 512;

    /// Parses the beginning of a message. The format of a PNG of 16-bit grey is completed where it states no encoding.
    pub fn parse(bytes: &'a [u8], kind: Kind, encoding: Encoding) -> Option<Self> {
        let mut fields = start(bytes, encoding)?;
        let mut preview = Self::read(&mut fields, kind, encoding)?;
        let is_png = kind == Kind::CompressedImage && preview.format.ends_with("png") && !preview.format.contains(';');
        if is_png && fields.u32().is_some() {
            // A PNG has the bits per sample and the type of colour in bytes 24 and 25.
            let head: Option<Vec<u8>> = (0..26).map(|_| fields.u8()).collect();
            if matches!(head.as_deref(), Some([0x89, b'P', b'N', b'G', .., 16, 0])) {
                preview.format = "mono16; png";
            }
        }
        Some(preview)
    }

    fn read(fields: &mut Fields<'a>, kind: Kind, encoding: Encoding) -> Option<Self> {
        let (stamp_ns, frame_id) = read_header(fields, encoding)?;
        let (height, width) = match kind {
            Kind::Image => (fields.u32()?, fields.u32()?),
            Kind::CompressedImage => (0, 0),
        };
        Some(Self { stamp_ns, frame_id, size: (width, height), format: fields.text()? })
    }
}

/// A message with a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Picture<'a> {
    Image(RawImage<'a>),
    /// A PNG or JPEG, of a depth map after twelve bytes.
    Compressed {
        format: &'a str,
        data: &'a [u8],
    },
}

impl<'a> Picture<'a> {
    /// Parses a whole message.
    pub fn parse(bytes: &'a [u8], kind: Kind, encoding: Encoding) -> Option<Self> {
        let mut fields = start(bytes, encoding)?;
        let Preview { size, format, .. } = Preview::read(&mut fields, kind, encoding)?;
        Some(match kind {
            Kind::Image => Self::Image(RawImage {
                size,
                format,
                is_big_endian: fields.u8()? != 0,
                stride_bytes: fields.u32()? as usize,
                data: fields.bytes()?,
            }),
            Kind::CompressedImage => Self::Compressed { format, data: fields.bytes()? },
        })
    }
}

/// Reads the header of a message: its time in nanoseconds, and its coordinate frame without the slash of ROS 1.
pub(super) fn read_header<'a>(fields: &mut Fields<'a>, encoding: Encoding) -> Option<(u64, &'a str)> {
    const NS_PER_S: u64 = 1_000_000_000;
    if encoding == Encoding::Ros1 {
        // A number that counts messages.
        fields.u32()?;
    }
    let (seconds, ns, frame_id) = (fields.i32()?, fields.u32()?, fields.text()?);
    let stamp_ns = u64::try_from(seconds).unwrap_or(0) * NS_PER_S + u64::from(ns);
    Some((stamp_ns, frame_id.trim_start_matches('/')))
}

/// Returns the fields of a message.
pub(super) fn start(bytes: &[u8], encoding: Encoding) -> Option<Fields<'_>> {
    match encoding {
        Encoding::Cdr => Fields::cdr(bytes),
        Encoding::Ros1 => Some(Fields::packed(bytes)),
    }
}
