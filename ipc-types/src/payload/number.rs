//! [`Number`]: the fixed-size numbers that a payload may hold, and what each language calls them.

use crate::time::MonotonicNs;

/// Type of a number in shared memory. Little-endian, aligned to its own size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Number {
    /// `u8`
    U8,
    /// `u16`
    U16,
    /// `u32`
    U32,
    /// `u64`
    U64,
    /// `i8`
    I8,
    /// `i16`
    I16,
    /// `i32`
    I32,
    /// `i64`
    I64,
    /// `f32`
    F32,
    /// `f64`
    F64,
}

impl Number {
    /// All of them.
    pub const ALL: [Number; 10] = [
        Number::U8,
        Number::U16,
        Number::U32,
        Number::U64,
        Number::I8,
        Number::I16,
        Number::I32,
        Number::I64,
        Number::F32,
        Number::F64,
    ];

    /// Size and alignment, bytes.
    pub const fn size(self) -> usize {
        match self {
            Number::U8 | Number::I8 => 1,
            Number::U16 | Number::I16 => 2,
            Number::U32 | Number::I32 | Number::F32 => 4,
            Number::U64 | Number::I64 | Number::F64 => 8,
        }
    }

    /// Name in Rust, which is also the one that a layout hash is made of: `u32`, `f64`.
    pub const fn rust_name(self) -> &'static str {
        self.names()[0]
    }

    /// Name in a ROS 2 message definition: `uint32`, `float64`.
    pub const fn ros_name(self) -> &'static str {
        self.names()[1]
    }

    /// Name in C: `uint32_t`, `double`.
    pub const fn c_name(self) -> &'static str {
        self.names()[2]
    }

    /// Name in Python: `ctypes.c_uint32`, `ctypes.c_double`.
    pub const fn python_name(self) -> &'static str {
        self.names()[3]
    }

    /// The number with this name in a ROS 2 message definition. `byte` and `char` are `uint8` there.
    pub fn from_ros_name(name: &str) -> Option<Number> {
        match name {
            "byte" | "char" => Some(Number::U8),
            _ => Number::ALL
                .into_iter()
                .find(|number| number.ros_name() == name),
        }
    }

    /// In Rust, ROS 2, C and Python.
    const fn names(self) -> [&'static str; 4] {
        match self {
            Number::U8 => ["u8", "uint8", "uint8_t", "ctypes.c_uint8"],
            Number::U16 => ["u16", "uint16", "uint16_t", "ctypes.c_uint16"],
            Number::U32 => ["u32", "uint32", "uint32_t", "ctypes.c_uint32"],
            Number::U64 => ["u64", "uint64", "uint64_t", "ctypes.c_uint64"],
            Number::I8 => ["i8", "int8", "int8_t", "ctypes.c_int8"],
            Number::I16 => ["i16", "int16", "int16_t", "ctypes.c_int16"],
            Number::I32 => ["i32", "int32", "int32_t", "ctypes.c_int32"],
            Number::I64 => ["i64", "int64", "int64_t", "ctypes.c_int64"],
            Number::F32 => ["f32", "float32", "float", "ctypes.c_float"],
            Number::F64 => ["f64", "float64", "double", "ctypes.c_double"],
        }
    }
}

/// A value that means something only if another field says so.
pub(super) const fn given<T: Copy>(is_given: bool, value: T) -> Option<T> {
    if is_given { Some(value) } else { None }
}

/// When a message left the DSP, at the latest: when it was read, if nobody knows.
pub(super) const fn sent(sent_ns: u64, received_ns: u64) -> MonotonicNs {
    match sent_ns {
        0 => MonotonicNs(received_ns),
        known => MonotonicNs(known),
    }
}
