//! What a page gets of a robot: the messages of `hero.view.v1` from the model that `ril watch` shows, by pure
//! functions.
//!
//! A value that is not known is null, never 0. Texts are those of the terminal.

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, PilotSwitch};
use ipc_types::payload::ModuleState;
use operator::robot::changes::Alarm;
use operator::robot::clock::Clocks;
use operator::robot::freshness::{Freshness, named};
use operator::robot::geo::{Place, distance_m};
use operator::robot::history::EventLine;
use operator::robot::model::{Process, WatchedRobot};
use operator::robot::pilot;
use operator::robot::relay_link::UNREADABLE;
use runtime::finding::{Finding, Severity};

use crate::page;

/// Decimals of what is sent many times a second: at most one more than the page shows, so that the page can add and
/// compare. Telemetry has up to 17 digits, which would be half of what a page gets.
mod decimals {
    /// Of latitude and longitude, degrees: 1 cm.
    pub const PLACE: i32 = 7;
    /// Of heights and altitudes, m.
    pub const METRES: i32 = 2;
    /// Of speeds, m/s.
    pub const SPEED: i32 = 2;
    /// Of angles, degrees.
    pub const DEGREES: i32 = 1;
    /// Of voltages.
    pub const VOLTS: i32 = 2;
    /// Of voltages in the list of robots.
    pub const LIST_VOLTS: i32 = 1;
    /// Of fuel, percent.
    pub const PERCENT: i32 = 0;
    /// Of distances to go, m.
    pub const WHOLE: i32 = 0;
    /// Of moments before now, s.
    pub const SECONDS: i32 = 2;
}

/// A number with so many decimals; one that is not finite stays so.
fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    // What is added makes 0 of -0.
    (value * scale).round() / scale + 0.0
}

/// A number with so many decimals; `None` if it is not known.
fn known(value: Option<f64>, decimals: i32) -> Option<f64> {
    value.map(|value| rounded(value, decimals))
}

/// A place as it is sent many times.
fn rounded_place(place: Place) -> [f64; 2] {
    place
        .degrees()
        .map(|degrees| rounded(degrees, decimals::PLACE))
}

/// Home is drawn anew when it has moved by so much, m: no less than what a map shows.
const HOME_MOVED_M: f64 = 0.5;

/// Slower than this, the time that is left of a path says nothing, m/s.
const LEAST_SPEED_MPS: f64 = 0.5;

/// A robot in the list of robots.
pub(crate) fn summary(robot: &WatchedRobot, now: MonotonicNs) -> page::RobotSummary {
    let worst = robot.alarms.lasting().next();
    page::RobotSummary {
        robot: robot.id.get(),
        severity: worst.map_or(page::Severity::Ok, |alarm| severity(alarm.finding.severity)),
        text: worst.map_or_else(|| robot.doing(now), |alarm| alarm.finding.text.clone()),
        flying: fresh_flying(robot, now),
        battery_v: known(robot.pilot.battery_v, decimals::LIST_VOLTS),
        link: freshness(robot.process(Process::Bridge, now)),
    }
}

/// Whether it flies, as the present says.
fn fresh_flying(robot: &WatchedRobot, now: MonotonicNs) -> Option<bool> {
    let is_fresh = robot.telemetry_freshness(now).is_fresh();
    robot.pilot.flying.filter(|_| is_fresh)
}

