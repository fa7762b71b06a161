//! Writes schemas: a [`Layout`] as a message definition of ROS 2.

use std::fmt::Write;

use crate::payload::{FieldKind, FieldLayout, Layout};

/// Stands before each nested type.
pub(super) const SEPARATOR: &str =
    "================================================================================";

/// Begins the comment that has the name of the type in shared memory, with its version.
pub(super) const LAYOUT_MARK: &str = "Layout: ";

/// Units by the suffix of a field's name, as `docs/ipc.md` section 6 has them; no suffix ends in another one, because
/// each begins with the only underscore in it.
const UNITS: [(&str, &str); 19] = [
    ("_ns", "ns"),
    ("_us", "µs"),
    ("_ms", "ms"),
    ("_s", "s"),
    ("_m", "m"),
    ("_m2", "m²"),
    ("_mps", "m/s"),
    ("_mps2", "m/s²"),
    ("_rad", "rad"),
    ("_radps", "rad/s"),
    ("_deg", "deg"),
    ("_rpm", "rpm"),
    ("_mv", "mV"),
    ("_v", "V"),
    ("_ma", "mA"),
    ("_a", "A"),
    ("_percent", "%"),
    ("_hz", "Hz"),
    ("_ppb", "ppb"),
];

/// The schema of `layout` with all that it contains, as an MCAP file with the encoding `ros2msg` has it.
///
/// What it says is described at [the module](super).
pub fn text(layout: &'static Layout) -> String {
    let mut text = String::new();
    definition(layout, &mut text);
    for nested in layout.with_nested() {
        if nested != layout {
            let _ = write!(text, "\n{SEPARATOR}\nMSG: {}\n", nested.ros_name());
            definition(nested, &mut text);
        }
    }
    text
}

fn definition(layout: &Layout, text: &mut String) {
    for line in comment(layout).lines() {
        comment_line(line, text);
    }
    // An empty line ends the comment of the message; what follows is the first field's.
    text.push('\n');
    for field in layout.fields {
        for line in field_comment(field).lines() {
            comment_line(line, text);
        }
        let kind = match field.kind {
            FieldKind::Number(number) => number.ros_name().to_owned(),
            FieldKind::Struct(nested) => nested.ros_name(),
        };
        let len = field.len.map(|len| format!("[{len}]"));
        let _ = writeln!(text, "{kind}{} {}", len.unwrap_or_default(), field.name);
    }
}

fn comment_line(line: &str, text: &mut String) {
    text.push('#');
    if !line.is_empty() {
        text.push(' ');
    }
    text.push_str(line);
    text.push('\n');
}

/// The comment of a struct: its doc comment, and the name of its type.
pub(super) fn comment(layout: &Layout) -> String {
    let mut lines = plain_lines(layout.doc);
    if !lines.is_empty() {
        lines.push(String::new());
    }
    lines.push(format!("{LAYOUT_MARK}{}", layout.type_name));
    lines.join("\n")
}

/// The comment of a field: its doc comment, and its unit unless that stands there already.
pub(super) fn field_comment(field: &FieldLayout) -> String {
    let mut text = plain_lines(field.doc).join("\n");
    let by_suffix = UNITS
        .iter()
        .find(|(suffix, _)| field.name.ends_with(suffix));
    if let Some((_, unit)) = by_suffix
        && unit_of(&text).is_none()
    {
        if !text.is_empty() {
            text.push(' ');
        }
        let _ = write!(text, "[{unit}]");
    }
    text
}

/// The unit of a comment: the last thing in brackets that holds no comma, which would be an interval.
pub(super) fn unit_of(comment: &str) -> Option<&str> {
    let mut rest = comment;
    while let Some((before, after)) = rest.rsplit_once('[') {
        if let Some((unit, _)) = after.split_once(']')
            && !unit.is_empty()
            && !unit.contains([',', '\n'])
        {
            return Some(unit);
        }
        rest = before;
    }
    None
}

/// A doc comment without what only rustdoc understands, line by line.
fn plain_lines(doc: &[&str]) -> Vec<String> {
    let doc: String = doc.join("\n");
    let is_control = |c: char| c.is_control() && c != '\n';
    let doc = match doc.contains("[`") || doc.contains(is_control) {
        true => without_links(&doc).replace(is_control, " "),
        false => doc,
    };
    let mut lines: Vec<String> = doc.lines().map(|line| line.trim().to_owned()).collect();
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    let first = lines.iter().position(|line| !line.is_empty());
    lines.drain(..first.unwrap_or_default());
    lines
}

/// ``[`Name`](path)`` as `Name`: brackets would be taken for a unit, and the path leads nowhere outside of rustdoc.
fn without_links(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, link)) = rest.split_once("[`") {
        out.push_str(before);
        let Some((name, after)) = link.split_once("`]") else {
            out.push_str("[`");
            rest = link;
            continue;
        };
        out.push_str(name);
        rest = match after
            .strip_prefix('(')
            .and_then(|path| path.split_once(')'))
        {
            Some((_, after)) => after,
            None => after,
        };
    }
    out + rest
}
