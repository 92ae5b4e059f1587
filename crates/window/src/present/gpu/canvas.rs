//! Draws the picture and the controls to a texture, independent of the surface.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::controls::Overlay;
use crate::present::{Controls, Drawing, Image, StaleTone};
use bokehcam::compute::device::{Device, Shader};
use bokehcam::frame::ColorImage;

/// Shader that draws the picture in its area, and the background.
pub const PRESENT: Shader = Shader { name: "present", source: include_str!("present.wgsl") };

/// Maximum number of cached bind groups, one per pair of buffers.
const MAX_BIND_GROUPS: usize = 16;

/// Mirrors `Window` of `present.wgsl`, which documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct WindowUniform {
    pub area: [u32; 4],
    pub size: [u32; 2],
    pub split: u32,
    pub mirror: u32,
    pub stale: [f32; 4],
    pub divider: [u32; 4],
    pub visible_region: [u32; 4],
    pub stripes: [[f32; 4]; 3],
    pub background: [f32; 4],
}

/// Draws to textures of one format.
pub struct Canvas {
    device: Arc<Device>,
    /// Whether the target format is sRGB: the shader then writes linear light, which the hardware encodes.
    linear: bool,
    pipeline: wgpu::RenderPipeline,
    window: wgpu::Buffer,
    /// Buffers for pictures from memory: the picture, and the one before the blur.
    upload_buffers: [wgpu::Buffer; 2],
    bind_groups: Vec<CachedBindGroup>,
    overlay: Overlay,
}

/// A bind group and the pictures it binds.
struct CachedBindGroup {
    pictures: [wgpu::Buffer; 2],
    bind_group: wgpu::BindGroup,
}

