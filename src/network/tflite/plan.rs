//! The steps of a network, with the memory that they share: each is checked once, so that none can fail when it runs.

use pulp::Arch;

use super::kernels::{Axis, Lanes, Size, axes};
use super::model::{Activation, Kind, MOST_IN_ALL, Model, Operator, Tensor};

/// What a step does.
pub enum Work {
    /// Sums over channels, of the pixels themselves or of a row of what is under a filter.
    Pointwise {
        weights: Vec<f32>,
        bias: Vec<f32>,
        under: Option<([Axis; 2], Size)>,
    },
    /// Sums over the pixels under a filter; and how many values its lines have.
    Depthwise {
        weights: Vec<f32>,
        bias: Vec<f32>,
        axes: [Axis; 2],
        lines: usize,
    },
    /// Each pixel becomes four, of one channel: the sums are `[pixel][down][across]`.
    Doubling {
        weights: Vec<f32>,
        bias: Vec<f32>,
    },
    /// Of two and a gate, which of them are there.
    Each {
        gate: Option<usize>,
        b: Option<usize>,
    },
    Mean {
        b: Option<usize>,
    },
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

fn size_of(tensor: &Tensor, lanes: impl Fn(usize) -> usize) -> Result<Size, String> {
    let [1, rows, columns, channels] = tensor.shape[..] else {
        return Err(format!("{:?} is no picture: {:?}", tensor.name, tensor.shape));
    };
    if rows * columns * channels == 0 {
        return Err(format!("{:?} is empty: {:?}", tensor.name, tensor.shape));
    }
    Ok(Size { rows, columns, channels, lanes: lanes(channels) })
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
            && !tensor.shape.contains(&0)
            && tensor.shape.iter().zip(shape).all(|(side, wanted)| wanted.is_none_or(|wanted| wanted == *side));
        match &tensor.constant {
            Some(values) if fits => Ok((values, &tensor.shape)),
            _ => Err(format!("{:?} is not the constants it should be: {:?}", tensor.name, tensor.shape)),
        }
    }

    fn bias(&self, tensor: usize, channels: usize) -> Result<Vec<f32>, String> {
        let (values, _) = self.constant(tensor, &[Some(channels)])?;
        let mut bias = values.to_vec();
        bias.resize(self.padded(channels), 0.0);
        Ok(bias)
    }

    /// Channels in whole vectors.
    fn padded(&self, channels: usize) -> usize {
        channels.next_multiple_of(self.lanes)
    }

    /// Weights `[out][depth]` as [`super::kernels::Pointwise`] takes them.
    fn packed(&self, weights: &[f32], depth: usize) -> Vec<f32> {
        let (out, all, lanes) = (weights.len() / depth, self.padded(depth), self.lanes);
        let mut packed = vec![0.0; self.padded(out) * all];
        for (channel, weights) in weights.chunks_exact(depth).enumerate() {
            for (k, weight) in weights.iter().enumerate() {
                packed[(channel / lanes * all + k) * lanes + channel % lanes] = *weight;
            }
        }
        packed
    }

    /// Sees to it that there is so much memory for a step's own use.
    fn scratch(&mut self, values: usize) -> Result<(), String> {
        self.plan.scratch = self.plan.scratch.max(values);
        self.check_memory()
    }

    fn check_memory(&self) -> Result<(), String> {
        let values = self.plan.slots.iter().chain([&self.plan.scratch]).sum::<usize>();
        if values > MOST_IN_ALL { Err(format!("it takes memory for more than {MOST_IN_ALL} values")) } else { Ok(()) }
    }

