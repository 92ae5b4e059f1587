//! The GPU executor: wgpu compute passes, one WGSL file each under `shaders/`. It agrees with the CPU executor to the
//! bit.
//!
//! Costs and sums are bytes, four disparities per word, in volumes on the device: their traffic is small compared with
//! the sequential steps of the paths. So each path has a workgroup of its own, with four disparities per invocation,
//! and prefetches the next pixels.
//!
//! Per-pixel values take one word each, so that no two invocations write the same word. Only two pictures are uploaded
//! and one map is read back per pair; the state for the next pair stays on the device.

pub mod postprocess;
pub mod rectifier;
pub mod shaders;

use std::sync::Arc;

use shaders::linear_workgroups;

use super::executor::Executor;
use super::fixed::{self, UNKNOWN};
use super::penalty::Penalties;
use crate::compute::device::{Device, Pass, Readback, Recorder, Timestamps};
use crate::compute::thread_pool::ThreadPool;
use crate::compute::{GpuError, PassTimes, bands};

/// Sizes declared in the shaders: side of a workgroup's tile in `stereo_census`, and its columns in `stereo_cost`.
const TILE: u32 = 16;
const STRIP: u32 = 16;
/// Minimum number of map pixels per thread that unpacks the result.
const MIN_PIXELS_PER_THREAD: usize = 1 << 14;

/// Matches pairs of one size on a GPU.
pub struct GpuExecutor {
    device: Arc<Device>,
    pixels: usize,
    /// Grey values, left and right; the right ones begin at a multiple of 4 bytes, as uploads require.
    luma: wgpu::Buffer,
    /// Left grey values of the last pair.
    last_luma: wgpu::Buffer,
    passes: [Pass; 12],
    /// The map, two pixels per word.
    words: wgpu::Buffer,
    readback: Readback,
    stamps: Option<Timestamps>,
}

impl GpuExecutor {
    /// Creates an executor for pairs of this size (columns, rows) and at least `disparities` candidates, at most 256,
    /// that removes speckles of up to `max_speckle` pixels.
    ///
    /// # Errors
    /// Fails if the device lacks memory or fails.
    pub fn new(
        device: &Arc<Device>,
        size: (usize, usize),
        disparities: usize,
        max_speckle: u32,
    ) -> Result<Self, GpuError> {
        let ((width, height), disparities) = (size, fixed::candidate_count(disparities));
        let pixels = width * height;
        check_limits(device, size, disparities)?;
        use wgpu::BufferUsages as Usage;
        let buffer = |label, bytes, usage| device.create_buffer(label, bytes, usage);
        let luma = buffer("luma", 2 * pixels.next_multiple_of(4), Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC);
        let last_luma = buffer("last luma", pixels, Usage::STORAGE | Usage::COPY_DST);
        let table = buffer("P2", 256, Usage::STORAGE | Usage::COPY_DST);
        device.queue.write_buffer(&table, 0, Penalties::new().table());
        let likely = buffer("likely", pixels * 4, Usage::STORAGE);
        let census = buffer("census", 2 * pixels * 4, Usage::STORAGE);
        let penalties = buffer("penalties", pixels * 4, Usage::STORAGE);
        let [costs, sums, totals] =
            ["costs", "sums", "totals"].map(|label| buffer(label, pixels * disparities, Usage::STORAGE));
        let map = buffer("map", pixels * 4, Usage::STORAGE | Usage::COPY_DST);
        // Before the first pair no disparity is likely.
        device.queue.write_buffer(&map, 0, bytemuck::cast_slice(&vec![u32::from(UNKNOWN); pixels]));
        let words = buffer("words", pixels * 2, Usage::STORAGE | Usage::COPY_SRC);
        let readback = Readback::new(device, "words back", pixels * 2);

        let constants_for = |from_right| shaders::matcher_constants(size, disparities, max_speckle, from_right);
        let forwards = constants_for(false);
        let (columns, rows) = (width as u32, height as u32);
        let pass = |shader, buffers: &[&wgpu::Buffer], workgroups| {
            let buffers = buffers.iter().map(|buffer| buffer.as_entire_buffer_binding());
            Pass::new(device, shader, &forwards, buffers, workgroups)
        };
        let along_rows = |from_right| {
            let buffers = [&costs, &penalties, &sums].map(wgpu::Buffer::as_entire_buffer_binding);
            Pass::new(device, shaders::ROWS, &constants_for(from_right), buffers, [rows, 1, 1])
        };
        // The volumes and penalties are not needed after the winners and serve as scratch memory.
        let scratch = postprocess::Scratch { labels: &costs, sizes: &sums, filled: &penalties };
        let [runs, join, sizes, gaps, pack] =
            postprocess::create_passes(device, size, &forwards, &map, scratch, &words);
        let tiles = [columns.div_ceil(TILE), rows.div_ceil(TILE), 2];
        let passes = [
            pass(shaders::LIKELY, &[&luma, &last_luma, &map, &likely], linear_workgroups(pixels)),
            pass(shaders::CENSUS, &[&luma, &table, &census, &penalties], tiles),
            pass(shaders::COST, &[&census, &likely, &costs], [columns.div_ceil(STRIP), rows, 1]),
            along_rows(false),
            along_rows(true),
            pass(shaders::COLUMNS, &[&costs, &penalties, &sums, &totals], [columns, 1, 1]),
            pass(shaders::WINNERS, &[&totals, &map], linear_workgroups(pixels)),
            runs,
            join,
            sizes,
            gaps,
            pack,
        ];
        let stamps = Timestamps::new(device, passes.len());
        device.check()?;
        Ok(Self { device: Arc::clone(device), pixels, luma, last_luma, passes, words, readback, stamps })
    }

