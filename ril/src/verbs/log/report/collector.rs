//! [`Collector`]: takes the samples of a flight one after the other and keeps none: curves, phases, events and track,
//! all bounded.

use ipc_types::TelemetryGroup;
use ipc_types::code::PilotSwitch;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use operator::render::messages::details;
use operator::robot::chart::Chart;
use operator::robot::geo::{Place, Spaced, Track, distance_m};
use operator::robot::pilot::PilotView;
use recording::RequestEvent;
use view::page::Weight;
use view::report::FlightReport;
use view::report::flight::{Ink, Lane, Limit, Map};

use super::curves::{Curves, FlightClock, RelativeDelay};
use super::events::{EventLog, LoggedEventKind};
use super::module::{ModuleLog, States};
use super::requests::RequestLog;
use crate::verbs::log::summary::{GAP_S, MAX_STEP_M, SampleStep};

/// Most points of the track: more than a map has columns.
const TRACK_POINTS: usize = 4000;

/// Most spans without samples that are shown.
const MAX_GAPS: usize = 500;

/// A DSP whose clock goes back by more than this has booted, ms. Samples come in order.
const BOOT_BACK_MS: u32 = 500;

/// The DSP's clock begins anew after 2³² ms; that is no boot if it was this near to it, ms.
const WRAP_MS: u32 = 60_000;

/// Leaves out a single place that is farther than [`MAX_STEP_M`] from all others: a damaged number.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    last: Option<Place>,
    far: Option<Place>,
}

impl Places {
    fn confirm(&mut self, place: Place) -> Option<Place> {
        let is_near = |other: Option<Place>| {
            other.is_some_and(|other| distance_m(other, place) <= MAX_STEP_M)
        };
        if self.last.is_none() || is_near(self.last) || is_near(self.far) {
            *self = Places {
                last: Some(place),
                far: None,
            };
            return Some(place);
        }
        self.far = Some(place);
        None
    }
}

/// Without a fix the GPS says zero for everything.
fn with_fix(view: PilotView) -> PilotView {
    match view.gps {
        Some(fix) if !fix.is_there() => PilotView {
            place: None,
            altitude_m: None,
            climb_mps: None,
            ground_speed_mps: None,
            course_deg: None,
            ..view
        },
        _ => view,
    }
}

/// Where the helicopter was, and when, s.
#[derive(Clone, Copy, Debug)]
struct Visit {
    place: Place,
    at_s: f64,
}

impl Spaced for Visit {
    fn distance_m(self, to: Visit) -> f64 {
        distance_m(self.place, to.place)
    }
}

/// What the sample before said.
#[derive(Clone, Copy, Debug)]
struct Before {
    at_s: f64,
    dsp: DspTelemetry,
    view: PilotView,
}

/// Takes the samples of a flight one after the other and keeps none: curves, phases, events and track, all bounded.
#[derive(Debug)]
pub struct Collector {
    clock: FlightClock,
    delay: RelativeDelay,
    curves: Curves,
    event_log: EventLog,
    air: States,
    switch: States,
    fix: States,
    track: Track<Visit>,
    places: Places,
    gaps: Vec<[f64; 2]>,
    before: Option<Before>,
    module: ModuleLog,
    requests: RequestLog,
    /// What telemetry said beside the states of the module.
    flying: Option<bool>,
}

impl Default for Collector {
    fn default() -> Self {
        Collector {
            clock: FlightClock::default(),
            delay: RelativeDelay::default(),
            curves: Curves::default(),
            event_log: EventLog::default(),
            air: States::default(),
            switch: States::default(),
            fix: States::default(),
            track: Track::with_room(TRACK_POINTS),
            places: Places::default(),
            gaps: Vec::new(),
            before: None,
            module: ModuleLog::default(),
            requests: RequestLog::default(),
            flying: None,
        }
    }
}

impl Collector {
    /// Takes the next sample.
    pub fn sample(&mut self, dsp: &DspTelemetry) {
        let at_s = self.clock.at(dsp.received_ns);
        let view = with_fix(PilotView::from(dsp));
        self.flying.get_or_insert(dsp.is_flying());
        if let Some(before) = self.before {
            let step = SampleStep::between(&before.dsp, dsp);
            self.note_gaps(&before, at_s, step);
            self.dsp(&before, at_s, step, dsp, &view);
        }
        if dsp.valid(TelemetryGroup::Time) {
            let late_ms = self.delay.of(at_s, dsp.dsp_time_ms, dsp.received_ns);
            self.curves.delay(at_s, late_ms);
        }
        self.states(at_s, &view);
        self.curves.sample(at_s, dsp, &view);
        if let Some(place) = view.place.and_then(|place| self.places.confirm(place)) {
            self.track.push(Visit { place, at_s });
        }
        self.before = Some(Before {
            at_s,
            dsp: *dsp,
            view,
        });
    }

