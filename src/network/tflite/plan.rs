//! The steps of a network, with the memory that they share: each is checked once, so that none can fail when it runs.

use pulp::Arch;

use super::kernels::{Axis, Lanes, PADDED, Size, axes};
use super::model::{Activation, Kind, Model, Operator, Tensor};

/// What a step does.
pub enum Work {
    /// Sums over channels, of the pixels themselves or of those under a filter.
    Pointwise { weights: Vec<f32>, bias: Vec<f32>, depth: usize, under: Option<[Axis; 2]> },
    Depthwise { weights: Vec<f32>, bias: Vec<f32>, axes: [Axis; 2] },
    /// Each pixel becomes four, of one channel: the sums are `[pixel][down][across]`.
    Doubling { weights: Vec<f32>, bias: Vec<f32> },
    /// Of two and a gate, which of them are there.
    Each { gate: Option<usize>, b: Option<usize> },
    Mean { b: Option<usize> },
    Enlarge,
}

/// A step: from slot to slot.
pub struct Step {
    pub work: Work,
    pub activation: Activation,
    pub input: usize,
    pub size: Size,
    pub output: usize,
    pub result: Size,
}

/// A network that is ready to run.
pub struct Plan {
    pub steps: Vec<Step>,
    /// Values of each slot.
    pub slots: Vec<usize>,
    /// Values of the memory that a step needs for itself.
    pub scratch: usize,
    pub input: (usize, Size),
    pub output: (usize, Size),
}

/// What a tensor is kept in.
struct Kept {
    slot: usize,
    size: Size,
    /// How many steps still want it.
    wanted: usize,
}

/// Makes a plan, tensor by tensor.
struct Planner<'a> {
    model: &'a Model,
    lanes: usize,
    kept: Vec<Option<Kept>>,
    free: Vec<usize>,
    plan: Plan,
}

fn size_of(tensor: &Tensor, stride: impl Fn(usize) -> usize) -> Result<Size, String> {
    let [1, rows, columns, channels] = tensor.shape[..] else {
        return Err(format!("{:?} is no picture: {:?}", tensor.name, tensor.shape));
    };
    if rows * columns * channels == 0 {
        return Err(format!("{:?} is empty: {:?}", tensor.name, tensor.shape));
    }
    Ok(Size { rows, columns, channels, stride: stride(channels) })
}

fn padded(channels: usize) -> usize {
    channels.next_multiple_of(PADDED)
}

impl Plan {
    /// The plan of a model on this machine.
    pub fn new(model: &Model) -> Result<Self, String> {
        let input = size_of(&model.tensors[model.input], |channels| channels)?;
        let plan =
            Self { steps: Vec::new(), slots: vec![input.len()], scratch: 0, input: (0, input), output: (0, input) };
        let kept = model.tensors.iter().map(|_| None).collect();
        let lanes = Arch::new().dispatch(Lanes);
        let mut planner = Planner { model, lanes, kept, free: Vec::new(), plan };
        planner.kept[model.input] = Some(Kept { slot: 0, size: input, wanted: planner.wanted(model.input) });
        let mut operators = model.operators.iter().peekable();
        while let Some(operator) = operators.next() {
            let mut operator = operator.clone();
            // What follows and is wanted by nothing else is done with it.
            while let Some(next) = operators.peek()
                && planner.wanted(operator.output) == 1
                && let Some(both) = joined(&operator, next)
            {
                operator = both;
                operators.next();
            }
            planner.add(&operator)?;
        }
        let output = planner.kept[model.output].take().ok_or("nothing gives its output")?;
        Ok(Self { output: (output.slot, output.size), ..planner.plan })
    }
}

