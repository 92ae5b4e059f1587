//! The GPU executor: wgpu compute passes, one WGSL file each under `shaders/`, with the names of the passes in
//! [`super::plan`]. A pass of several dispatches (`fill`: find_occluders, pull, coarse, fill) has a file
//! for each.

mod buffers;
mod layout;
mod passes;
mod probe;
mod readback;
mod self_test;
pub mod shaders;

use std::sync::Arc;
use std::time::Instant;

pub use self_test::run_self_test;

use buffers::Buffers;
use layout::{Capacity, Layout};
use passes::Passes;
use readback::{CAPACITY, Ring, SubmittedFrame};

use super::bank::STEPS_PER_PX;
use super::ladder::Compositing;
use super::occlusion::front_px;
use super::plan::Plan;
use super::{BlurredFrame, Bokeh, BokehError, Job};
use crate::compute::device::{Device, DeviceFrame, DevicePicture, Recorder};
use crate::compute::{Backend, GpuError, PictureLocation};
use crate::link::pool::{Pool, Pooled};
use crate::optics::CocField;

/// Largest number of results on the device: those in flight, queued, or in use by a viewer. When all are in use,
/// results are copied to memory.
const MAX_DEVICE_PICTURES: usize = CAPACITY + 7;

/// Runs a plan with wgpu compute passes.
pub struct GpuBokeh {
    plan: Plan,
    device: Arc<Device>,
    buffers: Buffers,
    /// Depth map of the current frame, in metres; grows to the largest one seen.
    metres: wgpu::Buffer,
    capacity: Capacity,
    layout: Layout,
    passes: Passes,
    ring: Ring,
    /// A frame that the device refused, until it is taken back.
    refused: Option<Job>,
    /// Pool of results that stay on the device, created when the first one is requested.
    results: Option<Pool<DevicePicture>>,
}

impl GpuBokeh {
    /// Creates an executor of `plan` on the adapter whose name contains `adapter`, else on the best one. With
    /// `hardware_only`, software adapters are ignored unless named.
    ///
    /// # Errors
    /// No adapter fits, or its device failed.
    pub fn new(plan: &Plan, hardware_only: bool, adapter: Option<&str>) -> Result<Self, BokehError> {
        Self::with_device(plan, Arc::new(Device::open(hardware_only, adapter)?))
    }

    /// Creates an executor of `plan` on a device.
    ///
    /// # Errors
    /// The device is too small for these pictures, or failed.
    pub fn with_device(plan: &Plan, device: Arc<Device>) -> Result<Self, BokehError> {
        let allowed = device.device.limits().max_storage_buffer_binding_size;
        let capacity = Capacity::for_plan(plan);
        let rows = capacity.rows * plan.ladder.max_terms().min(4);
        // A pixel is four halves, also in each of the up to four terms per row pass.
        let largest = (capacity.pixels.max(rows).max(1) as u64 * 8).max(buffers::max_filter_bytes(plan));
        let largest = largest.max(buffers::mixed_bytes(plan));
        if largest > allowed {
            return Err(GpuError::Failed(format!(
                "{}: pictures of {} x {} need buffers of {largest} bytes, and this GPU allows {allowed}; use --backend \
                 cpu",
                device.name, plan.width, plan.height
            ))
            .into());
        }
        let buffers = Buffers::new(&device, plan, &capacity);
        let metres = Buffers::create_depth_buffer(&device, plan.width * plan.height);
        let passes = Passes::new(&device, plan, &buffers, &metres);
        let ring = Ring::new(&device, buffers::packed_picture_bytes(plan) as usize);
        device.check()?;
        let (plan, layout, refused, results) = (plan.clone(), Layout::new(), None, None);
        Ok(Self { plan, device, buffers, metres, capacity, layout, passes, ring, refused, results })
    }

    /// Columns and rows of its pictures.
    fn size(&self) -> (u32, u32) {
        (self.plan.width as u32, self.plan.height as u32)
    }

