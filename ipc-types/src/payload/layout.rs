//! `shared_struct!`: one definition gives the struct, its description at run time and its checks at compile time.

/// A struct of the shared-memory contract.
pub trait SharedStruct: Copy + Default + 'static {
    /// Stable name without the version, such as `DspTelemetry`.
    const NAME: &'static str;
    /// Name of the layout in shared memory, with its version, such as `hero.DspTelemetry.v2`.
    const TYPE_NAME: &'static str;
    /// The fields in the order of their offsets.
    const FIELDS: &'static [FieldLayout];

    /// What a reader finds when these bytes lie in shared memory, in this machine's order; nothing when they are not as
    /// many as the struct has.
    ///
    /// For recordings, and for tests of readers: every pattern of bits is some value, though perhaps a senseless one.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

/// One field of a [`SharedStruct`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldLayout {
    /// Name, with the unit as suffix.
    pub name: &'static str,
    /// Offset from the start of the struct, bytes.
    pub offset: usize,
    /// Size, bytes.
    pub size: usize,
    /// What lies there.
    pub kind: FieldKind,
}

/// Type of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldKind {
    /// A number, by its Rust name: `u32`, `f64` …
    Number(&'static str),
    /// An array of numbers: type and length.
    Array(&'static str, usize),
    /// A nested struct: its name and its fields.
    Struct(&'static str, &'static [FieldLayout]),
}

/// Hash of one or more layouts: 64-bit FNV-1a over each field's name, offset, size and kind, nested structs included.
///
/// A type's name says which layout is meant; the hash says which one was compiled, so that two fields that changed
/// places are found even when somebody forgot to raise the version.
pub const fn layout_hash(layouts: &[&[FieldLayout]]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    let mut index = 0;
    while index < layouts.len() {
        hash = hash_fields(hash, layouts[index]);
        index += 1;
    }
    hash
}

const fn hash_fields(mut hash: u64, fields: &[FieldLayout]) -> u64 {
    let mut index = 0;
    while index < fields.len() {
        let field = &fields[index];
        hash = hash_text(hash, field.name);
        hash = hash_number(hash, field.offset);
        hash = hash_number(hash, field.size);
        hash = match field.kind {
            FieldKind::Number(name) => hash_text(hash, name),
            FieldKind::Array(name, len) => hash_number(hash_text(hash, name), len),
            FieldKind::Struct(name, nested) => hash_fields(hash_text(hash, name), nested),
        };
        index += 1;
    }
    hash
}

/// The text's bytes and a zero, so that `ab`, `c` differs from `a`, `bc`.
const fn hash_text(mut hash: u64, text: &str) -> u64 {
    let bytes = text.as_bytes();
    let mut index = 0;
    while index < bytes.len() {
        hash = hash_byte(hash, bytes[index]);
        index += 1;
    }
    hash_byte(hash, 0)
}

/// The number's low 32 bits, least significant byte first; layouts are far smaller than that.
const fn hash_number(mut hash: u64, number: usize) -> u64 {
    let bytes = (number as u32).to_le_bytes();
    let mut index = 0;
    while index < bytes.len() {
        hash = hash_byte(hash, bytes[index]);
        index += 1;
    }
    hash
}

const fn hash_byte(hash: u64, byte: u8) -> u64 {
    (hash ^ byte as u64).wrapping_mul(0x0000_0100_0000_01b3)
}

/// Types that may be a field of a shared struct.
pub(crate) trait FieldType: Sized {
    const KIND: FieldKind;

    /// As [`SharedStruct::from_bytes`].
    fn read(bytes: &[u8]) -> Option<Self>;
}

macro_rules! numbers {
    ($($number:ident),+) => {
        $(
            impl FieldType for $number {
                const KIND: FieldKind = FieldKind::Number(stringify!($number));

                fn read(bytes: &[u8]) -> Option<Self> {
                    Some($number::from_ne_bytes(bytes.try_into().ok()?))
                }
            }

            impl<const N: usize> FieldType for [$number; N] {
                const KIND: FieldKind = FieldKind::Array(stringify!($number), N);

                fn read(bytes: &[u8]) -> Option<Self> {
                    if bytes.len() != size_of::<Self>() {
                        return None;
                    }
                    let mut numbers = [$number::default(); N];
                    let parts = bytes.chunks_exact(size_of::<$number>());
                    for (number, part) in numbers.iter_mut().zip(parts) {
                        *number = $number::read(part)?;
                    }
                    Some(numbers)
                }
            }
        )+
    };
}

numbers!(u8, u16, u32, u64, i32, f32, f64);

impl<T: SharedStruct> FieldType for T {
    const KIND: FieldKind = FieldKind::Struct(T::NAME, T::FIELDS);

    fn read(bytes: &[u8]) -> Option<Self> {
        T::from_bytes(bytes)
    }
}

/// Defines a struct of the contract: `pub struct Name("hero.Name.v1") = SIZE { fields }`.
///
/// The size in the definition pins the layout: it must be written down, and it must be the sum of the fields' sizes,
/// which is to say that there is no padding.
macro_rules! shared_struct {
    (
        $(#[$meta:meta])*
        pub struct $name:ident ($type_name:literal) = $size:literal {
            $( $(#[$field_meta:meta])* pub $field:ident: $type:ty, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, serde::Serialize,
            ZeroCopySend,
        )]
        #[type_name($type_name)]
        #[repr(C)]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $type, )+
        }

        impl $crate::payload::SharedStruct for $name {
            const NAME: &'static str = stringify!($name);
            const TYPE_NAME: &'static str = $type_name;
            const FIELDS: &'static [$crate::payload::FieldLayout] = &[
                $( $crate::payload::FieldLayout {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    size: size_of::<$type>(),
                    kind: <$type as $crate::payload::layout::FieldType>::KIND,
                }, )+
            ];

            fn from_bytes(bytes: &[u8]) -> Option<Self> {
                use $crate::payload::layout::FieldType;
                if bytes.len() != size_of::<Self>() {
                    return None;
                }
                Some($name {
                    $( $field: {
                        let offset = std::mem::offset_of!($name, $field);
                        FieldType::read(&bytes[offset..offset + size_of::<$type>()])?
                    }, )+
                })
            }
        }

        const _: () = {
            assert!(size_of::<$name>() == $size, "the pinned size is wrong: raise the layout version");
            assert!(0 $( + size_of::<$type>() )+ == $size, "the struct has padding");
        };
    };
}
