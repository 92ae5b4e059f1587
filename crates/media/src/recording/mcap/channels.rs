//! What a file states of its channels: the topics of their messages, and the types.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::cameras::{self, Cameras};
use super::chunk::Chunk;
use super::fields::Fields;
use super::message::{Encoding, Kind};
use super::topic::Topic;

/// Most topics with pictures, and of cameras; robots have some tens.
pub(super) const MAX_TOPICS: usize = 1000;

/// Longest name of a topic that is read.
const MAX_NAME_BYTES: usize = 1024;
/// Number of characters that are kept of a type's name.
const MAX_TYPE_CHARS: usize = 80;
/// Number of topics without pictures that a message lists.
const MAX_OTHERS: usize = 12;

/// What a file contains.
#[derive(Debug, Default)]
pub(super) struct Contents {
    /// Topics of messages with pictures.
    pub topics: Vec<Topic>,
    pub cameras: Cameras,
    /// Compressed chunks.
    pub chunks: Vec<Chunk>,
    /// Some topics without pictures, with their types.
    pub others: Vec<String>,
    /// What is wrong with the file, if anything.
    pub damage: Option<String>,
}

/// The channels that matter here.
#[derive(Default)]
pub(super) struct Channels {
    /// Types of messages.
    schemas: HashMap<u16, String>,
    /// Positions of topics with pictures, by channel.
    topics: HashMap<u16, usize>,
    /// The same by what channels of one topic share.
    positions: HashMap<(String, Kind, Encoding), usize>,
    /// Topics that describe cameras, by channel.
    cameras: HashMap<u16, (String, cameras::Kind, Encoding)>,
}

impl Channels {
    /// Returns the position of a channel's topic, if that has pictures.
    pub fn topic(&self, channel: u16) -> Option<usize> {
        self.topics.get(&channel).copied()
    }

    /// Returns the topic of a channel that describes cameras.
    pub fn camera(&self, channel: u16) -> Option<&(String, cameras::Kind, Encoding)> {
        self.cameras.get(&channel)
    }

    /// Reads a schema; `None` if it is damaged.
    pub fn define_schema(&mut self, content: &[u8]) -> Option<()> {
        let mut fields = Fields::packed(content);
        let (id, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(id, name.chars().take(MAX_TYPE_CHARS).collect());
        Some(())
    }

    /// Reads a channel, and notes its topic in `found`; `None` if it is damaged.
    pub fn define(&mut self, content: &[u8], found: &mut Contents) -> Option<()> {
        let mut fields = Fields::packed(content);
        let (id, schema, name, encoding) = (fields.u16()?, fields.u16()?, fields.text()?, fields.text()?);
        if self.topics.contains_key(&id) || name.len() > MAX_NAME_BYTES {
            return Some(());
        }
        let kind = self.schemas.get(&schema).map_or("no type", String::as_str);
        let camera = cameras::Kind::of_topic(name, kind).zip(Encoding::from_name(encoding));
        if let Some((camera, encoding)) = camera.filter(|_| self.cameras.len() < MAX_TOPICS) {
            self.cameras.insert(id, (name.to_owned(), camera, encoding));
        }
        if let (Some(kind), Some(encoding)) = (Kind::from_type(kind), Encoding::from_name(encoding)) {
            let position = match self.positions.entry((name.to_owned(), kind, encoding)) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(new) => {
                    found.topics.push(Topic::new(name, kind, encoding));
                    *new.insert(found.topics.len() - 1)
                }
            };
            self.topics.insert(id, position);
        } else if found.others.len() < MAX_OTHERS {
            let text = format!("{name} ({kind}, {encoding})").escape_debug().to_string();
            if !found.others.contains(&text) {
                found.others.push(text);
            }
        }
        Some(())
    }
}
