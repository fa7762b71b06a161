//! The whole simulator as a pure value: DSP, helicopter, the serial link to the PC and what goes wrong on it by a
//! script of faults, on a clock that the caller holds.
//!
//! It is given bytes and the time, and is drained of bytes. The time is simulated: a [`Duration`] since the simulator
//! started, which never goes back. A test jumps from deadline to deadline; a shell maps a real clock onto it.

use std::collections::VecDeque;
use std::num::NonZeroU32;
use std::time::Duration;

use dsp_protocol::{DspErrorCode, Profile};

use crate::device::Dsp;
use crate::device::firmware::Firmware;
use crate::device::ports::Ports;
use crate::faults::{
    Direction, DspEvent, FaultCounters, Happening, HelicopterEvent, Injector, PortState, Script,
};
use crate::helicopter::pilot::PilotSwitch;
use crate::helicopter::{Helicopter, Model};
use crate::serial_link::Lane;

/// Bytes from the PC that are on the serial link, in bytes: sixty waypoints, of which a PC that obeys flow control
/// sends one. More are left with the caller, as a full transmit queue of a serial port leaves them.
pub const INPUT_PLACES: usize = 1_024;
/// Bytes to the PC that have passed the serial link and that the caller has not fetched: 5 s of a serial link of
/// 115200 baud, more than any reader of a serial port may be late. Further ones are dropped and counted, as by a
/// receiver that overruns.
pub const OUTPUT_PLACES: usize = 65_536;

/// What is simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The helicopter and its world.
    pub model: Model,
    /// Speed of the serial link, bits per second; without a figure, bytes take no time.
    pub baud: Option<NonZeroU32>,
    /// Whether bytes from the PC reach the DSP at once, because a real port has already given them their time. Those
    /// to the PC are always sent at the speed of the link: a port that got them sooner would queue them, and what
    /// waits in its queue can be neither left out nor overtaken (`docs/protocol.md` section 8.3).
    pub receives_at_once: bool,
    /// What the DSP speaks.
    pub profile: Profile,
    /// Errors that the DSP queues while it boots.
    pub boot_errors: Vec<DspErrorCode>,
    /// What distinguishes the DSP's firmware from that of `docs/protocol.md`.
    pub firmware: Firmware,
    /// What goes wrong on purpose.
    pub faults: Option<Script>,
}

/// DSP, helicopter and serial link.
#[derive(Clone, Debug)]
pub struct Simulator {
    now: Duration,
    dsp: Dsp,
    helicopter: Helicopter,
    to_dsp: Lane,
    from_dsp: Lane,
    input: VecDeque<u8>,
    output: VecDeque<u8>,
    overrun: u64,
    /// `None` if all goes well: the bytes then take the short way.
    faults: Option<Box<Injector>>,
    /// Until when the DSP hangs.
    hangs_until: Option<Duration>,
}

impl Simulator {
    /// A helicopter at home and a DSP that boots at time zero.
    pub fn new(setup: Setup) -> Simulator {
        Simulator {
            now: Duration::ZERO,
            dsp: Dsp::boot(
                Duration::ZERO,
                setup.profile,
                setup.boot_errors,
                setup.firmware,
            ),
            helicopter: Helicopter::new(setup.model, Ports::default().settings()),
            to_dsp: Lane::new(setup.baud.filter(|_| !setup.receives_at_once)),
            from_dsp: Lane::new(setup.baud),
            input: VecDeque::new(),
            output: VecDeque::new(),
            overrun: 0,
            faults: setup
                .faults
                .map(|script| Box::new(Injector::new(&script, setup.profile))),
            hangs_until: None,
        }
    }

