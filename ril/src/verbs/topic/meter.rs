//! [`Meter`]: what `ril hz`, `ril delay` and `ril bw` measure, a pure value. It is given samples with the moment at
//! which each came, and reports one quantity at any time.
//!
//! * The rate is measured twice, because the two differ when samples are lost: the observed rate counts what came, the
//!   published one goes by sequence numbers and the publisher's own times. A sample of another publisher begins anew;
//!   the pause between two publishers is the rate of neither.
//! * The age of a sample is measured three times, as far as it has the times. The first two compare host times, which
//!   all processes of a machine share. The DSP's clock began at its boot and cannot be compared with the host's; but
//!   the quickest samples show how the two stand to each other, and how much later than those a sample came can be
//!   said: what the line, the DSP's own queue and this machine added.
//! * Bytes are those that would have to be carried over a tunnel to another machine, or written into a log: in shared
//!   memory a consumer reads where the publisher wrote.
//!
//! Losses are not guessed from times: they are those that the subscriber counted by sequence numbers.

use std::time::Duration;

use ipc_types::{Losses, MonotonicNs};
use operator::render::stamps::{DspClock, Stamps};
use operator::render::words::{count, or_dash};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use serde_json::Value;

use self::Figure::{Line, Plain, Spread};
use super::histogram::{Detail, Distribution, Histogram, Unit, rounded};

/// For how long the DSP's clock is compared with the quickest sample. Two quartzes drift apart by up to 1 ms in this
/// time, which is the step of the DSP's clock; a longer time would show the drift and not the delay.
const WINDOW: Duration = Duration::from_secs(10);

/// Most samples that are compared: 400 a second in the time of the window. When more come the window ends earlier.
const MAX_WINDOW_SAMPLES: usize = 4096;

/// The length of a second, ns.
const SECOND_NS: u64 = 1_000_000_000;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `ril hz`: how often samples come here, and how often they are published.
    Rate,
    /// `ril delay`: how old they are when they come.
    Age,
    /// `ril bw`: how many bytes they make.
    Bandwidth,
}

/// Whose samples are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Of<'a> {
    /// Robot id.
    pub robot: u32,
    /// Key of the service, such as `hero_telemetry`.
    pub service: &'a str,
    /// What the relay says; `None` if the samples are of this machine.
    pub relayed: Option<Relayed>,
}

/// What the relay says of samples that come from another machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relayed {
    /// How far their times, which the relay translated to this machine's clock, may be from the truth, to either side,
    /// s; `None` if the relay does not know it.
    pub uncertainty_s: Option<f64>,
    /// Samples of all topics that came, and that were lost on the air, while it was measured; `None` if that is not
    /// known.
    pub air: Option<(u64, u64)>,
}

impl Relayed {
    fn uncertainty_ms(self) -> Option<f64> {
        self.uncertainty_s.map(|seconds| rounded(seconds * 1e3, 6))
    }

    fn truth(self) -> String {
        let truth = match self.uncertainty_ms() {
            Some(ms) => format!("ages are true within ±{ms:.3} ms"),
            None => "how true the ages are is not known".to_owned(),
        };
        format!("relayed from another machine: {truth}")
    }
}

/// Measures one topic for `ril hz`, `ril delay` and `ril bw`. Whatever it reports, it measures all: pages of histograms
/// that are not used take no memory.
#[derive(Clone, Debug)]
pub struct Meter {
    quantity: Quantity,
    payload_bytes: u64,
    samples: u64,
    first: Option<MonotonicNs>,
    last: Option<(Stamps, MonotonicNs)>,
    /// Steps of the sequence, and the time that they took by the publisher's clock.
    published: u64,
    published_ns: u64,
    intervals: Histogram,
    published_intervals: Histogram,
    since_sent: Histogram,
    since_received: Histogram,
    since_published: Histogram,
    window: ClockWindow,
    behind_quickest: Histogram,
    /// The second under way: when it began, and the bytes in it so far.
    second: Option<(MonotonicNs, u64)>,
    seconds: Histogram,
}

/// The samples that are being compared by the DSP's clock.
#[derive(Clone, Debug, Default)]
struct ClockWindow {
    began: MonotonicNs,
    clock: Option<DspClock>,
    /// Of each sample, when it came minus what the DSP's clock said: the same for all that took the same time.
    offsets_ns: Vec<i128>,
}

