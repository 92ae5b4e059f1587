//! Quantity (depth or disparity) and unit of a map file. Our files state them where other programs ignore it: a PNG in
//! a text chunk (keyword [`KEYWORD`]), a PFM by the spelling of its scale, whose absolute value is always 1.

use bokehcam::optics::StereoRig;

/// Units of a 16-bit disparity picture per pixel, as in the KITTI benchmark.
pub const DISPARITY_SCALE: f32 = 256.0;

/// The keyword of the text chunk in a PNG.
pub(super) const KEYWORD: &str = "bokehcam map";

/// Quantity and unit of the values in a map file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MapUnit {
    Depth {
        /// Units of a PNG per metre, > 0.
        per_m: f32,
    },
    /// Disparity in pixels of the map.
    Disparity {
        /// The stereo rig that measured it, if known.
        rig: Option<StereoRig>,
    },
}

impl MapUnit {
    /// Returns the text for a PNG. A rig that is only assumed is omitted, as its distances are not real.
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

    /// Returns the stereo rig, if it is stated.
    pub(super) fn rig(&self) -> Option<StereoRig> {
        if let Self::Disparity { rig } = self { *rig } else { None }
    }

    /// Parses the text of a PNG; `None` if it is not ours, or has invalid values.
    pub(super) fn from_text(text: &str) -> Option<Self> {
        let mut words = text.split_ascii_whitespace();
        let kind = words.next()?;
        let value = |name: &str| {
            let mut rest = words.clone();
            let number: f32 = rest.find_map(|word| word.strip_prefix(name)?.strip_prefix('=')?.parse().ok())?;
            number.is_finite().then_some(number)
        };
        let above_zero = |name: &str| value(name).filter(|&number| number > 0.0);
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

    /// Returns the scale of a PFM. Its value is -1: negative for little-endian, and 1 because some readers multiply by
    /// it. Only the spelling distinguishes the quantities.
    pub(super) fn pfm_scale(&self) -> &'static str {
        match self {
            Self::Depth { .. } => "-1000e-3",
            Self::Disparity { .. } => "-100e-2",
        }
    }

    /// Returns the meaning of a PFM by the spelling of its scale; it cannot hold a rig.
    pub(super) fn from_pfm_scale(scale: &str) -> Option<Self> {
        let map_units = [Self::Depth { per_m: 1.0 }, Self::Disparity { rig: None }];
        map_units.into_iter().find(|map_unit| map_unit.pfm_scale() == scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let rig = StereoRig { focal_px: 707.25, baseline_m: 0.1, doffs_px: -31.086, metric: true };
        for map_unit in
            [MapUnit::Depth { per_m: 5000.0 }, MapUnit::Disparity { rig: None }, MapUnit::Disparity { rig: Some(rig) }]
        {
            assert_eq!(MapUnit::from_text(&map_unit.text()), Some(map_unit));
            assert_eq!(map_unit.pfm_scale().parse(), Ok(-1.0));
        }
        let assumed = MapUnit::Disparity { rig: Some(StereoRig { metric: false, ..rig }) };
        assert_eq!(
            MapUnit::from_text(&assumed.text()),
            Some(MapUnit::Disparity { rig: None }),
            "no distances of cameras that are assumed"
        );
        for other in [
            "",
            "depth",
            "depth units_per_metre=0",
            "depth units_per_metre=inf",
            "disparity",
            "height units_per_metre=1",
        ] {
            assert_eq!(MapUnit::from_text(other), None, "{other}");
        }
        assert_eq!(MapUnit::from_pfm_scale("-1"), None);
        assert_eq!(MapUnit::from_pfm_scale("-100e-2"), Some(MapUnit::Disparity { rig: None }));
    }
}
