//! [`decide`]: what a command asks for, as the helicopter is now. Nothing is changed here.
//!
//! What a command means is read by [`Meaning`], as an item of a mission is. `judge` beside it: what the helicopter, as
//! it is, does for that; `decision`: the values.

mod decision;
mod judge;

use plans::mavlink::parameters::account;
use plans::mavlink::{MissionItem, command_name};
use plans::meaning::Meaning;
use plans::model::Action;

use self::decision::refuse;
pub use self::decision::{Decision, MissionAsk, OrderPair};
pub use self::judge::VehicleFacts;
use crate::event::OrderKind;
use crate::mode::Mode;
use crate::number::{MavResult, command};

/// What is to be done, and what of the command is not.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedCommand {
    pub decision: Decision,
    /// What is done otherwise than asked, to be told when something is done.
    pub notices: Vec<String>,
}

impl From<Decision> for JudgedCommand {
    fn from(decision: Decision) -> JudgedCommand {
        JudgedCommand {
            decision,
            notices: Vec::new(),
        }
    }
}

/// What people call what a command asks for; `None` if it is not offered.
fn called(item: &MissionItem) -> Option<&'static str> {
    Some(match item.command {
        command::ARM_DISARM if item.params[0] == 0.0 => "disarm",
        command::ARM_DISARM => "arm",
        command::TAKE_OFF => "take-off",
        command::LAND => "land",
        command::RETURN_TO_LAUNCH => "return",
        command::REPOSITION => "goto",
        command::PAUSE_CONTINUE => "pause",
        command::MISSION_START | command::SET_MISSION_CURRENT => "the mission",
        command::SET_MODE | command::SET_STANDARD_MODE => "the mode",
        command::CHANGE_SPEED => "speed",
        command::SET_HOME => "home",
        _ => return None,
    })
}

/// What a command asks for, as the helicopter is now. Commands that only ask for messages are judged elsewhere.
pub fn decide(asked: &MissionItem, facts: &VehicleFacts<'_>) -> JudgedCommand {
    if matches!(
        asked.command,
        command::FLIGHT_TERMINATION | command::REBOOT | command::FENCE_ENABLE
    ) {
        let text = format!("{} is never done over MAVLink", command_name(asked.command));
        return refuse(MavResult::Denied, text).into();
    }
    let Some(name) = called(asked) else {
        let text = format!("{} is not offered", command_name(asked.command));
        return refuse(MavResult::Unsupported, text).into();
    };
    with_notices(asked, name, |notices| {
        decide_command(asked, name, facts, notices)
    })
}

/// What the parameters ask for that is not done stands beside the decision; a command that asks for something without
/// which it would be another one is refused.
fn with_notices(
    asked: &MissionItem,
    name: &str,
    decide: impl FnOnce(&mut Vec<String>) -> Decision,
) -> JudgedCommand {
    let account = account(asked);
    if let Some((_, what)) = account.refused {
        let text = format!("{name} was refused: it asks for {what}");
        return refuse(MavResult::Denied, text).into();
    }
    let not_done = |(what, _)| format!("{name}: {what} is not done");
    let mut notices = account.named.into_iter().map(not_done).collect();
    let decision = decide(&mut notices);
    JudgedCommand { decision, notices }
}

fn decide_command(
    asked: &MissionItem,
    name: &str,
    facts: &VehicleFacts<'_>,
    notices: &mut Vec<String>,
) -> Decision {
    let first = asked.params[0];
    match asked.command {
        command::ARM_DISARM => match first {
            1.0 => facts.arm(),
            0.0 => facts.disarm(),
            _ => refuse(MavResult::Denied, "arm: param1 is 0 or 1"),
        },
        command::TAKE_OFF
        | command::LAND
        | command::RETURN_TO_LAUNCH
        | command::REPOSITION
        | command::CHANGE_SPEED => match Meaning::of_command(asked) {
            Ok(meaning) => facts.act(&meaning.action, name, notices),
            Err(why) => refuse(MavResult::Denied, format!("{name} was refused: {why}")),
        },
        command::SET_HOME => facts.set_home(asked, notices),
        command::PAUSE_CONTINUE => match first {
            0.0 => OrderPair::one(OrderKind::Hold),
            1.0 => MISSION_GOES_ON,
            _ => refuse(MavResult::Denied, "pause: param1 is 0 or 1"),
        },
        command::MISSION_START => match whole(first) {
            // 0 where the station means "go on".
            None if first.is_nan() => mission_start(0),
            Some(first) => mission_start(first),
            None => no_such_item(),
        },
        command::SET_MISSION_CURRENT => match whole(first) {
            Some(number) => Decision::Mission(MissionAsk::SetCurrent(number)),
            None => no_such_item(),
        },
        command::SET_MODE => {
            let [base, main, sub, ..] = asked.params;
            // The other flags say how a vehicle is, and stations repeat them.
            let has_custom = (0.0..=255.0).contains(&base) && base % 2.0 == 1.0;
            match has_custom || base == 0.0 || base.is_nan() {
                true => decide_mode(custom_of(main, sub), facts),
                false => refuse(
                    MavResult::Denied,
                    format!(
                        "the mode was refused: its flags are {base}, and 1 is that of a mode by number"
                    ),
                ),
            }
        }
        _ => {
            let mode = Mode::ALL
                .into_iter()
                .find(|mode| mode.standard() != 0 && f64::from(mode.standard()) == first);
            decide_mode(mode.map_or(0, Mode::custom), facts)
        }
    }
}

