//! Writes Matroska as the recorder of Azure Kinect's SDK does.

use image::codecs::jpeg::JpegEncoder;

use super::SIZE;

/// Microseconds from frame to frame.
const PERIOD: u64 = 33_333;

/// Returns an element; its length has four bytes.
pub fn element(id: u32, content: &[u8]) -> Vec<u8> {
    let id: Vec<u8> = id.to_be_bytes().into_iter().skip_while(|&byte| byte == 0).collect();
    [&id[..], &(content.len() as u32 | 1 << 28).to_be_bytes(), content].concat()
}

fn number(id: u32, value: u64) -> Vec<u8> {
    element(id, &value.to_be_bytes())
}

/// Returns an element whose length is unknown.
fn endless(id: u32, content: &[u8]) -> Vec<u8> {
    [&id.to_be_bytes()[..], &[1], &[0xFF; 7], content].concat()
}

/// Returns the entry of a video track with the number `at`, and 1000 more as its UID.
pub fn track(at: u64, name: &str, format: &str, (width, height): (u32, u32)) -> Vec<u8> {
    let bitmap_info = [
        &40_u32.to_le_bytes()[..],
        &width.to_le_bytes(),
        &height.to_le_bytes(),
        &[1, 0, 24, 0],
        format.as_bytes(),
        &[0; 20],
    ];
    let video = [number(0xB0, width.into()), number(0xBA, height.into())].concat();
    let parts = [
        number(0xD7, at),
        number(0x73C5, 1000 + at),
        number(0x83, 1),
        element(0x536E, name.as_bytes()),
        element(0x86, b"V_MS/VFW/FOURCC"),
        element(0x63A2, &bitmap_info.concat()),
        element(0xE0, &video),
    ];
    element(0xAE, &parts.concat())
}

/// Returns a `SimpleBlock`: its track, its time after that of the cluster, and a picture.
pub fn block(track: u8, ticks: i16, picture: &[u8]) -> Vec<u8> {
    element(0xA3, &[&[0x80 | track][..], &ticks.to_be_bytes(), &[0x80], picture].concat())
}

/// Returns the same block in a `BlockGroup` with a duration.
pub fn block_group(simple: &[u8]) -> Vec<u8> {
    element(0xA0, &[element(0xA1, &simple[5..]), number(0x9B, PERIOD)].concat())
}

/// Returns the same block with the flag of EBML lacing.
pub fn laced(simple: &[u8]) -> Vec<u8> {
    let mut block = simple.to_vec();
    block[8] |= 0b110;
    block
}

/// Returns samples of the accelerometer, several in a block.
pub fn imu_block() -> Vec<u8> {
    block_group(&laced(&block(4, 0, &[2, 0x90, 0x90, 0, 1, 2])))
}

/// Returns the pictures of frame `frame`: the colour (10 k, 100, 200), and the depth k + 1 m with one unknown.
pub fn pictures(format: &str, frame: u16) -> [Vec<u8>; 2] {
    let rgb = [10 * frame as u8, 100, 200];
    let pixels = (SIZE.0 * SIZE.1) as usize;
    // BT.601 in limited range.
    let [red, green, blue] = rgb.map(f64::from);
    let y = (16.0 + 0.256_788 * red + 0.504_129 * green + 0.097_906 * blue).round() as u8;
    let cb = (128.0 - 0.148_223 * red - 0.290_993 * green + 0.439_216 * blue).round() as u8;
    let cr = (128.0 + 0.439_216 * red - 0.367_788 * green - 0.071_427 * blue).round() as u8;
    let color = match format {
        "MJPG" => {
            let mut jpeg = Vec::new();
            let color = image::ExtendedColorType::Rgb8;
            JpegEncoder::new_with_quality(&mut jpeg, 100).encode(&rgb.repeat(pixels), SIZE.0, SIZE.1, color).unwrap();
            jpeg
        }
        "NV12" => [vec![y; pixels], [cb, cr].repeat(pixels / 4)].concat(),
        "YUY2" => [y, cb, y, cr].repeat(pixels / 2),
        _ => [rgb[2], rgb[1], rgb[0], 255].repeat(pixels),
    };
    let mut depth = (1000 * (frame + 1)).to_be_bytes().repeat(12 * 8);
    depth[..2].fill(0);
    [color, depth]
}

/// A file under construction.
#[derive(Clone)]
pub struct Take {
    pub tracks: Vec<Vec<u8>>,
    pub tags: Vec<(&'static str, String)>,
    pub calibration: Option<String>,
    /// The time and the blocks of each cluster.
    pub clusters: Vec<(u64, Vec<Vec<u8>>)>,
    pub has_lengths: bool,
    /// Whether tags and calibration follow the pictures.
    pub is_tagged_last: bool,
    /// Whether the recorder did not come to write what it writes last: the scale of times, and the length of the whole.
    pub is_killed: bool,
}

impl Take {
    /// Returns a file with the tracks of colour, depth and infrared, and a cluster for each frame.
    pub fn with_frames(format: &str, frames: u16) -> Self {
        let cluster = |frame: u16| {
            let [color, depth] = pictures(format, frame);
            let blocks = vec![block(1, 0, &color), block(2, 0, &depth), block(3, 0, &[7; 12 * 8 * 2])];
            (u64::from(frame) * PERIOD, blocks)
        };
        Self {
            tracks: vec![
                track(1, "COLOR", format, SIZE),
                track(2, "DEPTH", "b16g", (12, 8)),
                track(3, "IR", "b16g", (12, 8)),
            ],
            tags: vec![("K4A_COLOR_MODE", format!("{format}_720P")), ("K4A_DEPTH_MODE", "NFOV_UNBINNED".to_owned())],
            calibration: None,
            clusters: (0..frames).map(cluster).collect(),
            has_lengths: true,
            is_tagged_last: false,
            is_killed: false,
        }
    }

    /// Returns the bytes of the file.
    pub fn file(&self) -> Vec<u8> {
        let master = if self.has_lengths { element } else { endless };
        let tags: Vec<u8> = (self.tags.iter())
            .flat_map(|(name, value)| {
                let simple = [element(0x45A3, name.as_bytes()), element(0x4487, value.as_bytes())].concat();
                element(0x7373, &[element(0x63C0, &[]), element(0x67C8, &simple)].concat())
            })
            .collect();
        let attached = self.calibration.iter().flat_map(|json| {
            let file = [element(0x466E, b"calibration.json"), element(0x465C, json.as_bytes())].concat();
            element(0x1941_A469, &element(0x61A7, &file))
        });
        let described = [attached.collect(), element(0x1254_C367, &tags)].concat();
        let info = element(0x1549_A966, &number(0x2A_D7B1, 1000));
        let space = element(0xEC, &[0; 30]);
        let mut segment =
            [if self.is_killed { space } else { info }, element(0x1654_AE6B, &self.tracks.concat())].concat();
        if !self.is_tagged_last {
            segment.extend(&described);
        }
        let head_bytes = segment.len();
        for (ticks, blocks) in &self.clusters {
            segment.extend(master(0x1F43_B675, &[number(0xE7, *ticks), blocks.concat()].concat()));
        }
        if self.is_tagged_last {
            segment.extend(&described);
        }
        let mut file = element(0x1A45_DFA3, &element(0x4282, b"matroska"));
        let end = file.len() + 8;
        file.extend(master(0x1853_8067, &segment));
        if self.is_killed {
            file[end - 4..end].copy_from_slice(&(head_bytes as u32 | 1 << 28).to_be_bytes());
        }
        file
    }
}