/// The robot in words.
pub(crate) fn robot(robot: &WatchedRobot, now: MonotonicNs) -> page::RobotStatus {
    let state = robot.state.as_ref();
    let flying = robot.pilot.flying;
    let functionality = state.and_then(|state| state.functionality());
    let activity = functionality.map(|one| pilot::activity(one, flying).to_owned());
    page::RobotStatus {
        robot: robot.id.get(),
        phase: robot.doing(now),
        activity: activity.unwrap_or_default(),
        module: state.map_or("unknown".to_owned(), module),
        blocked: state.is_some_and(ModuleState::is_blocked),
        link: link(robot, now),
        switch: robot.pilot.switch.and_then(switch),
        commander: robot
            .known_stations(now)
            .and_then(|stations| stations.commanding())
            .map(|station| page::Commander {
                text: station.name().unwrap_or(UNREADABLE).to_owned(),
            }),
        control: page::Control {
            exclusive: state.is_some_and(|state| state.control.exclusive != 0),
            holder: match robot.is_commanded_from_here() {
                true => Some("this view".to_owned()),
                false => robot.commander(),
            },
        },
        alarms: robot.alarms.lasting().map(|one| alarm(one, now)).collect(),
        movement: state.and_then(|state| movement(robot, state)),
        flown_s: robot
            .airborne
            .map(|since| now.since(since).as_secs() as f64),
        replayed: state.is_some_and(ModuleState::is_replayed),
        relayed: robot.is_relayed,
    }
}

/// The words without what counts on by itself, or with each sample: a page counts ages on, and gets the rest once a
/// second.
pub(crate) fn lasting(mut words: page::RobotStatus) -> page::RobotStatus {
    (words.link.age_s, words.flown_s) = (None, None);
    for alarm in &mut words.alarms {
        alarm.since_s = 0.0;
    }
    if let Some(movement) = &mut words.movement {
        (movement.distance_to_go_m, movement.time_to_go_s) = (None, None);
    }
    words
}

/// The list of robots without what changes with each sample.
pub(crate) fn lasting_list(mut robots: page::Robots) -> page::Robots {
    for robot in &mut robots.robots {
        robot.battery_v = None;
    }
    robots
}

fn module(state: &ModuleState) -> String {
    named(state.status(), state.status)
}

/// The link to the DSP.
fn link(robot: &WatchedRobot, now: MonotonicNs) -> page::LinkStatus {
    let Some(state) = &robot.state else {
        return page::LinkStatus {
            text: "unknown".to_owned(),
            state: "unknown".to_owned(),
            age_s: None,
        };
    };
    let known = state.link.state();
    let name = named(known, state.link.state);
    let text = match known {
        Some(LinkState::Up) => "link to the DSP up".to_owned(),
        _ => format!("link to the DSP {name}"),
    };
    page::LinkStatus {
        text,
        state: name,
        age_s: robot.link_age(now).map(|(age, _)| age.as_secs() as f64),
    }
}

fn switch(switch: PilotSwitch) -> Option<page::Switch> {
    match switch {
        PilotSwitch::Auto => Some(page::Switch::Auto),
        PilotSwitch::Manual => Some(page::Switch::Manual),
        PilotSwitch::Unknown => None,
    }
}

fn alarm(alarm: &Alarm, now: MonotonicNs) -> page::Alarm {
    let finding = &alarm.finding;
    page::Alarm {
        id: match finding.items.first() {
            Some(item) => format!("{}-{item}", finding.id),
            None => finding.id.to_owned(),
        },
        severity: severity(finding.severity),
        text: finding.text.clone(),
        next_step: finding.next_step.clone(),
        since_s: now.since(alarm.since).as_secs() as f64,
    }
}

fn movement(robot: &WatchedRobot, state: &ModuleState) -> Option<page::Movement> {
    let movement = &state.movement;
    let text = pilot::movement(state)?;
    let distance_m = movement.distance_to_go().map(f64::from);
    let distance_m = distance_m.filter(|distance| distance.is_finite());
    let speed_mps = robot.pilot.ground_speed_mps;
    let speed_mps = speed_mps.filter(|speed| *speed >= LEAST_SPEED_MPS);
    let (total, reached) = (movement.waypoints_total, movement.waypoints_reached);
    Some(page::Movement {
        text,
        waypoints_total: total,
        waypoints_reached: reached,
        distance_to_go_m: known(distance_m, decimals::WHOLE),
        time_to_go_s: distance_m
            .zip(speed_mps)
            .map(|(metres, mps)| (metres / mps).ceil()),
    })
}

