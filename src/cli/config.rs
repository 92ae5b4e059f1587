//! Resolved, validated configuration: what the raw options mean. Nothing below the command line sees an option.

use std::path::{Path, PathBuf};

use super::defaults;
use super::error::CliError;
use super::options;
use super::values::{DepthChoice, Effect, Focus, Method, Rank, Tilt};
use crate::bokeh;
use crate::bokeh::aperture::Aperture;
use crate::budget::Quality;
use crate::optics::{CocField, DepthCoc, Lens, Ramp};

/// How strong the blur is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strength {
    /// A fraction of the picture's height.
    Default,
    /// CoC radius at infinity, in pixels.
    AtInfinity(f32),
    /// What this lens does at the distance of focus.
    Lens(Lens),
}

/// Everything about the blur, for pictures of any size.
#[derive(Clone, Debug)]
pub struct Blur {
    /// What the blur follows; none passes frames through.
    pub effect: Option<bokeh::Effect>,
    /// Where the focal plane is.
    pub focus: Focus,
    method: bokeh::Method,
    strength: Strength,
    max_coc_px: Option<f32>,
    tilt: Tilt,
    aperture: Aperture,
    rim: f32,
    rank: Option<bokeh::Rank>,
    highlights: f32,
    quality: Quality,
}

impl Blur {
    /// Resolves options for a source that has depth or not.
    ///
    /// # Errors
    /// The options do not fit each other or the source, or the aperture's picture cannot be read.
    pub fn resolve(
        blur: &options::Blur,
        aperture: &options::Aperture,
        quality: Quality,
        has_depth: bool,
    ) -> Result<Self, CliError> {
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
        Ok(Self {
            effect,
            focus: blur.focus,
            method: match blur.method {
                Method::Layered => bokeh::Method::Layered,
                Method::Gather => bokeh::Method::Gather,
            },
            strength,
            max_coc_px: blur.max_coc,
            tilt: blur.tilt,
            aperture: aperture.aperture.load(aperture.intensity)?,
            rim: aperture.rim,
            rank: aperture.rank.map(|rank| match rank {
                Rank::Terms(terms) => bokeh::Rank::Terms(terms),
                Rank::Full => bokeh::Rank::Full,
            }),
            highlights: aperture.highlights,
            quality,
        })
    }

    /// The executor's settings for pictures of `size` pixels; none when frames pass through.
    pub fn settings(&self, size: (u32, u32)) -> Option<bokeh::Settings> {
        let effect = self.effect?;
        let max_px = self.max_coc_px(size);
        let far_max_px = match (effect, self.strength) {
            // The distance of focus, and with it the radius at infinity, may change from frame to frame.
            (bokeh::Effect::Dof, Strength::Lens(_)) => max_px,
            _ => self.coc_at_infinity_px(size, self.focus_m()).min(max_px),
        };
        let near_max_px = if effect == bokeh::Effect::Dof { max_px } else { 0.0 };
        Some(bokeh::Settings {
            effect,
            method: self.method,
            aperture: self.aperture.clone(),
            rim: self.rim,
            rank: self.rank,
            highlights: self.highlights,
            quality: self.quality,
            far_max_px,
            near_max_px,
        })
    }

    /// The radius of every pixel of a picture of `size` pixels that is in focus at `focus_m` metres; `blur` and
    /// `tilt-shift` need the distance only with a lens.
    pub fn coc_field(&self, size: (u32, u32), focus_m: f32) -> CocField {
        let (at_infinity_px, max_px) = (self.coc_at_infinity_px(size, focus_m), self.max_coc_px(size));
        match self.effect {
            None => CocField::Uniform { radius_px: 0.0 },
            Some(bokeh::Effect::Blur) => CocField::Uniform { radius_px: at_infinity_px.min(max_px) },
            Some(bokeh::Effect::TiltShift) => CocField::Ramp(self.tilt.ramp(size, at_infinity_px.min(max_px))),
            Some(bokeh::Effect::Dof) => {
                CocField::Depth(DepthCoc { coc_at_infinity_px: at_infinity_px, focus_m, max_coc_px: max_px })
            }
        }
    }

