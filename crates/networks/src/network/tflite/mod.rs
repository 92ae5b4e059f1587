//! TFLite networks for person segmentation: MobileNet-like, with a single input and ten kinds of operators
//! ([`model::OperatorKind`]), run on one thread with SIMD. Weights are packed once; memory of intermediate pictures is
//! reused as soon as it is free.

mod filters;
mod fuse;
mod kernels;
mod model;
mod plan;
mod table;

use std::mem;

use pulp::Arch;

pub use model::is_tflite;

use self::filters::{Convolution, Depthwise, copy_lines};
use self::kernels::{Elementwise, Logistic, Mean, Upsample};
use self::model::{Activation, Model};
use self::plan::{Operation, Plan, Step};
use super::{Engine, Network, Port, Tensor};

/// A network run by this module.
pub struct Tflite {
    plan: Plan,
    arch: Arch,
    slots: Vec<Vec<f32>>,
    scratch: Vec<f32>,
}

impl Tflite {
    /// Loads a TFLite file.
    ///
    /// # Errors
    /// The file is truncated, not TFLite, or uses unsupported operators.
    pub fn load(bytes: &[u8]) -> Result<Network, String> {
        let model = Model::read(bytes)?;
        let port = |tensor: usize| {
            let tensor = &model.tensors[tensor];
            vec![Port { name: tensor.name.clone(), shape: tensor.shape.iter().map(|&side| Some(side)).collect() }]
        };
        let (inputs, outputs) = (port(model.input), port(model.output));
        let engine = Box::new(Self::from_model(&model)?);
        Ok(Network { engine, inputs, outputs, runtime: "the built-in TFLite runtime" })
    }

    fn from_model(model: &Model) -> Result<Self, String> {
        let plan = Plan::new(model)?;
        let slots = plan.slots.iter().map(|&values| vec![0.0; values]).collect();
        Ok(Self { scratch: vec![0.0; plan.scratch], slots, plan, arch: Arch::new() })
    }
}

impl Engine for Tflite {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let (slot, size) = self.plan.input;
        let [Tensor { values, shape }] = inputs else { return Err("it takes one input".to_owned()) };
        if shape[..] != [1, size.rows, size.columns, size.channels] || values.len() != size.len() {
            return Err(format!("it takes no input of {shape:?}"));
        }
        self.slots[slot][..values.len()].copy_from_slice(values);
        for step in &self.plan.steps {
            let mut out = mem::take(&mut self.slots[step.output]);
            step.run(&self.slots, &mut out[..step.result.len()], &mut self.scratch, self.arch);
            self.slots[step.output] = out;
        }
        let (slot, size) = self.plan.output;
        outputs.resize_with(1, Tensor::default);
        let picture = &self.slots[slot][..size.len()];
        let shape = [1, size.rows, size.columns, size.channels];
        if size.lanes == size.channels {
            outputs[0].set(shape, picture.iter().copied());
        } else {
            let at =
                |pixel, channel: usize| channel / size.lanes * size.plane() + pixel * size.lanes + channel % size.lanes;
            let places = (0..size.pixels()).flat_map(|pixel| (0..size.channels).map(move |channel| at(pixel, channel)));
            outputs[0].set(shape, places.map(|place| picture[place]));
        }
        Ok(())
    }
}

impl Step {
    /// Computes the picture `out` from those in `slots`; overwrites `scratch`.
    fn run(&self, slots: &[Vec<f32>], out: &mut [f32], scratch: &mut [f32], arch: Arch) {
        let (size, result, activation) = (self.size, self.result, self.activation);
        let input = &slots[self.input][..size.len()];
        let (pixels, plane) = (size.pixels(), result.plane());
        let operand = |slot: &Option<usize>| slot.map(|slot| &slots[slot][..size.len()]);
        let pointwise = |weights: &[f32], bias: &[f32], activation, out: &mut [f32]| {
            let (part, step) = (size.plane(), size.lanes);
            let run = step;
            arch.dispatch(Convolution { input, part, step, run, pixels, weights, bias, activation, out, plane: part });
        };
        match &self.operation {
            Operation::Convolution { weights, bias, axes: None } => pointwise(weights, bias, activation, out),
            Operation::Convolution { weights, bias, axes: Some(axes) } => {
                let [down, across] = axes;
                let (part, pixels) = (across.padded_len(size.columns, result.columns) * size.lanes, result.columns);
                let (step, run) = (across.step * size.lanes, across.taps * size.lanes);
                let lines = &mut scratch[..down.taps * size.blocks() * part];
                lines.fill(0.0);
                for row in 0..result.rows {
                    copy_lines(input, &size, axes, row, part, lines);
                    let (input, out) = (&*lines, &mut out[row * pixels * result.lanes..]);
                    arch.dispatch(Convolution {
                        input,
                        part,
                        step,
                        run,
                        pixels,
                        weights,
                        bias,
                        activation,
                        out,
                        plane,
                    });
                }
            }
            Operation::Depthwise { weights, bias, axes, lines, b } => {
                let (axes, lines) = (*axes, &mut scratch[..*lines]);
                let b = b.map(|slot| &slots[slot][..result.len()]);
                arch.dispatch(Depthwise { input, b, size, axes, weights, bias, activation, out, result, lines });
            }
            Operation::TransposedConvolution { weights, bias } => {
                let (lanes, sums) = (size.lanes, &mut scratch[..pixels * bias.len()]);
                pointwise(weights, bias, activation, sums);
                // Pixel shuffle: the four channels of a pixel are 2x2 pixels of the result.
                for (y, row) in out.chunks_exact_mut(result.columns).enumerate() {
                    let [left, right] = [2 * (y % 2), 2 * (y % 2) + 1].map(|channel| {
                        let first = channel / lanes * size.plane() + channel % lanes;
                        sums[first + y / 2 * size.columns * lanes..].iter().step_by(lanes)
                    });
                    for (pair, (left, right)) in row.as_chunks_mut::<2>().0.iter_mut().zip(left.zip(right)) {
                        *pair = [*left, *right];
                    }
                }
            }
            Operation::Elementwise { gate, b } => {
                let gate = gate.map(|slot| &slots[slot][..]);
                arch.dispatch(Elementwise { a: input, gate, b: operand(b), activation, out, plane });
            }
            Operation::Mean { b } => arch.dispatch(Mean { a: input, b: operand(b), out, plane: size.plane() }),
            Operation::Upsample { filter } => {
                let (row, sums) = scratch.split_at_mut(size.columns * size.lanes);
                let input = match filter {
                    None => input,
                    Some((weights, bias)) => {
                        let sums = &mut sums[..result.len() / 4];
                        pointwise(weights, bias, Activation::None, sums);
                        &*sums
                    }
                };
                arch.dispatch(Upsample { input, size, row, out });
            }
        }
        if activation == Activation::Logistic {
            arch.dispatch(Logistic { values: out });
        }
    }
}

#[cfg(test)]
mod tests;