    /// Puts bytes from the PC on the serial link at `now`. Returns how many it took: the serial link holds
    /// [`INPUT_PLACES`].
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) -> usize {
        self.advance(now);
        let taken = bytes.len().min(self.input_room());
        if taken > 0 {
            self.to_dsp.begin(self.now);
            self.input.extend(&bytes[..taken]);
            // A serial link without a speed delivers at once.
            self.advance(now);
        }
        taken
    }

    /// Bytes that [`receive`](Self::receive) would take now.
    pub fn input_room(&self) -> usize {
        INPUT_PLACES - self.input.len()
    }

    /// Simulates up to `now`; a time that is past does nothing.
    pub fn advance(&mut self, now: Duration) {
        self.ferry();
        while let Some(next) = self.inner_deadline().filter(|next| *next <= now) {
            self.now = self.now.max(next);
            self.hangs_until.take_if(|until| *until <= self.now);
            self.deliver();
            self.dsp.advance(self.now, &mut self.helicopter);
            self.ferry();
            self.apply_faults();
        }
        self.now = self.now.max(now);
        self.helicopter.advance(self.now);
    }

    /// When [`advance`](Self::advance) or [`transmit`](Self::transmit) has something to do next; `None` while all is
    /// quiet.
    pub fn next_deadline(&self) -> Option<Duration> {
        self.inner_deadline()
            .into_iter()
            .chain(self.helicopter.next_deadline())
            .min()
    }

    /// Gives `sink` the bytes for the PC that have passed the serial link; it returns how many it took. The others
    /// stay.
    pub fn transmit(&mut self, mut sink: impl FnMut(&[u8]) -> usize) {
        while !self.output.is_empty() {
            let (front, _) = self.output.as_slices();
            let taken = sink(front).min(front.len());
            self.output.drain(..taken);
            if taken == 0 {
                return;
            }
        }
    }

    /// Whether bytes for the PC wait to be fetched.
    pub fn has_output(&self) -> bool {
        !self.output.is_empty()
    }

    /// Drops the bytes that wait to be fetched, because the PC that they were for has gone.
    pub fn discard_output(&mut self) {
        self.output.clear();
    }

    /// Lets the DSP boot again; the helicopter stays in the air. What is on the serial link stays there.
    pub fn reboot(&mut self) {
        self.hangs_until = None;
        self.dsp.reboot(self.now, &mut self.helicopter);
    }

    /// The time up to which everything is simulated.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// The DSP, to look at.
    pub fn dsp(&self) -> &Dsp {
        &self.dsp
    }

    /// The helicopter as it truly is, to look at.
    pub fn helicopter(&self) -> &Helicopter {
        &self.helicopter
    }

    /// Waypoints that the DSP would still fly: see [`Helicopter::held_waypoints`]. After *invalidate path*, and after
    /// the last waypoint of a path was reached, it is 0.
    pub fn held_waypoints(&self) -> usize {
        self.helicopter.held_waypoints()
    }

    /// Whether port 10121 reads 1.
    pub fn is_taking_off(&self) -> bool {
        self.dsp.is_taking_off(&self.helicopter)
    }

    /// Whether port 10122 reads 1.
    pub fn is_landing(&self) -> bool {
        self.dsp.is_landing(&self.helicopter)
    }

    /// Bytes to the PC that were dropped because the caller did not fetch them.
    pub fn overrun(&self) -> u64 {
        self.overrun
    }

    /// What the script of faults has done; `None` if there is none.
    pub fn faults(&self) -> Option<FaultCounters> {
        Some(self.faults.as_ref()?.counters())
    }

    /// Whether the serial port of the PC is there, which a script of faults decides. While it is gone, bytes to the
    /// PC are lost; the process hangs the PC's end up and lets it come back.
    pub fn port(&self) -> PortState {
        let faults = self.faults.as_ref();
        faults.map(|faults| faults.port()).unwrap_or_default()
    }

    /// When DSP, serial link or faults have something to do next.
    fn inner_deadline(&self) -> Option<Duration> {
        let input = self.to_dsp.next_deadline(self.input.len());
        let output = self.from_dsp.next_deadline(self.dsp.output().front().len());
        let faults = self.faults.as_ref();
        [
            input,
            output,
            self.dsp.next_deadline(),
            faults.and_then(|faults| faults.next_deadline()),
            self.hangs_until,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Hands the DSP the bytes from the PC that have passed the serial link, and what faults leave of them.
    fn deliver(&mut self) {
        let count = self.to_dsp.through(self.now).min(self.input.len());
        match &mut self.faults {
            Some(faults) => {
                for (index, byte) in self.input.drain(..count).enumerate() {
                    let at = self.to_dsp.through_at(index).unwrap_or(self.now);
                    faults.enter(Direction::ToDsp, at, byte);
                }
                let leave = || faults.leave(Direction::ToDsp, self.now);
                let arrived: Vec<u8> = std::iter::from_fn(leave).collect();
                if self.hangs_until.is_some() {
                    faults.count_missed(arrived.len() as u64);
                } else if !arrived.is_empty() {
                    self.dsp.receive(self.now, &arrived, &mut self.helicopter);
                }
            }
            None => {
                let mut left = count;
                while left > 0 {
                    let (front, _) = self.input.as_slices();
                    let piece = &front[..front.len().min(left)];
                    let taken = piece.len();
                    self.dsp.receive(self.now, piece, &mut self.helicopter);
                    self.input.drain(..taken);
                    left -= taken;
                }
            }
        }
        self.to_dsp.take(count);
        if self.input.is_empty() {
            self.to_dsp.rest();
        }
    }

    /// Moves the DSP's output onto the serial link, and takes off what has passed it.
    fn ferry(&mut self) {
        while self.hangs_until.is_none() {
            let front = self.dsp.output().front();
            if front.is_empty() {
                self.from_dsp.rest();
                break;
            }
            self.from_dsp.begin(self.now);
            let count = self.from_dsp.through(self.now).min(front.len());
            if count == 0 {
                break;
            }
            let through = &front[..count];
            match &mut self.faults {
                Some(faults) => {
                    for (index, byte) in through.iter().enumerate() {
                        let at = self.from_dsp.through_at(index).unwrap_or(self.now);
                        faults.enter(Direction::ToPc, at, *byte);
                    }
                }
                None => {
                    let room = OUTPUT_PLACES - self.output.len();
                    let kept = count.min(room);
                    self.output.extend(&through[..kept]);
                    self.overrun += (count - kept) as u64;
                }
            }
            self.dsp.sent(count);
            self.from_dsp.take(count);
        }
        self.collect();
    }

    /// Lets the PC have what faults leave of the bytes that have passed the serial link.
    fn collect(&mut self) {
        let Some(faults) = &mut self.faults else {
            return;
        };
        while let Some(byte) = faults.leave(Direction::ToPc, self.now) {
            if faults.port().is_gone {
                faults.count_unplugged(1);
            } else if self.output.len() < OUTPUT_PLACES {
                self.output.push_back(byte);
            } else {
                self.overrun += 1;
            }
        }
    }

    /// Lets happen what the script of faults has for now.
    fn apply_faults(&mut self) {
        while let Some(faults) = &mut self.faults
            && let Some(event) = faults.next_event(self.now)
        {
            match event {
                Happening::Dsp(event) => self.apply_to_dsp(event),
                Happening::Helicopter(event) => self.apply_to_helicopter(event),
            }
        }
        if let Some(faults) = &mut self.faults
            && faults.port().is_gone
        {
            // Bytes that were not fetched go with the port.
            faults.count_unplugged(self.output.len() as u64);
            self.output.clear();
        }
    }

    fn apply_to_dsp(&mut self, event: DspEvent) {
        match event {
            DspEvent::RaiseError(error) => self.dsp.raise(error),
            DspEvent::Reboot => self.reboot(),
            DspEvent::StopStatus => self.dsp.stop_status(),
            DspEvent::Hang(length) => self.hang(length),
            DspEvent::ClockJump(milliseconds) => self.dsp.shift_clock(milliseconds),
            DspEvent::ChangeMask(mask) => self.dsp.change_mask(mask),
        }
    }

    /// Lets something happen to the helicopter now, as a script does at its time.
    pub fn apply_to_helicopter(&mut self, event: HelicopterEvent) {
        self.helicopter.advance(self.now);
        match event {
            HelicopterEvent::PilotTakesOver(length) => self.helicopter.take_over(length),
            HelicopterEvent::BatteryLow { volts } => self.helicopter.set_battery_v(volts),
            HelicopterEvent::FuelLow { percent } => self.helicopter.set_fuel_percent(percent),
            HelicopterEvent::GpsAltitudeDrift { rate_mps, length } => {
                self.helicopter.drift_gps_altitude(rate_mps, length)
            }
            HelicopterEvent::LoseFix(length) => self.helicopter.lose_gps_fix(length),
        }
    }

    /// Sets how many simulated seconds pass in a second of the PC: see [`Dsp::set_speed`].
    pub fn set_speed(&mut self, speed: f64) {
        self.dsp.set_speed(speed);
    }

    /// Moves the pilot's switch now and leaves it there.
    pub fn set_pilot_switch(&mut self, switch: PilotSwitch) {
        self.helicopter.advance(self.now);
        self.helicopter.set_switch(switch);
    }

    /// The DSP stands still; the rest of a message that it was sending comes when it goes on.
    fn hang(&mut self, length: Duration) {
        let until = self.now.saturating_add(length);
        self.hangs_until = self.hangs_until.max(Some(until));
        self.dsp.hold(until);
        self.from_dsp.rest();
    }
}

#[cfg(test)]
mod tests;
