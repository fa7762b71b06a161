//! What the process decides: a value that is given samples and the time, and gives what to publish, what happened, and
//! when it wants to be woken next.
//!
//! It knows no port, no clock and no thread. It never delays a sample: publishing comes before logging. What it
//! publishes follows from its [`Input`]s alone, so a [journal](crate::journal) of these replays it.

use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{Module, MonotonicNs, StatusModule};
use module_kit::journal::raw;
use module_kit::{Manager, OnStop};
use serde::{Deserialize, Serialize};

use crate::calibration::Calibration;
use crate::estimator::Estimator;
use crate::fields::plausible;
use crate::group::GroupSet;
use crate::log::Logs;
use crate::log::event::{LogEvent, LogSummary};
use crate::rate_limited::RateLimitedCounter;
use crate::translate::translate;

/// Without a sample for this long the input counts as silent. At the bridge's default of 50 samples a second, 50 in a
/// row are missing.
pub const SILENT_AFTER: Duration = Duration::from_secs(1);

/// How often losses are reported while they go on, with increment and total.
pub const LOSS_REPORT_PERIOD: Duration = Duration::from_secs(5);

/// What a subscriber counted since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputCounts {
    /// Samples that were received.
    pub received: u64,
    /// Samples that were published and not received.
    pub lost: u64,
    /// How often another bridge took over.
    pub publisher_restarts: u64,
}

/// What the core can be given. A journal has inputs as this enum in postcard's format, see `docs/journal.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum Input {
    /// A sample of the bridge arrived. Its translation is the output.
    Sample(#[serde(with = "raw")] DspTelemetry),
    /// The translation of the last sample was published, or could not be.
    Published(Result<(), String>),
    /// What the subscriber has counted, and that time has passed.
    Step(InputCounts),
    /// The state is to be published: in any case when `always`, else if it has changed. It is the output. Without one,
    /// nothing has happened.
    State {
        /// In any case.
        always: bool,
    },
}

/// What the core said to an input, but for what the publisher fills in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum Output {
    /// A telemetry sample to publish, without `sequence` and `epoch_ns`.
    Telemetry(#[serde(with = "raw")] HeroTelemetry),
    /// A state to publish, without `sequence`, `epoch_ns` and `published_ns`.
    State(#[serde(with = "raw")] State),
}

/// Something that the operator should know.
#[derive(Debug)]
pub enum Event {
    /// Telemetry is received: for the first time, or after a silence.
    InputStarted,
    /// No telemetry for [`SILENT_AFTER`].
    InputSilent,
    /// Another bridge publishes now: the former one was restarted.
    PublisherRestarted,
    /// Samples were lost. At onset and once a [`LOSS_REPORT_PERIOD`].
    SamplesLost {
        /// How many since the last such event.
        lost: u64,
        /// How many since the start.
        total: u64,
    },
    /// Groups are marked as valid and hold implausible values, for the first time: they are left out.
    GroupsImplausible {
        /// Which.
        groups: GroupSet,
    },
    /// A sample could not be published; once for each series of failures.
    OutputFailed {
        /// Why.
        reason: String,
    },
    /// Something about a log.
    Log(LogEvent),
}

/// What the process did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Samples in.
    pub received: u64,
    /// Samples lost on the way in.
    pub lost: u64,
    /// Samples out.
    pub published: u64,
    /// What became of each log.
    pub logs: Vec<LogSummary>,
}

/// The process without its surroundings.
pub struct Status {
    calibration: Calibration,
    estimator: Option<Box<dyn Estimator + Send>>,
    logs: Logs,
    input: InputState,
    output: OutputState,
    /// The sample that was translated last, without its implausible groups, and those.
    checked: (DspTelemetry, GroupSet),
    /// What the published state says.
    manager: Manager,
    /// Drained by the caller after each step: at most a handful for a step and a log.
    events: Vec<Event>,
}

/// The state of the input.
#[derive(Clone, Serialize, Deserialize)]
struct InputState {
    counts: InputCounts,
    /// When the last sample came, while the input is not silent.
    flowing_since: Option<MonotonicNs>,
    lost: RateLimitedCounter,
    /// The groups that were reported as implausible.
    implausible: GroupSet,
}

/// The state of the output.
#[derive(Clone, Default, Serialize, Deserialize)]
struct OutputState {
    published: u64,
    /// Whether the last sample could not be published.
    failing: bool,
}

