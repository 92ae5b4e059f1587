//! The window's content, drawn by a GPU.

use std::sync::Arc;

use super::common::{coc, color, noise, settings, three_depths};
use bokehcam::bokeh::{self, Job};
use bokehcam::compute::PictureLocation;
use bokehcam::compute::device::{Device, DevicePicture};
use bokehcam::frame::ColorImage;
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam_window::present::gpu::Canvas;
use bokehcam_window::present::{Drawing, Image};

use super::*;
use crate::on_gpu::device;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// What the GPU draws, as words of the window.
fn drawn(device: &Arc<Device>, canvas: &mut Canvas, (width, height): (u32, u32), drawing: &Drawing) -> Vec<u32> {
    let gpu = &device.device;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = gpu.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let stride = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(stride * height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    canvas.draw(&texture.create_view(&wgpu::TextureViewDescriptor::default()), (width, height), drawing);
    let mut encoder = gpu.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, size);
    device.queue.submit([encoder.finish()]);
    let bytes = read(device, &buffer);
    let rows = bytes.chunks_exact(stride as usize);
    rows.flat_map(|row| row.as_chunks::<4>().0[..width as usize].iter().map(|&[r, g, b, _]| word([r, g, b]))).collect()
}

fn read(device: &Device, buffer: &wgpu::Buffer) -> Vec<u8> {
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    device.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).expect("the device works");
    device.check().expect("nothing is wrong");
    buffer.get_mapped_range(..).expect("it is mapped").to_vec()
}

