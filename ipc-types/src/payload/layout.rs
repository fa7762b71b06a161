//! `shared_struct!`: one definition gives the struct, its description at run time and its checks at compile time.

/// A struct of the shared-memory contract.
pub trait SharedStruct: Copy + Default + 'static {
    /// Stable name without the version, such as `DspTelemetry`.
    const NAME: &'static str;
    /// The fields in the order of their offsets.
    const FIELDS: &'static [FieldLayout];
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

/// Types that may be a field of a shared struct.
pub(crate) trait FieldType {
    const KIND: FieldKind;
}

macro_rules! numbers {
    ($($number:ident),+) => {
        $(
            impl FieldType for $number {
                const KIND: FieldKind = FieldKind::Number(stringify!($number));
            }

            impl<const N: usize> FieldType for [$number; N] {
                const KIND: FieldKind = FieldKind::Array(stringify!($number), N);
            }
        )+
    };
}

numbers!(u8, u16, u32, u64, i32, f32, f64);

impl<T: SharedStruct> FieldType for T {
    const KIND: FieldKind = FieldKind::Struct(T::NAME, T::FIELDS);
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
            const FIELDS: &'static [$crate::payload::FieldLayout] = &[
                $( $crate::payload::FieldLayout {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    size: size_of::<$type>(),
                    kind: <$type as $crate::payload::layout::FieldType>::KIND,
                }, )+
            ];
        }

        const _: () = {
            assert!(size_of::<$name>() == $size, "the pinned size is wrong: raise the layout version");
            assert!(0 $( + size_of::<$type>() )+ == $size, "the struct has padding");
        };
    };
}
