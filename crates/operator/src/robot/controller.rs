//! Who commands a robot, in words and as part of a JSON object: `docs/safety.md`, *Control*.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::{ControlSender, ControlState, ModuleState, RelayStations};
use runtime::duration::DurationText;

use crate::render::fields::Tree;
use crate::robot::freshness::age_ms;

/// What is known here of senders.
#[derive(Clone, Copy, Debug, Default)]
pub struct Senders<'a> {
    /// The session of this process, when the robot's processes are on this machine.
    pub own_session: Option<u32>,
    /// The stations of the robot's relay.
    pub stations: Option<&'a RelayStations>,
}

/// The session of this process.
pub fn own_session() -> Option<u32> {
    let leader = runtime::session::session_of(None)?;
    u32::try_from(leader.as_raw_nonzero().get()).ok()
}

impl Senders<'_> {
    /// A sender's name.
    pub fn name(&self, sender: &ControlSender) -> String {
        let ControlSender {
            origin,
            session,
            process,
        } = *sender;
        let station = self
            .stations
            .and_then(|stations| stations.of_origin(origin))
            .and_then(|station| station.name());
        match (station, self.own_session) {
            (Some(name), _) if origin != 0 => format!("station {name}"),
            _ if origin != 0 => "a station".to_owned(),
            (_, Some(own)) if session == own => "this terminal".to_owned(),
            _ if session != 0 => format!("session {session}"),
            _ if process != 0 => format!("process {process}"),
            _ => "an unknown program".to_owned(),
        }
    }

    /// Who commands, in a line.
    pub fn in_words(&self, state: &ModuleState, now: MonotonicNs) -> String {
        let control = &state.control;
        let rule = match control.exclusive {
            0 => "",
            _ => "; others may hold and land only",
        };
        let Some(holder) = state.holder() else {
            return match control.exclusive {
                0 => "free".to_owned(),
                _ => "free; the first sender that orders gets it".to_owned(),
            };
        };
        let mut text = self.name(&holder);
        if let Some(ms) = age_ms(MonotonicNs(control.since_ns), now) {
            text += &format!(", for {}", DurationText(Duration::from_millis(ms)));
        }
        if let Some(asker) = state.asker() {
            text += &format!("; {} asks for it", self.name(&asker));
        }
        text + rule
    }

    /// Who commands, as part of a JSON object.
    pub fn tree(&self, control: &ControlState, now: MonotonicNs) -> Tree {
        let sender = |sender: &ControlSender, is_there: u32| match is_there {
            0 => Tree::NULL,
            _ => Tree::nested([
                ("name", self.name(sender).into()),
                ("origin", sender.origin.into()),
                ("session", sender.session.into()),
                ("process", sender.process.into()),
            ]),
        };
        let age = |at_ns: u64| {
            (at_ns != 0)
                .then(|| age_ms(MonotonicNs(at_ns), now))
                .flatten()
        };
        Tree::nested([
            ("exclusive", (control.exclusive != 0).into()),
            ("holder", sender(&control.holder, control.held)),
            ("asker", sender(&control.asker, control.asked)),
            ("since_ms", age(control.since_ns).into()),
            ("last_order_age_ms", age(control.last_order_ns).into()),
        ])
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::{RelayStation, ascii_bytes};

    use super::*;

    fn sender(origin: u32, session: u32, process: u32) -> ControlSender {
        ControlSender {
            origin,
            session,
            process,
        }
    }

    #[test]
    fn senders_have_the_names_by_which_a_person_finds_them() {
        let mut stations = RelayStations {
            count: 1,
            ..RelayStations::default()
        };
        stations.stations[0] = RelayStation {
            name: ascii_bytes("tower"),
            origin: 7,
            ..RelayStation::default()
        };
        let senders = Senders {
            own_session: Some(10),
            stations: Some(&stations),
        };
        for (of, name) in [
            (sender(7, 10, 11), "station tower"),
            (sender(8, 10, 11), "a station"),
            (sender(0, 10, 11), "this terminal"),
            (sender(0, 20, 21), "session 20"),
            (sender(0, 0, 21), "process 21"),
            (sender(0, 0, 0), "an unknown program"),
        ] {
            assert_eq!(senders.name(&of), name);
        }
        // Numbers of another machine are not those of this one.
        assert_eq!(Senders::default().name(&sender(0, 10, 11)), "session 10");
    }

    #[test]
    fn control_is_said_in_a_line() {
        let now = MonotonicNs(65_000_000_000);
        let mut state = ModuleState::default();
        let senders = Senders::default();
        assert_eq!(senders.in_words(&state, now), "free");
        state.control.exclusive = 1;
        let free = "free; the first sender that orders gets it";
        assert_eq!(senders.in_words(&state, now), free);
        state.control = ControlState {
            since_ns: 5_000_000_000,
            holder: sender(0, 20, 21),
            asker: sender(9, 0, 0),
            held: 1,
            asked: 1,
            ..state.control
        };
        assert_eq!(
            senders.in_words(&state, now),
            "session 20, for 1m; a station asks for it; others may hold and land only"
        );
    }
}
