//! `shared_struct!`: one definition gives the struct, its description and its checks at compile time.

use serde::ser::{Serialize, Serializer};

use super::layout::{FieldKind, FieldLayout, Layout};
use super::number::Number;

/// A struct that can lie in shared memory. [`shared_struct!`](crate::shared_struct) implements it.
///
/// # Safety
///
/// The type is `repr(C)`, consists of [`FieldType`]s without padding, and `LAYOUT` describes exactly that. Therefore
/// every pattern of bits is a value of it, and all of its bytes are initialized.
#[allow(unsafe_code)]
pub unsafe trait SharedStruct: Copy + Default + Serialize + 'static {
    /// What it looks like.
    const LAYOUT: &'static Layout;
    /// All numbers zero.
    const ZERO: Self;
    /// Stable name without the version, such as `DspTelemetry`.
    const NAME: &'static str = Self::LAYOUT.name;
    /// Name of the layout in shared memory, with its version, such as `hero.DspTelemetry.v3`.
    const TYPE_NAME: &'static str = Self::LAYOUT.type_name;
    /// The fields in the order of their offsets.
    const FIELDS: &'static [FieldLayout] = Self::LAYOUT.fields;

    /// The bytes as they lie in shared memory.
    ///
    /// With [`CDR_HEADER`](crate::schema::CDR_HEADER) in front they are a CDR message, as ROS 2 and MCAP files carry
    /// it.
    fn bytes(&self) -> &[u8] {
        // SAFETY: by the contract of this trait there is no padding, so all bytes are initialized; the slice borrows
        // them.
        #[allow(unsafe_code)]
        unsafe {
            std::slice::from_raw_parts(std::ptr::from_ref(self).cast(), size_of::<Self>())
        }
    }

    /// What a reader finds when these bytes lie in shared memory; `None` if they are not as many as the struct has.
    ///
    /// For recordings, and for tests of readers: every pattern of bits is some value, though perhaps a senseless one.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        if bytes.len() != size_of::<Self>() {
            return None;
        }
        // SAFETY: there are as many bytes, and by the contract of this trait every pattern of bits is a value.
        #[allow(unsafe_code)]
        let value = unsafe { bytes.as_ptr().cast::<Self>().read_unaligned() };
        Some(value)
    }
}

/// Types that may be a field of a shared struct: numbers, shared structs, and arrays of either.
///
/// # Safety
///
/// Every pattern of bits is a value, there is no padding, and `KIND` and `LEN` describe exactly what lies there.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be a field of a shared struct",
    label = "not a number of fixed size",
    note = "use u8 to u64, i8 to i64, f32, f64, a struct made by `shared_struct!`, or an array of one of them; a flag is a number that is 0 or 1"
)]
#[allow(unsafe_code)]
pub unsafe trait FieldType: Copy + 'static {
    /// What lies there, or in each element of an array.
    const KIND: FieldKind;
    /// Length of the array; `None` if it is none.
    const LEN: Option<usize> = None;
    /// All numbers zero.
    const ZERO: Self;

    /// Serializes the field: `serde::Serialize` has no arrays of more than 32 elements.
    ///
    /// # Errors
    ///
    /// Those of the serializer.
    fn serialize_field<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error>;
}

/// A [`FieldType`] as serde takes it.
#[doc(hidden)]
pub struct Serialized<'a, T>(pub &'a T);

impl<T: FieldType> Serialize for Serialized<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize_field(serializer)
    }
}

macro_rules! numbers {
    ($($number:ident $variant:ident),+) => {
        $(
            // SAFETY: a number has no padding, and every pattern of bits is one.
            #[allow(unsafe_code)]
            unsafe impl FieldType for $number {
                const KIND: FieldKind = FieldKind::Number(Number::$variant);
                const ZERO: Self = 0 as $number;

                fn serialize_field<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                    self.serialize(serializer)
                }
            }
        )+
    };
}

numbers!(u8 U8, u16 U16, u32 U32, u64 U64, i8 I8, i16 I16, i32 I32, i64 I64, f32 F32, f64 F64);

// SAFETY: by the contract of `SharedStruct`.
#[allow(unsafe_code)]
unsafe impl<T: SharedStruct> FieldType for T {
    const KIND: FieldKind = FieldKind::Struct(T::LAYOUT);
    const ZERO: Self = T::ZERO;

    fn serialize_field<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.serialize(serializer)
    }
}

// SAFETY: an array adds no padding to that of its elements.
#[allow(unsafe_code)]
unsafe impl<T: FieldType, const N: usize> FieldType for [T; N] {
    const KIND: FieldKind = T::KIND;
    const LEN: Option<usize> = match T::LEN {
        None => Some(N),
        Some(_) => {
            panic!("an array of arrays has no schema: use one array, or an array of structs")
        }
    };
    const ZERO: Self = [T::ZERO; N];

    fn serialize_field<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(Serialized))
    }
}

