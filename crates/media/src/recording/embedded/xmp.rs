//! Properties in XMP: attributes or elements of the RDF, found by namespace and name wherever they are.

use roxmltree::{Document, Node};

use super::super::xmp;
use super::packets::Packets;

/// The namespace of `GDepth`.
pub(super) const GDEPTH: &str = "http://ns.google.com/photos/1.0/depthmap/";
/// The namespace of the depth map in Dynamic Depth.
pub(super) const DYNAMIC_DEPTH: &str = "http://ns.google.com/photos/dd/1.0/depthmap/";
/// The namespace of Apple's auxiliary pictures.
pub(super) const APPLE: &str = "http://ns.apple.com/pixeldatainfo/1.0/";

/// The parsed packets of a file.
pub(super) struct Xmp<'a> {
    documents: Vec<Document<'a>>,
    damage: Option<&'static str>,
}

impl<'a> Xmp<'a> {
    /// Parses the packets. Damaged ones are left out.
    pub(super) fn parse(packets: &'a Packets) -> Self {
        let mut parsed = Self { documents: Vec::new(), damage: None };
        for packet in &packets.packets {
            match xmp::parse(packet) {
                Some(document) => parsed.documents.push(document),
                None if mentions_depth(packet) => parsed.damage = Some("it is damaged XML"),
                None => {}
            }
        }
        if packets.is_incomplete && packets.packets.iter().any(|packet| mentions_depth(packet)) {
            parsed.damage = Some("pieces of its Extended XMP are missing");
        }
        parsed
    }

    /// Returns, in words, the damage to packets that mention depth.
    pub(super) fn damage(&self) -> Option<&'static str> {
        self.damage
    }

    /// Returns all elements, in their order.
    pub(super) fn nodes(&self) -> impl Iterator<Item = Node<'_, 'a>> {
        self.documents.iter().flat_map(Document::descendants)
    }

    /// Returns the first value of a property.
    pub(super) fn value(&self, namespace: &str, name: &str) -> Option<&str> {
        self.nodes().find_map(|node| value(node, namespace, name))
    }

    /// Returns the first value of a property as a number.
    pub(super) fn number(&self, namespace: &str, name: &str) -> Option<f32> {
        parse_number(self.value(namespace, name)?)
    }
}

/// Returns a property of an element: an attribute, or a child with a text.
pub(super) fn value<'a>(node: Node<'a, '_>, namespace: &str, name: &str) -> Option<&'a str> {
    let child = || node.children().find(|child| child.has_tag_name((namespace, name)));
    node.attribute((namespace, name)).or_else(|| child()?.text())
}

/// Parses a finite number.
pub(super) fn parse_number(text: &str) -> Option<f32> {
    text.trim().parse().ok().filter(|number: &f32| number.is_finite())
}

fn mentions_depth(packet: &[u8]) -> bool {
    // Apple's is on auxiliary pictures of other kinds, too.
    [GDEPTH, DYNAMIC_DEPTH].iter().any(|name| packet.windows(name.len()).any(|bytes| bytes == name.as_bytes()))
}
