//! What the window shows, painted into memory.
#![cfg(feature = "window")]
#![allow(missing_docs)]

mod common;

use std::sync::Arc;

use bokehcam::bokeh::{self, Job};
use bokehcam::budget::Quality;
use bokehcam::compute::Place;
use bokehcam::compute::device::{Device, DevicePicture};
use bokehcam::frame::ColorImage;
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam::preview::panel;
use bokehcam::preview::present::gpu::Canvas;
use bokehcam::preview::present::soft::Painter;
use bokehcam::preview::present::{Area, Controls, Drawing, Image};
use common::{coc, color, noise, settings, three_depths};

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const BACKGROUND: [u8; 3] = [9, 8, 7];

fn drawing(picture: &ColorImage, area: Area) -> Drawing<'_> {
    Drawing { area, picture: Image::Memory(picture), before: None, mirror: false, stale: false, background: BACKGROUND }
}

fn area(x: u32, y: u32, width: u32, height: u32) -> Area {
    Area { x, y, width, height }
}

fn painter(size: (u32, u32), controls: Option<Controls>) -> Painter {
    let mut painter = Painter::new();
    painter.resize(size);
    controls.into_iter().for_each(|controls| painter.set_controls(controls));
    painter
}

fn paint(size: (u32, u32), drawing: &Drawing, controls: Option<Controls>) -> Vec<u32> {
    let mut pixels = vec![0xdead_beef; (size.0 * size.1) as usize];
    painter(size, controls).paint(&mut pixels, 0, drawing);
    pixels
}

fn word([r, g, b]: [u8; 3]) -> u32 {
    u32::from_be_bytes([0, r, g, b])
}

fn at(image: &ColorImage, x: u32, y: u32) -> [u8; 3] {
    image.rgb.as_chunks().0[(y * image.width + x) as usize]
}

/// egui with the window's own fonts.
fn context() -> egui::Context {
    let context = egui::Context::default();
    panel::dress(&context);
    context
}

/// Controls of every kind, text first.
fn controls(context: &egui::Context, size: (u32, u32), pixels_per_point: f32) -> Controls {
    let points = egui::vec2(size.0 as f32, size.1 as f32) / pixels_per_point;
    let mut input = egui::RawInput {
        screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, points)),
        ..egui::RawInput::default()
    };
    input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(pixels_per_point);
    let mut value = 0.4;
    let output = context.run_ui(input, |ui| {
        egui::Window::new("Look").default_width(280.0).show(ui.ctx(), |ui| {
            ui.heading("Aperture");
            for line in 0..12 {
                ui.add(egui::Slider::new(&mut value, 0.0..=1.0).text("f-number"));
                ui.horizontal(|ui| {
                    ui.label("The quick brown fox jumps over");
                    let _ = ui.button(format!("Button {line}"));
                });
                ui.checkbox(&mut (line % 2 == 0), "mirror");
            }
        });
    });
    Controls {
        primitives: context.tessellate(output.shapes, output.pixels_per_point),
        textures: output.textures_delta,
        pixels_per_point: output.pixels_per_point,
    }
}

/// What it is, the size of the picture, that of the window, and where in it the picture is.
type Layout = (&'static str, (u32, u32), (u32, u32), Area);

fn layouts() -> [Layout; 7] {
    [
        ("as it is", (64, 48), (64, 48), area(0, 0, 64, 48)),
        ("with bars", (64, 48), (97, 60), area(16, 5, 64, 48)),
        ("enlarged", (64, 48), (200, 130), area(13, 0, 173, 130)),
        ("enlarged by little", (64, 48), (70, 52), area(0, 0, 69, 52)),
        ("shrunk by little", (64, 48), (60, 45), area(0, 0, 60, 45)),
        ("shrunk", (64, 48), (30, 25), area(1, 2, 27, 20)),
        ("shrunk by much", (331, 247), (32, 20), area(3, 0, 26, 20)),
    ]
}

/// Every way to show two pictures.
fn manners<'a>(picture: &'a ColorImage, before: &'a ColorImage, place: Area) -> Vec<(String, Drawing<'a>)> {
    let mut all = Vec::new();
    for (mirror, stale) in [(false, false), (true, false), (false, true)] {
        for split in [None, Some(0.0), Some(0.37), Some(1.0)] {
            let before = split.map(|split| (before, split));
            all.push((
                format!("mirror {mirror}, stale {stale}, split {split:?}"),
                Drawing { before, mirror, stale, ..drawing(picture, place) },
            ));
        }
    }
    all
}

