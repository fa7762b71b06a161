//! Rows as they are shown: by chosen columns, with the time in UTC.

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;
use status::fields;
use status::log::clock::IsoTime;

use super::recording::Row;

/// Name of the layout of a row in JSON.
pub const SCHEMA: &str = "ril.LogRow.v1";

pub use status::log::tsv::UTC;

/// Where times in UTC come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UtcSource {
    /// The log has a column.
    Column,
    /// The file's name: the log's file was created in this second, ns since 1970. The first row may be later, by as
    /// long as status waited for telemetry.
    FileName(u64),
    /// Neither.
    Nowhere,
}

impl UtcSource {
    /// Where times come from in a log with `columns` whose name says that it was created at `created_unix_s`.
    pub fn of(columns: &[String], created_unix_s: Option<u64>) -> UtcSource {
        if columns.iter().any(|name| name == UTC) {
            return UtcSource::Column;
        }
        created_unix_s.map_or(UtcSource::Nowhere, |unix_s| {
            UtcSource::FileName(unix_s.saturating_mul(1_000_000_000))
        })
    }

    /// Its name for programs.
    pub fn name(self) -> Option<&'static str> {
        match self {
            UtcSource::Column => Some("column"),
            UtcSource::FileName(_) => Some("file-name"),
            UtcSource::Nowhere => None,
        }
    }
}

/// Gives each row its time in UTC.
#[derive(Clone, Copy, Debug)]
pub struct UtcTimes {
    source: UtcSource,
    first_received_ns: Option<u64>,
}

impl UtcTimes {
    /// Times from `source`.
    pub fn new(source: UtcSource) -> UtcTimes {
        UtcTimes {
            source,
            first_received_ns: None,
        }
    }

    /// The time of the next row; `None` if it is not known.
    pub fn of(&mut self, row: &Row<'_>) -> Option<IsoTime> {
        let first = *self.first_received_ns.get_or_insert(row.sample.received_ns);
        match self.source {
            UtcSource::Column => row.unix_ns.map(IsoTime::from_unix_ns),
            UtcSource::FileName(created_ns) => {
                let elapsed_ns = row.sample.received_ns.saturating_sub(first);
                Some(IsoTime::from_unix_ns(created_ns.saturating_add(elapsed_ns)))
            }
            UtcSource::Nowhere => None,
        }
    }
}

/// Which columns are shown, in which order, the time apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chosen {
    columns: Vec<(usize, String)>,
}

impl Chosen {
    /// All of `columns` but the time.
    pub fn all(columns: &[String]) -> Chosen {
        let chosen = columns.iter().cloned().enumerate();
        Chosen {
            columns: chosen.filter(|(_, name)| name != UTC).collect(),
        }
    }

    /// The columns `names`. A column can also be named as its field in `ril echo dsp`.
    ///
    /// # Errors
    ///
    /// A name that is no column, with those that are.
    pub fn named(columns: &[String], names: &[String]) -> Result<Chosen, String> {
        let find = |name: &String| {
            let mut fields = fields::all();
            let field = fields.find(|field| field.path() == *name);
            let column = field.map_or(name.as_str(), |field| field.name);
            let place = columns.iter().position(|one| one == column);
            place
                .map(|place| (place, column.to_owned()))
                .ok_or_else(|| {
                    let near = runtime::config::nearest(name, columns.iter().map(String::as_str));
                    match near {
                        Some(near) => {
                            format!("the log has no column `{name}`; did you mean `{near}`?")
                        }
                        None => format!(
                            "the log has no column `{name}`; it has {}",
                            columns.join(", ")
                        ),
                    }
                })
        };
        let columns = names.iter().filter(|name| *name != UTC).map(find);
        Ok(Chosen {
            columns: columns.collect::<Result<_, _>>()?,
        })
    }

    /// The columns of `names` that the log has.
    pub fn present(columns: &[String], names: &[&str]) -> Chosen {
        let find = |name: &&str| {
            let place = columns.iter().position(|column| column == name)?;
            Some((place, (*name).to_owned()))
        };
        Chosen {
            columns: names.iter().filter_map(find).collect(),
        }
    }

    /// The names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(_, name)| name.as_str())
    }

    /// The chosen cells of `row`.
    pub fn cells<'a>(&self, row: &Row<'a>) -> Vec<&'a str> {
        let cells: Vec<&str> = row.cells().collect();
        let places = self.columns.iter().map(|(place, _)| *place);
        places
            .map(|place| cells.get(place).copied().unwrap_or_default())
            .collect()
    }

    /// A row as one line for people: `TIME  name=value  …`; a cell without a value is a dash.
    pub fn line(&self, time: Option<IsoTime>, row: &Row<'_>) -> String {
        let time = time.map_or_else(|| "-".to_owned(), |time| time.to_string());
        let cells = self.cells(row);
        let cells = self.names().zip(cells).map(|(name, cell)| {
            let cell = if cell.is_empty() { "-" } else { cell };
            format!("{name}={cell}")
        });
        let mut parts = vec![time];
        parts.extend(cells);
        parts.join("  ")
    }
}

/// A row as one JSON object.
pub struct JsonRow<'a> {
    /// The columns.
    pub chosen: &'a Chosen,
    /// The time in UTC.
    pub time: Option<IsoTime>,
    /// The row.
    pub row: &'a Row<'a>,
}

impl Serialize for JsonRow<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("schema", SCHEMA)?;
        map.serialize_entry("utc", &self.time.map(|time| time.to_string()))?;
        for (name, cell) in self.chosen.names().zip(self.chosen.cells(self.row)) {
            map.serialize_entry(name, &number(cell))?;
        }
        map.end()
    }
}

/// A cell as a number with its own digits; `None` if it is empty.
fn number(cell: &str) -> Value {
    match cell.parse::<u64>() {
        Ok(number) => Value::from(number),
        Err(_) => cell.parse::<f64>().map_or(Value::Null, Value::from),
    }
}
