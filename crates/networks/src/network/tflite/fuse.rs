//! Fuses an operator with the next one, so that one step does the work of both.

use super::model::{Activation, Operator, OperatorKind, Strides, Tensor};

/// Fuses two operators into one, if the second reads the output of the first and the combination is supported. A pointwise
/// filter of an enlarged picture is that of the picture, enlarged: the weights of both sum up in any order.
pub fn fuse_operators(first: &Operator, second: &Operator, tensors: &[Tensor]) -> Option<Operator> {
    let other = |k: usize| second.inputs.get(1 - k).copied().filter(|&other| other != first.output);
    let place = second.inputs.iter().position(|&input| input == first.output)?;
    let mut both = Operator { output: second.output, ..first.clone() };
    match (first.kind, second.kind) {
        (_, OperatorKind::Activation(activation))
            if first.activation == Activation::None && fuses_activation(first) =>
        {
            both.activation = activation;
        }
        (OperatorKind::Scale, OperatorKind::Sum) if first.activation == Activation::None && first.inputs.len() == 2 => {
            both.inputs.push(other(place)?);
            both.activation = second.activation;
        }
        (OperatorKind::Depthwise(_), OperatorKind::Sum)
            if first.activation != Activation::Logistic
                && second.activation == Activation::None
                && first.inputs.len() == 3 =>
        {
            both.inputs.push(other(place)?);
        }
        (OperatorKind::Upsample, OperatorKind::Convolution(Strides { down: 1, across: 1, .. }))
            if second.activation == Activation::None && place == 0 =>
        {
            let &[_, weights, bias] = &second.inputs[..] else { return None };
            let [_, 1, 1, _] = tensors[weights].shape[..] else { return None };
            both.inputs = vec![first.inputs[0], weights, bias];
        }
        (OperatorKind::Sum, OperatorKind::Mean) if first.activation == Activation::None => {
            both.kind = OperatorKind::Mean;
        }
        _ => return None,
    }
    Some(both)
}

/// Returns whether a step can apply an activation to its result.
fn fuses_activation(operator: &Operator) -> bool {
    match operator.kind {
        OperatorKind::Convolution(_) | OperatorKind::TransposedConvolution | OperatorKind::Sum => true,
        // Not after a sum.
        OperatorKind::Depthwise(_) => operator.inputs.len() == 3,
        _ => false,
    }
}
