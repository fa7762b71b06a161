//! Whether a mission can be flown, by the code of `ril plan check`, and what stations are told when it cannot.

use bridge::BridgeConfig;
use dsp_protocol::{Waypoint, port};
use ipc_types::payload::WaypointPosition;
use plans::Plan;
use plans::check::{check, configured};
use plans::finding::effect;
use plans::flight::Flight;
use plans::mavlink::parameters::account;
use plans::mavlink::{FRAME_MISSION, FRAMES_HOME, FRAMES_SEA, command};
use plans::meaning::Meaning;
use plans::model::OtherKind;
use plans::site::{Endurance, HomeSource, Site, Start};
use runtime::finding::Finding;

use super::store::{Item, Mission};
use crate::home::Home;
use crate::number::{MissionRefusal, MissionResult};
use crate::settings::Settings;

/// Most remarks about what is not done of a mission that can be flown and leaves the path as it is, such as a camera;
/// stations show each in its own line.
const MAX_REMARKS: usize = 4;

/// Most remarks about what makes the flight another one than asked: so many different ones are in no mission that
/// people make.
const MAX_FLIGHT_REMARKS: usize = 24;

/// Most items that a text names.
const MAX_NUMBERS: usize = 6;

/// Where a mission is to be flown, and by which rules.
#[derive(Clone, Copy, Debug)]
pub struct Conditions<'a> {
    pub settings: &'a Settings,
    /// The configuration of the bridge; `None` if it is not known.
    pub rules: Option<&'a BridgeConfig>,
    pub home: &'a Home,
    /// Where the helicopter is, and whether it flies; `None` if that is not known, or does not count because nothing is
    /// flown yet.
    pub here: Option<(WaypointPosition, bool)>,
}

/// A mission that can be flown.
#[derive(Clone, Debug)]
pub struct CheckedMission {
    pub flight: Flight,
    /// What the operator should know.
    pub remarks: Vec<String>,
}

/// Checks a mission from the item `from` on, which counts from 1.
///
/// # Errors
///
/// Why it cannot be flown.
pub fn check_mission(
    mission: &Mission,
    from: u32,
    conditions: &Conditions<'_>,
) -> Result<CheckedMission, MissionRefusal> {
    let items = mission.items();
    let plan = Plan::from_items(items.iter().map(Item::read)).map_err(|error| MissionRefusal {
        result: unreadable(items),
        text: error.to_string(),
    })?;
    let site = conditions.site(&plan, from);
    let flight = Flight::new(&plan, &site);
    let of_rules = |port| conditions.rules.and_then(|rules| configured(rules, port));
    let endurance = Endurance {
        cruise_speed_mps: of_rules(port::CRUISE_SPEED_MPS),
        climb_speed_mps: of_rules(port::CLIMB_SPEED_MPS),
        ..Endurance::default()
    };
    let findings = check(&plan, &flight, &site, conditions.rules, &endurance);
    if let Some(forbids) = findings.iter().find(|one| effect(one) == "forbids") {
        return Err(MissionRefusal {
            result: result_of(forbids, items),
            text: text_of(forbids),
        });
    }
    let remarks = findings.iter().filter(|finding| {
        // How long battery and fuel last is not known here.
        effect(finding) == "warns" || finding.id == "robot-rules"
    });
    Ok(CheckedMission {
        remarks: remarks_in_order(&plan, remarks),
        flight,
    })
}

/// What changes the flight comes first, and no other remark takes its place. What does not fit is named by its items.
fn remarks_in_order<'a>(plan: &Plan, findings: impl Iterator<Item = &'a Finding>) -> Vec<String> {
    let (without_effect, of_flight): (Vec<&Finding>, Vec<&Finding>) =
        findings.partition(|finding| leaves_flight(plan, finding));
    let mut remarks = Vec::new();
    for (findings, most) in [
        (of_flight, MAX_FLIGHT_REMARKS),
        (without_effect, MAX_REMARKS),
    ] {
        let (told, rest) = findings.split_at(findings.len().min(most));
        remarks.extend(told.iter().map(|finding| text_of(finding)));
        if let [first, ..] = rest {
            let mut items: Vec<u32> = rest.iter().flat_map(|one| one.items.clone()).collect();
            items.sort_unstable();
            items.dedup();
            let text = "more that is not done; `ril plan check` names it".to_owned();
            remarks.push(text_of(&Finding {
                items,
                text,
                amount_m: None,
                ..(*first).clone()
            }));
        }
    }
    remarks
}