    /// The distance of focus, where it is given as such.
    fn focus_m(&self) -> f32 {
        if let Focus::Metres(metres) = self.focus { metres } else { 1.0 }
    }

    /// CoC radius at infinity, in pixels.
    pub fn coc_at_infinity_px(&self, (width, height): (u32, u32), focus_m: f32) -> f32 {
        match self.strength {
            Strength::Default => height as f32 * defaults::COC_AT_INFINITY_PER_HEIGHT,
            Strength::AtInfinity(radius_px) => radius_px,
            Strength::Lens(lens) => lens.coc_at_infinity_px(focus_m, width),
        }
    }

    /// Largest CoC radius, in pixels. Without depth no point is nearer than the focal plane, and the strength that
    /// was asked for holds unless `--max-coc` is given, too.
    pub fn max_coc_px(&self, size: (u32, u32)) -> f32 {
        let by_height_px = size.1 as f32 * defaults::MAX_COC_PER_HEIGHT;
        self.max_coc_px.unwrap_or(match self.strength {
            Strength::AtInfinity(radius_px) => by_height_px.max(radius_px),
            Strength::Default | Strength::Lens(_) => by_height_px,
        })
    }
}

impl Tilt {
    /// The ramp for a picture of `size` pixels that reaches `max_px` in the corner farthest from the band.
    fn ramp(&self, (width, height): (u32, u32), max_px: f32) -> Ramp {
        let (width, height) = (width as f32, height as f32);
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        let normal = glam::Vec2::new(-sin, cos);
        let offset_px = normal.dot(glam::Vec2::new(width / 2.0, height * self.center_y));
        let half_band_px = height * self.band / 2.0;
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        let reach_px = corners
            .map(|corner| (normal.dot(corner.into()) - offset_px).abs() - half_band_px)
            .into_iter()
            .fold(0.0, f32::max);
        Ramp { normal, offset_px, half_band_px, slope: if reach_px > 0.0 { max_px / reach_px } else { 0.0 }, max_px }
    }
}

/// Where frames go, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum SinkName {
    /// A folder of numbered PNG files.
    Folder(PathBuf),
    /// A y4m file.
    Y4m(PathBuf),
    /// y4m on standard output.
    Stdout,
    /// A file that ffmpeg encodes.
    Encoded(PathBuf),
    /// Nowhere.
    Null,
}

impl std::str::FromStr for SinkName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let path = Path::new(text);
        match text {
            "null" => return Ok(SinkName::Null),
            "-" => return Ok(SinkName::Stdout),
            folder if folder.ends_with('/') || path.is_dir() => return Ok(SinkName::Folder(path.to_owned())),
            _ => {}
        }
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("y4m") => Ok(SinkName::Y4m(path.to_owned())),
            Some("mp4" | "mkv" | "webm") => Ok(SinkName::Encoded(path.to_owned())),
            _ => Err("use DIR/ (with the slash), FILE.y4m, - for y4m on standard output, FILE.mp4, .mkv or .webm, \
                      or null"
                .to_string()),
        }
    }
}

/// Where frames come from, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceName {
    /// The moving scene with known depth.
    Synthetic,
    /// A folder with a recording.
    Folder(PathBuf),
}

impl std::str::FromStr for SourceName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match Path::new(text) {
            _ if text == "synthetic" => Ok(SourceName::Synthetic),
            folder if folder.is_dir() => Ok(SourceName::Folder(folder.to_owned())),
            other if other.exists() => Err("it is no folder: use a folder with a recording, or synthetic".to_string()),
            _ => Err("there is no such folder: use a folder with a recording, or synthetic".to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command, FromArgMatches};

    use super::*;

    const SIZE: (u32, u32) = (640, 450);

    fn resolve(flags: &[&str], has_depth: bool) -> Result<Blur, CliError> {
        let command = options::Every::augment_args(Command::new("test").no_binary_name(true));
        let matches = command.try_get_matches_from(flags).unwrap();
        let every = options::Every::from_arg_matches(&matches).unwrap();
        Blur::resolve(&every.blur, &every.aperture, every.computing.quality, has_depth)
    }