/// What a snapshot has of the process. Logs and events are not of it: nothing that is published follows from them.
#[derive(Serialize, Deserialize)]
pub(crate) struct CoreSnapshot {
    input: InputState,
    output: OutputState,
    manager: Manager,
    estimator: KeptEstimator,
}

/// What a snapshot has of the estimator.
#[derive(Serialize, Deserialize)]
enum KeptEstimator {
    /// There is none.
    Absent,
    /// It cannot say what it knows.
    Unknown,
    /// What it knows.
    Known(Vec<u8>),
}

impl Status {
    /// What a snapshot has of the process.
    pub(crate) fn keep(&self) -> CoreSnapshot {
        let estimator = match &self.estimator {
            None => KeptEstimator::Absent,
            Some(estimator) => match estimator.save() {
                Some(bytes) => KeptEstimator::Known(bytes),
                None => KeptEstimator::Unknown,
            },
        };
        CoreSnapshot {
            input: self.input.clone(),
            output: self.output.clone(),
            manager: self.manager.clone(),
            estimator,
        }
    }

    /// The process that was kept, without logs; `None` if its estimator is not `estimator`.
    pub(crate) fn from_kept(
        kept: CoreSnapshot,
        calibration: Calibration,
        mut estimator: Option<Box<dyn Estimator + Send>>,
    ) -> Option<Status> {
        let is_restored = match (&mut estimator, &kept.estimator) {
            (None, KeptEstimator::Absent) => true,
            (Some(estimator), KeptEstimator::Known(bytes)) => estimator.restore(bytes),
            _ => false,
        };
        is_restored.then_some(Status {
            calibration,
            estimator,
            logs: Logs::default(),
            input: kept.input,
            output: kept.output,
            checked: Default::default(),
            manager: kept.manager,
            events: Vec::new(),
        })
    }

    /// Continues with another configuration: what it would do from here on. Another kind of estimator begins anew.
    pub(crate) fn reconfigure(
        &mut self,
        calibration: Calibration,
        estimator: Option<Box<dyn Estimator + Send>>,
    ) {
        let known = self
            .estimator
            .as_ref()
            .and_then(|estimator| estimator.save());
        self.calibration = calibration;
        self.estimator = estimator;
        if let (Some(estimator), Some(known)) = (&mut self.estimator, known) {
            estimator.restore(&known);
        }
    }

    /// The process with `calibration` and without an estimator, which gives what comes to `logs`. It began at `now`.
    pub fn new(calibration: Calibration, logs: Logs, now: MonotonicNs) -> Status {
        let mut manager = Manager::new(now);
        // Status has no control: it works from its beginning to its end.
        let _ = manager.control(now, ControlCommand::Start);
        let mut status = Status {
            calibration,
            estimator: None,
            logs,
            input: InputState {
                counts: InputCounts::default(),
                flowing_since: None,
                lost: RateLimitedCounter::every(LOSS_REPORT_PERIOD),
                implausible: GroupSet::default(),
            },
            output: OutputState::default(),
            checked: Default::default(),
            manager,
            events: Vec::new(),
        };
        status.input_flows(false, now);
        status
    }

    /// Since when it does what it does.
    pub(crate) fn since(&self) -> MonotonicNs {
        self.manager.since()
    }

