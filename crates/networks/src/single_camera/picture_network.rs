//! Feeds pictures to a network: input layout and scaling, and the selection of its output.

use super::shrink::Shrinker;
use super::stillness::StillnessDetector;
use crate::network::{LoadedNetwork, Network, Port, Scaling, Task, Tensor};
use bokehcam::frame::ColorImage;

/// Maximum side of a network's input picture, in pixels.
const MAX_SIDE: usize = 1024;

/// User-given properties of an unknown network; `None` is guessed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hints {
    /// Scaling of the picture's codes.
    pub scaling: Option<Scaling>,
    /// Whether the channel order is blue, green, red.
    pub bgr: Option<bool>,
}

/// A network with a picture input.
pub struct PictureNetwork {
    network: Network,
    /// Columns and rows of the input picture.
    size: (usize, usize),
    /// Whether the input is planar (NCHW) or interleaved (NHWC).
    is_planar: bool,
    scaling: Scaling,
    bgr: bool,
    /// Index of the picture input, and of the output that is used.
    picture: usize,
    output: usize,
    /// Recurrent states: pairs of an input and the output that feeds it for the next picture.
    recurrent_states: Vec<(usize, usize)>,
    inputs: Vec<Tensor>,
    outputs: Vec<Tensor>,
    shrinker: Shrinker,
    /// The shrunk picture, 8-bit RGB.
    shrunk: Vec<u8>,
    /// Detects pictures like the last one that the network ran on; `None` runs it on every picture.
    stillness: Option<StillnessDetector>,
}

/// A network's output: one or two channels, of the network's own size.
#[derive(Clone, Copy, Debug)]
pub struct NetworkOutput<'a> {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Numbers per pixel.
    pub channels: usize,
    values: &'a [f32],
    is_planar: bool,
}

impl NetworkOutput<'_> {
    /// Returns the number of a channel at a pixel.
    #[inline(always)]
    pub fn at(&self, pixel: usize, channel: usize) -> f32 {
        let pixels = self.size.0 * self.size.1;
        self.values[if self.is_planar { channel * pixels + pixel } else { pixel * self.channels + channel }]
    }

    /// Replaces `into` by the numbers of a channel.
    pub fn read_channel(&self, channel: usize, into: &mut Vec<f32>) {
        let pixels = self.size.0 * self.size.1;
        into.clear();
        if self.is_planar || self.channels == 1 {
            into.extend_from_slice(&self.values[channel * pixels..][..pixels]);
        } else {
            into.extend((0..pixels).map(|pixel| self.at(pixel, channel)));
        }
    }
}

/// Returns width and height for a variable input size: small, and divisible by the usual strides of networks.
fn usual_size(task: Task) -> [usize; 2] {
    match task {
        Task::Matte => [256, 144],
        Task::Mono => [320, 192],
    }
}

/// Returns the index of the output that is the result, by its name or else its shape.
fn find_output(outputs: &[Port]) -> Option<usize> {
    let is_named = |port: &Port| {
        let name = port.name.to_lowercase();
        ["pha", "alpha", "mask", "depth"].iter().any(|part| name.contains(part))
    };
    let is_picture = |port: &Port| channel_axis(port, &[1, 2]).is_some();
    let named = outputs.iter().position(|port| is_named(port) && is_picture(port));
    named.or_else(|| outputs.iter().position(is_picture)).or((outputs.len() == 1).then_some(0))
}