    fn refusal(flags: &[&str], has_depth: bool) -> String {
        resolve(flags, has_depth).unwrap_err().to_string()
    }

    #[test]
    fn the_effect_follows_what_the_source_has() {
        assert_eq!(resolve(&[], true).unwrap().effect, Some(bokeh::Effect::Dof));
        assert_eq!(resolve(&[], false).unwrap().effect, Some(bokeh::Effect::Blur));
        assert_eq!(resolve(&["--depth=none"], true).unwrap().effect, Some(bokeh::Effect::Blur));
        assert!(resolve(&["--effect=none"], true).unwrap().settings(SIZE).is_none());
        assert!(refusal(&["--effect=dof"], false).contains("the source has none"));
        assert!(refusal(&["--effect=dof", "--depth=none"], true).contains("--depth none"));
    }

    #[test]
    fn the_strength_is_a_share_of_the_height_a_radius_or_a_lens() {
        let field = |flags: &[&str]| resolve(flags, true).unwrap().coc_field(SIZE, 2.0);
        let depth = |flags: &[&str]| match field(flags) {
            CocField::Depth(depth) => (depth.coc_at_infinity_px, depth.max_coc_px),
            other => panic!("{other:?}"),
        };
        assert_eq!(depth(&[]), (10.0, 27.0));
        assert_eq!(depth(&["--coc-at-infinity=40"]), (40.0, 40.0));
        assert_eq!(depth(&["--coc-at-infinity=40", "--max-coc=30"]), (40.0, 30.0));
        let lens = ["--f-number=2", "--focal-length=50", "--sensor-width=36"];
        assert!((depth(&lens).0 - 5.698).abs() < 1e-2);
        assert!(refusal(&lens[..2], true).contains("--sensor-width"));
        assert!(refusal(&lens, false).contains("--focus METRES"));
        assert_eq!(field(&["--effect=blur", "--coc-at-infinity=7"]), CocField::Uniform { radius_px: 7.0 });
    }

    #[test]
    fn the_executor_is_made_for_every_radius_that_can_come() {
        let dof = resolve(&["--f-number=2", "--focal-length=50", "--sensor-width=36"], true).unwrap();
        let settings = dof.settings(SIZE).unwrap();
        assert_eq!((settings.far_max_px, settings.near_max_px), (27.0, 27.0));
        let blur = resolve(&["--coc-at-infinity=7"], false).unwrap().settings(SIZE).unwrap();
        assert_eq!((blur.far_max_px, blur.near_max_px), (7.0, 0.0));
    }

    #[test]
    fn tilt_shift_is_sharp_in_its_band_and_strongest_in_the_farthest_corner() {
        for angle in ["0", "30", "-90"] {
            let tilt = format!("--tilt=0.25:0.1:{angle}");
            let blur = resolve(&["--effect=tilt-shift", "--coc-at-infinity=8", &tilt], true).unwrap();
            let CocField::Ramp(ramp) = blur.coc_field(SIZE, 1.0) else { panic!("no ramp") };
            assert_eq!(ramp.coc_px(320.0, 112.5), 0.0);
            let corners = [(0.0, 0.0), (640.0, 0.0), (0.0, 450.0), (640.0, 450.0)];
            let most = corners.map(|(x, y)| ramp.coc_px(x, y)).into_iter().fold(0.0, f32::max);
            assert!((most - 8.0).abs() < 1e-3, "{angle}: {most}");
        }
    }

    #[test]
    fn sinks_are_told_by_their_names() {
        let sink = |text: &str| text.parse::<SinkName>();
        assert_eq!(sink("out/"), Ok(SinkName::Folder("out/".into())));
        assert_eq!(sink("-"), Ok(SinkName::Stdout));
        assert_eq!(sink("a.y4m"), Ok(SinkName::Y4m("a.y4m".into())));
        assert_eq!(sink("a.webm"), Ok(SinkName::Encoded("a.webm".into())));
        assert!(sink("out").unwrap_err().contains("DIR/"));
    }
}
