//! The same structs for other languages: a header for C and C++, a module for Python, a table for people.
//!
//! `ipc-types/layouts/` has what this makes of the robot's own structs. A module makes its own files from its own structs,
//! in a test that pins them or in a build step.

use std::fmt::Write;

use super::layout::{FieldKind, Layout};

/// A header for C11 and C++11 with `structs` and all that they contain. `guard` is its include guard.
///
/// Each struct comes with its type name, and with assertions of its size and offsets. A struct that another header of this
/// kind may have defined before is not defined again; C knows structs by their name without package, so that two packages
/// cannot be used together in one C program when they have structs of one name.
pub fn c_header(guard: &str, structs: &[&'static Layout]) -> String {
    let mut text = format!("#ifndef {guard}\n#define {guard}\n\n");
    text.push_str("#include <stddef.h>\n#include <stdint.h>\n");
    let all = with_nested(structs);
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
    text.push_str("\n#endif\n");
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
        let kind = match field.kind {
            FieldKind::Number(number) | FieldKind::Array(number, _) => number.c_name(),
            FieldKind::Struct(nested) | FieldKind::StructArray(nested, _) => nested.name,
        };
        let len = field.kind.len().map(|len| format!("[{len}]"));
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

/// A module for Python with `structs` and all that they contain, as `ctypes` has them.
pub fn python_module(structs: &[&'static Layout]) -> String {
    let classes = with_nested(structs).into_iter().map(python_class);
    format!("import ctypes\n{}", classes.collect::<String>())
}

/// The class of one struct in Python, without those that it contains, and assertions of its size and offsets.
///
/// Its method `type_name` is the one by which iceoryx2's Python binding asks.
pub fn python_class(layout: &Layout) -> String {
    let name = layout.name;
    let mut text = format!("\n\nclass {name}(ctypes.Structure):\n    _fields_ = [\n");
    for field in layout.fields {
        let kind = match field.kind {
            FieldKind::Number(number) | FieldKind::Array(number, _) => number.python_name(),
            FieldKind::Struct(nested) | FieldKind::StructArray(nested, _) => nested.name,
        };
        let len = field.kind.len().map(|len| format!(" * {len}"));
        let _ = writeln!(
            text,
            "        (\"{}\", {kind}{}),",
            field.name,
            len.unwrap_or_default()
        );
    }
    let _ = write!(
        text,
        "    ]\n\n    @staticmethod\n    def type_name() -> str:\n        return \"{}\"\n",
        layout.type_name
    );
    let _ = writeln!(text, "\n\nassert ctypes.sizeof({name}) == {}", layout.size);
    for field in layout.fields {
        let _ = writeln!(
            text,
            "assert {name}.{}.offset == {}",
            field.name, field.offset
        );
    }
    text
}

/// The layout of one struct as a table: offset, size, type and name of each field.
pub fn table(layout: &Layout) -> String {
    let Layout {
        name,
        type_name,
        size,
        align,
        ..
    } = layout;
    let hash = layout.hash();
    let mut text = format!("{name} {type_name} size {size} align {align} hash {hash:016x}\n");
    for field in layout.fields {
        let kind = match field.kind {
            FieldKind::Number(number) => number.rust_name().to_owned(),
            FieldKind::Array(number, len) => format!("{}[{len}]", number.rust_name()),
            FieldKind::Struct(nested) => nested.name.to_owned(),
            FieldKind::StructArray(nested, len) => format!("{}[{len}]", nested.name),
        };
        let _ = writeln!(
            text,
            "{:6} {:4} {kind:18} {}",
            field.offset, field.size, field.name
        );
    }
    text
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