    /// Returns the time of each pass over the last pair; empty if the device has no timestamps.
    pub fn pass_times(&self) -> PassTimes {
        self.stamps.as_ref().map(Timestamps::last_times).unwrap_or_default()
    }
}

/// Refuses sizes whose cost volume, or whose number of workgroups (one for each row or column), exceeds the limits of
/// the device.
fn check_limits(device: &Device, (width, height): (usize, usize), disparities: usize) -> Result<(), GpuError> {
    let limits = device.device.limits();
    let bytes = (width * height * disparities) as u64;
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let longest = limits.max_compute_workgroups_per_dimension as usize;
    let name = &device.name;
    if bytes > most {
        return Err(GpuError::Failed(format!(
            "{name}: {disparities} disparities of {width} x {height} pixels need buffers of {bytes} bytes, and this \
             GPU allows {most}; use --backend cpu"
        )));
    }
    if width.max(height) > longest {
        return Err(GpuError::Failed(format!(
            "{name}: pictures of {width} x {height} need {} workgroups, and this GPU allows {longest}; use --backend \
             cpu",
            width.max(height)
        )));
    }
    Ok(())
}

impl Executor for GpuExecutor {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn device(&self) -> Option<Arc<Device>> {
        Some(Arc::clone(&self.device))
    }

    fn compute_disparities(
        &mut self,
        [left, right]: [&[u8]; 2],
        workers: &mut ThreadPool,
        out: &mut [u16],
    ) -> Result<(), GpuError> {
        let Self { device, pixels, luma, last_luma, passes, words, readback, stamps } = self;
        device.check()?;
        device.upload(luma, 0, left);
        device.upload(luma, pixels.next_multiple_of(4) as u64, right);

        let mut recorder = Recorder::new(device, stamps.as_mut());
        passes.iter().for_each(|pass| recorder.record(pass));
        recorder.encoder.copy_buffer_to_buffer(luma, 0, last_luma, 0, last_luma.size());
        recorder.submit_and_read(device, readback, words, words.size(), |bytes| {
            let each = bands::chunk_len(out.len(), MIN_PIXELS_PER_THREAD);
            workers.run_each(out.chunks_mut(each).zip(bytes.chunks(2 * each)), &|(out, bytes): (&mut [u16], &[u8])| {
                for (out, bytes) in out.iter_mut().zip(bytes.as_chunks().0) {
                    *out = u16::from_le_bytes(*bytes);
                }
            });
        })?;
        Ok(())
    }
}
