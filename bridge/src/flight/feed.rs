//! The way of a path's waypoints to the DSP: one for each grant, verified one by one where the DSP counts them.

use dsp_protocol::{Command, Uplink, port};
use ipc_types::code::ImiError;

use super::activity::Activity;
use super::trajectory::Trajectory;
use super::verification::{Counted, OnGrant, Verification};
use super::{Context, Flight};
use crate::line::FlightCommand;
use crate::outputs::Outputs;

const COUNT_WAYPOINTS: Command = Command::Read16 {
    port: port::WAYPOINT_COUNT,
};

impl<T: Trajectory> Flight<T> {
    /// A path was closed: before its first waypoint goes, the DSP's count is read.
    pub(super) fn begin_feed<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.verification = Verification::begin();
        self.count_waypoints(cx);
    }

    /// Flow control grants one waypoint. A grant that finds nothing to send is not kept: the DSP repeats it.
    pub(super) fn send_waypoint<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let Some(point) = self.trajectory.peek() else {
            return;
        };
        let on_grant = self.verification.on_grant();
        if on_grant == OnGrant::Wait || !cx.line.is_up() {
            return;
        }
        let again = self.verification.is_repetition();
        if !cx.line.waypoint(&point.waypoint, again) {
            return;
        }
        if self.activity.order().is_some_and(|order| !order.begun) {
            self.movement_begun(cx);
        }
        match on_grant {
            OnGrant::SendAndCount => {
                self.verification.sent();
                self.count_waypoints(cx);
            }
            OnGrant::Send | OnGrant::Wait => self.next_waypoint(cx),
        }
    }

    /// The DSP's count was read.
    pub(super) fn waypoints_counted<O: Outputs>(&mut self, count: u16, cx: &mut Context<'_, O>) {
        let Activity::Following { .. } = self.activity else {
            return;
        };
        match self.verification.counted(count) {
            Counted::Ready => cx.line.note_verified(true),
            Counted::Unverified => cx.line.note_verified(false),
            Counted::Arrived => self.next_waypoint(cx),
            Counted::Lost => cx.line.count_repeated_waypoint(),
            Counted::Failed(reason) => self.fatal(ImiError::CommunicationFatalError, reason, cx),
        }
    }

    /// The waypoint is with the DSP. Those that follow and are the same on the wire are with it too: it would take
    /// them for copies.
    fn next_waypoint<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let wire = |waypoint| Uplink::Waypoint(waypoint).encode();
        let Some(sent) = self.trajectory.peek().map(|point| wire(point.waypoint)) else {
            return;
        };
        let before = self.movement.waypoints_sent;
        while let Some(point) = self.trajectory.peek()
            && wire(point.waypoint) == sent
        {
            if let Some(index) = point.path_index {
                self.movement.waypoints_sent = index as u32 + 1;
            }
            self.trajectory.advance();
        }
        if self.movement.waypoints_sent != before {
            self.progress(cx);
        }
    }

    fn count_waypoints<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        let queued = cx
            .line
            .command(COUNT_WAYPOINTS, FlightCommand::CountWaypoints);
        if queued.is_err() {
            self.undelivered(FlightCommand::CountWaypoints, cx);
        }
    }
}
