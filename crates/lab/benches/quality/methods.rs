//! The methods: this crate's and the rivals, all from the same 8-bit picture and depth map.

use std::fmt;

use bokehcam::bokeh::aperture::Aperture;
use bokehcam::bokeh::{self, Bokeh, BokehError, Job, Rank, Settings};
use bokehcam::budget::Quality;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::depth::background::BackgroundMemory;
use bokehcam::depth::fill::HoleFiller;
use bokehcam::depth::matting::{self, Matting};
use bokehcam::depth::misalignment::Misalignment;
use bokehcam::depth::refine::{MapCorrection, Refiner};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::optics::CocKind;
use bokehcam::optics::{CocField, DepthCoc};

use super::picture::{Plane, decode_srgb, encode_srgb};
use super::{damage, rivals};

/// The product's default softness of the aperture's rim.
const RIM: f32 = 0.2;
/// The product's default limit of the CoC, as a fraction of the height.
const MAX_COC_PER_HEIGHT: f32 = 0.06;

/// A blur method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// No blur.
    None,
    /// This crate's exact 2-D gather: the reference that the paper's form approximates.
    Gather,
    /// This crate's separable gather of rank 3: the paper's plain form.
    Gather3,
    /// See [`rivals::golden_angle_blur`].
    GoldenAngle,
    /// See [`rivals::near_focus_far_blur`].
    NearFocusFar,
    /// See [`rivals::scatter_blur`].
    Scatter,
    /// See [`rivals::gaussian_blur`].
    Gaussian,
    /// See [`rivals::blended_blur`].
    Blended,
    /// This crate's layers, by default on the unrefined depth map with filled holes.
    Layered(Quality),
    /// This crate's layers at the default quality on refined depth, as for recordings.
    Refined,
    /// This crate's layers on unrefined depth, with background memory, as for streams.
    Remembered,
}

impl Method {
    /// Returns all methods, in the order of the tables.
    pub fn all() -> Vec<Method> {
        use Method::{Blended, Gather, Gather3, Gaussian, GoldenAngle, NearFocusFar, None, Scatter};
        let others = [None, Gaussian, Blended, Gather3, Gather, NearFocusFar, GoldenAngle, Scatter];
        others
            .into_iter()
            .chain(Quality::ALL.map(Method::Layered))
            .chain([Method::Refined, Method::Remembered])
            .collect()
    }

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::None => "none",
            Method::Gather => "gather",
            Method::Gather3 => "gather-3",
            Method::GoldenAngle => "golden-angle",
            Method::NearFocusFar => "near-focus-far",
            Method::Scatter => "scatter",
            Method::Gaussian => "gaussian",
            Method::Blended => "blended",
            Method::Layered(quality) => quality.name(),
            Method::Refined => "refined",
            Method::Remembered => "remembered",
        }
    }

    /// Returns whether it competes with the layers.
    pub fn is_rival(self) -> bool {
        !matches!(self, Method::None | Method::Layered(_) | Method::Refined | Method::Remembered)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The input of every method.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The sharp picture.
    pub image: ColorImage,
    /// Depth in metres, 0 where unknown.
    pub depth: DepthMap,
    /// Converts depth to CoC.
    pub lens: DepthCoc,
    /// The opening of the lens.
    pub aperture: Aperture,
}

impl Shot {
    /// Returns the lens for a scene, as the product's command line sets it up from `--coc-at-infinity` and `--focus`.
    pub fn lens(coc_at_infinity_px: f32, focus_m: f32, height: usize) -> DepthCoc {
        let max_coc_px = coc_at_infinity_px.max(height as f32 * MAX_COC_PER_HEIGHT);
        DepthCoc { coc_at_infinity_px, focus_m, range_m: 0.0, max_coc_px }
    }

    /// Returns the CoC for the rivals: unknown depth is that of the nearest known pixel.
    pub fn coc(&self) -> Plane<f32> {
        let (width, height) = (self.depth.width as usize, self.depth.height as usize);
        let metres = Plane { width, height, data: self.depth.metres.clone() };
        damage::fill_from_nearest(&metres).map(|z_m| self.lens.coc_px(z_m))
    }
}

/// Blurs the frames of one scene, one after the other.
pub struct Blurrer {
    method: Method,
    bokeh: Option<Box<dyn Bokeh>>,
    filler: HoleFiller,
    refiner: Refiner,
    correction: MapCorrection,
    matting: Matting,
    background: BackgroundMemory,
    time_ns: u64,
}

/// Frame period.
const PERIOD_NS: u64 = 33_333_333;

impl Blurrer {
    /// Creates the blur for shots like this one.
    ///
    /// # Errors
    /// Fails if this crate's executor cannot be created.
    pub fn new(method: Method, shot: &Shot) -> Result<Self, BokehError> {
        let (layers, rank, rim, quality) = match method {
            Method::Gather => (bokeh::Method::Gather, Some(Rank::Full), 0.0, Quality::Best),
            Method::Gather3 => (bokeh::Method::Gather, Some(Rank::Terms(3)), 0.0, Quality::Best),
            Method::Layered(quality) => (bokeh::Method::Layered, None, RIM, quality),
            Method::Refined | Method::Remembered => (bokeh::Method::Layered, None, RIM, Quality::default()),
            _ => return Ok(Self::with_executor(method, None)),
        };
        let settings = Settings {
            coc: CocKind::Depth,
            method: layers,
            aperture: shot.aperture.clone(),
            rim,
            rank,
            highlights: 0.0,
            quality,
            adaptive: false,
            reuse: false,
            privacy: false,
            far_max_px: shot.lens.coc_at_infinity_px,
            near_max_px: shot.lens.max_coc_px,
        };
        let bokeh = bokeh::create_blur(&settings, shot.image.size(), None, None)?;
        Ok(Self::with_executor(method, Some(bokeh)))
    }

