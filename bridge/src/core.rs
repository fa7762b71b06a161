//! [`Bridge`]: the whole bridge as one value, without a thread, a file or a clock.
//!
//! It is given the time and one input: the port opened or closed, bytes, a request, a deadline. While it works it speaks
//! through [`Outputs`]; afterwards there may be bytes to write ([`Bridge::transmit`]) and there is a next deadline
//! ([`Bridge::deadline`]). That is all a driver needs to know, be it the shell or a simulation in virtual time.

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, ModuleId};
use ipc_types::payload::{DspErrorCounters, ModuleControl, ModuleState, MovementData};

use crate::config::{BridgeConfig, MovementLimits};
use crate::flight::request::{RequestKey, parse_control, parse_movement};
use crate::flight::trajectory::{PassThrough, Trajectory};
use crate::flight::{Context, Flight};
use crate::line::{Line, LineEvent};
use crate::outputs::Outputs;
use crate::{errors, translate};

/// The part of its period by which a state may be early, so that a bridge that is awake shortly before need not wake again.
const EARLY: u32 = 5;

/// See the module's documentation.
#[derive(Debug)]
pub struct Bridge<T = PassThrough> {
    limits: MovementLimits,
    state_period: std::time::Duration,
    line: Line,
    flight: Flight<T>,
    dsp_errors: DspErrorCounters,
    published: ModuleState,
    next_state: MonotonicNs,
}

impl Bridge {
    /// A bridge without a port that waits for its start and passes waypoints through.
    pub fn new(config: &BridgeConfig) -> Self {
        Bridge::with_trajectory(config, PassThrough::new())
    }
}

impl<T: Trajectory> Bridge<T> {
    /// A bridge with a trajectory generator between the waypoints and the DSP.
    pub fn with_trajectory(config: &BridgeConfig, trajectory: T) -> Self {
        Bridge {
            limits: config.movement.clone(),
            state_period: config.state.period(),
            line: Line::new(config),
            flight: Flight::new(config, trajectory),
            dsp_errors: DspErrorCounters::default(),
            published: ModuleState::default(),
            next_state: MonotonicNs(0),
        }
    }

    /// The serial port was opened.
    pub fn port_opened<O: Outputs>(&mut self, now: MonotonicNs, out: &mut O) {
        self.line.opened(now);
        self.settle(now, out);
    }

    /// The serial port is gone.
    pub fn port_closed<O: Outputs>(&mut self, now: MonotonicNs, out: &mut O) {
        self.line.closed(now);
        self.settle(now, out);
    }

    /// Bytes arrived from the DSP. All of them are handled.
    pub fn receive<O: Outputs>(&mut self, now: MonotonicNs, mut bytes: &[u8], out: &mut O) {
        while let Some(event) = self.line.receive(now, &mut bytes) {
            self.line_event(now, &event, out);
        }
        self.settle(now, out);
    }

    /// A control request arrived.
    pub fn control<O: Outputs>(
        &mut self,
        now: MonotonicNs,
        key: RequestKey,
        control: &ModuleControl,
        out: &mut O,
    ) {
        let (envelope, command) = parse_control(key, control, &self.limits);
        let line = &mut self.line;
        self.flight
            .control_request(&envelope, command, &mut Context { now, line, out });
        self.settle(now, out);
    }

    /// A movement request arrived.
    pub fn movement<O: Outputs>(
        &mut self,
        now: MonotonicNs,
        key: RequestKey,
        data: &MovementData,
        out: &mut O,
    ) {
        let (envelope, movement) = parse_movement(key, data, &self.limits);
        let line = &mut self.line;
        self.flight
            .movement_request(&envelope, movement, &mut Context { now, line, out });
        self.settle(now, out);
    }

    /// The sender of a request is gone; reports to it would reach nobody.
    pub fn sender_gone<O: Outputs>(&mut self, now: MonotonicNs, key: RequestKey, out: &mut O) {
        let line = &mut self.line;
        self.flight
            .sender_gone(key, &mut Context { now, line, out });
        self.settle(now, out);
    }

    /// Time has passed: handles every deadline up to `now`. Cheap when there is none.
    pub fn advance<O: Outputs>(&mut self, now: MonotonicNs, out: &mut O) {
        while let Some(event) = self.line.expire(now) {
            self.line_event(now, &event, out);
        }
        let line = &mut self.line;
        self.flight.expire(&mut Context { now, line, out });
        self.settle(now, out);
    }

