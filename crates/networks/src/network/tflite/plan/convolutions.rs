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
        let weights = self.pack_weights(weights, [down, across], &size)?;
        let is_pointwise = size.lanes == self.lanes && [down, across, steps.down, steps.across] == [1; 4];
        if !is_pointwise {
            let line = axes[1].padded_len(size.columns, columns).saturating_mul(size.lanes);
            self.reserve_scratch(line.saturating_mul(down * size.blocks()))?;
        }
        let operation = Operation::Convolution { weights, bias, axes: (!is_pointwise).then_some(axes) };
        let work = down * across * size.channels;
        Ok(Some(Planned { operation, size: Size { rows, columns, channels: out, ..size }, work }))
    }

    pub(super) fn plan_depthwise(
        &mut self,
        size: Size,
        steps: &Strides,
        [weights, bias]: [usize; 2],
        b: Option<usize>,
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
        let (b, size) = (b.map(|b| self.find_picture(b)).transpose()?, Size { rows, columns, ..size });
        let operation = Operation::Depthwise { weights: spread, bias, axes, lines, b: b.map(|(slot, _)| slot) };
        Ok(b.is_none_or(|(_, b)| b == size).then_some(Planned { operation, size, work: taps }))
    }

    pub(super) fn plan_transposed(&mut self, size: Size, [weights, bias]: [usize; 2]) -> Result<Planned, String> {
        let (weights, _) = self.constant(weights, &[Some(1), Some(2), Some(2), Some(size.channels)])?;
        let (bias, _) = self.constant(bias, &[Some(1)])?;
        let (mut four, weights) = (vec![bias[0]; 4], self.pack_weights(weights, [1, 1], &size)?);
        four.resize(self.padded_channels(4), 0.0);
        self.reserve_scratch(size.pixels() * four.len())?;
        let operation = Operation::TransposedConvolution { weights, bias: four };
        Ok(Planned { operation, size: Size { channels: 1, ..size.doubled() }, work: size.channels })
    }

    /// Plans the upsampling of a pointwise convolution.
    pub(super) fn plan_filtered_upsampling(
        &mut self,
        size: Size,
        [weights, bias]: [usize; 2],
    ) -> Result<Option<Planned>, String> {
        let steps = Strides { down: 1, across: 1, is_padded: true };
        Ok(match self.plan_convolution(size, &steps, [weights, bias])? {
            Some(Planned { operation: Operation::Convolution { weights, bias, axes: None }, size, work }) => {
                self.reserve_scratch((size.columns * size.lanes).saturating_add(size.len()))?;
                let operation = Operation::Upsample { filter: Some((weights, bias)) };
                Some(Planned { operation, size: size.doubled(), work: work.div_ceil(4) + 4 })
            }
            _ => None,
        })
    }

    fn padded_bias(&mut self, tensor: usize, channels: usize) -> Result<Vec<f32>, String> {
        let (values, _) = self.constant(tensor, &[Some(channels)])?;
        self.reserve_constants(self.padded_channels(channels))?;
        let mut bias = values.to_vec();
        bias.resize(self.padded_channels(channels), 0.0);
        Ok(bias)
    }

    /// Packs weights `[out][down][across][channel]` for [`Convolution`](super::super::filters::Convolution), of pictures
    /// of this size.
    fn pack_weights(&mut self, weights: &[f32], [down, across]: [usize; 2], size: &Size) -> Result<Vec<f32>, String> {
        let (own, lanes, run) = (size.lanes, self.lanes, across * size.lanes);
        let (depth, all) = (down * across * size.channels, down * size.blocks() * run);
        let padded = self.padded_channels(weights.len() / depth).saturating_mul(all);
        self.reserve_constants(padded)?;
        let mut packed = vec![0.0; padded];
        for (out, weights) in weights.chunks_exact(depth).enumerate() {
            for (at, weight) in weights.iter().enumerate() {
                let (tap, channel) = (at / size.channels, at % size.channels);
                let part = tap / across * size.blocks() + channel / own;
                let place = part * run + tap % across * own + channel % own;
                packed[(out / lanes * all + place) * lanes + out % lanes] = *weight;
            }
        }
        Ok(packed)
    }
}