    fn with_executor(method: Method, bokeh: Option<Box<dyn Bokeh>>) -> Self {
        let (filler, refiner) = (HoleFiller::new(), Refiner::new());
        let (matting, background) = (Matting::default(), BackgroundMemory::default());
        let correction = MapCorrection::default();
        Self { method, bokeh, filler, refiner, correction, matting, background, time_ns: 0 }
    }

    /// Returns the blurred picture.
    ///
    /// # Errors
    /// Fails if this crate's executor fails.
    pub fn blur(&mut self, shot: &Shot) -> Result<ColorImage, BokehError> {
        let rival = |blur: &dyn Fn() -> Plane<_>| Ok(encode_srgb(&blur()));
        let light = || decode_srgb(&shot.image);
        match self.method {
            Method::None => Ok(shot.image.clone()),
            Method::GoldenAngle => rival(&|| rivals::golden_angle_blur(&light(), &shot.coc())),
            Method::NearFocusFar => rival(&|| rivals::near_focus_far_blur(&light(), &shot.coc())),
            Method::Blended => rival(&|| rivals::blended_blur(&light(), &shot.coc())),
            Method::Gaussian => rival(&|| rivals::gaussian_blur(&light(), &shot.coc())),
            Method::Scatter => rival(&|| rivals::scatter_blur(&light(), &shot.coc(), &shot.aperture.shape)),
            // The gathers get the rivals' input, the layers the product's processed depth map.
            Method::Gather | Method::Gather3 => {
                let (width, height) = (shot.depth.width as usize, shot.depth.height as usize);
                let metres = damage::fill_from_nearest(&Plane { width, height, data: shot.depth.metres.clone() }).data;
                self.run(shot, DepthMap { metres, ..shot.depth.clone() })
            }
            Method::Layered(_) => {
                let mut depth = shot.depth.clone();
                self.filler.fill_guided(&mut depth, &shot.image);
                self.blur_layered(shot, depth)
            }
            Method::Remembered => {
                let depth = self.recall_background(shot);
                self.run(shot, depth)
            }
            Method::Refined => {
                let mut depth = shot.depth.clone();
                let correction = Misalignment::measure(&depth, &shot.image)
                    .and_then(|misalignment| misalignment.correction(&depth, &shot.image));
                let correction = correction.unwrap_or_default();
                if self.correction != correction {
                    (self.correction, self.refiner) = (correction, Refiner::with_correction(correction));
                }
                self.refiner.refine(&mut depth, &shot.image, self.time_ns);
                self.time_ns += PERIOD_NS;
                self.blur_layered(shot, depth)
            }
        }
    }

    /// Blurs by the layers, with the matte that every source gets.
    fn blur_layered(&mut self, shot: &Shot, mut depth: DepthMap) -> Result<ColorImage, BokehError> {
        self.matting.find_mixed_pixels(&mut depth, &shot.image, shot.lens.inverse_depth_step(matting::MIN_STEP_PX));
        self.run(shot, depth)
    }

    /// Updates the memory with a frame that is not blurred.
    pub fn update_memory(&mut self, shot: &Shot) {
        if self.method == Method::Remembered {
            self.recall_background(shot);
        }
    }

    /// Returns the depth of a frame with its matte and the background seen so far.
    fn recall_background(&mut self, shot: &Shot) -> DepthMap {
        let mut depth = shot.depth.clone();
        self.filler.fill_guided(&mut depth, &shot.image);
        let mut workers = ThreadPool::new("matte", 1);
        self.background.find_matte(&mut self.matting, &mut workers, (&mut depth, &shot.image), &shot.lens);
        self.background.update(&mut workers, (&depth, &shot.image), &shot.lens, self.time_ns);
        self.background.reveal_background(&mut workers, &mut depth, &shot.image, &shot.lens);
        self.time_ns += PERIOD_NS;
        depth
    }

    /// Returns the blurred picture, with the shot's own depth and matte.
    ///
    /// # Errors
    /// Fails like [`Self::blur`].
    pub fn blur_as_is(&mut self, shot: &Shot) -> Result<ColorImage, BokehError> {
        self.run(shot, shot.depth.clone())
    }

    fn run(&mut self, shot: &Shot, depth: DepthMap) -> Result<ColorImage, BokehError> {
        let Some(bokeh) = &mut self.bokeh else { return Ok(shot.image.clone()) };
        let (color, depth) = (Pooled::detached(shot.image.clone()), Pooled::detached(depth));
        bokeh.submit(Job::new(color, Some(depth), CocField::Depth(shot.lens)))?;
        let finished = bokeh.collect(true)?;
        Ok(finished.and_then(|mut finished| finished.picture.memory_mut().map(std::mem::take)).unwrap_or_default())
    }
}
