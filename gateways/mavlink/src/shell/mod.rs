//! `MavlinkShell`: the gateway's loop: its socket, the robot's ports and the deadlines in the one wait of every
//! process. `OwnTopic`: what it publishes of itself.
//!
//! * `ports`: what it reads and orders of the robot;
//! * `state`: what it keeps over restarts; `keeper`: the thread that writes that; `fence`: a fence of a station in the
//!   bridge's file;
//! * [`key`]: the key of signatures, from its file;
//! * [`status`]: `ril mavlink status`.

pub(crate) mod fence;
pub(crate) mod keeper;
pub mod key;
pub(crate) mod ports;
pub(crate) mod state;
pub mod status;

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::os::fd::AsFd;
use std::time::Duration;

use ipc_types::payload::{MavlinkStation, MavlinkStations};
use ipc_types::{Ipc, MonotonicNs, Publisher, SchedulingRole, Source, WaitError, Wake};
use module_kit::process::{Process, Sources};
use operator::fence_file::FenceChange;
use runtime::datagrams::{Datagram, StampedSocket};
use runtime::exit::{ExitCode, Failure, OrFail};

use self::keeper::{END_LIMIT, Job, Keeper, Written};
use self::ports::Ports;
use crate::{Event, Gateway, Task};

/// Datagrams that are read at one wake, so that a flood cannot starve telemetry and reports.
const MAX_DATAGRAMS: usize = 64;

/// Bytes of a datagram that are read: more than seven of the longest frames.
const MAX_BYTES: usize = 2048;

/// How often orders and datagrams that came of others are looked at before the process sleeps.
const RETRY: Duration = Duration::from_millis(10);

/// Most answers that wait for a socket that is full. Of more the oldest go: stations repeat what they get no answer
/// for.
const MAX_WAITING: usize = 16;

/// Why a gateway cannot go on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MavlinkError {
    /// The operating system cannot wait any more.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// A service cannot be opened.
    #[error("{0}")]
    Service(String),
}

impl From<Failure> for MavlinkError {
    fn from(failure: Failure) -> MavlinkError {
        MavlinkError::Service(failure.chain().join(": "))
    }
}

/// The gateway's loop: its socket, the robot's ports and the deadlines in one wait.
pub(crate) struct MavlinkShell {
    socket: StampedSocket,
    ports: Ports,
    topic: OwnTopic,
    gateway: Gateway,
    keeper: Keeper,
    /// Until when the end of the process waits for the keeper, once it is asked for.
    end_by: Option<MonotonicNs>,
    /// The last change of the bridge's file, until the next one.
    fence: Option<FenceChange>,
    /// Answers that the socket did not take.
    waiting: VecDeque<crate::Datagram>,
    retry_at: Option<MonotonicNs>,
    deadline: Option<MonotonicNs>,
}

impl MavlinkShell {
    pub fn new(
        socket: StampedSocket,
        ports: Ports,
        topic: OwnTopic,
        keeper: Keeper,
        gateway: Gateway,
    ) -> MavlinkShell {
        MavlinkShell {
            socket,
            ports,
            topic,
            gateway,
            keeper,
            end_by: None,
            fence: None,
            waiting: VecDeque::new(),
            retry_at: None,
            deadline: None,
        }
    }

    fn read(&mut self) {
        let mut buffer = [0; MAX_BYTES];
        for _ in 0..MAX_DATAGRAMS {
            match self.socket.receive(&mut buffer) {
                Ok(Datagram { length, from, came }) => {
                    // Read behind the datagram: one that came while the process was stopped is not of now.
                    let now = MonotonicNs::now();
                    let came = MonotonicNs(u64::try_from(came.as_nanos()).unwrap_or(now.0));
                    self.gateway.datagram(from, &buffer[..length], came, now);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                // Such as that a station which was sent something is gone.
                Err(error) => tracing::debug!(%error, "nothing was received"),
            }
        }
    }

    /// Does what the gateway wants; what comes of it may make it want more.
    fn work(&mut self, now: MonotonicNs) -> Result<(), Failure> {
        loop {
            while let Some(order) = self.gateway.poll_order() {
                self.ports.send(order, &mut self.gateway, now)?;
            }
            match self.gateway.poll_task() {
                None => return Ok(()),
                Some(Task::Rules) => self.ports.ask_rules(now)?,
                Some(Task::PutFence(areas)) => {
                    self.keeper
                        .keep(Job::PutFence(self.ports.bridge_file(), areas));
                }
                Some(Task::RestoreFence) => match self.fence.take() {
                    Some(change) => self.keeper.keep(Job::RestoreFence(change)),
                    None => self.gateway.fence_restored(Ok(()), now),
                },
                Some(Task::Save(mission)) => self.keeper.keep(Job::Mission(mission)),
            }
            self.ports.take_rules(&mut self.gateway, now);
        }
    }

    fn write(&mut self, now: MonotonicNs) {
        self.retry_at = None;
        let mut before = std::mem::take(&mut self.waiting);
        while let Some(datagram) = before.pop_front().or_else(|| self.gateway.poll_datagram()) {
            if !is_full(self.socket.send_to(&datagram.bytes, datagram.to)) {
                continue;
            }
            if datagram.is_telemetry {
                self.topic.dropped += 1;
                continue;
            }
            if self.waiting.len() == MAX_WAITING {
                self.topic.dropped += 1;
                self.waiting.pop_front();
            }
            self.waiting.push_back(datagram);
            self.retry_at = Some(now + RETRY);
        }
    }

    /// Tells the gateway what is on the disk.
    fn take_written(&mut self, now: MonotonicNs) -> Result<(), Failure> {
        while let Some(written) = self.keeper.written().or_fail(ExitCode::Internal)? {
            match written {
                Written::Mission(mission, result) => self.gateway.saved(mission, result, now),
                Written::Fence(put) => {
                    let areas = put.map(|change| self.fence.insert(change).areas);
                    self.gateway.fence_put(areas, now);
                }
                Written::RestoredFence(restored) => self.gateway.fence_restored(restored, now),
                Written::Other => {}
            }
        }
        Ok(())
    }

    /// Has the disk keep what the next start needs.
    fn keep(&mut self, now: MonotonicNs) {
        if let Some(timestamp) = self.gateway.poll_timestamp() {
            self.keeper.keep(Job::Timestamp(timestamp));
        }
        if let Some(progress) = self.gateway.poll_progress(now) {
            self.keeper.keep(Job::Progress(progress.encode()));
        }
        if let Some(home) = self.gateway.poll_home(now) {
            // Without a bridge there is no flight that it could belong to.
            let kept = home.zip(self.ports.bridge_run());
            let text = kept.map_or_else(String::new, |(home, bridge)| home.encode(bridge));
            self.keeper.keep(Job::Home(text));
        }
    }

    fn log(&mut self) {
        while let Some(event) = self.gateway.poll_event() {
            match event {
                Event::Note(text) | Event::Commanded(text) => tracing::info!("{text}"),
                Event::Warning(text) => tracing::warn!("{text}"),
            }
        }
    }
}

/// Whether the socket took nothing because it is full. That a station is gone is seen by its silence.
fn is_full(sent: io::Result<usize>) -> bool {
    sent.is_err_and(|error| error.kind() == ErrorKind::WouldBlock)
}

impl Process for MavlinkShell {
    type Error = MavlinkError;
    type Key = ();

