//! Pictures and depth maps: what travels between the stages.

pub mod crop;
pub mod fit;
mod matte;
pub mod scale;

pub use matte::{Mask, Matte, MixedPixel};

/// Number of a captured frame: counts from 0 in capture order, dropped frames included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub u64);

/// Which frame of its source it is, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// The source's own number of the frame: its place in a recording, or since a camera was opened.
    pub index: usize,
    /// Media time: since the first frame, strictly increasing also where a recording starts over.
    pub time_ns: u64,
    /// When a camera took it, on the system's monotonic clock; `None` where frames are stored and have no such time.
    pub captured_ns: Option<u64>,
}

/// Gives `values` the length `count`; the content is unspecified after. Memory that is new comes zeroed from the system, which
/// provides it only as it is used.
fn make_room<T: Copy + Default>(values: &mut Vec<T>, count: usize) {
    if values.capacity() < count {
        *values = vec![T::default(); count];
    } else {
        values.resize(count, T::default());
    }
}

/// An 8-bit sRGB picture: `height` x `width` x 3 bytes (R, G, B), row-major, no padding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColorImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width * 3` bytes.
    pub rgb: Vec<u8>,
}

impl ColorImage {
    /// A black picture.
    pub fn new(width: u32, height: u32) -> Self {
        let mut image = Self::default();
        image.resize(width, height);
        image
    }

    /// Gives the picture another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        make_room(&mut self.rgb, width as usize * height as usize * 3);
    }

    /// Takes over size and content of another picture, keeping its own memory where that suffices.
    pub fn copy_from(&mut self, other: &Self) {
        self.resize(other.width, other.height);
        self.rgb.copy_from_slice(&other.rgb);
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// A picture as cameras give it: `height` x `width` x 2 bytes (Y Cb Y Cr), row-major, no padding. The width is even: two
/// pixels share their colour. BT.601, limited range.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct YuyvImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width * 2` bytes.
    pub bytes: Vec<u8>,
}

impl YuyvImage {
    /// A picture of zeros.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, bytes: vec![0; width as usize * height as usize * 2] }
    }

    /// Gives the picture another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        make_room(&mut self.bytes, width as usize * height as usize * 2);
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// An 8-bit grey picture: `height` x `width` bytes of sRGB luma, row-major, no padding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GrayImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` bytes.
    pub luma: Vec<u8>,
}

impl GrayImage {
    /// Gives the picture another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        make_room(&mut self.luma, width as usize * height as usize);
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Becomes the luma of a colour picture (BT.601 weights, as usual for matching).
    pub fn set_luma_of(&mut self, color: &ColorImage) {
        self.resize(color.width, color.height);
        luma_of(&color.rgb, &mut self.luma);
    }
}

/// The luma of `rgb` (R, G, B after each other), pixel by pixel, as in [`GrayImage::set_luma_of`].
pub fn luma_of(rgb: &[u8], luma: &mut [u8]) {
    for (luma, rgb) in luma.iter_mut().zip(rgb.as_chunks::<3>().0) {
        let [r, g, b] = rgb.map(u32::from);
        *luma = ((r * 9_798 + g * 19_235 + b * 3_735 + (1 << 14)) >> 15) as u8;
    }
}

/// Disparity of the left picture of a rectified pair: `height` x `width` pixels, row-major; what is left column `x` is
/// seen by the right eye in column `x - disparity`. What means unknown is as for a [`DepthMap`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisparityMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` disparities in pixels.
    pub px: Vec<f32>,
}

impl DisparityMap {
    /// Its depth, where `depth_m` gives the metres of a disparity; 0 where that is unknown.
    pub fn depth(&self, depth_m: impl Fn(f32) -> f32) -> DepthMap {
        let metres = |&px: &f32| if DepthMap::is_known(px) { depth_m(px) } else { 0.0 };
        DepthMap {
            width: self.width,
            height: self.height,
            metres: self.px.iter().map(metres).collect(),
            ..DepthMap::default()
        }
    }

    /// Gives the map another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        make_room(&mut self.px, width as usize * height as usize);
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// Depth along the optical axis: `height` x `width` metres, row-major. What is not between [`DepthMap::LEAST_M`] and
/// [`DepthMap::MOST_M`] means unknown: 0, as it is written here, what is not finite, and what no lens and no light reaches.
/// It covers the same view as its colour picture, and may have fewer pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` metres.
    pub metres: Vec<f32>,
    /// The pixels that show two surfaces at once, as far as that is known; none by default.
    pub matte: Matte,
    /// The distance of the subject that the map was made around, in metres, such as a person whom a mask shows. Such a map
    /// has its matte and no holes; what is in focus by default is the subject.
    pub subject_m: Option<f32>,
    /// The distance of a person in a map that was measured, in metres, as far as that is known: in focus by default.
    pub person_m: Option<f32>,
    /// Whether its outlines are slopes of several pixels, as a coarse network's are: no pixel shows two surfaces then.
    pub is_smooth: bool,
}

impl DepthMap {
    /// The distance of what is nearest, or of a subject, where distances are only relative, in metres.
    pub const SUBJECT_M: f32 = 1.0;
    /// What is then as good as infinitely far, in metres.
    pub const FAR_M: f32 = 1e3;
    /// The distance of something of relative inverse depth, 1 where it is nearest and 0 where it is farthest, and what is no
    /// number.
    #[inline(always)]
    pub fn relative_m(nearness: f32) -> f32 {
        const LEAST: f32 = DepthMap::SUBJECT_M / DepthMap::FAR_M;
        Self::SUBJECT_M / if nearness > LEAST { nearness } else { LEAST }
    }

    /// The least depth: no scene is nearer, and its reciprocal, squared, still is a number.
    pub const LEAST_M: f32 = 1e-6;
    /// The largest depth: what is infinitely far in files that have to write a number is nearer than this.
    pub const MOST_M: f32 = 1e12;

    /// A map with every depth unknown.
    pub fn new(width: u32, height: u32) -> Self {
        let mut map = Self::default();
        map.resize(width, height);
        map
    }

    /// Gives the map another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        make_room(&mut self.metres, width as usize * height as usize);
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Whether a stored value is a depth rather than the mark for "unknown".
    #[inline]
    pub fn is_known(metres: f32) -> bool {
        // Both comparisons are false for NaN; without a branch, so that loops over maps become vector code.
        let (is_beyond_least, is_below_most) = (metres >= Self::LEAST_M, metres <= Self::MOST_M);
        is_beyond_least & is_below_most
    }

    /// Inverse depth of a stored value, in 1/m; 0 where it is unknown.
    #[inline(always)]
    pub fn inverse_of(metres: f32) -> f32 {
        if Self::is_known(metres) { 1.0 / metres } else { 0.0 }
    }
}
