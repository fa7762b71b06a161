//! What `ril wait` waits for. [`Condition`]: something about a robot that is so or not, judged by the newest samples
//! and the time.
//!
//! A sample that is not of the present fulfils nothing: a robot that is gone has not landed.

#[cfg(test)]
mod tests;

use std::fmt;

use ipc_types::code::{Functionality, LinkState};
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, Schema, TelemetryGroup};
use operator::options::with_point;
use operator::render::fields::{Selection, Tree};
use operator::robot::freshness::is_present;

/// A helicopter that is slower than this over ground, and that climbs and sinks more slowly, hovers, m/s. Gusts move
/// one that stays in its place by some tenths of that.
const HOVER_MPS: f32 = 0.5;

/// What is so, or is not.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// What the operator wrote.
    text: String,
    kind: ConditionKind,
}

#[derive(Clone, Debug, PartialEq)]
enum ConditionKind {
    Up,
    Landed,
    Flying,
    Hovering,
    Compare(Comparison),
}

/// A field of the robot's telemetry beside a value.
#[derive(Clone, Debug, PartialEq)]
struct Comparison {
    selection: Selection,
    /// From the field's unit to the one that is compared.
    factor: f64,
    unit: &'static str,
    operator: Operator,
    value: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operator {
    Greater,
    AtLeast,
    Less,
    AtMost,
    Equal,
    Unequal,
}

/// Operators as they are written; of two that begin alike, the longer one first.
const OPERATORS: [(&str, Operator); 7] = [
    (">=", Operator::AtLeast),
    ("<=", Operator::AtMost),
    ("!=", Operator::Unequal),
    ("==", Operator::Equal),
    (">", Operator::Greater),
    ("<", Operator::Less),
    ("=", Operator::Equal),
];

/// A short name of a field.
struct Short {
    name: &'static str,
    field: &'static str,
    factor: f64,
    unit: &'static str,
}

const DEG_PER_RAD: f64 = 180.0 / std::f64::consts::PI;

const SHORT: [Short; 8] = [
    Short::new("altitude", "geodetic.altitude_m", 1.0, "m"),
    Short::new("speed", "velocity.ground_speed_mps", 1.0, "m/s"),
    Short::new("climb", "velocity.up_mps", 1.0, "m/s"),
    Short::new("battery", "supply.battery_v", 1.0, "V"),
    Short::new("fuel", "supply.fuel_fraction", 100.0, "%"),
    Short::new("heading", "attitude.yaw_rad", DEG_PER_RAD, "deg"),
    Short::new("fix", "gps_quality", 1.0, ""),
    Short::new("height", "sonar_height_m", 1.0, "m"),
];

impl Short {
    const fn new(
        name: &'static str,
        field: &'static str,
        factor: f64,
        unit: &'static str,
    ) -> Short {
        Short {
            name,
            field,
            factor,
            unit,
        }
    }
}

/// Units by the end of a field's name.
const UNITS: [(&str, &str); 7] = [
    ("_mps2", "m/s2"),
    ("_mps", "m/s"),
    ("_deg", "deg"),
    ("_rad", "rad"),
    ("_m", "m"),
    ("_v", "V"),
    ("_s", "s"),
];

/// The newest samples of a robot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Newest<'a> {
    /// State of bridge and link.
    pub state: Option<&'a ModuleState>,
    /// Telemetry.
    pub hero: Option<&'a HeroTelemetry>,
}

/// How a condition is now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Whether it is fulfilled.
    pub is_met: bool,
    /// How things are, in words.
    pub value: String,
}

impl Condition {
    /// Reads a condition.
    ///
    /// # Errors
    ///
    /// What is wrong with it, and what may have been meant.
    pub fn parse(text: &str) -> Result<Condition, String> {
        let kind = match text.trim() {
            "up" => ConditionKind::Up,
            "landed" => ConditionKind::Landed,
            "flying" => ConditionKind::Flying,
            "hovering" => ConditionKind::Hovering,
            other => ConditionKind::Compare(Comparison::parse(other)?),
        };
        Ok(Condition {
            text: text.trim().to_owned(),
            kind,
        })
    }