impl ClockWindow {
    /// Whether a sample that came at `now` with `clock` has to be compared with others.
    fn is_over(&self, clock: DspClock, now: MonotonicNs) -> bool {
        self.offsets_ns.len() == MAX_WINDOW_SAMPLES
            || now.since(self.began) >= WINDOW
            || self.clock.is_some_and(|last| {
                clock.boots != last.boots || clock.since_boot_ns < last.since_boot_ns
            })
    }

    /// Adds each sample's lag behind the quickest to `histogram`.
    fn compare(&self, histogram: &mut Histogram) {
        let Some(quickest) = self.offsets_ns.iter().min() else {
            return;
        };
        for offset in &self.offsets_ns {
            histogram.record(u64::try_from(offset - quickest).unwrap_or(u64::MAX));
        }
    }

    /// Takes a sample; one that cannot be compared with those before ends their comparison, which goes into
    /// `histogram`.
    fn take(&mut self, clock: DspClock, now: MonotonicNs, histogram: &mut Histogram) {
        if self.offsets_ns.is_empty() {
            self.began = now;
        } else if self.is_over(clock, now) {
            self.compare(histogram);
            self.offsets_ns.clear();
            self.began = now;
        }
        self.clock = Some(clock);
        let offset_ns = i128::from(now.0) - i128::from(clock.since_boot_ns);
        self.offsets_ns.push(offset_ns);
    }
}

impl Meter {
    /// Begins to measure samples of so many bytes.
    pub fn new(quantity: Quantity, payload_bytes: usize) -> Meter {
        let times = || Histogram::new(Unit::Milliseconds);
        Meter {
            quantity,
            payload_bytes: payload_bytes as u64,
            samples: 0,
            first: None,
            last: None,
            published: 0,
            published_ns: 0,
            intervals: times(),
            published_intervals: times(),
            since_sent: times(),
            since_received: times(),
            since_published: times(),
            window: ClockWindow {
                offsets_ns: Vec::with_capacity(MAX_WINDOW_SAMPLES),
                ..ClockWindow::default()
            },
            behind_quickest: times(),
            second: None,
            seconds: Histogram::new(Unit::Bytes),
        }
    }

    /// Takes a sample that came at `now`.
    pub fn take(&mut self, stamps: &Stamps, now: MonotonicNs) {
        self.samples += 1;
        self.first.get_or_insert(now);
        if let Some((last, came)) = self.last.replace((*stamps, now)) {
            self.intervals.record(now.0.saturating_sub(came.0));
            if stamps.epoch_ns == last.epoch_ns {
                let steps = stamps.sequence.saturating_sub(last.sequence);
                let took_ns = stamps.sent.0.saturating_sub(last.sent.0);
                self.published = self.published.saturating_add(steps);
                self.published_ns = self.published_ns.saturating_add(took_ns);
                if steps == 1 {
                    self.published_intervals.record(took_ns);
                }
            }
        }
        for (time, histogram) in [
            (stamps.from_dsp, &mut self.since_sent),
            (stamps.received, &mut self.since_received),
            (stamps.published, &mut self.since_published),
        ] {
            if let Some(time) = time {
                histogram.record(now.0.saturating_sub(time.0));
            }
        }
        if let Some(clock) = stamps.dsp {
            self.window.take(clock, now, &mut self.behind_quickest);
        }
        self.count(now);
    }

    /// Counts a sample into its second. Seconds in which nothing came count as well.
    fn count(&mut self, now: MonotonicNs) {
        let (began, bytes) = self.second.get_or_insert((now, 0));
        let over = now.0.saturating_sub(began.0) / SECOND_NS;
        if over > 0 {
            self.seconds.record(*bytes);
            self.seconds.record_n(0, over - 1);
            *began = MonotonicNs(began.0 + over * SECOND_NS);
            *bytes = 0;
        }
        *bytes += self.payload_bytes;
    }

    /// From the first sample to the last, s.
    fn seconds(&self) -> f64 {
        match (self.first, self.last) {
            (Some(first), Some((_, last))) => last.since(first).as_secs_f64(),
            _ => 0.0,
        }
    }

    /// Samples that came here and that were published, a second, each times `size`; `None` before the second.
    fn rates(&self, size: f64, decimals: i32) -> [Option<f64>; 2] {
        let came = (self.samples.saturating_sub(1), self.seconds());
        let published = (self.published, self.published_ns as f64 / 1e9);
        [came, published].map(|(count, seconds)| {
            let is_known = count > 0 && seconds > 0.0;
            is_known.then(|| rounded(count as f64 / seconds * size, decimals))
        })
    }

