//! The operator's verbs before and after a flight, with the real processes: `ril preflight`, `wait` and `log`;
//! on a terminal of 80 × 24, piped, with `--json`, without a bridge and with a dead link.

mod logs;
mod preflight;
mod station;
mod waiting;
