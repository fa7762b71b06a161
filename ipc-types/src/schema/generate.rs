//! Structs for programs in other languages: Rust, C, C++ and Python, each with its type name and its layout asserted.
//!
//! `ipc-types/layouts/` has what this makes of the robot's own structs. A module makes its files from its own structs,
//! in a test that pins them or in a build step; or from a message definition, of which [`Generated`] has all of them.

use std::fmt::Write;
use std::iter;

use super::text::{LAYOUT_MARK, field_comment};
use super::{Kind, Message, Schema};
use crate::payload::{FieldKind, FieldLayout, Layout, Number};

/// The words of Rust, C, C++ and Python that a field or a struct of a definition could have as its name, and none of
/// them can.
const WORDS: &str = "\
    False None Self True abstract alignas alignof and as asm assert async auto await become bool box break case catch char class \
    compl concept const consteval constexpr constinit continue crate decltype def default del delete do double dyn elif else enum \
    except explicit export extern false final finally float fn for friend from gen global goto if impl import in inline int is \
    lambda let long loop macro match mod move mut mutable namespace new noexcept nonlocal not nullptr operator or override pass \
    priv private protected pub public raise ref register reinterpret_cast requires restrict return self short signed sizeof \
    static struct super switch template this throw trait true try type typedef typename typeof union unsafe unsigned unsized use \
    using virtual void volatile where while with xor yield";

/// What a message definition is in each language.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generated {
    /// Name of the files, without their endings.
    pub stem: String,
    /// Each file: its ending and its content.
    pub files: [(&'static str, String); 3],
}

impl Generated {
    /// The files of `schema`, which was read from the text `definition`. `made` is a comment that each begins with. C
    /// and Python get the definition too, for `hero_ril_topic` and `hero_ril_service`, so that a topic has the comments
    /// and units.
    ///
    /// # Errors
    ///
    /// The first name in the definition that is a word of a language.
    pub fn of(schema: &Schema, definition: &str, made: &str) -> Result<Generated, &'static str> {
        let layout = layout_of(schema);
        if let Some(word) = reserved(layout) {
            return Err(word);
        }
        let name = upper_snake(layout.name);
        let guard = format!("{}_{name}", layout.package()).to_uppercase();
        let mut text = format!("#define {guard}_SCHEMA");
        for line in definition.lines() {
            let line = line.replace('\\', "\\\\").replace('"', "\\\"");
            // Writing to a string cannot fail.
            let _ = write!(text, " \\\n    \"{line}\\n\"");
        }
        let header = c_header(&format!("{guard}_H"), layout, &text);
        let docstring = definition.replace('\\', "\\\\").replace("\"\"\"", "'''");
        let module = python_module(layout);
        let class = layout.name;
        let python =
            format!("{module}\n\nsetattr({class}, \"SCHEMA\", \"\"\"\\\n{docstring}\"\"\")\n");
        Ok(Generated {
            stem: name.to_lowercase(),
            files: [
                ("rs", format!("// {made}\n{}", rust_module(layout))),
                ("h", format!("/* {made} */\n{header}")),
                ("py", format!("# {made}\n{python}")),
            ],
        })
    }
}

/// The first name in a definition that is a word of a language.
fn reserved(layout: &'static Layout) -> Option<&'static str> {
    let names = |layout: &'static Layout| {
        let fields = layout.fields.iter().map(|field| field.name);
        iter::once(layout.name).chain(fields)
    };
    let mut names = layout.with_nested().into_iter().flat_map(names);
    names.find(|name| WORDS.split_whitespace().any(|word| word == *name))
}

/// The layout that the schema describes. It is never freed: for a tool that ends.
fn layout_of(schema: &Schema) -> &'static Layout {
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