#[test]
fn a_picture_of_the_windows_size_is_copied() {
    let picture = noise(61, 47);
    let pixels = paint((61, 47), &drawing(&picture, area(0, 0, 61, 47)), None);
    let expected: Vec<u32> = picture.rgb.as_chunks().0.iter().copied().map(word).collect();
    assert_eq!(pixels, expected);
}

#[test]
fn the_background_is_around_the_picture() {
    let picture = color(8, 6, |_, _| [200, 100, 50]);
    for (size, place) in [((20, 10), area(6, 2, 8, 6)), ((20, 10), area(3, 0, 16, 10)), ((20, 10), area(0, 4, 20, 3))] {
        let pixels = paint(size, &drawing(&picture, place), None);
        for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
            let inside =
                (place.x..place.x + place.width).contains(&x) && (place.y..place.y + place.height).contains(&y);
            let expected = word(if inside { [200, 100, 50] } else { BACKGROUND });
            assert_eq!(pixels[(y * size.0 + x) as usize], expected, "{place:?} at {x}, {y}");
        }
    }
}

#[test]
fn a_mirror_flips_the_picture_and_not_the_split() {
    let (picture, before) = (noise(40, 30), color(40, 30, |x, _| [x as u8, 0, 255]));
    let whole = area(0, 0, 40, 30);
    let shown = Drawing { mirror: true, before: Some((&before, 0.25)), ..drawing(&picture, whole) };
    let pixels = paint((40, 30), &shown, None);
    for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
        let expected = match x {
            0..8 => at(&before, 39 - x, y),
            8 | 11 => [24; 3],
            9..11 => [255; 3],
            _ => at(&picture, 39 - x, y),
        };
        // The divider is two bright columns between two dark ones.
        let expected = if x == 8 || x == 11 { [24; 3] } else { expected };
        assert_eq!(pixels[(y * 40 + x) as usize], word(expected), "{x}, {y}");
    }
}

#[test]
fn scaling_mirrored_is_mirroring_scaled() {
    let picture = noise(64, 48);
    for place in [area(0, 0, 101, 75), area(0, 0, 40, 30)] {
        let size = (place.width, place.height);
        let straight = paint(size, &drawing(&picture, place), None);
        let mut flipped = paint(size, &Drawing { mirror: true, ..drawing(&picture, place) }, None);
        flipped.chunks_exact_mut(size.0 as usize).for_each(<[u32]>::reverse);
        assert_eq!(straight, flipped);
    }
}

#[test]
fn a_stale_picture_is_grey_and_darker() {
    let picture = color(3, 1, |x, _| [[255, 255, 255], [0, 0, 0], [10, 200, 30]][x as usize]);
    let pixels = paint((3, 1), &Drawing { stale: true, ..drawing(&picture, area(0, 0, 3, 1)) }, None);
    assert_eq!(pixels, [word([153; 3]), 0, word([74; 3])]);
}

#[test]
fn buffers_that_come_back_show_the_same_as_new_ones() {
    let (size, context) = ((200, 120), context());
    let mut painter = painter(size, None);
    let picture = noise(100, 100);
    let drawings = [area(50, 10, 100, 100), area(0, 0, 100, 100), area(40, 0, 120, 120)];
    let (mut buffers, mut ages) = (vec![vec![0xdead_beef; (size.0 * size.1) as usize]; 3], [0_u8; 3]);
    for frame in 0..40_usize {
        if frame % 7 == 3 {
            let mut fresh = controls(&context, size, 1.0);
            if frame % 2 == 0 {
                fresh.primitives.truncate(frame / 7);
            }
            painter.set_controls(fresh);
        }
        let shown = drawing(&picture, drawings[frame / 9 % 3]);
        // Buffers in no order at all.
        let k = (frame * frame + frame / 5) % 3;
        painter.paint(&mut buffers[k], ages[k], &shown);
        let mut expected = vec![0; (size.0 * size.1) as usize];
        ages.iter_mut().for_each(|age| *age = if *age == 0 { 0 } else { *age + 1 });
        ages[k] = 1;
        painter.paint(&mut expected, 0, &shown);
        ages.iter_mut().for_each(|age| *age = if *age == 0 { 0 } else { *age + 1 });
        assert_eq!(buffers[k], expected, "frame {frame}");
    }
}

#[test]
fn what_does_not_fit_is_cut_and_what_is_nothing_shows_nothing() {
    let picture = noise(64, 48);
    let beyond = paint((40, 30), &drawing(&picture, area(10, 10, 64, 48)), None);
    assert_eq!(beyond[10 * 40 + 10], word(at(&picture, 0, 0)));
    assert_eq!(beyond[29 * 40 + 39], word(at(&picture, 29, 19)));
    let empty = ColorImage::default();
    for (picture, place) in [(&empty, area(0, 0, 4, 3)), (&picture, area(0, 0, 0, 0)), (&picture, area(0, 0, 4, 0))] {
        assert_eq!(paint((4, 3), &drawing(picture, place), None), [word(BACKGROUND); 12]);
    }
}

