//! `ViewShell`: the server's loop: sockets, robots and what pages want, in the one wait of every process.
//!
//! Samples wake nothing: robots are drained by the time, 20 times a second while a page looks and 5 times when none
//! does, so that no publisher pays for viewers, and the last minutes are there for a page that comes. Sockets, reports
//! and signals wake at once.
//!
//! * `sockets`: its connections, `tls`: what hides them, [`certificate`]: until when it is valid, [`peer`]: who is at
//!   the other end;
//! * `fleet`: the robots with their ports and [models](operator::robot::model);
//! * `foxglove`: what Foxglove and Lichtblick get;
//! * `files`: what is read from a disk: imagery, and the report of a recording;
//! * `checks`: what pages ask before they order;
//! * [`run_file`]: what a running view leaves for programs of the same user; [`token_key`]: the secret of the tokens.

pub mod certificate;
mod checks;
pub(crate) mod files;
pub(crate) mod fleet;
mod foxglove;
pub mod peer;
pub mod run_file;
pub(crate) mod sockets;
pub(crate) mod tls;
pub mod token_key;

use std::collections::BTreeMap;
use std::io;
use std::time::Duration;

use ipc_types::{MonotonicNs, SchedulingRole, WaitError, Wake};
use module_kit::process::{Process, Sources};
use operator::config::RequestConfig;
use operator::request::ports::RobotOrder;
use operator::robot::changes::Weight;
use operator::robot::clock::{Clocks, WallClock};

use self::checks::Checks;
use self::files::Files;
use self::fleet::Fleet;
use self::foxglove::Foxglove;
use self::sockets::{Arrived, ConnectionKey, Sockets};
use crate::config::ViewConfig;
use crate::messages;
use crate::metrics;
use crate::orders::{GivenOrder, OrderPort, Orders};
use crate::replay::Playback;
use crate::shell::peer::OwnConnections;
use crate::speaker::Speaker;
use crate::{BUSY, ConnectionId, Event, Peer, Server, Wanted};

/// Time between two looks at the robots while a page looks.
const WATCHED_PERIOD: Duration = Duration::from_millis(50);

/// Time between two looks at the robots while no page looks.
const UNWATCHED_PERIOD: Duration = Duration::from_millis(200);

/// Clients of robots that may wake the process. A wait has 16 sources, of which sockets, signals, files and two checks
/// are five; the reports of further robots are taken at the next look.
const MAX_CLIENTS: usize = 11;

/// How often what pages want is done at one wake before the process looks at its sources again.
const MAX_ROUNDS: usize = 4;

/// Why a view cannot go on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ViewError {
    /// The operating system cannot wait any more.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// The sockets cannot be waited for.
    #[error("the sockets cannot be used")]
    Sockets(#[from] io::Error),
}

/// The server's loop: sockets, robots and what pages want, in one wait.
pub(crate) struct ViewShell {
    sockets: Sockets,
    /// What each connection is called in the server.
    connections: BTreeMap<ConnectionKey, ConnectionId>,
    server: Server,
    fleet: Fleet,
    /// Reads imagery and the report; `None` if there is neither.
    files: Option<Files>,
    /// The recording that is shown; `None` if robots are shown live.
    playback: Option<Playback>,
    speaker: Speaker,
    foxglove: Foxglove,
    orders: Orders,
    checks: Checks,
    requests: RequestConfig,
    /// When the robots are looked at next.
    next_look: MonotonicNs,
    wall_clock: WallClock,
    buffer: Vec<u8>,
}

impl ViewShell {
    pub fn new(
        sockets: Sockets,
        server: Server,
        fleet: Fleet,
        files: Option<Files>,
        config: &ViewConfig,
    ) -> ViewShell {
        ViewShell {
            files,
            sockets,
            connections: BTreeMap::new(),
            server,
            fleet,
            playback: None,
            speaker: Speaker::default(),
            foxglove: Foxglove::default(),
            orders: Orders::new(config.page_lost()),
            checks: Checks::default(),
            requests: config.request.clone(),
            next_look: MonotonicNs(0),
            wall_clock: WallClock::default(),
            buffer: Vec::new(),
        }
    }

    /// Shows a recording.
    pub fn play(&mut self, playback: Playback) {
        self.playback = Some(playback);
    }

    /// Accepts and reads.
    fn take_bytes(&mut self, now: MonotonicNs) -> io::Result<()> {
        let (readable, wants_to_connect) = self.sockets.ready()?;
        for key in readable {
            let Some(id) = self.connections.get(&key).copied() else {
                continue;
            };
            match self.sockets.read(key, &mut self.buffer) {
                None => {}
                Some(Arrived::Bytes {
                    bytes,
                    is_encrypted,
                }) => {
                    if is_encrypted {
                        self.server.encrypted(id, now);
                    }
                    self.server.receive(id, bytes, now);
                }
                Some(Arrived::End) => self.close(key, now),
            }
        }
        if wants_to_connect {
            self.take_connections(now);
        }
        Ok(())
    }

