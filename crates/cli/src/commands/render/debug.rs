//! `render --debug-dir`: writes every intermediate result of a blur as a picture, and its plan as numbers.

use std::fs;
use std::io;
use std::path::Path;

use serde::Serialize;

use super::debug_pictures::{draw_coc, draw_grey, draw_light};
use crate::error::CliError;
use crate::files::{refuse_overwrite, write_atomically};
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::ladder::Compositing;
use bokehcam::bokeh::plan::{Bin, Plan};
use bokehcam::bokeh::{Bokeh, Probe};
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::engine::still::{Depth, compute_coc_and_depth, prepare_16bit};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam::recording::{Photo, still};

/// Name of the file of numbers, which is written even if nothing is blurred.
pub const PLAN: &str = "plan.json";

/// Contents of `plan.json`: how the picture was blurred.
#[derive(Serialize)]
struct PlanFile {
    /// Width and height of the picture, in pixels.
    size: (u32, u32),
    executor: String,
    /// `layers`, `select`, `gather` or `none`.
    compositing: &'static str,
    /// Number of separable terms of the filters.
    rank: usize,
    /// Distance of the focal plane in metres, and CoC radius at infinity, if the blur follows depth.
    focus_m: Option<f32>,
    coc_at_infinity_px: Option<f32>,
    /// Lowest and highest CoC of the picture, in pixels; negative in front of the focal plane.
    coc_px: Option<Range>,
    /// CoC at full saturation in the pictures of CoC, in pixels.
    coc_full_color_px: f32,
    /// Whether the background hidden by near objects was filled in.
    filled: bool,
    /// Fraction of the picture in tiles whose background is sharp.
    still_share: f32,
    bins: Vec<BinEntry>,
    /// Names of the pictures in the same folder.
    files: Vec<String>,
}

/// A CoC bin. A border of `null` is open.
#[derive(Serialize)]
struct BinEntry {
    index: usize,
    /// CoC limits, in pixels of the picture.
    low_px: Option<f32>,
    high_px: Option<f32>,
    /// Picture pixels per bin pixel, in each direction.
    scale: usize,
    width: usize,
    height: usize,
    /// Largest filter radius, in bin pixels: white in the picture of the radius.
    max_radius_px: f32,
    near: bool,
    /// Index of the executor's buffer.
    slot: usize,
    /// Whether the bin had content; if not, its passes were skipped.
    present: bool,
    /// The pixels with over half of their weight in this bin: their fraction of the picture, and their CoC and depth
    /// ranges.
    picture_share: f32,
    content_coc_px: Option<Range>,
    content_depth_m: Option<Range>,
}

/// Lowest and highest value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Range(f32, f32);

impl Range {
    fn from_values(values: impl Iterator<Item = f32>) -> Option<Self> {
        values.fold(None, |range, value| {
            let Range(low, high) = range.unwrap_or(Range(value, value));
            Some(Range(low.min(value), high.max(value)))
        })
    }
}

/// Blurs a photo on the CPU and writes every intermediate result into the folder `dir`; `force` overwrites existing
/// files. Returns a description of the executor.
///
/// # Errors
/// Fails like the blur itself, or if a file in the folder exists without `force` or cannot be written.
pub fn blur_and_dump(
    photo: &mut Photo,
    depth: Option<Depth>,
    look: &Look,
    computing: &ComputeOptions,
    (dir, force): (&Path, bool),
) -> Result<String, CliError> {
    let size = photo.color.size();
    let mut output = DebugOutput { pictures: Vec::new(), plan: PlanFile::for_unblurred(size) };
    if let Some(settings) = look.blur_settings(size, false) {
        if computing.backend == Backend::Gpu || computing.adapter.is_some() {
            let text = "--debug-dir needs the CPU executor: leave --backend gpu and --adapter out";
            return Err(CliError::Usage(text.to_string()));
        }
        settings.check(size)?;
        // Always the CPU executor: only its intermediates can be read.
        let mut bokeh = CpuBokeh::new(Plan::new(&settings, size.0, size.1), computing.threads);
        let color = &mut photo.color;
        let (coc, depth) = match &mut photo.codes {
            None => compute_coc_and_depth(look, color, depth)?,
            Some(codes) => prepare_16bit(look, color, codes, depth)?,
        };
        let mut result = ColorImage::default();
        match &mut photo.codes {
            None => drop(bokeh.blur(color, depth.as_ref(), &coc, &mut result)?),
            Some(codes) => *codes = bokeh.blur_16bit(codes, depth.as_ref(), &coc)?,
        }
        output.collect(&bokeh, color, depth.as_ref(), &coc);
        *color = result;
    }
    output.write(dir, force)?;
    Ok(output.plan.executor)
}

