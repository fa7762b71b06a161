//! [`Bridge`]: the whole bridge as one value, without a thread, a file or a clock.
//!
//! It is given the time and one [`Input`]: the port opened or closed, bytes, a request, a deadline. While it works it
//! speaks through [`Outputs`]; afterwards there may be bytes to write ([`Bridge::transmit`]) and there is a next
//! deadline ([`Bridge::deadline`]). That is all a driver needs to know, be it the shell, a simulation in virtual time
//! or a replay of a [journal](crate::journal), which records exactly this.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, LinkState, ModuleId, Reason};
use ipc_types::payload::{
    ControlSender, DspErrorCounters, DspTelemetry, ModuleControl, ModuleState, MovementData,
    ParameterRequest, RequestReport,
};
use module_kit::journal::{NotASnapshot, raw};
use serde::{Deserialize, Serialize};

use crate::config::{BridgeConfig, MovementLimits, ParametersConfig};
use crate::flight::control::Sender;
use crate::flight::request::{
    Parsed, Request, RequestKey, judged_by_clock, parse_control, parse_movement, parse_parameter,
};
use crate::flight::trajectory::{Trajectory, generator};
use crate::flight::{Context, Flight};
use crate::link::last_minute::LastMinute;
use crate::link::line::Line;
use crate::link::session::DspPath;
use crate::link::{Link, LinkEvent};
use crate::outline::Outline;
use crate::outputs::{Notice, Outputs};
use crate::safety::fence::Fence;
use crate::{errors, translate};

/// A state may be published early by this part of its period, if the bridge is awake anyway.
const EARLY: u32 = 5;

/// What the core can be given. A journal has inputs as this enum in postcard's format, see `docs/journal.md`.
///
/// `sender` is what is known of the process that sent a request: from it follows who commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Input<'a> {
    /// The serial port was opened.
    PortOpened(Line),
    /// The serial port is gone.
    PortClosed,
    /// Bytes arrived from the DSP. All of them are handled.
    Received(&'a [u8]),
    /// A control request arrived.
    Control {
        /// To whom the reports go.
        key: RequestKey,
        /// From whom.
        sender: Sender,
        /// The request.
        #[serde(with = "raw")]
        request: ModuleControl,
    },
    /// A control request to reload the geofence arrived.
    NewFence {
        /// To whom the reports go.
        key: RequestKey,
        /// From whom.
        sender: Sender,
        /// The request.
        #[serde(with = "raw")]
        request: ModuleControl,
        /// What the configuration says now, or why it cannot be used.
        #[serde(with = "read_fence")]
        fence: Result<Fence, Reason>,
    },
    /// A movement request arrived.
    Movement {
        /// To whom the reports go.
        key: RequestKey,
        /// From whom.
        sender: Sender,
        /// The request.
        #[serde(with = "raw")]
        request: MovementData,
    },
    /// A parameter request arrived.
    Parameter {
        /// To whom the reports go.
        key: RequestKey,
        /// From whom.
        sender: Sender,
        /// The request.
        #[serde(with = "raw")]
        request: ParameterRequest,
    },
    /// The sender of a request is gone; reports to it would be lost.
    SenderGone(RequestKey),
    /// Time has passed: every deadline up to now is handled. Cheap if there is none.
    Advance,
    /// The bridge is about to end: a path ends, no request is taken any more, and the DSP's path buffer is emptied. The
    /// driver goes on until [`Bridge::has_wound_down`], for a bounded time, and then gives [`Input::Close`].
    WindDown,
    /// The bridge is ending: every open request gets its final report, and the state is published once more.
    Close,
    /// The bytes for the port are asked for: [`Bridge::transmit`].
    Transmit,
    /// The port took so many of them, from the first on.
    Transmitted(usize),
    /// The kernel was made to discard what it had not sent: [`Bridge::take_discard_unsent`].
    DiscardUnsent,
    /// A process has ended: that with whose end a sender ends, [`Bridge::controller`], or that of
    /// [`Bridge::path_sender`].
    ProcessEnded(u32),
    /// The machine was suspended for so many nanoseconds since the input before, which the host's monotonic clock does
    /// not count.
    Suspended(u64),
    /// The sender of the path that is [leased](Bridge::lease) renewed that at this moment, host monotonic.
    LeaseRenewed(MonotonicNs),
}