#[test]
fn text_and_controls_are_painted_over_the_picture() {
    let (size, context) = ((480, 480), context());
    let picture = color(480, 480, |_, _| [90, 140, 60]);
    let shown = drawing(&picture, area(0, 0, 480, 480));
    // A window grows to its content in its first frames.
    let mut painter = painter(size, Some(controls(&context, size, 1.0)));
    painter.set_controls(controls(&context, size, 1.0));
    let mut pixels = vec![0; 480 * 480];
    painter.paint(&mut pixels, 0, &shown);
    let plain = word([90, 140, 60]);
    let changed = pixels.iter().filter(|&&pixel| pixel != plain).count();
    assert!(changed > 480 * 480 / 10, "{changed}");
    assert_eq!(pixels[480 * 480 - 1], plain, "the corner is free");
    let kinds: std::collections::HashSet<u32> = pixels.iter().copied().collect();
    assert!(kinds.len() > 40, "text has smooth edges: {} colours", kinds.len());
    // The controls go, and the picture is whole again.
    painter.set_controls(Controls {
        primitives: Vec::new(),
        textures: egui::TexturesDelta::default(),
        pixels_per_point: 1.0,
    });
    painter.paint(&mut pixels, 1, &shown);
    assert!(pixels.iter().all(|&pixel| pixel == plain));
}

fn device() -> Arc<Device> {
    Arc::new(Device::open(false, None).expect("a Vulkan adapter, software included"))
}

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

/// Equal up to `limit` codes, but for one channel in `but_one_in` that may be off by up to `worst`.
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
    let device = Device::open(false, None).unwrap();
    let refused = wgpu::BufferDescriptor {
        label: None,
        size: 16,
        // Both at once is never allowed.
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    };
    assert!(device.attempt(|| device.device.create_buffer(&refused)).is_err());
    device.check().unwrap();
    assert_eq!(device.attempt(|| 7).unwrap(), 7);
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
            // Where nothing is computed, nothing is rounded.
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
        // A window grows to its content in its first frames; textures of the first ones are needed later, too.
        for frame in 0..3 {
            painter.set_controls(controls(&ours, (500, 500), pixels_per_point));
            canvas.set_controls(controls(&theirs, (500, 500), pixels_per_point));
            painter.paint(&mut pixels, 1, &shown);
            let drawn = drawn(&device, &mut canvas, (500, 500), &shown);
            // Shadows are laid over each other, and rounded, in another order.
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
        let mut bokeh = bokeh::create_on(&settings, (width, height), Arc::clone(&device), None).expect("a blur");
        let (image, map) = (noise(width, height), three_depths(width, height));
        let mut results = Vec::new();
        for place in [Place::Memory, Place::Both, Place::Device] {
            let job = Job {
                ticket: 0,
                color: Pooled::detached(image.clone()),
                depth: Some(Pooled::detached(map.clone())),
                coc: coc(CocKind::Depth, height),
                quality: Quality::default(),
                place,
                out: Pooled::detached(ColorImage::default()),
            };
            bokeh.submit(job).expect("room for a frame");
            let finished = bokeh.collect(true).expect("the GPU blurs").expect("a frame comes back");
            assert_eq!(
                (finished.picture.memory().is_some(), finished.picture.device().is_some()),
                match place {
                    Place::Memory => (true, false),
                    Place::Both => (true, true),
                    Place::Device => (false, true),
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
    let mut bokeh = bokeh::create_on(&settings(CocKind::Uniform), (16, 16), device(), None).expect("a blur");
    let mut kept = Vec::new();
    for frame in 0..40 {
        let job = Job {
            ticket: frame,
            color: Pooled::detached(noise(16, 16)),
            depth: None,
            coc: coc(CocKind::Uniform, 16),
            quality: Quality::default(),
            place: Place::Device,
            out: Pooled::detached(ColorImage::default()),
        };
        bokeh.submit(job).expect("room for a frame");
        kept.push(bokeh.collect(true).expect("the GPU blurs").expect("a frame comes back"));
    }
    let stayed = kept.iter().take_while(|finished| finished.picture.device().is_some()).count();
    assert!((8..40).contains(&stayed), "{stayed}");
    assert!(kept[stayed..].iter().all(|finished| finished.picture.memory() == kept[stayed].picture.memory()));
    kept.clear();
}

/// The bytes of a picture on the device.
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