    /// The bridge is ending: every open request gets its final word, and the state is published once more.
    pub fn close<O: Outputs>(&mut self, now: MonotonicNs, out: &mut O) {
        let line = &mut self.line;
        self.flight.close(&mut Context { now, line, out });
        self.line.closed(now);
        self.next_state = now;
        self.settle(now, out);
    }

    /// The bytes to write to the port now; [`Bridge::transmitted`] says how many of them were.
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        self.line.transmit(now)
    }

    /// The first `count` bytes of [`Bridge::transmit`] have been written.
    pub fn transmitted(&mut self, count: usize) {
        self.line.transmitted(count);
    }

    /// Whether bytes that the kernel has not sent yet should be discarded, because what they say was given up. Asking
    /// resets the answer.
    pub fn take_discard_unsent(&mut self) -> bool {
        self.line.take_discard_unsent()
    }

    /// When [`Bridge::advance`] has something to do. There always is a next state to publish.
    pub fn deadline(&self) -> MonotonicNs {
        [self.line.deadline(), self.flight.deadline()]
            .into_iter()
            .flatten()
            .fold(self.next_state, MonotonicNs::min)
    }

    /// State of the link.
    pub fn link(&self) -> LinkState {
        self.line.state()
    }

    /// The state as last published.
    pub fn state(&self) -> &ModuleState {
        &self.published
    }

    fn line_event<O: Outputs>(&mut self, now: MonotonicNs, event: &LineEvent, out: &mut O) {
        match event {
            LineEvent::Sample(sample) => {
                let boots = self.line.health().dsp_boots;
                out.telemetry(|telemetry| {
                    translate::dsp_telemetry(sample, boots, &self.dsp_errors, telemetry)
                });
                self.line.count_published(sample.received);
            }
            LineEvent::DspError { code, .. } => errors::count(&mut self.dsp_errors, *code),
            _ => {}
        }
        let line = &mut self.line;
        self.flight
            .line_event(event, &mut Context { now, line, out });
    }

    /// After every input: what the line said without being asked, and the state if it changed or is due.
    fn settle<O: Outputs>(&mut self, now: MonotonicNs, out: &mut O) {
        // A port that closes leaves an event behind, without any byte or deadline.
        while let Some(event) = self.line.receive(now, &mut [].as_slice()) {
            self.line_event(now, &event, out);
        }
        let state = self.compose_state(now);
        let is_due = now + self.state_period / EARLY >= self.next_state;
        if is_due || differs(&state, &self.published) {
            out.state(&state);
            self.published = state;
            self.next_state = now + self.state_period;
        }
    }

    fn compose_state(&self, now: MonotonicNs) -> ModuleState {
        let flight = &self.flight;
        let manager = flight.manager();
        let distance = flight.distance_to_go_m(now);
        let mut state = ModuleState {
            module_id: ModuleId::HeroBridge.code(),
            status: manager.status().code(),
            imi_error: manager.error().code(),
            blocked: u32::from(manager.blocked()),
            functionality: flight
                .activity()
                .functionality(flight.receiving_path())
                .code(),
            unable_to_abort: u32::from(flight.activity().unable_to_abort()),
            movement: *flight.movement(),
            link: *self.line.health(),
            refused: *self.line.refused(),
            dsp_errors: self.dsp_errors,
            ..ModuleState::default()
        };
        state.movement.distance_valid = u32::from(distance.is_some());
        state.movement.distance_to_go_m = distance.unwrap_or_default() as f32;
        state.link.state = self.line.state().code();
        state.refused.requests = flight.refused_requests();
        state.dsp_errors.escalated = flight.transcended();
        state
    }
}

/// Whether something changed that must not wait for the next period. Counters and distances may.
fn differs(a: &ModuleState, b: &ModuleState) -> bool {
    let key = |state: &ModuleState| {
        (
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
                state.dsp_errors.total,
            ],
            [state.movement.request_id, state.movement.path_id],
            [
                state.movement.kind,
                state.movement.waypoints_sent,
                state.movement.waypoints_reached,
            ],
        )
    };
    key(a) != key(b)
}