    /// How things are while it is not fulfilled: `battery is 24.8 V (battery<22.5V)`, `not landed (flying)`.
    pub fn unmet(&self, standing: &Standing) -> String {
        let (text, value) = (&self.text, &standing.value);
        let is_number = value.starts_with(|first: char| first.is_ascii_digit() || first == '-');
        let name = text.split(['>', '<', '=', '!']).next().unwrap_or_default();
        match (&self.kind, is_number) {
            (ConditionKind::Compare(_), true) => format!("{} is {value} ({text})", name.trim()),
            (ConditionKind::Compare(_), false) => format!("{text} ({value})"),
            _ => format!("not {text} ({value})"),
        }
    }

    /// Whether it needs the state of the bridge.
    pub fn needs_state(&self) -> bool {
        matches!(self.kind, ConditionKind::Up | ConditionKind::Hovering)
    }

    /// Whether it needs the robot's telemetry.
    pub fn needs_telemetry(&self) -> bool {
        !matches!(self.kind, ConditionKind::Up)
    }

    /// How it is at `now`.
    pub fn judge(&self, newest: &Newest<'_>, now: MonotonicNs) -> Standing {
        let judged = match &self.kind {
            ConditionKind::Up => up(newest, now),
            ConditionKind::Landed => {
                telemetry(newest, now).map(|hero| flight(hero, hero.flying == 0))
            }
            ConditionKind::Flying => {
                telemetry(newest, now).map(|hero| flight(hero, hero.flying == 1))
            }
            ConditionKind::Hovering => hovering(newest, now),
            ConditionKind::Compare(comparison) => {
                telemetry(newest, now).and_then(|hero| comparison.judge(hero))
            }
        };
        judged.unwrap_or_else(|why| Standing {
            is_met: false,
            value: why,
        })
    }
}

/// The condition in the operator's own words.
impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

fn state<'a>(newest: &Newest<'a>, now: MonotonicNs) -> Result<&'a ModuleState, String> {
    match newest.state {
        None => Err("no state of the bridge".to_owned()),
        Some(state) if !is_present(state.published(), now) => {
            Err("the bridge's state is old".to_owned())
        }
        Some(state) => Ok(state),
    }
}

fn telemetry<'a>(newest: &Newest<'a>, now: MonotonicNs) -> Result<&'a HeroTelemetry, String> {
    match newest.hero {
        None => Err("no telemetry".to_owned()),
        Some(hero) if !is_present(hero.received(), now) => Err("the telemetry is old".to_owned()),
        Some(hero) => Ok(hero),
    }
}

fn up(newest: &Newest<'_>, now: MonotonicNs) -> Result<Standing, String> {
    let link = state(newest, now)?.link.state();
    Ok(Standing {
        is_met: link == Some(LinkState::Up),
        value: link.map_or_else(
            || "an unknown state".to_owned(),
            |link| format!("link {link}"),
        ),
    })
}

fn flight(hero: &HeroTelemetry, is_met: bool) -> Standing {
    let value = if hero.flying == 1 {
        "flying"
    } else {
        "on the ground"
    };
    Standing {
        is_met,
        value: value.to_owned(),
    }
}

fn hovering(newest: &Newest<'_>, now: MonotonicNs) -> Result<Standing, String> {
    let (state, hero) = (state(newest, now)?, telemetry(newest, now)?);
    if hero.flying != 1 {
        return Ok(flight(hero, false));
    }
    if !hero.valid(TelemetryGroup::GpsVelocity) {
        return Err("the DSP sends no velocity".to_owned());
    }
    let doing = Functionality::from_code(state.functionality);
    let is_at_rest = matches!(doing, Some(Functionality::AtRest | Functionality::Holding));
    let (speed, climb) = (hero.velocity.ground_speed_mps, hero.velocity.up_mps);
    let doing = doing.map_or_else(
        || "an unknown movement".to_owned(),
        |doing| doing.to_string(),
    );
    Ok(Standing {
        is_met: is_at_rest && speed < HOVER_MPS && climb.abs() < HOVER_MPS,
        value: format!("{doing}, {speed:.1} m/s over ground, {climb:.1} m/s upwards"),
    })
}