/// Compares channels: equal up to `limit` codes, except one in `but_one_in` that may differ by up to `worst`.
fn close(ours: &[u32], theirs: &[u32], (limit, but_one_in, worst): (u8, usize, u8), what: &str) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let bytes = |pixels: &[u32]| pixels.iter().flat_map(|pixel| pixel.to_be_bytes()).collect::<Vec<u8>>();
    let off: Vec<u8> = bytes(ours).iter().zip(bytes(theirs)).map(|(a, b)| a.abs_diff(b)).collect();
    let beyond = off.iter().filter(|&&off| off > limit).count();
    let most = off.iter().max().copied().unwrap_or(0);
    assert!(beyond <= off.len() / but_one_in && most <= worst, "{what}: {beyond} of {}, {most} at most", off.len());
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn what_was_only_attempted_leaves_the_device_sound() {
    let device = device();
    let refused = wgpu::BufferDescriptor {
        label: None,
        size: 16,
        // This combination is never valid.
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    };
    assert!(device.with_error_scope(|| device.device.create_buffer(&refused)).is_err());
    device.check().unwrap();
    assert_eq!(device.with_error_scope(|| 7).unwrap(), 7);
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn both_presenters_show_the_same_pictures() {
    let device = device();
    let mut canvas = Canvas::new(Arc::clone(&device), FORMAT);
    for (layout, from, size, place) in layouts() {
        let (picture, before) = (noise(from.0, from.1), color(from.0, from.1, |x, y| [x as u8, y as u8, 255]));
        for (manner, shown) in manners(&picture, &before, place) {
            let ours = paint(size, &shown, None);
            let theirs = drawn(&device, &mut canvas, size, &shown);
            let what = format!("{layout}, {manner}");
            // An unscaled picture is copied exactly.
            let limit = if from == (place.width, place.height) && !shown.stale { 0 } else { 1 };
            close(&ours, &theirs, (limit, usize::MAX, limit), &what);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn both_presenters_show_the_same_controls() {
    let device = device();
    let mut canvas = Canvas::new(Arc::clone(&device), FORMAT);
    let picture = noise(500, 500);
    let shown = drawing(&picture, area(0, 0, 500, 500));
    for pixels_per_point in [1.0, 1.5] {
        let (ours, theirs) = (context(), context());
        let (mut painter, mut pixels) = (painter((500, 500), None), vec![0; 500 * 500]);
        // An egui window grows to its content during the first frames; textures of the first ones are needed later,
        // too.
        for frame in 0..3 {
            painter.set_controls(controls(&ours, (500, 500), pixels_per_point));
            canvas.set_controls(controls(&theirs, (500, 500), pixels_per_point));
            painter.paint(&mut pixels, &shown);
            let drawn = drawn(&device, &mut canvas, (500, 500), &shown);
            // Shadows are composited, and rounded, in another order.
            close(&pixels, &drawn, (3, 500, 24), &format!("frame {frame} at {pixels_per_point}"));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_picture_on_the_device_is_the_one_in_memory_and_is_shown_the_same() {
    let device = device();
    let mut canvas = Canvas::new(Arc::clone(&device), FORMAT);
    for (width, height) in [(97, 71), (64, 48)] {
        let settings = settings(CocKind::Depth);
        let mut bokeh =
            bokeh::create_blur(&settings, (width, height), Some(Arc::clone(&device)), None).expect("a blur");
        let (image, map) = (noise(width, height), three_depths(width, height));
        let mut results = Vec::new();
        for place in [PictureLocation::Memory, PictureLocation::Both, PictureLocation::Device] {
            let (color, depth) = (Pooled::detached(image.clone()), Pooled::detached(map.clone()));
            let job = Job::new(color, Some(depth), coc(CocKind::Depth, height));
            bokeh.submit(Job { place, ..job }).expect("room for a frame");
            let finished = bokeh.collect(true).expect("the GPU blurs").expect("a frame comes back");
            assert_eq!(
                (finished.picture.memory().is_some(), finished.picture.device().is_some()),
                match place {
                    PictureLocation::Memory => (true, false),
                    PictureLocation::Both => (true, true),
                    PictureLocation::Device => (false, true),
                }
            );
            results.extend(finished.picture.memory().cloned());
            if let Some(picture) = finished.picture.device() {
                assert!(picture.is_on(&device) && picture.size() == (width, height));
                results.push(ColorImage { width, height, rgb: bytes(&device, picture) });
                let place = area(3, 0, 140, 120);
                let here = drawing(&results[0], place);
                let there = Drawing { picture: Image::Device(picture), ..here };
                let (here, there) =
                    (drawn(&device, &mut canvas, (150, 120), &here), drawn(&device, &mut canvas, (150, 120), &there));
                assert_eq!(here, there);
            }
        }
        assert_eq!(results.len(), 4);
        assert!(results.iter().all(|result| result.rgb == results[0].rgb));
        assert_ne!(results[0].rgb, image.rgb, "it was blurred");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn results_go_to_memory_when_the_device_has_no_more_room_for_them() {
    let mut bokeh = bokeh::create_blur(&settings(CocKind::Uniform), (16, 16), Some(device()), None).expect("a blur");
    let mut kept = Vec::new();
    for frame in 0..40 {
        let job = Job::new(Pooled::detached(noise(16, 16)), None, coc(CocKind::Uniform, 16));
        bokeh.submit(Job { ticket: frame, place: PictureLocation::Device, ..job }).expect("room for a frame");
        kept.push(bokeh.collect(true).expect("the GPU blurs").expect("a frame comes back"));
    }
    let stayed = kept.iter().take_while(|finished| finished.picture.device().is_some()).count();
    assert!((8..40).contains(&stayed), "{stayed}");
    assert!(kept[stayed..].iter().all(|finished| finished.picture.memory() == kept[stayed].picture.memory()));
    kept.clear();
}

/// Reads back a picture from the device.
fn bytes(device: &Device, picture: &DevicePicture) -> Vec<u8> {
    let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: picture.buffer().size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(picture.buffer(), 0, &buffer, 0, buffer.size());
    device.queue.submit([encoder.finish()]);
    let mut bytes = read(device, &buffer);
    bytes.truncate((picture.size().0 * picture.size().1 * 3) as usize);
    bytes
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn an_enlarged_picture_is_the_same_on_both() {
    let device = device();
    let mut canvas = Canvas::new(Arc::clone(&device), FORMAT);
    let (picture, before) = (noise(64, 48), noise(64, 48));
    for (what, window, shown) in enlargements(&picture, &before) {
        let ours = drawn(&device, &mut canvas, window, &shown);
        close(&ours, &paint(window, &shown, None), (1, 10_000, 1), &what);
    }
}
