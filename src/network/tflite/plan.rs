//! The execution plan of a network: its steps and their shared memory. Each step is checked once, so that none can fail
//! at run time.

use pulp::Arch;

use super::kernels::{Axis, LaneCount, Size, filter_axes};
use super::model::{Activation, MAX_TOTAL_VALUES, Model, Operator, OperatorKind, Tensor};

/// The operation of a step.
pub enum Operation {
    /// Pointwise convolution, of the pixels themselves or of an im2col row (`under`).
    Pointwise {
        weights: Vec<f32>,
        bias: Vec<f32>,
        under: Option<([Axis; 2], Size)>,
    },
    /// Depthwise convolution; `lines` is the size of its ring buffer.
    Depthwise {
        weights: Vec<f32>,
        bias: Vec<f32>,
        axes: [Axis; 2],
        lines: usize,
    },
    /// Transposed convolution with stride 2 and one output channel: the sums are `[pixel][down][across]`.
    TransposedConvolution {
        weights: Vec<f32>,
        bias: Vec<f32>,
    },
    /// Elementwise operation with optional gate and second summand.
    Elementwise {
        gate: Option<usize>,
        b: Option<usize>,
    },
    Mean {
        b: Option<usize>,
    },
    Upsample,
}

/// A step, which reads and writes slots.
pub struct Step {
    pub operation: Operation,
    pub activation: Activation,
    pub input: usize,
    pub size: Size,
    pub output: usize,
    pub result: Size,
}

/// A network that is ready to run.
pub struct Plan {
    pub steps: Vec<Step>,
    /// Number of values of each slot.
    pub slots: Vec<usize>,
    /// Number of values of the working memory of the steps.
    pub scratch: usize,
    pub input: (usize, Size),
    pub output: (usize, Size),
}

/// The slot of a tensor.
struct Allocation {
    slot: usize,
    size: Size,
    /// Number of steps that still read it.
    uses: usize,
}

/// Builds a plan, operator by operator.
struct Planner<'a> {
    model: &'a Model,
    lanes: usize,
    allocations: Vec<Option<Allocation>>,
    free: Vec<usize>,
    plan: Plan,
}

fn picture_size(tensor: &Tensor, lanes: impl Fn(usize) -> usize) -> Result<Size, String> {
    let [1, rows, columns, channels] = tensor.shape[..] else {
        return Err(format!("{:?} is not a picture: {:?}", tensor.name, tensor.shape));
    };
    if rows * columns * channels == 0 {
        return Err(format!("{:?} is empty: {:?}", tensor.name, tensor.shape));
    }
    Ok(Size { rows, columns, channels, lanes: lanes(channels) })
}

impl Plan {
    /// Creates the plan of a model for this machine.
    pub fn new(model: &Model) -> Result<Self, String> {
        let input = picture_size(&model.tensors[model.input], |channels| channels)?;
        let plan =
            Self { steps: Vec::new(), slots: vec![input.len()], scratch: 0, input: (0, input), output: (0, input) };
        let allocations = model.tensors.iter().map(|_| None).collect();
        let lanes = Arch::new().dispatch(LaneCount);
        let mut planner = Planner { model, lanes, allocations, free: Vec::new(), plan };
        planner.allocations[model.input] =
            Some(Allocation { slot: 0, size: input, uses: planner.count_uses(model.input) });
        let mut operators = model.operators.iter().peekable();
        while let Some(operator) = operators.next() {
            let mut operator = operator.clone();
            // Fuse the next operator if nothing else reads this output.
            while let Some(next) = operators.peek()
                && planner.count_uses(operator.output) == 1
                && let Some(both) = fuse_operators(&operator, next)
            {
                operator = both;
                operators.next();
            }
            planner.add_step(&operator)?;
        }
        let output = planner.allocations[model.output].take().ok_or("no operator computes its output")?;
        Ok(Self { output: (output.slot, output.size), ..planner.plan })
    }
}

/// Fuses two operators into one, if the second reads the output of the first and the combination is supported.
fn fuse_operators(first: &Operator, second: &Operator) -> Option<Operator> {
    let other = |k: usize| second.inputs.get(1 - k).copied().filter(|&other| other != first.output);
    let place = second.inputs.iter().position(|&input| input == first.output)?;
    let mut both = Operator { output: second.output, ..first.clone() };
    match (first.kind, second.kind) {
        (_, OperatorKind::Activation(activation))
            if first.activation == Activation::None && fuses_activation(first.kind) =>
        {
            both.activation = activation;
        }
        (OperatorKind::Scale, OperatorKind::Sum) if first.activation == Activation::None && first.inputs.len() == 2 => {
            both.inputs.push(other(place)?);
            both.activation = second.activation;
        }
        (OperatorKind::Sum, OperatorKind::Mean) if first.activation == Activation::None => {
            both.kind = OperatorKind::Mean;
        }
        _ => return None,
    }
    Some(both)
}

