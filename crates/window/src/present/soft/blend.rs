//! Blending of premultiplied colours in words `0xAARRGGBB`.

/// Two channels are computed at once, in the low bytes of two 16-bit halves. `ONE` is 256 and `HALF` 128 in both.
const PAIR_MASK: u32 = 0x00ff_00ff;
const ONE: u32 = 0x0100_0100;
const HALF: u32 = 0x0080_0080;

/// Composites `color` over `below` (Porter-Duff), rounding each channel. A colour brighter than its alpha adds light;
/// channels saturate at 255.
#[inline(always)]
pub fn over(color: u32, below: u32) -> u32 {
    let transmittance = 255 - (color >> 24);
    let low = add_saturating(color & PAIR_MASK, scale_pair(below & PAIR_MASK, transmittance));
    let high = add_saturating((color >> 8) & PAIR_MASK, scale_pair((below >> 8) & PAIR_MASK, transmittance));
    low | high << 8
}

/// Multiplies two channels by `by` / 255, rounded.
#[inline(always)]
fn scale_pair(pair: u32, by: u32) -> u32 {
    let product = pair * by + HALF;
    // Division by 255, exact for every product of two bytes.
    ((product + ((product >> 8) & PAIR_MASK)) >> 8) & PAIR_MASK
}

/// Adds two pairs of channels, saturating each at 255.
#[inline(always)]
fn add_saturating(a: u32, b: u32) -> u32 {
    let sum = a + b;
    let overflow = sum & ONE;
    // 256 - 1 sets all bits of a channel that overflowed.
    (sum | (overflow - (overflow >> 8))) & PAIR_MASK
}

/// Multiplies a texel by a colour (red, green, blue, alpha) per channel: products / 255, rounded.
#[inline(always)]
pub fn modulate(texel: u32, color: [u8; 4]) -> u32 {
    let [a, r, g, b] = texel.to_be_bytes();
    let times = |x: u8, y: u8| {
        let product = u32::from(x) * u32::from(y) + 128;
        ((product + (product >> 8)) >> 8) as u8
    };
    u32::from_be_bytes([times(a, color[3]), times(r, color[0]), times(g, color[1]), times(b, color[2])])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_is_the_rounded_sum() {
        for alpha in 0..=255_u32 {
            for below in 0..=255_u32 {
                for light in [0, alpha / 3, alpha, 255] {
                    let remaining = f64::from(below) * f64::from(255 - alpha) / 255.0;
                    let expected = (light + remaining.round() as u32).min(255);
                    let got = over((alpha << 24) | (light * 0x0001_0101), below * 0x0101_0101);
                    let alpha_left = (alpha + remaining.round() as u32).min(255);
                    assert_eq!(got, (alpha_left << 24) | (expected * 0x0001_0101), "{alpha} {light} {below}");
                }
            }
        }
    }

    #[test]
    fn a_product_is_rounded() {
        for (x, y) in (0..=255_u8).flat_map(|x| (0..=255_u8).map(move |y| (x, y))) {
            let expected = (f64::from(x) * f64::from(y) / 255.0).round() as u32;
            assert_eq!(modulate(u32::from(x) * 0x0101_0101, [y; 4]), expected * 0x0101_0101, "{x} {y}");
        }
    }
}