impl Comparison {
    fn parse(text: &str) -> Result<Comparison, String> {
        let place = text.find(['>', '<', '=', '!']);
        let Some((name, rest)) = place.map(|place| text.split_at(place)) else {
            let words = ["up", "landed", "flying", "hovering"];
            let near = runtime::config::nearest(text, words);
            return Err(match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => "a condition is up, landed, flying, hovering, or a comparison such as \"altitude>20\"".to_owned(),
            });
        };
        let operator = OPERATORS.iter().find(|(sign, _)| rest.starts_with(sign));
        let Some((sign, operator)) = operator else {
            return Err("an operator is >, >=, <, <=, = or !=".to_owned());
        };
        let (field, factor, unit) = field(name.trim());
        let selection = select(field)?;
        Ok(Comparison {
            selection,
            factor,
            unit,
            operator: *operator,
            value: number(rest[sign.len()..].trim(), unit)?,
        })
    }

    fn judge(&self, hero: &HeroTelemetry) -> Result<Standing, String> {
        let tree = Tree::of(hero, &self.selection);
        let fields = tree.plain_fields();
        let value = fields.first().and_then(|(_, value)| value.as_f64());
        let Some(value) = value else {
            return Err("no value: the DSP does not send its group".to_owned());
        };
        let value = value * self.factor;
        let wanted = self.value;
        let is_met = match self.operator {
            Operator::Greater => value > wanted,
            Operator::AtLeast => value >= wanted,
            Operator::Less => value < wanted,
            Operator::AtMost => value <= wanted,
            Operator::Equal => value == wanted,
            Operator::Unequal => value != wanted,
        };
        let unit = self.unit;
        let space = if unit.is_empty() { "" } else { " " };
        // Three digits are more than any sensor of the helicopter has, but for places.
        let digits = if unit == "deg" { 7 } else { 3 };
        let text = format!("{value:.digits$}");
        let text = match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.'),
            false => &text,
        };
        Ok(Standing {
            is_met,
            value: format!("{text}{space}{unit}"),
        })
    }
}

/// Field, factor and unit that `name` stands for.
fn field(name: &str) -> (&str, f64, &'static str) {
    if let Some(short) = SHORT.iter().find(|short| short.name == name) {
        return (short.field, short.factor, short.unit);
    }
    let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
    (name, 1.0, unit.map_or("", |(_, unit)| unit))
}

/// The one number that `field` names.
fn select(field: &str) -> Result<Selection, String> {
    let schema = Schema::of::<HeroTelemetry>();
    let selection = Selection::of(&schema, &[field.to_owned()]).map_err(|error| {
        // A short name is one plain word.
        let short = SHORT.iter().filter(|_| !field.contains(['_', '.']));
        match runtime::config::nearest(field, short.map(|short| short.name)) {
            Some(near) => format!("there is no field `{field}`; did you mean `{near}`?"),
            None => error.to_string(),
        }
    })?;
    if !selection.is_number(&schema) {
        return Err(format!(
            "`{field}` is not one number; `ril topic info hero` lists the fields"
        ));
    }
    Ok(selection)
}

/// A number with or without `unit`.
fn number(text: &str, unit: &str) -> Result<f64, String> {
    let bare = text.strip_suffix(unit).unwrap_or(text).trim();
    match bare.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ if with_point(bare).is_some() => {
            let fixed = with_point(bare).unwrap_or_default();
            Err(format!("`{text}` has a decimal comma: write {fixed}"))
        }
        _ if unit.is_empty() => Err(format!("`{text}` is not a number")),
        _ => Err(format!(
            "`{text}` is not a number of {unit}, such as 20 or 20{unit}"
        )),
    }
}
