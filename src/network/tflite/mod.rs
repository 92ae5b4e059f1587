//! Networks in TFLite files of the kind that tells persons from rooms: MobileNet-like ones for one picture, made of ten kinds
//! of operators ([`model::Kind`]), run on one thread with the machine's vectors. Weights are packed once; the memory of pictures
//! between the operators is shared as soon as it is free.

mod kernels;
mod model;
mod plan;
mod table;

use std::mem;

use pulp::Arch;

pub use model::is_tflite;

use self::kernels::{Depthwise, Each, Enlarge, Mean, PADDED, Pointwise, under_filter};
use self::model::Model;
use self::plan::{Plan, Step, Work};
use super::{Engine, Network, Port, Tensor};

/// A network that runs here.
pub struct Tflite {
    plan: Plan,
    arch: Arch,
    slots: Vec<Vec<f32>>,
    scratch: Vec<f32>,
}

impl Tflite {
    pub fn load(bytes: &[u8]) -> Result<Network, String> {
        let model = Model::read(bytes)?;
        let plan = Plan::new(&model)?;
        let port = |tensor: usize| {
            let tensor = &model.tensors[tensor];
            vec![Port { name: tensor.name.clone(), shape: tensor.shape.iter().map(|&side| Some(side)).collect() }]
        };
        let slots = plan.slots.iter().map(|&values| vec![0.0; values]).collect();
        let engine = Box::new(Self { scratch: vec![0.0; plan.scratch], slots, plan, arch: Arch::new() });
        let (inputs, outputs) = (port(model.input), port(model.output));
        Ok(Network { engine, inputs, outputs, runtime: "the built-in runtime for TFLite".to_owned() })
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
        let pixels = self.slots[slot][..size.len()].chunks_exact(size.stride);
        let values = pixels.flat_map(|pixel| &pixel[..size.channels]).copied();
        outputs[0].set([1, size.rows, size.columns, size.channels], values);
        Ok(())
    }
}

impl Step {
    fn run(&self, slots: &[Vec<f32>], out: &mut [f32], scratch: &mut [f32], arch: Arch) {
        let (size, activation, stride) = (self.size, self.activation, self.result.stride);
        let input = &slots[self.input][..size.len()];
        let row_len = self.result.columns * stride;
        let seen = |slot: &Option<usize>| slot.map(|slot| &slots[slot][..size.len()]);
        match &self.work {
            Work::Pointwise { weights, bias, depth, under: None } => {
                let (weights, bias, depth, apart) = (&weights[..], &bias[..], *depth, size.stride);
                arch.dispatch(Pointwise { input, apart, depth, weights, bias, activation, out, stride });
            }
            Work::Pointwise { weights, bias, depth, under: Some(axes) } => {
                let (weights, bias, depth) = (&weights[..], &bias[..], *depth);
                let under = &mut scratch[..self.result.columns * depth];
                for (row, out) in out.chunks_exact_mut(row_len).enumerate() {
                    under_filter(input, &size, axes, row, under);
                    arch.dispatch(Pointwise {
                        input: under, apart: depth, depth, weights, bias, activation, out, stride,
                    });
                }
            }
            Work::Depthwise { weights, bias, axes } => {
                let (axes, columns) = (*axes, self.result.columns);
                arch.dispatch(Depthwise { input, size, axes, weights, bias, activation, out, columns });
            }
            Work::Doubling { weights, bias } => {
                let four = &mut scratch[..size.columns * PADDED];
                let rows = input.chunks_exact(size.columns * size.stride);
                for (input, out) in rows.zip(out.chunks_exact_mut(2 * row_len)) {
                    let (depth, apart) = (size.channels, size.stride);
                    arch.dispatch(Pointwise {
                        input, apart, depth, weights, bias, activation, out: four, stride: PADDED,
                    });
                    for (down, out) in out.chunks_exact_mut(row_len).enumerate() {
                        for (pair, four) in out.as_chunks_mut::<2>().0.iter_mut().zip(four.chunks_exact(PADDED)) {
                            pair.copy_from_slice(&four[2 * down..][..2]);
                        }
                    }
                }
            }
            Work::Each { gate, b } => {
                let gate = gate.map(|slot| &slots[slot][..stride]);
                arch.dispatch(Each { a: input, gate, b: seen(b), activation, out, stride });
            }
            Work::Mean { b } => arch.dispatch(Mean { a: input, b: seen(b), out }),
            Work::Enlarge => {
                let row = &mut scratch[..size.columns * size.stride];
                arch.dispatch(Enlarge { input, size, row, out });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "needs BOKEHCAM_TFLITE"]
    fn proto() {
        let bytes = std::fs::read(std::env::var("BOKEHCAM_TFLITE").unwrap()).unwrap();
        let mut ours = Tflite::load(&bytes).unwrap();
        println!("{:?} {:?}", ours.inputs, ours.outputs);
        let onnx = std::fs::read(std::env::var("BOKEHCAM_ONNX").unwrap()).unwrap();
        let mut theirs = super::super::built_in::BuiltIn::load(onnx).unwrap();
        println!("{:?} {:?}", theirs.inputs, theirs.outputs);
        let mut seed = 1u32;
        let values: Vec<f32> = (0..144 * 256 * 3)
            .map(|k| {
                seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
                ((k / 768) as f32 / 144.0 * 0.7 + (seed >> 8) as f32 / (1 << 24) as f32 * 0.3).min(1.0)
            })
            .collect();
        let input = [Tensor { shape: vec![1, 144, 256, 3], values }];
        let (mut a, mut b) = (Vec::new(), Vec::new());
        ours.run(&input, &mut a).unwrap();
        theirs.run(&input, &mut b).unwrap();
        println!("{:?} {:?}", a[0].shape, b[0].shape);
        let most = a[0].values.iter().zip(&b[0].values).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("most {most} of {:?}", b[0].values.iter().fold((9f32, 0f32), |(l, h), &v| (l.min(v), h.max(v))));
        for (name, network) in [("ours", &mut ours), ("theirs", &mut theirs)] {
            let mut out = Vec::new();
            let mut best = f64::MAX;
            for _ in 0..60 {
                let from = std::time::Instant::now();
                network.run(&input, &mut out).unwrap();
                best = best.min(from.elapsed().as_secs_f64());
            }
            println!("{name} {:.3} ms", best * 1e3);
        }
    }
}
