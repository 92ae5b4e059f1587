//! Renders everything in `recordings/` again: `cargo run --release --example make_recordings`.
//!
//! With the name of a recording it renders that one alone; with `--check` it writes nothing and compares the existing
//! files with its renderings.

mod folder;

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::thread;

use bokehcam::bokeh::aperture::{Aperture, Shape, lens_points};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_lab::scene::{Scene, ThinLens, View};
use bokehcam_live::capture::demo::{self, Demo};
use bokehcam_live::capture::{Camera, FrameBuffers};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use folder::Folder;

const SIZE_PX: (u32, u32) = (640, 360);
const FRAMES_PER_SECOND: u32 = 12;
const SAMPLES_PER_PIXEL: u32 = 16;
/// Scale of the TUM benchmark.
const DEPTH_UNITS_PER_METRE: f32 = 5000.0;
const BASELINE_M: f32 = 0.06;
/// Scale of the KITTI benchmarks.
const DISPARITY_UNITS_PER_PX: f32 = 256.0;
/// Number of the portrait's frames that have a right picture.
const STEREO_FRAMES: u32 = 12;
const COC_AT_INFINITY_PX: f32 = 14.0;
/// Rays per pixel of the true blur: more than half the pixels of the widest disc.
const LENS_RAYS: usize = 720;
const DISC_FRAMES: [u32; 3] = [0, 8, 16];
const HEXAGON_FRAMES: [u32; 1] = [0];

/// JPEG quality of the demonstration's colour pictures.
const JPEG_QUALITY: u8 = 82;
/// Minimum PSNR of the demonstration's JPEGs.
const MIN_PSNR_DB: f64 = 34.0;
/// Changes below this many codes count as static in the demonstration.
const MIN_CHANGE: u8 = 2;

type Outcome = Result<(), Box<dyn Error>>;

/// Renders a recording into its folder.
type Make = fn(&mut Folder) -> Outcome;

/// The recordings, and the function that renders each.
const RECORDINGS: [(&str, Make); 3] = [("portrait", make_portrait), ("stereo", make_stereo), ("demo", make_demo)];

