//! Take-off and landing: movements that the DSP forms itself (requirement D5; `docs/protocol.md` section 8.5).
//!
//! The bridge gives the order, makes sure that the DSP carries it out, and believes the DSP's own word for the end. It never
//! judges an altitude.
//!
//! | step | take-off | landing |
//! |---|---|---|
//! | preparing | port 20121 is written, and read back | – |
//! | ordering | 1 is written to port 10121 | 1 is written to port 10122 |
//! | confirming | the port reads 1, or the flying flag is 1 → under way | the port reads 1 → under way; flag 0 and port 0 → done |
//! | under way | flow control 1 in the air, or port 0 in the air → done | flag 0 and port 0 → done |
//! | either, no flag since the order | flow control 1, then port 0 → done | – |
//! | refused | error 30 and the port reads 0 on the ground, or 0 for a second | error 30 and the port reads 0 in the air, or 0 for a second |

use std::time::Duration;

use dsp_protocol::{Command, DspErrorCode, port};
use ipc_types::code::{MovementKind, Reason};

use super::motion::{Doubt, DspOrder, Landing, Motion, Order, Rest, TakeOff};
use super::report::{Detail, Refusal, Verdict};
use super::request::RequestHeader;
use super::{Context, Flight, FlightTimer};
use crate::link::FlightCommand;
use crate::link::commands::{ALWAYS, AckData};
use crate::outputs::Outputs;

/// How long the DSP may take after its acknowledgement to show that it carries out the order.
const CONFIRM_WITHIN: Duration = Duration::from_secs(1);

/// Pause between two looks at the movement's port, while the order is not confirmed or the rotor runs down.
const LOOK_PERIOD: Duration = Duration::from_millis(250);

/// Pause between two looks at the port of a take-off that is under way: its end shows by flow control.
const CLIMB_LOOK_PERIOD: Duration = Duration::from_secs(1);

