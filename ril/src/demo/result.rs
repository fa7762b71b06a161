//! What the demonstration prints at its end.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use super::flight::Flight;
use super::verdict::Check;

/// What stays when the demonstration is over.
#[derive(Clone, Copy)]
pub(super) struct Kept<'a> {
    /// The folder that the operator chose.
    pub folder: &'a Path,
    /// The log of the flight in it.
    pub log: Option<&'a Path>,
    /// The record of the flight in it.
    pub record: Option<&'a Path>,
}

/// The demonstration's result as JSON.
#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    passed: bool,
    flight_s: f64,
    telemetry_age_ms_p50: Option<f64>,
    telemetry_age_ms_p99: Option<f64>,
    checks: &'a [Check],
    log: Option<&'a Path>,
    record: Option<&'a Path>,
    folder: Option<&'a Path>,
}

/// Prints the result on standard output: in lines for people, or as one JSON object.
pub(super) fn tell(
    flight: &Flight,
    checks: &[Check],
    kept: Option<Kept<'_>>,
    json: bool,
) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let passed = checks.iter().all(|check| check.passed);
    let age_ms = |percent| flight.watch.age_us(percent).map(|us| f64::from(us) / 1e3);
    if json {
        let report = Report {
            schema: "ril.Demo.v1",
            passed,
            flight_s: flight.took.as_secs_f64(),
            telemetry_age_ms_p50: age_ms(50),
            telemetry_age_ms_p99: age_ms(99),
            checks,
            log: kept.and_then(|kept| kept.log),
            record: kept.and_then(|kept| kept.record),
            folder: kept.map(|kept| kept.folder),
        };
        serde_json::to_writer(&mut out, &report)?;
        return writeln!(out);
    }
    writeln!(out)?;
    for check in checks {
        let mark = if check.passed { "ok    " } else { "FAILED" };
        writeln!(out, "{mark} {:33} {}", check.name, check.detail)?;
    }
    writeln!(out)?;
    writeln!(out, "flight    {:.1} s", flight.took.as_secs_f64())?;
    if let (Some(p50), Some(p99)) = (age_ms(50), age_ms(99)) {
        writeln!(
            out,
            "age       {p50:.3} ms median, {p99:.3} ms 99th percentile: serial byte to this consumer"
        )?;
    }
    let log = kept.and_then(|kept| kept.log);
    let record = kept.and_then(|kept| kept.record);
    for (title, file) in [("log", log), ("record", record)] {
        match file {
            Some(file) => writeln!(out, "{title:9} {}", file.display())?,
            None => writeln!(out, "{title:9} removed; --folder FOLDER keeps it")?,
        }
    }
    writeln!(
        out,
        "{}",
        if passed {
            "all checks passed"
        } else {
            "not all checks passed"
        }
    )
}
