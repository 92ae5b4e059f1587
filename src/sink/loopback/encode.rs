//! Pictures as frames in the pixel layouts of V4L2; Y'CbCr ones in BT.601, limited range.

use pulp::{Arch, Simd, WithSimd};

use crate::color::Matrix;
use crate::frame::ColorImage;
use crate::sink::yuv::Converter;
use crate::v4l2::loopback::Layout;

/// Encodes pictures of one layout.
pub(super) struct Encoder {
    layout: Layout,
    arch: Arch,
    planar: Converter,
    /// Working memory: planes that are to be interleaved.
    planes: Vec<u8>,
}

impl Encoder {
    pub(super) fn new(layout: Layout) -> Self {
        Self { layout, arch: Arch::new(), planar: Converter::new(Matrix::Bt601), planes: Vec::new() }
    }

    /// Encodes `picture` into `bytes`, which are resized to a frame of the layout.
    pub(super) fn encode(&mut self, picture: &ColorImage, bytes: &mut Vec<u8>) {
        match self.layout {
            Layout::Yuyv => {
                bytes.resize(self.layout.frame_bytes(picture.size()), 0);
                self.arch.dispatch(Yuyv { rgb: &picture.rgb, yuyv: bytes });
            }
            Layout::Yu12 => {
                bytes.clear();
                self.planar.append(picture, bytes);
            }
            Layout::Nv12 => {
                self.planes.clear();
                self.planar.append(picture, &mut self.planes);
                let (luma, chroma) = self.planes.split_at(picture.rgb.len() / 3);
                let (cb, cr) = chroma.split_at(chroma.len() / 2);
                bytes.resize(self.planes.len(), 0);
                let (to_luma, to_chroma) = bytes.split_at_mut(luma.len());
                to_luma.copy_from_slice(luma);
                for ((pair, &cb), &cr) in to_chroma.as_chunks_mut::<2>().0.iter_mut().zip(cb).zip(cr) {
                    *pair = [cb, cr];
                }
            }
            Layout::Rgb24 => {
                bytes.clear();
                bytes.extend_from_slice(&picture.rgb);
            }
            Layout::Bgr24 => {
                bytes.resize(picture.rgb.len(), 0);
                let pixels = picture.rgb.as_chunks::<3>().0;
                for (to, &[r, g, b]) in bytes.as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
                    *to = [b, g, r];
                }
            }
        }
    }
}

/// Pixels that are converted together: whole vectors of every width.
const BLOCK: usize = 64;

/// Converts an even number of pixels, all rows as one: every pair from the first pixel on shares its chroma.
struct Yuyv<'a> {
    rgb: &'a [u8],
    yuyv: &'a mut [u8],
}

impl WithSimd for Yuyv<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (blocks, rest) = self.rgb.as_chunks::<{ 3 * BLOCK }>();
        let (to_blocks, to_rest) = self.yuyv.as_chunks_mut::<{ 2 * BLOCK }>();
        for (rgb, yuyv) in blocks.iter().zip(to_blocks.iter_mut()) {
            rgb_to_yuyv(rgb, yuyv);
        }
        if !rest.is_empty() {
            // Padded to a block.
            let (mut rgb, mut yuyv) = ([0; 3 * BLOCK], [0; 2 * BLOCK]);
            rgb[..rest.len()].copy_from_slice(rest);
            rgb_to_yuyv(&rgb, &mut yuyv);
            let len = to_rest.len();
            to_rest.copy_from_slice(&yuyv[..len]);
        }
    }
}

