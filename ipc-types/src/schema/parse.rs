//! Reads schemas: text from another process or a file, which may be anything.
//!
//! Two steps: [`split`] makes definitions of the lines, [`Resolver`] makes structs of the definitions and works out
//! where each field lies. Every loop is bounded by the text's length, every recursion by [`MAX_DEPTH`], and every size
//! is checked before it is added.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::message::{Field, Kind, Message};
use super::text::{LAYOUT_MARK, SEPARATOR, comment, field_comment};
use crate::payload::layout::is_snake;
use crate::payload::{FieldKind, Layout, MAX_PAYLOAD_SIZE, Number};

/// Longest text that is parsed, bytes. The longest of the robot's own has 12 kB.
pub const MAX_TEXT_LEN: usize = 256 << 10;

/// How deep structs may be nested, the outermost included. The robot's own are two deep.
pub const MAX_DEPTH: usize = 16;

/// Longest list of a payload's numbers, bytes: each with its full name, such as `cells[2].voltage_v`, its type and its
/// comment. Names in the text of a schema may be as long as the text, and the name of a struct stands before that of
/// each number in it.
pub const MAX_LISTED_LEN: usize = 4 << 20;

/// Most numbers of a payload that have a name of their own; an array of numbers is one.
pub const MAX_NUMBERS: usize = 1 << 14;

/// Longest name that an error repeats, characters: it may come from a text that was made to fill a screen.
const MAX_QUOTED: usize = 64;

/// A text is no schema of a struct in shared memory.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// It is longer than [`MAX_TEXT_LEN`].
    #[error("the schema has {0} bytes, {MAX_TEXT_LEN} are possible")]
    TooLong(usize),
    /// The outermost struct has no comment that names its type in shared memory.
    #[error(
        "the schema does not name its type: a comment `{LAYOUT_MARK}package.Name.v1` must stand above the first field"
    )]
    NoLayoutName,
    /// A line is neither comment, constant nor field.
    #[error("line {line} of the schema cannot be read: {reason}")]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A type that no struct in shared memory has, or one that the text does not define.
    #[error(
        "line {line} of the schema has the type `{name}`, which is neither a number of fixed size nor defined here"
    )]
    UnknownType {
        /// Number of the line, from 1.
        line: usize,
        /// Name of the type.
        name: String,
    },
    /// A struct is defined twice.
    #[error("the schema defines `{0}` twice")]
    DefinedTwice(String),
    /// A struct without fields.
    #[error("the struct `{0}` of the schema has no fields")]
    Empty(String),
    /// A struct contains itself, or structs are nested deeper than [`MAX_DEPTH`].
    #[error("the structs of the schema are nested deeper than {MAX_DEPTH}, or contain themselves")]
    TooDeep,
    /// The payload would be larger than [`MAX_PAYLOAD_SIZE`] or have more than [`MAX_NUMBERS`] numbers.
    #[error("the schema describes more than {MAX_PAYLOAD_SIZE} bytes or {MAX_NUMBERS} numbers")]
    TooLarge,
    /// Names and comments are so long that a list of all numbers would be longer than [`MAX_LISTED_LEN`].
    #[error(
        "the numbers of the schema, with full names and comments, take more than {MAX_LISTED_LEN} bytes: use shorter ones"
    )]
    TooWordy,
    /// The struct would have padding, and so cannot be one of the contract.
    #[error("the struct `{name}` of the schema would have padding at its byte {offset}")]
    Padding {
        /// Name of the struct.
        name: String,
        /// Where it begins.
        offset: usize,
    },
}

/// `name` as an error may repeat it.
fn quoted(name: &str) -> String {
    name.chars()
        .take(MAX_QUOTED)
        .flat_map(char::escape_debug)
        .collect()
}

/// The name of the type that a text describes, and its outermost struct.
pub(super) fn parse(text: &str) -> Result<(String, Arc<Message>), SchemaError> {
    if text.len() > MAX_TEXT_LEN {
        return Err(SchemaError::TooLong(text.len()));
    }
    let mut definitions = split(text)?;
    let type_name = definitions[0]
        .layout_name()
        .ok_or(SchemaError::NoLayoutName)?
        .to_owned();
    let (package, name) = ros_names(&type_name).ok_or(SchemaError::NoLayoutName)?;
    definitions[0].package = package;
    definitions[0].name = name;
    let mut by_name = BTreeMap::new();
    for (index, definition) in definitions.iter().enumerate() {
        let name = (definition.package.as_str(), definition.name.as_str());
        if by_name.insert(name, index).is_some() {
            return Err(SchemaError::DefinedTwice(quoted(name.1)));
        }
    }
    let mut resolver = Resolver {
        done: vec![None; definitions.len()],
        definitions: &definitions,
        by_name,
    };
    let root = resolver.resolve(0, 1)?;
    Ok((type_name, root))
}

