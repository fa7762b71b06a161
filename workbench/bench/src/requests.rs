//! A secure request and its answer: through the bridge to the DSP and back, and over iceoryx2 alone.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use iceoryx2::port::client::Client as RawClient;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server as RawServer;
use iceoryx2::prelude::ipc;
use ipc_types::code::{ControlCommand, MovementKind, Stage};
use ipc_types::payload::{DspTelemetry, ModuleControl, MovementData, RequestReport};
use ipc_types::{Client, MonotonicNs, Request, SchedulingRole, fresh_request_id, request_slice};
use runtime::signal::Termination;

use crate::pace::{Pace, sleep_until};
use crate::peers::{TIMEOUT, iceoryx2 as raw, join};

/// Rounds at the beginning that do not count.
const WARM_UP: usize = 20;

/// Orders `count` landings at `rate_hz`, or as fast as they are carried out. Of each, the time from the request to the
/// report that the DSP has acknowledged it, ns.
pub fn land(count: usize, rate_hz: u32, ready: impl FnOnce() -> Result<()>) -> Result<Vec<u64>> {
    let ipc = join("bench-client")?;
    request_slice(SchedulingRole::Consumer);
    let mut control = ipc.client::<ModuleControl>()?;
    let mut movement = ipc.client::<MovementData>()?;
    let mut telemetry = ipc.subscriber::<DspTelemetry>()?;
    ready()?;
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
        let request = MovementData {
            request_id: fresh_request_id(),
            kind: MovementKind::Land.code(),
            ..MovementData::default()
        };
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
        let request = ModuleControl {
            request_id: fresh_request_id(),
            command: ControlCommand::Start.code(),
            ..ModuleControl::default()
        };
        control.send(&request)?;
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

/// The ends of a request service of iceoryx2, woken by its events.
struct Ends {
    listener: Listener<ipc::Service>,
    notifier: Notifier<ipc::Service>,
}

const SERVICE: &str = "bench-request";

/// Answers every request at once, until `termination`.
pub fn serve_raw(termination: &Termination, ready: impl FnOnce() -> Result<()>) -> Result<()> {
    let node = raw::node()?;
    let service = node
        .service_builder(&SERVICE.try_into()?)
        .request_response::<MovementData, RequestReport>()
        .open_or_create()?;
    let server: RawServer<_, _, (), _, ()> = service.server_builder().create()?;
    let ends = Ends {
        listener: raw::listener(&node, "bench-requests")?,
        notifier: raw::notifier(&node, "bench-responses")?,
    };
    ready()?;
    while !termination.requested() {
        // Short, so that the end is noticed.
        ends.listener
            .timed_wait(|_| {}, Duration::from_millis(100))?;
        while let Some(request) = server.receive()? {
            let report = RequestReport {
                request_id: request.request_id,
                ..RequestReport::new(Stage::Done, ipc_types::code::Reason::None)
            };
            request.send_copy(report)?;
            ends.notifier.notify()?;
        }
    }
    Ok(())
}

/// Sends `count` requests at `rate_hz`. Of each, the time to its answer, ns.
pub fn ask_raw(count: usize, rate_hz: u32, ready: impl FnOnce() -> Result<()>) -> Result<Vec<u64>> {
    let node = raw::node()?;
    let service = node
        .service_builder(&SERVICE.try_into()?)
        .request_response::<MovementData, RequestReport>()
        .open_or_create()?;
    let client: RawClient<_, _, (), _, ()> = service.client_builder().create()?;
    let ends = Ends {
        listener: raw::listener(&node, "bench-responses")?,
        notifier: raw::notifier(&node, "bench-requests")?,
    };
    ready()?;
    let mut pace = Pace::new(rate_hz);
    let mut times = Vec::with_capacity(count);
    for round in 0..WARM_UP + count {
        pace.wait()?;
        let request = MovementData {
            request_id: round as u64 + 1,
            kind: MovementKind::Land.code(),
            ..MovementData::default()
        };
        let begin = MonotonicNs::now();
        let pending = client.loan_uninit()?.write_payload(request).send()?;
        ends.notifier.notify()?;
        while pending.receive()?.is_none() {
            ends.listener.timed_wait(|_| {}, TIMEOUT)?;
        }
        if round >= WARM_UP {
            times.push(MonotonicNs::now().0 - begin.0);
        }
    }
    Ok(times)
}
