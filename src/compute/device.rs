//! GPU adapters, and the device on an adapter.

mod pass;
mod picture;
mod readback;
mod self_test;
mod wait;

pub use pass::{Pass, Recorder, Timestamps, UNIFORM_STRIDE, uniform_binding, workgroups_2d};
pub use picture::{DeviceFrame, DevicePicture};
pub use readback::Readback;
pub use self_test::SelfTest;
pub use wait::begin_shutdown;

use std::any::TypeId;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use super::GpuError;

/// A compute shader: the name of its entry point and file, and its source.
#[derive(Clone, Copy, Debug)]
pub struct Shader {
    pub name: &'static str,
    /// Source text, including the shared files.
    pub source: &'static str,
}

/// Builds a [`Shader`] from a file in a folder under `shaders/`, prefixed by the shared files of the folder, the common one
/// first. Its name begins with the folder's, except for the blur.
macro_rules! shader {
    (blur: $common:literal; $name:literal $(, $shared:literal)*) => {
        $crate::compute::device::shader!($name, "blur", $common, $name $(, $shared)*)
    };
    ($folder:ident: $common:literal; $name:literal $(, $shared:literal)*) => {
        $crate::compute::device::shader!(
            concat!(stringify!($folder), "_", $name), stringify!($folder), $common, $name $(, $shared)*
        )
    };
    ($pass:expr, $folder:expr, $common:literal, $name:literal $(, $shared:literal)*) => {
        $crate::compute::device::Shader {
            name: $pass,
            source: concat!(
                include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $folder, "/", $common, ".wgsl")),
                $(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $folder, "/", $shared, ".wgsl")),)*
                include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $folder, "/", $name, ".wgsl")),
            ),
        }
    };
}
pub(crate) use shader;

/// Time after which a device counts as hung; a software device is slow, but does not hang.
const HANG_TIMEOUT: Duration = Duration::from_secs(10);
const SOFTWARE_HANG_TIMEOUT: Duration = Duration::from_secs(60);

/// Returns the only wgpu instance of the process. Dropping the last instance unloads the drivers, and reloading may
/// leak: NVIDIA's 580 fails after 29 reloads, or crashes if two threads do it.
fn instance() -> wgpu::Instance {
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    let make = || {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        wgpu::Instance::new(descriptor)
    };
    INSTANCE.get_or_init(make).clone()
}

/// Returns name, kind and driver of every adapter, including software.
pub fn list_adapters() -> Vec<String> {
    let adapters = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.iter().map(|adapter| describe_adapter(&adapter.get_info())).collect()
}

