//! R'G'B' to YUYV conversion: Y Cb Y Cr, two pixels sharing their chroma (4:2:2); ITU-R BT.601, limited range, as
//! readers of cameras assume. twin: shaders/blur/yuyv.wgsl

use pulp::{Arch, Simd, WithSimd};

use bokehcam::frame::ColorImage;

/// Encodes pictures with an even number of pixels.
pub struct Encoder {
    arch: Arch,
}

impl Encoder {
    /// Creates an encoder that uses the best instruction set of this processor.
    pub fn new() -> Self {
        Self { arch: Arch::new() }
    }

    /// Encodes `picture` into `yuyv`, which has two bytes per pixel.
    pub fn encode(&self, picture: &ColorImage, yuyv: &mut [u8]) {
        self.arch.dispatch(YuyvEncode { rgb: &picture.rgb, yuyv });
    }
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

/// Number of pixels converted together: a multiple of every vector width.
const BLOCK: usize = 64;

/// Converts an even number of pixels, with all rows as one: every pair from the first pixel on shares its chroma.
struct YuyvEncode<'a> {
    rgb: &'a [u8],
    yuyv: &'a mut [u8],
}

impl WithSimd for YuyvEncode<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (blocks, rest) = self.rgb.as_chunks::<{ 3 * BLOCK }>();
        let (to_blocks, to_rest) = self.yuyv.as_chunks_mut::<{ 2 * BLOCK }>();
        for (rgb, yuyv) in blocks.iter().zip(to_blocks.iter_mut()) {
            rgb_to_yuyv(rgb, yuyv);
        }
        if !rest.is_empty() {
            // The remainder is padded to a block.
            let (mut rgb, mut yuyv) = ([0; 3 * BLOCK], [0; 2 * BLOCK]);
            rgb[..rest.len()].copy_from_slice(rest);
            rgb_to_yuyv(&rgb, &mut yuyv);
            let len = to_rest.len();
            to_rest.copy_from_slice(&yuyv[..len]);
        }
    }
}

/// Converts pixels to YUYV (BT.601, limited range), within one code value of the exact result. 16-bit integers with
/// 8-bit coefficients fit the most pixels into a vector. Two pixels are loaded as three words and stored as two: words
/// are cheaper to shuffle than bytes.
#[inline(always)]
fn rgb_to_yuyv(rgb: &[u8; 3 * BLOCK], yuyv: &mut [u8; 2 * BLOCK]) {
    const PAIRS: usize = BLOCK / 2;
    let (mut rg, mut br, mut gb) = ([0_u16; PAIRS], [0_u16; PAIRS], [0_u16; PAIRS]);
    for pair in 0..PAIRS {
        let word = |at: usize| u16::from_le_bytes([rgb[6 * pair + at], rgb[6 * pair + at + 1]]);
        (rg[pair], br[pair], gb[pair]) = (word(0), word(2), word(4));
    }
    // At most 56 228: no overflow.
    let luma = |r: u16, g: u16, b: u16| ((66 * r + 129 * g + 25 * b + 128) >> 8) + 16;
    let bytes = |word: u16| (word & 0xFF, word >> 8);
    let (mut left, mut right) = ([0_u16; PAIRS], [0_u16; PAIRS]);
    for pair in 0..PAIRS {
        let ((r0, g0), (b0, r1), (g1, b1)) = (bytes(rg[pair]), bytes(br[pair]), bytes(gb[pair]));
        let (r, g, b) = ((r0 + r1) as i16, (g0 + g1) as i16, (b0 + b1) as i16);
        // The coefficients are halved, since these are sums of two pixels: at most 28 560 in magnitude.
        let cb = (((56 * b - 19 * r - 37 * g + 128) >> 8) + 128) as u16;
        let cr = (((56 * r - 47 * g - 9 * b + 128) >> 8) + 128) as u16;
        (left[pair], right[pair]) = (luma(r0, g0, b0) | cb << 8, luma(r1, g1, b1) | cr << 8);
    }
    for pair in 0..PAIRS {
        let bytes = (u32::from(left[pair]) | u32::from(right[pair]) << 16).to_le_bytes();
        yuyv[4 * pair..][..4].copy_from_slice(&bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference Y'CbCr of BT.601 in limited range, not rounded.
    fn exact([r, g, b]: [f64; 3]) -> [f64; 3] {
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        [
            16.0 + 219.0 / 255.0 * luma,
            128.0 + 224.0 / 255.0 * (b - luma) / (2.0 * (1.0 - 0.114)),
            128.0 + 224.0 / 255.0 * (r - luma) / (2.0 * (1.0 - 0.299)),
        ]
    }

    /// Every 5th value of each channel in pairs of unequal pixels; the count is not a multiple of a block.
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
            let mut bytes = vec![9; 2 * picture.width as usize];
            Encoder { arch }.encode(&picture, &mut bytes);
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
        let mut bytes = vec![9; 512];
        Encoder::new().encode(&grey, &mut bytes);
        assert_eq!((bytes[0], bytes[510]), (16, 235));
        assert!(bytes.as_chunks::<2>().0.iter().all(|&[_, chroma]| chroma == 128));
        assert!(bytes.as_chunks::<2>().0.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
    }
}
