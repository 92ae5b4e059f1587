//! Topics with pictures, and the choice of those that are played.

use std::fmt;

use super::message::{Encoding, Kind, Preview};
use crate::recording::raw_image::{ColorFormat, DepthSamples};

/// A message with a picture, in the file or in a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Message {
    /// The time at which the picture was taken, in nanoseconds; 0 if it is not stated.
    pub stamp_ns: u64,
    /// The time at which it was recorded.
    pub log_ns: u64,
    /// Its position in the file, or in its chunk.
    pub at: u64,
    pub length: u32,
    /// The number of the compressed chunk that has it.
    pub chunk: Option<u32>,
}

/// The messages of one name and type.
#[derive(Debug)]
pub(super) struct Topic {
    pub name: String,
    pub kind: Kind,
    pub encoding: Encoding,
    /// Pixel format or compression of the first message.
    pub format: String,
    /// The coordinate frame of the first message.
    pub frame_id: String,
    /// In the order of the file.
    pub messages: Vec<Message>,
}

/// What the pictures of a topic show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Color,
    Depth,
}

impl Content {
    fn name(self) -> &'static str {
        match self {
            Self::Color => "colour",
            Self::Depth => "depth",
        }
    }
}

/// Writes the name for messages.
impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.name.escape_debug().fmt(f)
    }
}

impl Topic {
    pub fn new(name: &str, kind: Kind, encoding: Encoding) -> Self {
        let (format, frame_id) = Default::default();
        Self { name: name.to_owned(), kind, encoding, format, frame_id, messages: Vec::new() }
    }

    /// Adds a message.
    pub fn add(&mut self, message: Message, preview: &Preview) {
        if self.messages.is_empty() {
            (self.format, self.frame_id) = (preview.format.to_owned(), preview.frame_id.to_owned());
        }
        self.messages.push(message);
    }

    /// Returns what its pictures show; `None` if their format is not read.
    pub fn content(&self) -> Option<Content> {
        let is_named_depth = self.name.contains("depth");
        match self.kind {
            Kind::Image if is_named_depth && self.format == "mono16" => Some(Content::Depth),
            Kind::Image if DepthSamples::from_name(&self.format).is_some() => Some(Content::Depth),
            Kind::Image => ColorFormat::from_name(&self.format).map(|_| Content::Color),
            // Such as `16UC1; compressedDepth png`, or `rgb8; jpeg compressed bgr8`.
            Kind::CompressedImage => {
                let is_depth = self.format.contains("compressedDepth")
                    || self.name.ends_with("/compressedDepth")
                    || DepthSamples::from_name(self.format.split(';').next().unwrap_or_default()).is_some();
                Some(if is_depth { Content::Depth } else { Content::Color })
            }
        }
    }

    /// Returns whether its depth is in metres, and needs no scale.
    pub fn has_metres(&self) -> bool {
        self.format.starts_with("32FC1")
    }

    /// Returns the name without what a compression adds, so that the same pictures have the same name.
    pub fn base_name(&self) -> &str {
        ["/compressedDepth", "/compressed"].iter().find_map(|end| self.name.strip_suffix(end)).unwrap_or(&self.name)
    }

    /// Returns whether it is the usual choice among several: colour before infrared, and depth as the colour camera
    /// sees it.
    fn is_preferred(&self, content: Content) -> bool {
        match content {
            Content::Color => !self.format.starts_with("mono") && self.format != "8UC1" && !self.name.contains("infra"),
            Content::Depth => ["aligned", "registered"].iter().any(|word| self.name.contains(word)),
        }
    }
}

/// The topics that are played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Choice {
    pub color: usize,
    pub depth: Option<usize>,
    /// Whether there were others to choose from, and none was named.
    pub is_guess: bool,
}

/// Chooses the topics: those that are `named`, else the only one of its content, or the preferred one.
///
/// # Errors
/// The reason in one line.
pub(super) fn choose(topics: &[Topic], named: &[String], others: &[String]) -> Result<Choice, String> {
    let mut chosen = [None; 2];
    for name in named {
        let is_named = |topic: &Topic| topic.name == *name || topic.name.trim_start_matches('/') == *name;
        let position = topics.iter().position(|topic| is_named(topic) && !topic.messages.is_empty());
        let position =
            position.ok_or_else(|| format!("--topic {name}: no pictures there; {}", list(topics, others)))?;
        let topic = &topics[position];
        let content = topic
            .content()
            .ok_or_else(|| format!("--topic {name}: pictures of format {:?} are not read", topic.format))?;
        let place = &mut chosen[content as usize];
        if let Some(other) = place.replace(position).filter(|&other| other != position) {
            let (one, other) = (&topics[other], content.name());
            return Err(format!("--topic {one} and {topic} both have {other}; name one for colour, and one for depth"));
        }
    }
    let mut is_guess = false;
    let mut find = |content: Content| -> Result<Option<usize>, String> {
        if let Some(position) = chosen[content as usize] {
            return Ok(Some(position));
        }
        let several =
            || format!("several topics have {}, name one with --topic; {}", content.name(), list(topics, others));
        let (position, is_only) = find_preferred(topics, content).ok_or_else(several)?;
        is_guess |= !is_only;
        Ok(position)
    };
    let (color, depth) = (find(Content::Color)?, find(Content::Depth)?);
    let color =
        color.ok_or_else(|| format!("no topic with colour pictures that are read; {}", list(topics, others)))?;
    Ok(Choice { color, depth, is_guess })
}

/// Returns the topic of a content, if there is one, and whether there is no other choice; `None` if there are several
/// and none is preferred.
fn find_preferred(topics: &[Topic], content: Content) -> Option<(Option<usize>, bool)> {
    let has = |&at: &usize| topics[at].content() == Some(content) && !topics[at].messages.is_empty();
    let all: Vec<usize> = (0..topics.len()).filter(has).collect();
    // Of the same pictures, those without compression are exact.
    let is_original = |at: usize| topics[at].kind == Kind::Image;
    let is_copy = |&at: &usize| {
        let is_same = |&other: &usize| topics[other].base_name() == topics[at].base_name();
        !is_original(at) && all.iter().filter(|&other| is_same(other)).any(|&other| is_original(other))
    };
    let apart: Vec<usize> = all.iter().copied().filter(|at| !is_copy(at)).collect();
    let preferred: Vec<usize> = apart.iter().copied().filter(|&at| topics[at].is_preferred(content)).collect();
    match (&apart[..], &preferred[..]) {
        ([], _) => Some((None, true)),
        (&[only], _) => Some((Some(only), true)),
        (_, &[preferred]) => Some((Some(preferred), false)),
        _ => None,
    }
}

/// Lists all topics in one line.
fn list(topics: &[Topic], others: &[String]) -> String {
    let with_pictures = topics
        .iter()
        .map(|topic| format!("{topic} ({}, {} messages)", topic.format.escape_debug(), topic.messages.len()));
    let all: Vec<String> = with_pictures.chain(others.iter().cloned()).collect();
    if all.is_empty() { "the file has no topics".to_owned() } else { format!("the file has {}", all.join(", ")) }
}