    /// What was measured so far.
    pub fn report(&self, of: Of, losses: Losses) -> MeterReport {
        let mut figures = self.of_all(of, losses);
        figures.extend(self.of_quantity(of.relayed));
        MeterReport(figures)
    }

    /// What each report has.
    fn of_all(&self, of: Of, losses: Losses) -> Vec<Figure> {
        let schema = match self.quantity {
            Quantity::Rate => "ril.Rate.v1",
            Quantity::Age => "ril.Delay.v3",
            Quantity::Bandwidth => "ril.Bandwidth.v1",
        };
        let (robot, service) = (of.robot, of.service);
        let (samples, seconds) = (count(self.samples, "sample"), rounded(self.seconds(), 6));
        let lost = losses.lost;
        let due = losses.received.saturating_add(lost);
        let percent = rounded(100.0 * lost as f64 / due.max(1) as f64, 4);
        let restarts = count(losses.publisher_restarts, "publisher restart");
        let air = of.relayed.and_then(|relayed| relayed.air);
        let air = air.map(|(came, lost)| {
            let sent = came.saturating_add(lost);
            let percent = 100.0 * lost as f64 / sent.max(1) as f64;
            (sent, lost, rounded(percent, 4))
        });
        let on_air = |(sent, lost, percent)| {
            format!("on the air {lost} of {sent} samples of all topics lost ({percent:.2} %)")
        };
        vec![
            Line(Some(format!(
                "{service} of robot {robot}: {samples} in {seconds:.3} s"
            ))),
            Line(Some(format!("{lost} lost ({percent:.2} %), {restarts}"))),
            Line(air.map(on_air)),
            Plain("schema", schema.into()),
            Plain("robot", robot.into()),
            Plain("service", service.into()),
            Plain("samples", self.samples.into()),
            Plain("seconds", seconds.into()),
            Plain("lost", lost.into()),
            Plain("lost_percent", percent.into()),
            Plain("joined_late", losses.joined_late.into()),
            Plain("repeated", losses.repeated.into()),
            Plain("publisher_restarts", losses.publisher_restarts.into()),
            Plain("relayed", of.relayed.is_some().into()),
            Plain("lost_on_air", air.map(|(_, lost, _)| lost).into()),
            Plain(
                "lost_on_air_percent",
                air.map(|(.., percent)| percent).into(),
            ),
        ]
    }

    /// What the report of each quantity has beside that.
    fn of_quantity(&self, relayed: Option<Relayed>) -> Vec<Figure> {
        let both = |rates: [Option<f64>; 2], shown: fn(f64) -> String| {
            let [observed, published] = rates.map(|rate| or_dash(rate.map(shown)));
            Line(Some(format!("observed {observed}, published {published}")))
        };
        let spread = |name, title, histogram: &Histogram| Spread(name, title, histogram.summary());
        match self.quantity {
            Quantity::Rate => {
                let rates = self.rates(1.0, 3);
                let (here, there) = ("interval here", "interval at the publisher");
                vec![
                    both(rates, |hz| format!("{hz:.2} Hz")),
                    Plain("observed_hz", rates[0].into()),
                    Plain("published_hz", rates[1].into()),
                    spread("interval_ms", here, &self.intervals),
                    spread("published_interval_ms", there, &self.published_intervals),
                ]
            }
            Quantity::Age => {
                let uncertainty_ms = relayed.and_then(Relayed::uncertainty_ms);
                let mut behind_quickest = self.behind_quickest.clone();
                self.window.compare(&mut behind_quickest);
                let sent = "DSP's last byte to here, at least";
                let (received, published) = ("bridge's last byte to here", "publisher to here");
                let behind = "DSP's clock to here, behind the quickest";
                vec![
                    Line(relayed.map(Relayed::truth)),
                    spread("since_sent_ms", sent, &self.since_sent),
                    spread("since_received_ms", received, &self.since_received),
                    spread("since_published_ms", published, &self.since_published),
                    spread("behind_quickest_ms", behind, &behind_quickest),
                    Plain("age_uncertainty_ms", uncertainty_ms.into()),
                ]
            }
            Quantity::Bandwidth => {
                let (size, bytes) = (self.payload_bytes, self.samples * self.payload_bytes);
                let rates = self.rates(size as f64, 1);
                vec![
                    both(rates, |bytes| format!("{:.2} kB/s", bytes / 1e3)),
                    Line(Some(format!("{size} B a sample, {bytes} B in all"))),
                    Plain("payload_bytes", size.into()),
                    Plain("bytes", bytes.into()),
                    Plain("observed_bytes_per_s", rates[0].into()),
                    Plain("published_bytes_per_s", rates[1].into()),
                    spread("bytes_in_a_second", "in each second", &self.seconds),
                ]
            }
        }
    }
}