    /// Uploads the depth map of a job, if its CoC follows it; returns it instead if it is on the device already.
    fn upload_depth<'a>(&mut self, job: &Job, shared: Option<&'a DeviceFrame>) -> Option<&'a wgpu::Buffer> {
        let (CocField::Depth(_), Some(map)) = (job.coc, &job.depth) else { return None };
        let metres = shared.filter(|_| map.size() == self.size()).map(|frame| &frame.metres);
        if 4 * map.metres.len() as u64 > self.metres.size() {
            self.metres = Buffers::create_depth_buffer(&self.device, map.metres.len());
            self.passes.bind_depth_buffer(&self.device, &self.buffers, &self.metres);
        }
        if metres.is_none() {
            self.device.upload(&self.metres, 0, bytemuck::cast_slice(&map.metres));
        }
        metres
    }

    /// Returns a free picture on the device for a result, if `place` asks for one.
    fn take_device_picture(&mut self, place: PictureLocation) -> Option<Pooled<DevicePicture>> {
        if place == PictureLocation::Memory {
            return None;
        }
        let (device, size) = (&self.device, self.size());
        self.results
            .get_or_insert_with(|| Pool::new(MAX_DEVICE_PICTURES, || DevicePicture::new(device, size)))
            .try_take()
    }

    /// Returns the uniform `Frame` of a job; see `common.wgsl` for the values.
    fn frame_uniform(&self, job: &Job) -> shaders::Frame {
        let plan = &self.plan;
        let (coc_kind, coc, ramp) = match job.coc {
            CocField::Uniform { radius_px } => (0, [radius_px, 0.0, 0.0, 0.0], [0.0; 2]),
            CocField::Ramp(r) => (1, [r.normal.x, r.normal.y, r.offset_px, r.half_band_px], [r.slope, r.max_px]),
            CocField::Depth(d) => (2, [d.coc_at_infinity_px, d.near_m(), d.far_m(), d.max_coc_px], [0.0; 2]),
        };
        shaders::Frame {
            size: [plan.width as u32, plan.height as u32],
            depth_size: job.depth.as_ref().map_or([1, 1], |map| [map.width, map.height]),
            coc_kind,
            compositing: match plan.compositing {
                Compositing::Layers => 0,
                Compositing::Select => 1,
                Compositing::Gather => 2,
            },
            bins: plan.bins.len() as u32,
            near_bins: self.layout.near as u32,
            half_width: plan.bank.half_width as u32,
            nodes: plan.bank.nodes as u32,
            groups: plan.bank.terms.div_ceil(4) as u32,
            max_px: max_coc_px(&job.coc),
            coc,
            ramp,
            symmetric: u32::from(plan.bank.is_symmetric),
            extent: plan.bank.extent as f32,
            term_stride: self.capacity.rows as u32,
            expansion: if plan.expansion.is_finite() { plan.expansion } else { 0.0 },
            steps_per_px: STEPS_PER_PX,
            mixed: plan.matte(job.depth.as_deref(), &job.coc).map_or(0, |matte| matte.pixels.len() as u32),
            yuyv: u32::from(job.yuyv.is_some()),
            front_px: front_px(plan.near_from_px()),
            has_reduced: u32::from(plan.bank.has_reduced()),
            unused: 0,
        }
    }
}

/// Returns an upper bound > 0 of |CoC| in a frame, in pixels: the shaders divide by it.
fn max_coc_px(coc: &CocField) -> f32 {
    let max_px = match coc {
        CocField::Uniform { radius_px } => *radius_px,
        CocField::Ramp(ramp) => ramp.max_px,
        CocField::Depth(lens) => lens.max_coc_px,
    };
    max_px.max(1e-3)
}

