//! What must hold between the parts of a flight after each input. Debug builds check it, so every virtual mission
//! judges it.

use super::dsp_order::DspOrder;
use super::motion::{Motion, PathStep};
use super::{Flight, FlightTimer};

impl Flight {
    /// # Panics
    /// When two parts of the flight contradict each other, which is a defect.
    pub(crate) fn assert_sound(&self) {
        let is_armed = |timer| self.timers.is_armed(timer);
        let motion = &self.motion;
        let is_open = self.assembler.open_path().is_some();
        // The newest waypoint of an open path, and no other one, waits for its final report, until a moment.
        debug_assert_eq!(is_open, self.assembler.newest().is_some());
        debug_assert_eq!(is_open, is_armed(FlightTimer::Assembly));
        debug_assert!(!is_open || !self.assembler.waypoints().is_empty());
        let has_parameters = self.parameters.open().next().is_some();
        debug_assert_eq!(has_parameters, is_armed(FlightTimer::Parameter));
        debug_assert!(!is_armed(FlightTimer::Lease) || self.lease().is_some());

        let [begin, limit] = [FlightTimer::Begin, FlightTimer::Limit].map(is_armed);
        debug_assert!(!(begin && limit), "it has begun, or it has not: {motion:?}");
        match motion {
            Motion::Idle(_) => {
                debug_assert!(!begin && !limit && !is_armed(FlightTimer::Step));
            }
            Motion::TakingOff { step, .. } | Motion::Landing { step, .. } => {
                // Once its moment has passed, the acknowledgement of a command on its way decides: it comes or fails.
                let is_on_its_way = matches!(step, DspOrder::Ordering(_));
                debug_assert!(
                    begin || limit || is_on_its_way,
                    "it ends in time: {motion:?}"
                );
                debug_assert_eq!(self.movement.waypoints_total, 0);
            }
            Motion::Following { step, .. } => {
                let total = self.movement.waypoints_total as usize;
                debug_assert_eq!(total, self.route.tracker.path().len());
                let has_sent = self.movement.waypoints_sent > 0;
                debug_assert!(!has_sent || !matches!(step, PathStep::AwaitingEmpty));
            }
            Motion::Holding { .. } | Motion::Deferred { .. } | Motion::Stopping { .. } => {
                debug_assert!(begin && !limit, "it ends in time: {motion:?}");
            }
        }
        let movement = &self.movement;
        debug_assert!(movement.waypoints_sent <= movement.waypoints_total);
        debug_assert!(movement.waypoints_reached <= movement.waypoints_total);

        // Each open request is open once, and has had no final report.
        let open = || {
            (self.assembler.newest().into_iter())
                .chain(motion.requester())
                .chain(self.parameters.open())
        };
        for (index, header) in open().enumerate() {
            let id = header.request_id;
            debug_assert!(self.answers.report_of(id).is_none(), "{header:?}");
            debug_assert!(open().skip(index + 1).all(|other| other.request_id != id));
        }
        self.control.assert_sound();
        self.safety.assert_sound();
    }
}