/// A measurement: as text for people, as JSON for programs.
#[derive(Clone, Debug)]
pub struct MeterReport(Vec<Figure>);

/// A row of a report.
#[derive(Clone, Debug)]
enum Figure {
    /// What people alone read, above all that is spread.
    Line(Option<String>),
    /// What programs alone read.
    Plain(&'static str, Value),
    /// A quantity with its title for people; `None` if nothing was measured.
    Spread(&'static str, &'static str, Option<Distribution>),
}

impl MeterReport {
    /// Lines of at most 80 characters.
    pub fn text(&self, detail: Detail) -> String {
        let mut text = String::new();
        for figure in &self.0 {
            if let Line(Some(line)) = figure {
                text += line;
                text.push('\n');
            }
        }
        for figure in &self.0 {
            if let Spread(_, title, Some(summary)) = figure {
                summary.write(title, detail, &mut text);
            }
        }
        text
    }
}

impl Serialize for MeterReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for figure in &self.0 {
            match figure {
                Line(_) => {}
                Plain(name, value) => map.serialize_entry(name, value)?,
                Spread(name, _, summary) => map.serialize_entry(name, summary)?,
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF: Of = Of {
        robot: 1,
        service: "hero_telemetry",
        relayed: None,
    };

    /// Sample `sequence` of publisher `epoch_ns`, sent at so many ms.
    fn sample(epoch_ns: u64, sequence: u64, sent_ms: u64) -> Stamps {
        Stamps {
            epoch_ns,
            sequence,
            sent: at(sent_ms),
            received: None,
            published: None,
            from_dsp: None,
            dsp: None,
        }
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// Text for people and object for programs.
    fn shown(report: &MeterReport) -> (String, Value) {
        let text = report.text(Detail::Figures);
        (text, serde_json::to_value(report).unwrap())
    }

    fn measured(
        quantity: Quantity,
        samples: impl IntoIterator<Item = (Stamps, u64)>,
    ) -> (String, Value) {
        let mut meter = Meter::new(quantity, 272);
        for (stamps, came_ms) in samples {
            meter.take(&stamps, at(came_ms));
        }
        assert!(meter.window.offsets_ns.capacity() <= MAX_WINDOW_SAMPLES);
        shown(&meter.report(OF, Losses::default()))
    }

    fn rate(samples: &[(Stamps, u64)]) -> (String, Value) {
        measured(Quantity::Rate, samples.iter().copied())
    }

    #[test]
    fn one_sample_is_no_rate() {
        let (text, json) = rate(&[(sample(1, 1, 0), 5)]);
        assert_eq!(json["samples"], 1);
        assert!(json["observed_hz"].is_null() && json["published_hz"].is_null());
        assert!(text.contains("observed -, published -"), "{text}");
    }

    #[test]
    fn losses_lower_the_observed_rate_and_not_the_published_one() {
        let every_other: Vec<_> = (0..=50)
            .map(|n| (sample(1, 1 + 2 * n, 40 * n), 3 + 40 * n))
            .collect();
        let (_, json) = rate(&every_other);
        assert_eq!(json["observed_hz"], 25.0);
        assert_eq!(json["published_hz"], 50.0);
        let without_a_gap = &json["published_interval_ms"];
        assert!(without_a_gap.is_null(), "{without_a_gap}");
        assert_eq!(json["interval_ms"]["count"], 50);
    }

    #[test]
    fn samples_that_come_together_are_published_evenly_all_the_same() {
        let (_, json) = rate(&[
            (sample(1, 1, 0), 0),
            (sample(1, 2, 20), 60),
            (sample(1, 3, 40), 60),
            (sample(1, 4, 60), 60),
        ]);
        assert_eq!(json["observed_hz"], 50.0);
        assert_eq!(json["published_hz"], 50.0);
        assert_eq!(json["interval_ms"]["min"], 0.0);
        let longest = &json["published_interval_ms"]["max"];
        assert!((longest.as_f64().unwrap() - 20.0).abs() < 0.02);
    }

    #[test]
    fn the_pause_between_two_publishers_is_not_in_the_published_rate() {
        let (_, json) = rate(&[
            (sample(1, 7, 0), 0),
            (sample(1, 8, 20), 20),
            (sample(2, 1, 1000), 1000),
            (sample(2, 2, 1020), 1020),
        ]);
        assert_eq!(json["published_hz"], 50.0);
        assert_eq!(json["published_interval_ms"]["count"], 2);
    }

    #[test]
    fn programs_get_one_object() {
        let losses = Losses {
            received: 3,
            lost: 1,
            ..Losses::default()
        };
        let mut meter = Meter::new(Quantity::Rate, 0);
        meter.take(&sample(1, 1, 0), at(0));
        meter.take(&sample(1, 2, 20), at(20));
        let (_, json) = shown(&meter.report(OF, losses));
        assert_eq!(json["schema"], "ril.Rate.v1");
        assert_eq!(json["service"], "hero_telemetry");
        assert_eq!(
            (&json["lost"], &json["lost_percent"]),
            (&1.into(), &25.0.into())
        );
        assert_eq!(json["observed_hz"], 50.0);
        assert_eq!(json["interval_ms"]["count"], 1);
        assert_eq!(json["interval_ms"]["histogram"][0]["count"], 1);
        assert_eq!(json["seconds"], 0.02);
    }

    #[test]
    fn absurd_stamps_do_not_overflow() {
        let (_, json) = rate(&[
            (sample(1, u64::MAX, 10), 10),
            (sample(1, 0, 0), 0),
            (sample(1, u64::MAX, 10), 10),
            (sample(1, 0, 0), 0),
            (sample(1, u64::MAX, 10), 10),
        ]);
        assert!(json["published_hz"].is_number());
    }

    /// A sample of the DSP's time `dsp_ms` after the boot number `boots`.
    fn timed(boots: u32, dsp_ms: u64) -> Stamps {
        Stamps {
            dsp: Some(DspClock {
                since_boot_ns: dsp_ms * 1_000_000,
                boots,
            }),
            ..sample(1, 1, 0)
        }
    }

    fn age(samples: impl IntoIterator<Item = (Stamps, u64)>) -> Value {
        measured(Quantity::Age, samples).1
    }

    /// Whether `value` is right within the thousandth that a histogram keeps.
    fn about(value: &Value, expected: f64) -> bool {
        (value.as_f64().unwrap() - expected).abs() <= expected * 1e-3
    }

    #[test]
    fn each_age_is_from_its_own_time_and_missing_ones_are_nothing() {
        let both = Stamps {
            received: Some(at(100)),
            published: Some(at(103)),
            from_dsp: None,
            ..sample(1, 1, 0)
        };
        let report = age([(both, 104)]);
        assert!(about(&report["since_received_ms"]["p50"], 4.0));
        assert!(about(&report["since_published_ms"]["p50"], 1.0));
        assert!(report["behind_quickest_ms"].is_null());
        let report = age([(timed(0, 0), 1)]);
        assert!(report["since_received_ms"].is_null());
        assert!(report["since_published_ms"].is_null());
    }

    #[test]
    fn the_quickest_sample_is_the_measure_wherever_it_comes() {
        let lags = [5, 7, 0, 2, 9];
        let samples = (0..)
            .zip(lags)
            .map(|(n, lag)| (timed(0, 20 * n), 777 + 20 * n + lag));
        let summary = &age(samples)["behind_quickest_ms"];
        assert_eq!(
            (&summary["count"], &summary["min"]),
            (&5.into(), &0.0.into())
        );
        assert!(
            about(&summary["p50"], 5.0) && about(&summary["max"], 9.0),
            "{summary:?}"
        );
    }

    #[test]
    fn a_dsp_that_boots_has_another_clock() {
        let rebooted = [(timed(0, 5000), 5000), (timed(1, 10), 6000)];
        // Boots that were not counted show in the clock itself.
        let unseen = [(timed(0, 5000), 5000), (timed(0, 10), 6000)];
        for samples in [rebooted, unseen] {
            let summary = &age(samples)["behind_quickest_ms"];
            assert_eq!(
                (&summary["count"], &summary["max"]),
                (&2.into(), &0.0.into())
            );
        }
    }

    #[test]
    fn clocks_that_drift_apart_are_compared_for_ten_seconds_only() {
        // A hundred seconds, in which the DSP's clock loses 100 ms.
        let samples = (0..1000).map(|n| (timed(0, n * 100 - n / 10), n * 100));
        let summary = &age(samples)["behind_quickest_ms"];
        assert_eq!(summary["count"], 1000);
        assert!(summary["max"].as_f64().unwrap() <= 10.1, "{summary:?}");
    }

    #[test]
    fn a_flood_is_compared_in_shorter_parts() {
        let count = 3 * MAX_WINDOW_SAMPLES as u64 + 1;
        let report = age((0..count).map(|n| (timed(0, n / 10), n / 10)));
        assert_eq!(report["behind_quickest_ms"]["count"], count);
    }

    #[test]
    fn times_to_come_and_absurd_ones_do_no_harm() {
        let odd = Stamps {
            received: Some(MonotonicNs(u64::MAX)),
            published: Some(MonotonicNs(0)),
            from_dsp: None,
            dsp: Some(DspClock {
                since_boot_ns: u64::MAX,
                boots: u32::MAX,
            }),
            ..sample(1, 1, 0)
        };
        let report = age([(odd, 1), (timed(u32::MAX, 0), 2), (odd, 3)]);
        assert_eq!(report["since_received_ms"]["max"], 0.0);
        assert!(report["behind_quickest_ms"].is_object());
    }

    #[test]
    fn ages_of_another_machine_are_as_true_as_the_comparison_of_clocks() {
        let report = |relayed| {
            let of = Of { relayed, ..OF };
            shown(&Meter::new(Quantity::Age, 0).report(of, Losses::default()))
        };
        let relayed = |uncertainty_s| {
            report(Some(Relayed {
                uncertainty_s,
                air: None,
            }))
        };
        let (text, json) = relayed(Some(0.0025));
        assert_eq!(json["relayed"], true);
        assert_eq!(json["age_uncertainty_ms"], 2.5);
        assert!(text.contains("ages are true within ±2.500 ms\n"), "{text}");
        let (text, json) = relayed(None);
        assert_eq!(json["relayed"], true);
        assert!(json["age_uncertainty_ms"].is_null());
        let unknown = "how true the ages are is not known";
        assert!(text.contains(unknown), "{text}");
        let (text, json) = report(Some(Relayed {
            uncertainty_s: None,
            air: Some((95, 5)),
        }));
        assert_eq!(
            (&json["lost_on_air"], &json["lost"]),
            (&5.into(), &0.into())
        );
        assert_eq!(json["lost_on_air_percent"], 5.0);
        let expected = "on the air 5 of 100 samples of all topics lost (5.00 %)\n";
        assert!(text.contains(expected), "{text}");
        let (text, json) = report(None);
        assert!(json["lost_on_air"].is_null());
        assert_eq!(json["relayed"], false);
        assert!(json["age_uncertainty_ms"].is_null());
        assert!(!text.contains("relayed"), "{text}");
    }

    #[test]
    fn text_and_json_say_the_same() {
        let samples = [(timed(0, 0), 0), (timed(0, 20), 23)];
        let (text, json) = measured(Quantity::Age, samples);
        assert!(text.contains("DSP's clock to here"), "{text}");
        assert_eq!(json["schema"], "ril.Delay.v3");
        assert!(json["since_received_ms"].is_null());
        assert_eq!(json["behind_quickest_ms"]["count"], 2);
    }

    fn bandwidth(came_ms: impl IntoIterator<Item = u64>) -> (String, Value) {
        let samples = (1..).zip(came_ms);
        measured(
            Quantity::Bandwidth,
            samples.map(|(index, ms)| (sample(1, index, ms), ms)),
        )
    }

    #[test]
    fn bytes_are_samples_times_their_size() {
        let (text, json) = bandwidth((0..=100).map(|n| 20 * n));
        assert_eq!(json["payload_bytes"], 272);
        assert_eq!(json["bytes"], 101 * 272);
        assert_eq!(json["observed_bytes_per_s"], 50.0 * 272.0);
        assert_eq!(json["published_bytes_per_s"], 50.0 * 272.0);
        assert!(text.contains("13.60 kB/s"), "{text}");
    }

    #[test]
    fn only_whole_seconds_are_counted_and_the_empty_ones_too() {
        let (_, json) = bandwidth([0, 500, 999]);
        assert!(json["bytes_in_a_second"].is_null());
        let (_, json) = bandwidth([0, 500, 999, 4000, 4500, 5000]);
        let seconds = &json["bytes_in_a_second"];
        // Three samples, nothing for three seconds, two samples; the sixth second has just begun.
        assert_eq!(seconds["count"], 5);
        assert_eq!(
            (&seconds["min"], &seconds["max"]),
            (&0.0.into(), &816.0.into())
        );
        assert_eq!(seconds["p50"], 0.0);
    }
}
