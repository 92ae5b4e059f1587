//! Runs ONNX networks by `rten`, a runtime in pure Rust.

use std::sync::Arc;

use rten::{Dimension, Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value, ValueOrView};
use rten_tensor::TensorView;
use rten_tensor::prelude::*;

use super::{Engine, Network, Port, Tensor, onnx, to_one_line};
use bokehcam::compute::expect_panics;
use bokehcam::compute::memory_limit::MemoryLimit;

/// A network run by `rten`.
pub struct BuiltIn {
    model: Model,
    /// A pool of one thread; the other cores are for the blur.
    threads: Arc<ThreadPool>,
}

impl BuiltIn {
    /// Loads a network, whose thread gets the memory limit of this one. Optimisation computes constants, in other threads.
    pub fn load(bytes: Vec<u8>, optimized: bool) -> Result<Network, String> {
        let bytes = onnx::remove_output_shapes(bytes)?;
        let model = ModelOptions::with_all_ops().enable_optimization(optimized).load(bytes).map_err(to_one_line)?;
        let ports = |ids: &[NodeId]| ids.iter().map(|&id| read_port(&model, id)).collect::<Result<Vec<_>, _>>();
        let (inputs, outputs) = (ports(model.input_ids())?, ports(model.output_ids())?);
        let threads = Arc::new(ThreadPool::with_num_threads(1));
        let limit = MemoryLimit::of_thread();
        threads.run(|| {
            if let Some(limit) = limit {
                limit.apply();
            }
            expect_panics();
        });
        Ok(Network { engine: Box::new(Self { model, threads }), inputs, outputs, runtime: "rten" })
    }
}

fn read_port(model: &Model, id: NodeId) -> Result<Port, String> {
    let info = model.node_info(id).ok_or("a port without a description")?;
    let shape = info.shape().unwrap_or_default();
    let side = |dimension: &Dimension| match dimension {
        Dimension::Fixed(size) => Some(*size),
        Dimension::Symbolic(_) => None,
    };
    Ok(Port { name: info.name().unwrap_or_default().to_owned(), shape: shape.iter().map(side).collect() })
}

impl Engine for BuiltIn {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let given = self.model.input_ids().iter().zip(inputs).map(|(&id, Tensor { shape, values })| {
            let view = TensorView::try_from_data(shape.as_slice(), values.as_slice());
            Ok((id, ValueOrView::from(view.map_err(to_one_line)?)))
        });
        let given = given.collect::<Result<Vec<_>, String>>()?;
        let options = RunOptions::default().with_thread_pool(Some(Arc::clone(&self.threads)));
        let results = self.model.run(given, self.model.output_ids(), Some(options)).map_err(to_one_line)?;
        outputs.resize_with(results.len(), Tensor::default);
        for (output, result) in outputs.iter_mut().zip(results) {
            let Value::FloatTensor(result) = result else { return Err("an output is not of floats".to_owned()) };
            output.set(result.shape().iter().copied(), result.iter().copied());
        }
        Ok(())
    }
}