    fn add(&mut self, operator: &Operator) -> Result<(), String> {
        let tensor = &self.model.tensors[operator.output];
        let wrong = || format!("an operator cannot make {:?}: {:?}", tensor.name, tensor.shape);
        let [first, others @ ..] = &operator.inputs[..] else { return Err(wrong()) };
        let (input, size) = self.picture(*first)?;
        let lanes = self.lanes;
        let result = size_of(tensor, |_| if operator.kind == Kind::Doubling { 1 } else { lanes })?;
        let in_vectors = size.lanes == lanes;
        let made = |[rows, columns]: [usize; 2], channels: usize| Size { rows, columns, channels, ..result };
        let like_input = Size { lanes: result.lanes, ..size };
        let (work, made) = match (operator.kind, others) {
            (Kind::Convolution(steps), &[weights, bias]) => {
                let (weights, shape) = self.constant(weights, &[None, None, None, Some(size.channels)])?;
                let ([out, down, across], bias) = ([shape[0], shape[1], shape[2]], self.bias(bias, shape[0])?);
                let (axes, sides) = axes(&size, [down, across], &steps).ok_or_else(wrong)?;
                let depth = down * across * size.channels;
                let weights = self.packed(weights, depth);
                let alone = in_vectors && [down, across, steps.down, steps.across] == [1; 4];
                let row = Size { rows: 1, columns: sides[1], channels: depth, lanes };
                if !alone {
                    self.scratch(row.len())?;
                }
                (Work::Pointwise { weights, bias, under: (!alone).then_some((axes, row)) }, made(sides, out))
            }
            (Kind::Depthwise(steps), &[weights, bias]) if in_vectors && steps.across <= 2 => {
                let (weights, shape) = self.constant(weights, &[Some(1), None, None, Some(size.channels)])?;
                let taps = shape[1] * shape[2];
                let (axes, sides) = axes(&size, [shape[1], shape[2]], &steps).ok_or_else(wrong)?;
                let mut spread = vec![0.0; taps * self.padded(size.channels)];
                for (tap, weights) in weights.chunks_exact(size.channels).enumerate() {
                    for (channel, weight) in weights.iter().enumerate() {
                        spread[(channel / lanes * taps + tap) * lanes + channel % lanes] = *weight;
                    }
                }
                let bias = self.bias(bias, size.channels)?;
                let lines = axes[0].taps * axes[1].line(size.columns, sides[1]) * lanes;
                self.scratch(lines)?;
                (Work::Depthwise { weights: spread, bias, axes, lines }, made(sides, size.channels))
            }
            (Kind::Doubling, &[weights, bias]) if in_vectors => {
                let (weights, _) = self.constant(weights, &[Some(1), Some(2), Some(2), Some(size.channels)])?;
                let (bias, _) = self.constant(bias, &[Some(1)])?;
                let (mut four, weights) = (vec![bias[0]; 4], self.packed(weights, size.channels));
                four.resize(self.padded(4), 0.0);
                self.scratch(size.pixels() * four.len())?;
                (Work::Doubling { weights, bias: four }, made([2 * size.rows, 2 * size.columns], 1))
            }
            (Kind::Activation(_), []) if in_vectors => (Work::Each { gate: None, b: None }, like_input),
            (Kind::Scale, &[gate, ref b @ ..]) if in_vectors => {
                let ((gate, gate_size), b) = (self.picture(gate)?, b.first().map(|&b| self.picture(b)).transpose()?);
                let is_gate = gate_size == Size { rows: 1, columns: 1, ..size };
                if !is_gate || b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Work::Each { gate: Some(gate), b: b.map(|(slot, _)| slot) }, like_input)
            }
            (Kind::Sum, &[b]) if in_vectors => {
                let (b, b_size) = self.picture(b)?;
                if b_size != size {
                    return Err(wrong());
                }
                (Work::Each { gate: None, b: Some(b) }, like_input)
            }
            (Kind::Mean, others) if in_vectors => {
                // The axes, or the other of a sum, which has axes of its own no more.
                let b = others.iter().find_map(|&other| self.picture(other).ok());
                if b.is_some_and(|(_, b)| b != size) {
                    return Err(wrong());
                }
                (Work::Mean { b: b.map(|(slot, _)| slot) }, Size { rows: 1, columns: 1, ..size })
            }
            (Kind::Enlarge, _) if in_vectors => {
                self.scratch(size.columns * lanes)?;
                (Work::Enlarge, made([2 * size.rows, 2 * size.columns], size.channels))
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
        self.check_memory()?;
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