    /// Takes a sample that status published, after all samples of the DSP were taken.
    pub fn hero(&mut self, hero: &HeroTelemetry) {
        self.flying = Some(hero.is_flying());
        self.curves.hero(self.clock.within(hero.received_ns), hero);
    }

    /// Takes a state of the bridge, after all samples of the DSP were taken.
    pub fn state(&mut self, state: &ModuleState) {
        let at_s = self.clock.within(state.published_ns);
        let (curves, event_log) = (&mut self.curves, &mut self.event_log);
        self.module
            .state(at_s, state, self.flying, curves, event_log);
    }

    /// Takes a request or a report about one.
    pub fn request(&mut self, event: &RequestEvent<'_>) {
        self.requests.take(event);
    }

    /// Something happened to the recording, or was logged by a process, so long after the first sample.
    pub fn happened(&mut self, kind: LoggedEventKind, since_ns: u64, weight: Weight, text: &str) {
        let at_s = (since_ns as f64 / 1e9).min(self.clock.end_s());
        self.event_log.add(kind, at_s, weight, text, None);
    }

    /// A part of the recording is damaged: `text` says how.
    pub fn damage(&mut self, text: &str) {
        let at_s = self.clock.end_s();
        let text = format!("the recording is damaged: {text}");
        self.event_log.add(
            LoggedEventKind::Recording,
            at_s,
            Weight::Warning,
            text,
            None,
        );
    }

    /// Losses, gaps and restarts.
    fn note_gaps(&mut self, before: &Before, at_s: f64, step: SampleStep) {
        let place = before.view.place;
        let interval_s = at_s - before.at_s;
        self.curves.interval(at_s, interval_s * 1000.0);
        if interval_s > GAP_S {
            if self.gaps.len() < MAX_GAPS {
                self.gaps.push([before.at_s, at_s]);
            }
            for states in [&mut self.air, &mut self.switch, &mut self.fix] {
                states.interrupt();
            }
            let is_flying = before.view.flying == Some(true);
            let (weight, whence) = match is_flying {
                true => (Weight::Alarm, "in flight"),
                false => (Weight::Warning, "on the ground"),
            };
            let text = format!("no sample for {interval_s:.1} s {whence}");
            self.event_log
                .add(LoggedEventKind::Gap, before.at_s, weight, text, place);
        }
        if step.lost > 0 {
            self.curves.lost.add(at_s, step.lost as f64);
            self.event_log.count(
                LoggedEventKind::Lost,
                at_s,
                Weight::Warning,
                step.lost,
                "",
                place,
            );
        }
        if step.is_restart {
            self.delay.reset();
            let text = "the bridge began anew";
            self.event_log
                .add(LoggedEventKind::Restart, at_s, Weight::Alarm, text, place);
        }
    }

    /// What the DSP says of itself.
    fn dsp(
        &mut self,
        before: &Before,
        at_s: f64,
        step: SampleStep,
        dsp: &DspTelemetry,
        view: &PilotView,
    ) {
        let place = view.place.or(before.view.place);
        let has_time = |dsp: &DspTelemetry| dsp.valid(TelemetryGroup::Time);
        if has_time(&before.dsp) && has_time(dsp) {
            let was_ms = before.dsp.dsp_time_ms;
            let back_ms = was_ms.saturating_sub(dsp.dsp_time_ms);
            if back_ms > BOOT_BACK_MS {
                self.delay.reset();
                if was_ms < u32::MAX - WRAP_MS {
                    let text = "the DSP booted";
                    self.event_log
                        .add(LoggedEventKind::Boot, at_s, Weight::Alarm, text, place);
                }
            }
        }
        if step.new_errors > 0 {
            let text = format!(
                "the DSP reported {}",
                details::dsp_error(dsp.last_dsp_error_code)
            );
            self.event_log.count(
                LoggedEventKind::DspError,
                at_s,
                Weight::Warning,
                step.new_errors.into(),
                text,
                place,
            );
        }
        self.changes(before, at_s, view);
    }