/// A geofence as its text in `bridge.toml`, or the number of the reason.
mod read_fence {
    use super::{Fence, Reason};
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::{Error as _, Serialize, Serializer};

    type Read = Result<Fence, Reason>;

    pub fn serialize<S: Serializer>(fence: &Read, to: S) -> Result<S::Ok, S::Error> {
        let read = match fence {
            Ok(fence) => Ok(toml::to_string(fence).map_err(S::Error::custom)?),
            Err(reason) => Err(reason.code()),
        };
        read.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Read, D::Error> {
        match Result::<&str, u32>::deserialize(from)? {
            Ok(text) => runtime::config::parse(text, "the journal")
                .map(Ok)
                .map_err(D::Error::custom),
            Err(code) => Reason::from_code(code)
                .map(Err)
                .ok_or_else(|| D::Error::custom("no reason has this number")),
        }
    }
}

/// The bridge's whole state: link, flight, safety rules and what is published, driven by [`apply`](Bridge::apply).
#[derive(Debug, Serialize, Deserialize)]
pub struct Bridge {
    #[serde(skip)]
    limits: MovementLimits,
    #[serde(skip)]
    state_period: Duration,
    link: Link,
    flight: Flight,
    #[serde(with = "raw")]
    dsp_errors: DspErrorCounters,
    last_minute: LastMinute,
    #[serde(with = "raw")]
    published: ModuleState,
    next_state: MonotonicNs,
    /// Number of the outline that holds; 0 before the first input.
    outline: u64,
    /// Something changed that the published state shows at once.
    is_changed: bool,
    /// The port was closed because the bridge ends, which is no trouble.
    is_closed: bool,
    clock: CoreClock,
}

/// The core's clock: the host's monotonic one, and the time for which the machine was suspended. So whatever waits,
/// waits no longer than it should, and a suspension is to the core as if the bridge had stood still. Requests are
/// translated when they come, and what is published when it goes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct CoreClock {
    /// For how long the machine was suspended since the bridge began.
    suspended: Duration,
    /// The last suspensions, the newest one last.
    resumes: [Resume; RESUMES],
    /// The last input, host monotonic. In no snapshot: bytes are asked for more often than the journal has it.
    #[serde(skip)]
    last: MonotonicNs,
}

/// The end of a suspension.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Resume {
    /// When it was noticed, host monotonic; 0 for none.
    at: MonotonicNs,
    /// For how long the machine was suspended before this one.
    before: Duration,
}

/// So many suspensions are known apart. A moment from before that many counts as one from before all: no order gets
/// younger by that.
const RESUMES: usize = 8;

impl CoreClock {
    /// The present moment. It never runs backwards: timers and comparisons of moments rest on that.
    fn enter(&mut self, host: MonotonicNs) -> MonotonicNs {
        debug_assert!(host >= self.last, "{host:?} after {:?}", self.last);
        self.last = self.last.max(host);
        host + self.suspended
    }

    fn resume(&mut self, host: MonotonicNs, slept: Duration) {
        self.resumes.rotate_left(1);
        self.resumes[RESUMES - 1] = Resume {
            at: host,
            before: self.suspended,
        };
        self.suspended += slept;
    }

    /// A moment of the core by the host's clock.
    fn host(&self, moment: MonotonicNs) -> MonotonicNs {
        match self.suspended.is_zero() || moment == MonotonicNs(0) {
            true => moment,
            // 0 stands for never.
            false => (moment - self.suspended).max(MonotonicNs(1)),
        }
    }

