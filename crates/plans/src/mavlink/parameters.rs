//! What becomes of each parameter of the commands that something is done for: one table for items of missions, guided
//! items, COMMAND_LONG and COMMAND_INT. [`account`] goes through the seven parameters of a command.
//!
//! A parameter asks for nothing while it is not a number, or has one of its neutral values. Otherwise it is done, or
//! named in a text, or the command is refused. One that has no row in the table is named by its number.

use super::{MissionItem, command};

/// What becomes of a parameter that asks for something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// It is this: the reader of its command does it, or refuses the command. An infinite one is refused.
    Done(&'static str),
    /// It asks for this, with its value for `{}`, which is not done.
    Named(&'static str),
    /// It asks for a heading, which is not done: the path is the same.
    Heading,
    /// It asks for this, with its value for `{}`: without it something else would be done, so the command is refused.
    Refused(&'static str),
}

use Parameter::{Done, Heading, Named, Refused};

/// The value of a parameter that asks for nothing, beside not a number.
const ZERO: &[f64] = &[0.0];

/// A row: the command, the number of the parameter, what becomes of it, and its neutral values.
pub type ParameterRow = (u16, u8, Parameter, &'static [f64]);

/// Commands of which one place or another is read.
const LATITUDE: Parameter = Done("latitude");
const LONGITUDE: Parameter = Done("longitude");
const ALTITUDE: Parameter = Done("altitude");

/// All rows, by command.
#[rustfmt::skip]
pub const PARAMETERS: &[ParameterRow] = &[
    (command::WAYPOINT, 1, Done("hover, s"), ZERO),
    (command::WAYPOINT, 2, Named("an acceptance radius of {} m"), ZERO),
    (command::WAYPOINT, 3, Named("a pass at {} m"), ZERO),
    (command::WAYPOINT, 4, Heading, ZERO),
    (command::WAYPOINT, 5, LATITUDE, ZERO),
    (command::WAYPOINT, 6, LONGITUDE, ZERO),
    (command::WAYPOINT, 7, ALTITUDE, ZERO),
    (command::LOITER_UNLIMITED, 3, Named("a radius of {} m"), ZERO),
    (command::LOITER_UNLIMITED, 4, Heading, ZERO),
    (command::LOITER_UNLIMITED, 5, LATITUDE, ZERO),
    (command::LOITER_UNLIMITED, 6, LONGITUDE, ZERO),
    (command::LOITER_UNLIMITED, 7, ALTITUDE, ZERO),
    (command::LOITER_TIME, 1, Done("hover, s"), ZERO),
    // What QGroundControl writes for a helicopter, too, which has no circle to leave.
    (command::LOITER_TIME, 2, Named("the turn {} towards the next item"), &[0.0, 1.0]),
    (command::LOITER_TIME, 3, Named("a radius of {} m"), ZERO),
    (command::LOITER_TIME, 4, Heading, ZERO),
    (command::LOITER_TIME, 5, LATITUDE, ZERO),
    (command::LOITER_TIME, 6, LONGITUDE, ZERO),
    (command::LOITER_TIME, 7, ALTITUDE, ZERO),
    (command::RETURN_TO_LAUNCH, 1, Named("parameter 1 = {}"), ZERO),
    (command::LAND, 1, Named("an abort altitude of {} m"), ZERO),
    (command::LAND, 2, Named("the precision landing mode {}"), ZERO),
    (command::LAND, 4, Heading, ZERO),
    (command::LAND, 5, LATITUDE, ZERO),
    (command::LAND, 6, LONGITUDE, ZERO),
    (command::LAND, 7, Named("an altitude of {} m"), ZERO),
    // 15 is what QGroundControl writes into plans, and -1 into commands.
    (command::TAKE_OFF, 1, Named("a pitch of {} degrees"), &[0.0, -1.0, 15.0]),
    (command::TAKE_OFF, 3, Named("the flags {}"), ZERO),
    (command::TAKE_OFF, 4, Heading, ZERO),
    (command::TAKE_OFF, 5, LATITUDE, ZERO),
    (command::TAKE_OFF, 6, LONGITUDE, ZERO),
    (command::TAKE_OFF, 7, ALTITUDE, &[]),
    (command::DELAY, 1, Done("hover, s"), ZERO),
    (command::DELAY, 2, Done("hour"), &[0.0, -1.0]),
    (command::DELAY, 3, Done("minute"), &[0.0, -1.0]),
    (command::DELAY, 4, Done("second"), &[0.0, -1.0]),
    (command::SET_MODE, 1, Done("flags of the base mode"), ZERO),
    (command::SET_MODE, 2, Done("main mode"), &[]),
    (command::SET_MODE, 3, Done("sub mode"), ZERO),
    (command::CHANGE_SPEED, 1, Done("type 0 or 1"), ZERO),
    (command::CHANGE_SPEED, 2, Done("speed, m/s"), &[]),
    (command::CHANGE_SPEED, 3, Named("a throttle of {} %"), &[0.0, -1.0, -2.0]),
    (command::CHANGE_SPEED, 4, Refused("a speed relative to the present one"), ZERO),
    (command::SET_HOME, 1, Done("1 for the present place"), ZERO),
    (command::SET_HOME, 2, Named("a roll of {} degrees"), ZERO),
    (command::SET_HOME, 3, Named("a pitch of {} degrees"), ZERO),
    (command::SET_HOME, 4, Heading, ZERO),
    (command::SET_HOME, 5, LATITUDE, ZERO),
    (command::SET_HOME, 6, LONGITUDE, ZERO),
    (command::SET_HOME, 7, ALTITUDE, ZERO),
    (command::REPOSITION, 1, Refused("{} m/s: set the speed before, by DO_CHANGE_SPEED"), &[0.0, -1.0]),
    // The mode changes in any case.
    (command::REPOSITION, 2, Named("the flags {}"), &[0.0, 1.0]),
    (command::REPOSITION, 3, Named("a radius of {} m"), ZERO),
    (command::REPOSITION, 4, Heading, &[]),
    (command::REPOSITION, 5, LATITUDE, &[]),
    (command::REPOSITION, 6, LONGITUDE, &[]),
    (command::REPOSITION, 7, ALTITUDE, &[]),
    (command::PAUSE_CONTINUE, 1, Done("0 to hold, 1 to go on"), &[]),
    (command::SET_MISSION_CURRENT, 1, Done("item"), &[]),
    (command::SET_MISSION_CURRENT, 2, Named("a reset of the mission"), ZERO),
    (command::SET_STANDARD_MODE, 1, Done("mode"), &[]),
    (command::MISSION_START, 1, Done("first item, 0 for the next one"), ZERO),
    (command::MISSION_START, 2, Refused("an end at item {}, and it is flown to its last one"), ZERO),
    (command::ARM_DISARM, 1, Done("1 to arm, 0 to disarm"), &[]),
    (command::ARM_DISARM, 2, Named("force ({})"), ZERO),
    (command::GET_HOME_POSITION, 1, Named("parameter 1 = {}"), ZERO),
    (command::GET_MESSAGE_INTERVAL, 1, Done("message"), &[]),
    (command::SET_MESSAGE_INTERVAL, 1, Done("message"), &[]),
    (command::SET_MESSAGE_INTERVAL, 2, Done("interval, µs"), ZERO),
    (command::SET_MESSAGE_INTERVAL, 7, Named("an answer to others ({})"), &[0.0, 1.0]),
    (command::REQUEST_MESSAGE, 1, Done("message"), &[]),
    (command::REQUEST_MESSAGE, 2, Done("which one, of AVAILABLE_MODES"), ZERO),
    (command::REQUEST_MESSAGE, 7, Named("an answer to others ({})"), &[0.0, 1.0]),
    (command::REQUEST_CAPABILITIES, 1, Named("parameter 1 = {}"), &[0.0, 1.0]),
    (command::FENCE_INSIDE_POLYGON, 1, Done("corners of the area"), &[]),
    (command::FENCE_INSIDE_POLYGON, 2, Refused("the inclusion group {}"), ZERO),
    (command::FENCE_INSIDE_POLYGON, 5, LATITUDE, &[]),
    (command::FENCE_INSIDE_POLYGON, 6, LONGITUDE, &[]),
    (command::FENCE_OUTSIDE_POLYGON, 1, Done("corners of the area"), &[]),
    (command::FENCE_OUTSIDE_POLYGON, 5, LATITUDE, &[]),
    (command::FENCE_OUTSIDE_POLYGON, 6, LONGITUDE, &[]),
    (command::FENCE_INSIDE_CIRCLE, 1, Done("radius, m"), &[]),
    (command::FENCE_INSIDE_CIRCLE, 2, Refused("the inclusion group {}"), ZERO),
    (command::FENCE_INSIDE_CIRCLE, 5, LATITUDE, &[]),
    (command::FENCE_INSIDE_CIRCLE, 6, LONGITUDE, &[]),
    (command::FENCE_OUTSIDE_CIRCLE, 1, Done("radius, m"), &[]),
    (command::FENCE_OUTSIDE_CIRCLE, 5, LATITUDE, &[]),
    (command::FENCE_OUTSIDE_CIRCLE, 6, LONGITUDE, &[]),
];

/// What a command asks for beside what its reader does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Account {
    /// What is not done, in words, and whether it is a heading.
    pub named: Vec<(String, bool)>,
    /// The number of the first parameter for which the command is refused, and what it asks for.
    pub refused: Option<(u8, String)>,
}

/// What becomes of a parameter of a command, and its neutral values; `None` if nothing is done for the command.
pub fn parameter(command: u16, number: u8) -> Option<(Parameter, &'static [f64])> {
    let of_command = || PARAMETERS.iter().filter(|row| row.0 == command);
    of_command().next()?;
    let row = of_command().find(|row| row.1 == number);
    let named = UNLISTED[usize::from(number) - 1];
    Some(row.map_or((Named(named), ZERO), |row| (row.2, row.3)))
}

/// What a parameter without a row asks for.
const UNLISTED: [&str; 7] = [
    "parameter 1 = {}",
    "parameter 2 = {}",
    "parameter 3 = {}",
    "parameter 4 = {}",
    "parameter 5 = {}",
    "parameter 6 = {}",
    "parameter 7 = {}",
];

/// Goes through the parameters of a command.
pub fn account(item: &MissionItem) -> Account {
    let mut account = Account::default();
    for (number, value) in (1..).zip(item.params) {
        let Some((what, neutral)) = parameter(item.command, number) else {
            break;
        };
        if value.is_nan() || neutral.contains(&value) {
            continue;
        }
        let words = |words: &str| words.replace("{}", &value.to_string());
        let refused = match what {
            Named(text) => {
                account.named.push((words(text), false));
                None
            }
            Heading => {
                account.named.push((words("the heading {} degrees"), true));
                None
            }
            Done(text) if value.is_infinite() => Some(format!("{value} as {text}")),
            Done(_) => None,
            Refused(text) => Some(words(text)),
        };
        if account.refused.is_none() {
            account.refused = refused.map(|text| (number, text));
        }
    }
    account
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_is_done_or_named_or_refused_unless_it_asks_for_nothing() {
        for (index, row) in PARAMETERS.iter().enumerate() {
            let (command, number, what, neutral) = *row;
            assert!((1..=7).contains(&number));
            let is_twice = |other: &&ParameterRow| (other.0, other.1) == (command, number);
            assert_eq!(PARAMETERS[..index].iter().find(is_twice), None);
            let with = |value| {
                let mut params = [f64::NAN; 7];
                params[usize::from(number) - 1] = value;
                account(&MissionItem {
                    frame: 3,
                    command,
                    params,
                    auto_continue: true,
                })
            };
            assert_eq!(with(f64::NAN), Account::default(), "{row:?}");
            for value in neutral {
                assert_eq!(with(*value), Account::default(), "{row:?}, {value}");
            }
            for value in [7.25, -3.0, f64::INFINITY] {
                let account = with(value);
                let is_done = matches!(what, Done(_)) && value.is_finite();
                assert_eq!(account == Account::default(), is_done, "{row:?}, {value}");
                assert!(account.named.is_empty() || account.refused.is_none());
            }
        }
        // One without a row is named by its number, and a command that nothing is done for has no parameters.
        let of = |command| {
            let params = [0.0, 0.0, 0.0, 0.0, 0.0, 5.5, 0.0];
            account(&MissionItem {
                frame: 3,
                command,
                params,
                auto_continue: true,
            })
        };
        assert_eq!(of(20).named, [("parameter 6 = 5.5".to_owned(), false)]);
        assert_eq!(of(206), Account::default());
    }

    /// The row of a command in the table of docs/mavlink.md.
    fn row(command: u16) -> String {
        let rows = || PARAMETERS.iter().filter(|row| row.0 == command);
        let cell = |is_in: fn(&Parameter) -> bool| {
            let entry = |(_, number, what, neutral): &ParameterRow| {
                let text = match what {
                    Done(text) | Named(text) | Refused(text) => text.replace("{}", "…"),
                    Heading => "the heading".to_owned(),
                };
                let others = neutral.iter().filter(|value| **value != 0.0);
                let others: Vec<String> = others.map(f64::to_string).collect();
                let but = match others.is_empty() || is_in(&Done("")) {
                    true => String::new(),
                    false => format!(" (but for {})", others.join(", ")),
                };
                format!("{number}: {text}{but}")
            };
            let listed = rows().filter(|row| is_in(&row.2));
            let listed = listed.filter(|row| row.2 != Named(UNLISTED[usize::from(row.1) - 1]));
            let text = listed.map(entry).collect::<Vec<_>>().join("; ");
            if text.is_empty() {
                " ".to_owned()
            } else {
                format!(" {text} ")
            }
        };
        let done = cell(|what| matches!(what, Done(_)));
        let named = cell(|what| matches!(what, Named(_) | Heading));
        let refused = cell(|what| matches!(what, Refused(_)));
        let name = super::super::names::command_name(command);
        format!("| {name} |{done}|{named}|{refused}|")
    }

    #[test]
    fn the_document_has_this_table() {
        let document = include_str!("../../../../docs/mavlink.md");
        let mut commands: Vec<u16> = PARAMETERS.iter().map(|row| row.0).collect();
        commands.dedup();
        let expected: Vec<String> = commands.into_iter().map(row).collect();
        let expected = expected.join("\n");
        assert!(
            document.contains(&expected),
            "docs/mavlink.md should have:\n{expected}"
        );
    }
}
