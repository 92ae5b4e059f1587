//! Reference implementation of the operators in `f64`, pixel by pixel and channel by channel. Twin: `../filters.rs`,
//! `../kernels.rs`.

use crate::network::tflite::model::{Activation, Model, Operator, OperatorKind, Strides};

/// Runs a network on a picture `[rows][columns][channels]`.
pub fn run_reference(model: &Model, input: &[f32]) -> Vec<f32> {
    let mut values: Vec<Vec<f64>> =
        model.tensors.iter().map(|tensor| to_f64(tensor.constant.as_deref().unwrap_or_default())).collect();
    values[model.input] = to_f64(input);
    for operator in &model.operators {
        let made = compute_operator(model, operator, &values);
        values[operator.output] = made.into_iter().map(|value| activate(operator.activation, value)).collect();
    }
    values[model.output].iter().map(|&value| value as f32).collect()
}

fn to_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

fn activate(activation: Activation, value: f64) -> f64 {
    match activation {
        Activation::None => value,
        Activation::Relu => value.max(0.0),
        Activation::HardSwish => value * (value + 3.0).clamp(0.0, 6.0) / 6.0,
        Activation::Logistic => 1.0 / (1.0 + (-value).exp()),
    }
}

fn compute_operator(model: &Model, operator: &Operator, values: &[Vec<f64>]) -> Vec<f64> {
    let shape =
        |k: usize| -> [usize; 4] { model.tensors[operator.inputs[k]].shape[..].try_into().expect("four sides") };
    let of = |k: usize| &values[operator.inputs[k]];
    let [_, out_rows, out_columns, out_channels]: [usize; 4] =
        model.tensors[operator.output].shape[..].try_into().expect("four sides");
    let [_, rows, columns, channels] = shape(0);
    let at = |y: usize, x: usize, channel: usize| (y * columns + x) * channels + channel;
    let places = (0..out_rows)
        .flat_map(|y| (0..out_columns).flat_map(move |x| (0..out_channels).map(move |channel| (y, x, channel))));
    let source = of(0);
    match operator.kind {
        OperatorKind::Convolution(steps) | OperatorKind::Depthwise(steps) => {
            let is_dense = matches!(operator.kind, OperatorKind::Convolution(_));
            let [_, down, across, _] = shape(1);
            let before = |count: usize, step: usize, taps: usize, pixels: usize| match steps.is_padded {
                true => ((count - 1) * step + taps).saturating_sub(pixels) / 2,
                false => 0,
            };
            let Strides { down: step_down, across: step_across, .. } = steps;
            let (above, left) =
                (before(out_rows, step_down, down, rows), before(out_columns, step_across, across, columns));
            places
                .map(|(y, x, channel)| {
                    let mut sum = of(2)[channel];
                    for (tap_y, tap_x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
                        let (y, x) = (y * step_down + tap_y, x * step_across + tap_x);
                        if !(above..rows + above).contains(&y) || !(left..columns + left).contains(&x) {
                            continue;
                        }
                        let (y, x) = (y - above, x - left);
                        let tap = tap_y * across + tap_x;
                        sum += match is_dense {
                            true => (0..channels)
                                .map(|k| source[at(y, x, k)] * of(1)[(channel * down * across + tap) * channels + k])
                                .sum::<f64>(),
                            false => source[at(y, x, channel)] * of(1)[tap * channels + channel],
                        };
                    }
                    sum
                })
                .collect()
        }
        OperatorKind::TransposedConvolution => places
            .map(|(y, x, _)| {
                let four = (y % 2 * 2 + x % 2) * channels;
                of(2)[0] + (0..channels).map(|k| source[at(y / 2, x / 2, k)] * of(1)[four + k]).sum::<f64>()
            })
            .collect(),
        OperatorKind::Activation(activation) => source.iter().map(|&value| activate(activation, value)).collect(),
        OperatorKind::Mean => (0..channels)
            .map(|channel| {
                source.iter().skip(channel).step_by(channels).sum::<f64>() / (source.len() / channels) as f64
            })
            .collect(),
        OperatorKind::Scale => source.iter().zip(of(1).iter().cycle()).map(|(a, b)| a * b).collect(),
        OperatorKind::Sum => source.iter().zip(of(1)).map(|(a, b)| a + b).collect(),
        OperatorKind::Upsample => places
            .map(|(y, x, channel)| {
                let near = |at: usize, count: usize| {
                    let place = (at as f64 + 0.5) / 2.0 - 0.5;
                    let first = place.floor().clamp(0.0, (count - 1) as f64);
                    (first as usize, (first as usize + 1).min(count - 1), (place - first).clamp(0.0, 1.0))
                };
                let ((y0, y1, down), (x0, x1, across)) = (near(y, rows), near(x, columns));
                let row = |y: usize| source[at(y, x0, channel)] * (1.0 - across) + source[at(y, x1, channel)] * across;
                row(y0) * (1.0 - down) + row(y1) * down
            })
            .collect(),
    }
}
