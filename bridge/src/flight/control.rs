//! [`Control`]: who commands, and whose movements are taken (requirement H11).
//!
//! Courtesy among programs of one user, which trust one another: it keeps two operators from flying one helicopter by
//! mistake. `hold`, `land` and `stop` are everyone's, always; so are a start, a new fence, and what reads.
//!
//! A *sender* is a station of the relay, or on the robot's machine a session of processes: all that an operator runs in
//! one terminal, or all processes of a service. One whose session is not known is its process.
//!
//! | event | free | held by the sender | held by another |
//! |---|---|---|---|
//! | movement or parameter write | → held by the sender, when it is taken | taken | not in control |
//! | take | → held by the sender | done | not in control; the sender *asks* |
//! | release | done | → free | the sender does not ask any more; done |
//! | pass | not in control | → held by who asks; → free if none does | not in control |
//! | anything else | taken | taken | taken |
//! | the sender is gone | – | → free | it does not ask any more |
//! | silence | – | → free | |
//!
//! That is with `exclusive = true`. Without it nothing is refused: a movement that is taken, a write, and a take make
//! their sender the holder. Silence counts from the holder's last request, and from the end of any movement under way.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::{ControlSender, ControlState};
use serde::{Deserialize, Serialize};

use crate::config::ControlConfig;

/// What is known of the process that sent a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sender {
    /// Its number.
    pub process: Option<u32>,
    /// The number of its session, when the process that began it lives.
    pub session: Option<u32>,
    /// Which clock it reads.
    pub clock: SenderClock,
}

/// The monotonic clock of the process that sent a request. In another time namespace it has another zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SenderClock {
    /// The bridge's own.
    #[default]
    Own,
    /// A clock with another zero.
    Other,
    /// The process is not seen from here: it may be another one.
    Unknown,
}

/// The identity of a sender: which station, or which session or process.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Who {
    /// The station's number; 0 on the robot's machine.
    pub origin: u32,
    /// What the shell knows of the processes.
    pub sender: Sender,
}

impl Who {
    /// The process whose end is the sender's end; `None` if it is not known. Of a station it is the relay.
    pub fn lives_as(&self) -> Option<u32> {
        match self.origin {
            0 => self.sender.session.or(self.sender.process),
            _ => self.sender.process,
        }
    }

    /// The sender as it is published.
    pub fn published(&self) -> ControlSender {
        ControlSender {
            origin: self.origin,
            session: self.sender.session.unwrap_or_default(),
            process: self.sender.process.unwrap_or_default(),
        }
    }
}

/// Two processes of one session are one sender.
impl PartialEq for Who {
    fn eq(&self, other: &Who) -> bool {
        let is_of_one_place = self.origin == other.origin;
        is_of_one_place && (self.origin != 0 || self.lives_as() == other.lives_as())
    }
}

/// What a request means for control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Authority {
    /// A movement that is not everyone's, or a write of a parameter.
    Order,
    /// It asks for control.
    Take,
    /// It gives control up.
    Release,
    /// It hands control over to the sender that has asked for it.
    Pass,
    /// Every sender may make it.
    Everyones,
}

/// Who commands the helicopter, and whose movements are taken.
#[derive(Debug, Serialize, Deserialize)]
pub struct Control {
    #[serde(skip)]
    is_exclusive: bool,
    #[serde(skip)]
    silence: Duration,
    held: Option<Held>,
}

/// By whom control is held.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Held {
    by: Who,
    since: MonotonicNs,
    /// The holder's last movement that was taken.
    last_order: Option<MonotonicNs>,
    /// From then on the holder is silent.
    heard: MonotonicNs,
    /// Who asks for control.
    asker: Option<Who>,
}

impl Control {
    /// Free.
    pub fn new(config: &ControlConfig) -> Control {
        Control {
            is_exclusive: config.exclusive,
            silence: config.silence(),
            held: None,
        }
    }

    /// After a snapshot: takes over what the configuration says.
    pub fn configure(&mut self, config: &ControlConfig) {
        (self.is_exclusive, self.silence) = (config.exclusive, config.silence());
    }

