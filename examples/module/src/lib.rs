//! Watches the flight battery, and commands a landing when its cells stay below a limit.

use std::ops::RangeInclusive;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{HeroTelemetry, MovementData, RequestReport};
use ipc_types::{Client, Ipc, MonotonicNs, OpenError, Publisher, Subscriber, TelemetryGroup};
use ipc_types::{fresh_request_id, module, request, shared_struct, topic};
use module_kit::{Manager, OnStop, Requests, Sources, Work, ranged};

module!(BatteryWatch, "battery_watch", 1001);

/// What the module is doing, in its state: it has commanded a landing that is not over.
pub const LANDING: u32 = 1;
/// Error in the state: nobody took the order to land, or the landing ended early.
pub const NOT_LANDED: u32 = 1001;

shared_struct! {
    /// The cells of the flight battery.
    pub struct Cells("battery_watch.Cells.v1") = 40 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns.
        pub epoch_ns: u64,
        /// When the bridge read the telemetry that this was made of, host monotonic ns.
        pub received_ns: u64,
        /// Mean voltage of a cell, under load.
        pub mean_v: f32,
        /// A landing is commanded below it.
        pub limit_v: f32,
        /// For how long the mean has been below the limit in flight.
        pub below_s: f32,
        /// Number of cells in series.
        pub cells: u32,
    }
}
topic!(Cells, "battery_watch/cells");

shared_struct! {
    /// Sets the limit.
    pub struct SetLimit("battery_watch.SetLimit.v1") = 16 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// Mean voltage of a cell below which a landing is commanded, 2.5 to 4.2.
        pub limit_v: f64,
    }
}
request!(SetLimit, "battery_watch/limits");

/// Limits that can be set, V.
const LIMITS_V: RangeInclusive<f64> = 2.5..=4.2;

ranged! {
    fn limit_v(f64) in LIMITS_V;
    fn below_for_s(f64) in 0.0..=60.0;
    fn cells(u32) in 1..=24;
}

/// `battery_watch.toml`
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    #[serde(deserialize_with = "limit_v")]
    limit_v: f64,
    /// For how long the cells are below the limit before a landing is commanded.
    #[serde(deserialize_with = "below_for_s")]
    below_for_s: f64,
    #[serde(deserialize_with = "cells")]
    cells: u32,
}

impl Default for Config {
    fn default() -> Config {
        Config {
            limit_v: 3.5,
            below_for_s: 3.0,
            cells: 6,
        }
    }
}

/// Decides when the battery is too low. A test builds it without anything else.
struct Watch {
    config: Config,
    below_since: Option<MonotonicNs>,
    is_low: bool,
}

impl Watch {
    /// What is published for a sample; nothing when it does not say how the battery is.
    fn sample(&mut self, sample: &HeroTelemetry) -> Option<Cells> {
        if !sample.valid(TelemetryGroup::Supply) {
            return None;
        }
        let mean_v = sample.supply.battery_v / self.config.cells as f32;
        let is_below = sample.is_flying() && f64::from(mean_v) < self.config.limit_v;
        let now = sample.received();
        self.below_since = is_below.then(|| self.below_since.unwrap_or(now));
        let below_s = self
            .below_since
            .map_or(0.0, |since| now.since(since).as_secs_f64());
        self.is_low = is_below && below_s >= self.config.below_for_s;
        Some(Cells {
            received_ns: sample.received_ns,
            mean_v,
            limit_v: self.config.limit_v as f32,
            below_s: below_s as f32,
            cells: self.config.cells,
            ..Cells::default()
        })
    }
}

/// The module: its ports and its decision.
pub struct BatteryWatch {
    watch: Watch,
    telemetry: Subscriber<HeroTelemetry>,
    cells: Publisher<Cells>,
    limits: Requests<SetLimit>,
    movement: Client<MovementData>,
}

impl Work for BatteryWatch {
    type Config = Config;

    fn open(config: Config, ipc: &Ipc) -> Result<BatteryWatch, OpenError> {
        Ok(BatteryWatch {
            watch: Watch {
                config,
                below_since: None,
                is_low: false,
            },
            telemetry: ipc.subscriber()?,
            cells: ipc.publisher()?,
            limits: Requests::open(ipc)?,
            movement: ipc.client()?,
        })
    }

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.telemetry);
        sources.port(&mut self.cells);
        sources.port(self.limits.source());
        sources.port(&mut self.movement);
    }

    fn step(&mut self, now: MonotonicNs, manager: &mut Manager) {
        let BatteryWatch {
            watch,
            telemetry,
            cells,
            limits,
            movement,
        } = self;
        limits.serve(|request| {
            if !LIMITS_V.contains(&request.limit_v) {
                return RequestReport::new(Stage::Refused, Reason::OutOfRange);
            }
            watch.config.limit_v = request.limit_v;
            RequestReport::new(Stage::Done, Reason::None)
        });
        // A failure to receive or publish is over with the next call.
        let _ = telemetry.drain(|sample| {
            if let Some(sample) = watch.sample(sample) {
                let _ = cells.publish(|slot| *slot = sample);
            }
        });
        // Once for each start: whoever wants another landing watched starts the module again.
        if watch.is_low && manager.is_ready() {
            let land = MovementData::land(fresh_request_id()).preempting();
            match movement.send(&land) {
                Ok(_) => _ = manager.begin(now, LANDING, "landing", OnStop::Refused),
                Err(_) => manager.fail(now, NOT_LANDED),
            }
        }
        movement.drain(|report| match report.stage() {
            Some(Stage::Done) => manager.done(now),
            Some(stage) if stage.is_final() => manager.fail(now, NOT_LANDED),
            _ => {}
        });
    }
}