/// Whether a finding is about what is not done and leaves the flight as it is: a load, or a heading.
fn leaves_flight(plan: &Plan, finding: &Finding) -> bool {
    let item = |number: &u32| plan.items.get((*number as usize).wrapping_sub(1));
    let is_of_flight = |item: &plans::model::Item| {
        let mut ignored = item.ignored.iter();
        ignored.any(|one| one.kind == OtherKind::Flight && finding.text.contains(&one.text))
    };
    finding.id == "not-done" && !finding.items.iter().filter_map(item).any(is_of_flight)
}

impl Conditions<'_> {
    /// While home is not known, and nothing is flown yet, it is taken to be below the mission's first place.
    fn site(&self, plan: &Plan, from: u32) -> Site {
        let at = |position: WaypointPosition| Waypoint {
            latitude_deg: position.latitude_deg,
            longitude_deg: position.longitude_deg,
            altitude_m: position.altitude_m,
        };
        let home = self.home.known().map(at);
        let home_source = match home {
            Some(_) => HomeSource::Robot,
            None => HomeSource::Assumed,
        };
        let first = plan.items.iter().find_map(|item| item.action.position());
        let below_first = first.map(|first| Waypoint {
            latitude_deg: first.latitude_deg,
            longitude_deg: first.longitude_deg,
            altitude_m: 0.0,
        });
        let here = self.here.map(|(here, _)| at(here));
        let home = home.or(here).or(below_first).unwrap_or_default();
        Site {
            home,
            is_home_altitude_known: home_source == HomeSource::Robot,
            home_source,
            start: match self.here {
                Some((here, true)) => Start::Flying(at(here)),
                Some((here, false)) => Start::Ground(at(here)),
                None => Start::Ground(home),
            },
            zero_above_sea_m: self.settings.zero_above_sea_m,
            take_off_m: Some(self.settings.take_off_m),
            from,
            is_for_flight: self.here.is_some(),
        }
    }
}

/// Which parameter of the first item that cannot be read is no coordinate.
fn unreadable(items: &[Item]) -> MissionResult {
    let wrong = items
        .iter()
        .map(Item::read)
        .find(|item| Meaning::of(item).is_err());
    match wrong.map(|item| item.params[4].abs() <= 90.0) {
        Some(true) => MissionResult::InvalidParam6,
        _ => MissionResult::InvalidParam5,
    }
}

/// A finding in the protocol's numbers, so that stations name the parameter.
fn result_of(finding: &Finding, items: &[Item]) -> MissionResult {
    let number = finding.items.first().copied().unwrap_or(0);
    let item = items.get((number as usize).wrapping_sub(1));
    match finding.id {
        "not-possible" => item.map_or(MissionResult::Unsupported, not_possible),
        "above-terrain" | "sea-level" => MissionResult::UnsupportedFrame,
        "altitude-missing" | "altitude-range" | "take-off-altitude" | "fence-floor"
        | "fence-ceiling" | "below-take-off" => MissionResult::InvalidParam7,
        "speed" => MissionResult::InvalidParam2,
        "fence-exclusion" | "fence-inclusion" | "fence-unjudgeable" | "fence-ahead"
        | "max-distance" => MissionResult::InvalidParam5,
        "already-flying" | "not-flying" => MissionResult::InvalidSequence,
        _ => MissionResult::Invalid,
    }
}

fn not_possible(item: &Item) -> MissionResult {
    if let Some((number, _)) = account(&item.read()).refused {
        return match number {
            1 => MissionResult::InvalidParam1,
            2 => MissionResult::InvalidParam2,
            3 => MissionResult::InvalidParam3,
            4 => MissionResult::InvalidParam4,
            5 => MissionResult::InvalidParam5,
            6 => MissionResult::InvalidParam6,
            _ => MissionResult::InvalidParam7,
        };
    }
    let frame = u16::from(item.frame());
    let has_altitude = FRAMES_SEA.contains(&frame) || FRAMES_HOME.contains(&frame);
    match item.command() {
        command::WAYPOINT
        | command::TAKE_OFF
        | command::LOITER_TIME
        | command::LOITER_UNLIMITED => match has_altitude {
            true => MissionResult::InvalidParam5,
            false => MissionResult::UnsupportedFrame,
        },
        _ if has_altitude || frame == FRAME_MISSION => MissionResult::Unsupported,
        _ => MissionResult::UnsupportedFrame,
    }
}