/// What changes all the time, as it is at `now`, which is another moment than that of sending, `sent`, in a replay.
pub(crate) fn now(
    robot: &WatchedRobot,
    number: u64,
    now: MonotonicNs,
    sent: MonotonicNs,
) -> page::Now {
    let view = &robot.pilot;
    let bridge = robot.process(Process::Bridge, now);
    let telemetry = match (robot.telemetry_freshness(now), bridge) {
        // The bridge publishes telemetry, and the model looks for the bridge alone.
        (Freshness::Stale(age), Freshness::Gone(_)) => Freshness::Gone(age),
        (freshness, _) => freshness,
    };
    let published = robot.state.as_ref().map(ModuleState::published);
    let lost = robot.lost_place(now);
    page::Now {
        robot: robot.id.get(),
        n: number,
        sent_ms: sent.0 / 1_000_000,
        telemetry: age(telemetry, view.received, now),
        bridge: age(bridge, published, now),
        position: view.place.map(rounded_place),
        lost_position: lost.map(|(place, _)| rounded_place(place)),
        lost_position_age_ms: lost.map(|(_, age)| age.as_millis() as u64),
        altitude_m: known(view.altitude_m, decimals::METRES),
        height_m: known(robot.height_m(), decimals::METRES),
        attitude: attitude(robot),
        ground_speed_mps: known(view.ground_speed_mps, decimals::SPEED),
        climb_mps: known(view.climb_mps, decimals::SPEED),
        course_deg: known(view.course_deg, decimals::DEGREES),
        battery_v: known(view.battery_v, decimals::VOLTS),
        fuel_percent: known(view.fuel_percent, decimals::PERCENT),
        fix: view.gps.map(|gps| gps.name().to_owned()),
        flying: view.flying,
        left_out: 0,
    }
}

fn attitude(robot: &WatchedRobot) -> Option<page::Attitude> {
    let view = &robot.pilot;
    let degrees = |value| known(value, decimals::DEGREES);
    Some(page::Attitude {
        roll_deg: degrees(view.roll_deg)?,
        pitch_deg: degrees(view.pitch_deg)?,
        yaw_deg: degrees(view.heading_deg)?,
    })
}

/// How old a sample is. The age of a sample with a moment in the future is not known.
fn age(freshness: Freshness, at: Option<MonotonicNs>, now: MonotonicNs) -> page::Age {
    let age = match freshness {
        Freshness::Absent | Freshness::Waiting => None,
        Freshness::Fresh => at.map(|at| now.since(at)),
        Freshness::Stale(age) | Freshness::Gone(age) => age,
    };
    page::Age {
        freshness: self::freshness(freshness),
        age_ms: age.map(|age| age.as_millis() as u64),
    }
}

fn freshness(freshness: Freshness) -> page::Freshness {
    match freshness {
        Freshness::Absent | Freshness::Waiting => page::Freshness::Never,
        Freshness::Fresh => page::Freshness::Fresh,
        Freshness::Stale(_) => page::Freshness::Stale,
        Freshness::Gone(_) => page::Freshness::Gone,
    }
}

/// The fence in force, the path that is flown, and home; a part that the bridge has not published is empty.
pub(crate) fn chart(robot: &WatchedRobot) -> page::Chart {
    let held = robot.held.as_ref();
    let outline = held.map(|held| &held.outline);
    page::Chart {
        robot: robot.id.get(),
        source: page::ChartSource::Bridge,
        number: outline.map_or(0, |outline| outline.number),
        fence: held.map_or_else(Vec::new, |held| held.chart.fence.clone()),
        floor_m: outline.and_then(|outline| outline.floor_m),
        ceiling_m: outline.and_then(|outline| outline.ceiling_m),
        path: outline
            .iter()
            .flat_map(|outline| &outline.path)
            .map(|at| [at.latitude_deg, at.longitude_deg, at.altitude_m])
            .collect(),
        home: robot.home.map(|home| {
            let [latitude_deg, longitude_deg] = home.place.degrees();
            [latitude_deg, longitude_deg, home.altitude_m]
        }),
    }
}

