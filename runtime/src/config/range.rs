//! Numbers with bounds.

use std::fmt;
use std::ops::RangeBounds;

use serde::Deserializer;
use serde::de::{DeserializeOwned, Error};

/// Reads a number and refuses it outside `range`; floats that are not finite are outside every range.
///
/// [`ranged!`](crate::ranged) makes this a function for `#[serde(deserialize_with)]`.
///
/// # Errors
/// The value is not a number of this type, or lies outside.
pub fn in_range<'de, T: Number, D: Deserializer<'de>>(
    deserializer: D,
    range: impl RangeBounds<T> + fmt::Debug,
) -> Result<T, D::Error> {
    let number = T::deserialize(deserializer)?;
    if number.is_finite() && range.contains(&number) {
        return Ok(number);
    }
    let range = format!("{range:?}")
        .replace("..=", " to ")
        .replace("..", " to below ");
    Err(D::Error::custom(format_args!(
        "{number} is out of range: it must be from {range}"
    )))
}

/// Defines functions for `#[serde(deserialize_with = "…")]` that read a bounded number.
///
/// ```
/// runtime::ranged! {
///     /// Bits per second.
///     pub fn baud_rate(u32) in 50..=4_000_000;
///     fn tolerance_m(f64) in 0.1..=50.0;
/// }
///
/// #[derive(Debug, serde::Deserialize)]
/// struct Port {
///     #[serde(deserialize_with = "baud_rate")]
///     baud_rate: u32,
///     #[serde(deserialize_with = "tolerance_m")]
///     tolerance_m: f64,
/// }
///
/// let text = "tolerance_m = 2\nbaud_rate = 3\n";
/// let error = runtime::config::parse::<Port>(text, "bridge.toml").unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "bridge.toml:2: 3 is out of range: it must be from 50 to 4000000, in `baud_rate = 3`"
/// );
/// ```
#[macro_export]
macro_rules! ranged {
    ($( $(#[$meta:meta])* $visibility:vis fn $name:ident($number:ty) in $range:expr; )+) => {
        $(
            $(#[$meta])*
            $visibility fn $name<'de, D: $crate::config::Deserializer<'de>>(
                deserializer: D,
            ) -> ::core::result::Result<$number, D::Error> {
                $crate::config::in_range(deserializer, $range)
            }
        )+
    };
}

/// Numbers that [`in_range`] can bound.
pub trait Number: DeserializeOwned + PartialOrd + fmt::Display {
    /// Whether this is a number at all: neither infinite nor not-a-number.
    fn is_finite(&self) -> bool;
}

macro_rules! numbers {
    ($($integer:ty),+; $($float:ty),+) => {
        $(impl Number for $integer { fn is_finite(&self) -> bool { true } })+
        $(impl Number for $float { fn is_finite(&self) -> bool { <$float>::is_finite(*self) } })+
    };
}

numbers!(u8, u16, u32, u64, usize, i8, i16, i32, i64, isize; f32, f64);
