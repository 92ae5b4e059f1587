//! Pictures of a scene; the truth is cached between runs, as it is slow to render and never changes.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::{fs, io};

use bokehcam::frame::{ColorImage, DepthMap};

use super::lens::Scene;
use super::methods::Shot;
use super::picture::{Plane, encode_srgb};
use super::scenes::FOCUS_M;
use super::sheet;

/// Version of the renderer: increase it when the renderer changes.
const RENDERER: u32 = 1;
/// Rays per pixel: the minimum, the number per square pixel of the largest disc, and the maximum.
const RAYS: (f32, f32, f32) = (768.0, 2.0, 2048.0);

/// A scene, rendered.
pub struct Views {
    /// The input of the methods: the pinhole picture and exact depth.
    pub shot: Shot,
    /// CoC of each pixel.
    pub coc_px: Plane<f32>,
    /// The picture of the true lens.
    pub truth: ColorImage,
}

/// Renders a scene, or reads its truth from `cache`.
///
/// # Errors
/// Fails if the cache cannot be written.
pub fn load_or_render_views(scene: &Scene, name: &str, cache: &Path) -> io::Result<Views> {
    let views = render_without_truth(scene);
    let max_px = views.coc_px.data.iter().fold(0f32, |most, c| most.max(c.abs()));
    let rays = (RAYS.1 * max_px * max_px).clamp(RAYS.0, RAYS.2) as usize;
    let file = cache.join(format!("{name}-{:016x}.png", cache_key(scene, rays)));
    let truth = match sheet::read_png(&file) {
        Some(truth) => truth,
        None => {
            let truth = encode_srgb(&scene.render_thin_lens(rays));
            write_atomically(&truth, &file)?;
            truth
        }
    };
    Ok(Views { truth, ..views })
}

/// Returns the input of the methods, without the truth.
pub fn render_without_truth(scene: &Scene) -> Views {
    let coc_px = scene.render_coc();
    let shot = Shot {
        image: encode_srgb(&scene.render_pinhole()),
        depth: depth_from_coc(&coc_px, scene.coc_at_infinity_px),
        lens: Shot::lens(scene.coc_at_infinity_px, FOCUS_M, scene.height),
        aperture: scene.aperture.clone(),
    };
    Views { shot, coc_px, truth: ColorImage::default() }
}

/// Returns the depth map whose CoC is `coc_px`.
pub fn depth_from_coc(coc_px: &Plane<f32>, coc_at_infinity_px: f32) -> DepthMap {
    let metres = |coc_px: f32| FOCUS_M / (1.0 - coc_px / coc_at_infinity_px).max(1e-3);
    DepthMap {
        width: coc_px.width as u32,
        height: coc_px.height as u32,
        metres: coc_px.map(metres).data,
        ..DepthMap::default()
    }
}

/// Returns a hash of everything that the truth depends on.
fn cache_key(scene: &Scene, rays: usize) -> u64 {
    let mut hasher = DefaultHasher::new();
    (RENDERER, rays, scene.size(), format!("{:?}", scene.aperture)).hash(&mut hasher);
    for surface in &scene.surfaces {
        surface.margin_px.hash(&mut hasher);
        let numbers = [surface.coc_px, surface.slope.x, surface.slope.y];
        let texels = surface.texture.data.iter().flatten();
        numbers.iter().chain(texels).for_each(|number| number.to_bits().hash(&mut hasher));
    }
    hasher.finish()
}

/// Writes to a temporary name first, so that an existing picture is complete.
fn write_atomically(image: &ColorImage, file: &Path) -> io::Result<()> {
    fs::create_dir_all(file.parent().unwrap_or(Path::new(".")))?;
    let part: PathBuf = file.with_extension("part.png");
    sheet::write_png(&part, image)?;
    fs::rename(part, file)
}
