//! Resolved, validated configuration: what the raw options mean. Nothing below the command line sees an option.

use super::error::CliError;
use super::options;
use super::quality::QualityChoice;
use super::values::{self, ApertureName, DepthChoice, Effect, Focus, Method, Rank};
use crate::bokeh::{self, Backend, Bokeh, cpu::CpuBokeh, plan::Plan};
use crate::compute::team::cores;
use crate::depth::DepthError;
use crate::depth::focus::FocusRule;
use crate::depth::stereo::{self, Matcher};
use crate::look::{Look, Refine, Strength};
use crate::optics::Lens;

/// Resolves options for a source that has depth or not.
///
/// # Errors
/// The options do not fit each other or the source, or the aperture's picture cannot be read.
pub fn look(
    blur: &options::Blur,
    aperture: &options::Aperture,
    quality: QualityChoice,
    has_depth: bool,
) -> Result<Look, CliError> {
    let usage = |text: &str| Err(CliError::Usage(text.to_string()));
    let uses_depth = has_depth && blur.depth != DepthChoice::None;
    let effect = match blur.effect {
        Some(Effect::None) => None,
        Some(Effect::Blur) => Some(bokeh::Effect::Blur),
        Some(Effect::TiltShift) => Some(bokeh::Effect::TiltShift),
        Some(Effect::Dof) if uses_depth => Some(bokeh::Effect::Dof),
        Some(Effect::Dof) if has_depth => {
            return usage("--effect dof needs depth: leave --depth none out, or use --effect blur or tilt-shift");
        }
        Some(Effect::Dof) => {
            return usage("--effect dof needs depth, and the source has none: use --effect blur or tilt-shift");
        }
        None if uses_depth => Some(bokeh::Effect::Dof),
        None => Some(bokeh::Effect::Blur),
    };
    if blur.depth == DepthChoice::Recorded && !has_depth {
        return usage("--depth recorded: the source has no depth");
    }
    let strength = match (blur.coc_at_infinity, blur.f_number, blur.focal_length, blur.sensor_width) {
        (Some(radius_px), ..) => Strength::AtInfinity(radius_px),
        (None, None, None, None) => Strength::Default,
        (None, Some(f_number), Some(focal_length_mm), Some(sensor_width_mm)) => {
            Strength::Lens(Lens { focal_length_mm, f_number, sensor_width_mm })
        }
        _ => return usage("a lens needs all of --f-number, --focal-length and --sensor-width"),
    };
    let focuses_by_depth = effect == Some(bokeh::Effect::Dof);
    if matches!(strength, Strength::Lens(_)) && !focuses_by_depth && !matches!(blur.focus, Focus::Metres(_)) {
        return usage("a lens without depth needs --focus METRES: its blur depends on the distance of focus");
    }
    Ok(Look {
        effect,
        focus: match blur.focus {
            Focus::Auto => FocusRule::Auto,
            Focus::Metres(metres) => FocusRule::Metres(metres),
            Focus::Point(x, y) => FocusRule::Point { x, y },
        },
        method: match blur.method {
            Method::Layered => bokeh::Method::Layered,
            Method::Gather => bokeh::Method::Gather,
        },
        strength,
        max_coc_px: blur.max_coc,
        refine: match blur.refine {
            values::Refine::Auto => Refine::Auto,
            values::Refine::On => Refine::On,
            values::Refine::Off => Refine::Off,
        },
        tilt: blur.tilt,
        aperture: aperture.aperture.load(aperture.intensity)?,
        aperture_file: match &aperture.aperture {
            ApertureName::Image(file) => Some(file.clone()),
            _ => None,
        },
        rim: aperture.rim,
        rank: aperture.rank.map(|rank| match rank {
            Rank::Terms(terms) => bokeh::Rank::Terms(terms),
            Rank::Full => bokeh::Rank::Full,
        }),
        highlights: aperture.highlights,
        quality: quality.level(),
    })
}

/// What runs the blur.
#[derive(Clone, Debug)]
pub struct Executor {
    backend: Backend,
    adapter: Option<String>,
    threads: Option<usize>,
}

impl Executor {
    /// Resolves options.
    pub fn of(computing: &options::Computing) -> Self {
        Self::new(computing.backend, computing.adapter.clone(), computing.threads)
    }