    const ROLE: SchedulingRole = SchedulingRole::Consumer;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.descriptor((), self.socket.as_fd());
        sources.descriptor((), self.keeper.as_fd());
        sources.port(self.topic.source());
        for port in self.ports.sources(self.gateway.has_stations()) {
            sources.port(port);
        }
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), MavlinkError> {
        self.ports.drain(&mut self.gateway);
        self.read();
        let now = MonotonicNs::now();
        self.gateway.advance(now);
        self.ports.take_rules(&mut self.gateway, now);
        self.take_written(now)?;
        self.work(now)?;
        self.keep(now);
        self.write(now);
        self.log();
        self.topic.service(&self.gateway, now);
        let deadlines = [self.gateway.deadline(), self.ports.deadline()];
        self.deadline = deadlines.into_iter().flatten().min();
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let own = Some(self.topic.deadline());
        [self.deadline, self.retry_at, self.end_by, own]
            .into_iter()
            .flatten()
            .min()
    }

    fn may_end(&mut self, now: MonotonicNs) -> bool {
        let end_by = *self.end_by.get_or_insert(now + END_LIMIT);
        let is_over = now >= end_by;
        if is_over && !self.keeper.is_idle() {
            tracing::warn!("the disk does not answer: what was last to be kept is not");
        }
        is_over || self.keeper.is_idle()
    }
}

/// How often it is published though nothing has changed. Counts alone are no change, so that a flood is none.
const OWN_PERIOD: Duration = Duration::from_millis(900);

/// What the gateway publishes of itself, for `ril mavlink status` and `ril doctor`.
pub(crate) struct OwnTopic {
    port: Publisher<MavlinkStations>,
    last: MavlinkStations,
    next: MonotonicNs,
    /// Datagrams that a full socket did not take.
    pub dropped: u64,
}

impl OwnTopic {
    /// # Errors
    ///
    /// Another gateway of this robot runs, or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<OwnTopic, Failure> {
        Ok(OwnTopic {
            port: ipc.publisher().or_fail(ExitCode::Internal)?,
            last: MavlinkStations::default(),
            next: MonotonicNs(0),
            dropped: 0,
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut self.port
    }

    /// When it is published at the latest.
    pub fn deadline(&self) -> MonotonicNs {
        self.next
    }

    /// Publishes it when it has changed, or is due.
    pub fn service(&mut self, gateway: &Gateway, now: MonotonicNs) {
        self.port.service();
        let mut sample = self.last;
        gateway.describe(&mut sample, now);
        sample.datagrams_dropped = self.dropped;
        if now < self.next && seen_at_once(&sample) == seen_at_once(&self.last) {
            return;
        }
        self.last = sample;
        self.next = now + OWN_PERIOD;
        if let Err(error) = self.port.publish(|place| *place = sample) {
            tracing::debug!(%error, "the stations cannot be published");
        }
    }
}

/// What is published at once when it changes.
fn seen_at_once(sample: &MavlinkStations) -> (u32, Vec<[u64; 7]>) {
    let station = |one: &MavlinkStation| {
        [
            one.since_ns,
            one.commands,
            one.system.into(),
            one.component.into(),
            one.may_command.into(),
            one.is_lost.into(),
            one.has_movement.into(),
        ]
    };
    (
        sample.vehicle,
        sample.stations().iter().map(station).collect(),
    )
}
