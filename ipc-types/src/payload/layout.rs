//! [`Layout`]: what a struct in shared memory looks like, as a constant, and the rules that it must keep.

use super::number::Number;

/// Largest payload, bytes. A sample is a state or a measurement; images and clouds of points do not belong in one.
pub const MAX_PAYLOAD_SIZE: usize = 1 << 20;

/// Description of a [`SharedStruct`](super::SharedStruct).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Name without package and version, such as `DspTelemetry`.
    pub name: &'static str,
    /// `<package>.<name>.v<version>`, such as `hero.DspTelemetry.v3`: the name of the type in shared memory.
    pub type_name: &'static str,
    /// Doc comment, by lines.
    pub doc: &'static [&'static str],
    /// Size, bytes.
    pub size: usize,
    /// Alignment, bytes.
    pub align: usize,
    /// The fields in the order of their offsets.
    pub fields: &'static [FieldLayout],
}

/// One field of a [`Layout`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldLayout {
    /// Name, with the unit as suffix.
    pub name: &'static str,
    /// Offset from the start of the struct, bytes.
    pub offset: usize,
    /// Size, bytes.
    pub size: usize,
    /// What lies there, or in each element of an array.
    pub kind: FieldKind,
    /// Length of the array; `None` if it is none.
    pub len: Option<usize>,
    /// Doc comment, by lines.
    pub doc: &'static [&'static str],
}

/// Type of a field, or of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldKind {
    /// A number.
    Number(Number),
    /// A nested struct.
    Struct(&'static Layout),
}

impl FieldKind {
    /// The struct that is nested here, if one is.
    pub const fn nested(self) -> Option<&'static Layout> {
        match self {
            FieldKind::Number(_) => None,
            FieldKind::Struct(layout) => Some(layout),
        }
    }

    /// Its name: the number's in a language, or the struct's.
    pub fn name(self, number_name: impl FnOnce(Number) -> &'static str) -> &'static str {
        match self {
            FieldKind::Number(number) => number_name(number),
            FieldKind::Struct(layout) => layout.name,
        }
    }
}

impl Layout {
    /// The package of the type name, such as `hero`.
    pub fn package(&self) -> &'static str {
        self.type_name.split('.').next().unwrap_or_default()
    }

    /// Name of the type in a ROS 2 message definition, such as `hero_msgs/DspTelemetry`.
    ///
    /// The package gets `_msgs`, as ROS packages of messages have it, and the version is left out: it stands in the
    /// definition's comment `Layout:`.
    pub fn ros_name(&self) -> String {
        format!("{}_msgs/{}", self.package(), self.name)
    }

    /// Name of the schema in an MCAP file and of the type in `ros2`, such as `hero_msgs/msg/DspTelemetry`.
    pub fn ros_resource_name(&self) -> String {
        format!("{}_msgs/msg/{}", self.package(), self.name)
    }

    /// Where the field of this name lies, if it is a `u64`, bytes.
    pub const fn offset_of(&self, name: &str) -> Option<usize> {
        let mut index = 0;
        while index < self.fields.len() {
            let field = &self.fields[index];
            if is_equal(field.name, name) {
                let is_u64 = matches!(field.kind, FieldKind::Number(Number::U64));
                return if is_u64 && field.len.is_none() {
                    Some(field.offset)
                } else {
                    None
                };
            }
            index += 1;
        }
        None
    }

    /// The nested structs, each once and after those that it contains, and this one last.
    pub fn with_nested(&'static self) -> Vec<&'static Layout> {
        let mut all = Vec::new();
        self.collect(&mut all);
        all
    }

    fn collect(&'static self, all: &mut Vec<&'static Layout>) {
        for nested in self.fields.iter().filter_map(|field| field.kind.nested()) {
            nested.collect(all);
        }
        if !all.contains(&self) {
            all.push(self);
        }
    }
}