impl PictureNetwork {
    /// Finds the inputs and outputs of a network.
    ///
    /// # Errors
    /// The network does not take exactly one picture, takes other inputs than recurrent states and ratios, or has no
    /// usable output.
    pub fn new(LoadedNetwork { network, known }: LoadedNetwork, task: Task, hints: &Hints) -> Result<Self, String> {
        let inputs = &network.inputs;
        let pictures: Vec<usize> = (0..inputs.len()).filter(|&k| channel_axis(&inputs[k], &[3]).is_some()).collect();
        let &[picture] = pictures.as_slice() else {
            return Err(format!(
                "{} of its inputs are pictures of three channels, and exactly one is needed",
                pictures.len()
            ));
        };
        let is_planar = channel_axis(&inputs[picture], &[3]) == Some(1);
        let sides = if is_planar { [3, 2] } else { [2, 1] };
        let usual = usual_size(task);
        let [width, height] = [0, 1].map(|k| inputs[picture].shape[sides[k]].unwrap_or(usual[k]));
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(format!(
                "its input is {width} x {height} pixels, and at most {MAX_SIDE} per side are supported"
            ));
        }
        let outputs = &network.outputs;
        let output = find_output(outputs).ok_or("none of its outputs is a picture with one or two channels")?;
        // Other inputs are recurrent states, in the order of the outputs (as in Robust Video Matting), or a ratio.
        let others = (0..inputs.len()).filter(|&k| k != picture && !is_ratio(&inputs[k]));
        let states =
            (outputs.len() + 1).saturating_sub(inputs.iter().filter(|port| !is_ratio(port)).count())..outputs.len();
        let recurrent_states: Vec<(usize, usize)> = others.clone().zip(states).collect();
        if recurrent_states.len() != others.count() || recurrent_states.iter().any(|&(_, state)| state == output) {
            return Err("it has inputs other than a picture and its own earlier output".to_owned());
        }
        let first_inputs = (0..inputs.len()).map(|k| match k {
            _ if k == picture => Tensor::zeros(&if is_planar { [1, 3, height, width] } else { [1, height, width, 3] }),
            _ if is_ratio(&inputs[k]) => Tensor { shape: vec![1], values: vec![1.0] },
            // Variable sizes of states are 1 at first: one number is broadcast.
            _ => Tensor::zeros(&inputs[k].shape.iter().map(|side| side.unwrap_or(1)).collect::<Vec<_>>()),
        });
        let inputs = first_inputs.collect();
        // A network with a memory gets every picture.
        let is_skippable = task == Task::Matte && recurrent_states.is_empty();
        let stillness = is_skippable.then(|| StillnessDetector::new((width, height)));
        let usual_scaling = match task {
            Task::Matte => Scaling::UNIT,
            Task::Mono => Scaling::IMAGENET,
        };
        let scaling = hints.scaling.or(known.map(|known| known.scaling)).unwrap_or(usual_scaling);
        let bgr = hints.bgr.or(known.map(|known| known.bgr)).unwrap_or(false);
        Ok(Self {
            network,
            size: (width, height),
            is_planar,
            scaling,
            bgr,
            picture,
            output,
            recurrent_states,
            inputs,
            outputs: Vec::new(),
            shrinker: Shrinker::default(),
            shrunk: vec![0; 3 * width * height],
            stillness,
        })
    }

    /// Resets the recurrent states, for a new scene.
    pub fn reset(&mut self) {
        for &(input, _) in &self.recurrent_states {
            self.inputs[input].values.fill(0.0);
        }
        self.stillness.iter_mut().for_each(StillnessDetector::reset);
    }

    /// Whether the picture that was set hardly differs from the last one for which this returned false, so that the
    /// network would return the same.
    pub fn is_still(&mut self) -> bool {
        self.stillness.as_mut().is_some_and(StillnessDetector::is_still)
    }

    /// Appends to `at_rest` whether each pixel of an output of this size (columns, rows) has not changed for this many
    /// pictures; nothing if that is not watched.
    pub fn append_at_rest(&self, pictures: u32, size: (usize, usize), at_rest: &mut Vec<bool>) {
        if let Some(stillness) = &self.stillness {
            stillness.append_at_rest(pictures, self.size, size, at_rest);
        }
    }

    /// Runs the network on the picture set by [`Self::set_picture`].
    ///
    /// # Errors
    /// The runtime fails, or the output is no picture of finite numbers.
    pub fn run(&mut self) -> Result<NetworkOutput<'_>, String> {
        self.fill_input();
        self.network.run(&self.inputs, &mut self.outputs)?;
        for &(input, output) in &self.recurrent_states {
            std::mem::swap(&mut self.inputs[input], &mut self.outputs[output]);
        }
        let output = self.outputs.get(self.output).ok_or("it gives no output")?;
        let output = parse_output(output).ok_or_else(|| format!("its output is not a picture: {:?}", output.shape))?;
        match output.values.iter().all(|value| value.is_finite()) {
            true => Ok(output),
            false => Err("its output has a value that is not a number".to_owned()),
        }
    }

    /// Sets the input picture for [`Self::run`].
    pub fn set_picture(&mut self, color: &ColorImage) {
        if self.shrinker.set_sizes((color.width as usize, color.height as usize), self.size) {
            self.stillness.iter_mut().for_each(StillnessDetector::reset);
        }
        for (y, row) in self.shrunk.chunks_exact_mut(3 * self.size.0).enumerate() {
            self.shrinker.shrink_row(color, y, row);
            self.stillness.iter_mut().for_each(|stillness| stillness.add_row(y, row));
        }
    }

    /// Converts the picture to the network's values and layout.
    fn fill_input(&mut self) {
        let order = if self.bgr { [2, 1, 0] } else { [0, 1, 2] };
        let Scaling { mean, divisor } = self.scaling;
        let (pixels, values) = (self.shrunk.as_chunks::<3>().0, &mut self.inputs[self.picture].values);
        for c in 0..3 {
            let scaled: [f32; 256] = std::array::from_fn(|code| (code as f32 - mean[c]) * divisor[c].recip());
            let codes = pixels.iter().map(|pixel| scaled[usize::from(pixel[order[c]])]);
            if self.is_planar {
                values[c * pixels.len()..].iter_mut().zip(codes).for_each(|(value, scaled)| *value = scaled);
            } else {
                values.as_chunks_mut::<3>().0.iter_mut().zip(codes).for_each(|(value, scaled)| value[c] = scaled);
            }
        }
    }
}

/// Returns the channel axis of a picture port with one of these channel counts, 1 or 3; `None` if it is not a picture.
fn channel_axis(port: &Port, channels: &[usize]) -> Option<usize> {
    let &[batch, is_planar, _, last] = port.shape.as_slice() else { return None };
    let has = |side: Option<usize>| side.is_some_and(|side| channels.contains(&side));
    match () {
        () if batch.is_some_and(|batch| batch != 1) => None,
        () if has(is_planar) => Some(1),
        () if has(last) => Some(3),
        () => None,
    }
}

/// Whether the port is a scalar, such as a downsampling ratio.
fn is_ratio(port: &Port) -> bool {
    port.shape.len() <= 1
}

/// Interprets a tensor as a picture of one or two channels, by its shape.
fn parse_output(tensor: &Tensor) -> Option<NetworkOutput<'_>> {
    let values = tensor.values.as_slice();
    let (is_planar, channels, height, width) = match *tensor.shape.as_slice() {
        [1, channels @ 1..=2, height, width] => (true, channels, height, width),
        [1, height, width, channels @ 1..=2] => (false, channels, height, width),
        [1, height, width] | [height, width] => (true, 1, height, width),
        _ => return None,
    };
    let is_valid = width > 1 && height > 1 && width * height * channels == values.len();
    is_valid.then_some(NetworkOutput { size: (width, height), channels, values, is_planar })
}