/// A finding in one line.
fn text_of(finding: &Finding) -> String {
    let numbers: Vec<String> = finding
        .items
        .iter()
        .take(MAX_NUMBERS)
        .map(u32::to_string)
        .collect();
    let more = match finding.items.len() > MAX_NUMBERS {
        true => ", …",
        false => "",
    };
    let items = match numbers.len() {
        0 => String::new(),
        1 => format!("item {}: ", numbers[0]),
        _ => format!("items {}{more}: ", numbers.join(", ")),
    };
    let amount = finding.amount_m.filter(|amount_m| *amount_m > 0.0);
    let amount = amount.map_or(String::new(), |amount_m| format!(", by {amount_m:.1} m"));
    format!("{items}{}{amount}", finding.text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::MISSION_ITEM_INT;
    use crate::wire::MessageWriter;

    const NAN: f32 = f32::NAN;
    /// 37.4112, −6.001, which is home, and 111 m to the north of it.
    const HERE: (i32, i32) = (374_112_000, -60_010_000);
    const NORTH: (i32, i32) = (374_122_000, -60_010_000);

    fn item(command: u16, frame: u8, params: [f32; 4], (x, y): (i32, i32), z: f32) -> Item {
        let message = params
            .iter()
            .fold(MessageWriter::new(MISSION_ITEM_INT), |message, param| {
                message.f32(*param)
            });
        let message = message.i32(x).i32(y).f32(z).u16(0).u16(command).u8(1).u8(1);
        Item::of(message.u8(frame).u8(0).u8(1).u8(0).payload())
    }

    fn take_off() -> Item {
        item(22, 3, [0.0, 0.0, 0.0, NAN], (0, 0), 15.0)
    }

    fn waypoint(frame: u8, place: (i32, i32), z: f32) -> Item {
        item(16, frame, [0.0, 0.0, 0.0, NAN], place, z)
    }

    fn rules(text: &str) -> BridgeConfig {
        runtime::config::parse(text, "bridge.toml").unwrap()
    }

    fn home() -> WaypointPosition {
        WaypointPosition {
            latitude_deg: 37.4112,
            longitude_deg: -6.001,
            altitude_m: 30.0,
        }
    }

    fn checked(
        items: &[Item],
        rules: &BridgeConfig,
        here: Option<(WaypointPosition, bool)>,
    ) -> Result<CheckedMission, MissionRefusal> {
        let conditions = Conditions {
            settings: &Settings::default(),
            rules: Some(rules),
            home: &Home::Ground(home()),
            here,
        };
        check_mission(&Mission::new(items.to_vec()), 1, &conditions)
    }

    #[test]
    fn each_refusal_names_the_parameter_and_the_item() {
        use MissionResult::{
            Invalid, InvalidParam2, InvalidParam5, InvalidParam6, InvalidParam7, InvalidSequence,
            Unsupported, UnsupportedFrame,
        };
        let land = item(21, 3, [0.0, 0.0, 0.0, NAN], (0, 0), 0.0);
        let circle = item(18, 3, [2.0, 0.0, 20.0, 0.0], NORTH, 15.0);
        let speed = item(178, 2, [1.0, 50.0, -1.0, 0.0], (0, 0), 0.0);
        let camera = item(206, 2, [5.0, 0.0, 0.0, 0.0], (0, 0), 0.0);
        let fence = "[fence]\nceiling_m = 60.0\n[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\ncentre = [37.4122, -6.001]\nradius_m = 9.0\n";
        // The item after a take-off, the result, and what the text has.
        let table: [(Item, MissionResult, &str); 16] = [
            (
                waypoint(3, (0, 0), 15.0),
                InvalidParam5,
                "item 2: the helicopter cannot do NAV_WAYPOINT (16) without a position",
            ),
            (
                waypoint(3, (999_999_999, 1), 15.0),
                InvalidParam5,
                "item 2: the latitude 99.9999999",
            ),
            (
                waypoint(3, (1, 1_999_999_999), 15.0),
                InvalidParam6,
                "item 2: the longitude 199.9999999",
            ),
            // The pole is a latitude.
            (
                waypoint(3, (900_000_000, 1_999_999_999), 15.0),
                InvalidParam6,
                "item 2: the longitude 199.9999999",
            ),
            (
                waypoint(0, (0, 0), 15.0),
                InvalidParam5,
                "item 2: the helicopter cannot do NAV_WAYPOINT (16) without a position",
            ),
            (
                item(18, 1, [2.0, 0.0, 20.0, 0.0], NORTH, 15.0),
                UnsupportedFrame,
                "item 2: the helicopter cannot do NAV_LOITER_TURNS (18)",
            ),
            (
                item(18, 2, [2.0, 0.0, 20.0, 0.0], NORTH, 15.0),
                Unsupported,
                "item 2: the helicopter cannot do NAV_LOITER_TURNS (18)",
            ),
            (
                waypoint(1, NORTH, 15.0),
                UnsupportedFrame,
                "in a frame without altitude",
            ),
            (
                waypoint(10, NORTH, 15.0),
                UnsupportedFrame,
                "item 2: has an altitude above terrain",
            ),
            (
                waypoint(0, NORTH, 15.0),
                UnsupportedFrame,
                "item 2: has an altitude above sea",
            ),
            (
                waypoint(3, NORTH, NAN),
                InvalidParam7,
                "item 2: has no altitude",
            ),
            (
                waypoint(3, (384_122_000, -60_010_000), 15.0),
                InvalidParam5,
                "km from where its path begins",
            ),
            (
                circle,
                Unsupported,
                "item 2: the helicopter cannot do NAV_LOITER_TURNS (18)",
            ),
            (speed, InvalidParam2, "item 2: asks for 50 m/s"),
            (
                waypoint(3, HERE, 40.0),
                InvalidParam7,
                "above the ceiling of the robot's fence, by 10.0 m",
            ),
            (
                waypoint(3, NORTH, 15.0),
                InvalidParam5,
                "through the exclusion area `mast`",
            ),
        ];
        for (second, result, text) in table {
            let refusal = checked(&[take_off(), second], &rules(fence), None).unwrap_err();
            assert_eq!(refusal.result, result, "{}", refusal.text);
            assert!(refusal.text.contains(text), "{} / {text}", refusal.text);
        }
        let no_fence = rules("");
        let sequence = [take_off(), land, waypoint(3, NORTH, 15.0)];
        let refusal = checked(&sequence, &no_fence, None).unwrap_err();
        assert_eq!(refusal.result, InvalidSequence, "{}", refusal.text);
        let nothing = checked(&[camera], &no_fence, None).unwrap_err();
        assert_eq!(nothing.result, Invalid, "{}", nothing.text);
        let camera_too = checked(&[take_off(), camera], &no_fence, None).unwrap();
        assert!(camera_too.remarks[0].contains("DO_SET_CAM_TRIGG_DIST (206)"));
        // Rules that are not known are a remark, and a mission that is in order has none.
        for rules in [Some(&no_fence), None] {
            let conditions = Conditions {
                settings: &Settings::default(),
                rules,
                home: &Home::Ground(home()),
                here: None,
            };
            let plain = Mission::new(vec![take_off()]);
            let remarks = check_mission(&plain, 1, &conditions).unwrap().remarks;
            assert_eq!(remarks.len(), usize::from(rules.is_none()), "{remarks:?}");
        }
    }

    #[test]
    fn a_finding_is_a_line_with_its_items_and_by_how_much() {
        use runtime::finding::Severity;
        for (items, amount_m, text) in [
            (0..0, None, "too high"),
            (3..4, Some(0.0), "item 3: too high"),
            (3..5, Some(1.25), "items 3, 4: too high, by 1.2 m"),
            (3..9, Some(-1.0), "items 3, 4, 5, 6, 7, 8: too high"),
            (3..10, None, "items 3, 4, 5, 6, 7, 8, …: too high"),
        ] {
            let finding = Finding {
                items: items.collect(),
                amount_m,
                ..Finding::new(Severity::Error, "height", "too high")
            };
            assert_eq!(text_of(&finding), text);
        }
    }

    #[test]
    fn while_home_is_not_known_a_mission_is_checked_from_its_first_place_and_is_not_flown() {
        let items = [waypoint(6, NORTH, 15.0), waypoint(6, HERE, 20.0)];
        let seen = WaypointPosition {
            altitude_m: 50.0,
            ..home()
        };
        let rules = rules("");
        let mut conditions = Conditions {
            settings: &Settings::default(),
            rules: Some(&rules),
            home: &Home::Unknown,
            here: None,
        };
        let mission = Mission::new(items.to_vec());
        assert!(check_mission(&mission, 1, &conditions).is_ok());
        conditions.here = Some((seen, true));
        let refusal = check_mission(&mission, 1, &conditions).unwrap_err();
        assert!(
            refusal.text.contains("home is not known"),
            "{}",
            refusal.text
        );
    }

    #[test]
    fn a_mission_without_a_take_off_gets_one_on_the_ground() {
        use plans::flight::Step;
        let items = [waypoint(6, NORTH, 15.0)];
        let first = |here| checked(&items, &rules(""), here).unwrap().flight.steps[0].clone();
        let take_off = Step::TakeOff {
            item: None,
            height_m: 10.0,
        };
        assert_eq!(first(None), take_off);
        assert_eq!(first(Some((home(), false))), take_off);
        let above = WaypointPosition {
            altitude_m: 50.0,
            ..home()
        };
        assert!(matches!(first(Some((above, true))), Step::Path(_)));
    }
}
