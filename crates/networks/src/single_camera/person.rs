//! Person mask from a network, temporally smoothed where it is unsure.

use pulp::{Arch, Simd, WithSimd};

use super::mask_postprocess::MaskPostProcessor;
use super::picture_network::PictureNetwork;
use bokehcam::frame::{ColorImage, Mask};

/// Weight of the previous frame for an undecided pixel at 30 frames a second; it decreases with longer gaps.
const PREVIOUS_WEIGHT: f32 = 0.8;
const FRAME_NS: f32 = 1e9 / 30.0;
/// Number of pictures without any change after which a place is at rest, about a minute: who breathes is not.
const MIN_REST_PICTURES: u32 = 1800;
/// Lower mask values are 0: those of a sure network are so small that arithmetic with them is slow.
const MIN_ALPHA: f32 = 1e-6;

/// Computes the person mask from frame to frame.
pub struct PersonSegmenter {
    picture_network: PictureNetwork,
    /// The network's mask, and after temporal smoothing.
    decoded: Vec<f32>,
    smoothed: Mask,
    mask_postprocess: MaskPostProcessor,
    mask: Mask,
    /// Whether the network outputs logits: values outside of 0 to 1 were seen.
    is_logits: bool,
    /// When the previous picture was taken.
    seen_ns: Option<u64>,
    /// Whether the mask is that of an earlier picture, from which the last one hardly differs.
    is_still: bool,
}

impl PersonSegmenter {
    pub fn new(picture_network: PictureNetwork) -> Self {
        Self {
            picture_network,
            decoded: Vec::new(),
            smoothed: Mask::default(),
            mask_postprocess: MaskPostProcessor::default(),
            mask: Mask::default(),
            is_logits: false,
            seen_ns: None,
            is_still: false,
        }
    }

    /// Resets the state, for a new scene.
    pub fn reset(&mut self) {
        self.picture_network.reset();
        self.mask_postprocess.reset();
        self.seen_ns = None;
    }

    /// Returns whether the mask of an earlier picture served for the last one.
    pub fn is_still(&self) -> bool {
        self.is_still
    }

    /// Returns the mask of the last picture.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Computes the mask of a picture taken at `time_ns`. Undecided pixels are averaged with the previous frame's and
    /// decided ones not, so that nothing lags (as in MediaPipe). If it `takes_two` masks, a person is there from the second
    /// one on.
    ///
    /// # Errors
    /// See [`PictureNetwork::infer`].
    pub fn run(&mut self, color: &ColorImage, time_ns: u64, takes_two: bool) -> Result<(), String> {
        self.picture_network.set_picture(color);
        self.is_still = self.picture_network.is_still() && !self.mask_postprocess.is_waiting();
        if self.is_still {
            return Ok(());
        }
        let output = self.picture_network.run()?;
        // Of two channels, the second one is the person.
        output.read_channel(output.channels - 1, &mut self.decoded);
        self.is_logits |= self.decoded.iter().fold(false, |is, value| is | !(-0.01..=1.01).contains(value));
        if self.is_logits {
            for (pixel, value) in self.decoded.iter_mut().enumerate() {
                *value = sigmoid(*value - if output.channels == 1 { 0.0 } else { output.at(pixel, 0) });
            }
        }
        let size = (output.size.0 as u32, output.size.1 as u32);
        let before_ns = self.seen_ns.filter(|_| (self.smoothed.width, self.smoothed.height) == size);
        let previous_weight = before_ns.map_or(0.0, |before_ns| previous_weight(time_ns.abs_diff(before_ns)));
        self.smoothed.resize(size.0, size.1);
        Arch::new().dispatch(Smooth { new: &self.decoded, previous_weight, smoothed: &mut self.smoothed.alpha });
        self.seen_ns = Some(time_ns);
        let (network, size) = (&self.picture_network, (size.0 as usize, size.1 as usize));
        self.mask_postprocess.set_at_rest(|at_rest| network.append_at_rest(MIN_REST_PICTURES, size, at_rest));
        self.mask_postprocess.postprocess(&self.smoothed, &self.decoded, takes_two, &mut self.mask);
        Ok(())
    }
}

/// Averages the undecided pixels of a mask with those of the previous frame, which `smoothed` has. Those of the room stay
/// that: where a person was it must not be sharp.
struct Smooth<'a> {
    new: &'a [f32],
    previous_weight: f32,
    smoothed: &'a mut [f32],
}

impl WithSimd for Smooth<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (alpha, &new) in self.smoothed.iter_mut().zip(self.new) {
            let new = if new < MIN_ALPHA { 0.0 } else { new.min(1.0) };
            let smoothed = new + (*alpha - new) * (self.previous_weight * uncertainty(new));
            *alpha = if new < 0.5 { smoothed.min(0.5) } else { smoothed };
        }
    }
}

/// Returns the weight of a previous frame so long ago: a person has moved by then.
fn previous_weight(gap_ns: u64) -> f32 {
    PREVIOUS_WEIGHT.powf((gap_ns as f32 / FRAME_NS).max(1.0))
}

fn sigmoid(value: f32) -> f32 {
    1.0 / (1.0 + (-value).exp())
}

/// Returns the uncertainty of a mask value: 1 at one half, 0 at 0 and 1. Approximates binary entropy by a power of a
/// parabola.
#[inline(always)]
fn uncertainty(alpha: f32) -> f32 {
    let off = 2.0 * alpha - 1.0;
    // The power 3/4, by roots, which take a fraction of its time.
    let root = (1.0 - off * off).max(0.0).sqrt();
    root * root.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_seen_long_ago_says_little() {
        assert!(
            (previous_weight(33_333_333) - 0.8).abs() < 1e-4 && previous_weight(0) == 0.8,
            "nothing lags at a camera's pace"
        );
        assert!((previous_weight(66_666_666) - 0.64).abs() < 1e-4, "as if the missing one had been seen");
        assert!(previous_weight(400_000_000) < 0.07);
    }

    #[test]
    fn an_undecided_pixel_is_averaged_and_where_somebody_was_is_room() {
        let new = [0.0, 0.4, 0.4, 0.6, 1.0];
        let mut smoothed = [1.0, 1.0, 0.2, 1.0, 0.0];
        Arch::new().dispatch(Smooth { new: &new, previous_weight: PREVIOUS_WEIGHT, smoothed: &mut smoothed });
        assert_eq!([smoothed[0], smoothed[1], smoothed[4]], [0.0, 0.5, 1.0]);
        assert!((0.2..0.3).contains(&smoothed[2]) && (0.8..1.0).contains(&smoothed[3]), "{smoothed:?}");
    }

    #[test]
    fn uncertainty_is_that_of_a_coin() {
        for step in 1..100 {
            let alpha = step as f32 / 100.0;
            let entropy = -alpha * alpha.log2() - (1.0 - alpha) * (1.0 - alpha).log2();
            assert!((uncertainty(alpha) - entropy).abs() < 0.03, "{alpha}: {} {entropy}", uncertainty(alpha));
        }
        assert_eq!((uncertainty(0.0), uncertainty(1.0), uncertainty(0.5)), (0.0, 0.0, 1.0));
    }
}
