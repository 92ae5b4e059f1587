//! Options of depth from a single camera: a clean plate, and networks.

// The help texts contain brackets that are not links.
#![allow(rustdoc::broken_intra_doc_links)]

use std::fmt;
use std::path::PathBuf;

use clap::Args;

use bokehcam::names;

/// Networks that make depth from the pictures of one camera.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Networks")]
pub struct Networks {
    /// Input range of an unknown network, from black to white: unit (0 to 1), signed (-1 to 1), codes (0 to 255) or
    /// imagenet (normalized by the mean and deviation of ImageNet) [default: unit for a matte, imagenet for depth]
    #[arg(long, value_name = "RANGE", value_parser = names::parse_name::<Range>)]
    pub network_range: Option<Range>,
    /// Order of the colours in the input of an unknown network: rgb or bgr [default: rgb]
    #[arg(long, value_name = "ORDER", value_parser = names::parse_name::<Order>)]
    pub network_order: Option<Order>,
}

names::named! {
    /// Input range of a network, from black to white.
    pub enum Range default Unit {
        /// 0 to 1
        Unit = "unit",
        /// -1 to 1
        Signed = "signed",
        /// 0 to 255
        Codes = "codes",
        /// The mean and deviation of ImageNet
        Imagenet = "imagenet",
    }
}

names::named! {
    /// The order of a picture's colours.
    pub enum Order default Rgb {
        /// Red first
        Rgb = "rgb",
        /// Blue first
        Bgr = "bgr",
    }
}

/// A network: the best installed one for its task, or a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NetworkFile {
    /// The best known one in the folders of installed networks.
    Installed,
    /// A network file.
    At(PathBuf),
}

/// A clean plate: taken at the start, or a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlateFile {
    /// Taken from the first pictures.
    Taken,
    /// A picture of the background.
    At(PathBuf),
}

/// The origin of depth from a single camera; at least one field is set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SingleCameraDepth {
    /// The clean plate.
    pub plate: Option<PlateFile>,
    /// The network that segments a person.
    pub matte: Option<NetworkFile>,
    /// The network that estimates depth.
    pub mono: Option<NetworkFile>,
}

impl SingleCameraDepth {
    /// Returns the value of `--depth` without files.
    pub fn kind_names(&self) -> String {
        let kinds = [("plate", self.plate.is_some()), ("matte", self.matte.is_some()), ("mono", self.mono.is_some())];
        kinds.into_iter().filter(|(_, is_there)| *is_there).map(|(kind, _)| kind).collect::<Vec<_>>().join(",")
    }

    /// Returns the files that it names.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let plate = match &mut self.plate {
            Some(PlateFile::At(file)) => Some(file),
            _ => None,
        };
        let networks = [&mut self.matte, &mut self.mono].into_iter().filter_map(|network| match network {
            Some(NetworkFile::At(file)) => Some(file),
            _ => None,
        });
        plate.into_iter().chain(networks)
    }

    /// Returns whether it has a network.
    pub fn has_networks(&self) -> bool {
        self.matte.is_some() || self.mono.is_some()
    }

    /// Parses `plate[:FILE]`, `matte[:FILE]` and `mono[:FILE]`, separated by commas; `None` if the text means something
    /// else.
    pub(super) fn parse(text: &str) -> Option<Result<Self, String>> {
        let is_kind = |text: &str| {
            let kind = text.split([':', ',']).next().unwrap_or_default();
            ["plate", "matte", "mono"].contains(&kind)
        };
        if !is_kind(text) {
            return None;
        }
        let mut chosen = Self::default();
        let mut rest = Some(text);
        while let Some(text) = rest {
            // A comma separates only if another kind follows, as file names may contain commas.
            let comma = text.match_indices(',').map(|(at, _)| at).find(|at| is_kind(&text[at + 1..]));
            let part = &text[..comma.unwrap_or(text.len())];
            rest = comma.map(|at| &text[at + 1..]);
            let (kind, file) = part.split_once(':').map_or((part, None), |(kind, file)| (kind, Some(file)));
            if file == Some("") {
                return Some(Err(format!("{part}: name a file after the colon, or leave it out")));
            }
            let network = || file.map_or(NetworkFile::Installed, |file| NetworkFile::At(file.into()));
            let is_twice = match kind {
                "plate" => {
                    let plate = file.map_or(PlateFile::Taken, |file| PlateFile::At(file.into()));
                    chosen.plate.replace(plate).is_some()
                }
                "matte" => chosen.matte.replace(network()).is_some(),
                "mono" => chosen.mono.replace(network()).is_some(),
                other => return Some(Err(format!("{other}: use plate, matte or mono, with commas between"))),
            };
            if is_twice {
                return Some(Err(format!("{kind} is named twice")));
            }
        }
        Some(Ok(chosen))
    }
}

/// Writes the value of `--depth`.
impl fmt::Display for SingleCameraDepth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let network = |network: &Option<NetworkFile>| match network {
            Some(NetworkFile::At(file)) => Some(Some(file.clone())),
            Some(NetworkFile::Installed) => Some(None),
            None => None,
        };
        let plate = self.plate.as_ref().map(|plate| match plate {
            PlateFile::At(file) => Some(file.clone()),
            PlateFile::Taken => None,
        });
        let kinds = [("plate", plate), ("matte", network(&self.matte)), ("mono", network(&self.mono))];
        let parts = kinds.into_iter().filter_map(|(kind, file)| {
            Some(file?.map_or_else(|| kind.to_owned(), |file| format!("{kind}:{}", file.display())))
        });
        f.write_str(&parts.collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::super::DepthChoice;
    use super::*;

    #[test]
    fn networks_are_told_from_folders_and_cameras() {
        let depth = |text: &str| text.parse::<DepthChoice>();
        let at = |file: &str| Some(NetworkFile::At(file.into()));
        let networks = |matte, mono| Ok(DepthChoice::SingleCamera(SingleCameraDepth { plate: None, matte, mono }));
        assert_eq!(depth("matte"), networks(Some(NetworkFile::Installed), None));
        assert_eq!(depth("mono:a,b.onnx"), networks(None, at("a,b.onnx")));
        assert_eq!(depth("matte:x:1.onnx,mono"), networks(at("x:1.onnx"), Some(NetworkFile::Installed)));
        assert_eq!(depth("mono:n.onnx,matte:m.onnx"), networks(at("m.onnx"), at("n.onnx")));
        assert_eq!(depth("matterhorn"), Ok(DepthChoice::Device("matterhorn".to_owned())));
        let plate = |plate| SingleCameraDepth { plate: Some(plate), ..SingleCameraDepth::default() };
        assert_eq!(depth("plate"), Ok(DepthChoice::SingleCamera(plate(PlateFile::Taken))));
        assert_eq!(plate(PlateFile::Taken).kind_names(), "plate");
        let room = plate(PlateFile::At("room,1.png".into()));
        assert_eq!(depth("plate:room,1.png"), Ok(DepthChoice::SingleCamera(room.clone())));
        let all = SingleCameraDepth { matte: Some(NetworkFile::Installed), mono: at("n.onnx"), ..room };
        assert_eq!(depth("matte,plate:room,1.png,mono:n.onnx"), Ok(DepthChoice::SingleCamera(all)));
        assert!(depth("matte,plateau").unwrap_err().contains("use plate, matte or mono"));
        assert!(
            depth("matte:").unwrap_err().contains("name a file") && depth("mono,mono").unwrap_err().contains("twice")
        );
    }
}