    /// An executor by its backend, part of its adapter's name, and its number of threads.
    pub fn new(backend: values::Backend, adapter: Option<String>, threads: Option<usize>) -> Self {
        let backend = match backend {
            values::Backend::Auto => Backend::Auto,
            values::Backend::Gpu => Backend::Gpu,
            values::Backend::Cpu => Backend::Cpu,
        };
        Self { backend, adapter, threads }
    }

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU.
    pub fn create(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, CliError> {
        Ok(bokeh::create(settings, size, self.backend, self.adapter.as_deref(), self.threads)?)
    }

    /// A matcher of pairs of `size` pixels that tries so many `disparities`.
    ///
    /// # Errors
    /// There is no such GPU.
    pub fn matcher(
        &self,
        disparities: u32,
        effort: stereo::Effort,
        size: (u32, u32),
    ) -> Result<Box<dyn Matcher>, CliError> {
        let threads = self.threads.unwrap_or_else(cores);
        let settings = stereo::Settings { size, disparities, effort, threads };
        Ok(stereo::create(&settings, self.backend, self.adapter.as_deref()).map_err(DepthError::from)?)
    }

    /// The CPU executor, which can be looked into.
    ///
    /// # Errors
    /// A GPU was asked for.
    pub fn create_open(&self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<CpuBokeh, CliError> {
        if self.backend == Backend::Gpu || self.adapter.is_some() {
            let text = "--debug-dir looks into the CPU executor: leave --backend gpu and --adapter out";
            return Err(CliError::Usage(text.to_string()));
        }
        Ok(CpuBokeh::new(Plan::new(settings, size.0, size.1), self.threads))
    }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command, FromArgMatches};

    use super::*;
    use crate::optics::CocField;
    use crate::pipeline::CocRule;

    const SIZE: (u32, u32) = (640, 450);

    fn resolve(flags: &[&str], has_depth: bool) -> Result<Look, CliError> {
        let command = options::Every::augment_args(Command::new("test").no_binary_name(true));
        let matches = command.try_get_matches_from(flags).unwrap();
        let every = options::Every::from_arg_matches(&matches).unwrap();
        look(&every.blur, &every.aperture, every.computing.quality, has_depth)
    }

    fn refusal(flags: &[&str], has_depth: bool) -> String {
        resolve(flags, has_depth).unwrap_err().to_string()
    }

    #[test]
    fn the_effect_follows_what_the_source_has() {
        assert_eq!(resolve(&[], true).unwrap().effect, Some(bokeh::Effect::Dof));
        assert_eq!(resolve(&[], false).unwrap().effect, Some(bokeh::Effect::Blur));
        assert_eq!(resolve(&["--depth=none"], true).unwrap().effect, Some(bokeh::Effect::Blur));
        assert!(resolve(&["--effect=none"], true).unwrap().settings(SIZE, false).is_none());
        assert!(refusal(&["--effect=dof"], false).contains("the source has none"));
        assert!(refusal(&["--effect=dof", "--depth=none"], true).contains("--depth none"));
    }

    #[test]
    fn the_strength_is_a_share_of_the_height_a_radius_or_a_lens() {
        let rule = |flags: &[&str]| resolve(flags, true).unwrap().coc_rule(SIZE);
        let depth = |flags: &[&str]| match rule(flags) {
            CocRule::Depth { lens, max_coc_px, .. } => match lens.field((2.0, 0.0), SIZE.0, max_coc_px) {
                CocField::Depth(depth) => (depth.coc_at_infinity_px, depth.max_coc_px),
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        };
        assert_eq!(depth(&[]), (10.0, 27.0));
        assert_eq!(depth(&["--coc-at-infinity=40"]), (40.0, 40.0));
        assert_eq!(depth(&["--coc-at-infinity=40", "--max-coc=30"]), (40.0, 30.0));
        let lens = ["--f-number=2", "--focal-length=50", "--sensor-width=36"];
        assert!((depth(&lens).0 - 5.698).abs() < 1e-2);
        assert!(refusal(&lens[..2], true).contains("--sensor-width"));
        assert!(refusal(&lens, false).contains("--focus METRES"));
        let even = CocRule::Fixed(CocField::Uniform { radius_px: 7.0 });
        assert_eq!(rule(&["--effect=blur", "--coc-at-infinity=7"]), even);
    }

    #[test]
    fn the_executor_is_made_for_every_radius_that_can_come() {
        let dof = resolve(&["--f-number=2", "--focal-length=50", "--sensor-width=36"], true).unwrap();
        let settings = dof.settings(SIZE, false).unwrap();
        assert_eq!((settings.far_max_px, settings.near_max_px), (27.0, 27.0));
        let blur = resolve(&["--coc-at-infinity=7"], false).unwrap().settings(SIZE, false).unwrap();
        assert_eq!((blur.far_max_px, blur.near_max_px), (7.0, 0.0));
    }

    #[test]
    fn tilt_shift_is_sharp_in_its_band_and_strongest_in_the_farthest_corner() {
        for angle in ["0", "30", "-90"] {
            let tilt = format!("--tilt=0.25:0.1:{angle}");
            let blur = resolve(&["--effect=tilt-shift", "--coc-at-infinity=8", &tilt], true).unwrap();
            let CocRule::Fixed(CocField::Ramp(ramp)) = blur.coc_rule(SIZE) else { panic!("no ramp") };
            assert_eq!(ramp.coc_px(320.0, 112.5), 0.0);
            let corners = [(0.0, 0.0), (640.0, 0.0), (0.0, 450.0), (640.0, 450.0)];
            let most = corners.map(|(x, y)| ramp.coc_px(x, y)).into_iter().fold(0.0, f32::max);
            assert!((most - 8.0).abs() < 1e-3, "{angle}: {most}");
        }
    }
}