/// The struct of `layout`: what [`parse`] would make of its [text](super::text()), which nobody reads here; or that
/// without its comments.
pub(super) fn of_layout(
    layout: &'static Layout,
    is_commented: bool,
) -> Result<Arc<Message>, SchemaError> {
    let package = format!("{}_msgs", layout.package());
    let of_struct = if is_commented {
        comment(layout)
    } else {
        String::new()
    };
    let mut message = Message::new(package, layout.name.to_owned(), of_struct);
    for (index, field) in layout.fields.iter().enumerate() {
        let line = FieldLine {
            line: index,
            kind: String::new(),
            len: field.len,
            name: field.name.to_owned(),
            comment: Vec::from_iter(is_commented.then(|| field_comment(field))),
        };
        let kind = match field.kind {
            FieldKind::Number(number) => Kind::Number(number),
            FieldKind::Struct(nested) => Kind::Struct(of_layout(nested, is_commented)?),
        };
        append(&mut message, &line, kind)?;
    }
    Ok(Arc::new(message))
}

/// `hero.DspTelemetry.v3` as `hero_msgs` and `DspTelemetry`.
fn ros_names(type_name: &str) -> Option<(String, String)> {
    let (package, rest) = type_name.split_once('.')?;
    let (name, version) = rest.split_once(".v")?;
    let is_number = version.bytes().all(|byte| byte.is_ascii_digit());
    let is_version = is_number && version.parse::<u32>().is_ok_and(|number| number > 0);
    let is_right = is_snake(package.as_bytes(), 0, package.len()) && is_camel(name) && is_version;
    is_right.then(|| (format!("{package}_msgs"), name.to_owned()))
}

fn is_camel(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

/// A struct as the text has it.
#[derive(Default)]
struct Definition {
    package: String,
    name: String,
    comment: Vec<String>,
    fields: Vec<FieldLine>,
}

/// A field as the text has it.
struct FieldLine {
    line: usize,
    kind: String,
    len: Option<usize>,
    name: String,
    comment: Vec<String>,
}

impl Definition {
    /// The name of the type in shared memory; the last one, because the generator writes it last.
    fn layout_name(&self) -> Option<&str> {
        let mut lines = self.comment.iter().rev();
        lines.find_map(|line| line.strip_prefix(LAYOUT_MARK))
    }
}

/// The definitions, of which the first is the outermost struct, whose name is not known yet.
fn split(text: &str) -> Result<Vec<Definition>, SchemaError> {
    let mut definitions = Vec::new();
    let mut current = Definition::default();
    let mut comment: Vec<String> = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((index, line)) = lines.next() {
        let number = index + 1;
        let line = line.trim();
        if line == SEPARATOR {
            let header = lines.next().map(|(_, line)| line.trim());
            let (package, name) = header.and_then(message_names).ok_or(SchemaError::Line {
                line: number + 1,
                reason: "after a separator comes `MSG: package/Name`",
            })?;
            definitions.push(std::mem::take(&mut current));
            (current.package, current.name) = (package, name);
            comment.clear();
        } else if line.is_empty() {
            // A comment that an empty line ends is no field's. At the top it is the struct's.
            if current.fields.is_empty() {
                current.comment.append(&mut comment);
            }
            comment.clear();
        } else if let Some(text) = line.strip_prefix('#') {
            comment.push(printable(text));
        } else if let Some(mut field) = field(number, line)? {
            comment.append(&mut field.comment);
            field.comment = std::mem::take(&mut comment);
            current.fields.push(field);
        } else {
            comment.clear();
        }
    }
    definitions.push(current);
    Ok(definitions)
}

/// A comment as it may be shown: a terminal would take control characters for commands.
fn printable(comment: &str) -> String {
    comment.trim().replace(char::is_control, " ")
}

/// `MSG: package/Name`; `package/msg/Name` is the same.
fn message_names(line: &str) -> Option<(String, String)> {
    let (package, name) = line.strip_prefix("MSG:")?.trim().split_once('/')?;
    let name = name.strip_prefix("msg/").unwrap_or(name);
    let is_right = is_snake(package.as_bytes(), 0, package.len()) && is_camel(name);
    is_right.then(|| (package.to_owned(), name.to_owned()))
}

/// `uint32[4] name # comment`, with a default value perhaps. Nothing comes out of a constant, which takes no memory.
fn field(line: usize, text: &str) -> Result<Option<FieldLine>, SchemaError> {
    let wrong = |reason| SchemaError::Line { line, reason };
    let (text, comment) = match text.split_once('#') {
        Some((text, comment)) => (text, Some(printable(comment))),
        None => (text, None),
    };
    let (kind, rest) = text
        .trim()
        .split_once(char::is_whitespace)
        .ok_or_else(|| wrong("a field is a type and a name"))?;
    let rest = rest.trim();
    // Of a constant `=` follows the name; in a default value it stands behind a space.
    let name_len = rest
        .find(|c: char| c.is_whitespace() || c == '=')
        .unwrap_or(rest.len());
    let (name, behind) = rest.split_at(name_len);
    if behind.trim_start().starts_with('=') {
        return Ok(None);
    }
    if !is_snake(name.as_bytes(), 0, name.len()) {
        return Err(wrong("a field's name is in lower snake case"));
    }
    let (kind, len) = match kind.split_once('[') {
        None => (kind, None),
        Some((kind, len)) => {
            let len = len
                .strip_suffix(']')
                .and_then(|len| len.parse::<usize>().ok())
                .filter(|len| *len > 0);
            let wrong_len = || wrong("an array in shared memory has a fixed length, such as `[4]`");
            (kind, Some(len.ok_or_else(wrong_len)?))
        }
    };
    Ok(Some(FieldLine {
        line,
        kind: kind.to_owned(),
        len,
        name: name.to_owned(),
        comment: comment.into_iter().collect(),
    }))
}

/// Makes structs of definitions, each once.
struct Resolver<'a> {
    definitions: &'a [Definition],
    /// Which definition has this package and name.
    by_name: BTreeMap<(&'a str, &'a str), usize>,
    done: Vec<Option<Arc<Message>>>,
}

