//! Topics with pictures, and the choice of those that are played.

use std::fmt;

use super::message::{Encoding, Kind, Preview};
use crate::recording::raw_image::{ColorFormat, DepthSamples};
use crate::recording::role::Role;

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
    /// Disparity or inverse depth, which is not read.
    Disparity,
}

impl Content {
    fn name(self) -> &'static str {
        match self {
            Self::Color => "colour",
            Self::Depth | Self::Disparity => "depth",
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

    /// Returns what its pictures show; `None` if there are none, their format is not read, or their name says that they
    /// are no depth, such as infrared, unless `is_chosen` by the user.
    pub fn content(&self, is_chosen: bool) -> Option<Content> {
        let is_compressed = self.kind == Kind::CompressedImage;
        // Such as `16UC1; compressedDepth png`, or `rgb8; jpeg compressed bgr8`.
        let encoding = self.format.split(';').next().unwrap_or_default();
        let is_depth = DepthSamples::from_name(encoding).is_some()
            || is_compressed && (self.format.contains("compressedDepth") || self.name.ends_with("/compressedDepth"));
        match self.role() {
            _ if self.messages.is_empty() => None,
            Role::Disparity | Role::InverseDepth if is_depth => Some(Content::Disparity),
            Role::Infrared | Role::Other if is_depth => is_chosen.then_some(Content::Depth),
            Role::Depth | Role::Unstated if is_depth || encoding == "mono16" && self.name.contains("depth") => {
                Some(Content::Depth)
            }
            _ => (is_compressed || ColorFormat::from_name(encoding).is_some()).then_some(Content::Color),
        }
    }

    /// Returns what the last two parts of its name state, above all the last one: those before name cameras.
    fn role(&self) -> Role {
        let mut parts = self.base_name().rsplit('/').take(2).map(Role::of_name);
        parts.find(|role| *role != Role::Unstated).unwrap_or_default()
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
            Content::Color => {
                let is_other = matches!(self.role(), Role::Infrared | Role::Other);
                !self.format.starts_with("mono") && self.format != "8UC1" && !is_other
            }
            _ => ["aligned", "registered"].iter().any(|word| self.name.contains(word)),
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
/// The reason in one line: nothing or several may be meant, or depth is not in metres.
pub(super) fn choose(topics: &[Topic], named: &[String], others: &[String]) -> Result<Choice, String> {
    let mut chosen = [None; 2];
    let unread = |topic: &Topic| {
        format!(
            "{topic} holds disparity or inverse depth by its name, not metres; name another topic with --topic, or \
             only that of colour, to play it without depth"
        )
    };
    for name in named {
        let is_named = |topic: &Topic| topic.name == *name || topic.name.trim_start_matches('/') == *name;
        let position = topics.iter().position(|topic| is_named(topic) && !topic.messages.is_empty());
        let position =
            position.ok_or_else(|| format!("--topic {name}: no pictures there; {}", list(topics, others)))?;
        let topic = &topics[position];
        let content = topic
            .content(true)
            .ok_or_else(|| format!("--topic {name}: pictures of format {:?} are not read", topic.format))?;
        if content == Content::Disparity {
            return Err(unread(topic));
        }
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
    let disparity = topics.iter().find(|topic| topic.content(false) == Some(Content::Disparity));
    if let Some(topic) = disparity.filter(|_| depth.is_none() && named.is_empty()) {
        return Err(unread(topic));
    }
    let color =
        color.ok_or_else(|| format!("no topic with colour pictures that are read; {}", list(topics, others)))?;
    Ok(Choice { color, depth, is_guess })
}

/// Returns the topic of a content, if there is one, and whether there is no other choice; `None` if there are several
/// and none is preferred.
fn find_preferred(topics: &[Topic], content: Content) -> Option<(Option<usize>, bool)> {
    let all: Vec<usize> = (0..topics.len()).filter(|&at| topics[at].content(false) == Some(content)).collect();
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
