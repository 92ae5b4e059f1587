//! Parses the XML of OpenCV's FileStorage: an element is a map of its children, or the words in it; the children of a
//! list are named `_`.

use roxmltree::{Document, ParsingOptions};

use super::tree::{Kind, MAX_NESTING, Node};

/// Maximum number of elements and texts; a calibration has a hundred.
const MAX_NODES: u32 = 100_000;
const ROOT: &str = "opencv_storage";

/// Parses `text`. Fails with the line and the reason.
pub(super) fn parse(text: &str) -> Result<Node, (usize, String)> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text.trim_start(), options)
        .map_err(|error| (error.pos().row as usize, error.to_string().replace(['\n', '\r'], " ")))?;
    let root = document.root_element();
    if root.tag_name().name() != ROOT {
        return Err((1, format!("OpenCV's begins with <{ROOT}>, and this with <{:.40}>", root.tag_name().name())));
    }
    let starts: Vec<usize> = text.trim_start().match_indices('\n').map(|(at, _)| at).collect();
    let skipped = text.len() - text.trim_start().len();
    let lines_before = text[..skipped].matches('\n').count();
    convert(root, &|at| lines_before + starts.partition_point(|&end| end < at) + 1, 0)
}

/// Converts an element; `line_of` gives the line of a byte.
fn convert(
    element: roxmltree::Node<'_, '_>,
    line_of: &impl Fn(usize) -> usize,
    nesting: usize,
) -> Result<Node, (usize, String)> {
    let line = line_of(element.range().start);
    if nesting == MAX_NESTING {
        return Err((line, "nested too deep".into()));
    }
    let mut children = Vec::new();
    for child in element.children().filter(roxmltree::Node::is_element) {
        children.push((child.tag_name().name().to_owned(), convert(child, line_of, nesting + 1)?));
    }
    let words = || element.text().unwrap_or_default().split_whitespace().map(|word| word.trim_matches('"').to_owned());
    let kind = if children.iter().any(|(name, _)| name != "_") || nesting == 0 {
        Kind::Map(children)
    } else if !children.is_empty() {
        Kind::List(children.into_iter().map(|(_, node)| node).collect())
    } else if words().count() == 1 {
        Kind::Scalar(words().collect())
    } else {
        Kind::List(words().map(|word| Node { line, kind: Kind::Scalar(word) }).collect())
    };
    Ok(Node { line, kind })
}