/// Stops the compiler when `layout` breaks a rule of the contract. `size` is the one that the definition pins.
#[doc(hidden)]
pub const fn check(layout: &Layout, size: usize) {
    const {
        assert!(
            cfg!(target_endian = "little"),
            "samples in shared memory are little-endian"
        );
    }
    assert!(
        layout.size == size,
        "the pinned size is wrong: correct it, and raise the layout version if the struct was in use"
    );
    assert!(
        size <= MAX_PAYLOAD_SIZE,
        "the struct is larger than MAX_PAYLOAD_SIZE"
    );
    assert!(
        is_type_name(layout.type_name, layout.name),
        "the type name must be `<package>.<struct>.v<version>`, the package in lower snake case, the struct in camel case"
    );
    let mut end = 0;
    let mut index = 0;
    while index < layout.fields.len() {
        let field = &layout.fields[index];
        assert!(
            field.offset == end,
            "the struct has padding: order the fields by size, or fill the hole with a field `reserved`"
        );
        assert!(field.size > 0, "an array of length 0 cannot be a field");
        assert!(
            is_snake(field.name.as_bytes(), 0, field.name.len()),
            "a field's name must be in lower snake case: letters, digits and single underscores"
        );
        end += field.size;
        index += 1;
    }
    assert!(
        end == layout.size,
        "the struct has padding at its end: add a field `reserved`"
    );
    assert!(
        are_unambiguous(layout, layout),
        "two nested structs have the same package and name but other versions or fields"
    );
}

/// `<package>.<name>.v<version>`, with names that ROS 2 takes: it is the strictest of those that must take them.
const fn is_type_name(type_name: &str, name: &str) -> bool {
    let (text, name) = (type_name.as_bytes(), name.as_bytes());
    let mut dot = 0;
    while dot < text.len() && text[dot] != b'.' {
        dot += 1;
    }
    // Room for two dots, the `v` and a digit.
    if !is_snake(text, 0, dot) || text.len() < dot + name.len() + 4 {
        return false;
    }
    let mut index = 0;
    while index < name.len() {
        let is_camel =
            name[index].is_ascii_alphanumeric() && (index > 0 || name[0].is_ascii_uppercase());
        if !is_camel || text[dot + 1 + index] != name[index] {
            return false;
        }
        index += 1;
    }
    index = dot + 1 + name.len();
    if text[index] != b'.' || text[index + 1] != b'v' || text[index + 2] == b'0' {
        return false;
    }
    index += 2;
    while index < text.len() {
        if !text[index].is_ascii_digit() {
            return false;
        }
        index += 1;
    }
    true
}

/// Whether `text[from..to]` is in lower snake case, as ROS 2 wants names of packages and fields.
pub(crate) const fn is_snake(text: &[u8], from: usize, to: usize) -> bool {
    if from >= to || !text[from].is_ascii_lowercase() || text[to - 1] == b'_' {
        return false;
    }
    let mut index = from;
    while index < to {
        let byte = text[index];
        let is_double = byte == b'_' && text[index - 1] == b'_';
        if is_double || !(byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_') {
            return false;
        }
        index += 1;
    }
    true
}

/// Whether each struct in `layout` is the only one of its name in `root`.
const fn are_unambiguous(layout: &Layout, root: &Layout) -> bool {
    let mut index = 0;
    while index < layout.fields.len() {
        if let Some(nested) = layout.fields[index].kind.nested()
            && (!agrees(nested, root) || !are_unambiguous(nested, root))
        {
            return false;
        }
        index += 1;
    }
    true
}

/// Whether every struct in `root` that is called as `layout` is the same.
const fn agrees(layout: &Layout, root: &Layout) -> bool {
    if is_same_but_version(layout.type_name, root.type_name) && !is_same(layout, root) {
        return false;
    }
    let mut index = 0;
    while index < root.fields.len() {
        if let Some(nested) = root.fields[index].kind.nested()
            && !agrees(layout, nested)
        {
            return false;
        }
        index += 1;
    }
    true
}

/// Whether two structs have the same name, version and fields.
const fn is_same(one: &Layout, other: &Layout) -> bool {
    if !is_equal(one.type_name, other.type_name) || one.fields.len() != other.fields.len() {
        return false;
    }
    let mut index = 0;
    while index < one.fields.len() {
        let (a, b) = (&one.fields[index], &other.fields[index]);
        let is_same_kind = match (a.kind, b.kind) {
            (FieldKind::Number(a), FieldKind::Number(b)) => a as u8 == b as u8,
            (FieldKind::Struct(a), FieldKind::Struct(b)) => is_same(a, b),
            _ => false,
        };
        // With the kind, the size says the length.
        if !is_same_kind || !is_equal(a.name, b.name) || a.size != b.size {
            return false;
        }
        index += 1;
    }
    true
}

const fn is_same_but_version(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut index = 0;
    let mut dots = 0;
    while index < one.len() && index < other.len() && one[index] == other[index] {
        if one[index] == b'.' {
            dots += 1;
        }
        index += 1;
    }
    dots == 2
}

/// `==` of texts, which is not const.
pub(crate) const fn is_equal(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut index = 0;
    while index < one.len() && index < other.len() {
        if one[index] != other[index] {
            return false;
        }
        index += 1;
    }
    one.len() == other.len()
}