    /// Take-off, landing, switch and fix.
    fn changes(&mut self, before: &Before, at_s: f64, view: &PilotView) {
        let place = view.place;
        match (before.view.flying, view.flying) {
            (Some(false), Some(true)) => {
                self.event_log.add(
                    LoggedEventKind::Flying,
                    at_s,
                    Weight::Note,
                    "took off",
                    place,
                );
            }
            (Some(true), Some(false)) => {
                self.event_log
                    .add(LoggedEventKind::Flying, at_s, Weight::Note, "landed", place);
            }
            _ => {}
        }
        let change = match (before.view.switch, view.switch) {
            (Some(PilotSwitch::Auto), Some(PilotSwitch::Manual)) => Some((
                Weight::Warning,
                "the pilot took control: the switch is at manual",
            )),
            (Some(PilotSwitch::Manual), Some(PilotSwitch::Auto)) => Some((
                Weight::Note,
                "the pilot gave control: the switch is at auto",
            )),
            _ => None,
        };
        if let Some((weight, text)) = change {
            self.event_log
                .add(LoggedEventKind::Switch, at_s, weight, text, place);
        }
        let (Some(was), Some(is)) = (before.view.gps, view.gps) else {
            return;
        };
        if was.is_there() && !is.is_there() {
            let weight = if view.flying == Some(true) {
                Weight::Alarm
            } else {
                Weight::Warning
            };
            self.event_log.add(
                LoggedEventKind::Fix,
                at_s,
                weight,
                "the GPS lost its fix",
                before.view.place,
            );
        } else if was != is {
            let text = format!("the GPS fix is {}", is.name());
            self.event_log
                .add(LoggedEventKind::Fix, at_s, Weight::Note, text, place);
        }
    }

    fn states(&mut self, at_s: f64, view: &PilotView) {
        match view.flying {
            Some(true) => self.air.set(at_s, "in the air", Ink::Blue),
            Some(false) => self.air.set(at_s, "on the ground", Ink::Grey),
            None => self.air.interrupt(),
        }
        match view.switch {
            Some(PilotSwitch::Auto) => self.switch.set(at_s, "auto", Ink::Green),
            Some(PilotSwitch::Manual) => self.switch.set(at_s, "manual", Ink::Yellow),
            Some(PilotSwitch::Unknown) | None => self.switch.interrupt(),
        }
        match view.gps {
            Some(fix) if fix.is_there() => self.fix.set(at_s, fix.name(), Ink::Green),
            Some(fix) => self.fix.set(at_s, fix.name(), Ink::Red),
            None => self.fix.interrupt(),
        }
    }

    /// The flight, with what files say of fence and plan. Its words are not there yet.
    pub fn finish(self, title: String, chart: &Chart) -> FlightReport {
        let duration_s = self.clock.end_s();
        let mut flight = FlightReport::new(title, duration_s);
        let lane = |name: &str, states: States| Lane {
            name: name.to_owned(),
            spans: states.finish(duration_s),
        };
        let (doing, link) = self.module.finish(duration_s);
        flight.phases = match doing.is_empty() {
            true => self.air.finish(duration_s),
            false => doing,
        };
        flight.lanes = vec![link, lane("switch", self.switch), lane("GPS fix", self.fix)];
        flight.gaps = self.gaps;
        flight.plots = self.curves.plots(limits(chart));
        let (events, left_out) = self.event_log.finish();
        flight.events_left_out = left_out;
        // What was asked for is the plan, when the operator names none.
        let mut chart = chart.clone();
        if chart.path.is_empty() {
            chart.path = self.requests.path();
        }
        flight.map = map_of(self.track.points(), chart);
        flight.requests = self.requests.finish(|ns| self.clock.within(ns));
        if self.requests.left_out() > 0 {
            let text = format!(
                "{} further requests are not shown.",
                self.requests.left_out()
            );
            flight.remarks.push(text);
        }
        flight.events = events;
        if self.clock.jumps() > 0 {
            flight.remarks.push(format!(
                "The clock jumped {} times; times go on where they were.",
                self.clock.jumps()
            ));
        }
        flight
    }
}

/// Most waypoints and corners that are drawn; a survey has some hundreds.
const MAX_POINTS: usize = 5000;

/// The map of a track with what files say of its surroundings.
fn map_of(track: &[Visit], chart: Chart) -> Map {
    let fence = chart.fence.into_iter().map(|mut area| {
        area.corners.truncate(MAX_POINTS);
        area
    });
    Map {
        track: track.iter().map(|visit| visit.place.degrees()).collect(),
        track_s: track.iter().map(|visit| visit.at_s).collect(),
        plan: chart
            .path
            .into_iter()
            .take(MAX_POINTS)
            .map(Place::degrees)
            .collect(),
        fence: fence.collect(),
    }
}

/// Floor and ceiling of the fence.
fn limits(chart: &Chart) -> Vec<Limit> {
    let limits = [
        ("floor of the fence", chart.floor_m),
        ("ceiling of the fence", chart.ceiling_m),
    ];
    let known = limits.into_iter().filter_map(|(name, value)| {
        Some(Limit {
            name: name.to_owned(),
            value: value?,
        })
    });
    known.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_place_far_away_is_not_confirmed_and_a_second_one_is() {
        let place = |latitude_deg| Place::new(latitude_deg, -6.0).unwrap();
        let mut places = Places::default();
        let confirmed = [37.0, 37.001, 77.0, 37.002, 50.0, 50.001, 50.002]
            .map(|latitude_deg| places.confirm(place(latitude_deg)).is_some());
        assert_eq!(confirmed, [true, true, false, true, false, true, true]);
    }
}