impl Resolver<'_> {
    /// The struct of the definition at `index`, which `depth` structs are around, itself included.
    fn resolve(&mut self, index: usize, depth: usize) -> Result<Arc<Message>, SchemaError> {
        if let Some(message) = &self.done[index] {
            // It was not too deep where it was first met, but here it may lie deeper.
            return match depth + message.height - 1 <= MAX_DEPTH {
                true => Ok(Arc::clone(message)),
                false => Err(SchemaError::TooDeep),
            };
        }
        // This also ends a struct that contains itself.
        if depth > MAX_DEPTH {
            return Err(SchemaError::TooDeep);
        }
        let definitions = self.definitions;
        let definition = &definitions[index];
        let (package, name) = (definition.package.clone(), definition.name.clone());
        let mut message = Message::new(package, name, definition.comment.join("\n"));
        let mut names = BTreeSet::new();
        for line in &definition.fields {
            let kind = self.kind(&definition.package, line, depth)?;
            if !names.insert(line.name.as_str()) {
                return Err(SchemaError::Line {
                    line: line.line,
                    reason: "another field has the same name",
                });
            }
            append(&mut message, line, kind)?;
        }
        if message.fields.is_empty() {
            return Err(SchemaError::Empty(quoted(&message.name)));
        }
        if !message.size.is_multiple_of(message.align) {
            return Err(SchemaError::Padding {
                name: quoted(&message.name),
                offset: message.size,
            });
        }
        let message = Arc::new(message);
        self.done[index] = Some(Arc::clone(&message));
        Ok(message)
    }

    fn kind(&mut self, package: &str, line: &FieldLine, depth: usize) -> Result<Kind, SchemaError> {
        if let Some(number) = Number::from_ros_name(&line.kind) {
            return Ok(Kind::Number(number));
        }
        let (package, name) = match line.kind.split_once('/') {
            Some((package, name)) => (package, name.strip_prefix("msg/").unwrap_or(name)),
            // A type of the same package.
            None => (package, line.kind.as_str()),
        };
        let index = self.by_name.get(&(package, name)).copied();
        let index = index.ok_or_else(|| SchemaError::UnknownType {
            line: line.line,
            name: quoted(&line.kind),
        })?;
        self.resolve(index, depth + 1).map(Kind::Struct)
    }
}

/// Adds a field to the end of `message`.
fn append(message: &mut Message, line: &FieldLine, kind: Kind) -> Result<(), SchemaError> {
    if !message.size.is_multiple_of(kind.align()) {
        return Err(SchemaError::Padding {
            name: quoted(&message.name),
            offset: message.size,
        });
    }
    let size = kind.size().checked_mul(line.len.unwrap_or(1));
    let end = size.and_then(|size| message.size.checked_add(size));
    let (Some(size), Some(end)) = (size, end) else {
        return Err(SchemaError::TooLarge);
    };
    let field = Field {
        name: line.name.clone(),
        offset: message.size,
        size,
        len: line.len,
        comment: line.comment.join("\n"),
        kind,
    };
    message.numbers = message.numbers.saturating_add(field.numbers());
    if end > MAX_PAYLOAD_SIZE || message.numbers > MAX_NUMBERS {
        return Err(SchemaError::TooLarge);
    }
    message.listed_len = message.listed_len.saturating_add(field.listed_len());
    if message.listed_len > MAX_LISTED_LEN {
        return Err(SchemaError::TooWordy);
    }
    message.align = message.align.max(field.kind.align());
    message.height = message.height.max(1 + field.kind.height());
    message.size = end;
    message.fields.push(field);
    Ok(())
}