/// Whether `chart` is to be sent after `before`. On the ground, home follows each sample of telemetry with its noise,
/// and a chart may be long: home is sent again when it has moved by [`HOME_MOVED_M`], and exactly at the take-off.
pub(crate) fn is_another_chart(before: &page::Chart, chart: &page::Chart, is_flying: bool) -> bool {
    let apart_m = match (before.home, chart.home) {
        (Some(before), Some(now)) => {
            let places = Place::new(before[0], before[1]).zip(Place::new(now[0], now[1]));
            let level_m = places.map_or(f64::INFINITY, |(from, to)| distance_m(from, to));
            level_m.hypot(now[2] - before[2])
        }
        (None, None) => 0.0,
        _ => return true,
    };
    let without_home = |chart: &page::Chart| page::Chart {
        home: None,
        ..chart.clone()
    };
    let has_moved = apart_m >= HOME_MOVED_M || is_flying && before.home != chart.home;
    has_moved || without_home(before) != without_home(chart)
}

/// The last minutes, for a page that joins.
pub(crate) fn past(robot: &WatchedRobot, clock: Clocks) -> page::Past {
    let (past, now) = (&robot.past, clock.now);
    let before = |at: MonotonicNs| rounded(-now.since(at).as_secs_f64(), decimals::SECONDS);
    let metres = |value| known(value, decimals::METRES);
    page::Past {
        robot: robot.id.get(),
        track: track(robot),
        t_s: past.points().map(|point| before(point.at)).collect(),
        altitude_m: past
            .points()
            .map(|point| metres(point.altitude_m))
            .collect(),
        ground_speed_mps: past
            .points()
            .map(|point| known(point.ground_speed_mps, decimals::SPEED))
            .collect(),
        battery_v: past
            .points()
            .map(|point| known(point.battery_v, decimals::VOLTS))
            .collect(),
        phases: past
            .phases()
            .map(|phase| page::Phase {
                from_s: before(phase.from),
                to_s: before(phase.to.unwrap_or(now)),
                text: phase.text.to_owned(),
            })
            .collect(),
        events: robot
            .journal
            .newest(usize::MAX)
            .map(|line| past_event(line, clock))
            .collect(),
    }
}

/// Its places, with a `None` between two pieces.
fn track(robot: &WatchedRobot) -> Vec<Option<[f64; 2]>> {
    let mut track = Vec::new();
    for piece in robot.track.pieces() {
        if !track.is_empty() {
            track.push(None);
        }
        track.extend(piece.iter().map(|place| Some(rounded_place(*place))));
    }
    track
}

fn past_event(line: &EventLine, clock: Clocks) -> page::PastEvent {
    page::PastEvent {
        at_unix_ms: clock.unix_ms(line.at),
        severity: line.weight,
        text: line.text.clone(),
    }
}

/// What happened just now.
pub(crate) fn event(robot: &WatchedRobot, line: &EventLine, clock: Clocks) -> page::Event {
    page::Event {
        robot: robot.id.get(),
        at_unix_ms: clock.unix_ms(line.at),
        severity: line.weight,
        text: line.text.clone(),
    }
}

pub(crate) fn severity(severity: Severity) -> page::Severity {
    match severity {
        Severity::Note => page::Severity::Note,
        Severity::Warning => page::Severity::Warning,
        Severity::Error => page::Severity::Alarm,
    }
}

/// A finding of a check.
pub(crate) fn finding(finding: &Finding) -> page::Finding {
    page::Finding {
        severity: finding_severity(finding),
        text: finding.text.clone(),
        next_step: finding.next_step.clone(),
    }
}