    /// Makes moments of the core those of the host's clock.
    fn write(&self, moments: &mut [&mut u64]) {
        for moment in moments {
            **moment = self.host(MonotonicNs(**moment)).0;
        }
    }

    /// A moment by the host's clock as one by the core's.
    fn at(&self, host: MonotonicNs) -> MonotonicNs {
        let next = self.resumes.iter().position(|resume| host < resume.at);
        host + match next {
            None => self.suspended,
            Some(0) => Duration::ZERO,
            Some(next) => self.resumes[next].before,
        }
    }

    /// The moments of a request by the core's clock: when it was issued, and until when it may begin. 0 stays what it
    /// is.
    fn translate(&self, issued_ns: &mut u64, begin_by_ns: &mut u64) {
        let issued = MonotonicNs(*issued_ns);
        let suspended = self.at(issued).0.saturating_sub(issued.0);
        for moment in [issued_ns, begin_by_ns] {
            if *moment > 0 {
                *moment = moment.saturating_add(suspended);
            }
        }
    }
}

/// Outputs whose moments go back to the host's clock.
struct HostTime<'a> {
    out: &'a mut dyn Outputs,
    clock: CoreClock,
}

impl Outputs for HostTime<'_> {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let clock = self.clock;
        self.out.telemetry(&mut |sample| {
            fill(sample);
            clock.write(&mut [&mut sample.received_ns, &mut sample.sent_ns]);
        });
    }

    fn state(&mut self, state: &ModuleState) {
        let mut state = *state;
        let (link, control) = (&mut state.link, &mut state.control);
        self.clock.write(&mut [
            &mut link.last_message_ns,
            &mut link.last_telemetry_ns,
            &mut link.state_since_ns,
            &mut control.since_ns,
            &mut control.last_order_ns,
            &mut state.last_end.ended_ns,
        ]);
        self.out.state(&state);
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let mut report = *report;
        self.clock.write(&mut [&mut report.reported_ns]);
        self.out.report(to, &report);
    }

    fn sent(&mut self, bytes: &[u8]) {
        self.out.sent(bytes);
    }

    fn notice(&mut self, notice: &Notice) {
        self.out.notice(notice);
    }
}

impl Bridge {
    /// A bridge without a port that waits for its start, with the trajectory generator of the configuration.
    pub fn new(config: &BridgeConfig) -> Self {
        Bridge::with_trajectory(config, generator(&config.trajectory))
    }

    /// A bridge with another trajectory generator between the waypoints and the DSP.
    pub fn with_trajectory(config: &BridgeConfig, trajectory: Box<dyn Trajectory>) -> Self {
        Bridge {
            limits: config.movement.clone(),
            state_period: config.state.period(),
            link: Link::new(config),
            flight: Flight::new(config, trajectory),
            dsp_errors: DspErrorCounters::default(),
            last_minute: LastMinute::default(),
            published: ModuleState::default(),
            next_state: MonotonicNs(0),
            outline: 0,
            is_changed: true,
            is_closed: false,
            clock: CoreClock::default(),
        }
    }

    /// After a snapshot: takes over what the configuration says, and the geofence in force.
    ///
    /// # Errors
    /// The snapshot cannot be one.
    pub(crate) fn configure(
        &mut self,
        config: &BridgeConfig,
        fence: Fence,
    ) -> Result<(), NotASnapshot> {
        self.limits = config.movement.clone();
        self.state_period = config.state.period();
        self.link.configure(config);
        self.flight
            .configure(config, generator(&config.trajectory), fence)
    }

    /// The parameters `new` in the place of `old`, unless others were set at run time.
    pub(crate) fn replace_parameters(&mut self, old: &ParametersConfig, new: &ParametersConfig) {
        if self.link.parameters() == old {
            *self.link.parameters_mut() = new.clone();
        }
    }

