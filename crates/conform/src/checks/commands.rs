//! Commands and acknowledgements: sections 4.3, 5.1, 8.1 and 8.2.

use std::time::Duration;

use dsp_protocol::{StatusMask, port};

use crate::bench::Bench;
use crate::check::{Check, StartPlace};
use crate::outcome::{Judged, ensure};
use crate::permitted::{Harmless, QuietPort16, QuietPort32, Raw};

const INVALID: u16 = 30;

/// A command of section 5.1, its name there, and the frame.
const COMMANDS: [(&str, &str, Harmless); 8] = [
    (
        "5.1-read-16",
        "read 16-bit port (`COMANDO_LECTURA_16_BITS`)",
        Harmless::read_16(port::STATUS_PERIOD_MS),
    ),
    (
        "5.1-write-16",
        "write 16-bit port (`COMANDO_ESCRITURA_16_BITS`)",
        Harmless::write_16(QuietPort16::FlowControlPeriod, 100),
    ),
    (
        "5.1-read-32",
        "read 32-bit port (`COMANDO_LECTURA_32_BITS`)",
        Harmless::read_32(port::CRUISE_SPEED_MPS),
    ),
    (
        "5.1-write-32",
        "write 32-bit port (`COMANDO_ESCRITURA_32_BITS`)",
        Harmless::write_32(QuietPort32::TakeOffAltitude, 10.0),
    ),
    (
        "5.1-clear-errors",
        "clear errors (`COMANDO_LIMPIEZA_ERROR`)",
        Harmless::CLEAR_ERRORS,
    ),
    (
        "5.1-activate-status",
        "activate status transmission (`COMANDO_ACTIVAR_TX_ESTADO`)",
        Harmless::ACTIVATE_STATUS,
    ),
    (
        "5.1-invalidate-path",
        "invalidate path (`COMANDO_INVALIDAR_CAMINO`)",
        Harmless::INVALIDATE_PATH,
    ),
    (
        "5.1-following-off",
        "change waypoint following (`COMANDO_CAMBIO_SEGUIMIENTO`)",
        Harmless::FOLLOWING_OFF,
    ),
];

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks: Vec<Check> = COMMANDS
        .into_iter()
        .map(|(id, name, command)| {
            Check::harmless(
                id,
                "5.1",
                name,
                "the command, twice",
                "one acknowledgement each time, of its kind, with its code and, in the extended profile, its number; no error",
                move |bench| each_command(bench, command),
            )
        })
        .collect();
    checks.extend(of_acknowledgements());
    checks
}

async fn each_command(bench: Bench, command: Harmless) -> Judged {
    bench.expect_command(command, &[]).await?;
    let raw = bench.frame(command);
    bench.expect(&raw, "the command", 1, &[]).await
}