/// Two operators as one, where the second takes what the first gives.
fn joined(first: &Operator, second: &Operator) -> Option<Operator> {
    let other = |k: usize| second.inputs.get(1 - k).copied().filter(|&other| other != first.output);
    let place = second.inputs.iter().position(|&input| input == first.output)?;
    let mut both = Operator { output: second.output, ..first.clone() };
    match (first.kind, second.kind) {
        (_, Kind::Activation(activation)) if first.activation == Activation::None && takes(first.kind) => {
            both.activation = activation;
        }
        (Kind::Scale, Kind::Sum) if first.activation == Activation::None && first.inputs.len() == 2 => {
            both.inputs.push(other(place)?);
            both.activation = second.activation;
        }
        (Kind::Sum, Kind::Mean) if first.activation == Activation::None => {
            both.kind = Kind::Mean;
        }
        _ => return None,
    }
    Some(both)
}

/// Whether a step can do an activation at last.
fn takes(kind: Kind) -> bool {
    matches!(kind, Kind::Convolution(_) | Kind::Depthwise(_) | Kind::Doubling | Kind::Sum)
}

impl Planner<'_> {
    /// How many operators take a tensor, and one more for the output.
    fn wanted(&self, tensor: usize) -> usize {
        let by = self.model.operators.iter().flat_map(|operator| &operator.inputs).filter(|&&input| input == tensor);
        by.count() + usize::from(tensor == self.model.output)
    }

    fn picture(&self, tensor: usize) -> Result<(usize, Size), String> {
        let kept = self.kept[tensor].as_ref();
        kept.map(|kept| (kept.slot, kept.size))
            .ok_or_else(|| format!("{:?} is taken before it is given", self.model.tensors[tensor].name))
    }

    /// Constants of a shape; `None` in it is any size.
    fn constant(&self, tensor: usize, shape: &[Option<usize>]) -> Result<(&[f32], &[usize]), String> {
        let tensor = &self.model.tensors[tensor];
        let fits = tensor.shape.len() == shape.len()
            && tensor.shape.iter().zip(shape).all(|(side, wanted)| wanted.is_none_or(|wanted| wanted == *side));
        match &tensor.constant {
            Some(values) if fits => Ok((values, &tensor.shape)),
            _ => Err(format!("{:?} is not the constants it should be: {:?}", tensor.name, tensor.shape)),
        }
    }

    fn bias(&self, tensor: usize, channels: usize) -> Result<Vec<f32>, String> {
        let (values, _) = self.constant(tensor, &[Some(channels)])?;
        let mut bias = values.to_vec();
        bias.resize(padded(channels), 0.0);
        Ok(bias)
    }

    /// Weights `[out][depth]` as [`super::kernels::Pointwise`] takes them.
    fn packed(&self, weights: &[f32], depth: usize) -> Vec<f32> {
        let (out, lanes) = (weights.len() / depth, self.lanes);
        let mut packed = vec![0.0; padded(out) * depth];
        for (channel, weights) in weights.chunks_exact(depth).enumerate() {
            for (k, weight) in weights.iter().enumerate() {
                packed[(channel / lanes * depth + k) * lanes + channel % lanes] = *weight;
            }
        }
        packed
    }

    fn add(&mut self, operator: &Operator) -> Result<(), String> {
        let tensor = &self.model.tensors[operator.output];
        let wrong = || format!("an operator cannot make {:?}: {:?}", tensor.name, tensor.shape);
        let [first, others @ ..] = &operator.inputs[..] else { return Err(wrong()) };
        let (input, size) = self.picture(*first)?;
        let one_plane = operator.kind == Kind::Doubling;
        let result = size_of(tensor, |channels| if one_plane { 1 } else { padded(channels) })?;
        let like_input = Size { rows: result.rows, columns: result.columns, ..size };
        let all = |channels: usize| Size { rows: result.rows, columns: result.columns, channels, stride: result.stride };
        let (work, made) = match (operator.kind, others) {
            (Kind::Convolution(steps), &[weights, bias]) => {
                let (weights, shape) = self.constant(weights, &[None, None, None, Some(size.channels)])?;
                let ([out, down, across], bias) = ([shape[0], shape[1], shape[2]], self.bias(bias, shape[0])?);
                let (axes, [rows, columns]) = axes(&size, [down, across], &steps).ok_or_else(wrong)?;
                let depth = down * across * size.channels;
                let alone = [down, across, steps.down, steps.across] == [1; 4];
                let weights = self.packed(weights, depth);
                if !alone {
                    self.plan.scratch = self.plan.scratch.max(columns * depth);
                }
                let made = Size { rows, columns, ..all(out) };
                (Work::Pointwise { weights, bias, depth, under: (!alone).then_some(axes) }, made)
            }
            (Kind::Depthwise(steps), &[weights, bias]) => {
                let (weights, shape) = self.constant(weights, &[Some(1), None, None, Some(size.channels)])?;
                let (axes, [rows, columns]) = axes(&size, [shape[1], shape[2]], &steps).ok_or_else(wrong)?;
                let mut spread = vec![0.0; shape[1] * shape[2] * padded(size.channels)];
                let taps = spread.chunks_exact_mut(padded(size.channels)).zip(weights.chunks_exact(size.channels));
                taps.for_each(|(spread, weights)| spread[..size.channels].copy_from_slice(weights));
                if size.stride != padded(size.channels) {
                    return Err(wrong());
                }
                let bias = self.bias(bias, size.channels)?;
                (Work::Depthwise { weights: spread, bias, axes }, Size { rows, columns, ..all(size.channels) })
            }
            (Kind::Doubling, &[weights, bias]) => {
                let (weights, _) = self.constant(weights, &[Some(1), Some(2), Some(2), Some(size.channels)])?;
                let (bias, _) = self.constant(bias, &[Some(1)])?;
                let (mut four, weights) = (vec![bias[0]; 4], self.packed(weights, size.channels));
                four.resize(PADDED, 0.0);
                self.plan.scratch = self.plan.scratch.max(size.columns * PADDED);
                let made = Size { rows: 2 * size.rows, columns: 2 * size.columns, ..all(1) };
                (Work::Doubling { weights, bias: four }, made)
            }
            (Kind::Activation(_), []) => (Work::Each { gate: None, b: None }, like_input),
            (Kind::Scale, &[gate, ref b @ ..]) => {
                let ((gate, gate_size), b) = (self.picture(gate)?, b.first().map(|&b| self.picture(b)).transpose()?);
                let is_gate = gate_size.pixels() == 1 && gate_size.stride == size.stride;
                if !is_gate || b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Work::Each { gate: Some(gate), b: b.map(|(slot, _)| slot) }, like_input)
            }
            (Kind::Sum, &[b]) => {
                let (b, b_size) = self.picture(b)?;
                if b_size != size {
                    return Err(wrong());
                }
                (Work::Each { gate: None, b: Some(b) }, like_input)
            }
            (Kind::Mean, others) => {
                // The axes, or the other of a sum, which has axes of its own no more.
                let b = others.iter().find_map(|&other| self.picture(other).ok());
                if b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Work::Mean { b: b.map(|(slot, _)| slot) }, Size { rows: 1, columns: 1, ..size })
            }
            (Kind::Enlarge, _) => {
                self.plan.scratch = self.plan.scratch.max(size.columns * size.stride);
                (Work::Enlarge, Size { rows: 2 * size.rows, columns: 2 * size.columns, ..size })
            }
            _ => return Err(wrong()),
        };
        if made != result {
            return Err(wrong());
        }
        let activation = match operator.kind {
            Kind::Activation(activation) => activation,
            _ => operator.activation,
        };
        let output = self.slot(result.len());
        self.plan.steps.push(Step { work, activation, input, size, output, result });
        for &tensor in &operator.inputs {
            self.let_go(tensor);
        }
        self.kept[operator.output] = Some(Kept { slot: output, size: result, wanted: self.wanted(operator.output) });
        Ok(())
    }

    /// A slot of so many values at least: one that is free, the least of those that are large enough, or the largest.
    fn slot(&mut self, values: usize) -> usize {
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

    fn let_go(&mut self, tensor: usize) {
        if let Some(kept) = &mut self.kept[tensor] {
            kept.wanted -= 1;
            if kept.wanted == 0 {
                self.free.push(kept.slot);
                self.kept[tensor] = None;
            }
        }
    }
}