fn main() -> ExitCode {
    let (mut check, mut only) = (false, None);
    for argument in std::env::args().skip(1) {
        match RECORDINGS.iter().find(|(name, _)| *name == argument) {
            _ if argument == "--check" => check = true,
            Some((name, _)) => only = Some(*name),
            None => {
                eprintln!(
                    "no option '{argument}': use --check, or none to write; and portrait, stereo or demo for one alone"
                );
                return ExitCode::from(2);
            }
        }
    }
    let mut differing = 0;
    for (name, make) in RECORDINGS {
        if only.is_some_and(|only| only != name) {
            continue;
        }
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings").join(name);
        let mut folder = Folder { root, check, differing: 0 };
        if let Err(error) = make(&mut folder) {
            eprintln!("{name}: {error}");
            return ExitCode::FAILURE;
        }
        differing += folder.differing;
    }
    if differing > 0 {
        eprintln!("{differing} files differ; render them again without --check");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

fn make_portrait(folder: &mut Folder) -> Outcome {
    let scene = Scene::portrait();
    let view = View::new(SIZE_PX.0, SIZE_PX.1);
    folder.write_or_check_text("camera.txt", &format_camera(&scene, &view))?;
    make_sequence(folder, &scene, &view)?;
    make_truth(folder, &scene, &view)
}

/// Renders both pictures and the true disparity of the portrait's first frames, in the layout of the KITTI odometry
/// benchmark.
fn make_stereo(folder: &mut Folder) -> Outcome {
    let scene = Scene::portrait();
    let left = View::new(SIZE_PX.0, SIZE_PX.1);
    let right = left.right_camera(BASELINE_M);
    folder.write_or_check_text("calib.txt", &format_calibration(&left))?;
    let mut times = String::new();
    let (mut picture, mut map) = (ColorImage::default(), DepthMap::default());
    for frame in 0..STEREO_FRAMES {
        let mut render = |view: &View, picture: &mut ColorImage| {
            scene.render_pinhole(view, time_s(frame), SAMPLES_PER_PIXEL, thread_count(), picture, &mut map);
        };
        render(&right, &mut picture);
        folder.write_or_check_color(&format!("image_3/{frame:06}.png"), &picture)?;
        render(&left, &mut picture);
        folder.write_or_check_color(&format!("image_2/{frame:06}.png"), &picture)?;
        let units_at_1_m = left.focal_px * BASELINE_M * DISPARITY_UNITS_PER_PX;
        folder.write_or_check_gray16(&format!("disp/{frame:06}.png"), &map, |z_m| units_at_1_m / z_m)?;
        writeln!(times, "{:.6}", time_s(frame))?;
    }
    folder.write_or_check_text("times.txt", &times)
}

/// Renders the loop that is built into the program: a whole picture, then tiles as in [`demo::Layout`].
fn make_demo(folder: &mut Folder) -> Outcome {
    let (scene, view) = (Scene::portrait(), View::new(demo::SIZE_PX.0, demo::SIZE_PX.1));
    let render = |frame: u32| {
        let (mut picture, mut map) = (ColorImage::default(), DepthMap::default());
        let time_s = f64::from(frame) / f64::from(demo::FRAMES_PER_SECOND);
        scene.render_pinhole(&view, time_s, SAMPLES_PER_PIXEL, thread_count(), &mut picture, &mut map);
        (picture, map)
    };
    if folder.check {
        return check_demo(folder, render);
    }
    let frames: Vec<(Vec<u8>, Vec<u8>)> = (0..demo::FRAMES)
        .map(render)
        .map(|(picture, map)| (picture.rgb, map.metres.into_iter().map(demo::quantize_depth).collect()))
        .collect();
    let (width, tile) = (demo::SIZE_PX.0 as usize, demo::TILE_PX as usize);
    let moves: Vec<bool> = frames[0]
        .1
        .iter()
        .enumerate()
        .map(|(pixel, level)| {
            let rgb = &frames[0].0[3 * pixel..][..3];
            frames.iter().any(|(other, levels)| {
                levels[pixel] != *level || rgb.iter().zip(&other[3 * pixel..]).any(|(a, b)| a.abs_diff(*b) > MIN_CHANGE)
            })
        })
        .collect();
    let tiles: Vec<bool> = (0..demo::SIZE_PX.1 as usize / tile)
        .flat_map(|row| (0..width / tile).map(move |column| [tile * row, tile * column]))
        .map(|[y, x]| (y..y + tile).any(|y| moves[y * width + x..][..tile].contains(&true)))
        .collect();
    let layout = demo::Layout::new(tiles.iter().copied());
    let tiles: Vec<u8> = tiles.into_iter().map(|moves| if moves { 255 } else { 0 }).collect();
    let map_size = (demo::SIZE_PX.0 / demo::TILE_PX, demo::SIZE_PX.1 / demo::TILE_PX);
    folder.write_png("moving.png", &tiles, map_size, ExtendedColorType::L8)?;
    let (mut color, mut depth) = (Vec::new(), Vec::new());
    let mut add = |rgb: &[u8], levels: &[u8], (width, height): (u32, u32)| {
        let jpeg = JpegEncoder::new_with_quality(&mut color, JPEG_QUALITY);
        jpeg.write_image(rgb, width, height, ExtendedColorType::Rgb8)?;
        let png = PngEncoder::new_with_quality(&mut depth, CompressionType::Best, FilterType::Adaptive);
        png.write_image(levels, width, height, ExtendedColorType::L8)
    };
    add(&frames[0].0, &frames[0].1, demo::SIZE_PX)?;
    let size = layout.size_px();
    let mut levels = vec![0; width * size.1 as usize];
    let mut rgb = vec![0; 3 * levels.len()];
    for (picture, map) in &frames {
        for [to, from] in layout.tile_rows() {
            rgb[3 * to..3 * (to + tile)].copy_from_slice(&picture[3 * from..3 * (from + tile)]);
            levels[to..to + tile].copy_from_slice(&map[from..from + tile]);
        }
        add(&rgb, &levels, size)?;
    }
    for (name, file) in [("color.mjpeg", color), ("depth.mpng", depth)] {
        eprintln!("{name}: {} kB", file.len() / 1000);
        fs::write(folder.root.join(name), file)?;
    }
    Ok(())
}

/// Compares the demonstration, as it is played, with the renderings.
fn check_demo(folder: &mut Folder, render: impl Fn(u32) -> (ColorImage, DepthMap)) -> Outcome {
    let mut camera = Demo::new(None)?;
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    for frame in 0..demo::FRAMES {
        camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right })?;
        let (picture, map) = render(frame);
        let squares = color.rgb.iter().zip(&picture.rgb).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
        let psnr_db = 10.0 * (255.0f64.powi(2) * color.rgb.len() as f64 / squares.sum::<f64>()).log10();
        let levels =
            |map: &DepthMap| map.metres.iter().map(|&z_m| i32::from(demo::quantize_depth(z_m))).collect::<Vec<_>>();
        let name = format!("frame {frame}, {psnr_db:.1} dB");
        folder.compare_values(
            &name,
            psnr_db >= MIN_PSNR_DB,
            levels(&depth).iter().zip(levels(&map)).map(|(a, b)| a - b),
        );
    }
    Ok(())
}