    /// The geofence in force.
    pub fn fence(&self) -> &Fence {
        self.flight.fence()
    }

    /// What is published of the fence and of the path that is held.
    pub fn outline(&self) -> Outline<'_> {
        Outline {
            number: self.outline,
            fence: self.fence(),
            path: self.flight.held_path(),
        }
    }

    /// The process whose end ends the control that its sender has; `None` if control is free, or the process is not
    /// known.
    pub fn controller(&self) -> Option<u32> {
        self.flight.control().lives_as()
    }

    /// The process of the sender of the path under way, if the path depends on that.
    pub fn path_sender(&self) -> Option<u32> {
        self.flight.path_process()
    }

    /// The path under way whose sender renews it, and until when, host monotonic: when that has come, look whether it
    /// was renewed before the deadlines are handled.
    pub fn lease(&self) -> Option<(u64, MonotonicNs)> {
        let (path_id, until) = self.flight.lease()?;
        Some((path_id, self.clock.host(until)))
    }

    /// Takes an input at `now`, host monotonic, which is not before that of the input before.
    pub fn apply(&mut self, now: MonotonicNs, input: Input<'_>, out: &mut dyn Outputs) {
        if let Input::Suspended(ns) = input {
            self.clock.resume(now, Duration::from_nanos(ns));
        }
        let now = self.clock.enter(now);
        let clock = self.clock;
        match clock.suspended.is_zero() {
            true => self.take(now, input, out),
            false => self.take(now, input, &mut HostTime { out, clock }),
        }
        if cfg!(debug_assertions) {
            self.link.assert_sound();
            self.flight.assert_sound();
        }
    }

    fn take(&mut self, now: MonotonicNs, input: Input<'_>, out: &mut dyn Outputs) {
        let link = &mut self.link;
        match input {
            Input::PortOpened(line) => link.opened(now, line),
            Input::PortClosed => link.closed(now),
            Input::Received(mut bytes) => {
                self.begin(now, out);
                while !bytes.is_empty() {
                    self.link.receive(now, &mut bytes);
                    self.handle_events(now, out);
                }
                self.link.end_read(now);
            }
            Input::Control {
                key,
                sender,
                mut request,
            } => {
                self.clock
                    .translate(&mut request.issued_ns, &mut request.begin_by_ns);
                let asked = parse_control((key, sender), &request, None, &self.limits);
                self.request(now, asked, out);
            }
            Input::NewFence {
                key,
                sender,
                mut request,
                fence,
            } => {
                self.clock
                    .translate(&mut request.issued_ns, &mut request.begin_by_ns);
                let asked = parse_control((key, sender), &request, Some(fence), &self.limits);
                self.request(now, asked, out);
            }
            Input::Movement {
                key,
                sender,
                mut request,
            } => {
                self.clock
                    .translate(&mut request.issued_ns, &mut request.begin_by_ns);
                let (header, movement) = parse_movement((key, sender), &request, &self.limits, now);
                let asked = (header, movement.map(Request::Movement));
                self.request(now, asked, out);
            }
            Input::Parameter {
                key,
                sender,
                mut request,
            } => {
                self.clock
                    .translate(&mut request.issued_ns, &mut request.begin_by_ns);
                let asked = parse_parameter((key, sender), &request, &self.limits);
                self.request(now, asked, out);
            }
            Input::SenderGone(key) => self
                .flight
                .sender_gone(key, &mut Context { now, link, out }),
            Input::ProcessEnded(process) => {
                self.flight
                    .process_ended(process, &mut Context { now, link, out });
            }
            // A lease does not run while the machine sleeps, whenever it was renewed.
            Input::LeaseRenewed(at) => {
                let at = at + self.clock.suspended;
                self.flight.lease_renewed(at.min(now));
            }
            Input::Advance => self.advance(now, out),
            Input::WindDown => self.flight.wind_down(&mut Context { now, link, out }),
            Input::Close => {
                self.flight.close(&mut Context { now, link, out });
                self.is_closed = true;
                self.link.closed(now);
                self.next_state = now;
            }
            Input::Transmit => {
                link.transmit(now);
                return;
            }
            Input::Suspended(ns) => {
                let slept = Duration::from_nanos(ns);
                link.suspended(now, slept);
                self.flight.suspended(slept, now);
                self.advance(now, out);
            }
            Input::Transmitted(count) => {
                let unsent = link.unsent();
                out.sent(&unsent[..count.min(unsent.len())]);
                return link.transmitted(count);
            }
            Input::DiscardUnsent => {
                self.take_discard_unsent();
                return;
            }
        }
        self.publish_if_due(now, out);
    }

    /// Whether the DSP holds nothing that would be flown without the bridge, as far as it can be reached.
    pub fn has_wound_down(&self) -> bool {
        self.link.path() == DspPath::Empty || !self.link.is_up()
    }

    /// The bytes to write to the port now; [`Input::Transmitted`] says how many of them were. With none, nothing has
    /// happened.
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        let now = self.clock.enter(now);
        self.link.transmit(now)
    }

    /// The bytes of the last [`Bridge::transmit`] that have not been written.
    pub fn unsent(&self) -> &[u8] {
        self.link.unsent()
    }

    /// Whether bytes that the kernel has not sent yet should be discarded, because what they say was given up. Asking
    /// resets the answer.
    pub fn take_discard_unsent(&mut self) -> bool {
        self.link.take_discard_unsent()
    }

    /// When [`Input::Advance`] has something to do. There always is a next state to publish.
    pub fn deadline(&self) -> MonotonicNs {
        let next = [self.link.deadline(), self.flight.deadline()]
            .into_iter()
            .flatten()
            .fold(self.next_state, MonotonicNs::min);
        next - self.clock.suspended
    }

    /// How many bytes of the message that has begun on the line are missing at least; 0 when none has.
    pub fn missing(&self) -> usize {
        self.link.missing()
    }

    /// State of the link.
    pub fn link(&self) -> LinkState {
        self.link.state()
    }

    /// The state as last published.
    pub fn state(&self) -> &ModuleState {
        &self.published
    }

    /// First of most inputs: what the time that has passed since the one before says of the DSP.
    fn begin(&mut self, now: MonotonicNs, out: &mut dyn Outputs) {
        self.link.begin_input(now);
        self.handle_events(now, out);
    }

    fn request(&mut self, now: MonotonicNs, asked: Parsed<Request>, out: &mut dyn Outputs) {
        self.begin(now, out);
        let (header, request) = judged_by_clock(asked, now);
        let link = &mut self.link;
        self.flight
            .request(&header, request, &mut Context { now, link, out });
    }

    fn advance(&mut self, now: MonotonicNs, out: &mut dyn Outputs) {
        self.begin(now, out);
        loop {
            let link_expired = self.link.expire(now);
            self.handle_events(now, out);
            let link = &mut self.link;
            let flight_expired = self.flight.expire(&mut Context { now, link, out });
            if !link_expired && !flight_expired {
                break;
            }
        }
    }

    fn handle_events(&mut self, now: MonotonicNs, out: &mut dyn Outputs) {
        while let Some(event) = self.link.poll_event() {
            match &event {
                LinkEvent::Sample(sample) => {
                    let boots = self.link.health().dsp_boots;
                    out.telemetry(&mut |telemetry| {
                        translate::dsp_telemetry(sample, boots, &self.dsp_errors, telemetry);
                    });
                    self.link.count_published(sample.received);
                }
                LinkEvent::DspError { code, .. } => {
                    errors::count(&mut self.dsp_errors, *code);
                    self.is_changed = true;
                }
                _ => {}
            }
            let link = &mut self.link;
            self.flight
                .link_event(&event, &mut Context { now, link, out });
        }
    }

    /// After every input: what the link said without a byte or deadline, and the state if it changed or is due.
    fn publish_if_due(&mut self, now: MonotonicNs, out: &mut dyn Outputs) {
        // A port that closes leaves an event behind.
        self.handle_events(now, out);
        if self.flight.take_outline_changed() {
            // In microseconds: another bridge begins later, so it has other numbers.
            self.outline = (self.outline + 1).max(now.0 / 1000);
            self.is_changed = true;
        }
        let is_due = now + self.state_period / EARLY >= self.next_state;
        let is_changed = std::mem::take(&mut self.is_changed)
            | self.link.take_changed()
            | self.flight.take_changed();
        if !is_due && !is_changed {
            return;
        }
        let state = self.compose_state(now);
        if is_due || differs(&state, &self.published) {
            out.state(&state);
            self.published = state;
            self.next_state = now + self.state_period;
        }
    }

    fn compose_state(&mut self, now: MonotonicNs) -> ModuleState {
        let (link, rejected) = (self.link.health(), *self.link.rejected());
        let last_minute = self.last_minute.look(now, &link, &rejected);
        let flight = &self.flight;
        let motion = flight.motion();
        let distance = flight.distance_to_go_m(now);
        let home = flight.home();
        let mut state = ModuleState {
            module_id: ModuleId::HeroBridge.code(),
            status: motion.status().code(),
            imi_error: self.error().code(),
            blocked: u32::from(motion.is_blocked()),
            functionality: motion.functionality(flight.is_receiving_path()).code(),
            unable_to_abort: u32::from(motion.unable_to_abort()),
            movement: *flight.movement(),
            last_end: *flight.last_end(),
            link,
            refused: rejected,
            dsp_errors: self.dsp_errors,
            safety: flight.safety_state(now),
            home_latitude_deg: home.map_or(0.0, |home| home.latitude_deg),
            home_longitude_deg: home.map_or(0.0, |home| home.longitude_deg),
            ground_altitude_m: home.map_or(0.0, |home| home.altitude_m),
            ground_valid: u32::from(home.is_some()),
            last_minute,
            outline: self.outline,
            control: flight.control().published(),
            ..ModuleState::default()
        };
        state.movement.distance_valid = u32::from(distance.is_some());
        state.movement.distance_to_go_m = distance.unwrap_or_default() as f32;
        state.refused.requests = flight.refused_requests();
        state.dsp_errors.escalated = flight.escalated();
        state
    }

    /// The error to publish: that of the module, or that of the link as long as it lasts (requirement H5).
    fn error(&self) -> ImiError {
        match self.flight.error() {
            ImiError::None if self.link.is_in_trouble() && !self.is_closed => {
                ImiError::CommunicationFatalError
            }
            error => error,
        }
    }
}

/// Whether something changed that must not wait for the next period. Counters, distances and the last process of the
/// same sender may wait.
fn differs(a: &ModuleState, b: &ModuleState) -> bool {
    let named = |sender: ControlSender| [sender.origin, sender.session];
    let key = |state: &ModuleState| {
        (
            (state.holder().map(named), state.asker().map(named)),
            [
                state.status,
                state.imi_error,
                state.blocked,
                state.functionality,
                state.unable_to_abort,
            ],
            [
                state.link.state,
                state.link.dsp_boots,
                state.link.port_openings,
                state.link.dsp_path,
                state.dsp_errors.total,
            ],
            [
                state.safety.rule,
                state.safety.action,
                state.safety.pilot_switch,
                state.safety.fence_areas,
                state.ground_valid,
            ],
            [
                state.movement.request_id,
                state.movement.path_id,
                state.last_end.ended_ns,
                state.outline,
            ],
            [
                state.movement.kind,
                state.movement.waypoints_sent,
                state.movement.waypoints_reached,
            ],
        )
    };
    key(a) != key(b)
}
