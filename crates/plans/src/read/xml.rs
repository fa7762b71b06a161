//! XML as a tree of nodes: what roxmltree reads, without comments and processing instructions. Names of the format's
//! own namespace have no prefix.

use roxmltree::{Document, Error, Node as Source, ParsingOptions};

use super::items::{clean, clean_reason};
use super::tree::{Node, Value};
use crate::error::{MAX_ELEMENT_DEPTH, MAX_NODES, ReadError};

/// The namespace of Google's extensions, whose names are known with the prefix `gx`.
const GX: &str = "http://www.google.com/kml/ext/2.2";

/// Whether the namespace is that of a format, in one of its versions, or none.
fn is_own(namespace: &str) -> bool {
    let namespace = namespace.to_ascii_lowercase();
    let formats = [
        "opengis.net/kml/",
        "earth.google.com/kml/",
        "topografix.com/gpx/",
    ];
    namespace.is_empty() || formats.iter().any(|format| namespace.contains(format))
}

/// Parses an XML file whose root element is called `name`.
pub fn parse(text: &str, name: &str) -> Result<Node, ReadError> {
    let newlines: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
    let line = |at: usize| newlines.partition_point(|newline| *newline < at) + 1;
    if let Some(at) = too_deep(text) {
        let reason = format!("XML elements lie more than {MAX_ELEMENT_DEPTH} deep in each other");
        return Err(ReadError::line(line(at), reason));
    }
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: MAX_NODES as u32,
    };
    let document = Document::parse_with_options(text, options).map_err(|error| match error {
        Error::DtdDetected => ReadError::line(
            line(text.find("<!DOCTYPE").unwrap_or_default()),
            "a document type is not read",
        ),
        Error::NodesLimitReached => ReadError::new(format!("more than {MAX_NODES} XML nodes")),
        Error::NoRootNode => ReadError::file("not valid XML: there is no element"),
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
            ReadError::line(line(text.len()), "not valid XML: it ends within an element")
        }
        error => {
            let message = error.to_string();
            let reason = message
                .rsplit_once(" at ")
                .map_or(&*message, |(reason, _)| reason);
            let reason = clean_reason(&format!("not valid XML: {reason}"));
            ReadError::line(error.pos().row as usize, reason)
        }
    })?;
    let root = document.root_element();
    if root.tag_name().name() != name {
        let found = clean(root.tag_name().name());
        let reason = format!("the root element is `{found}`, not `{name}`");
        return Err(ReadError::line(line(root.range().start), reason));
    }
    let namespace = root.tag_name().namespace().unwrap_or_default();
    if !is_own(namespace) {
        let reason = format!(
            "`{name}` of the namespace `{}` is another format",
            clean(namespace)
        );
        return Err(ReadError::line(line(root.range().start), reason));
    }
    Ok(node(root, &line))
}

/// Elements lie in each other at most [`MAX_ELEMENT_DEPTH`] deep.
fn node(source: Source<'_, '_>, line: &impl Fn(usize) -> usize) -> Node {
    let name = |namespace: Option<&str>, local: &str| match namespace {
        None => local.to_owned(),
        Some(GX) => format!("gx:{local}"),
        Some(namespace) if is_own(namespace) => local.to_owned(),
        Some(other) => match source.lookup_prefix(other) {
            Some("gx") | None => format!("?:{local}"),
            Some(prefix) => format!("{prefix}:{local}"),
        },
    };
    let at = line(source.range().start);
    let attributes = source.attributes().map(|attribute| {
        let name = format!("@{}", name(attribute.namespace(), attribute.name()));
        Node::new(
            name,
            line(attribute.range().start),
            Value::Text(attribute.value().to_owned()),
            Vec::new(),
        )
    });
    let elements = source.children().filter(Source::is_element);
    let nodes = attributes
        .chain(elements.map(|element| node(element, line)))
        .collect();
    let text = source
        .children()
        .filter(Source::is_text)
        .filter_map(|text| text.text())
        .collect();
    let name = name(source.tag_name().namespace(), source.tag_name().name());
    Node::new(name, at, Value::Text(text), nodes)
}

/// Where elements lie deeper in each other than [`MAX_ELEMENT_DEPTH`]: the parser calls itself for each level. Up to
/// the first mistake in the text the depth is what the parser sees.
fn too_deep(text: &str) -> Option<usize> {
    let (mut at, mut depth) = (0, 0_usize);
    let end_of = |from: usize, mark: &str| {
        text[from..]
            .find(mark)
            .map(|found| from + found + mark.len())
    };
    while let Some(found) = text[at..].find('<') {
        let begin = at + found;
        let rest = &text[begin..];
        at = match rest {
            _ if rest.starts_with("<!--") => end_of(begin, "-->")?,
            _ if rest.starts_with("<![CDATA[") => end_of(begin, "]]>")?,
            _ if rest.starts_with("<?") => end_of(begin, "?>")?,
            _ if rest.starts_with("</") => {
                depth = depth.saturating_sub(1);
                begin + 2
            }
            _ => {
                let mut quote = None;
                let end = rest.bytes().position(|byte| match (quote, byte) {
                    (Some(open), _) => {
                        quote = (byte != open).then_some(open);
                        false
                    }
                    (None, b'"' | b'\'') => {
                        quote = Some(byte);
                        false
                    }
                    (None, _) => byte == b'>',
                })?;
                depth += usize::from(!rest[..end].ends_with('/'));
                begin + end
            }
        };
        if depth > MAX_ELEMENT_DEPTH {
            return Some(begin);
        }
    }
    None
}