    fn take_connections(&mut self, now: MonotonicNs) {
        let came: Vec<_> = std::iter::from_fn(|| self.sockets.accept()).collect();
        let own_user = OwnConnections::read();
        for connection in came {
            let peer = Peer {
                address: connection.peer,
                at: connection.own.ip(),
                is_own_user: own_user.has(connection.peer, connection.own),
                is_encrypted: false,
            };
            match self.server.accept(peer, now) {
                Some(id) => _ = self.connections.insert(connection.key, id),
                None => {
                    // What the kernel does not take of so few bytes is not worth waiting for.
                    let _ = self.sockets.write(connection.key, BUSY);
                    self.sockets.close(connection.key);
                }
            }
        }
    }

    fn close(&mut self, key: ConnectionKey, now: MonotonicNs) {
        self.sockets.close(key);
        if let Some(id) = self.connections.remove(&key) {
            self.server.closed(id, now);
        }
    }

    /// Answers with the files that were read.
    fn take_files(&mut self, now: MonotonicNs) {
        for (connection, request, bytes) in self.files.iter_mut().flat_map(Files::found) {
            self.server.file(connection, request, bytes, now);
        }
    }

    /// Looks at the robots, when it is time to, and says what is new.
    fn look(&mut self, now: MonotonicNs) {
        if now >= self.next_look {
            let period = match self.server.has_viewers() {
                true => WATCHED_PERIOD,
                false => UNWATCHED_PERIOD,
            };
            // A machine that stalls does not make up for it.
            self.next_look = (self.next_look + period).max(now + period / 2);
            self.sockets.recover();
            let clock = self.clock(now);
            self.server.set_wall_clock(clock.zero_unix_ns);
            match &mut self.playback {
                Some(playback) => playback.look(&mut self.server, &mut self.speaker, now),
                None => self.look_at_robots(now),
            }
        }
        self.report(now);
    }

    /// Ends the movements of pages that no page commands any more, where the configuration wants that.
    fn hold_deserted(&mut self, now: MonotonicNs) {
        let server = &self.server;
        let is_commanded = |robot| server.is_commanded(robot);
        let robots = self.fleet.under_way();
        let due = self.orders.deserted(robots, is_commanded, now);
        for robot in due {
            let text = "no page commands any more and a movement of one goes on: hold";
            tracing::warn!(robot, "{text}");
            if let Some(shown) = self.fleet.get_mut(robot) {
                shown.robot.journal.add(now, Weight::Alarm, text.to_owned());
            }
            if self.send_own(robot, RobotOrder::Hold, now) {
                self.orders.note_held(robot);
            }
        }
    }

    /// Takes the bridge's control for the page that commands, or gives it back, where control is exclusive.
    fn pass_control(&mut self, robot: u32, now: MonotonicNs) {
        let is_commanded = self.server.is_commanded(robot);
        let state = self.fleet.get_mut(robot).and_then(|one| one.robot.state);
        if state.is_some_and(|state| state.control.exclusive != 0 && !state.is_replayed()) {
            let order = match is_commanded {
                true => RobotOrder::TakeControl,
                false => RobotOrder::ReleaseControl,
            };
            self.send_own(robot, order, now);
        }
    }

    /// Orders something that no page has ordered; says whether it was sent. What becomes of it is in the robot's
    /// journal.
    fn send_own(&mut self, robot: u32, order: RobotOrder, now: MonotonicNs) -> bool {
        let Some(shown) = self.fleet.get_mut(robot) else {
            return false;
        };
        let sent = shown.send(order, now, &self.requests, now);
        if let Err(why) = &sent {
            tracing::warn!(robot, why, "an order of the view itself could not be sent");
        }
        sent.is_ok()
    }

    fn look_at_robots(&mut self, now: MonotonicNs) {
        if self.fleet.look(now) {
            self.server.set_robots(self.fleet.ids());
        }
        // To join robots takes time: by the clock before it, what came meanwhile would be of the future.
        let now = self.fleet.drain(MonotonicNs::now);
        self.hold_deserted(now);
        let clock = self.clock(now);
        self.speaker
            .speak(self.fleet.seen(), &mut self.server, clock, now);
        self.foxglove
            .drain(&mut self.fleet, &mut self.server, clock);
    }

    /// Says what became of orders and checks.
    fn report(&mut self, now: MonotonicNs) {
        for shown in self.fleet.iter_mut() {
            shown.ports.drain_reports(&mut shown.robot, now);
            let robot = shown.robot.id.get();
            for news in shown.ports.take_news() {
                if let Some(report) = self.orders.report(robot, &news) {
                    self.server.order(&report);
                }
            }
        }
        for (viewer, answer) in self.checks.answers(now) {
            self.server.check(viewer, &answer);
        }
    }