/// Returns whether a step can apply an activation to its result.
fn fuses_activation(kind: OperatorKind) -> bool {
    matches!(
        kind,
        OperatorKind::Convolution(_)
            | OperatorKind::Depthwise(_)
            | OperatorKind::TransposedConvolution
            | OperatorKind::Sum
    )
}

impl Planner<'_> {
    /// Returns how many operators read a tensor; the network's output counts as one more.
    fn count_uses(&self, tensor: usize) -> usize {
        let by = self.model.operators.iter().flat_map(|operator| &operator.inputs).filter(|&&input| input == tensor);
        by.count() + usize::from(tensor == self.model.output)
    }

    fn find_picture(&self, tensor: usize) -> Result<(usize, Size), String> {
        let allocation = self.allocations[tensor].as_ref();
        allocation
            .map(|allocation| (allocation.slot, allocation.size))
            .ok_or_else(|| format!("{:?} is used before it is computed", self.model.tensors[tensor].name))
    }

    /// Returns the constants of a tensor; `None` in `shape` matches any size.
    fn constant(&self, tensor: usize, shape: &[Option<usize>]) -> Result<(&[f32], &[usize]), String> {
        let tensor = &self.model.tensors[tensor];
        let fits = tensor.shape.len() == shape.len()
            && !tensor.shape.contains(&0)
            && tensor.shape.iter().zip(shape).all(|(side, wanted)| wanted.is_none_or(|wanted| wanted == *side));
        match &tensor.constant {
            Some(values) if fits => Ok((values, &tensor.shape)),
            _ => Err(format!("{:?} does not have the expected constants: {:?}", tensor.name, tensor.shape)),
        }
    }

    fn padded_bias(&self, tensor: usize, channels: usize) -> Result<Vec<f32>, String> {
        let (values, _) = self.constant(tensor, &[Some(channels)])?;
        let mut bias = values.to_vec();
        bias.resize(self.padded_channels(channels), 0.0);
        Ok(bias)
    }

    /// Rounds channels up to whole vectors.
    fn padded_channels(&self, channels: usize) -> usize {
        channels.next_multiple_of(self.lanes)
    }

    /// Packs weights `[out][depth]` for [`super::kernels::Pointwise`].
    fn pack_weights(&self, weights: &[f32], depth: usize) -> Vec<f32> {
        let (out, all, lanes) = (weights.len() / depth, self.padded_channels(depth), self.lanes);
        let mut packed = vec![0.0; self.padded_channels(out) * all];
        for (channel, weights) in weights.chunks_exact(depth).enumerate() {
            for (k, weight) in weights.iter().enumerate() {
                packed[(channel / lanes * all + k) * lanes + channel % lanes] = *weight;
            }
        }
        packed
    }

    /// Ensures working memory for `values` values.
    fn reserve_scratch(&mut self, values: usize) -> Result<(), String> {
        self.plan.scratch = self.plan.scratch.max(values);
        self.check_memory()
    }

    fn check_memory(&self) -> Result<(), String> {
        let values = self.plan.slots.iter().chain([&self.plan.scratch]).sum::<usize>();
        if values > MAX_TOTAL_VALUES {
            Err(format!("it needs memory for more than {MAX_TOTAL_VALUES} values"))
        } else {
            Ok(())
        }
    }

    fn add_step(&mut self, operator: &Operator) -> Result<(), String> {
        let tensor = &self.model.tensors[operator.output];
        let wrong = || format!("an operator cannot make {:?}: {:?}", tensor.name, tensor.shape);
        let [first, others @ ..] = &operator.inputs[..] else { return Err(wrong()) };
        let (input, size) = self.find_picture(*first)?;
        let lanes = self.lanes;
        let result =
            picture_size(tensor, |_| if operator.kind == OperatorKind::TransposedConvolution { 1 } else { lanes })?;
        let in_vectors = size.lanes == lanes;
        let made = |[rows, columns]: [usize; 2], channels: usize| Size { rows, columns, channels, ..result };
        let like_input = Size { lanes: result.lanes, ..size };
        let (operation, made) = match (operator.kind, others) {
            (OperatorKind::Convolution(steps), &[weights, bias]) => {
                let (weights, shape) = self.constant(weights, &[None, None, None, Some(size.channels)])?;
                let ([out, down, across], bias) = ([shape[0], shape[1], shape[2]], self.padded_bias(bias, shape[0])?);
                let (axes, sides) = filter_axes(&size, [down, across], &steps).ok_or_else(wrong)?;
                let depth = down * across * size.channels;
                let weights = self.pack_weights(weights, depth);
                let alone = in_vectors && [down, across, steps.down, steps.across] == [1; 4];
                let row = Size { rows: 1, columns: sides[1], channels: depth, lanes };
                if !alone {
                    self.reserve_scratch(row.len())?;
                }
                (Operation::Pointwise { weights, bias, under: (!alone).then_some((axes, row)) }, made(sides, out))
            }
            (OperatorKind::Depthwise(steps), &[weights, bias]) if in_vectors && steps.across <= 2 => {
                let (weights, shape) = self.constant(weights, &[Some(1), None, None, Some(size.channels)])?;
                let taps = shape[1] * shape[2];
                let (axes, sides) = filter_axes(&size, [shape[1], shape[2]], &steps).ok_or_else(wrong)?;
                let mut spread = vec![0.0; taps * self.padded_channels(size.channels)];
                for (tap, weights) in weights.chunks_exact(size.channels).enumerate() {
                    for (channel, weight) in weights.iter().enumerate() {
                        spread[(channel / lanes * taps + tap) * lanes + channel % lanes] = *weight;
                    }
                }
                let bias = self.padded_bias(bias, size.channels)?;
                let lines = axes[0].taps * axes[1].padded_len(size.columns, sides[1]) * lanes;
                self.reserve_scratch(lines)?;
                (Operation::Depthwise { weights: spread, bias, axes, lines }, made(sides, size.channels))
            }
            (OperatorKind::TransposedConvolution, &[weights, bias]) if in_vectors => {
                let (weights, _) = self.constant(weights, &[Some(1), Some(2), Some(2), Some(size.channels)])?;
                let (bias, _) = self.constant(bias, &[Some(1)])?;
                let (mut four, weights) = (vec![bias[0]; 4], self.pack_weights(weights, size.channels));
                four.resize(self.padded_channels(4), 0.0);
                self.reserve_scratch(size.pixels() * four.len())?;
                (Operation::TransposedConvolution { weights, bias: four }, made([2 * size.rows, 2 * size.columns], 1))
            }
            (OperatorKind::Activation(_), []) if in_vectors => {
                (Operation::Elementwise { gate: None, b: None }, like_input)
            }
            (OperatorKind::Scale, &[gate, ref b @ ..]) if in_vectors => {
                let ((gate, gate_size), b) =
                    (self.find_picture(gate)?, b.first().map(|&b| self.find_picture(b)).transpose()?);
                let is_gate = gate_size == Size { rows: 1, columns: 1, ..size };
                if !is_gate || b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Operation::Elementwise { gate: Some(gate), b: b.map(|(slot, _)| slot) }, like_input)
            }
            (OperatorKind::Sum, &[b]) if in_vectors => {
                let (b, b_size) = self.find_picture(b)?;
                if b_size != size {
                    return Err(wrong());
                }
                (Operation::Elementwise { gate: None, b: Some(b) }, like_input)
            }
            (OperatorKind::Mean, others) if in_vectors => {
                // The second input is either the axes, or the second summand of a fused sum.
                let b = others.iter().find_map(|&other| self.find_picture(other).ok());
                if b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Operation::Mean { b: b.map(|(slot, _)| slot) }, Size { rows: 1, columns: 1, ..size })
            }
            (OperatorKind::Upsample, _) if in_vectors => {
                self.reserve_scratch(size.columns * lanes)?;
                (Operation::Upsample, made([2 * size.rows, 2 * size.columns], size.channels))
            }
            _ => return Err(wrong()),
        };
        if made != result {
            return Err(wrong());
        }
        let activation = match operator.kind {
            OperatorKind::Activation(activation) => activation,
            _ => operator.activation,
        };
        let output = self.allocate_slot(result.len());
        self.check_memory()?;
        self.plan.steps.push(Step { operation, activation, input, size, output, result });
        for &tensor in &operator.inputs {
            self.release_use(tensor);
        }
        self.allocations[operator.output] =
            Some(Allocation { slot: output, size: result, uses: self.count_uses(operator.output) });
        Ok(())
    }

    /// Allocates a slot for `values` values: the smallest free one that is large enough, or else the largest free one,
    /// enlarged.
    fn allocate_slot(&mut self, values: usize) -> usize {
        let lens = &self.plan.slots;
        let fits = |&&slot: &&usize| (lens[slot] < values, lens[slot].abs_diff(values));
        match self.free.iter().min_by_key(fits).copied() {
            Some(slot) => {
                self.free.retain(|&other| other != slot);
                self.plan.slots[slot] = self.plan.slots[slot].max(values);
                slot
            }
            None => {
                self.plan.slots.push(values);
                self.plan.slots.len() - 1
            }
        }
    }

    fn release_use(&mut self, tensor: usize) {
        if let Some(allocation) = &mut self.allocations[tensor] {
            allocation.uses -= 1;
            if allocation.uses == 0 {
                self.free.push(allocation.slot);
                self.allocations[tensor] = None;
            }
        }
    }
}