    /// # Panics
    /// When what is known of the holder contradicts itself, which is a defect.
    pub(super) fn assert_sound(&self) {
        let Some(held) = &self.held else { return };
        debug_assert!(held.asker.is_none_or(|asker| asker != held.by), "{held:?}");
        debug_assert!(held.since <= held.heard, "{held:?}");
        debug_assert!(
            held.last_order.is_none_or(|order| order >= held.since),
            "{held:?}"
        );
    }

    /// Judges a request before anything else is made of it. What takes control by being taken does so by
    /// [`Control::took`].
    ///
    /// # Errors
    /// [`Reason::NotInControl`].
    pub fn ask(&mut self, who: Who, authority: Authority, now: MonotonicNs) -> Result<(), Reason> {
        let is_exclusive = self.is_exclusive;
        match (&mut self.held, authority) {
            (Some(held), _) if held.by == who => {
                held.heard = now;
                // Of several processes of one sender, the last one is shown.
                held.by = who;
                match (authority, held.asker) {
                    (Authority::Release, _) | (Authority::Pass, None) => self.held = None,
                    (Authority::Pass, Some(asker)) => self.held = Some(Held::by(asker, now)),
                    _ => {}
                }
                Ok(())
            }
            (Some(held), Authority::Take) if is_exclusive => {
                held.asker = Some(who);
                Err(Reason::NotInControl)
            }
            (_, Authority::Take) => {
                self.held = Some(Held::by(who, now));
                Ok(())
            }
            (Some(held), Authority::Release) => {
                held.asker = held.asker.filter(|asker| *asker != who);
                Ok(())
            }
            (Some(_), Authority::Order) if is_exclusive => Err(Reason::NotInControl),
            (_, Authority::Pass) => Err(Reason::NotInControl),
            _ => Ok(()),
        }
    }

    /// An [order](Authority::Order) was taken; `is_movement` if it is a movement.
    pub fn took(&mut self, who: Who, is_movement: bool, now: MonotonicNs) {
        if self.held.is_none_or(|held| held.by != who) {
            self.held = Some(Held::by(who, now));
        }
        if let Some(held) = self.held.as_mut().filter(|_| is_movement) {
            held.last_order = Some(now);
        }
    }

    /// The processes of a sender have ended. Says whether that changed anything.
    pub fn gone(&mut self, process: u32) -> bool {
        let is_gone = |who: &Who| who.lives_as() == Some(process);
        match &mut self.held {
            Some(held) if is_gone(&held.by) => self.held = None,
            Some(held) if held.asker.is_some_and(|asker| is_gone(&asker)) => held.asker = None,
            _ => return false,
        }
        true
    }

    /// A movement is under way, or has just ended: the holder waits for it.
    pub fn wait(&mut self, now: MonotonicNs) {
        if let Some(held) = &mut self.held {
            held.heard = now;
        }
    }

    /// When the holder will have been silent for too long.
    pub fn silent_from(&self) -> Option<MonotonicNs> {
        self.held.map(|held| held.heard + self.silence)
    }

    /// Ends the control of a holder that has been silent for too long. Says whether it did.
    pub fn expire(&mut self, now: MonotonicNs) -> bool {
        let is_silent = self.silent_from().is_some_and(|from| now >= from);
        if is_silent {
            self.held = None;
        }
        is_silent
    }

    /// The process with whose end control ends.
    pub fn lives_as(&self) -> Option<u32> {
        self.held.and_then(|held| held.by.lives_as())
    }

    /// The state of control as it is published.
    pub fn published(&self) -> ControlState {
        let exclusive = u32::from(self.is_exclusive);
        let Some(held) = self.held else {
            return ControlState {
                exclusive,
                ..ControlState::default()
            };
        };
        ControlState {
            since_ns: held.since.0,
            last_order_ns: held.last_order.map_or(0, |at| at.0),
            holder: held.by.published(),
            asker: held.asker.as_ref().map(Who::published).unwrap_or_default(),
            held: 1,
            asked: u32::from(held.asker.is_some()),
            exclusive,
            reserved: 0,
        }
    }
}