/// The pictures with their file names, and the numbers.
struct DebugOutput {
    pictures: Vec<(String, ColorImage)>,
    plan: PlanFile,
}

impl PlanFile {
    /// Returns the plan of an unblurred picture.
    fn for_unblurred(size: (u32, u32)) -> Self {
        Self {
            size,
            executor: "not blurred".to_string(),
            compositing: "none",
            rank: 0,
            focus_m: None,
            coc_at_infinity_px: None,
            coc_px: None,
            coc_full_color_px: 0.0,
            filled: false,
            still_share: 0.0,
            bins: Vec::new(),
            files: Vec::new(),
        }
    }
}

impl DebugOutput {
    /// Collects everything about the frame that the executor has just blurred.
    fn collect(&mut self, bokeh: &CpuBokeh, color: &ColorImage, depth: Option<&DepthMap>, field: &CocField) {
        let (plan, width) = (bokeh.plan(), color.width as usize);
        let position = |k: usize| (k % width, k / width);
        let scene = bokeh.scene(color, depth, field, false);
        let coc_px: Vec<f32> = scene.iter().map(|pixel| pixel[3]).collect();
        let range = Range::from_values(coc_px.iter().copied());
        let full_px = range.map_or(0.0, |Range(low, high)| high.max(-low));
        let still = (0..scene.len()).map(|k| f32::from(u8::from(bokeh.is_still(position(k)))));
        let still_share = still.clone().sum::<f32>() / scene.len().max(1) as f32;
        let lens = match field {
            CocField::Depth(lens) => Some(lens),
            _ => None,
        };
        self.plan = PlanFile {
            executor: bokeh.describe(),
            compositing: match plan.compositing {
                Compositing::Layers => "layers",
                Compositing::Select => "select",
                Compositing::Gather => "gather",
            },
            rank: plan.bank.terms,
            focus_m: lens.map(|lens| lens.focus_m),
            coc_at_infinity_px: lens.map(|lens| lens.coc_at_infinity_px),
            coc_px: range,
            coc_full_color_px: full_px,
            filled: bokeh.has_inpainting(),
            still_share,
            ..PlanFile::for_unblurred(color.size())
        };
        self.add_picture("coc", draw_coc(width, coc_px.iter().copied(), full_px));
        if plan.compositing == Compositing::Layers {
            self.add_picture("still", draw_grey(width, still, 1.0));
        }
        if bokeh.has_inpainting() {
            let mut behind = bokeh.scene(color, depth, field, true);
            self.add_picture("behind_coc", draw_coc(width, behind.iter().map(|pixel| pixel[3]), full_px));
            // Channel 3 changes from CoC to full coverage, for `draw_light`.
            behind.iter_mut().for_each(|pixel| pixel[3] = 1.0);
            self.add_picture("behind", draw_light(width, &behind, plan.expansion, 1));
            self.add_picture(
                "hidden",
                draw_grey(width, coc_px.iter().map(|&coc_px| bokeh.inpainting_weight(coc_px)), 1.0),
            );
        }
        for (k, bin) in plan.bins.iter().enumerate() {
            self.collect_bin(bokeh, k, bin);
            self.plan.bins.push(build_bin_entry(bokeh, (k, bin), &coc_px, depth, field));
        }
    }

