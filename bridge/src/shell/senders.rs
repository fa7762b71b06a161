//! [`Senders`]: who sends, as the kernel knows it. A thread looks through `/proc` whether the number of a process is
//! that of one of the robot (requirement H14), and the requests of a process that it has not looked at yet wait for
//! that; the bridge's loop goes on.
//!
//! | a request comes | its process is known | it is not |
//! |---|---|---|
//! | hold, landing, stop | goes on | goes on, as of a process that is not seen: it is taken whatever clock its sender reads |
//! | another one | goes on, unless one of that process waits | waits, in the order of arrival, for at most [`KNOWN_WITHIN`]; then it goes on as of one that is not seen |
//!
//! Numbers of processes mean something in one PID namespace only. A process in another one, whose number may be
//! another's here, is not seen: it is a sender by itself, silence ends its control, and the end of its path's client is
//! noticed within two seconds.

use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, MovementKind};
use runtime::helper::{Helper, HelperGone};
use runtime::session::session_of;
use rustix::io::Errno;
use rustix::process::test_kill_process;

use super::controller::{Watched, pid};
use crate::core::Input;
use crate::flight::control::{Sender, SenderClock};
use crate::outputs::RequestKey;

/// How long a request waits until its process was looked at, which takes a millisecond.
const KNOWN_WITHIN: Duration = Duration::from_millis(500);

/// Processes that are remembered while they live: as many as can have a client of `movement`. Of more, the oldest are
/// looked at again.
const MAX_KNOWN: usize = 16;

/// Requests that wait: as many as that many clients can have open. A further one goes on as of a process that is not
/// seen.
const MAX_WAITING: usize = 128;

/// A process that was looked at, or is to be.
struct Known {
    process: u32,
    /// Its end, and with it that the number may become another's.
    watched: Watched,
    /// `None` until it was looked at.
    clock: Option<SenderClock>,
}

/// A request that waits, and until when.
struct Waiting {
    input: Input<'static>,
    by: MonotonicNs,
}

/// Finds out who sends: requests of a process that was not looked at yet wait in it.
pub(super) struct Senders {
    thread: Helper<u32, (u32, SenderClock)>,
    known: VecDeque<Known>,
    waiting: VecDeque<Waiting>,
}

/// The request of an input from a process: its key, its sender, and whether it is taken whatever clock that one reads.
fn request<'a>(input: &'a mut Input<'static>) -> Option<(RequestKey, &'a mut Sender, bool)> {
    match input {
        Input::Control {
            key,
            sender,
            request,
        } => Some((
            *key,
            sender,
            request.command() == Some(ControlCommand::Stop),
        )),
        Input::Movement {
            key,
            sender,
            request,
        } => {
            let is_stop = matches!(
                request.kind(),
                Some(MovementKind::Hold | MovementKind::Land)
            );
            Some((*key, sender, is_stop))
        }
        Input::Parameter { key, sender, .. } => Some((*key, sender, false)),
        _ => None,
    }
}

/// What is known of a process without a look through `/proc`.
pub(super) fn sender(process: Option<u32>) -> Sender {
    let leader = process
        .and_then(pid)
        .and_then(|pid| session_of(Some(pid)))
        .filter(|leader| test_kill_process(*leader) != Err(Errno::SRCH));
    Sender {
        process,
        session: leader.map(|leader| leader.as_raw_nonzero().get() as u32),
        clock: SenderClock::Unknown,
    }
}

impl Senders {
    /// Starts the thread, which looks with `look`: see
    /// [`Members::shares_clock_with`](ipc_types::Members::shares_clock_with).
    pub fn start(look: impl Fn(u32) -> Option<bool> + Send + 'static) -> io::Result<Senders> {
        let look = move |process| {
            let clock = match look(process) {
                Some(true) => SenderClock::Own,
                Some(false) => SenderClock::Other,
                None => SenderClock::Unknown,
            };
            (process, clock)
        };
        Ok(Senders {
            thread: Helper::start("senders", MAX_KNOWN, look)?,
            known: VecDeque::with_capacity(MAX_KNOWN),
            waiting: VecDeque::with_capacity(MAX_WAITING),
        })
    }

    /// What wakes the bridge when the thread has looked.
    pub fn thread(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }

    /// When [`Senders::next`] has something although the thread has not looked.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.waiting.front().map(|oldest| oldest.by)
    }

    /// Takes a request. It comes back, with what is known of its sender, unless it waits.
    pub fn admit(&mut self, mut input: Input<'static>, now: MonotonicNs) -> Option<Input<'static>> {
        let Some((_, sender, is_stop)) = request(&mut input) else {
            return Some(input);
        };
        let process = sender.process;
        let known = process.map_or(Some(SenderClock::Unknown), |it| self.clock_of(it));
        if let Some(clock) = known {
            sender.clock = clock;
        }
        let waits = known.is_none() || self.has_waiting(process);
        if is_stop || !waits || self.waiting.len() == MAX_WAITING {
            return Some(input);
        }
        let by = now + KNOWN_WITHIN;
        self.waiting.push_back(Waiting { input, by });
        None
    }

    /// Whether a request of the process waits: none passes an earlier one of its own process.
    fn has_waiting(&mut self, process: Option<u32>) -> bool {
        (self.waiting.iter_mut())
            .filter_map(|waiting| request(&mut waiting.input))
            .any(|(_, sender, _)| sender.process.is_some() && sender.process == process)
    }

    /// The clock of a process that lives; `None` while the thread is to look at it.
    fn clock_of(&mut self, process: u32) -> Option<SenderClock> {
        if let Some(at) = self.known.iter().position(|known| known.process == process) {
            if self.known[at].watched.lives() {
                return self.known[at].clock;
            }
            self.known.remove(at);
        }
        let mut watched = Watched::default();
        if watched.follow(Some(process)).is_some() {
            // Gone, or a number of another namespace.
            return Some(SenderClock::Unknown);
        }
        if self.known.len() == MAX_KNOWN {
            self.known.pop_front();
        }
        // Where the thread has no room it does not look, and the request goes on when its time is over.
        let _ = self.thread.give(process);
        self.known.push_back(Known {
            process,
            watched,
            clock: None,
        });
        None
    }

    /// The sender of a request is gone. Says whether that request waits here: then it is forgotten.
    pub fn forget(&mut self, gone: RequestKey) -> bool {
        let before = self.waiting.len();
        self.waiting
            .retain_mut(|waiting| request(&mut waiting.input).is_none_or(|(key, ..)| key != gone));
        self.waiting.len() < before
    }

    /// The next request whose process is known by now, or must do without; `is_done` if the thread has looked.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn next(
        &mut self,
        now: MonotonicNs,
        is_done: bool,
    ) -> Result<Option<Input<'static>>, HelperGone> {
        while is_done && let Some((process, clock)) = self.thread.take()? {
            if let Some(known) = self.known.iter_mut().find(|known| known.process == process) {
                known.clock = Some(clock);
            }
        }
        let Some(oldest) = self.waiting.front_mut() else {
            return Ok(None);
        };
        let is_late = now >= oldest.by;
        let Some((_, sender, _)) = request(&mut oldest.input) else {
            return Ok(None);
        };
        let known = (self.known.iter_mut()).find(|known| Some(known.process) == sender.process);
        let clock = match known {
            Some(known) if known.clock.is_none() && is_late => {
                tracing::warn!(
                    known.process,
                    "/proc does not say in time what process this is"
                );
                *known.clock.insert(SenderClock::Unknown)
            }
            Some(Known {
                clock: Some(clock), ..
            }) => *clock,
            // It was forgotten for newer ones.
            None => SenderClock::Unknown,
            Some(_) => return Ok(None),
        };
        sender.clock = clock;
        Ok(self.waiting.pop_front().map(|waiting| waiting.input))
    }

    /// The bridge ends: what waits gets its answer.
    pub fn give_up(&mut self) -> impl Iterator<Item = Input<'static>> + '_ {
        self.waiting.drain(..).map(|waiting| waiting.input)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::process::{Child, Command, Stdio};
    use std::sync::mpsc::{Sender as Feed, channel};
    use std::thread;

    use ipc_types::payload::{ModuleControl, MovementData};

    const NOW: MonotonicNs = MonotonicNs(5);

    /// Senders whose thread says what the test says.
    fn senders() -> (Senders, Feed<Option<bool>>) {
        let (feed, seen) = channel();
        let senders = Senders::start(move |_process| seen.recv().unwrap_or(None)).unwrap();
        (senders, feed)
    }

    fn process() -> Child {
        Command::new("cat").stdin(Stdio::piped()).spawn().unwrap()
    }

    fn start(process: u32, id: u64) -> Input<'static> {
        Input::Control {
            key: RequestKey::Control(id),
            sender: sender(Some(process)),
            request: ModuleControl::new(id, ControlCommand::Start),
        }
    }

    fn order(process: u32, request: MovementData) -> Input<'static> {
        Input::Movement {
            key: RequestKey::Movement(request.request_id),
            sender: sender(Some(process)),
            request,
        }
    }

    /// Which request goes on, and what is known of its sender.
    fn seen(input: Option<Input<'static>>) -> Option<(RequestKey, SenderClock)> {
        input.map(|mut input| {
            let (key, sender, _) = request(&mut input).expect("a request");
            (key, sender.clock)
        })
    }

    /// Waits until the thread has looked.
    fn next(senders: &mut Senders) -> Option<(RequestKey, SenderClock)> {
        loop {
            match senders.next(NOW, true).unwrap() {
                Some(input) => return seen(Some(input)),
                None => thread::yield_now(),
            }
        }
    }

    #[test]
    fn requests_wait_in_order_until_their_process_was_looked_at_and_stops_do_not() {
        let (mut senders, feed) = senders();
        let mut children = [process(), process()];
        let [one, other] = [children[0].id(), children[1].id()];
        for (process, id) in [(one, 1), (other, 2), (one, 3)] {
            assert_eq!(seen(senders.admit(start(process, id), NOW)), None);
        }
        let hold = senders.admit(order(other, MovementData::hold(4)), NOW);
        assert_eq!(
            seen(hold),
            Some((RequestKey::Movement(4), SenderClock::Unknown))
        );
        assert!(
            senders.next(NOW, true).unwrap().is_none(),
            "nothing was looked at"
        );
        assert_eq!(senders.deadline(), Some(NOW + KNOWN_WITHIN));
        feed.send(Some(true)).unwrap();
        assert_eq!(
            next(&mut senders),
            Some((RequestKey::Control(1), SenderClock::Own))
        );
        // A request whose sender has gone is not answered.
        assert!(senders.forget(RequestKey::Control(3)) && !senders.forget(RequestKey::Control(3)));
        feed.send(Some(false)).unwrap();
        assert_eq!(
            next(&mut senders),
            Some((RequestKey::Control(2), SenderClock::Other))
        );
        assert_eq!(senders.deadline(), None);
        for (process, clock) in [(one, SenderClock::Own), (other, SenderClock::Other)] {
            let land = senders.admit(order(process, MovementData::land(5)), NOW);
            assert_eq!(seen(land), Some((RequestKey::Movement(5), clock)));
        }
        // Its process has ended, so the number names no process.
        for child in &mut children {
            drop(child.stdin.take());
            child.wait().unwrap();
        }
        let late = seen(senders.admit(start(one, 6), NOW));
        assert_eq!(late, Some((RequestKey::Control(6), SenderClock::Unknown)));
    }

    #[test]
    fn no_request_passes_an_earlier_one_of_its_process() {
        let (mut senders, feed) = senders();
        let mut child = process();
        let [own, other] = [std::process::id(), child.id()];
        // The process of the second is looked at first, and its first request is behind that of the other one.
        assert_eq!(seen(senders.admit(start(own, 1), NOW)), None);
        assert_eq!(seen(senders.admit(start(other, 2), NOW)), None);
        for known in &mut senders.known {
            known.clock = (known.process == other).then_some(SenderClock::Own);
        }
        assert_eq!(seen(senders.admit(start(other, 3), NOW)), None);
        feed.send(Some(true)).unwrap();
        let order: Vec<_> = (0..3).filter_map(|_| next(&mut senders)).collect();
        let own = |id| (RequestKey::Control(id), SenderClock::Own);
        assert_eq!(order, [own(1), own(2), own(3)]);
        drop(child.stdin.take());
        child.wait().unwrap();
    }

    #[test]
    fn a_look_that_does_not_come_back_delays_a_request_once_and_no_longer_than_the_limit() {
        let (mut senders, feed) = senders();
        let own = std::process::id();
        assert_eq!(seen(senders.admit(start(own, 1), NOW)), None);
        let due = NOW + KNOWN_WITHIN;
        assert_eq!(senders.deadline(), Some(due));
        let unknown = |id| Some((RequestKey::Control(id), SenderClock::Unknown));
        assert_eq!(seen(senders.next(due, false).unwrap()), unknown(1));
        assert_eq!(seen(senders.admit(start(own, 2), due)), unknown(2));
        // It comes back, and is used from then on.
        feed.send(Some(true)).unwrap();
        let known = loop {
            assert!(senders.next(due, true).unwrap().is_none());
            match seen(senders.admit(start(own, 3), due)) {
                Some((_, SenderClock::Unknown)) => thread::yield_now(),
                known => break known,
            }
        };
        assert_eq!(known, Some((RequestKey::Control(3), SenderClock::Own)));
    }

    #[test]
    fn only_so_many_requests_wait_and_at_the_end_all_get_their_answer() {
        let (mut senders, _feed) = senders();
        let own = std::process::id();
        for id in 0..MAX_WAITING as u64 {
            assert_eq!(seen(senders.admit(start(own, id), NOW)), None);
        }
        assert!(senders.admit(start(own, 999), NOW).is_some());
        assert_eq!(senders.give_up().count(), MAX_WAITING);
    }

    #[test]
    fn processes_of_one_session_have_one_leader() {
        let own = sender(Some(std::process::id())).session;
        let mut child = process();
        let id = child.id();
        assert_eq!(sender(Some(id)).session, own);
        drop(child.stdin.take());
        child.wait().unwrap();
        assert_eq!(sender(Some(id)).session, None);
        assert_eq!(sender(None).session, None);
    }
}