    /// Replaces the estimator by `estimator`, which is fed with every sample.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Status {
        self.estimator = Some(estimator);
        self
    }

    /// Takes an input.
    pub fn apply(&mut self, now: MonotonicNs, input: Input) -> Option<Output> {
        match input {
            Input::Sample(dsp) => Some(Output::Telemetry(self.translate(&dsp, now))),
            Input::Published(outcome) => {
                self.record(outcome, now);
                None
            }
            Input::Step(counts) => {
                self.count(counts, now);
                self.on_time(now);
                None
            }
            Input::State { always } => {
                let is_due = self.manager.take_changed() || always;
                is_due.then(|| Output::State(self.manager.state(StatusModule::ID)))
            }
        }
    }

    /// What to publish for `dsp` at `now`. Called once for each sample: the estimator goes on with it.
    fn translate(&mut self, dsp: &DspTelemetry, now: MonotonicNs) -> HeroTelemetry {
        self.checked = plausible(dsp);
        let (dsp, _) = &self.checked;
        let mut hero = translate(dsp, &self.calibration, now);
        if let Some(estimator) = &mut self.estimator {
            hero.estimate = estimator.update(dsp, &hero);
        }
        hero
    }

    /// Takes note at `now` of the sample that was [translated](Self::translate) last: what that gave was published or
    /// could not be.
    fn record(&mut self, outcome: Result<(), String>, now: MonotonicNs) {
        if self.input.flowing_since.replace(now).is_none() {
            self.events.push(Event::InputStarted);
            self.input_flows(true, now);
        }
        match outcome {
            Ok(()) => {
                self.output.published += 1;
                self.output.failing = false;
            }
            Err(reason) => {
                if !std::mem::replace(&mut self.output.failing, true) {
                    self.events.push(Event::OutputFailed { reason });
                }
            }
        }
        let (dsp, implausible) = &self.checked;
        self.logs.record(dsp);
        if *implausible != GroupSet::default() {
            let groups = implausible.without(self.input.implausible);
            self.report_implausible(groups);
        }
    }

    /// Reports groups that hold implausible values, each once.
    fn report_implausible(&mut self, groups: GroupSet) {
        if !groups.is_empty() {
            self.input.implausible = self.input.implausible.union(groups);
            self.events.push(Event::GroupsImplausible { groups });
        }
    }

    /// Takes note of what the subscriber has counted by `now`.
    fn count(&mut self, counts: InputCounts, now: MonotonicNs) {
        if counts.publisher_restarts > self.input.counts.publisher_restarts {
            self.events.push(Event::PublisherRestarted);
        }
        self.input.counts = counts;
        self.input.lost.set(counts.lost);
        self.report_losses(now);
    }

    /// Does what is due at `now`.
    fn on_time(&mut self, now: MonotonicNs) {
        let log_events = self.logs.on_time(now);
        self.events.extend(log_events.into_iter().map(Event::Log));
        self.report_losses(now);
        if self.input.silent_at().is_some_and(|at| at <= now) {
            self.input.flowing_since = None;
            self.events.push(Event::InputSilent);
            self.input_flows(false, now);
        }
    }

    /// When an [`Input::Step`] has something to do; `None` if not before the next sample.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let report_losses = self.input.lost.deadline();
        [self.logs.deadline(), self.input.silent_at(), report_losses]
            .into_iter()
            .flatten()
            .min()
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Closes the logs; the last thing to do. How their writers end is not known here.
    pub fn finish(&mut self) -> Summary {
        self.logs.close();
        Summary {
            received: self.input.counts.received,
            lost: self.input.counts.lost,
            published: self.output.published,
            logs: self.logs.summaries().collect(),
        }
    }

    fn input_flows(&mut self, flows: bool, now: MonotonicNs) {
        let (functionality, doing) = match flows {
            true => (StatusModule::TRANSLATING, "translating telemetry"),
            false => (StatusModule::WAITING, "waiting for telemetry"),
        };
        self.manager
            .begin(now, functionality, doing, OnStop::Refused);
    }

    fn report_losses(&mut self, now: MonotonicNs) {
        if let Some(lost) = self.input.lost.due(now) {
            let total = self.input.lost.total();
            self.events.push(Event::SamplesLost { lost, total });
        }
    }
}