/// What could not be checked forbids nothing, but is to be seen.
pub(crate) fn finding_severity(finding: &Finding) -> page::Severity {
    match finding.is_unmade() {
        true => page::Severity::Warning,
        false => severity(finding.severity),
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use operator::robot::fixture::{at, fly, without_fix};

    fn flown() -> WatchedRobot {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        fly(&mut robot);
        robot.judge(at(20_000));
        robot
    }

    #[test]
    fn a_robot_in_flight_is_said_in_the_words_of_the_terminal() {
        let robot = flown();
        let words = super::robot(&robot, at(20_100));
        assert_eq!(words.phase, "flying the path, waypoint 2 of 3");
        assert_eq!(
            (&*words.activity, &*words.module),
            ("flying the path", "running")
        );
        assert_eq!((&*words.link.state, words.link.age_s), ("up", Some(20.0)));
        assert_eq!(words.switch, Some(page::Switch::Auto));
        let movement = words.movement.unwrap();
        assert_eq!(
            (movement.waypoints_total, movement.waypoints_reached),
            (3, 1)
        );
        assert_eq!(
            (movement.distance_to_go_m, movement.time_to_go_s),
            (Some(31.0), Some(11.0))
        );
        assert_eq!(words.flown_s, Some(17.0));
        assert!(words.alarms.is_empty() && !words.blocked && !words.replayed && !words.relayed);
        let line = summary(&robot, at(20_100));
        assert_eq!(
            (line.severity, line.flying),
            (page::Severity::Ok, Some(true))
        );
        assert_eq!(line.text, words.phase);
    }

    #[test]
    fn values_have_the_age_of_their_sample_and_the_freshness_of_the_terminal() {
        let mut robot = flown();
        let said = now(&robot, 5, at(20_100), at(20_100));
        assert_eq!((said.n, said.height_m), (5, Some(10.0)));
        assert_eq!(said.fix.as_deref(), Some("RTK fixed"));
        assert_eq!(said.attitude.unwrap().yaw_deg, 90.0);
        robot.provider(Process::Bridge, false, at(21_500));
        for (ms, telemetry, bridge) in [
            (20_100, page::Freshness::Fresh, page::Freshness::Gone),
            (21_500, page::Freshness::Gone, page::Freshness::Gone),
        ] {
            let said = now(&robot, 1, at(ms), at(ms));
            assert_eq!(
                (said.telemetry.freshness, said.bridge.freshness),
                (telemetry, bridge)
            );
            assert_eq!(said.telemetry.age_ms, Some(ms - 20_000));
            assert_eq!(said.bridge.age_ms, Some(ms - 20_000));
        }
        robot.judge(at(21_500));
        let words = super::robot(&robot, at(21_500));
        assert_eq!(
            (&*words.alarms[0].id, words.alarms[0].severity),
            ("bridge-gone", page::Severity::Alarm)
        );
        assert_eq!(
            summary(&robot, at(21_500)).flying,
            None,
            "it is not of the present"
        );
    }

    #[test]
    fn numbers_have_no_more_digits_than_a_page_needs() {
        for (value, decimals, expected) in [
            (24.100000381469727, 2, "24.1"),
            (37.411234567, 7, "37.4112346"),
            (-0.001, 2, "0.0"),
            (-7.14159, 1, "-7.1"),
            (f64::NAN, 2, "null"),
        ] {
            let text = serde_json::to_string(&rounded(value, decimals)).unwrap();
            assert_eq!(text, expected, "{value}");
        }
        let text = serde_json::to_string(&now(&flown(), 5, at(20_100), at(20_100))).unwrap();
        let digits = |number: &str| number.split(['.', 'e']).nth(1).map_or(0, str::len);
        let numbers = text.split([',', ':', '[', ']', '{', '}']);
        let most = numbers
            .filter(|part| part.parse::<f64>().is_ok())
            .map(digits)
            .max();
        assert_eq!(most, Some(7), "{text}");
    }

    #[test]
    fn a_chart_is_sent_again_when_it_is_another_one_and_not_for_the_noise_of_home() {
        let before = page::Chart {
            home: Some([37.4, -6.0, 10.0]),
            ..chart(&flown())
        };
        let moved = |home: Option<[f64; 3]>| page::Chart {
            home,
            ..before.clone()
        };
        for (home, is_flying, expected) in [
            (Some([37.4, -6.0, 10.0]), false, false),
            (Some([37.4, -6.0, 10.0]), true, false),
            (Some([37.400001, -6.000001, 10.2]), false, false),
            (Some([37.400001, -6.000001, 10.2]), true, true),
            (Some([37.400005, -6.0, 10.0]), false, true),
            (Some([37.4, -6.00001, 10.0]), false, true),
            (Some([37.4, -6.0, 10.6]), false, true),
            (None, false, true),
        ] {
            let found = is_another_chart(&before, &moved(home), is_flying);
            assert_eq!(found, expected, "{home:?}");
        }
        let other = page::Chart {
            number: before.number + 1,
            ..before.clone()
        };
        assert!(is_another_chart(&before, &other, false));
    }

    #[test]
    fn what_counts_on_by_itself_is_no_change_of_words() {
        let robot = flown();
        let [one, other] = [20_100, 24_300].map(|ms| super::robot(&robot, at(ms)));
        assert_ne!(one, other);
        assert_eq!(lasting(one), lasting(other));
    }

    #[test]
    fn what_is_not_known_is_nothing() {
        let robot = WatchedRobot::new(RobotId::DEFAULT);
        let said = now(&robot, 1, at(0), at(0));
        assert_eq!(
            (said.telemetry.freshness, said.telemetry.age_ms),
            (page::Freshness::Never, None)
        );
        assert_eq!(
            (said.position, said.altitude_m, said.attitude, said.flying),
            (None, None, None, None)
        );
        let words = super::robot(&robot, at(0));
        assert_eq!((&*words.phase, words.movement), ("no bridge runs", None));
        assert_eq!(chart(&robot).home, None);
    }

    #[test]
    fn without_a_fix_a_page_gets_no_zeros_and_the_last_place_with_its_age() {
        let mut robot = flown();
        let before = now(&robot, 1, at(20_000), at(20_000));
        assert_eq!(before.lost_position, None);
        robot.hero(&without_fix(21_000), at(21_000));
        robot.judge(at(21_000));
        let said = now(&robot, 2, at(21_500), at(21_500));
        assert_eq!(said.telemetry.freshness, page::Freshness::Fresh);
        assert_eq!(said.lost_position, before.position);
        let json = serde_json::to_value(&said).unwrap();
        for (name, expected) in [
            ("position", serde_json::Value::Null),
            ("altitude_m", serde_json::Value::Null),
            ("height_m", serde_json::Value::Null),
            ("ground_speed_mps", serde_json::Value::Null),
            ("climb_mps", serde_json::Value::Null),
            ("course_deg", serde_json::Value::Null),
            ("lost_position_age_ms", 1500.into()),
            ("fix", "no fix".into()),
            ("flying", true.into()),
            ("battery_v", before.battery_v.into()),
        ] {
            assert_eq!(json[name], expected, "{name}");
        }
        let past = past(
            &robot,
            Clocks {
                now: at(21_500),
                zero_unix_ns: 0,
            },
        );
        let (altitude_m, ground_speed_mps) = (&past.altitude_m, &past.ground_speed_mps);
        assert_eq!(
            (altitude_m.last(), ground_speed_mps.last()),
            (Some(&None), Some(&None))
        );
        assert_eq!(past.track.last(), Some(&before.position));
    }

    #[test]
    fn a_page_that_comes_gets_track_plots_and_events_with_the_time_of_day() {
        let robot = flown();
        let clock = Clocks {
            now: at(21_000),
            zero_unix_ns: 1_800_014_400_000_000_000 - at(0).0,
        };
        let said = past(&robot, clock);
        assert_eq!((said.t_s.len(), said.t_s[80]), (81, -1.0));
        assert_eq!(said.altitude_m[80], Some(25.0));
        assert_eq!((said.phases[2].from_s, said.phases[2].to_s), (-13.0, 0.0));
        assert!(said.track.len() > 20);
        let first = &said.events[0];
        assert_eq!(
            (first.at_unix_ms, &*first.text),
            (1_800_014_400_000, "at rest")
        );
        assert_eq!(said.events[3].severity, page::Weight::Order);
    }
}