/// Defines a struct for shared memory, in any crate: `pub struct Name("package.Name.v1") = SIZE { fields }`.
///
/// ```
/// ipc_types::shared_struct! {
///     /// One cell of a battery.
///     pub struct Cell("battery_watch.Cell.v1") = 8 {
///         /// Voltage under load.
///         pub voltage_v: f32,
///         /// Temperature at the middle of the cell [degC].
///         pub temperature_c: f32,
///     }
/// }
///
/// ipc_types::shared_struct! {
///     /// Voltages and temperatures of the flight battery.
///     pub struct Battery("battery_watch.Battery.v1") = 120 {
///         /// Counts the samples of this publisher from 1.
///         pub sequence: u64,
///         /// When the publisher began, host monotonic ns.
///         pub epoch_ns: u64,
///         /// When the cells were measured.
///         pub measured_ns: u64,
///         /// The cells, from the negative pole.
///         pub cells: [Cell; 12],
///     }
/// }
///
/// use ipc_types::payload::SharedStruct;
/// assert_eq!(size_of::<Battery>(), 120);
/// assert_eq!(Battery::TYPE_NAME, "battery_watch.Battery.v1");
/// let schema = ipc_types::schema::text(Battery::LAYOUT);
/// assert!(schema.contains("\nbattery_watch_msgs/Cell[12] cells\n"));
/// assert!(schema.contains("\n# Voltage under load. [V]\nfloat32 voltage_v\n"));
/// ```
///
/// What comes out is a `repr(C)` struct that is `Copy`, `Default` (all zeros), `Debug`, `PartialEq` and `Serialize`,
/// and that implements [`SharedStruct`]. Its [`Layout`] is a constant, from which come the schema in ROS 2's message
/// format ([`schema::text`](crate::schema::text)), its hash ([`Schema::layout_hash`](crate::Schema::layout_hash)), and
/// the types for C and Python ([`generate`](crate::schema::generate)). Doc comments go along: write ranges and meaning
/// into them. A unit goes into the field's name, as the table of `docs/ipc.md` section 6 has it, or in brackets at the
/// end of the comment.
///
/// A number that stands for something else can be read as that: `pub mode: u32 => mode: Mode` makes a method
/// `fn mode(&self) -> Option<Mode>` of `Mode::from_code(u32) -> Option<Mode>`, which is a `const fn`. Any pattern of
/// bits may lie in shared memory, therefore it is an `Option`.
///
/// # What the compiler checks
///
/// A struct that breaks a rule does not compile. Names are such as ROS 2 takes: the package and the fields in lower
/// snake case, the struct in camel case. The size is written down, so that a change of the layout is noticed where it
/// is made.
///
/// No padding, because its bytes hold whatever lay there before, and because CDR would have it in other places:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Padded("stranger.Padded.v1") = 16 {
///         pub short: u16,
///         pub long: u64,
///     }
/// }
/// ```
///
/// No `bool`, no `char`, no enum, because not every pattern of bits is one; no `usize`, whose size is the machine's:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Flagged("stranger.Flagged.v1") = 1 {
///         pub is_flying: bool,
///     }
/// }
/// ```
///
/// The size as it is written down:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Grown("stranger.Grown.v1") = 8 {
///         pub one: u64,
///         pub two: u64,
///     }
/// }
/// ```
///
/// A type name of package, struct and version:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Named("stranger.Other.v1") = 8 {
///         pub one: u64,
///     }
/// }
/// ```
///
/// Names of fields that every language takes:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Named("stranger.Named.v1") = 8 {
///         pub camelCase: u64,
///     }
/// }
/// ```
#[macro_export]
macro_rules! shared_struct {
    (
        $(#[doc = $doc:literal])*
        $vis:vis struct $name:ident ($type_name:literal) = $size:literal {
            $(
                $(#[doc = $field_doc:literal])*
                pub $field:ident: $type:ty $(=> $getter:ident: $code:ty)?
            ),+ $(,)?
        }
    ) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[repr(C)]
        $vis struct $name {
            $( $(#[doc = $field_doc])* pub $field: $type, )+
        }

        impl $name {
            $($(
                #[doc = ::core::concat!("What `", ::core::stringify!($field), "` stands for; `None` if the contract has no such number.")]
                pub const fn $getter(&self) -> ::core::option::Option<$code> {
                    <$code>::from_code(self.$field)
                }
            )?)+
        }

        // SAFETY: the struct is `repr(C)`; the compiler takes only a `FieldType` for a field; `check` below refuses
        // padding.
        unsafe impl $crate::payload::SharedStruct for $name {
            const LAYOUT: &'static $crate::payload::Layout = &$crate::payload::Layout {
                name: ::core::stringify!($name),
                type_name: $type_name,
                doc: &[$($doc),*],
                size: ::core::mem::size_of::<$name>(),
                align: ::core::mem::align_of::<$name>(),
                fields: &[
                    $( $crate::payload::FieldLayout {
                        name: ::core::stringify!($field),
                        offset: ::core::mem::offset_of!($name, $field),
                        size: ::core::mem::size_of::<$type>(),
                        kind: <$type as $crate::payload::FieldType>::KIND,
                        len: <$type as $crate::payload::FieldType>::LEN,
                        doc: &[$($field_doc),*],
                    }, )+
                ],
            };
            const ZERO: Self = $name {
                $( $field: <$type as $crate::payload::FieldType>::ZERO, )+
            };
        }

        // SAFETY: it holds numbers only, so no pointers, and it is `repr(C)`; the name carries the version of the
        // layout.
        unsafe impl $crate::macro_support::ZeroCopySend for $name {
            unsafe fn type_name() -> &'static str {
                $type_name
            }
        }

        impl ::core::default::Default for $name {
            fn default() -> Self {
                <Self as $crate::payload::SharedStruct>::ZERO
            }
        }

        impl $crate::macro_support::Serialize for $name {
            fn serialize<S: $crate::macro_support::Serializer>(
                &self,
                serializer: S,
            ) -> ::core::result::Result<S::Ok, S::Error> {
                use $crate::macro_support::SerializeStruct;
                let fields = <Self as $crate::payload::SharedStruct>::FIELDS.len();
                let mut fields = serializer.serialize_struct(::core::stringify!($name), fields)?;
                $( fields.serialize_field(
                    ::core::stringify!($field),
                    &$crate::macro_support::Serialized(&self.$field),
                )?; )+
                fields.end()
            }
        }

        const _: () = $crate::macro_support::check(
            <$name as $crate::payload::SharedStruct>::LAYOUT,
            $size,
        );
    };
}
