//! Pictures and depth maps: the data passed between the stages.

#[doc(hidden)]
pub mod crop;
pub mod fit;
mod matte;
pub mod scale;
pub mod transform;

pub use matte::{Mask, Matte, MixedPixel};

/// Number of a captured frame: counts from 0 in capture order, dropped frames included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub u64);

/// Index and time of a frame within its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Index of the frame in its source: in a recording, or since a camera was opened.
    pub index: usize,
    /// Media time since the first frame, strictly increasing, also when a recording restarts.
    pub time_ns: u64,
    /// Capture time on the system's monotonic clock; `None` for stored frames without it.
    pub captured_ns: Option<u64>,
}

/// Resizes `values` to `count`; the content is unspecified afterwards. New memory comes zeroed from the system, which
/// provides pages only as they are used.
pub(crate) fn resize_buffer<T: Copy + Default>(values: &mut Vec<T>, count: usize) {
    if values.capacity() < count {
        *values = vec![T::default(); count];
    } else {
        values.resize(count, T::default());
    }
}

/// Sets `values` to `count` defaults; new memory is like that of [`resize_buffer`].
pub(crate) fn reset_buffer<T: Copy + Default>(values: &mut Vec<T>, count: usize) {
    values.clear();
    resize_buffer(values, count);
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
    /// Creates a black picture.
    pub fn new(width: u32, height: u32) -> Self {
        let mut image = Self::default();
        image.resize(width, height);
        image
    }

    /// Resizes the picture, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        resize_buffer(&mut self.rgb, width as usize * height as usize * 3);
    }

    /// Copies size and content of another picture, reusing its own memory if possible.
    pub fn copy_from(&mut self, other: &Self) {
        self.resize(other.width, other.height);
        self.rgb.copy_from_slice(&other.rgb);
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// A YUYV picture, as cameras produce it: `height` x `width` x 2 bytes (Y Cb Y Cr), row-major, no padding. The width is
/// even, because two pixels share their chroma. BT.601, limited range.
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
    /// Creates a picture of zeros.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, bytes: vec![0; width as usize * height as usize * 2] }
    }

    /// Resizes the picture, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        resize_buffer(&mut self.bytes, width as usize * height as usize * 2);
    }

    /// Returns columns and rows.
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
    /// Resizes the picture, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        resize_buffer(&mut self.luma, width as usize * height as usize);
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Computes the luma of a colour picture (BT.601 weights, as usual for matching).
    pub fn set_luma_from(&mut self, color: &ColorImage) {
        self.resize(color.width, color.height);
        compute_luma(&color.rgb, &mut self.luma);
    }
}

/// Computes the luma of `rgb` (interleaved R, G, B), pixel by pixel, as [`GrayImage::set_luma_from`] does.
pub fn compute_luma(rgb: &[u8], luma: &mut [u8]) {
    for (luma, rgb) in luma.iter_mut().zip(rgb.as_chunks::<3>().0) {
        let [r, g, b] = rgb.map(u32::from);
        *luma = ((r * 9_798 + g * 19_235 + b * 3_735 + (1 << 14)) >> 15) as u8;
    }
}

/// Disparity of the left picture of a rectified pair: `height` x `width` pixels, row-major. Left column `x` appears in
/// column `x - disparity` of the right camera. Unknown values as in a [`DepthMap`].
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
    /// Returns the depth map, with `depth_m` converting a disparity to metres; 0 where unknown.
    pub fn to_depth_map(&self, depth_m: impl Fn(f32) -> f32) -> DepthMap {
        let metres = |&px: &f32| if DepthMap::is_known(px) { depth_m(px) } else { 0.0 };
        DepthMap {
            width: self.width,
            height: self.height,
            metres: self.px.iter().map(metres).collect(),
            ..DepthMap::default()
        }
    }

    /// Resizes the map, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        resize_buffer(&mut self.px, width as usize * height as usize);
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// Depth along the optical axis: `height` x `width` metres, row-major. Values outside [`DepthMap::MIN_M`] to
/// [`DepthMap::MAX_M`] and non-finite values are unknown; 0 is written for them. It covers the same view as its colour
/// picture, possibly at a lower resolution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` metres.
    pub metres: Vec<f32>,
    /// Mixed pixels, which show two surfaces at once, if known; empty by default.
    pub matte: Matte,
    /// Distance in metres of the subject that the map was made around, such as a person in a mask. Such a map has a
    /// matte and no holes; the subject is in focus by default.
    pub subject_m: Option<f32>,
    /// Distance in metres of a person in a measured map, if known: in focus by default.
    pub person_m: Option<f32>,
    /// True if its outlines are slopes of several pixels, as in the output of a coarse network: it then has no mixed
    /// pixels.
    pub is_smooth: bool,
}

