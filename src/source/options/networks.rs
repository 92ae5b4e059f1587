//! Which networks make depth, and how they are run.

// What options say is shown as it is written, brackets included.
#![allow(rustdoc::broken_intra_doc_links)]

use std::path::PathBuf;

use clap::Args;

#[cfg(feature = "networks")]
use crate::names;
#[cfg(feature = "networks")]
use crate::network::{Runtime, Scaling};

/// Networks that make depth from the pictures of one camera.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Networks")]
pub struct Networks {
    /// What runs networks [default: auto]
    #[cfg(feature = "networks")]
    #[arg(long, value_name = "WHICH", value_parser = names::parse::<Runtime>)]
    pub network_runtime: Option<Runtime>,
    /// What a network that is not known takes for black and white: unit (0 to 1), signed (-1 to 1), codes (0 to 255) or
    /// imagenet (the mean and deviation of that collection) [default: unit for a matte, imagenet for depth]
    #[cfg(feature = "networks")]
    #[arg(long, value_name = "RANGE", value_parser = names::parse::<Range>)]
    pub network_range: Option<Range>,
    /// The order of its colours: rgb or bgr [default: rgb]
    #[cfg(feature = "networks")]
    #[arg(long, value_name = "ORDER", value_parser = names::parse::<Order>)]
    pub network_order: Option<Order>,
}

#[cfg(feature = "networks")]
names::named! {
    /// What a network takes for black and white.
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

#[cfg(feature = "networks")]
impl Range {
    /// What the codes of a picture become.
    pub fn scaling(self) -> Scaling {
        match self {
            Self::Unit => Scaling::UNIT,
            Self::Signed => Scaling::SIGNED,
            Self::Codes => Scaling::CODES,
            Self::Imagenet => Scaling::IMAGENET,
        }
    }
}

#[cfg(feature = "networks")]
names::named! {
    /// The order of a picture's colours.
    pub enum Order default Rgb {
        /// Red first
        Rgb = "rgb",
        /// Blue first
        Bgr = "bgr",
    }
}

/// A network: the best that is installed for its task, or a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NetworkFile {
    /// The best known one in the folders of installed networks.
    Installed,
    /// An ONNX file.
    At(PathBuf),
}

/// The networks that depth is made by: one of them at least.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChosenNetworks {
    /// Where a person is.
    pub matte: Option<NetworkFile>,
    /// How near everything is.
    pub mono: Option<NetworkFile>,
}

impl ChosenNetworks {
    /// Parses `matte[:FILE]`, `mono[:FILE]`, or both with a comma between; `None` if the text means something else.
    pub(super) fn parse(text: &str) -> Option<Result<Self, String>> {
        let is_task = |text: &str| ["matte", "mono"].contains(&text.split(':').next().unwrap_or_default());
        // A comma divides only where a task follows: files may have commas in their names.
        let parts = match text.match_indices(',').find(|(at, _)| is_task(&text[at + 1..])) {
            Some((at, _)) => vec![&text[..at], &text[at + 1..]],
            None => vec![text],
        };
        if !is_task(parts[0]) {
            return None;
        }
        let mut chosen = Self::default();
        for part in parts {
            let (task, file) = part.split_once(':').map_or((part, None), |(task, file)| (task, Some(file)));
            let place = match task {
                "matte" => &mut chosen.matte,
                _ => &mut chosen.mono,
            };
            let file = match file {
                None => NetworkFile::Installed,
                Some("") => return Some(Err(format!("{part}: name an ONNX file after the colon, or leave it out"))),
                Some(file) => NetworkFile::At(file.into()),
            };
            if place.replace(file).is_some() {
                return Some(Err(format!("{task} is named twice")));
            }
        }
        Some(Ok(chosen))
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
        let networks = |matte, mono| Ok(DepthChoice::Networks(ChosenNetworks { matte, mono }));
        assert_eq!(depth("matte"), networks(Some(NetworkFile::Installed), None));
        assert_eq!(depth("mono:a,b.onnx"), networks(None, at("a,b.onnx")));
        assert_eq!(depth("matte:x:1.onnx,mono"), networks(at("x:1.onnx"), Some(NetworkFile::Installed)));
        assert_eq!(depth("mono:n.onnx,matte:m.onnx"), networks(at("m.onnx"), at("n.onnx")));
        assert_eq!(depth("matterhorn"), Ok(DepthChoice::Device("matterhorn".to_owned())));
        assert!(depth("matte:").unwrap_err().contains("ONNX") && depth("mono,mono").unwrap_err().contains("twice"));
    }
}
