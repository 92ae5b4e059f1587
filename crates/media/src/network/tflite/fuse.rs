//! Fuses an operator with the next one, so that one step does the work of both.

use super::model::{Activation, Operator, OperatorKind};

/// Fuses two operators into one, if the second reads the output of the first and the combination is supported.
pub fn fuse_operators(first: &Operator, second: &Operator) -> Option<Operator> {
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