impl DepthMap {
    /// Distance in metres of the nearest point or of the subject if distances are only relative.
    pub const SUBJECT_M: f32 = 1.0;
    /// Distance in metres that counts as infinite if distances are only relative.
    pub const FAR_M: f32 = 1e3;
    /// Converts relative inverse depth to metres: 1 is nearest; 0 and NaN are farthest.
    #[inline(always)]
    pub fn relative_to_metres(nearness: f32) -> f32 {
        const MIN_NEARNESS: f32 = DepthMap::SUBJECT_M / DepthMap::FAR_M;
        Self::SUBJECT_M / if nearness > MIN_NEARNESS { nearness } else { MIN_NEARNESS }
    }

    /// Converts metres to relative inverse depth: the inverse of [`DepthMap::relative_to_metres`], at most 1.
    pub fn metres_to_relative(metres: f32) -> f32 {
        if metres < Self::FAR_M { (Self::SUBJECT_M / metres).min(1.0) } else { 0.0 }
    }

    /// Returns the largest known depth in metres.
    pub fn farthest_m(&self) -> Option<f32> {
        self.metres.iter().copied().filter(|&metres| Self::is_known(metres)).reduce(f32::max)
    }

    /// Smallest valid depth in metres: no scene is nearer, and its reciprocal squared is still finite.
    pub const MIN_M: f32 = 1e-6;
    /// Largest valid depth in metres: files that must write a number for infinity use a smaller one.
    pub const MAX_M: f32 = 1e12;

    /// Creates a map with unknown depth everywhere.
    pub fn new(width: u32, height: u32) -> Self {
        let mut map = Self::default();
        map.resize(width, height);
        map
    }

    /// Resizes the map, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        resize_buffer(&mut self.metres, width as usize * height as usize);
    }

    /// Makes it a map of `width` x `height` pixels in which everything is far behind a subject that is not there: the
    /// whole picture is blurred.
    pub fn fill_far(&mut self, (width, height): (u32, u32)) {
        self.resize(width, height);
        self.metres.fill(Self::FAR_M);
        self.matte.pixels.clear();
        (self.subject_m, self.person_m, self.is_smooth) = (Some(Self::SUBJECT_M), None, false);
    }

    /// Returns whether the subject that the map was made around is in it; `None` if it was made around none.
    pub fn has_subject(&self) -> Option<bool> {
        self.subject_m.map(|subject_m| self.metres.iter().any(|&metres| metres <= subject_m))
    }

    /// Copies size and content of another map, reusing its own memory if possible.
    pub fn copy_from(&mut self, other: &Self) {
        self.resize(other.width, other.height);
        self.metres.copy_from_slice(&other.metres);
        self.matte.pixels.clone_from(&other.matte.pixels);
        (self.subject_m, self.person_m, self.is_smooth) = (other.subject_m, other.person_m, other.is_smooth);
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Whether a stored value is a valid depth.
    #[inline]
    pub fn is_known(metres: f32) -> bool {
        // Both comparisons are false for NaN; branch-free, so that loops over maps vectorise.
        let (is_beyond_least, is_below_most) = (metres >= Self::MIN_M, metres <= Self::MAX_M);
        is_beyond_least & is_below_most
    }

    /// Returns the inverse of a stored depth, in 1/m; 0 if unknown.
    #[inline(always)]
    pub fn inverse_depth(metres: f32) -> f32 {
        if Self::is_known(metres) { 1.0 / metres } else { 0.0 }
    }
}