impl Canvas {
    /// Creates a canvas for textures of `format`.
    pub fn new(device: Arc<Device>, format: wgpu::TextureFormat) -> Self {
        let module = device.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(PRESENT.name),
            source: wgpu::ShaderSource::Wgsl(PRESENT.source.into()),
        });
        let pipeline = device.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(PRESENT.name),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                buffers: &[],
                compilation_options: wgpu::PipelineCompilationOptions::default(),
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(PRESENT.name),
                targets: &[Some(format.into())],
                compilation_options: wgpu::PipelineCompilationOptions::default(),
            }),
            multiview_mask: None,
            cache: None,
        });
        use wgpu::BufferUsages as Usage;
        let window = device.create_buffer("window", size_of::<WindowUniform>(), Usage::UNIFORM | Usage::COPY_DST);
        let upload_buffers = [create_upload_buffer(&device, 0), create_upload_buffer(&device, 0)];
        // egui's renderer draws the controls in the same render pass.
        let overlay = Overlay::new(&device, format);
        Self { device, linear: format.is_srgb(), pipeline, window, upload_buffers, bind_groups: Vec::new(), overlay }
    }

    /// Replaces the controls.
    pub fn set_controls(&mut self, controls: Controls) {
        self.overlay.set_controls(&self.device, controls);
    }

    /// Draws picture and controls to the whole of `target`, which has `size` pixels.
    pub fn draw(&mut self, target: &wgpu::TextureView, size: (u32, u32), drawing: &Drawing) {
        let split = drawing.split();
        let picture = match drawing.picture {
            Image::Memory(picture) => self.upload_picture(0, picture),
            Image::Device(picture) if picture.is_on(&self.device) => picture.buffer().clone(),
            // Not shown, but the bind group needs a buffer.
            Image::Device(_) => self.upload_buffers[0].clone(),
        };
        let before = split.map(|(before, _)| self.upload_picture(1, before));
        let pictures = [picture, before.unwrap_or_else(|| self.upload_buffers[1].clone())];
        let window = self.window_uniform(drawing);
        self.device.queue.write_buffer(&self.window, 0, bytemuck::bytes_of(&window));
        let bind_group = self.bind_group_index(pictures);

        let mut encoder = self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut submitted = self.overlay.upload(&self.device, &mut encoder, size);
        {
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(PRESENT.name),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: target,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    depth_stencil_attachment: None,
                    timestamp_writes: None,
                    occlusion_query_set: None,
                    multiview_mask: None,
                })
                .forget_lifetime();
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bind_groups[bind_group].bind_group, &[]);
            pass.draw(0..3, 0..1);
            self.overlay.draw(&mut pass);
        }
        submitted.push(encoder.finish());
        self.device.queue.submit(submitted);
    }

    /// Returns the shader's parameters for a drawing.
    fn window_uniform(&self, drawing: &Drawing) -> WindowUniform {
        let color = |[r, g, b]: [u8; 3], w: f32| [f32::from(r) / 255.0, f32::from(g) / 255.0, f32::from(b) / 255.0, w];
        let flag = |on: bool| f32::from(u8::from(on));
        let area = drawing.area;
        let (width, height) = drawing.picture.size();
        // Pictures without pixels or on another device are not drawn.
        let shown = match drawing.picture {
            Image::Memory(picture) => !picture.rgb.is_empty(),
            Image::Device(picture) => picture.is_on(&self.device),
        };
        let [red, green, blue] =
            StaleTone::LUMA_WEIGHTS.map(|weight| weight as f32 / (1 << StaleTone::FRACTION_BITS) as f32);
        let mut window = WindowUniform {
            area: if shown { [area.x, area.y, area.width, area.height] } else { [0; 4] },
            size: [width, height],
            visible_region: drawing
                .visible_region
                .map_or([0; 4], |part| [part.origin.0, part.origin.1, part.factor, 0]),
            mirror: u32::from(drawing.mirror),
            stale: [red, green, blue, flag(drawing.stale)],
            background: color(drawing.background, flag(self.linear)),
            ..WindowUniform::default()
        };
        if let Some((_, split)) = drawing.split() {
            window.split = split.at as u32;
            for (k, (columns, stripe)) in split.divider().into_iter().enumerate() {
                window.divider[k] = columns.start as u32;
                window.divider[k + 1] = columns.end as u32;
                window.stripes[k] = color(stripe, 0.0);
            }
        }
        window
    }

    /// Uploads a picture to `upload_buffers[k]`, which grows if it is too small.
    fn upload_picture(&mut self, k: usize, picture: &ColorImage) -> wgpu::Buffer {
        if (self.upload_buffers[k].size() as usize) < picture.rgb.len() {
            self.upload_buffers[k] = create_upload_buffer(&self.device, picture.rgb.len());
        }
        self.device.upload(&self.upload_buffers[k], 0, &picture.rgb);
        self.upload_buffers[k].clone()
    }

    /// Returns the index in `bind_groups` of the bind group of these buffers, creating it if needed. Valid until the
    /// next call, which may clear a full cache.
    fn bind_group_index(&mut self, pictures: [wgpu::Buffer; 2]) -> usize {
        if let Some(bind_group) = self.bind_groups.iter().position(|bind_group| bind_group.pictures == pictures) {
            return bind_group;
        }
        // Bind groups keep their buffers alive, even those of dropped pictures.
        if self.bind_groups.len() >= MAX_BIND_GROUPS {
            self.bind_groups.clear();
        }
        let buffers = [&self.window, &pictures[0], &pictures[1]].map(|buffer| buffer.as_entire_buffer_binding());
        let bind_group =
            self.device.create_bind_group_with_layout(&self.pipeline.get_bind_group_layout(0), buffers.into_iter());
        self.bind_groups.push(CachedBindGroup { pictures, bind_group });
        self.bind_groups.len() - 1
    }
}

/// Creates a buffer for a picture of this size in bytes.
fn create_upload_buffer(device: &Device, bytes: usize) -> wgpu::Buffer {
    use wgpu::BufferUsages as Usage;
    // The shader reads whole words, even for the last pixel.
    device.create_buffer("picture to present", bytes.next_multiple_of(4) + 16, Usage::STORAGE | Usage::COPY_DST)
}