impl InputState {
    /// When the input counts as silent, unless a sample comes.
    fn silent_at(&self) -> Option<MonotonicNs> {
        self.flowing_since.map(|since| since + SILENT_AFTER)
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;
    use ipc_types::payload::HeroEstimate;

    use super::*;
    use crate::log::queue::QUEUE_SAMPLES;
    use crate::test_samples::{full_sample, sample};

    const START: MonotonicNs = MonotonicNs(10_000_000_000);

    fn after_ms(ms: u64) -> MonotonicNs {
        START + Duration::from_millis(ms)
    }

    fn without_logs() -> Status {
        Status::new(Calibration::default(), Logs::default(), START)
    }

    fn take(
        status: &mut Status,
        dsp: &DspTelemetry,
        outcome: Result<(), String>,
        now: MonotonicNs,
    ) {
        status.translate(dsp, now);
        status.record(outcome, now);
    }

    /// Names of the events since the last call.
    fn events(status: &mut Status) -> Vec<String> {
        let events = status.take_events();
        let name = |event: &Event| match event {
            Event::SamplesLost { lost, total } => format!("lost {lost} of {total}"),
            Event::Log(LogEvent::RowsLost { lost, .. }) => format!("log lost {lost}"),
            Event::OutputFailed { reason } => reason.clone(),
            other => format!("{other:?}"),
        };
        events.iter().map(name).collect()
    }

    #[test]
    fn input_that_starts_stops_and_comes_back_is_reported_once_each() {
        let mut status = without_logs();
        assert_eq!(
            status.deadline(),
            None,
            "before the first sample nothing is due"
        );
        status.on_time(after_ms(60_000));
        assert!(events(&mut status).is_empty());

        take(&mut status, &sample(1, 1), Ok(()), START);
        take(&mut status, &sample(1, 2), Ok(()), after_ms(20));
        assert_eq!(events(&mut status), ["InputStarted"]);
        assert_eq!(status.deadline(), Some(after_ms(1020)));
        status.on_time(after_ms(1019));
        assert!(events(&mut status).is_empty());
        status.on_time(after_ms(1020));
        assert_eq!(events(&mut status), ["InputSilent"]);
        assert_eq!(status.deadline(), None);
        take(&mut status, &sample(1, 3), Ok(()), after_ms(5000));
        assert_eq!(events(&mut status), ["InputStarted"]);
    }

    #[test]
    fn implausible_groups_are_left_out_and_reported_once() {
        let mut status = without_logs();
        let mut dsp = sample(1, 1);
        dsp.geographic.latitude_deg = f64::NAN;
        dsp.flying = 0xff;
        for _ in 0..3 {
            let hero = status.translate(&dsp, START);
            let position = TelemetryGroup::Geographic;
            assert!(!hero.valid(position) && hero.valid(TelemetryGroup::Xy));
            assert_eq!((hero.geodetic.latitude_rad, hero.flying), (0.0, 1));
            status.record(Ok(()), START);
        }
        dsp.gps_quality = 99;
        take(&mut status, &dsp, Ok(()), START);
        let implausible = |event: &Event| match event {
            Event::GroupsImplausible { groups } => Some(groups.to_string()),
            _ => None,
        };
        let events = status.take_events();
        let implausible: Vec<_> = events.iter().filter_map(implausible).collect();
        assert_eq!(implausible, ["geographic", "gps_quality"]);
    }

    /// Counts the samples that it is fed with, and the groups that they have.
    #[derive(Default)]
    struct Counting(f64);

    impl Estimator for Counting {
        fn update(&mut self, raw: &DspTelemetry, hero: &HeroTelemetry) -> HeroEstimate {
            assert_eq!(u32::from(raw.valid_groups), hero.valid_groups);
            self.0 += 1.0;
            HeroEstimate {
                altitude_m: self.0,
                inputs: raw.valid_groups.into(),
                valid: 1,
                ..HeroEstimate::default()
            }
        }

        fn save(&self) -> Option<Vec<u8>> {
            Some(self.0.to_le_bytes().to_vec())
        }

        fn restore(&mut self, bytes: &[u8]) -> bool {
            let known = bytes.try_into().map(f64::from_le_bytes);
            known.map(|known| self.0 = known).is_ok()
        }
    }

    #[test]
    fn another_configuration_holds_from_the_next_sample_on_and_the_estimator_goes_on() {
        let dsp = full_sample();
        let mut status = without_logs().with_estimator(Box::new(Counting::default()));
        let before = status.translate(&dsp, START);
        let mut calibration = Calibration::default();
        calibration.sonar.m_per_step *= 2.0;
        status.reconfigure(calibration, Some(Box::new(Counting::default())));
        let after = status.translate(&dsp, START);
        assert!(before.sonar_height_m > 0.0);
        assert_eq!(after.sonar_height_m, 2.0 * before.sonar_height_m);
        assert_eq!(after.estimate.altitude_m, 2.0);
        // So it does after a snapshot, which is none for another kind.
        let counting: Box<dyn Estimator + Send> = Box::new(Counting::default());
        let kept = |estimator| Status::from_kept(status.keep(), Calibration::default(), estimator);
        assert!(kept(None).is_none());
        let again = kept(Some(counting)).unwrap().translate(&dsp, START);
        assert_eq!(again.estimate.altitude_m, 3.0);
        status.reconfigure(Calibration::default(), None);
        let without = status.translate(&dsp, START).estimate;
        assert_eq!(without, HeroEstimate::default());
    }

    #[test]
    fn an_estimator_is_fed_with_every_plausible_sample_and_published() {
        let mut dsp = sample(1, 1);
        dsp.geographic.latitude_deg = f64::NAN;
        let plausible = u32::from(!TelemetryGroup::Geographic.bit());
        let mut status = without_logs().with_estimator(Box::new(Counting::default()));
        for expected in [1.0, 2.0, 3.0] {
            let estimate = status.translate(&dsp, START).estimate;
            assert_eq!(
                (estimate.altitude_m, estimate.inputs),
                (expected, plausible)
            );
        }
        let none = without_logs().translate(&dsp, START).estimate;
        assert_eq!(none, HeroEstimate::default());
    }

    #[test]
    fn losses_are_reported_at_once_and_then_summed_up() {
        let mut status = without_logs();
        let counts = |received, lost| InputCounts {
            received,
            lost,
            publisher_restarts: 0,
        };
        status.count(counts(1, 0), START);
        assert!(events(&mut status).is_empty());
        status.count(counts(2, 3), after_ms(10));
        assert_eq!(events(&mut status), ["lost 3 of 3"]);
        status.count(counts(3, 4), after_ms(20));
        status.count(counts(4, 9), after_ms(30));
        assert!(events(&mut status).is_empty());
        assert_eq!(status.deadline(), Some(after_ms(5010)));
        status.on_time(after_ms(5010));
        assert_eq!(events(&mut status), ["lost 6 of 9"]);
        assert_eq!(status.deadline(), None);
    }

    #[test]
    fn the_state_says_whether_telemetry_flows_when_it_changes_and_when_it_is_due() {
        let mut status = without_logs();
        let said = |status: &mut Status, always, ms| {
            let output = status.apply(after_ms(ms), Input::State { always });
            let state = output.map(|output| match output {
                Output::State(state) => state,
                Output::Telemetry(_) => panic!("a state"),
            });
            state.map(|state| (state.functionality, state.since_ns))
        };
        let waiting = |ms| Some((StatusModule::WAITING, after_ms(ms).0));
        assert_eq!(said(&mut status, false, 0), waiting(0));
        assert_eq!(said(&mut status, false, 10), None);
        assert_eq!(said(&mut status, true, 10), waiting(0));
        take(&mut status, &sample(1, 1), Ok(()), after_ms(20));
        let translating = Some((StatusModule::TRANSLATING, after_ms(20).0));
        assert_eq!(said(&mut status, false, 30), translating);
        status.on_time(after_ms(1_020));
        assert_eq!(said(&mut status, false, 1_030), waiting(1_020));
    }

    #[test]
    fn another_bridge_is_reported() {
        let mut status = without_logs();
        let counts = InputCounts {
            publisher_restarts: 1,
            ..InputCounts::default()
        };
        status.count(counts, START);
        status.count(counts, START);
        assert_eq!(events(&mut status), ["PublisherRestarted"]);
    }

    #[test]
    fn an_output_that_fails_is_reported_once_until_it_works_again() {
        let mut status = without_logs();
        let failed = || Err("no room".to_owned());
        let outcomes = [failed(), failed(), Ok(()), failed()];
        for (sequence, outcome) in (1..).zip(outcomes) {
            take(&mut status, &sample(1, sequence), outcome, START);
        }
        assert_eq!(events(&mut status), ["InputStarted", "no room", "no room"]);
        assert_eq!(status.finish().published, 1);
    }

    #[test]
    fn a_log_whose_disk_hangs_never_stops_the_telemetry() {
        let mut logs = Logs::default();
        // Its thread takes nothing out.
        let hanging = logs.add("log/x.tsv".to_owned());
        let mut status = Status::new(Calibration::default(), logs, START);
        let bound = QUEUE_SAMPLES as u64;
        for sequence in 1..=bound + 100 {
            let now = after_ms(20 * sequence);
            status.on_time(now);
            let dsp = sample(1, sequence);
            assert_eq!(status.translate(&dsp, now).source_sequence, sequence);
            status.record(Ok(()), now);
        }
        assert_eq!(events(&mut status), ["InputStarted", "log lost 1"]);
        let summary = status.finish();
        assert_eq!(summary.published, bound + 100);
        assert_eq!(summary.logs[0].offered, bound + 100);
        assert_eq!(summary.logs[0].refused, 100);
        assert_eq!(hanging.waiting().count() as u64, bound);
    }
}
