//! A secure request and its answer: through the bridge to the DSP and back, and over iceoryx2 alone.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use iceoryx2::port::client::Client as RawClient;
use iceoryx2::port::server::Server as RawServer;
use ipc_types::code::{ControlCommand, Stage};
use ipc_types::payload::{DspTelemetry, ModuleControl, MovementData};
use ipc_types::{Client, MonotonicNs, Request, SchedulingRole, fresh_request_id, request_slice};
use runtime::signal::Termination;

use crate::harness::report_ready;
use crate::pace::{Pace, sleep_until};
use crate::peers::{TIMEOUT, iceoryx2 as raw, join};

/// Rounds at the beginning that do not count.
const WARM_UP: usize = 20;

/// Orders `count` landings at `rate_hz`, or as fast as they are carried out. Of each, the time from the request to the
/// report that the DSP has acknowledged it, ns.
pub fn land(count: usize, rate_hz: u32) -> Result<Vec<u64>> {
    let ipc = join("bench-client")?;
    request_slice(SchedulingRole::Consumer);
    let mut control = ipc.client::<ModuleControl>()?;
    let mut movement = ipc.client::<MovementData>()?;
    let mut telemetry = ipc.subscriber::<DspTelemetry>()?;
    report_ready()?;
    // Before the first sample the bridge knows no position, and refuses every movement.
    while telemetry.drain(|_| {})? == 0 {
        telemetry.wait(TIMEOUT)?;
    }
    drop(telemetry);
    start(&mut control)?;
    let mut pace = Pace::new(rate_hz);
    let mut times = Vec::with_capacity(count);
    for round in 0..WARM_UP + count {
        pace.wait()?;
        let request = MovementData::land(fresh_request_id());
        let begin = MonotonicNs::now();
        movement.send(&request)?;
        let begun = follow(&mut movement)?;
        if round >= WARM_UP {
            times.push(begun.0 - begin.0);
        }
    }
    Ok(times)
}

/// Starts the module. The bridge may still be getting to know the DSP, and refuses until it does.
fn start(control: &mut Client<ModuleControl>) -> Result<()> {
    let limit = MonotonicNs::now() + TIMEOUT;
    loop {
        control.send(&ModuleControl::new(
            fresh_request_id(),
            ControlCommand::Start,
        ))?;
        let mut is_done = false;
        while control.outstanding() > 0 {
            control.wait(TIMEOUT)?;
            control.drain(|report| is_done |= report.stage == Stage::Done.code());
        }
        if is_done {
            return Ok(());
        }
        let now = MonotonicNs::now();
        ensure!(now < limit, "the bridge does not start");
        sleep_until(now + Duration::from_millis(10))?;
    }
}

/// Follows the one open request to its end, and says when the report could be read that the DSP has acknowledged it.
fn follow<R: Request>(client: &mut Client<R>) -> Result<MonotonicNs> {
    let (mut begun, mut end) = (None, None);
    while client.outstanding() > 0 {
        client.wait(TIMEOUT)?;
        client.drain(|report| {
            if report.stage == Stage::Progress.code() {
                begun.get_or_insert_with(MonotonicNs::now);
            } else if report.is_final() {
                end = Some(*report);
            }
        });
    }
    let end = end.filter(|report| report.stage != Stage::Done.code());
    ensure!(end.is_none(), "ended early: {end:?}");
    begun.context("no report of its beginning")
}

/// The request service of iceoryx2, and the events that wake its ends.
pub const SERVICE: &str = "bench-request";
pub const REQUESTS: &str = "bench-requests";
pub const RESPONSES: &str = "bench-responses";

/// Answers every request at once, until it is asked to end.
pub fn serve_raw(end: &Termination) -> Result<()> {
    let node = raw::node()?;
    let service = raw::requests(&node, SERVICE)?;
    let server: RawServer<_, _, (), _, ()> = service.server_builder().create()?;
    let listener = raw::listener(&node, REQUESTS)?;
    let notifier = raw::notifier(&node, RESPONSES)?;
    report_ready()?;
    while !end.requested() {
        // Short, so that the end is noticed.
        listener.timed_wait(|_| {}, Duration::from_millis(100))?;
        while let Some(request) = server.receive()? {
            raw::answer(&request, Stage::Done)?;
            notifier.notify()?;
        }
    }
    Ok(())
}

/// Sends `count` requests at `rate_hz`, the next when the one before has ended. Of each, the time to the report of its
/// beginning, or, when there is none, to its end, ns.
pub fn ask_raw(count: usize, rate_hz: u32) -> Result<Vec<u64>> {
    let node = raw::node()?;
    let service = raw::requests(&node, SERVICE)?;
    let client: RawClient<_, _, (), _, ()> = service.client_builder().create()?;
    let listener = raw::listener(&node, RESPONSES)?;
    let notifier = raw::notifier(&node, REQUESTS)?;
    report_ready()?;
    let mut pace = Pace::new(rate_hz);
    let mut times = Vec::with_capacity(count);
    for round in 0..WARM_UP + count {
        pace.wait()?;
        let request = MovementData::land(round as u64 + 1);
        let begin = MonotonicNs::now();
        let pending = client.loan_uninit()?.write_payload(request).send()?;
        notifier.notify()?;
        let (mut begun, mut has_ended) = (None, false);
        while !has_ended {
            listener.timed_wait(|_| {}, TIMEOUT)?;
            while let Some(report) = pending.receive()? {
                has_ended = report.is_final();
                if has_ended || report.stage == Stage::Progress.code() {
                    begun.get_or_insert_with(MonotonicNs::now);
                }
            }
        }
        let begun = begun.context("it has ended")?;
        if round >= WARM_UP {
            times.push(begun.0 - begin.0);
        }
    }
    Ok(times)
}