/// A device and its queue.
pub struct Device {
    /// Instance that found the adapter; also creates the surfaces of windows.
    pub instance: wgpu::Instance,
    /// Adapter that the device was opened on.
    pub adapter: wgpu::Adapter,
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Name, kind and driver of the adapter.
    pub name: String,
    /// Whether passes can be timed.
    pub timestamps: bool,
    /// Results of self-tests of the device, by the type of the tested worker.
    faults: Mutex<HashMap<TypeId, Option<GpuError>>>,
    /// Pipelines made so far, by shader name and bits of the constants.
    pipelines: Mutex<HashMap<(&'static str, Vec<u64>), wgpu::ComputePipeline>>,
    /// Time after which the device counts as hung.
    hang_timeout: Duration,
    /// First error of the device.
    fault: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the best adapter: a discrete GPU before an integrated one before software, or the one whose name contains
    /// `wanted` (case-insensitive). With `hardware_only`, software adapters are ignored.
    ///
    /// # Errors
    /// No adapter fits, or the device could not be created.
    pub fn open(hardware_only: bool, wanted: Option<&str>) -> Result<Self, GpuError> {
        if hardware_only && wanted.is_none() && !has_gpu_node() {
            let found = "no GPU device node in /dev".to_owned();
            return Err(GpuError::NoAdapter { wanted: "in hardware".to_owned(), found });
        }
        let instance = instance();
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
        let fits = |info: &wgpu::AdapterInfo| match wanted {
            Some(wanted) => info.name.to_lowercase().contains(&wanted.to_lowercase()),
            None => !hardware_only || info.device_type != wgpu::DeviceType::Cpu,
        };
        let best = (0..adapters.len()).filter(|&k| fits(&infos[k])).min_by_key(|&k| adapter_rank(&infos[k]));
        let Some(best) = best else {
            let names: Vec<_> = infos.iter().map(describe_adapter).collect();
            return Err(GpuError::NoAdapter {
                wanted: match wanted {
                    Some(name) => format!("named '{name}'"),
                    None if hardware_only => "in hardware".to_owned(),
                    None => "at all".to_owned(),
                },
                found: if names.is_empty() { "none".to_owned() } else { names.join("; ") },
            });
        };
        let (adapter, name) = (adapters[best].clone(), describe_adapter(&infos[best]));
        let timestamps = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("bokehcam"),
            required_features: if timestamps { wgpu::Features::TIMESTAMP_QUERY } else { wgpu::Features::empty() },
            // Large pictures need more than the portable 128 MiB per buffer.
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|error| GpuError::Failed(format!("{name}: {error}")))?;
        let fault = Arc::new(Mutex::new(None));
        let report = |fault: &Arc<Mutex<Option<String>>>| {
            let fault = Arc::clone(fault);
            move |message: String| record_fault(&fault, message)
        };
        let (on_error, on_loss) = (report(&fault), report(&fault));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| on_error(error.to_string())));
        // Dropping the device calls this, too; the fault is then never read.
        device.set_device_lost_callback(move |_, message| on_loss(format!("device lost: {message}")));
        let hang_timeout =
            if infos[best].device_type == wgpu::DeviceType::Cpu { SOFTWARE_HANG_TIMEOUT } else { HANG_TIMEOUT };
        let (faults, pipelines) = (Mutex::default(), Mutex::default());
        Ok(Self { instance, adapter, device, queue, name, timestamps, faults, pipelines, hang_timeout, fault })
    }

    /// Sets the time after which the device counts as hung.
    #[must_use]
    pub fn with_hang_timeout(self, hang_timeout: Duration) -> Self {
        Self { hang_timeout, ..self }
    }

    /// Returns the pipeline of a shader with its `override` constants, from a cache. Its bind group layout follows from
    /// the source. Workgroup memory is not zero-initialised.
    pub fn pipeline(&self, shader: Shader, constants: &[(&str, f64)]) -> wgpu::ComputePipeline {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let constant_bits = constants.iter().map(|(_, value)| value.to_bits()).collect();
        pipelines.entry((shader.name, constant_bits)).or_insert_with(|| self.make_pipeline(shader, constants)).clone()
    }

    fn make_pipeline(&self, Shader { name, source }: Shader, constants: &[(&str, f64)]) -> wgpu::ComputePipeline {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(source.into()) };
        // Loop bounding would cost a twentieth of the time.
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..Default::default() };
        // SAFETY: all loops of all shaders terminate.
        #[allow(unsafe_code)]
        let module = unsafe { self.device.create_shader_module_trusted(descriptor, checks) };
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: None,
            module: &module,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        })
    }

    /// Creates bind group 0 of a pipeline: `buffers` at bindings 0, 1 and so on.
    pub fn create_bind_group<'a>(
        &self,
        pipeline: &wgpu::ComputePipeline,
        buffers: impl Iterator<Item = wgpu::BufferBinding<'a>>,
    ) -> wgpu::BindGroup {
        self.create_bind_group_with_layout(&pipeline.get_bind_group_layout(0), buffers)
    }

    /// Creates a bind group of a layout: `buffers` at bindings 0, 1 and so on.
    pub fn create_bind_group_with_layout<'a>(
        &self,
        layout: &wgpu::BindGroupLayout,
        buffers: impl Iterator<Item = wgpu::BufferBinding<'a>>,
    ) -> wgpu::BindGroup {
        let entry =
            |(k, buffer)| wgpu::BindGroupEntry { binding: k as u32, resource: wgpu::BindingResource::Buffer(buffer) };
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout,
            entries: &buffers.enumerate().map(entry).collect::<Vec<_>>(),
        })
    }

    /// Creates a buffer of `bytes` bytes, rounded up to whole words; at least 16, because a binding must not be empty.
    pub fn create_buffer(&self, label: &str, bytes: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(16).next_multiple_of(4) as u64,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Checks a picture size: its largest buffer and its number of workgroups must be within the limits of the device.
    ///
    /// # Errors
    /// The picture is too large to be `done` on this device.
    pub fn check_picture_size(&self, (width, height): (u32, u32), bytes: u64, done: &str) -> Result<(), GpuError> {
        let limits = self.device.limits();
        let max_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > max_bytes || width.max(height) > limits.max_compute_workgroups_per_dimension {
            let (name, size) = (&self.name, format!("{width} x {height}"));
            return Err(GpuError::Failed(format!("{name}: pictures of {size} are too large to be {done} on this GPU")));
        }
        Ok(())
    }

    /// Copies any number of bytes to a buffer, from byte `at` on, a multiple of 4. A device takes whole words only, so
    /// the last one is padded with zeros.
    pub fn upload(&self, buffer: &wgpu::Buffer, at: u64, bytes: &[u8]) {
        let (words, rest) = bytes.split_at(bytes.len() & !3);
        self.queue.write_buffer(buffer, at, words);
        if !rest.is_empty() {
            let mut word = [0; 4];
            word[..rest.len()].copy_from_slice(rest);
            self.queue.write_buffer(buffer, at + words.len() as u64, &word);
        }
    }

    /// Runs `work` in an error scope: its device errors are returned, and not reported by [`Device::check`].
    ///
    /// # Errors
    /// The device reported an error during `work`.
    pub fn with_error_scope<T>(&self, work: impl FnOnce() -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let done = work();
        let errors = [validation, memory].map(|scope| pollster::block_on(scope.pop()));
        match errors.into_iter().flatten().next() {
            Some(error) => Err(GpuError::Failed(format!("{}: {error}", self.name))),
            None => Ok(done),
        }
    }

    /// Checks whether the device has failed.
    ///
    /// # Errors
    /// Returns the first error of the device.
    pub fn check(&self) -> Result<(), GpuError> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            Some(message) => Err(GpuError::Failed(format!("{}: {message}", self.name))),
            None => Ok(()),
        }
    }
}

/// Records a fault, unless there is one already.
fn record_fault(fault: &Mutex<Option<String>>, message: String) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}

/// Whether the kernel has a GPU device node. Enumerating Vulkan takes time, and some drivers write to stderr.
fn has_gpu_node() -> bool {
    let render = std::fs::read_dir("/dev/dri")
        .is_ok_and(|entries| entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("render")));
    render
        || ["/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"]
            .iter()
            .any(|node| std::path::Path::new(node).exists())
}

/// Returns the rank of an adapter, lowest first.
fn adapter_rank(info: &wgpu::AdapterInfo) -> u32 {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu | wgpu::DeviceType::Other => 2,
        wgpu::DeviceType::Cpu => 3,
    }
}

/// Describes an adapter by name, kind and driver.
fn describe_adapter(info: &wgpu::AdapterInfo) -> String {
    let kind = match info.device_type {
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::DiscreteGpu => "discrete GPU",
        wgpu::DeviceType::IntegratedGpu => "integrated GPU",
        wgpu::DeviceType::VirtualGpu => "virtual GPU",
        wgpu::DeviceType::Other => "other",
    };
    format!("{} ({kind}, {} {})", info.name, info.driver, info.driver_info)
}