/// Converts pixels to YUYV (BT.601, limited range), within one code of the exact value. 16-bit integers with
/// coefficients of 8 bits fit the most pixels into a vector.
#[inline(always)]
fn rgb_to_yuyv(rgb: &[u8; 3 * BLOCK], yuyv: &mut [u8; 2 * BLOCK]) {
    let (mut r, mut g, mut b) = ([0_u16; BLOCK], [0_u16; BLOCK], [0_u16; BLOCK]);
    for at in 0..BLOCK {
        r[at] = u16::from(rgb[3 * at]);
        g[at] = u16::from(rgb[3 * at + 1]);
        b[at] = u16::from(rgb[3 * at + 2]);
    }
    let mut luma = [0_u8; BLOCK];
    for at in 0..BLOCK {
        // At most 56 228: no overflow.
        luma[at] = (((66 * r[at] + 129 * g[at] + 25 * b[at] + 128) >> 8) + 16) as u8;
    }
    let mut chroma = [0_u8; BLOCK];
    for pair in 0..BLOCK / 2 {
        let sum = |values: &[u16; BLOCK]| (values[2 * pair] + values[2 * pair + 1]) as i16;
        let (r, g, b) = (sum(&r), sum(&g), sum(&b));
        // Coefficients are halved, since these are sums of two pixels: at most 28 560 to either side.
        chroma[2 * pair] = (((56 * b - 19 * r - 37 * g + 128) >> 8) + 128) as u8;
        chroma[2 * pair + 1] = (((56 * r - 47 * g - 9 * b + 128) >> 8) + 128) as u8;
    }
    for at in 0..BLOCK {
        yuyv[2 * at] = luma[at];
        yuyv[2 * at + 1] = chroma[at];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Y'CbCr of BT.601 in limited range, not rounded.
    fn exact([r, g, b]: [f64; 3]) -> [f64; 3] {
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        [
            16.0 + 219.0 / 255.0 * luma,
            128.0 + 224.0 / 255.0 * (b - luma) / (2.0 * (1.0 - 0.114)),
            128.0 + 224.0 / 255.0 * (r - luma) / (2.0 * (1.0 - 0.299)),
        ]
    }

    fn encoded(layout: Layout, picture: &ColorImage) -> Vec<u8> {
        // What was there before must not matter.
        let mut bytes = vec![9; 77];
        Encoder::new(layout).encode(picture, &mut bytes);
        assert_eq!(bytes.len(), layout.frame_bytes(picture.size()));
        bytes
    }

    /// Every 5th value of each channel in pairs of unequal pixels; the count is no multiple of a block.
    fn colors() -> ColorImage {
        let values = || (0..=255).step_by(5).map(|value| value as u8);
        let all = values().flat_map(|r| values().flat_map(move |g| values().map(move |b| [r, g, b])));
        let rgb: Vec<u8> = all.skip(1).flat_map(|[r, g, b]| [r, g, b, g, 255 - r, b]).collect();
        ColorImage { width: rgb.len() as u32 / 3, height: 1, rgb }
    }

    #[test]
    fn every_colour_is_within_one_code_of_bt601() {
        let picture = colors();
        assert_ne!(picture.width as usize % BLOCK, 0);
        for arch in [Arch::new(), Arch::Scalar] {
            let mut encoder = Encoder { arch, ..Encoder::new(Layout::Yuyv) };
            let mut bytes = Vec::new();
            encoder.encode(&picture, &mut bytes);
            for (pair, &[y0, cb, y1, cr]) in picture.rgb.as_chunks::<6>().0.iter().zip(bytes.as_chunks::<4>().0) {
                let [left, right] =
                    [[pair[0], pair[1], pair[2]], [pair[3], pair[4], pair[5]]].map(|rgb| rgb.map(f64::from));
                let mean = [0, 1, 2].map(|channel| (left[channel] + right[channel]) / 2.0);
                let wanted = [exact(left)[0], exact(mean)[1], exact(right)[0], exact(mean)[2]];
                for (got, wanted) in [y0, cb, y1, cr].into_iter().zip(wanted) {
                    assert!((f64::from(got) - wanted).abs() < 1.0, "{pair:?}: {got} not {wanted}");
                }
            }
        }
    }

    #[test]
    fn grey_has_no_colour_and_the_whole_range() {
        let grey = ColorImage { width: 256, height: 1, rgb: (0..=255).flat_map(|value| [value; 3]).collect() };
        let bytes = encoded(Layout::Yuyv, &grey);
        assert_eq!((bytes[0], bytes[510]), (16, 235));
        assert!(bytes.as_chunks::<2>().0.iter().all(|&[_, chroma]| chroma == 128));
        assert!(bytes.as_chunks::<2>().0.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
    }

    #[test]
    fn every_layout_puts_each_value_in_its_place() {
        let rgb = [[255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255]].as_flattened().repeat(2);
        let picture = ColorImage { width: 4, height: 2, rgb };
        let near = |got: &[u8], wanted: &[u8]| got.iter().zip(wanted).all(|(got, wanted)| got.abs_diff(*wanted) <= 1);
        let row = [81, 90, 81, 240, 41, 240, 41, 110];
        assert!(near(&encoded(Layout::Yuyv, &picture), &[row, row].concat()));
        let luma = [81, 81, 41, 41, 81, 81, 41, 41];
        assert!(near(&encoded(Layout::Yu12, &picture), &[&luma[..], &[90, 240], &[240, 110]].concat()));
        assert!(near(&encoded(Layout::Nv12, &picture), &[&luma[..], &[90, 240, 240, 110]].concat()));
        assert_eq!(encoded(Layout::Rgb24, &picture), picture.rgb);
        assert_eq!(encoded(Layout::Bgr24, &picture)[..9], [0, 0, 255, 0, 0, 255, 255, 0, 0]);
    }

    #[test]
    #[ignore = "measures"]
    fn yuyv_beside_420_planes() {
        let rgb = (0..1280 * 720 * 3).map(|at| (at * 7 % 251) as u8).collect();
        let picture = ColorImage { width: 1280, height: 720, rgb };
        let mut bytes = Vec::new();
        for _ in 0..3 {
            for (name, arch, layout) in [
                ("YUYV", Arch::new(), Layout::Yuyv),
                ("YUYV, baseline", Arch::Scalar, Layout::Yuyv),
                ("YU12", Arch::new(), Layout::Yu12),
            ] {
                let mut encoder = Encoder { arch, ..Encoder::new(layout) };
                let times = std::iter::repeat_with(|| {
                    let began = std::time::Instant::now();
                    encoder.encode(&picture, &mut bytes);
                    began.elapsed()
                });
                println!("{name}: {:?}", times.take(30).min().unwrap_or_default());
            }
        }
    }
}
