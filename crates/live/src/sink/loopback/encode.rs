//! Encodes pictures in V4L2 pixel layouts; Y'CbCr in BT.601, limited range.

use crate::layout::Range;
use crate::sink::yuv::Converter;
use crate::sink::yuyv;
use crate::v4l2::loopback::Layout;
use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;

/// Encodes pictures in one layout.
pub(super) struct Encoder {
    layout: Layout,
    yuyv: yuyv::Encoder,
    planar: Converter,
    /// Scratch buffer: planes to be interleaved.
    planes: Vec<u8>,
}

impl Encoder {
    pub(super) fn new(layout: Layout) -> Self {
        Self {
            layout,
            yuyv: yuyv::Encoder::new(),
            planar: Converter::new(YcbcrMatrix::Bt601, Range::Limited),
            planes: Vec::new(),
        }
    }

    /// Encodes `picture` into `bytes`, which are resized to a frame of the layout.
    pub(super) fn encode(&mut self, picture: &ColorImage, bytes: &mut Vec<u8>) {
        match self.layout {
            Layout::Yuyv => {
                bytes.resize(self.layout.frame_bytes(picture.size()), 0);
                self.yuyv.encode(picture, bytes);
            }
            Layout::Yu12 => {
                bytes.clear();
                self.planar.append_planes(picture, bytes);
            }
            Layout::Nv12 => {
                // NV12 is planar 4:2:0 with the two chroma planes interleaved.
                self.planes.clear();
                self.planar.append_planes(picture, &mut self.planes);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(layout: Layout, picture: &ColorImage) -> Vec<u8> {
        // Previous content must not matter.
        let mut bytes = vec![9; 77];
        Encoder::new(layout).encode(picture, &mut bytes);
        assert_eq!(bytes.len(), layout.frame_bytes(picture.size()));
        bytes
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
            for layout in [Layout::Yuyv, Layout::Yu12] {
                let mut encoder = Encoder::new(layout);
                let times = std::iter::repeat_with(|| {
                    let began = std::time::Instant::now();
                    encoder.encode(&picture, &mut bytes);
                    began.elapsed()
                });
                println!("{layout:?}: {:?}", times.take(30).min().unwrap_or_default());
            }
        }
    }
}
