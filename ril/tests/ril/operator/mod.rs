//! The operator's verbs before and after a flight, with the real processes: `ril preflight`, `wait`, `robots`, `log` and `param`;
//! on a terminal of 80 × 24, piped, with `--json`, without a bridge, with two robots and with a dead link.

mod logs;
mod params;
mod preflight;
mod robots;
mod station;
mod waiting;
