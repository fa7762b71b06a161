//! What was true when, and whether what a consumer, a station, a page or a record says agrees with that.

use dsp_sim::helicopter::Helicopter;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::life::{MS, TICK_MS};

/// How far the GPS of the simulator may err, and a waypoint of the wire, m.
const GPS_ERROR_M: f64 = 6.0;

/// For so long the bridge may keep a sample, until what follows shows what it means.
const HELD_MS: u64 = 100;

/// For so long what the line brings may wait for a bridge that stands still.
const WAITED_MS: u64 = 3_000;

/// Metres of a degree of latitude.
const DEGREE_M: f64 = 111_320.0;

/// What a robot published of a sample, and when.
#[derive(Clone, Copy)]
struct Published {
    raw: DspTelemetry,
    true_ms: u64,
}

/// What was true of one robot.
#[derive(Default)]
pub struct Truth {
    /// When, the latitude, and the altitude, one for each step.
    places: Vec<(u64, f64, f64)>,
    published: Vec<Published>,
    /// Until when samples may have damaged values, which the sum of a classic frame does not see.
    pub noisy_until: u64,
    heroes: Vec<HeroTelemetry>,
    /// Until when the machine was suspended last, and for how long.
    slept: (u64, u64),
    /// From when until when nothing came to the bridge last: it stood still, it slept, or the line was silent.
    cut_off: (u64, u64),
}

impl Truth {
    pub fn note(&mut self, now_ms: u64, helicopter: &Helicopter) {
        let at = helicopter.position();
        self.places.push((now_ms, at.latitude_deg, at.altitude_m));
    }

    pub fn sleeps(&mut self, now_ms: u64, until_ms: u64) {
        self.slept = (until_ms, until_ms.saturating_sub(now_ms));
    }

    /// Nothing comes to the bridge.
    pub fn is_cut_off(&mut self, now_ms: u64, until_ms: u64) {
        let (from, until) = self.cut_off;
        self.cut_off = match now_ms <= until {
            true => (from, until.max(until_ms)),
            false => (now_ms, until_ms),
        };
    }

    /// The bridge publishes a sample, when its machine's clock shows `host`.
    ///
    /// # Errors
    /// It says that it was received when it cannot have been.
    pub fn published(&mut self, raw: &DspTelemetry, host: MonotonicNs) -> Result<(), String> {
        let now_ms = self.places.last().map_or(0, |(at, ..)| *at);
        let held_ms = (host.0 / MS).saturating_sub(raw.received_ns / MS);
        let true_ms = now_ms - held_ms.min(now_ms);
        self.published.push(Published { raw: *raw, true_ms });
        let is_noisy = true_ms <= self.noisy_until;
        // It may have had the sample already when nothing followed.
        let (from, until) = self.cut_off;
        let kept_ms = HELD_MS + if true_ms < until { until - from } else { 0 };
        match raw.received_ns > host.0 || held_ms > kept_ms && !is_noisy {
            true => Err(format!("a sample is {held_ms} ms old when it is published")),
            false => Ok(()),
        }
    }

    /// Status publishes a sample.
    ///
    /// # Errors
    /// It is not what the bridge published, or says a wrong moment.
    pub fn read(&mut self, hero: &HeroTelemetry) -> Result<(), String> {
        self.heroes.push(*hero);
        let number = hero.source_sequence;
        let Some(Published { raw, .. }) = self.published.get(number as usize - 1) else {
            return Err(format!(
                "status has a sample that nobody published: {number}"
            ));
        };
        if hero.received_ns != raw.received_ns {
            let text = "says another moment of its reception";
            return Err(format!("sample {number} of status {text}"));
        }
        let is_timed = hero.valid(TelemetryGroup::Time) && raw.valid(TelemetryGroup::Time);
        if is_timed && (hero.dsp_time_s - f64::from(raw.dsp_time_ms) / 1e3).abs() > 1e-6 {
            return Err(format!(
                "sample {number} of status has values of another one"
            ));
        }
        Ok(())
    }

    /// The sample with this number.
    pub fn hero(&self, sequence: u64) -> Option<&HeroTelemetry> {
        self.heroes.get((sequence as usize).wrapping_sub(1))
    }

