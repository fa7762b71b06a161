//! Structs for programs from the text of a schema: [`layout_of`] makes the layout, from which [`export`](crate::payload::export) writes C and
//! Python, and this file Rust and the types of Python, which its tools check.

use std::fmt::Write;

use super::text::{LAYOUT_MARK, field_comment};
use super::{Kind, Message, Schema};
use crate::payload::export::with_nested;
use crate::payload::{FieldKind, FieldLayout, Layout, Number};

/// The layout that the schema describes. It is never freed: for a tool that ends.
pub fn layout_of(schema: &Schema) -> &'static Layout {
    layout(schema.root(), schema.type_name().to_owned())
}

fn layout(message: &Message, type_name: String) -> &'static Layout {
    let fields = message.fields.iter().map(|field| FieldLayout {
        name: field.name.clone().leak(),
        offset: field.offset,
        size: field.size,
        kind: match &field.kind {
            Kind::Number(number) => FieldKind::Number(*number),
            Kind::Struct(nested) => FieldKind::Struct(layout(nested, type_name_of(nested))),
        },
        len: field.len,
        doc: lines(&field.comment),
    });
    Box::leak(Box::new(Layout {
        name: message.name.clone().leak(),
        type_name: type_name.leak(),
        doc: lines(&message.comment),
        size: message.size,
        align: message.align,
        fields: fields.collect::<Vec<_>>().leak(),
    }))
}

/// The type name of a nested struct: its comment says it, else it is the first version.
fn type_name_of(message: &Message) -> String {
    let mut lines = message.comment.lines();
    let said = lines.find_map(|line| line.strip_prefix(LAYOUT_MARK));
    said.map_or_else(
        || {
            let package = message.package.strip_suffix("_msgs");
            format!(
                "{}.{}.v1",
                package.unwrap_or(&message.package),
                message.name
            )
        },
        |name| name.trim().to_owned(),
    )
}

/// The comment by lines, without the name of the layout.
fn lines(comment: &str) -> &'static [&'static str] {
    let mut lines: Vec<&'static str> = comment
        .lines()
        .filter(|line| !line.starts_with(LAYOUT_MARK))
        .map(|line| &*line.to_owned().leak())
        .collect();
    while lines.last().is_some_and(|line| line.is_empty()) {
        lines.pop();
    }
    lines.leak()
}

/// Rust: each struct by `shared_struct!`, those that it contains first.
pub fn rust_module(structs: &[&'static Layout]) -> String {
    let mut text = String::new();
    for layout in with_nested(structs) {
        let Layout {
            name,
            type_name,
            size,
            ..
        } = layout;
        text.push_str("\nipc_types::shared_struct! {\n");
        docs(&mut text, "    ", &doc_of(layout).join("\n"));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    pub struct {name}(\"{type_name}\") = {size} {{");
        for field in layout.fields {
            docs(&mut text, "        ", &field_comment(field));
            let kind = field.kind.name(Number::rust_name);
            let kind = match field.len {
                Some(len) => format!("[{kind}; {len}]"),
                None => kind.to_owned(),
            };
            let _ = writeln!(text, "        pub {}: {kind},", field.name);
        }
        text.push_str("    }\n}\n");
    }
    text
}

/// A doc comment, which `shared_struct!` demands of everything.
fn docs(text: &mut String, indent: &str, comment: &str) {
    let comment = if comment.is_empty() {
        "Not described."
    } else {
        comment
    };
    for line in comment.lines() {
        let _ = writeln!(text, "{}", format!("{indent}/// {line}").trim_end());
    }
}

fn doc_of(layout: &Layout) -> Vec<&'static str> {
    layout.doc.iter().map(|line| line.trim()).collect()
}

/// What the stubs of [`python_stub`] need before them: the structures are no `ctypes.Structure` there, because that has every attribute.
pub const PYTHON_STUB_HEAD: &str = "\
from typing import Any, Generic, Iterator, Type, TypeVar

_T = TypeVar(\"_T\")
_S = TypeVar(\"_S\", bound=\"_Struct\")

class _Array(Generic[_T]):
    def __getitem__(self, index: int) -> _T: ...
    def __setitem__(self, index: int, value: _T) -> None: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[_T]: ...
    def __buffer__(self, flags: int) -> memoryview: ...

class _Struct:
    @classmethod
    def from_buffer_copy(cls: Type[_S], source: Any, offset: int = ...) -> _S: ...
    @staticmethod
    def type_name() -> str: ...
    def __buffer__(self, flags: int) -> memoryview: ...
";

/// The types of a structure in Python, with comments and units as docstrings: a stub for `mypy` and editors. After those of the
/// structures that it contains, and after [`PYTHON_STUB_HEAD`].
pub fn python_stub(layout: &Layout) -> String {
    let mut text = format!("\nclass {}(_Struct):\n", layout.name);
    docstring(&mut text, &doc_of(layout).join("\n"));
    let mut arguments = String::new();
    for field in layout.fields {
        let kind = match field.kind {
            FieldKind::Number(Number::F32 | Number::F64) => "float",
            FieldKind::Number(_) => "int",
            FieldKind::Struct(nested) => nested.name,
        };
        // Writing to a string cannot fail.
        let _ = match field.len {
            Some(_) => writeln!(text, "    {}: _Array[{kind}]", field.name),
            None => writeln!(text, "    {}: {kind}", field.name),
        };
        docstring(&mut text, &field_comment(field));
        let given = if field.len.is_some() { "Any" } else { kind };
        let _ = write!(arguments, ", {}: {given} = ...", field.name);
    }
    let _ = writeln!(text, "    def __init__(self{arguments}) -> None: ...");
    text
}

fn docstring(text: &mut String, comment: &str) {
    if !comment.is_empty() {
        let comment = comment.replace('\\', "\\\\").replace('"', "'");
        let comment = comment.replace('\n', "\n    ");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    \"\"\"{comment}\"\"\"");
    }
}
