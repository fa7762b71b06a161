//! `ril mavlink status`: which stations there are, what was not taken of them, and why nothing is sent.

use ipc_types::MonotonicNs;
use ipc_types::payload::MavlinkStations;
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};

use super::report::MavlinkReport;
use crate::options::SampleArgs;
use crate::render::print;
use crate::session::{Latest, Session, other_domains, others_alive};

/// `ril mavlink status`
///
/// # Errors
///
/// Code 3 when there is no gateway, 4 when it publishes nothing, 6 when the helicopter is not heard.
pub fn status(args: &SampleArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(args)?;
    let robot = session.ipc.robot();
    let Some(mut topic) = Latest::<MavlinkStations>::open_if_provided(&session)? else {
        let text = format!(
            "no gateway to MAVLink of robot {robot} is running here{}{}",
            others_alive(robot),
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text)
            .with_next_step("start `ril run mavlink`, and try again"));
    };
    let give_up = MonotonicNs::now() + timeout;
    let is_there = |topic: &mut Latest<MavlinkStations>, _| Ok(topic.sample.is_some());
    if !session.gather(&mut topic, give_up, is_there)? && session.termination.requested() {
        return Ok(());
    }
    let Some(sample) = &topic.sample else {
        let text = format!(
            "nothing came from the gateway of robot {robot} in {}, although it is running",
            DurationText(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    };
    let report = MavlinkReport::new(robot, sample, MonotonicNs::now());
    print(&report, args.json)?;
    match report.trouble() {
        None => Ok(()),
        Some((text, next_step)) => {
            Err(Failure::new(ExitCode::LinkDown, text).with_next_step(next_step))
        }
    }
}