/// Rust: the struct by `shared_struct!`, those that it contains first.
fn rust_module(root: &'static Layout) -> String {
    let mut text = String::new();
    for layout in root.with_nested() {
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

/// A header for C11 and C++11 with a struct and all that it contains, and behind them `end`. `guard` is its include
/// guard.
///
/// Each struct comes with its type name, and with assertions of its size and offsets. A struct that another header of
/// this kind may have defined before is not defined again; C knows structs by their name without package, so that two
/// packages cannot be used together in one C program when they have structs of one name.
fn c_header(guard: &str, root: &'static Layout, end: &str) -> String {
    let mut text = format!("#ifndef {guard}\n#define {guard}\n\n");
    text.push_str("#include <stddef.h>\n#include <stdint.h>\n");
    let all = root.with_nested();
    let mut packages: Vec<&str> = all.iter().map(|layout| layout.package()).collect();
    packages.sort_unstable();
    packages.dedup();
    for package in packages {
        let assert = format!("{}_ASSERT", package.to_uppercase());
        let _ = write!(
            text,
            "\n#ifndef {assert}\n#ifdef __cplusplus\n#define {assert}(what) static_assert(what, #what)\n#else\n\
             #define {assert}(what) _Static_assert(what, #what)\n#endif\n#endif\n"
        );
    }
    for layout in all {
        let _ = write!(
            text,
            "\n#ifndef {}\n{}#endif\n",
            type_name_constant(layout),
            c_struct(layout)
        );
    }
    // Writing to a string cannot fail.
    let _ = write!(text, "\n{end}\n\n#endif\n");
    text
}

/// The definition of one struct in C, without those that it contains. Needs a macro `<PACKAGE>_ASSERT`.
pub fn c_struct(layout: &Layout) -> String {
    let name = layout.name;
    let assert = format!("{}_ASSERT", layout.package().to_uppercase());
    let mut text = format!(
        "#define {} \"{}\"\ntypedef struct {name} {{\n",
        type_name_constant(layout),
        layout.type_name
    );
    for field in layout.fields {
        let kind = field.kind.name(Number::c_name);
        let len = field.len.map(|len| format!("[{len}]"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "    {kind} {}{};",
            field.name,
            len.unwrap_or_default()
        );
    }
    let _ = writeln!(text, "}} {name};");
    let _ = writeln!(text, "{assert}(sizeof({name}) == {});", layout.size);
    for field in layout.fields {
        let _ = writeln!(
            text,
            "{assert}(offsetof({name}, {}) == {});",
            field.name, field.offset
        );
    }
    text
}

/// `HERO_DSP_TELEMETRY_TYPE_NAME`
fn type_name_constant(layout: &Layout) -> String {
    let package = layout.package().to_uppercase();
    format!("{package}_{}_TYPE_NAME", upper_snake(layout.name))
}

/// `DspTelemetry` as `DSP_TELEMETRY`.
pub fn upper_snake(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.extend(letter.to_uppercase());
    }
    text
}

/// What a module with classes of [`python_class`] begins with. Its types need `hero_ril`; the program does not.
const PYTHON_HEAD: &str = "\
from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hero_ril.structs import Array, Struct
else:
    Struct = ctypes.Structure
";

/// A module for Python with a struct and all that it contains, as `ctypes` has them, with types for `mypy` and editors.
fn python_module(root: &'static Layout) -> String {
    let classes = root.with_nested().into_iter().map(python_class);
    format!("{PYTHON_HEAD}{}", classes.collect::<String>())
}

/// The class of one struct in Python, without those that it contains, and assertions of its size and offsets. Comments
/// and units are docstrings.
///
/// A program runs a `ctypes.Structure`. To a checker of types that has every attribute, so `Struct` is another class
/// there, with the fields as they are declared. The method `type_name` is the one by which iceoryx2's Python binding
/// asks.
pub fn python_class(layout: &Layout) -> String {
    let name = layout.name;
    let mut text = format!("\n\nclass {name}(Struct):\n");
    docstring(&mut text, &doc_of(layout).join("\n"));
    text.push('\n');
    let (mut arguments, mut members, mut offsets) = (String::new(), String::new(), String::new());
    for field in layout.fields {
        let kind = match field.kind {
            FieldKind::Number(Number::F32 | Number::F64) => "float",
            FieldKind::Number(_) => "int",
            FieldKind::Struct(nested) => nested.name,
        };
        let native = field.kind.name(Number::python_name);
        let (declared, given, native) = match field.len {
            Some(len) => (format!("Array[{kind}]"), "Any", format!("{native} * {len}")),
            None => (kind.to_owned(), kind, native.to_owned()),
        };
        let FieldLayout {
            name: field_name,
            offset,
            ..
        } = field;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    {field_name}: {declared}");
        docstring(&mut text, &field_comment(field));
        let _ = write!(arguments, ", {field_name}: {given} = ...");
        let _ = writeln!(members, "            (\"{field_name}\", {native}),");
        let _ = writeln!(offsets, "    assert {name}.{field_name}.offset == {offset}");
    }
    let _ = write!(
        text,
        "\n    if TYPE_CHECKING:\n        def __init__(self{arguments}) -> None: ...\n    else:\n        _fields_ = [\n{members}        ]\n\n\
         \x20   @staticmethod\n    def type_name() -> str:\n        return \"{}\"\n\n\n\
         if not TYPE_CHECKING:\n    assert ctypes.sizeof({name}) == {}\n{offsets}",
        layout.type_name, layout.size
    );
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

/// `structs` and all that they contain: each once, and after those that it contains.
pub fn with_nested(structs: &[&'static Layout]) -> Vec<&'static Layout> {
    let mut all: Vec<&'static Layout> = Vec::new();
    for layout in structs.iter().flat_map(|layout| layout.with_nested()) {
        if !all.contains(&layout) {
            all.push(layout);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_of_a_language_is_no_name() {
        let of = |field: &str, nested: &str| {
            let text = format!(
                "# Layout: pack.Pack.v1\n\nCell[2] cells\nfloat64 {field}\n{}\nMSG: pack_msgs/Cell\nfloat64 {nested}\n",
                "=".repeat(80)
            );
            Generated::of(&Schema::parse(&text).unwrap(), &text, "").map(|files| files.stem)
        };
        assert_eq!(of("charge", "voltage_v").as_deref(), Ok("pack"));
        for word in ["type", "from", "class", "struct"] {
            assert_eq!(of(word, "voltage_v"), Err(word));
            assert_eq!(of("charge", word), Err(word));
        }
    }
}
