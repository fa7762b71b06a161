//! What the measuring programs have in common. A measurement is a row, [`Measurement`], and the function in it: the row
//! is its name on the command line, and what the help says of it. What it finds are rows as well: an [`Outcome`] each,
//! which a [`Table`] prints, with what was not as it must be. [`Times`] are durations with their quantiles.

mod outcome;
mod times;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

pub use outcome::{Outcome, Table, table};
pub use times::{Times, median};

/// A measurement: what a program is told to measure, and how.
#[derive(Debug)]
pub struct Measurement<F: 'static> {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, for the help.
    pub about: &'static str,
    /// The functions that measure it, one after the other.
    pub functions: &'static [F],
}

/// A row of a program's measurements.
pub const fn row<F>(
    name: &'static str,
    functions: &'static [F],
    about: &'static str,
) -> Measurement<F> {
    Measurement {
        name,
        about,
        functions,
    }
}

/// Reads the name of one of these measurements.
pub fn named<F: Sync>(
    all: &'static [Measurement<F>],
) -> impl TypedValueParser<Value = &'static Measurement<F>> {
    let value = |one: &Measurement<F>| PossibleValue::new(one.name).help(one.about);
    let names = PossibleValuesParser::new(all.iter().map(value));
    names.try_map(|name| {
        all.iter()
            .find(|one| one.name == name)
            .ok_or("no measurement")
    })
}