impl Held {
    fn by(who: Who, now: MonotonicNs) -> Held {
        Held {
            by: who,
            since: now,
            last_order: None,
            heard: now,
            asker: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SILENCE: Duration = Duration::from_secs(60);

    const fn at(s: u64) -> MonotonicNs {
        MonotonicNs(s * 1_000_000_000)
    }

    /// The operator at terminal `session`; each command is another process.
    const fn terminal(session: u32, process: u32) -> Who {
        Who {
            origin: 0,
            sender: Sender {
                process: Some(process),
                session: Some(session),
                clock: SenderClock::Own,
            },
        }
    }

    const fn station(origin: u32) -> Who {
        Who {
            origin,
            sender: Sender {
                process: Some(900),
                session: Some(901),
                clock: SenderClock::Own,
            },
        }
    }

    fn control(exclusive: bool, held: Option<(Who, Option<Who>)>) -> Control {
        let mut control = Control::new(&ControlConfig {
            exclusive,
            silence_s: SILENCE.as_secs_f64(),
        });
        control.held = held.map(|(by, asker)| Held {
            asker,
            ..Held::by(by, at(1))
        });
        control
    }

    fn held(control: &Control) -> Option<(Who, Option<Who>)> {
        control.held.map(|held| (held.by, held.asker))
    }

    /// What happens to a control.
    #[derive(Clone, Copy, Debug)]
    enum Event {
        Request(Authority),
        Gone,
        Silence,
    }

    const A: Who = terminal(10, 11);
    const B: Who = terminal(20, 21);
    const C: Who = station(7);

    #[test]
    fn every_state_and_event() {
        use super::Authority::{Everyones, Order, Pass, Release, Take};
        use Event::{Gone, Request, Silence};
        type State = Option<(Who, Option<Who>)>;
        let free: State = None;
        let mine: State = Some((A, None));
        let asked: State = Some((A, Some(C)));
        let theirs: State = Some((B, None));
        let i_ask: State = Some((B, Some(A)));
        let another_asks: State = Some((B, Some(C)));
        let (yes, no) = (Ok(()), Err(Reason::NotInControl));
        // What A does, in each state of the exclusive control: the answer and the next state.
        type Cell = (Result<(), Reason>, State);
        let states = [free, mine, asked, theirs, i_ask, another_asks];
        #[rustfmt::skip]
        let table: [(Event, [Cell; 6]); 7] = [
            (Request(Order), [(yes, mine), (yes, mine), (yes, asked), (no, theirs), (no, i_ask), (no, another_asks)]),
            (Request(Take), [(yes, mine), (yes, mine), (yes, asked), (no, i_ask), (no, i_ask), (no, i_ask)]),
            (Request(Release), [(yes, free), (yes, free), (yes, free), (yes, theirs), (yes, theirs), (yes, another_asks)]),
            (Request(Pass), [(no, free), (yes, free), (yes, Some((C, None))), (no, theirs), (no, i_ask), (no, another_asks)]),
            (Request(Everyones), [(yes, free), (yes, mine), (yes, asked), (yes, theirs), (yes, i_ask), (yes, another_asks)]),
            (Gone, [(yes, free), (yes, free), (yes, free), (yes, theirs), (yes, theirs), (yes, another_asks)]),
            (Silence, [(yes, free); 6]),
        ];
        // Without exclusive control: an order and a take make A the holder, and nothing else is different.
        #[rustfmt::skip]
        let courtesy: [(Event, [Cell; 6]); 2] = [
            (Request(Order), [(yes, mine), (yes, mine), (yes, asked), (yes, mine), (yes, mine), (yes, mine)]),
            (Request(Take), [(yes, mine), (yes, mine), (yes, asked), (yes, mine), (yes, mine), (yes, mine)]),
        ];
        let courteous = |(event, cells): &(Event, [Cell; 6])| {
            let changed =
                |row: &&(Event, [Cell; 6])| format!("{:?}", row.0) == format!("{event:?}");
            courtesy
                .iter()
                .find(changed)
                .map_or((*event, *cells), |row| *row)
        };
        for (exclusive, rows) in [
            (true, table.to_vec()),
            (false, table.iter().map(courteous).collect()),
        ] {
            for (event, cells) in rows {
                for (state, (answer, next)) in states.into_iter().zip(cells) {
                    let what = format!("exclusive {exclusive}, {event:?} in {state:?}");
                    let mut control = control(exclusive, state);
                    let said = match event {
                        Request(authority) => {
                            let said = control.ask(A, authority, at(2));
                            if said.is_ok() && authority == Order {
                                control.took(A, true, at(2));
                            }
                            said
                        }
                        Gone => {
                            control.gone(10);
                            Ok(())
                        }
                        Silence => {
                            control.expire(at(1) + SILENCE);
                            Ok(())
                        }
                    };
                    assert_eq!((said, held(&control)), (answer, next), "{what}");
                }
            }
        }
    }

    #[test]
    fn a_session_and_a_station_are_one_sender_each_and_a_stranger_is_its_process() {
        let process = |process| Who {
            origin: 0,
            sender: Sender {
                process: Some(process),
                ..Sender::default()
            },
        };
        let table = [
            (terminal(10, 11), terminal(10, 12), true),
            (terminal(10, 11), terminal(20, 11), false),
            (station(7), station(7), true),
            (station(7), station(8), false),
            (station(7), terminal(901, 900), false),
            (process(5), process(5), true),
            (process(5), process(6), false),
            // The leader of a session that has gone on without it.
            (process(10), terminal(10, 11), true),
            (Who::default(), Who::default(), true),
        ];
        for (a, b, is_one) in table {
            assert_eq!(a == b, is_one, "{a:?} {b:?}");
        }
        assert_eq!(terminal(10, 11).lives_as(), Some(10));
        assert_eq!(station(7).lives_as(), Some(900), "with the relay");
        assert_eq!(Who::default().lives_as(), None);
    }

    #[test]
    fn silence_counts_from_the_last_request_of_the_holder_and_from_the_end_of_a_movement() {
        let mut control = control(true, None);
        assert_eq!(control.silent_from(), None);
        control.took(A, true, at(100));
        control.ask(B, Authority::Everyones, at(120)).unwrap();
        assert!(
            !control.expire(at(159)),
            "another's hold is not the holder's"
        );
        control
            .ask(terminal(10, 12), Authority::Everyones, at(159))
            .unwrap();
        control.wait(at(300));
        assert_eq!(control.silent_from(), Some(at(360)));
        assert!(!control.expire(at(359)));
        assert_eq!(control.published().holder.process, 12);
        assert!(control.expire(at(360)));
        assert_eq!(held(&control), None);
    }

    #[test]
    fn the_state_names_holder_and_asker() {
        let mut control = control(true, None);
        assert_eq!(
            control.published(),
            ControlState {
                exclusive: 1,
                ..ControlState::default()
            }
        );
        control.took(A, false, at(3));
        assert_eq!(
            control.published().last_order_ns,
            0,
            "a write is no movement"
        );
        control.took(A, true, at(4));
        control.ask(C, Authority::Take, at(5)).unwrap_err();
        let published = control.published();
        assert_eq!(
            (published.held, published.asked, published.exclusive),
            (1, 1, 1)
        );
        assert_eq!(
            (published.since_ns, published.last_order_ns),
            (at(3).0, at(4).0)
        );
        assert_eq!((published.holder.session, published.asker.origin), (10, 7));
        // Where control is handed over, nothing is left of the one before.
        control.ask(A, Authority::Pass, at(6)).unwrap();
        let passed = control.published();
        assert_eq!(
            (passed.holder.origin, passed.since_ns, passed.last_order_ns),
            (7, at(6).0, 0)
        );
        assert_eq!((passed.asked, passed.asker), (0, ControlSender::default()));
    }
}
