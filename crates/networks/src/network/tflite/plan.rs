//! The execution plan of a network: its steps and their shared memory. Each step is checked once, so that none can fail
//! at run time.

mod convolutions;

use pulp::Arch;

use super::fuse::fuse_operators;
use super::kernels::{Axis, LaneCount, Size, filter_axes};
use super::model::{Activation, MAX_TOTAL_VALUES, Model, Operator, OperatorKind, Strides, Tensor};

/// Maximum number of multiplications for a picture: seconds; networks for live pictures need a hundredth.
const MAX_WORK: usize = 1 << 35;

/// The operation of a step.
pub enum Operation {
    /// Convolution; a pointwise one has no axes.
    Convolution {
        weights: Vec<f32>,
        bias: Vec<f32>,
        axes: Option<[Axis; 2]>,
    },
    /// Depthwise convolution plus a picture; `lines` is the size of its ring buffer.
    Depthwise {
        weights: Vec<f32>,
        bias: Vec<f32>,
        axes: [Axis; 2],
        lines: usize,
        b: Option<usize>,
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
    /// Upsampling of the picture, or of its pointwise convolution.
    Upsample {
        filter: Option<(Vec<f32>, Vec<f32>)>,
    },
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

/// The operation for an operator.
struct Planned {
    operation: Operation,
    /// Size of its result, with the lanes of its input.
    size: Size,
    /// Number of multiplications for a value of the result.
    work: usize,
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
    /// Number of values of all packed constants.
    constants: usize,
    /// Number of multiplications for a picture.
    work: usize,
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
        let mut planner = Planner { model, lanes, allocations, free: Vec::new(), plan, constants: 0, work: 0 };
        planner.allocations[model.input] =
            Some(Allocation { slot: 0, size: input, uses: planner.count_uses(model.input) });
        let mut operators = model.operators.iter().peekable();
        while let Some(operator) = operators.next() {
            let mut operator = operator.clone();
            // Fuse the next operator if nothing else reads this output.
            while let Some(next) = operators.peek()
                && planner.count_uses(operator.output) == 1
                && let Some(both) = fuse_operators(&operator, next, &model.tensors)
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

impl<'a> Planner<'a> {
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
    fn constant(&self, tensor: usize, shape: &[Option<usize>]) -> Result<(&'a [f32], &'a [usize]), String> {
        let model = self.model;
        let tensor = &model.tensors[tensor];
        let fits = tensor.shape.len() == shape.len()
            && !tensor.shape.contains(&0)
            && tensor.shape.iter().zip(shape).all(|(side, wanted)| wanted.is_none_or(|wanted| wanted == *side));
        match &tensor.constant {
            Some(values) if fits => Ok((values, &tensor.shape)),
            _ => Err(format!("{:?} does not have the expected constants: {:?}", tensor.name, tensor.shape)),
        }
    }

    /// Rounds channels up to whole vectors.
    fn padded_channels(&self, channels: usize) -> usize {
        channels.next_multiple_of(self.lanes)
    }

    fn reserve_constants(&mut self, values: usize) -> Result<(), String> {
        self.constants = self.constants.saturating_add(values);
        self.check_memory()
    }

    /// Ensures working memory for `values` values.
    fn reserve_scratch(&mut self, values: usize) -> Result<(), String> {
        self.plan.scratch = self.plan.scratch.max(values);
        self.check_memory()
    }

    fn check_memory(&self) -> Result<(), String> {
        let values = self
            .plan
            .slots
            .iter()
            .chain([&self.plan.scratch])
            .fold(self.constants, |all, &one| all.saturating_add(one));
        if values > MAX_TOTAL_VALUES {
            Err(format!("it needs memory for more than {MAX_TOTAL_VALUES} values"))
        } else {
            Ok(())
        }
    }

    /// Adds the step of an operator, and frees the slots of its inputs after their last use.
    fn add_step(&mut self, operator: &Operator) -> Result<(), String> {
        let tensor = &self.model.tensors[operator.output];
        let wrong = || format!("an operator cannot make {:?}: {:?}", tensor.name, tensor.shape);
        let first = *operator.inputs.first().ok_or_else(wrong)?;
        let (input, size) = self.find_picture(first)?;
        let lanes = if operator.kind == OperatorKind::TransposedConvolution { 1 } else { self.lanes };
        let result = picture_size(tensor, |_| lanes)?;
        let Planned { operation, size: made, work } = self.plan_operation(operator, size)?.ok_or_else(wrong)?;
        if (Size { lanes, ..made }) != result {
            return Err(wrong());
        }
        self.work = self.work.saturating_add(result.len().saturating_mul(work));
        if self.work > MAX_WORK {
            return Err(format!("it needs more than {MAX_WORK} multiplications for a picture"));
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

    /// Plans the operation of an operator on a picture of this size; `None` if it cannot work on it.
    fn plan_operation(&mut self, operator: &Operator, size: Size) -> Result<Option<Planned>, String> {
        let in_vectors = size.lanes == self.lanes;
        let others = operator.inputs.get(1..).unwrap_or_default();
        let like_input = |operation| Some(Planned { operation, size, work: 1 });
        Ok(match (operator.kind, others) {
            (OperatorKind::Convolution(steps), &[weights, bias]) => {
                self.plan_convolution(size, &steps, [weights, bias])?
            }
            (OperatorKind::Depthwise(steps), &[weights, bias, ref b @ ..]) if in_vectors && steps.across <= 2 => {
                self.plan_depthwise(size, &steps, [weights, bias], b.first().copied())?
            }
            (OperatorKind::TransposedConvolution, &[weights, bias]) if in_vectors => {
                Some(self.plan_transposed(size, [weights, bias])?)
            }
            (OperatorKind::Activation(_), []) if in_vectors => {
                like_input(Operation::Elementwise { gate: None, b: None })
            }
            (OperatorKind::Scale, &[gate, ref b @ ..]) if in_vectors => {
                let (gate, gate_size) = self.find_picture(gate)?;
                let b = b.first().map(|&b| self.find_picture(b)).transpose()?;
                let fits = gate_size == Size { rows: 1, columns: 1, ..size } && b.is_none_or(|(_, b)| b == size);
                let b = b.map(|(slot, _)| slot);
                fits.then_some(Operation::Elementwise { gate: Some(gate), b }).and_then(like_input)
            }
            (OperatorKind::Sum, &[b]) if in_vectors => {
                let (b, b_size) = self.find_picture(b)?;
                (b_size == size).then_some(Operation::Elementwise { gate: None, b: Some(b) }).and_then(like_input)
            }
            (OperatorKind::Mean, others) if in_vectors => {
                // The second input is either the axes, or the second summand of a fused sum.
                let b = others.iter().find_map(|&other| self.find_picture(other).ok());
                let operation = Operation::Mean { b: b.map(|(slot, _)| slot) };
                let mean = Planned { operation, size: Size { rows: 1, columns: 1, ..size }, work: size.pixels() };
                b.is_none_or(|(_, b)| b == size).then_some(mean)
            }
            (OperatorKind::Upsample, &[weights, bias]) if in_vectors => {
                self.plan_filtered_upsampling(size, [weights, bias])?
            }
            (OperatorKind::Upsample, _) if in_vectors => {
                self.reserve_scratch(size.columns * self.lanes)?;
                Some(Planned { operation: Operation::Upsample { filter: None }, size: size.doubled(), work: 4 })
            }
            _ => None,
        })
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
