//! The header of a YUV4MPEG2 stream (y4m of the mjpegtools, `man yuv4mpeg`), with ffmpeg's `XCOLORRANGE`.

use crate::layout::{MAX_SIDE_PX, Range};

/// The first word of a stream.
pub const MAGIC: &str = "YUV4MPEG2";

/// The header of a stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// Width and height.
    pub size_px: (u32, u32),
    /// Frames per second; `None` if they are unknown.
    pub fps: Option<f64>,
    /// The chroma planes.
    pub chroma: Chroma,
    /// The quantisation range.
    pub range: Range,
    /// Whether a frame holds two fields, which belong to different times.
    pub is_interlaced: bool,
}

/// The size of the chroma planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chroma {
    /// No chroma.
    Mono,
    /// Half the columns and half the rows, rounded up.
    Quarter,
    /// Half the columns, rounded up.
    Half,
    /// That of the picture.
    Full,
}

impl Header {
    /// Parses the first line of a stream, without its end.
    ///
    /// # Errors
    /// What is wrong with it, and what to do.
    pub fn parse(line: &str) -> Result<Self, String> {
        let mut words = line.split(' ');
        if words.next() != Some(MAGIC) {
            return Err(format!(
                "it does not begin with {MAGIC}: pipe y4m into it, as `ffmpeg -f yuv4mpegpipe -` writes it"
            ));
        }
        let (mut width, mut height) = (None, None);
        // 4:2:0 is the default of the format.
        let mut header =
            Self { size_px: (0, 0), fps: None, chroma: Chroma::Quarter, range: Range::Limited, is_interlaced: false };
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE_PX).contains(side));
        for word in words.filter(|word| !word.is_empty()) {
            let (tag, value) = word.split_at(word.chars().next().map_or(0, char::len_utf8));
            match tag {
                "W" => width = side(value),
                "H" => height = side(value),
                "F" => header.fps = parse_rate(value)?,
                "I" => header.is_interlaced = !matches!(value, "p" | "?"),
                "C" => header.chroma = parse_chroma(value)?,
                "X" if value == "COLORRANGE=FULL" => header.range = Range::Full,
                // The shape of pixels, and comments.
                _ => {}
            }
        }
        header.size_px = width
            .zip(height)
            .ok_or_else(|| format!("its header {line:?} needs a width W and a height H from 1 to {MAX_SIDE_PX}"))?;
        Ok(header)
    }

    /// Returns width and height of each plane: luma, and the two of chroma if there are any.
    pub fn planes(&self) -> ([(usize, usize); 3], usize) {
        let (width, height) = (self.size_px.0 as usize, self.size_px.1 as usize);
        let chroma = match self.chroma {
            Chroma::Mono => return ([(width, height), (0, 0), (0, 0)], 1),
            Chroma::Quarter => (width.div_ceil(2), height.div_ceil(2)),
            Chroma::Half => (width.div_ceil(2), height),
            Chroma::Full => (width, height),
        };
        ([(width, height), chroma, chroma], 3)
    }
}

/// Parses frames per second such as `30000:1001`; `0:0` is unknown.
fn parse_rate(text: &str) -> Result<Option<f64>, String> {
    let wrong = || format!("its frame rate F{text} is not a ratio such as F30000:1001, from 0.1 to 1000 per second");
    let (frames, seconds) = text.split_once(':').ok_or_else(wrong)?;
    let number = |text: &str| text.parse::<u32>().map(f64::from).map_err(|_| wrong());
    match (number(frames)?, number(seconds)?) {
        (0.0, 0.0) => Ok(None),
        (frames, seconds) => {
            Some(frames / seconds).filter(|rate| (0.1..=1000.0).contains(rate)).map(Some).ok_or_else(wrong)
        }
    }
}

fn parse_chroma(text: &str) -> Result<Chroma, String> {
    match text {
        "mono" => Ok(Chroma::Mono),
        // They differ in where chroma lies between the pixels, by half a pixel at most.
        "420" | "420jpeg" | "420mpeg2" | "420paldv" => Ok(Chroma::Quarter),
        "422" => Ok(Chroma::Half),
        "444" => Ok(Chroma::Full),
        _ => Err(format!(
            "its pixels C{text} are not 4:2:0, 4:2:2, 4:4:4 or mono in 8 bits: give ffmpeg -pix_fmt yuv420p"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_ffmpeg_and_others_are_read() {
        let header = Header {
            size_px: (640, 480),
            fps: Some(25.0),
            chroma: Chroma::Quarter,
            range: Range::Limited,
            is_interlaced: false,
        };
        for (line, expected) in [
            ("YUV4MPEG2 W640 H480 F25:1 Ip A1:1 C420jpeg XYSCSS=420JPEG", header),
            ("YUV4MPEG2 W640 H480 F25:1", header),
            ("YUV4MPEG2 H480 W640  F0:0 I?", Header { fps: None, ..header }),
            ("YUV4MPEG2 W640 H480 F25:1 It", Header { is_interlaced: true, ..header }),
            (
                "YUV4MPEG2 W640 H480 F25:1 C422 XCOLORRANGE=FULL",
                Header { chroma: Chroma::Half, range: Range::Full, ..header },
            ),
            ("YUV4MPEG2 W640 H480 F25:1 C444 XCOLORRANGE=LIMITED", Header { chroma: Chroma::Full, ..header }),
            ("YUV4MPEG2 W640 H480 F25:1 Cmono", Header { chroma: Chroma::Mono, ..header }),
        ] {
            assert_eq!(Header::parse(line), Ok(expected), "{line}");
        }
    }

    #[test]
    fn other_headers_say_what_is_wrong() {
        for (line, what) in [
            ("RIFF", "yuv4mpegpipe"),
            ("", "yuv4mpegpipe"),
            ("YUV4MPEG2", "width"),
            ("YUV4MPEG2 W640", "height"),
            ("YUV4MPEG2 W0 H480", "1 to 8192"),
            ("YUV4MPEG2 W99999 H480", "1 to 8192"),
            ("YUV4MPEG2 W-4 Hé", "1 to 8192"),
            ("YUV4MPEG2 W4 H4 F25", "F25"),
            ("YUV4MPEG2 W4 H4 F0:1", "F0:1"),
            ("YUV4MPEG2 W4 H4 F1:0", "F1:0"),
            ("YUV4MPEG2 W4 H4 F-25:1", "F-25:1"),
            ("YUV4MPEG2 W4 H4 C420p10", "-pix_fmt yuv420p"),
            ("YUV4MPEG2 W4 H4 C411", "C411"),
            ("YUV4MPEG2 W4 H4 C444alpha", "C444alpha"),
        ] {
            assert!(Header::parse(line).unwrap_err().contains(what), "{line}: {:?}", Header::parse(line));
        }
    }
}
