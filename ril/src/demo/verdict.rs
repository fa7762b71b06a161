//! The judgement of a demonstration: from what a consumer saw to a list of checks with figures. Pure.

use ipc_types::code::{Functionality, ModuleStatus, Stage};
use serde::Serialize;

use super::mission::{Mission, Outcome};
use super::watch::{Counts, Watch};

/// How near a consumer must have seen the helicopter to each waypoint, m: the acceptance radius that the DSP is given
/// (1 m), and what the noise of a simulated GPS and the time between two samples add.
const TOLERANCE_M: f64 = 1.5;

/// Everything that is judged.
pub struct Evidence<'a> {
    /// How the orders ended.
    pub outcomes: &'a [Outcome],
    /// What the consumer saw.
    pub watch: &'a Watch,
    /// What its subscribers counted.
    pub counts: Counts,
    /// Rows of the log, the line of names not counted; nothing when it could not be read.
    pub log_rows: Option<u64>,
    /// What the flight record has; nothing when there is none that can be read.
    pub record: Option<RecordEvidence>,
    /// Exit codes of the processes, by name.
    pub exits: &'a [(&'static str, Option<i32>)],
    /// What is left in shared memory.
    pub residue: usize,
}

/// What a flight record has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordEvidence {
    /// Whether it is complete, and says of each missing message that it is missing.
    pub is_in_order: bool,
    /// Messages of raw telemetry.
    pub dsp: u64,
    /// Messages of the robot's telemetry.
    pub hero: u64,
    /// States of the bridge.
    pub states: u64,
    /// How many of these three the record says that it does not have, because it joined late or could not keep up.
    pub told: u64,
}

/// One check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// Whether it holds.
    pub passed: bool,
    /// The figures.
    pub detail: String,
}

/// The states that a mission goes through: waiting, started, and one pair of running and ended for each movement.
const EXPECTED_STATES: [(ModuleStatus, Functionality); 13] = {
    use Functionality::{AtRest, FollowingPath, Landing, ReceivingPath, Stopping, TakingOff};
    use ModuleStatus::{Ended, Running, WaitingDataToStart};
    [
        (WaitingDataToStart, AtRest),
        (Running, AtRest),
        (Running, TakingOff),
        (Ended, AtRest),
        (Ended, ReceivingPath),
        (Running, FollowingPath),
        (Ended, AtRest),
        (Ended, ReceivingPath),
        (Running, FollowingPath),
        (Ended, AtRest),
        (Running, Landing),
        (Ended, AtRest),
        (Ended, Stopping),
    ]
};

/// Judges the evidence.
pub fn judge(evidence: &Evidence<'_>) -> Vec<Check> {
    vec![
        orders(evidence),
        waypoints(evidence),
        states(evidence),
        gaps(evidence),
        line(evidence),
        log(evidence),
        record(evidence),
        landed(evidence),
        exits(evidence),
        Check {
            name: "nothing left in shared memory",
            passed: evidence.residue == 0,
            detail: format!("{} files and segments left", evidence.residue),
        },
    ]
}

fn orders(evidence: &Evidence<'_>) -> Check {
    let done = evidence
        .outcomes
        .iter()
        .filter(|outcome| outcome.stage == Stage::Done)
        .count();
    let failed = evidence
        .outcomes
        .iter()
        .find(|outcome| outcome.stage != Stage::Done);
    Check {
        name: "every order done",
        passed: done == Mission::ORDERS && failed.is_none(),
        detail: match failed {
            None => format!("{done} of {} done", Mission::ORDERS),
            Some(outcome) => format!(
                "`{}` was {}: {}",
                outcome.order.name(),
                outcome.stage,
                outcome.reason
            ),
        },
    }
}

fn waypoints(evidence: &Evidence<'_>) -> Check {
    let expected = evidence
        .watch
        .home()
        .map_or(0, |home| Mission::waypoints(home).len());
    let approaches = evidence.watch.approaches();
    let worst = approaches
        .iter()
        .map(|approach| approach.distance_m)
        .fold(0.0, f64::max);
    Check {
        name: "waypoints reached in order",
        passed: expected > 0 && approaches.len() == expected && worst <= TOLERANCE_M,
        detail: format!(
            "{} of {expected}, each within {worst:.2} m (tolerance {TOLERANCE_M} m)",
            approaches.len()
        ),
    }
}

/// States are published at every change, but a consumer that comes late or a state that lasts for one call of the core
/// may miss some of the short ones. So those seen must be a part of the expected, in order, with all that last.
fn states(evidence: &Evidence<'_>) -> Check {
    let seen = evidence.watch.states();
    let mut expected = EXPECTED_STATES
        .iter()
        .chain([&(ModuleStatus::Ended, Functionality::AtRest)])
        .peekable();
    let in_order = seen
        .iter()
        .all(|state| expected.by_ref().any(|next| next == state));
    let movements = seen
        .iter()
        .filter(|(_, functionality)| {
            matches!(
                functionality,
                Functionality::TakingOff | Functionality::FollowingPath | Functionality::Landing
            )
        })
        .count();
    let ended = seen.last() == Some(&(ModuleStatus::Ended, Functionality::AtRest));
    Check {
        name: "states in the right order",
        passed: in_order && movements == 4 && ended,
        detail: format!("{} states, {movements} movements", seen.len()),
    }
}