    /// Collects pictures of bin `k` before and after its filters, and of its filter radii.
    fn collect_bin(&mut self, bokeh: &CpuBokeh, k: usize, bin: &Bin) {
        let plan = bokeh.plan();
        let mut show = |name: &str, pixels: &[[f32; 4]]| {
            let coverage = pixels.iter().map(|pixel| pixel[3]);
            let picture = draw_light(bin.width, pixels, plan.expansion, bin.scale);
            self.add_picture(&format!("{name}_{k}"), picture);
            let name = if name == "bin" { "coverage" } else { "blur_coverage" };
            self.add_picture(&format!("{name}_{k}"), draw_grey(bin.width, coverage, 1.0));
        };
        show("bin", &bokeh.probe(Probe::Bin(k)));
        // The gather writes to the picture directly: it has no filtered bin.
        if plan.compositing != Compositing::Gather {
            show("blur", &bokeh.probe(Probe::Blur(k)));
            let radius = draw_grey(bin.width, bokeh.filter_radii_px(k).into_iter(), bin.max_radius_px);
            self.add_picture(&format!("radius_{k}"), radius);
        }
    }

    fn add_picture(&mut self, name: &str, picture: ColorImage) {
        self.pictures.push((format!("{name}.png"), picture));
    }

    /// Writes everything, or nothing if a file exists without `force`.
    fn write(&mut self, dir: &Path, force: bool) -> Result<(), CliError> {
        self.plan.files = self.pictures.iter().map(|(name, _)| name.clone()).collect();
        let paths: Vec<_> = self.plan.files.iter().map(|name| dir.join(name)).collect();
        let plan_path = dir.join(PLAN);
        let json = serde_json::to_vec_pretty(&self.plan).map_err(|error| CliError::io(&plan_path)(error.into()))?;
        refuse_overwrite(paths.iter().chain([&plan_path]).map(|path| path.as_path()), force)?;
        let name_fault = |error| match dir.exists() && !dir.is_dir() {
            true => io::Error::new(io::ErrorKind::NotADirectory, "not a folder; name one for --debug-dir"),
            false => error,
        };
        fs::create_dir_all(dir).map_err(name_fault).map_err(CliError::io(dir))?;
        for (path, (_, picture)) in paths.iter().zip(&self.pictures) {
            still::write_color(path, picture, force)?;
        }
        write_atomically(&plan_path, &json, force)
    }
}

/// Returns the statistics of bin `k` for `plan.json`.
fn build_bin_entry(
    bokeh: &CpuBokeh,
    (k, bin): (usize, &Bin),
    coc_px: &[f32],
    depth: Option<&DepthMap>,
    field: &CocField,
) -> BinEntry {
    let weight = bokeh.plan().bin_weight(k);
    // The gather's only bin has every pixel; elsewhere a pixel belongs to the bin with over half of its weight.
    let belongs = |coc_px: f32| bokeh.plan().compositing == Compositing::Gather || weight.at(coc_px) > 0.5;
    let content = || coc_px.iter().copied().filter(|&coc_px| belongs(coc_px));
    let depth_m = match (field, depth) {
        (CocField::Depth(lens), Some(map)) => {
            let known = map.metres.iter().copied().filter(|&metres| DepthMap::is_known(metres));
            Range::from_values(known.filter(|&metres| belongs(lens.coc_px(metres))))
        }
        _ => None,
    };
    let border = |at_px: f32| at_px.is_finite().then_some(at_px);
    BinEntry {
        index: k,
        low_px: border(bin.low_px),
        high_px: border(bin.high_px),
        scale: bin.scale,
        width: bin.width,
        height: bin.height,
        max_radius_px: bin.max_radius_px,
        near: bin.near,
        slot: bin.slot,
        present: bokeh.is_present(k),
        picture_share: content().count() as f32 / coc_px.len().max(1) as f32,
        content_coc_px: Range::from_values(content()),
        content_depth_m: depth_m,
    }
}
