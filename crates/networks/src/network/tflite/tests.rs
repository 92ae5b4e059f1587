use super::model::{Activation, MAX_TOTAL_VALUES, Model, Operator, OperatorKind, Strides, Tensor as Part};
use super::*;

mod file;
mod reference;

use file::{Value, table_file};
use reference::run_reference;

/// Returns pseudo-random numbers between -1 and 1.
fn noise(seed: &mut u32, count: usize) -> Vec<f32> {
    let mut next = || {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// Builds a network operator by operator.
struct Builder {
    model: Model,
    seed: u32,
}

impl Builder {
    fn new(shape: [usize; 4]) -> Self {
        let input = Part { name: "input".into(), shape: shape.to_vec(), constant: None };
        Self { model: Model { tensors: vec![input], operators: Vec::new(), input: 0, output: 0 }, seed: 1 }
    }

    fn shape(&self) -> [usize; 4] {
        self.model.tensors[self.model.output].shape[..].try_into().expect("a picture")
    }

    fn constant(&mut self, shape: &[usize]) -> usize {
        let values = noise(&mut self.seed, shape.iter().product());
        self.model.tensors.push(Part { name: "c".into(), shape: shape.to_vec(), constant: Some(values) });
        self.model.tensors.len() - 1
    }

    /// Adds an operator on these tensors with an output of this shape; returns the output's index.
    fn add(&mut self, kind: OperatorKind, activation: Activation, inputs: &[usize], shape: [usize; 4]) -> usize {
        let Model { tensors, operators, output, .. } = &mut self.model;
        tensors.push(Part { name: "p".into(), shape: shape.to_vec(), constant: None });
        *output = tensors.len() - 1;
        operators.push(Operator { kind, activation, inputs: inputs.to_vec(), output: *output });
        *output
    }

    fn filter(&mut self, out: Option<usize>, taps: [usize; 2], steps: Strides, activation: Activation) -> usize {
        let [_, rows, columns, channels] = self.shape();
        let count = |pixels: usize, taps: usize, step: usize| match steps.is_padded {
            true => pixels.div_ceil(step),
            false => (pixels - taps) / step + 1,
        };
        let sides = [count(rows, taps[0], steps.down), count(columns, taps[1], steps.across)];
        let (kind, shape) = match out {
            Some(out) => (OperatorKind::Convolution(steps), [out, taps[0], taps[1], channels]),
            None => (OperatorKind::Depthwise(steps), [1, taps[0], taps[1], channels]),
        };
        let out = out.unwrap_or(channels);
        let inputs = [self.model.output, self.constant(&shape), self.constant(&[out])];
        self.add(kind, activation, &inputs, [1, sides[0], sides[1], out])
    }

    fn check(mut self) {
        let shape = self.model.tensors[0].shape.clone();
        let values = noise(&mut self.seed, shape.iter().product());
        let wanted = run_reference(&self.model, &values);
        let mut outputs = Vec::new();
        let mut network = Tflite::from_model(&self.model).unwrap();
        // Twice, so that remains of the first run would show in the second.
        for _ in 0..2 {
            network.run(&[Tensor { shape: shape.clone(), values: values.clone() }], &mut outputs).unwrap();
        }
        assert_eq!(outputs[0].shape, self.model.tensors[self.model.output].shape);
        let largest = wanted.iter().fold(1.0f32, |most, value| most.max(value.abs()));
        for (at, (made, wanted)) in outputs[0].values.iter().zip(&wanted).enumerate() {
            assert!((made - wanted).abs() < 1e-5 * largest, "{at}: {made}, not {wanted}");
        }
        assert_eq!(outputs[0].values.len(), wanted.len());
    }
}

const ONE: Strides = Strides { down: 1, across: 1, is_padded: true };
const TWO: Strides = Strides { down: 2, across: 2, is_padded: true };
const FIRST: (Option<usize>, [usize; 2], Strides) = (Some(21), [3, 3], TWO);

/// Returns a network with a first layer like those for pictures.
fn with_first_layer(rows: usize, columns: usize) -> Builder {
    let mut net = Builder::new([1, rows, columns, 3]);
    net.filter(FIRST.0, FIRST.1, FIRST.2, Activation::HardSwish);
    net
}

#[test]
fn a_filter_is_the_sum_of_what_lies_under_it() {
    let within = Strides { is_padded: false, ..ONE };
    let skewed = Strides { down: 3, across: 2, is_padded: true };
    for (taps, steps) in [([3, 3], TWO), ([1, 1], ONE), ([5, 2], skewed), ([3, 4], within), ([1, 1], TWO)] {
        for (rows, columns) in [(13, 29), (8, 24), (5, 4)] {
            let mut net = Builder::new([1, rows, columns, 3]);
            net.filter(Some(19), taps, steps, Activation::Relu);
            net.check();
        }
    }
}

#[test]
fn sums_over_channels_of_any_number_and_filters_of_each() {
    for (channels, taps, steps) in
        [(1, [3, 3], ONE), (24, [5, 5], TWO), (88, [3, 3], TWO), (7, [5, 3], Strides { is_padded: false, ..ONE })]
    {
        let mut net = with_first_layer(14, 50);
        net.filter(Some(channels), [1, 1], ONE, Activation::HardSwish);
        net.filter(None, taps, steps, Activation::Relu);
        net.filter(Some(5), [3, 3], ONE, Activation::None);
        net.check();
    }
}

#[test]
fn gates_sums_means_and_enlargements() {
    let mut net = with_first_layer(12, 40);
    let trunk = net.model.output;
    let [_, rows, columns, channels] = net.shape();
    net.add(OperatorKind::Mean, Activation::None, &[trunk], [1, 1, 1, channels]);
    net.filter(Some(4), [1, 1], ONE, Activation::Relu);
    let squeezed = net.filter(Some(channels), [1, 1], ONE, Activation::None);
    let gate =
        net.add(OperatorKind::Activation(Activation::Logistic), Activation::None, &[squeezed], [1, 1, 1, channels]);
    let gated = net.add(OperatorKind::Scale, Activation::None, &[trunk, gate], [1, rows, columns, channels]);
    let sum = net.add(OperatorKind::Sum, Activation::Relu, &[gated, trunk], [1, rows, columns, channels]);
    let both = net.add(OperatorKind::Sum, Activation::None, &[sum, trunk], [1, rows, columns, channels]);
    net.add(OperatorKind::Mean, Activation::None, &[both], [1, 1, 1, channels]);
    let second = net.filter(Some(channels), [1, 1], ONE, Activation::Logistic);
    let scaled = net.add(OperatorKind::Scale, Activation::None, &[sum, second], [1, rows, columns, channels]);
    net.add(OperatorKind::Upsample, Activation::None, &[scaled], [1, 2 * rows, 2 * columns, channels]);
    let trunk = net.filter(Some(channels), [1, 1], ONE, Activation::None);
    let filtered = net.filter(None, [3, 3], ONE, Activation::Relu);
    let sum = net.add(OperatorKind::Sum, Activation::None, &[trunk, filtered], [1, 2 * rows, 2 * columns, channels]);
    let filtered = net.filter(None, [3, 3], ONE, Activation::None);
    let wide = net.add(OperatorKind::Sum, Activation::Relu, &[filtered, sum], [1, 2 * rows, 2 * columns, channels]);
    let (weights, bias) = (net.constant(&[1, 2, 2, channels]), net.constant(&[1]));
    let mask = net.add(
        OperatorKind::TransposedConvolution,
        Activation::None,
        &[wide, weights, bias],
        [1, 4 * rows, 4 * columns, 1],
    );
    net.add(OperatorKind::Activation(Activation::Logistic), Activation::None, &[mask], [1, 4 * rows, 4 * columns, 1]);
    net.check();
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let refused = |change: fn(&mut Model)| {
        let mut net = with_first_layer(12, 40);
        net.filter(None, [3, 3], ONE, Activation::None);
        change(&mut net.model);
        Tflite::from_model(&net.model).err().expect("refused")
    };
    refused(|model| model.tensors[model.output].shape[1] += 1);
    refused(|model| model.tensors[model.output].shape.truncate(3));
    refused(|model| model.tensors[0].shape[3] = 4);
    refused(|model| model.operators.reverse());
    refused(|model| model.operators[1].inputs.truncate(1));
    refused(|model| model.operators[1].kind = OperatorKind::Depthwise(Strides { across: 3, ..ONE }));
    refused(|model| model.operators[0].kind = OperatorKind::Sum);
    // Sizes that exceed the memory limit.
    refused(|model| {
        model.tensors[0].shape = vec![1, 1 << 20, 1 << 20, 3];
        let operator = model.operators[0].clone();
        model.tensors[operator.output].shape = vec![1, 1 << 19, 1 << 19, 21];
        model.operators.truncate(1);
        model.output = operator.output;
    });
}

#[test]
fn what_takes_too_long_or_too_much_memory_is_refused_before_it_runs() {
    let wide = |count: usize, out: usize| {
        let mut net = Builder::new([1, 512, 512, 3]);
        for _ in 0..count {
            net.filter(Some(out), [3, 3], ONE, Activation::None);
        }
        Tflite::from_model(&net.model).map(drop)
    };
    wide(2, 16).unwrap();
    assert!(wide(1 << 8, 32).unwrap_err().contains("multiplications"));
    // Weights that many operators share are packed for each.
    let mut net = Builder::new([1, 1, 1, 1]);
    let (weights, bias) = (net.constant(&[1 << 20, 1, 1, 1]), net.constant(&[1 << 20]));
    for _ in 0..64 {
        let inputs = [0, weights, bias];
        net.add(OperatorKind::Convolution(ONE), Activation::None, &inputs, [1, 1, 1, 1 << 20]);
    }
    assert!(Tflite::from_model(&net.model).err().unwrap().contains("memory"));
}

/// Returns a network as a file: a filter with 16-bit weights, and a logistic function.
fn small_file() -> Vec<u8> {
    use Value::{Byte, Bytes, Int, Ints, Table, Tables};
    let weights: Vec<u8> = [1.0f32, -0.5, 0.25, 2.0, 0.0, 1.0]
        .iter()
        .flat_map(|&value| half::f16::from_f32(value).to_le_bytes())
        .collect();
    let bias: Vec<u8> = [0.5f32, -0.5].iter().flat_map(|value| value.to_le_bytes()).collect();
    let tensor = |shape: &[i32], kind: i8, buffer: i32, name: &str| {
        vec![(0, Ints(shape.to_vec())), (1, Byte(kind)), (2, Int(buffer)), (3, Bytes(name.into()))]
    };
    let tensors = vec![
        tensor(&[1, 2, 4, 3], 0, 0, "picture"),
        tensor(&[2, 1, 1, 3], 1, 1, "half"),
        tensor(&[2, 1, 1, 3], 0, 0, "weights"),
        tensor(&[2], 0, 2, "bias"),
        tensor(&[1, 2, 4, 2], 0, 0, "sum"),
        tensor(&[1, 2, 4, 2], 0, 0, "mask"),
    ];
    let operator = |code: i32, inputs: &[i32], output: i32, options: Vec<(usize, Value)>| {
        vec![(0, Int(code)), (1, Ints(inputs.to_vec())), (2, Ints(vec![output])), (4, Table(options))]
    };
    let operators = vec![
        operator(0, &[1], 2, vec![]),
        operator(1, &[0, 2, 3], 4, vec![(0, Byte(0)), (1, Int(1)), (2, Int(1))]),
        operator(2, &[4], 5, vec![]),
    ];
    let code = |code: i8| vec![(0, Byte(code)), (3, Int(i32::from(code)))];
    let graph = vec![(0, Tables(tensors)), (1, Ints(vec![0])), (2, Ints(vec![5])), (3, Tables(operators))];
    table_file(&[
        (0, Int(3)),
        (1, Tables(vec![code(6), code(3), code(14)])),
        (2, Tables(vec![graph])),
        (4, Tables(vec![vec![], vec![(0, Bytes(weights))], vec![(0, Bytes(bias))]])),
    ])
}

#[test]
fn a_file_is_read_and_run() {
    let mut network = Tflite::load(&small_file()).unwrap();
    assert_eq!(network.inputs[0].name, "picture");
    assert_eq!(network.outputs[0].shape, [1, 2, 4, 2].map(Some));
    let values: Vec<f32> = (0..24).map(|k| k as f32 / 24.0).collect();
    let mut outputs = Vec::new();
    network.run(&[Tensor { shape: vec![1, 2, 4, 3], values: values.clone() }], &mut outputs).unwrap();
    let logistic = |x: f32| 1.0 / (1.0 + (-x).exp());
    for (pixel, made) in values.chunks(3).zip(outputs[0].values.chunks(2)) {
        let wanted = [pixel[0] - 0.5 * pixel[1] + 0.25 * pixel[2] + 0.5, 2.0 * pixel[0] + pixel[2] - 0.5].map(logistic);
        assert!(made.iter().zip(wanted).all(|(made, wanted)| (made - wanted).abs() < 1e-6), "{made:?} {wanted:?}");
    }
    let other = Tensor { shape: vec![1, 4, 2, 3], values };
    assert!(network.run(&[other], &mut outputs).is_err());
}

#[test]
fn tensors_that_are_too_large_together_are_refused() {
    use Value::{Byte, Bytes, Int, Ints, Tables};
    let read = |count: usize| {
        let side = (MAX_TOTAL_VALUES / 16) as i32;
        let tensor = vec![(0, Ints(vec![side])), (1, Byte(0)), (2, Int(0)), (3, Bytes(b"t".to_vec()))];
        let graph = vec![(0, Tables(vec![tensor; count])), (1, Ints(vec![0])), (2, Ints(vec![0]))];
        Model::read(&table_file(&[(0, Int(3)), (2, Tables(vec![graph])), (4, Tables(vec![vec![]]))])).map(drop)
    };
    assert_eq!(read(16), Ok(()));
    assert_eq!(read(17), Err(format!("its tensors have more than {MAX_TOTAL_VALUES} values")));
}

#[test]
fn files_that_are_cut_or_damaged_are_refused_in_words_or_run() {
    let whole = small_file();
    assert!(is_tflite(&whole));
    for length in 0..whole.len() - 1 {
        let _ = Tflite::load(&whole[..length]).err().map(|why| assert!(!why.is_empty()));
    }
    let input = [Tensor { shape: vec![1, 2, 4, 3], values: vec![0.5; 24] }];
    for at in 0..whole.len() {
        for value in [0, 1, 3, 0x7f, 0x80, 0xff, whole[at] ^ 4, whole[at].wrapping_add(1)] {
            let mut damaged = whole.clone();
            damaged[at] = value;
            if let Ok(mut network) = Tflite::load(&damaged) {
                let _ = network.engine.run(&input, &mut Vec::new());
            }
        }
    }
}