fn gaps(evidence: &Evidence<'_>) -> Check {
    let Counts { dsp, hero, state } = evidence.counts;
    let lost = dsp.lost + hero.lost + state.lost;
    Check {
        name: "no sample lost",
        passed: lost == 0 && dsp.received > 0 && hero.received > 0 && state.received > 0,
        detail: format!(
            "{} raw, {} robot, {} states received, {lost} lost",
            dsp.received, hero.received, state.received
        ),
    }
}

fn line(evidence: &Evidence<'_>) -> Check {
    let Some(state) = evidence.watch.last_state() else {
        return Check {
            name: "line without faults",
            passed: false,
            detail: "no state was published".to_owned(),
        };
    };
    let (link, refused) = (&state.link, &state.refused);
    let faults = refused.stray
        + refused.unknown_header
        + refused.truncated
        + refused.checksum
        + refused.padding
        + refused.value
        + refused.implausible_groups
        + link.telemetry_incoherent;
    Check {
        name: "line without faults",
        passed: faults == 0 && link.commands_failed == 0,
        detail: format!(
            "{} messages, {} commands acknowledged, {} repeated, {} refused",
            link.messages_received, link.commands_acknowledged, link.commands_repeated, faults
        ),
    }
}

fn log(evidence: &Evidence<'_>) -> Check {
    let published = evidence
        .watch
        .last_hero()
        .map_or(0, |sample| sample.sequence);
    let received = evidence
        .watch
        .last_hero()
        .map_or(0, |sample| sample.source_sequence);
    Check {
        name: "log rows equal samples published",
        passed: published > 0 && evidence.log_rows == Some(published) && received == published,
        detail: match evidence.log_rows {
            Some(rows) => {
                format!("{rows} rows, {published} samples by status, {received} by the bridge")
            }
            None => "there is no log".to_owned(),
        },
    }
}

fn record(evidence: &Evidence<'_>) -> Check {
    let Counts { dsp, hero, state } = evidence.counts;
    let name = "record tells of every sample";
    let Some(record) = evidence.record else {
        return Check {
            name,
            passed: false,
            detail: "there is no record".to_owned(),
        };
    };
    let state_of_file = match record.is_in_order {
        true => "complete",
        false => "not complete",
    };
    let missing = [
        (dsp.received, record.dsp),
        (hero.received, record.hero),
        (state.received, record.states),
    ]
    .map(|(received, recorded)| received.saturating_sub(recorded));
    let told = match record.told {
        0 => String::new(),
        told => format!(", {told} told as missing"),
    };
    Check {
        name,
        passed: record.is_in_order && missing.iter().sum::<u64>() <= record.told,
        detail: format!(
            "{} raw, {} robot, {} states{told}, {state_of_file}",
            record.dsp, record.hero, record.states
        ),
    }
}

fn landed(evidence: &Evidence<'_>) -> Check {
    let on_ground = evidence
        .watch
        .last_hero()
        .is_some_and(|sample| !sample.is_flying());
    Check {
        name: "flew and landed",
        passed: evidence.watch.ever_flew() && on_ground,
        detail: format!("{:.1} m at the highest", evidence.watch.highest_m()),
    }
}

