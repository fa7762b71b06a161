//! [`ParameterSubscriptions`]: the values that clients are shown. They are kept here because Lichtblick asks for all every 15 s, and a DSP's are read
//! one after the other over its serial line.

use std::collections::BTreeMap;

use serde_json::Value;

use super::message::Parameter;

/// Most parameters: 64 of 32 robots. Further ones are not kept.
pub const MAX_PARAMETERS: usize = 2048;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct ParameterSubscriptions {
    values: BTreeMap<String, Value>,
}

impl ParameterSubscriptions {
    /// Takes a value; `None` for a parameter that is gone. False if it is what is known, or there are too many.
    pub fn set(&mut self, name: &str, value: Option<Value>) -> bool {
        let Some(value) = value else {
            return self.values.remove(name).is_some();
        };
        let is_known = self.values.contains_key(name);
        if !is_known && self.values.len() >= MAX_PARAMETERS {
            return false;
        }
        self.values.insert(name.to_owned(), value.clone()) != Some(value)
    }

    /// Whether there is one of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.values.contains_key(name)
    }

    /// One as clients get it; without a value if it is gone.
    pub fn get(&self, name: &str) -> Parameter {
        let value = self.values.get(name);
        // JavaScript writes 3.0 as 3: without this a client could not set the number with a fraction that it is.
        let is_fraction = value.is_some_and(Value::is_f64);
        Parameter {
            name: name.to_owned(),
            value: value.cloned(),
            kind: is_fraction.then(|| "float64".to_owned()),
        }
    }

    /// Those of these names that there are; all if no name is given.
    pub fn find(&self, names: &[String]) -> Vec<Parameter> {
        match names {
            [] => self.values.keys().map(|name| self.get(name)).collect(),
            names => names
                .iter()
                .filter(|name| self.contains(name))
                .map(|name| self.get(name))
                .collect(),
        }
    }
}
