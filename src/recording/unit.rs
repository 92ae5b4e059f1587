//! What the numbers of a map file mean, as far as the file says. Ours do, in ways that leave others able to read them: a PNG
//! by a text (keyword [`KEYWORD`]), a PFM by how the number 1 of its scale is written.

use crate::optics::StereoRig;

/// Units of a 16-bit disparity picture per pixel, as in the KITTI benchmark.
pub const DISPARITY_SCALE: f32 = 256.0;

/// The keyword of the text in a PNG.
pub(super) const KEYWORD: &str = "bokehcam map";

/// What is in a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    Depth {
        /// Units of a PNG per metre, > 0.
        per_m: f32,
    },
    /// Disparity in pixels of the map.
    Disparity {
        /// The eyes that see it, where they are known.
        rig: Option<StereoRig>,
    },
}

impl Meaning {
    /// The text of a PNG.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Depth { per_m } => format!("depth units_per_metre={per_m}"),
            Self::Disparity { rig: Some(StereoRig { focal_px, baseline_m, doffs_px, metric: true }) } => format!(
                "disparity units_per_pixel={DISPARITY_SCALE} focal_px={focal_px} baseline_m={baseline_m} \
                 doffs_px={doffs_px}"
            ),
            Self::Disparity { .. } => format!("disparity units_per_pixel={DISPARITY_SCALE}"),
        }
    }

    /// The text read; nothing where it says nothing that can be.
    pub(super) fn of_text(text: &str) -> Option<Self> {
        let mut words = text.split_ascii_whitespace();
        let kind = words.next()?;
        let value = |name: &str| {
            let mut words = words.clone();
            let value: f32 = words.find_map(|word| word.strip_prefix(name)?.strip_prefix('=')?.parse().ok())?;
            value.is_finite().then_some(value)
        };
        let above_zero = |name: &str| value(name).filter(|&value| value > 0.0);
        match kind {
            "depth" => Some(Self::Depth { per_m: above_zero("units_per_metre")? }),
            "disparity" if value("units_per_pixel") == Some(DISPARITY_SCALE) => {
                let geometry = above_zero("focal_px").zip(above_zero("baseline_m")).zip(value("doffs_px"));
                let rig = geometry.map(|((focal_px, baseline_m), doffs_px)| StereoRig {
                    focal_px,
                    baseline_m,
                    doffs_px,
                    metric: true,
                });
                Some(Self::Disparity { rig })
            }
            _ => None,
        }
    }

    /// The scale of a PFM: low byte first, and 1, since some readers multiply by it.
    pub(super) fn pfm_scale(&self) -> &'static str {
        match self {
            Self::Depth { .. } => "-1000e-3",
            Self::Disparity { .. } => "-100e-2",
        }
    }

    /// What the scale of a PFM says, if it is one of ours. It has no room for the eyes.
    pub(super) fn of_pfm_scale(scale: &str) -> Option<Self> {
        [Self::Depth { per_m: 1.0 }, Self::Disparity { rig: None }].into_iter().find(|own| own.pfm_scale() == scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let rig = StereoRig { focal_px: 707.25, baseline_m: 0.1, doffs_px: -31.086, metric: true };
        for meaning in
            [Meaning::Depth { per_m: 5000.0 }, Meaning::Disparity { rig: None }, Meaning::Disparity { rig: Some(rig) }]
        {
            assert_eq!(Meaning::of_text(&meaning.text()), Some(meaning));
            assert_eq!(meaning.pfm_scale().parse(), Ok(-1.0));
        }
        let assumed = Meaning::Disparity { rig: Some(StereoRig { metric: false, ..rig }) };
        assert_eq!(
            Meaning::of_text(&assumed.text()),
            Some(Meaning::Disparity { rig: None }),
            "no distances of eyes that are assumed"
        );
        for other in [
            "",
            "depth",
            "depth units_per_metre=0",
            "depth units_per_metre=inf",
            "disparity",
            "height units_per_metre=1",
        ] {
            assert_eq!(Meaning::of_text(other), None, "{other}");
        }
        assert_eq!(Meaning::of_pfm_scale("-1"), None);
        assert_eq!(Meaning::of_pfm_scale("-100e-2"), Some(Meaning::Disparity { rig: None }));
    }
}