fn exits(evidence: &Evidence<'_>) -> Check {
    let texts: Vec<String> = evidence
        .exits
        .iter()
        .map(|(name, code)| match code {
            Some(code) => format!("{name} {code}"),
            None => format!("{name} killed"),
        })
        .collect();
    Check {
        name: "every process ended with 0",
        passed: evidence.exits.len() == 4
            && evidence.exits.iter().all(|(_, code)| *code == Some(0)),
        detail: texts.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::code::Reason;
    use ipc_types::payload::{DspGeographic, DspTelemetry, HeroTelemetry, ModuleState};
    use ipc_types::{Losses, MonotonicNs, TelemetryGroup};

    use super::super::mission::{Order, Point};

    fn good_watch() -> Watch {
        flight(|_| ())
    }

    /// What a consumer sees of a flight through the mission's waypoints, changed by `change`.
    fn flight(change: impl FnOnce(&mut Vec<Point>)) -> Watch {
        let mut watch = Watch::default();
        watch.dsp(&DspTelemetry {
            valid_groups: TelemetryGroup::Geographic.bit(),
            geographic: DspGeographic {
                latitude_deg: 37.0,
                longitude_deg: -6.0,
                altitude_m: 10.0,
            },
            ..DspTelemetry::default()
        });
        let mut points = Mission::waypoints(watch.home().unwrap());
        watch.expect(points.clone());
        change(&mut points);
        for (status, functionality) in EXPECTED_STATES {
            watch.state(&state(status, functionality));
        }
        watch.state(&state(ModuleStatus::Ended, Functionality::AtRest));
        let mut sequence = 0;
        let mut fly = |watch: &mut Watch, point: &Point, flying: u32| {
            sequence += 1;
            let mut sample = HeroTelemetry {
                sequence,
                source_sequence: sequence,
                flying,
                valid_groups: u32::from(TelemetryGroup::Geographic.bit()),
                ..HeroTelemetry::default()
            };
            sample.geodetic.latitude_rad = point.latitude_deg.to_radians();
            sample.geodetic.longitude_rad = point.longitude_deg.to_radians();
            sample.geodetic.altitude_m = point.altitude_m;
            watch.hero(&sample, MonotonicNs(0));
        };
        for point in &points {
            fly(&mut watch, point, 1);
        }
        fly(&mut watch, &points[points.len() - 1], 0);
        watch
    }

    fn state(status: ModuleStatus, functionality: Functionality) -> ModuleState {
        ModuleState {
            status: status.code(),
            functionality: functionality.code(),
            ..ModuleState::default()
        }
    }

    fn good_outcomes() -> Vec<Outcome> {
        (0..Mission::ORDERS)
            .map(|_| Outcome {
                order: Order::Start,
                stage: Stage::Done,
                reason: Reason::None,
            })
            .collect()
    }

    fn received(received: u64, lost: u64) -> Losses {
        Losses {
            received,
            lost,
            ..Losses::default()
        }
    }

    /// Judges a good flight after `spoil` has changed the evidence; returns the names of the failed checks.
    fn failed(spoil: impl FnOnce(&mut Evidence<'_>, &mut Watch)) -> Vec<&'static str> {
        let outcomes = good_outcomes();
        let (shown, mut spoilt) = (good_watch(), good_watch());
        let exits = ["bridge", "status", "sim", "record"].map(|name| (name, Some(0)));
        let mut evidence = Evidence {
            outcomes: &outcomes,
            watch: &shown,
            counts: Counts {
                dsp: received(7, 0),
                hero: received(7, 0),
                state: received(9, 0),
            },
            log_rows: Some(7),
            record: Some(RecordEvidence {
                is_in_order: true,
                dsp: 7,
                hero: 8,
                states: 9,
                told: 0,
            }),
            exits: &exits,
            residue: 0,
        };
        spoil(&mut evidence, &mut spoilt);
        let evidence = Evidence {
            watch: &spoilt,
            ..evidence
        };
        judge(&evidence)
            .into_iter()
            .filter(|check| !check.passed)
            .map(|check| check.name)
            .collect()
    }

    #[test]
    fn a_good_flight_passes_every_check() {
        assert_eq!(failed(|_, _| ()), Vec::<&str>::new());
    }

    #[test]
    fn each_fault_fails_its_own_check() {
        assert_eq!(
            failed(|evidence, _| evidence.outcomes = &[]),
            ["every order done"]
        );
        assert_eq!(
            failed(|evidence, _| evidence.counts.hero.lost = 1),
            ["no sample lost"]
        );
        assert_eq!(
            failed(|evidence, _| evidence.log_rows = Some(6)),
            ["log rows equal samples published"]
        );
        assert_eq!(
            failed(|evidence, _| evidence.log_rows = None),
            ["log rows equal samples published"]
        );
        let spoil_record = |spoil: fn(&mut RecordEvidence)| {
            failed(|evidence, _| evidence.record.iter_mut().for_each(spoil))
        };
        for found in [
            failed(|evidence, _| evidence.record = None),
            spoil_record(|record| record.is_in_order = false),
            spoil_record(|record| record.dsp = 6),
            spoil_record(|record| record.states = 8),
        ] {
            assert_eq!(found, ["record tells of every sample"]);
        }
        let told = spoil_record(|record| (record.dsp, record.states, record.told) = (6, 8, 2));
        assert_eq!(told, Vec::<&str>::new());
        assert_eq!(
            failed(|evidence, _| evidence.residue = 1),
            ["nothing left in shared memory"]
        );
        assert_eq!(
            failed(|evidence, _| evidence.exits = &[("bridge", None)]),
            ["every process ended with 0"]
        );
        let aborted = state(ModuleStatus::Aborted, Functionality::AtRest);
        assert_eq!(
            failed(|_, watch| watch.state(&aborted)),
            ["states in the right order"]
        );
        let mut noisy = state(ModuleStatus::Ended, Functionality::AtRest);
        noisy.refused.checksum = 1;
        assert_eq!(
            failed(|_, watch| watch.state(&noisy)),
            ["line without faults"]
        );
        let still_flying = |watch: &mut Watch| {
            let mut sample = *watch.last_hero().unwrap();
            sample.flying = 1;
            watch.hero(&sample, MonotonicNs(0));
        };
        assert_eq!(failed(|_, watch| still_flying(watch)), ["flew and landed"]);
        let wrong_way_round = flight(|points| points.swap(0, 2));
        assert_eq!(
            failed(|_, watch| *watch = wrong_way_round),
            ["waypoints reached in order"]
        );
        let one_missing = flight(|points| points[1] = points[0]);
        assert_eq!(
            failed(|_, watch| *watch = one_missing),
            ["waypoints reached in order"]
        );
    }
}