/// Resizes the pictures that a job may be written to, and drops the one in YUYV if it cannot be.
fn resize_outputs(job: &mut Job, (width, height): (u32, u32)) {
    job.out.resize(width, height);
    // YUYV shares chroma between two pixels of a row.
    if job.place != PictureLocation::Memory || !width.is_multiple_of(2) {
        job.yuyv = None;
    }
    if let Some(yuyv) = &mut job.yuyv {
        yuyv.resize(width, height);
    }
}

impl Bokeh for GpuBokeh {
    fn submit(&mut self, mut job: Job) -> Result<(), BokehError> {
        self.plan.check_frame(job.color.size(), job.depth.as_deref(), &job.coc)?;
        if let Err(error) = self.device.check() {
            self.refused = Some(job);
            return Err(error.into());
        }
        let Some(mut slot) = self.ring.take_slot() else {
            return Err(GpuError::Failed(format!("more than {CAPACITY} frames submitted and not collected")).into());
        };
        let started = Instant::now();
        let on_device = self.take_device_picture(job.place);
        resize_outputs(&mut job, self.size());
        let is_here = |frame: &Pooled<DeviceFrame>| frame.is_on(&self.device) && frame.size() == self.size();
        // Kept until this frame is submitted: its buffers may be overwritten only afterwards.
        let shared = job.on_device.take().filter(is_here);
        let shared_metres = self.upload_depth(&job, shared.as_deref());
        if let Some(matte) = self.plan.matte(job.depth.as_deref(), &job.coc) {
            self.device.upload(&self.buffers.mixed, 0, bytemuck::cast_slice(&matte.pixels));
        }
        self.plan.set_quality(job.quality);
        self.plan.split_by_depth(job.depth.as_deref(), &job.coc);
        self.layout.lay_out(&self.plan, &self.capacity);
        self.passes.upload(&self.device, &self.buffers, &self.plan, &self.layout);
        let frame = self.frame_uniform(&job);
        self.device.queue.write_buffer(&self.buffers.frame, 0, bytemuck::bytes_of(&frame));

        let mut recorder = Recorder::new(&self.device, slot.stamps.as_mut());
        let color = &self.buffers.color;
        match shared.as_deref() {
            Some(DeviceFrame { rgb, .. }) => {
                recorder.encoder.copy_buffer_to_buffer(rgb, 0, color, 0, rgb.size().min(color.size()));
            }
            None => self.device.upload(color, 0, &job.color.rgb),
        }
        if let Some(metres) = shared_metres {
            recorder.encoder.copy_buffer_to_buffer(metres, 0, &self.metres, 0, metres.size());
        }
        self.passes.record(&mut recorder, &self.plan, &self.layout);
        let (result, encoder) = (&self.buffers.result, &mut recorder.encoder);
        if let Some(picture) = on_device.as_deref().map(DevicePicture::buffer) {
            encoder.copy_buffer_to_buffer(result, 0, picture, 0, result.size().min(picture.size()));
        }
        let in_memory = on_device.is_none() || job.place == PictureLocation::Both;
        let copied = match &job.yuyv {
            _ if !in_memory => 0,
            Some(yuyv) => yuyv.bytes.len() as u64,
            None => slot.picture.size(),
        };
        if copied > 0 {
            slot.picture.record_copy(encoder, result, copied);
        }
        let submission = recorder.submit(&self.device);
        drop(shared);
        self.ring.push(&self.device, slot, SubmittedFrame { job, on_device, copied, submission, started });
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<BlurredFrame>, BokehError> {
        self.ring.pop(&self.device, wait)
    }

    fn reclaim_job(&mut self) -> Option<Job> {
        self.ring.reclaim_job().or_else(|| self.refused.take())
    }

    fn in_flight(&self) -> usize {
        self.ring.in_flight()
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }

    fn backend(&self) -> Backend {
        Backend::Gpu
    }

    fn device(&self) -> Option<Arc<Device>> {
        Some(Arc::clone(&self.device))
    }

    fn describe(&self) -> String {
        self.device.name.clone()
    }
}