fn of_acknowledgements() -> Vec<Check> {
    vec![
        Check::harmless(
            "8.2-one-acknowledgement",
            "8.2",
            "The DSP answers each command that it does not reject as bytes (section 5.1) with exactly one acknowledgement.",
            "32 commands of four codes, each after the acknowledgement of the one before",
            "32 acknowledgements, each of its command",
            |bench| async move {
                let mark = bench.mark();
                for _ in 0..8 {
                    for (_, _, command) in COMMANDS.into_iter().step_by(2) {
                        bench.ask(command).await?;
                    }
                }
                bench.statuses(2).await?;
                let acks = bench.since(mark);
                let acks = acks.iter().filter(|arrival| arrival.ack().is_some());
                let count = acks.count();
                ensure(count == 32, || {
                    format!("{count} acknowledgements for 32 commands")
                })
            },
        ),
        Check::harmless(
            "8.2-ack-time",
            "8.2",
            "The acknowledgement begins within 50 ms of the command's last byte, or, if another frame is being sent by then, right after that frame.",
            "twenty reads at moments that move against the status",
            "each acknowledgement within 50 ms, the frames that may be on the line, and the slack",
            |bench| async move {
                for step in 0..20u64 {
                    bench.sleep(Duration::from_millis(3 + step)).await;
                    bench.ask(Harmless::read_16(port::STATUS_PERIOD_MS)).await?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "8.2-ack-before-status",
            "8.2",
            "What waits is sent in this order: acknowledgements, error 100 for the other profile, flow control, status.",
            "ten reads while all groups are asked for every millisecond, which is more than a line of 1 Mbaud carries",
            "no acknowledgement behind more statuses than were on the line already",
            |bench| async move {
                bench.set_mask(StatusMask::ALL).await?;
                bench.set_period(1).await?;
                bench.statuses(3).await?;
                for _ in 0..10 {
                    bench.forget();
                    let mark = bench.mark();
                    let read = Harmless::read_16(port::STATUS_PERIOD_MS);
                    bench.ask(read).await?;
                    let before = bench.since(mark);
                    let statuses = before.iter().filter(|arrival| arrival.status().is_some());
                    let count = statuses.count() as u128;
                    // The one that was on the line, one that began before the command was there, and what this computer
                    // may have read late.
                    let frame_us = bench.frame_time().as_micros().max(1_000);
                    let allowed = 2 + bench.slack().as_micros() / frame_us;
                    ensure(count <= allowed, || {
                        format!(
                            "{count} statuses came before an acknowledgement where at most {allowed} should have"
                        )
                    })?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "8.2-write-then-read",
            "8.2",
            "Ports change before the acknowledgement is sent: a read after the acknowledgement of a write gives the new value.",
            "ten writes of port 10002 with different values, and a read right after each",
            "each read gives the value of its write",
            |bench| async move {
                for value in (110..210).step_by(10) {
                    let write = Harmless::write_16(QuietPort16::FlowControlPeriod, value);
                    bench.ask(write).await?;
                    let read = bench.read_16(port::FLOW_CONTROL_PERIOD_MS).await?;
                    ensure(read == value, || {
                        format!("port 10002 reads {read} right after {value} was written")
                    })?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "8.2-refused-command",
            "8.2",
            "the DSP acknowledges a command that it cannot carry out and reports error 30",
            "a write of port 10001 with 0",
            "an acknowledgement and one error 30",
            |bench| async move {
                let write = Harmless::write_16(QuietPort16::StatusPeriod, 0);
                bench.expect_command(write, &[INVALID]).await?;
                Ok(())
            },
        ),
        Check::harmless(
            "8.2-repeated-command",
            "8.2",
            "So every command may arrive twice, and then has the same effect as once.",
            "one frame twice without a pause: activate status transmission, invalidate path, a write",
            "two acknowledgements each time, no error, statuses as before",
            |bench| async move {
                let commands = [
                    Harmless::ACTIVATE_STATUS,
                    Harmless::INVALIDATE_PATH,
                    Harmless::write_16(QuietPort16::FlowControlPeriod, 100),
                ];
                for command in commands {
                    let frame: Raw = bench.frame(command);
                    let raw = frame.clone().then(frame);
                    bench
                        .expect(&raw, "a command that came twice", 2, &[])
                        .await?;
                }
                super::status::judge_period(&bench, 100).await
            },
        ),
        Check::harmless(
            "8.1-start-up",
            "8.1",
            "The PC then sends the following commands, each after the acknowledgement of the one before:",
            "the start-up without its step 7 (following on), twice: the second finds the DSP active",
            "an acknowledgement of each, the values read back, statuses with the mask",
            start_up,
        ),
        Check::moving(
            StartPlace::Ground,
            "5.1-following-on",
            "5.1",
            "1 on, 0 off; others are rejected (*value*)",
            "following on twice, following 2 and 127 with a right check field, following off",
            "acknowledgements of on and off; error 30 and no acknowledgement of the others",
            |bench, proof| async move {
                let on = proof.permit(dsp_protocol::Command::Following { on: true });
                bench.expect_command(on, &[]).await?;
                bench.expect_command(on, &[]).await?;
                let at = match bench.profile() {
                    dsp_protocol::Profile::Classic => 2,
                    dsp_protocol::Profile::Extended => 4,
                };
                for flip in [0x03, 0x7E] {
                    let raw = bench.frame(on).flip(at, flip).sealed(bench.profile());
                    bench
                        .expect(&raw, "following with another value", 0, &[INVALID])
                        .await?;
                }
                bench.expect_command(Harmless::FOLLOWING_OFF, &[]).await?;
                Ok(())
            },
        ),
    ]
}

async fn start_up(bench: Bench) -> Judged {
    let timeout_ms = 2_000;
    for _ in 0..2 {
        let mask = StatusMask(0x0001);
        bench.set_mask(mask).await?;
        let write = Harmless::write_16(QuietPort16::PcTimeout, timeout_ms);
        bench.ask(write).await?;
        let timeout = bench.read_16(port::PC_TIMEOUT_MS).await?;
        ensure(timeout == timeout_ms || timeout == 0, || {
            format!(
                "port 10004 reads {timeout} after {timeout_ms} was written; a classic DSP reads 0"
            )
        })?;
        bench.ask(Harmless::ACTIVATE_STATUS).await?;
        bench.ask(Harmless::CLEAR_ERRORS).await?;
        bench.ask(Harmless::INVALIDATE_PATH).await?;
        let write = Harmless::write_32(QuietPort32::CruiseSpeed, 7.5);
        bench.ask(write).await?;
        let speed = bench.read_32(port::CRUISE_SPEED_MPS).await?;
        ensure(speed == 7.5, || {
            format!("port 20000 reads {speed} after 7.5 was written")
        })?;
        bench.forget();
        let mark = bench.mark();
        let statuses = bench.statuses(3).await?;
        ensure(
            statuses.iter().all(|(_, status)| status.mask() == mask),
            || "a status came with another mask than the one that was written".to_owned(),
        )?;
        let errors: Vec<u16> = bench
            .since(mark)
            .iter()
            .filter_map(crate::arrival::Arrival::link_error)
            .collect();
        ensure(errors.is_empty(), || {
            format!("errors {errors:?} came after the errors were cleared")
        })?;
    }
    Ok(())
}