/// What an item asks for that a station sends to be flown to at once: `current` is 2, or 3 for a change of the height
/// alone.
pub fn decide_guided(asked: &MissionItem, current: u8, facts: &VehicleFacts<'_>) -> JudgedCommand {
    if asked.command != command::WAYPOINT {
        let text = format!(
            "{} is not done at once, by current = {current}: send it as a command",
            command_name(asked.command)
        );
        return refuse(MavResult::Unsupported, text).into();
    }
    with_notices(asked, "goto", |notices| {
        let hover_s = asked.params[0];
        if hover_s.abs() > 0.0 {
            notices.push(format!(
                "goto: an end of the hover after {hover_s} s is not done: another order ends it"
            ));
        }
        let action = match (Meaning::of(asked), Meaning::place(asked)) {
            (_, Ok((position, Some(altitude)))) if current == 3 => {
                if let Some(place) = position {
                    notices.push(format!(
                        "goto: the place {}, {} is not flown to: by current = 3 the height alone changes",
                        place.latitude_deg, place.longitude_deg
                    ));
                }
                Ok(Action::Hold {
                    position: None,
                    altitude: Some(altitude),
                    duration_s: None,
                })
            }
            (Ok(meaning), _) => Ok(meaning.action),
            (Err(why), _) => Err(why),
        };
        match action {
            Ok(action) => facts.act(&action, "goto", notices),
            Err(why) => refuse(MavResult::Denied, format!("goto was refused: {why}")),
        }
    })
}

/// What a mode asks for.
pub fn decide_mode(custom: u32, facts: &VehicleFacts<'_>) -> Decision {
    match Mode::of_custom(custom) {
        Ok(Mode::Hold) => OrderPair::one(OrderKind::Hold),
        Ok(Mode::Land) => facts.land_here(),
        Ok(Mode::Mission) => MISSION_GOES_ON,
        Ok(Mode::Return) => facts.go_home(),
        Ok(mode) => {
            let text = format!(
                "mode {} cannot be chosen: it shows what is done",
                mode.name()
            );
            refuse(MavResult::Denied, text)
        }
        Err(name) => refuse(MavResult::Denied, format!("{name}: there is no such mode")),
    }
}

/// Main mode and sub mode apart, as MAVSDK sends them, or the whole number, as scripts do.
fn custom_of(main: f64, sub: f64) -> u32 {
    let sub = if sub.is_nan() { 0.0 } else { sub };
    match main {
        main if main >= 65_536.0 && sub == 0.0 => main as u32,
        // A number that is none of these two is no mode.
        main if !(0.0..256.0).contains(&main) || !(0.0..256.0).contains(&sub) => 0,
        main if main.fract() != 0.0 || sub.fract() != 0.0 => 0,
        main => (sub as u32) << 24 | (main as u32) << 16,
    }
}

const MISSION_GOES_ON: Decision = Decision::Mission(MissionAsk::Start {
    first: None,
    arms: false,
});

fn mission_start(first: u16) -> Decision {
    let first = (first > 0).then_some(first);
    Decision::Mission(MissionAsk::Start { first, arms: true })
}

/// The number of an item.
fn whole(number: f64) -> Option<u16> {
    let is_number = (0.0..65_535.0).contains(&number) && number.fract() == 0.0;
    is_number.then_some(number as u16)
}

fn no_such_item() -> Decision {
    let text = "the mission was refused: there is no such item";
    refuse(MavResult::Denied, text)
}
