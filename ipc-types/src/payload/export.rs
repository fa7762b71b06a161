//! The same structs for other languages: a header for C and C++, a module for Python.
//!
//! `ipc-types/layouts/` has what this makes of the robot's own structs. A module makes its own files from its own structs,
//! in a test that pins them or in a build step.

use std::fmt::Write;

use super::layout::Layout;
use super::number::Number;

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
        let kind = field.kind.name(Number::python_name);
        let len = field.len.map(|len| format!(" * {len}"));
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