fn frame_count(scene: &Scene) -> u32 {
    (scene.period_s() * f64::from(FRAMES_PER_SECOND)).round() as u32
}

fn time_s(frame: u32) -> f64 {
    f64::from(frame) / f64::from(FRAMES_PER_SECOND)
}

fn thread_count() -> usize {
    thread::available_parallelism().map_or(1, |n| n.get())
}

/// Writes the left picture and depth, and the lists that make the folder a TUM recording. Does not use the crate's own
/// writer, which compresses for speed: these pictures are shipped with the source.
fn make_sequence(folder: &mut Folder, scene: &Scene, view: &View) -> Outcome {
    let mut rgb = String::from("# colour pictures, 8-bit RGB PNG\n# timestamp filename\n");
    let mut depth =
        format!("# depth maps, 16-bit PNG, {DEPTH_UNITS_PER_METRE} units per metre\n# timestamp filename\n");
    let mut pairs = String::new();
    let (mut picture, mut map) = (ColorImage::default(), DepthMap::default());
    for frame in 0..frame_count(scene) {
        scene.render_pinhole(view, time_s(frame), SAMPLES_PER_PIXEL, thread_count(), &mut picture, &mut map);
        folder.write_or_check_color(&format!("rgb/{frame:06}.png"), &picture)?;
        folder.write_or_check_gray16(&format!("depth/{frame:06}.png"), &map, |z_m| z_m * DEPTH_UNITS_PER_METRE)?;
        let time = format!("{:.6}", time_s(frame));
        writeln!(rgb, "{time} rgb/{frame:06}.png")?;
        writeln!(depth, "{time} depth/{frame:06}.png")?;
        writeln!(pairs, "{time} rgb/{frame:06}.png {time} depth/{frame:06}.png")?;
    }
    folder.write_or_check_text("rgb.txt", &rgb)?;
    folder.write_or_check_text("depth.txt", &depth)?;
    folder.write_or_check_text("associations.txt", &pairs)
}

/// Renders frames through a true thin lens.
fn make_truth(folder: &mut Folder, scene: &Scene, view: &View) -> Outcome {
    let hexagon = Shape::Polygon { blades: 6, rotation_deg: 0.0, curvature: 0.0 };
    let sets = [("disc", Shape::Disc, &DISC_FRAMES[..]), ("hexagon", hexagon, &HEXAGON_FRAMES[..])];
    for (name, shape, frames) in sets {
        let aperture = lens_points(&Aperture { shape, intensity: 0.0 }, LENS_RAYS);
        let lens = ThinLens { coc_at_infinity_px: COC_AT_INFINITY_PX, focus_m: scene.focus_m(), aperture: &aperture };
        for &frame in frames {
            let picture = scene.render_thin_lens(view, time_s(frame), &lens, thread_count());
            folder.write_or_check_color(&format!("truth/{name}_clipped_{frame:06}.png"), &picture.clipped.to_srgb())?;
            folder.write_or_check_color(&format!("truth/{name}_hdr_{frame:06}.png"), &picture.hdr.to_srgb())?;
        }
    }
    Ok(())
}

fn format_camera(scene: &Scene, view: &View) -> String {
    let centre = view.principal_point_px();
    format!(
        "# The camera of this recording; pixel centres are at whole numbers.\n\
         width {}\nheight {}\nfocal_px {}\ncx {}\ncy {}\n\
         # Units of the depth pictures; depth is along the optical axis.\n\
         depth_units_per_metre {DEPTH_UNITS_PER_METRE}\n\
         # Depth of the subject's face, in metres, and the lens of the pictures in truth/.\n\
         focus_m {}\ncoc_at_infinity_px {COC_AT_INFINITY_PX}\nlens_rays {LENS_RAYS}\n",
        view.width,
        view.height,
        view.focal_px,
        centre.x,
        centre.y,
        scene.focus_m(),
    )
}

/// Returns the pair's geometry in KITTI's format: projections of the left and the right colour camera, row by row.
fn format_calibration(view: &View) -> String {
    let centre = view.principal_point_px();
    let row = |offset_px: f32| {
        let focal_px = view.focal_px;
        format!("{focal_px:.5} 0 {:.5} {offset_px:.5} 0 {focal_px:.5} {:.5} 0 0 0 1 0", centre.x, centre.y)
    };
    format!("P2: {}\nP3: {}\n", row(0.0), row(-view.focal_px * BASELINE_M))
}
