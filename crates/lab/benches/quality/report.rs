//! The results: table lines, JSON, and derived values.

use bokehcam::frame::ColorImage;
use serde::Serialize;

use super::highlight::Profile;
use super::masks::Portrait;
use super::methods::Method;
use super::picture::Plane;
use super::{flip, metrics};

/// The name of a scene, and the damage of its depth map, if any.
pub type Case<'a> = (&'a str, Option<&'a str>);

/// The scores of a method on a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    /// Name of the scene.
    pub scene: &'static str,
    /// The damage of its depth map, if any.
    pub damage: Option<&'static str>,
    /// The method.
    #[serde(serialize_with = "serialize_method")]
    pub method: Method,
    /// PSNR in dB, sRGB.
    pub psnr_db: f64,
    /// PSNR within 12 px of depth edges; `None` without edges.
    pub edge_db: Option<f64>,
    /// Structural similarity.
    pub ssim: f64,
    /// LDR-FLIP, lower is better.
    pub flip: f64,
}

fn serialize_method<S: serde::Serializer>(method: &Method, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(method.name())
}

/// The profile of a method's picture of a single light.
#[derive(Clone, Debug, Serialize)]
pub struct Highlight {
    /// The method; `None` for the truth.
    pub method: Option<&'static str>,
    /// The profile of its disc.
    #[serde(flatten)]
    pub profile: Profile,
}

/// The flicker of a method on a static scene with noisy depth.
#[derive(Clone, Debug, Serialize)]
pub struct Flicker {
    /// The method.
    pub method: &'static str,
    /// Mean difference of consecutive frames in code values, where the picture is blurred.
    pub flicker_codes: f64,
    /// Flicker within 12 px of depth edges, with camera noise on the picture, too.
    pub outline_codes: f64,
}

/// All results.
#[derive(Default)]
pub struct Results {
    /// Methods on static scenes.
    pub records: Vec<Record>,
    /// Methods on moving scenes.
    pub moving: Vec<Record>,
    /// The single light.
    pub highlights: Vec<Highlight>,
    /// The static scene.
    pub flicker: Vec<Flicker>,
    /// Portraits from a coarse mask.
    pub portraits: Vec<Portrait>,
    /// Scenes that are hard for one camera.
    pub situations: Vec<super::situations::Outcome>,
}

impl Record {
    /// The head of the table.
    pub const TABLE_HEADER: &'static str = "scene     depth   method            PSNR dB  edge dB    SSIM    FLIP";

    /// Returns a line of the table.
    pub fn to_row(&self) -> String {
        let edge = self.edge_db.map_or("-".to_owned(), |edge_db| format!("{edge_db:.2}"));
        format!(
            "{:9} {:7} {:16} {:8.2} {edge:>8} {:7.4} {:7.4}",
            self.scene,
            self.damage.unwrap_or("exact"),
            self.method.name(),
            self.psnr_db,
            self.ssim,
            self.flip
        )
    }

    /// Measures a method's picture of a scene with its damage; `band` has the edges of the truth.
    pub fn score(
        (scene, damage): Case<'static>,
        method: Method,
        picture: &ColorImage,
        truth: &ColorImage,
        band: &Plane<bool>,
    ) -> Record {
        Record {
            scene,
            damage,
            method,
            psnr_db: metrics::psnr(picture, truth, None),
            edge_db: Some(metrics::psnr(picture, truth, Some(band))).filter(|db| !db.is_nan()),
            ssim: metrics::ssim(picture, truth),
            flip: flip::mean_flip(picture, truth),
        }
    }

    /// Returns the mean of records of one method, under the first one's names.
    pub fn mean(records: &[&Record]) -> Option<Record> {
        let first = *records.first()?;
        let mean = |of: &dyn Fn(&Record) -> Option<f64>| {
            let values: Vec<f64> = records.iter().filter_map(|record| of(record)).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Some(Record {
            psnr_db: mean(&|r| Some(r.psnr_db))?,
            edge_db: mean(&|r| r.edge_db),
            ssim: mean(&|r| Some(r.ssim))?,
            flip: mean(&|r| Some(r.flip))?,
            ..first.clone()
        })
    }
}

impl Highlight {
    /// Returns a line of the table.
    pub fn to_row(&self) -> String {
        let Profile { ripple_percent, rim_px, lowest_percent } = self.profile;
        let method = self.method.unwrap_or("truth");
        format!(
            "highlight {method:16} ripple {ripple_percent:5.1} %   rim {rim_px:5.2} px   lowest {lowest_percent:5.1} %"
        )
    }
}

impl Flicker {
    /// Returns a line of the table.
    pub fn to_row(&self) -> String {
        let Self { method, flicker_codes, outline_codes } = self;
        format!("flicker   {method:16} {flicker_codes:6.3} codes, outlines of a noisy picture {outline_codes:6.3}")
    }
}

impl Results {
    /// Returns the scenes, each with its damage, in the order measured.
    pub fn cases(&self, damaged: bool) -> Vec<Case<'static>> {
        let mut cases = Vec::new();
        for record in self.records.iter().filter(|record| record.damage.is_some() == damaged) {
            if !cases.contains(&(record.scene, record.damage)) {
                cases.push((record.scene, record.damage));
            }
        }
        cases
    }

    /// Returns the record of a method on a case.
    pub fn find(&self, case: Case, method: Method) -> Option<&Record> {
        self.records_of(case).find(|record| record.method == method)
    }

    /// Returns the records of every method on a case.
    pub fn records_of(&self, case: Case) -> impl Iterator<Item = &Record> {
        self.records.iter().filter(move |record| (record.scene, record.damage) == case)
    }

    /// Returns the rival with the highest PSNR on a case.
    pub fn best_rival(&self, case: Case) -> Option<&Record> {
        let rivals = self.records_of(case).filter(|record| record.method.is_rival());
        rivals.max_by(|a, b| a.psnr_db.total_cmp(&b.psnr_db))
    }
}
