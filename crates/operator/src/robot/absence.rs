//! Why nothing of a service comes, and what to do: no process provides it, its provider publishes nothing, or it would
//! come over the relay's link to the robot, which is not up.

use std::time::Duration;

use ipc_types::payload::{HeroTelemetry, MovementData, RelayLink};
use ipc_types::{Module, MonotonicNs, RelayModule, Request, RobotId, Topic};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};

use super::relay_link::LinkReport;
use crate::session::{Latest, Session, other_domains, others_alive, process_of};

/// How long the relay may take to say how its link is. A subscriber gets the last state at once.
const LINK_TIMEOUT: Duration = Duration::from_secs(1);

/// The failure that no process provides the service `key`. At a station it is that of the link to the robot, unless
/// that is up.
pub fn absent(session: &Session, key: &str) -> Failure {
    match link(session, key) {
        Ok(link) => {
            let is_there = |other: &&str| session.is_provided(other).unwrap_or(false);
            let living = [MovementData::KEY, HeroTelemetry::KEY]
                .into_iter()
                .find(is_there);
            let living = living.and_then(process_of);
            not_provided(key, session.ipc.robot(), living, link.as_ref())
        }
        Err(failure) => failure,
    }
}

/// The relay's link to the robot that the service `key` would come over; `None` if this machine is no station.
fn link(session: &Session, key: &str) -> Result<Option<LinkReport>, Failure> {
    if key.split('/').next() == Some(RelayModule::NAME) {
        return Ok(None);
    }
    let Some(mut latest) = Latest::<RelayLink>::open_if_provided(session)? else {
        return Ok(None);
    };
    let give_up = MonotonicNs::now() + LINK_TIMEOUT;
    session.gather(&mut latest, give_up, |latest, _| {
        Ok(latest.sample.is_some())
    })?;
    // Without a sample it is that of a relay that says nothing.
    let sample = latest.sample.unwrap_or_default();
    Ok(Some(LinkReport::new(&sample, MonotonicNs::now())))
}

/// What becomes of a helicopter whose bridge has ended.
const WITHOUT_BRIDGE: &str = "in flight a DSP with a time-out for the PC hovers meanwhile, and any other flies the waypoints that it holds";

/// The failure that no process of `robot`, whose `link` is known, provides `key`; another one of it may live. Other
/// robots that are alive are named.
fn not_provided(
    key: &str,
    robot: RobotId,
    living: Option<&str>,
    link: Option<&LinkReport>,
) -> Failure {
    if let Some((trouble, next_step)) = link.and_then(LinkReport::trouble) {
        let text = format!("{key} of robot {robot} is not there: {trouble}");
        return Failure::new(ExitCode::LinkDown, text).with_next_step(next_step);
    }
    let (here, there) = match link {
        Some(_) => (" on the robot's machine, to which the link is up", " there"),
        None => ("", ""),
    };
    let (start, absent) = match process_of(key) {
        Some(process) => (
            format!("start `ril run {process} --robot {robot}`{there}"),
            format!("robot {robot}'s {process} is not running{here}"),
        ),
        None => (
            format!("start the module that provides it{there}"),
            format!("no module of robot {robot} provides {key}{here}"),
        ),
    };
    let others = match (link, living) {
        (Some(_), _) => String::new(),
        (None, Some(living)) => match process_of(key) {
            Some("bridge") => format!("; its {living} is: {WITHOUT_BRIDGE}"),
            _ => format!("; its {living} is"),
        },
        (None, None) => format!("{}{}", others_alive(robot), other_domains()),
    };
    let text = format!("{absent}{others}");
    Failure::new(ExitCode::ServiceAbsent, text).with_next_step(format!("{start} and try again"))
}

/// The failure that nothing of the topic `key` came in time: it is [`absent`], or its provider publishes nothing.
pub fn nothing_came(session: &Session, key: &str, timeout: Duration) -> Result<Failure, Failure> {
    let robot = session.ipc.robot();
    let timeout = DurationText(timeout);
    let Some(provider) = session.provider(key)? else {
        return Ok(absent(session, key));
    };
    let (running, next_step) = match process_of(key) {
        _ if session.is_relayed(key, &provider)? => (
            "the relay".to_owned(),
            format!("`ril relay status --robot {robot}` shows its link to the robot"),
        ),
        Some(process) => (
            format!("`ril run {process}`"),
            format!("`ril status --robot {robot}` shows the link to the DSP"),
        ),
        None => (
            "its module".to_owned(),
            "wait longer with --timeout".to_owned(),
        ),
    };
    let text = format!(
        "nothing came from {key} of robot {robot} in {timeout}, although {running} is running"
    );
    Ok(Failure::new(ExitCode::Timeout, text).with_next_step(next_step))
}

#[cfg(test)]
mod tests {
    use ipc_types::code::RelayLinkState;

    use super::*;

    const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

    fn failure(key: &str, link: Option<RelayLinkState>) -> Failure {
        let link = link.map(|state| {
            let link = RelayLink {
                published_ns: NOW.0,
                since_ns: NOW.0 - 12_000_000_000,
                open_timeout_s: 6.0,
                state: state.code(),
                ..RelayLink::default()
            };
            LinkReport::new(&link, NOW)
        });
        not_provided(key, RobotId::new(7).unwrap(), None, link.as_ref())
    }

    #[test]
    fn a_robot_of_which_another_process_lives_is_not_called_dead() {
        let robot = RobotId::new(7).unwrap();
        let text = |key, living| {
            let failure = not_provided(key, robot, Some(living), None);
            failure.chain().join(": ")
        };
        let order = text("movement", "status");
        assert!(
            order.starts_with("robot 7's bridge is not running; its status is: in flight a DSP"),
            "{order}"
        );
        assert_eq!(
            text("hero_telemetry", "bridge"),
            "robot 7's status is not running; its bridge is"
        );
    }

    #[test]
    fn a_missing_process_is_named_with_how_to_start_it() {
        for (key, process) in [
            ("hero_telemetry", "ril run status --robot 7"),
            ("dsp_telemetry", "ril run bridge --robot 7"),
            ("movement", "ril run bridge --robot 7"),
        ] {
            let failure = failure(key, None);
            assert_eq!(failure.code(), ExitCode::ServiceAbsent);
            assert!(failure.next_step().contains(process), "{failure:?}");
        }
    }

    #[test]
    fn at_a_station_the_link_says_why_nothing_is_there() {
        for state in [RelayLinkState::Connecting, RelayLinkState::Down] {
            let failure = failure("movement", Some(state));
            assert_eq!(failure.code(), ExitCode::LinkDown);
            let text = format!("{failure:?}");
            assert!(text.contains("for 12s over"), "{text}");
            assert!(!failure.next_step().contains("ril run"), "{failure:?}");
        }
        let failure = failure("movement", Some(RelayLinkState::Up));
        assert_eq!(failure.code(), ExitCode::ServiceAbsent);
        let next_step = failure.next_step();
        assert!(next_step.contains("--robot 7` there"), "{failure:?}");
    }
}
