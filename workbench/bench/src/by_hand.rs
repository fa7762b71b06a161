//! Bridge and status as a user writes them by hand on plain iceoryx2: with the terminal, the decoder and the DSP of the
//! rest, and nothing else. It is what no bridge can do without.
//!
//! This is no bridge: it checks nothing, repeats nothing, logs nothing, survives no death, and a client can order one
//! landing after the other. Its processes wake one another by iceoryx2's default event.

use std::fs::File;
use std::os::fd::{AsFd, BorrowedFd};

use anyhow::Result;
use dsp_protocol::{Command, Decoded, Decoder, Downlink, Status, Uplink, port};
use iceoryx2::port::server::Server;
use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::{Errno, read, write};

use crate::consumer::{Indexed, raw_terminal};
use crate::harness::report_ready;
use crate::measured::Arrival;
use crate::peers::iceoryx2 as raw;
use crate::requests::{REQUESTS, RESPONSES, SERVICE};

/// What the bridge publishes; the events have the same name.
const TELEMETRY: &str = "bench-dsp";

/// Publishes what the DSP at the terminal `dsp` reports and orders landings of it, until it is asked to end.
pub fn bridge(end: &Termination) -> Result<()> {
    let terminal = raw_terminal("dsp".as_ref())?;
    let node = raw::node()?;
    let mut publish = raw::publisher::<DspTelemetry>(&node, TELEMETRY, true)?;
    let service = raw::requests(&node, SERVICE)?;
    let server: Server<_, _, (), _, ()> = service.server_builder().create()?;
    let listener = raw::listener(&node, REQUESTS)?;
    let notifier = raw::notifier(&node, RESPONSES)?;
    let (mut decoder, mut bytes, mut open) = (Decoder::new(), [0; 4096], None);
    report_ready()?;
    while !end.requested() {
        let sources = [terminal.as_fd(), raw::descriptor(&listener), end.as_fd()];
        let [has_bytes, has_request, _] = wait(sources)?;
        if has_bytes {
            let count = read(&terminal, &mut bytes)?;
            let received_ns = MonotonicNs::now().0;
            let mut rest = &bytes[..count];
            loop {
                let (taken, decoded) = decoder.decode(rest);
                rest = &rest[taken..];
                let stage = match decoded {
                    Decoded::Incomplete => break,
                    Decoded::Message(Downlink::Status(status)) => {
                        publish(&telemetry(&status, received_ns))?;
                        continue;
                    }
                    Decoded::Message(Downlink::Ack { .. }) => {
                        order(&terminal, Command::Read16 { port: port::LAND })?;
                        Stage::Progress
                    }
                    Decoded::Message(Downlink::Ack16 { .. }) => Stage::Done,
                    Decoded::Message(_) | Decoded::Rejected(_) => continue,
                };
                if let Some(request) = &open {
                    raw::answer(request, stage)?;
                    notifier.notify()?;
                }
            }
        }
        if has_request {
            listener.try_wait(|_| {})?;
            while let Some(request) = server.receive()? {
                let (port, value) = (port::LAND, 1);
                order(&terminal, Command::Write16 { port, value })?;
                raw::answer(&request, Stage::Accepted)?;
                notifier.notify()?;
                open = Some(request);
            }
        }
    }
    Ok(())
}

/// Waits until one can be read; says which can.
fn wait<const N: usize>(sources: [BorrowedFd<'_>; N]) -> Result<[bool; N]> {
    let mut sources = sources.map(|one| PollFd::from_borrowed_fd(one, PollFlags::IN));
    match poll(&mut sources, None) {
        Ok(_) | Err(Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    Ok(sources.map(|one| !one.revents().is_empty()))
}

fn order(terminal: &File, command: Command) -> Result<()> {
    write(terminal, Uplink::Command(command).encode().as_bytes())?;
    Ok(())
}

fn telemetry(status: &Status, received_ns: u64) -> DspTelemetry {
    let mut telemetry = DspTelemetry {
        received_ns,
        dsp_time_ms: status.time_ms.unwrap_or_default(),
        valid_groups: status.mask().0,
        flying: status.flying.into(),
        ..DspTelemetry::default()
    };
    if let Some(position) = status.geographic {
        telemetry.geographic.latitude_deg = position.latitude_deg;
        telemetry.geographic.longitude_deg = position.longitude_deg;
        telemetry.geographic.altitude_m = position.altitude_m;
    }
    telemetry
}

/// Publishes what the bridge reports, converted, until it is asked to end.
pub fn status(end: &Termination) -> Result<()> {
    let node = raw::node()?;
    let mut publish = raw::publisher::<HeroTelemetry>(&node, raw::SERVICE, true)?;
    receive(&node, TELEMETRY, end, |dsp: &DspTelemetry| {
        let mut hero = HeroTelemetry {
            received_ns: dsp.received_ns,
            published_ns: MonotonicNs::now().0,
            valid_groups: dsp.valid_groups.into(),
            flying: dsp.flying.into(),
            dsp_time_s: f64::from(dsp.dsp_time_ms) / 1000.0,
            ..HeroTelemetry::default()
        };
        hero.geodetic.latitude_rad = dsp.geographic.latitude_deg.to_radians();
        hero.geodetic.longitude_rad = dsp.geographic.longitude_deg.to_radians();
        hero.geodetic.altitude_m = dsp.geographic.altitude_m;
        publish(&hero).map(|()| true)
    })
}

/// Reads `count` samples of status, or until it is asked to end.
pub fn consume(count: usize, end: &Termination) -> Result<Vec<Arrival>> {
    let mut arrivals = Vec::new();
    receive(&raw::node()?, raw::SERVICE, end, |hero: &HeroTelemetry| {
        arrivals.push(hero.arrival());
        Ok(arrivals.len() < count)
    })?;
    Ok(arrivals)
}

/// Hands on what comes of a service while `take` says that more is wanted.
fn receive<T: raw::Sample>(
    node: &raw::Node,
    name: &str,
    end: &Termination,
    mut take: impl FnMut(&T) -> Result<bool>,
) -> Result<()> {
    let subscriber = raw::subscriber::<T>(node, name)?;
    let listener = raw::listener(node, name)?;
    report_ready()?;
    while !end.requested() {
        wait([raw::descriptor(&listener), end.as_fd()])?;
        listener.try_wait(|_| {})?;
        while let Some(sample) = subscriber.receive()? {
            if !take(&sample)? {
                return Ok(());
            }
        }
    }
    Ok(())
}