    /// A consumer on another machine has this sample, and says that it was received `claimed_ms` ago, give or take
    /// `within_ms`. The robot's clock shows `host`: ages do not count for how long its machine was suspended.
    ///
    /// # Errors
    /// It is another one, or younger or older.
    pub fn judge_age(
        &self,
        hero: &HeroTelemetry,
        host: MonotonicNs,
        (claimed_ms, within_ms): (f64, f64),
    ) -> Result<(), String> {
        let number = hero.sequence;
        let Some(own) = self.hero(number) else {
            return Err(format!("a sample that no robot published: {number}"));
        };
        let same = HeroTelemetry {
            received_ns: hero.received_ns,
            sent_ns: hero.sent_ns,
            published_ns: hero.published_ns,
            ..*own
        };
        if same != *hero {
            return Err(format!("sample {number} is not what its robot published"));
        }
        let true_ms = self.published[own.source_sequence as usize - 1].true_ms;
        let age_ms = before_ms(own.received_ns, host);
        let slack_ms = within_ms + TICK_MS as f64 + 1.0;
        if claimed_ms + slack_ms < age_ms {
            return Err(format!(
                "sample {number} is {age_ms} ms old, and said to be {claimed_ms:.1} ± {within_ms:.1} ms"
            ));
        }
        if claimed_ms > age_ms + slack_ms {
            return Err(format!(
                "sample {number} is {age_ms} ms old, and said to be older: {claimed_ms:.1} ± {within_ms:.1} ms"
            ));
        }
        self.judge_place(hero, true_ms)
    }

    /// A station on the robot's own network shows this latitude.
    ///
    /// # Errors
    /// The helicopter was not there of late.
    pub fn judge_latitude(&self, latitude_deg: f64, now_ms: u64) -> Result<(), String> {
        let is_near = |(_, latitude, _): &(u64, f64, f64)| {
            (latitude - latitude_deg).abs() * DEGREE_M < GPS_ERROR_M
        };
        let from = self.places.len().saturating_sub(600);
        let is_true = now_ms <= self.noisy_until + 3_000 || self.places[from..].iter().any(is_near);
        match is_true {
            true => Ok(()),
            false => Err(format!(
                "a station is shown {latitude_deg}, where nobody was"
            )),
        }
    }

    /// A page shows a place of `then_ms` by the robot's clock, and says that it is `claimed_ms` old at most.
    ///
    /// # Errors
    /// No sample of then has that place, or it is older.
    pub fn judge_drawn(
        &self,
        then_ms: u64,
        place: Option<[f64; 2]>,
        claimed_ms: f64,
        host: MonotonicNs,
    ) -> Result<(), String> {
        let mut heroes = self.heroes.iter().rev();
        let Some(hero) = heroes.find(|hero| (hero.received_ns / MS).abs_diff(then_ms) <= 1) else {
            return Err(format!(
                "a page shows what is of {then_ms} ms, and no sample is"
            ));
        };
        let own = [hero.geodetic.latitude_rad, hero.geodetic.longitude_rad].map(f64::to_degrees);
        if place.is_some_and(|place| (0..2).any(|at| (place[at] - own[at]).abs() > 1e-7)) {
            return Err(format!("a page shows {place:?}, and it was at {own:?}"));
        }
        let age_ms = before_ms(hero.received_ns, host);
        match claimed_ms + TICK_MS as f64 + 1.0 < age_ms {
            true => Err(format!(
                "a page shows what is {age_ms} ms old as {claimed_ms:.1} ms old at most"
            )),
            false => Ok(()),
        }
    }

    /// The place in a sample is where the helicopter was when the line brought it.
    fn judge_place(&self, hero: &HeroTelemetry, true_ms: u64) -> Result<(), String> {
        if !hero.valid(TelemetryGroup::Geographic) || true_ms <= self.noisy_until {
            return Ok(());
        }
        let latitude_deg = hero.geodetic.latitude_rad.to_degrees();
        // What the line brings has waited for a bridge that stood still, and for a machine that slept.
        let until = self.places.partition_point(|(at, ..)| *at <= true_ms);
        let (awake_ms, slept_ms) = self.slept;
        let is_of_then = (awake_ms..awake_ms + WAITED_MS).contains(&true_ms);
        let waited_ms = WAITED_MS + if is_of_then { slept_ms } else { 0 };
        let from = until.saturating_sub((waited_ms / TICK_MS) as usize);
        let is_near = self.places[from..until]
            .iter()
            .any(|(_, latitude, altitude_m)| {
                let north_m = (latitude - latitude_deg).abs() * DEGREE_M;
                north_m < GPS_ERROR_M && (altitude_m - hero.geodetic.altitude_m).abs() < GPS_ERROR_M
            });
        match is_near {
            true => Ok(()),
            false => Err(format!(
                "sample {} has a place where the helicopter was not",
                hero.sequence
            )),
        }
    }
}

/// By how many ms `at` lies before `now`.
pub fn before_ms(at: u64, now: MonotonicNs) -> f64 {
    (now.0 as f64 - at as f64) / MS as f64
}