impl Flight {
    pub(super) fn take_off<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        height_m: f32,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        self.ready_to_move(false, cx)?;
        if self.known_flying(cx)? {
            return Err(Reason::AlreadyFlying.into());
        }
        let position = self.known_position(cx)?;
        self.safety.check_take_off(&position, height_m)?;
        let write = Command::Write32 {
            port: port::TAKE_OFF_ALTITUDE_M,
            value: height_m,
        };
        cx.link
            .command(write, FlightCommand::WriteTakeOffAltitude)
            .map_err(|_| Reason::TooManyRequests)?;
        let motion = Motion::TakingOff(TakeOff {
            order: Order::of(*header),
            height_m,
            ground_altitude_m: position.altitude_m,
            is_granted: false,
            step: DspOrder::Preparing,
        });
        self.begin(Some(header), MovementKind::TakeOff, 0, motion, cx);
        Ok(())
    }

    pub(super) fn land<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        let order = self.order_on_the_spot(header, header.preempt, cx)?;
        // Whether it is on the ground decides the DSP, where that is not known here.
        if !self.observation.may_fly() {
            return Err(Reason::NotFlying.into());
        }
        match cx.link.is_up() {
            true => self.order_landing(order, cx),
            false => self.want(order, true, cx),
        }
        Ok(())
    }

    /// Orders the landing, for a request or for a safety rule. A path under way ends as replaced. The order goes out first;
    /// it empties the DSP's path buffer, which the link makes sure of.
    pub(super) fn order_landing<O: Outputs>(&mut self, order: Order, cx: &mut Context<'_, O>) {
        self.pre_empt(cx);
        let until = order.requester.map_or(ALWAYS, |header| header.begin_by);
        let queued = cx
            .link
            .command_until(write_one(port::LAND), FlightCommand::Land, until);
        cx.link.forget_path();
        let step = DspOrder::Ordering(Doubt::default());
        let motion = Motion::Landing(Landing { order, step });
        self.begin(order.requester.as_ref(), MovementKind::Land, 0, motion, cx);
        if queued.is_err() {
            self.undelivered(FlightCommand::Land, cx);
        }
    }

    /// How far the order for take-off or landing is; `None` if none is under way.
    pub(super) fn dsp_order(&self) -> Option<&DspOrder> {
        match &self.motion {
            Motion::TakingOff(take_off) => Some(&take_off.step),
            Motion::Landing(landing) => Some(&landing.step),
            _ => None,
        }
    }

    fn dsp_order_mut(&mut self) -> Option<&mut DspOrder> {
        match &mut self.motion {
            Motion::TakingOff(take_off) => Some(&mut take_off.step),
            Motion::Landing(landing) => Some(&mut landing.step),
            _ => None,
        }
    }

    pub(super) fn dsp_order_delivered<O: Outputs>(
        &mut self,
        command: FlightCommand,
        data: AckData,
        cx: &mut Context<'_, O>,
    ) {
        match (command, self.motion) {
            (FlightCommand::WriteTakeOffAltitude, Motion::TakingOff(_)) => {
                let read = Command::Read32 {
                    port: port::TAKE_OFF_ALTITUDE_M,
                };
                self.order(read, FlightCommand::ReadTakeOffAltitude, cx);
            }
            (FlightCommand::ReadTakeOffAltitude, Motion::TakingOff(take_off)) => {
                if data != AckData::Bits32(take_off.height_m) {
                    // A DSP that has another altitude than the one that was asked for must not take off.
                    let refused = Detail {
                        dsp_error: Some(DspErrorCode::INVALID_COMMAND),
                        ..Detail::default()
                    };
                    return self.refused_by_dsp(refused, cx);
                }
                if self.begins_in_time(cx) {
                    self.set_step(DspOrder::Ordering(Doubt::default()));
                    self.order(write_one(port::TAKE_OFF), FlightCommand::TakeOff, cx);
                }
            }
            (FlightCommand::TakeOff, Motion::TakingOff(take_off)) => {
                self.order_acknowledged(f64::from(take_off.height_m), cx);
            }
            (FlightCommand::Land, Motion::Landing(_)) => {
                let height_m = self
                    .observation
                    .position(cx.now)
                    .map_or(0.0, |p| p.altitude_m);
                self.order_acknowledged(height_m.max(0.0), cx);
            }
            (FlightCommand::ReadMovement, Motion::TakingOff(_) | Motion::Landing(_)) => {
                self.movement_read(data != AckData::Bits16(0), cx);
            }
            // Of a movement that has ended meanwhile.
            _ => {}
        }
    }

    /// The DSP has the order. That it arrived does not say that it is carried out: the port shows that.
    fn order_acknowledged<O: Outputs>(&mut self, length_m: f64, cx: &mut Context<'_, O>) {
        let Some(DspOrder::Ordering(doubt)) = self.dsp_order().copied() else {
            return;
        };
        self.movement_begun(length_m, cx);
        // Between two status messages the DSP can begin and end a take-off.
        self.observation.forget_flying(cx.now);
        self.set_step(DspOrder::Confirming {
            until: cx.now + CONFIRM_WITHIN,
            doubt,
        });
        self.progress(cx);
        self.look(cx);
    }

    /// Reads the port of the movement, and looks again after a time.
    fn look<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let (port, period) = match self.motion {
            Motion::TakingOff(TakeOff {
                step: DspOrder::UnderWay,
                ..
            }) => (port::TAKE_OFF, CLIMB_LOOK_PERIOD),
            Motion::TakingOff(_) => (port::TAKE_OFF, LOOK_PERIOD),
            Motion::Landing(_) => (port::LAND, LOOK_PERIOD),
            _ => return,
        };
        self.timers.arm(FlightTimer::Step, cx.now + period);
        if !cx.link.has(FlightCommand::ReadMovement) {
            self.order(Command::Read16 { port }, FlightCommand::ReadMovement, cx);
        }
    }

    /// The time to look at the movement has come.
    pub(super) fn step_due<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        match self.dsp_order().copied() {
            Some(DspOrder::Confirming { until, doubt }) if cx.now >= until => {
                self.refused_by_dsp(doubt.detail(), cx);
            }
            Some(DspOrder::Confirming { .. } | DspOrder::UnderWay) => self.look(cx),
            Some(DspOrder::Preparing | DspOrder::Ordering(_)) => {}
            None => self.settling_expired(cx),
        }
    }

    /// The port of the movement was read: whether the DSP says that it is under way.
    fn movement_read<O: Outputs>(&mut self, is_under_way: bool, cx: &mut Context<'_, O>) {
        let Some(step) = self.dsp_order().copied() else {
            return;
        };
        if is_under_way {
            self.note_grant(false);
            if let DspOrder::Confirming { .. } = step {
                self.under_way(cx);
            }
            return;
        }
        let is_taking_off = matches!(self.motion, Motion::TakingOff(_));
        match (self.observation.flying(cx.now), step) {
            (None, _) if self.is_over_by_grant() => self.dsp_order_done(cx),
            // In the air after a take-off, on the ground with the rotor stopped after a landing.
            (Some(flying), DspOrder::Confirming { .. } | DspOrder::UnderWay)
                if flying == is_taking_off =>
            {
                self.dsp_order_done(cx);
            }
            (Some(_), DspOrder::UnderWay) => self.refused_by_dsp(Detail::default(), cx),
            (_, DspOrder::Confirming { until, doubt }) => {
                let doubt = Doubt {
                    reads_zero: true,
                    ..doubt
                };
                self.set_step(DspOrder::Confirming { until, doubt });
                self.judge(cx);
            }
            _ => {}
        }
    }

    /// Error 30 came while an order is on its way or not confirmed.
    pub(super) fn dsp_order_refused<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Some(DspOrder::Ordering(doubt) | DspOrder::Confirming { doubt, .. }) =
            self.dsp_order_mut()
        {
            doubt.is_refused = true;
            self.judge(cx);
        }
    }

    /// An order that the DSP reported as invalid and whose port reads 0 is refused. Either alone may have another cause.
    fn judge<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Some(DspOrder::Confirming { doubt, .. }) = self.dsp_order().copied()
            && doubt.is_refused
            && doubt.reads_zero
        {
            self.refused_by_dsp(doubt.detail(), cx);
        }
    }

    /// Telemetry says whether the helicopter flies.
    pub(super) fn watch_dsp_order<O: Outputs>(&mut self, flying: bool, cx: &mut Context<'_, O>) {
        match (self.motion, self.dsp_order().copied()) {
            (Motion::TakingOff(_), Some(DspOrder::Confirming { .. })) if flying => {
                self.under_way(cx);
            }
            // Touch-down: the landing lasts until the rotor has stopped, which its port shows.
            (Motion::Landing(_), Some(DspOrder::Confirming { .. } | DspOrder::UnderWay))
                if !flying && !self.timers.is_armed(FlightTimer::Step) =>
            {
                self.look(cx);
            }
            _ => {}
        }
    }

    /// Flow control 1: the DSP flies, and neither takes off nor lands. A flying flag that was received since the order and
    /// says otherwise makes it a damaged message. Without a flag it may be a late one: the port must say the same.
    pub(super) fn granted_in_dsp_order<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let is_begun = matches!(
            self.dsp_order(),
            Some(DspOrder::Confirming { .. } | DspOrder::UnderWay)
        );
        let flying = self.observation.flying(cx.now);
        match self.motion {
            _ if !is_begun || flying == Some(false) => {}
            Motion::TakingOff(_) if flying.is_some() => self.dsp_order_done(cx),
            Motion::TakingOff(_) => {
                self.note_grant(true);
                self.look(cx);
            }
            // It has ended the landing by itself, or has not begun it yet: the port shows which.
            Motion::Landing(_) if !self.timers.is_armed(FlightTimer::Step) => self.look(cx),
            _ => {}
        }
    }

    fn note_grant(&mut self, is_granted: bool) {
        if let Motion::TakingOff(take_off) = &mut self.motion {
            take_off.is_granted = is_granted;
        }
    }

    /// A take-off whose port reads 0 is over when flow control 1 came since the port last read 1, unless error 30 came too.
    fn is_over_by_grant(&self) -> bool {
        let Motion::TakingOff(take_off) = &self.motion else {
            return false;
        };
        let is_refused =
            matches!(take_off.step, DspOrder::Confirming { doubt, .. } if doubt.is_refused);
        take_off.is_granted && !is_refused
    }

    /// The DSP's own word: the movement is over.
    fn dsp_order_done<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let height_m = match self.motion {
            Motion::TakingOff(take_off) => {
                self.observation.note_flying(cx.now);
                let position = self.observation.position(cx.now);
                position.map(|position| position.altitude_m - take_off.ground_altitude_m)
            }
            _ => None,
        };
        cx.link.forget_movement();
        let detail = Detail {
            value: height_m,
            ..Detail::default()
        };
        self.finish(&Verdict::DONE.about(detail), Rest::Done, cx);
    }

    /// The DSP does not do what it was ordered to. Nothing is under way, so the next order may come.
    fn refused_by_dsp<O: Outputs>(&mut self, detail: Detail, cx: &mut Context<'_, O>) {
        let verdict = Verdict::aborted(Reason::RefusedByDsp).about(detail);
        self.give_up_movement(&verdict, Rest::Ready, cx);
    }

    fn set_step(&mut self, to: DspOrder) {
        if let Some(step) = self.dsp_order_mut() {
            *step = to;
        }
    }

    /// The DSP carries the order out. The end of a landing shows by the flying flag; that of a take-off by flow control, and
    /// by the port should that stay away.
    fn under_way<O>(&mut self, cx: &Context<'_, O>) {
        self.set_step(DspOrder::UnderWay);
        self.timers.stop(FlightTimer::Step);
        if let Motion::TakingOff(_) = self.motion {
            self.timers
                .arm(FlightTimer::Step, cx.now + CLIMB_LOOK_PERIOD);
        }
    }

    fn order<O: Outputs>(
        &mut self,
        command: Command,
        purpose: FlightCommand,
        cx: &mut Context<'_, O>,
    ) {
        let until = match (purpose, self.motion.requester()) {
            (FlightCommand::TakeOff, Some(header)) => header.begin_by,
            _ => ALWAYS,
        };
        if cx.link.command_until(command, purpose, until).is_err() {
            self.undelivered(purpose, cx);
        }
    }
}

impl Doubt {
    fn detail(self) -> Detail {
        Detail {
            dsp_error: self.is_refused.then_some(DspErrorCode::INVALID_COMMAND),
            ..Detail::default()
        }
    }
}

fn write_one(port: u16) -> Command {
    Command::Write16 { port, value: 1 }
}
