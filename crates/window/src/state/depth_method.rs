//! Depth methods, as the user selects them.

use std::fmt;
use std::str::FromStr;

use bokehcam_live::source::{DepthChoice, DepthOrigin, NetworkFile, PlateFile, SingleCameraDepth};

/// A depth method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DepthMethod {
    /// Measured by a depth camera, or recorded.
    Measured,
    /// Stereo matching of two cameras.
    Stereo,
    /// Person segmentation by a network.
    Person,
    /// Person segmentation and monocular depth by networks.
    PersonAndMonoDepth,
    /// A background plate captured at the start.
    Plate,
}

impl DepthMethod {
    /// Returns the corresponding choice of `--depth`, with the installed networks.
    pub fn to_depth_choice(self) -> DepthChoice {
        let installed = Some(NetworkFile::Installed);
        match self {
            Self::Measured => DepthChoice::Recorded,
            Self::Stereo => DepthChoice::Stereo,
            Self::Person => {
                DepthChoice::SingleCamera(SingleCameraDepth { matte: installed, ..SingleCameraDepth::default() })
            }
            Self::PersonAndMonoDepth => DepthChoice::SingleCamera(SingleCameraDepth {
                matte: installed.clone(),
                mono: installed,
                ..SingleCameraDepth::default()
            }),
            Self::Plate => DepthChoice::SingleCamera(SingleCameraDepth {
                plate: Some(PlateFile::Taken),
                ..bokehcam_live::source::installed_networks()
            }),
        }
    }

    /// All methods, with their names in `--depth`.
    const NAMES: [(Self, &'static str); 5] = [
        (Self::Measured, "recorded"),
        (Self::Stereo, "stereo"),
        (Self::Person, "matte"),
        (Self::PersonAndMonoDepth, "matte,mono"),
        (Self::Plate, "plate"),
    ];

    /// Returns the value of `--depth`, including the networks that complement a plate.
    pub fn depth_option(self) -> String {
        match self.to_depth_choice() {
            DepthChoice::SingleCamera(chosen) => chosen.kind_names(),
            _ => self.to_string(),
        }
    }

    /// Returns the method that provided a source's depth; `None` without depth.
    pub fn from_origin(depth_from: DepthOrigin, networks: &SingleCameraDepth, has_plate: bool) -> Option<Self> {
        match depth_from {
            DepthOrigin::Nothing => None,
            DepthOrigin::Units | DepthOrigin::Metres | DepthOrigin::Relative => Some(Self::Measured),
            DepthOrigin::Stereo => Some(Self::Stereo),
            _ if has_plate => Some(Self::Plate),
            DepthOrigin::Networks if networks.mono.is_some() => Some(Self::PersonAndMonoDepth),
            DepthOrigin::Networks => Some(Self::Person),
            DepthOrigin::Plate => Some(Self::Plate),
        }
    }
}

impl fmt::Display for DepthMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(depth_method, _)| depth_method == self).map_or("", |(_, name)| name);
        f.write_str(name)
    }
}

impl FromStr for DepthMethod {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let depth_method = Self::NAMES.iter().find(|(_, name)| *name == text).map(|(depth_method, _)| *depth_method);
        depth_method.ok_or_else(|| {
            let names = Self::NAMES.map(|(_, name)| name).join(", ");
            format!("there is no source of depth '{text}': use one of {names}")
        })
    }
}
