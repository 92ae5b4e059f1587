//! Upload of depth as CoC in 16 bits: the format in which the passes store it, and all they need of depth.

use pulp::{Arch, Simd, WithSimd};
use wgpu::{Queue, QueueWriteBufferView};

use crate::frame::DepthMap;
use crate::optics::DepthCoc;

/// Pixels that are converted before they are copied, so that they stay in the nearest cache. Even, as two are a word.
const BLOCK: usize = 1024;
/// Code of the largest CoC, as `unpack2x16snorm` reads it.
const MAX_CODE: f32 = 32_767.0;
/// A float of this size has no fraction, and its lowest bits are the integer, also for negative integers.
const NO_FRACTION: f32 = 12_582_912.0;

/// Returns the bytes of a map of `pixels` pixels, in whole words.
pub fn radii_bytes(pixels: usize) -> u64 {
    (2 * pixels).next_multiple_of(4) as u64
}

/// Writes the CoC of a map to `buffer`, as signed square roots of its fraction of `max_px`, an upper bound: the same
/// 16 bits as in the scene (`pack_scene` of `common.wgsl`), so that no extra rounding occurs.
pub fn upload_coc(queue: &Queue, buffer: &wgpu::Buffer, map: &DepthMap, lens: DepthCoc, max_px: f32) {
    let Some(size) = wgpu::BufferSize::new(radii_bytes(map.metres.len())) else { return };
    // A failed device returns no memory; the failure is reported later.
    if let Some(to) = queue.write_buffer_with(buffer, 0, size) {
        Arch::new().dispatch(UploadCoc { lens, metres: &map.metres, max_px, to });
    }
}

struct UploadCoc<'a> {
    lens: DepthCoc,
    metres: &'a [f32],
    max_px: f32,
    /// Mapped memory, written once and in order.
    to: QueueWriteBufferView,
}

impl WithSimd for UploadCoc<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let (mut codes, mut at) = ([0; BLOCK], 0);
        for metres in self.metres.chunks(BLOCK) {
            encode_coc(&self.lens, self.max_px, metres, &mut codes);
            // The last word of an odd number of pixels is padded with a stale code.
            let bytes: &[u8] = bytemuck::cast_slice(&codes[..metres.len().next_multiple_of(2)]);
            self.to.slice(at..at + bytes.len()).copy_from_slice(bytes);
            at += bytes.len();
        }
    }
}

/// Converts depth to CoC in 16 bits.
#[inline(always)]
fn encode_coc(lens: &DepthCoc, max_px: f32, metres: &[f32], codes: &mut [u16; BLOCK]) {
    let fraction_per_px = 1.0 / max_px;
    for (code, &metres) in codes.iter_mut().zip(metres) {
        let coc_px = lens.coc_px(metres);
        let root = (coc_px.abs() * fraction_per_px).sqrt().copysign(coc_px);
        *code = (root * MAX_CODE + NO_FRACTION).to_bits() as u16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_sharp_stays_so_and_all_else_is_off_by_half_a_step_at_most() {
        let metres_m = (0..8000).map(|step| 1e-4 * 10f32.powf(step as f32 * 1e-3));
        let odd_m = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-40, 6e-8, 65_536.0, 1e12, f32::MAX];
        let metres: Vec<f32> = metres_m.chain(odd_m).collect();
        for (coc_at_infinity_px, range_m, max_coc_px) in
            [(16.0, 0.5, 40.0), (300.0, 0.0, 300.0), (20.0, 0.0, 7.0), (0.3, 0.0, 1e-3), (1e-4, 0.0, 5.0)]
        {
            let lens = DepthCoc { coc_at_infinity_px, focus_m: 2.0, range_m, max_coc_px };
            let root_of = |coc_px: f32| (coc_px / max_coc_px).abs().sqrt().copysign(coc_px) * MAX_CODE;
            let mut codes = [0; BLOCK];
            for metres in metres.chunks(BLOCK) {
                encode_coc(&lens, max_coc_px, metres, &mut codes);
                for (&metres, &code) in metres.iter().zip(&codes) {
                    let (exact, code) = (root_of(lens.coc_px(metres)), f32::from(code as i16));
                    assert!((code - exact).abs() <= 0.51, "{metres} m: {code} not {exact}");
                }
            }
        }
    }
}
