//! Plans convolutions: packs their weights for the vectors of this machine.

use super::{Operation, Planned, Planner, Size, Strides, filter_axes};

impl Planner<'_> {
    pub(super) fn plan_convolution(
        &mut self,
        size: Size,
        steps: &Strides,
        [weights, bias]: [usize; 2],
    ) -> Result<Option<Planned>, String> {
        let (weights, shape) = self.constant(weights, &[None, None, None, Some(size.channels)])?;
        let (out, [down, across]) = (shape[0], [shape[1], shape[2]]);
        let Some((axes, [rows, columns])) = filter_axes(&size, [down, across], steps) else { return Ok(None) };
        let bias = self.padded_bias(bias, out)?;
        let depth = down * across * size.channels;
        let weights = self.pack_weights(weights, depth)?;
        let alone = size.lanes == self.lanes && [down, across, steps.down, steps.across] == [1; 4];
        let row = Size { rows: 1, columns, channels: depth, lanes: self.lanes };
        if !alone {
            self.reserve_scratch(row.len() + axes[1].padded_len(size.columns, columns) * size.lanes)?;
        }
        let operation = Operation::Pointwise { weights, bias, unfolded: (!alone).then_some((axes, row)) };
        Ok(Some(Planned { operation, size: Size { rows, columns, channels: out, ..size }, work: depth }))
    }

    pub(super) fn plan_depthwise(
        &mut self,
        size: Size,
        steps: &Strides,
        [weights, bias]: [usize; 2],
    ) -> Result<Option<Planned>, String> {
        let (weights, shape) = self.constant(weights, &[Some(1), None, None, Some(size.channels)])?;
        let taps = shape[1] * shape[2];
        let Some((axes, [rows, columns])) = filter_axes(&size, [shape[1], shape[2]], steps) else { return Ok(None) };
        let packed = taps.saturating_mul(self.padded_channels(size.channels));
        self.reserve_constants(packed)?;
        let mut spread = vec![0.0; packed];
        for (tap, weights) in weights.chunks_exact(size.channels).enumerate() {
            for (channel, weight) in weights.iter().enumerate() {
                spread[(channel / self.lanes * taps + tap) * self.lanes + channel % self.lanes] = *weight;
            }
        }
        let bias = self.padded_bias(bias, size.channels)?;
        let lines = axes[0].taps * axes[1].padded_len(size.columns, columns) * self.lanes;
        self.reserve_scratch(lines)?;
        let operation = Operation::Depthwise { weights: spread, bias, axes, lines };
        Ok(Some(Planned { operation, size: Size { rows, columns, ..size }, work: taps }))
    }

    pub(super) fn plan_transposed(&mut self, size: Size, [weights, bias]: [usize; 2]) -> Result<Planned, String> {
        let (weights, _) = self.constant(weights, &[Some(1), Some(2), Some(2), Some(size.channels)])?;
        let (bias, _) = self.constant(bias, &[Some(1)])?;
        let (mut four, weights) = (vec![bias[0]; 4], self.pack_weights(weights, size.channels)?);
        four.resize(self.padded_channels(4), 0.0);
        self.reserve_scratch(size.pixels() * four.len())?;
        let operation = Operation::TransposedConvolution { weights, bias: four };
        Ok(Planned { operation, size: Size { channels: 1, ..size.doubled() }, work: size.channels })
    }

    fn padded_bias(&mut self, tensor: usize, channels: usize) -> Result<Vec<f32>, String> {
        let (values, _) = self.constant(tensor, &[Some(channels)])?;
        self.reserve_constants(self.padded_channels(channels))?;
        let mut bias = values.to_vec();
        bias.resize(self.padded_channels(channels), 0.0);
        Ok(bias)
    }

    /// Packs weights `[out][depth]` for [`crate::network::tflite::kernels::Pointwise`].
    fn pack_weights(&mut self, weights: &[f32], depth: usize) -> Result<Vec<f32>, String> {
        let (out, all, lanes) = (weights.len() / depth, self.padded_channels(depth), self.lanes);
        self.reserve_constants(self.padded_channels(out).saturating_mul(all))?;
        let mut packed = vec![0.0; self.padded_channels(out) * all];
        for (channel, weights) in weights.chunks_exact(depth).enumerate() {
            for (k, weight) in weights.iter().enumerate() {
                packed[(channel / lanes * all + k) * lanes + channel % lanes] = *weight;
            }
        }
        Ok(packed)
    }
}
