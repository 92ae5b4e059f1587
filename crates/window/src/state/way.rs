//! Where depth comes from, as a person chooses it.

use std::fmt;
use std::str::FromStr;

use bokehcam::source::{DepthChoice, DepthFrom, NetworkFile, OneCamera, PlateFile};

/// A way to depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Way {
    /// The source's own: a depth camera's, or recorded.
    Measured,
    /// Two eyes.
    Stereo,
    /// A network that finds people.
    Person,
    /// That, and one that tells how far everything is.
    PersonAndDistance,
    /// A picture of what is behind, taken now.
    Plate,
}

impl Way {
    /// As `--depth` takes it, for the network that is installed.
    pub fn choice(self) -> DepthChoice {
        let installed = Some(NetworkFile::Installed);
        match self {
            Self::Measured => DepthChoice::Recorded,
            Self::Stereo => DepthChoice::Stereo,
            Self::Person => DepthChoice::OneCamera(OneCamera { matte: installed, ..OneCamera::default() }),
            Self::PersonAndDistance => {
                DepthChoice::OneCamera(OneCamera { matte: installed.clone(), mono: installed, ..OneCamera::default() })
            }
            Self::Plate => DepthChoice::OneCamera(OneCamera {
                plate: Some(PlateFile::Taken),
                ..bokehcam::source::installed_networks()
            }),
        }
    }

    /// All of them, and what `--depth` calls each.
    const NAMES: [(Self, &'static str); 5] = [
        (Self::Measured, "recorded"),
        (Self::Stereo, "stereo"),
        (Self::Person, "matte"),
        (Self::PersonAndDistance, "matte,mono"),
        (Self::Plate, "plate"),
    ];

    /// What `--depth` calls it, with the networks that a plate is completed by.
    pub fn flag(self) -> String {
        match self.choice() {
            DepthChoice::OneCamera(chosen) => chosen.kinds(),
            _ => self.to_string(),
        }
    }

    /// The way by which a source got its depth, with a plate or without; `None` where it has none.
    pub fn of(depth_from: DepthFrom, networks: &OneCamera, has_plate: bool) -> Option<Self> {
        match depth_from {
            DepthFrom::Nothing => None,
            DepthFrom::Units | DepthFrom::Metres | DepthFrom::Relative => Some(Self::Measured),
            DepthFrom::Eyes => Some(Self::Stereo),
            _ if has_plate => Some(Self::Plate),
            DepthFrom::Networks if networks.mono.is_some() => Some(Self::PersonAndDistance),
            DepthFrom::Networks => Some(Self::Person),
            DepthFrom::Plate => Some(Self::Plate),
        }
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(way, _)| way == self).map_or("", |(_, name)| name);
        f.write_str(name)
    }
}

impl FromStr for Way {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let way = Self::NAMES.iter().find(|(_, name)| *name == text).map(|(way, _)| *way);
        way.ok_or_else(|| {
            let names = Self::NAMES.map(|(_, name)| name).join(", ");
            format!("there is no depth by '{text}': use one of {names}")
        })
    }
}