    /// Does what pages want; says whether they wanted something.
    fn take_events(&mut self, now: MonotonicNs) -> bool {
        let mut wanted = false;
        while let Some(event) = self.server.poll_event() {
            wanted = true;
            match event {
                Event::Joined { viewer, robot } => self.join(viewer, robot, now),
                Event::Order {
                    viewer: _,
                    order,
                    issued,
                    from,
                } => {
                    let Some(shown) = self.fleet.get_mut(order.robot) else {
                        continue;
                    };
                    let given = GivenOrder {
                        order: &order,
                        issued,
                        from: &from,
                    };
                    let report = self.orders.take(&given, shown, &self.requests, now);
                    self.server.order(&report);
                }
                Event::Check { viewer, check } => {
                    let Some(shown) = self.fleet.get_mut(check.robot) else {
                        continue;
                    };
                    if let Some(answer) = self.checks.take(viewer, &check, shown, now) {
                        self.server.check(viewer, &answer);
                    }
                }
                Event::NotSent { order, from, text } => {
                    let (robot, kind, order) = (order.robot, order.kind, &order.order);
                    tracing::info!(robot, ?kind, order, from, "order not sent: {text}");
                }
                Event::Lease { robot, text } => {
                    tracing::info!(robot, "{text}");
                    if let Some(shown) = self.fleet.get_mut(robot) {
                        shown.robot.journal.add(now, Weight::Order, text);
                    }
                    self.pass_control(robot, now);
                }
                Event::Replay { request, .. } => {
                    if let Some(playback) = &mut self.playback {
                        playback.take(&request, now);
                        self.next_look = now;
                    }
                }
                Event::File {
                    connection,
                    request,
                } if request.wanted == Wanted::Metrics => {
                    let robots: Vec<_> = self.fleet.seen().map(|seen| seen.robot).collect();
                    let text = metrics::text(&robots, now);
                    self.server
                        .file(connection, request, Some(text.into_bytes()), now);
                }
                Event::File {
                    connection,
                    request,
                } => {
                    let files = self.files.as_ref();
                    if !files.is_some_and(|files| files.ask(connection, request)) {
                        self.server.file(connection, request, None, now);
                    }
                }
                Event::Subscribed(_) => {
                    if let Some(playback) = &mut self.playback {
                        playback.subscribed(now);
                    }
                }
                Event::Rejected { from, why, count } => {
                    tracing::warn!(from, count, "{why}");
                }
            }
        }
        wanted
    }

    /// A page has come, or looks at another robot.
    fn join(&mut self, viewer: crate::ViewerId, robot: u32, now: MonotonicNs) {
        if let Some(playback) = &mut self.playback {
            playback.join(viewer, &mut self.server, &mut self.speaker, now);
            self.next_look = now;
            return;
        }
        let clock = self.clock(now);
        let Some(shown) = self.fleet.get_mut(robot) else {
            return;
        };
        let past = messages::past(&shown.robot, clock);
        self.server.past(viewer, &past);
        self.speaker.joined(robot);
        self.next_look = now;
        self.look(now);
    }

    /// Writes what waits, and closes what has ended.
    fn send(&mut self, now: MonotonicNs) {
        let keys: Vec<(ConnectionKey, ConnectionId)> = self
            .connections
            .iter()
            .map(|(key, id)| (*key, *id))
            .collect();
        for (key, id) in keys {
            let mut is_gone = false;
            let waits = loop {
                let output = self.server.output(id);
                if output.is_empty() {
                    let is_flushed = self.sockets.flush(key);
                    is_gone = is_flushed.is_none();
                    break is_flushed == Some(false);
                }
                match self.sockets.write(key, output) {
                    Some(0) => break true,
                    Some(count) => self.server.sent(id, count, now),
                    None => {
                        is_gone = true;
                        break false;
                    }
                }
            };
            if is_gone || !waits && self.server.is_ended(id) {
                self.close(key, now);
            } else {
                self.sockets.wait_to_write(key, waits);
            }
        }
    }

    /// The clocks. Foxglove clients keep what they have by the time of day, which is another one when the wall clock
    /// was set.
    fn clock(&mut self, now: MonotonicNs) -> Clocks {
        let (clock, was_set) = self.wall_clock.look(now);
        if was_set && self.playback.is_none() {
            tracing::warn!("the clock was set: Foxglove clients begin anew");
            self.server.restart_foxglove(clock.zero_unix_ns.to_string());
        }
        clock
    }
}

impl Process for ViewShell {
    type Error = ViewError;
    type Key = ();

    const ROLE: SchedulingRole = SchedulingRole::Consumer;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.descriptor((), self.sockets.descriptor());
        if let Some(files) = &self.files {
            sources.descriptor((), files.descriptor());
        }
        for descriptor in self.checks.descriptors() {
            sources.descriptor((), descriptor);
        }
        for client in self.fleet.sources(MAX_CLIENTS) {
            sources.port(client);
        }
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), ViewError> {
        let now = MonotonicNs::now();
        self.take_bytes(now)?;
        self.take_files(now);
        self.server.advance(now);
        for _ in 0..MAX_ROUNDS {
            // Orders are judged by a time after their bytes were read: a process may stand still between a look at the
            // clock and the read.
            let now = MonotonicNs::now();
            let wanted = self.take_events(now);
            self.look(now);
            self.send(now);
            // What a connection had sent before may be read when its output is written, and may want something.
            if !wanted {
                break;
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        [
            Some(self.next_look),
            self.server.deadline(),
            self.fleet.next_order(),
            self.checks.deadline(),
        ]
        .into_iter()
        .flatten()
        .min()
    }
}
