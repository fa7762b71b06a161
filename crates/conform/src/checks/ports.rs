//! The virtual ports: section 6.

use dsp_protocol::Command;
use dsp_protocol::port::{self, PORTS_16, PORTS_32, Port16, Port32};

use crate::arrival::{Arrival, describe_downlink};
use crate::bench::Bench;
use crate::check::{Check, StartPlace};
use crate::outcome::{Judged, broken, ensure, not_judged};
use crate::permitted::{Harmless, Permitted, QuietPort16, QuietPort32, RotorDisconnected, moves};

const INVALID: u16 = 30;

/// Ports that have a quiet type.
const QUIET_16: [(QuietPort16, u16); 4] = [
    (QuietPort16::StatusMask, port::STATUS_MASK),
    (QuietPort16::StatusPeriod, port::STATUS_PERIOD_MS),
    (QuietPort16::FlowControlPeriod, port::FLOW_CONTROL_PERIOD_MS),
    (QuietPort16::PcTimeout, port::PC_TIMEOUT_MS),
];
const QUIET_32: [(QuietPort32, u16); 4] = [
    (QuietPort32::CruiseSpeed, port::CRUISE_SPEED_MPS),
    (QuietPort32::ClimbSpeed, port::CLIMB_SPEED_MPS),
    (QuietPort32::AcceptanceRadius, port::ACCEPTANCE_RADIUS_M),
    (QuietPort32::TakeOffAltitude, port::TAKE_OFF_ALTITUDE_M),
];

const RANGE_SENDS: &str =
    "writes of both ends of the range, of the values next to them outside, and reads behind each";
const RANGE_EXPECTS: &str =
    "values in the range as written; error 30 and no change for those outside";

/// The checks.
pub fn checks() -> Vec<Check> {
    let mut checks = general();
    for port in PORTS_16 {
        checks.extend(of_port_16(port));
    }
    for port in PORTS_32 {
        checks.extend(of_port_32(port));
    }
    checks
}

fn of_port_16(port: &'static Port16) -> Vec<Check> {
    let named = Named(port.number, port.name);
    let quiet = QUIET_16.iter().find(|(_, number)| *number == port.number);
    if let Some((quiet, _)) = quiet {
        let quiet = *quiet;
        let write = move |value| Permitted::from(Harmless::write_16(quiet, value));
        return vec![named.range_harmless(move |bench| range_16(bench, port, write))];
    }
    let is_movement = matches!(port.number, port::TAKE_OFF | port::LAND);
    let expects = match is_movement {
        true => "0: the helicopter stands",
        false => "a value within the range",
    };
    let read = named.read(expects, move |bench| async move {
        let mark = bench.mark();
        let bits = bench.read_16(port.number).await?;
        judge_known(&bench, mark, port.number).await?;
        let is_right = if is_movement {
            bits == 0
        } else {
            port.accepts(bits)
        };
        ensure(is_right, || {
            format!("port {} reads {}", port.number, port.value_of(bits))
        })
    });
    if is_movement {
        return vec![read];
    }
    let range = named.range_moving(move |bench, proof| {
        let write = move |value| {
            proof.permit(Command::Write16 {
                port: port.number,
                value,
            })
        };
        range_16(bench, port, write)
    });
    vec![read, range]
}

fn of_port_32(port: &'static Port32) -> Vec<Check> {
    let named = Named(port.number, port.name);
    let quiet = QUIET_32.iter().find(|(_, number)| *number == port.number);
    if let Some((quiet, _)) = quiet {
        let quiet = *quiet;
        let write = move |value| Permitted::from(Harmless::write_32(quiet, value));
        return vec![named.range_harmless(move |bench| range_32(bench, port, write))];
    }
    debug_assert!(moves(port.number));
    let read = named.read("a value within the range", move |bench| async move {
        let mark = bench.mark();
        let value = bench.read_32(port.number).await?;
        judge_known(&bench, mark, port.number).await?;
        ensure(port.accepts(value), || {
            format!("port {} reads {value}", port.number)
        })
    });
    let range = named.range_moving(move |bench, proof| {
        let write = move |value| {
            proof.permit(Command::Write32 {
                port: port.number,
                value,
            })
        };
        range_32(bench, port, write)
    });
    vec![read, range]
}

/// Number and name of a port, as its row in section 6 has them.
struct Named(u16, &'static str);

impl Named {
    fn row(&self) -> String {
        format!("{} | `{}`", self.0, self.1)
    }

    fn read<F: Future<Output = Judged> + 'static>(
        &self,
        expects: &str,
        run: impl Fn(Bench) -> F + 'static,
    ) -> Check {
        let id = format!("6-read-{}", self.0);
        Check::harmless(&id, "6", &self.row(), "a read", expects, run)
    }

    fn range_harmless<F: Future<Output = Judged> + 'static>(
        &self,
        run: impl Fn(Bench) -> F + 'static,
    ) -> Check {
        let id = format!("6-port-{}", self.0);
        Check::harmless(&id, "6", &self.row(), RANGE_SENDS, RANGE_EXPECTS, run)
    }

    /// Of a port that can move a rotor.
    fn range_moving<F: Future<Output = Judged> + 'static>(
        &self,
        run: impl Fn(Bench, RotorDisconnected) -> F + 'static,
    ) -> Check {
        let (id, row) = (format!("6-port-{}", self.0), self.row());
        Check::moving(
            StartPlace::Ground,
            &id,
            "6",
            &row,
            RANGE_SENDS,
            RANGE_EXPECTS,
            run,
        )
    }
}

/// Judges that no error 30 came since `mark`: the DSP has the port.
async fn judge_known(bench: &Bench, mark: usize, number: u16) -> Judged {
    bench.errors(2).await?;
    let errors: Vec<u16> = bench
        .since(mark)
        .iter()
        .filter_map(Arrival::link_error)
        .collect();
    ensure(errors.is_empty(), || {
        format!("errors {errors:?} came for a read of port {number}")
    })
}

async fn range_16(bench: Bench, port: &'static Port16, write: impl Fn(u16) -> Permitted) -> Judged {
    let number = port.number;
    let mark = bench.mark();
    let found = bench.read_16(number).await?;
    if number == port::PC_TIMEOUT_MS && found == 0 && has_no_such_port(&bench, mark).await? {
        return not_judged("a classic DSP: it has no port 10004, which it may");
    }
    let outcome = values_16(&bench, port, found, &write).await;
    // As it was found, also when a value was refused that should have been taken.
    bench.ask(write(found)).await?;
    if number == port::STATUS_PERIOD_MS {
        bench.set_period(50).await?;
    }
    outcome
}

async fn values_16(
    bench: &Bench,
    port: &'static Port16,
    found: u16,
    write: &impl Fn(u16) -> Permitted,
) -> Judged {
    let number = port.number;
    let bits = |value: i32| value.cast_unsigned() as u16;
    for value in [port.min, port.max, port.min] {
        bench.ask(write(bits(value))).await?;
        let read = bench.read_16(number).await?;
        ensure(read == bits(value), || {
            format!(
                "port {number} reads {} after {value} was written",
                port.value_of(read)
            )
        })?;
    }
    bench.ask(write(found)).await?;
    let beyond = [port.min - 1, port.max + 1];
    let limits = match port.signed {
        true => -32_768..=32_767,
        false => 0..=65_535,
    };
    for value in beyond.into_iter().filter(|value| limits.contains(value)) {
        bench.expect_command(write(bits(value)), &[INVALID]).await?;
        let read = bench.read_16(number).await?;
        ensure(read == found, || {
            format!(
                "port {number} reads {} after {value} was written, which is outside its range; it was {}",
                port.value_of(read),
                port.value_of(found)
            )
        })?;
    }
    Ok(())
}

async fn range_32(bench: Bench, port: &'static Port32, write: impl Fn(f32) -> Permitted) -> Judged {
    let found = bench.read_32(port.number).await?;
    let outcome = values_32(&bench, port, found, &write).await;
    bench.ask(write(found)).await?;
    outcome
}

async fn values_32(
    bench: &Bench,
    port: &'static Port32,
    found: f32,
    write: &impl Fn(f32) -> Permitted,
) -> Judged {
    let number = port.number;
    for value in [port.min, port.max] {
        bench.ask(write(value)).await?;
        let read = bench.read_32(number).await?;
        ensure(read.to_bits() == value.to_bits(), || {
            format!("port {number} reads {read} after {value} was written")
        })?;
    }
    bench.ask(write(found)).await?;
    let beyond = [
        port.min.next_down(),
        port.max.next_up(),
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
    ];
    for value in beyond {
        bench.expect_command(write(value), &[INVALID]).await?;
        let read = bench.read_32(number).await?;
        ensure(read.to_bits() == found.to_bits(), || {
            format!(
                "port {number} reads {read} after {value} was written, which is outside its range; it was {found}"
            )
        })?;
    }
    Ok(())
}

/// Whether the read since `mark` brought error 30, as one of an unknown port does.
async fn has_no_such_port(bench: &Bench, mark: usize) -> Judged<bool> {
    bench.errors(2).await?;
    let seen = bench.since(mark);
    Ok(seen.iter().any(|seen| seen.link_error() == Some(INVALID)))
}

fn general() -> Vec<Check> {
    vec![
        Check::harmless(
            "6-unknown-read",
            "6",
            "It answers a read of an unknown port with 0 and reports error 30.",
            "reads of ports 9 and 65535, and of 20000 with 16 bits and 10000 with 32",
            "0 and error 30 for each",
            |bench| async move {
                for number in [9, 65_535, port::CRUISE_SPEED_MPS] {
                    let read = Harmless::read_16(number);
                    let answer = bench.expect_command(read, &[INVALID]).await?;
                    judge_zero(&answer, number)?;
                }
                for number in [9, 65_535, port::STATUS_MASK] {
                    let read = Harmless::read_32(number);
                    let answer = bench.expect_command(read, &[INVALID]).await?;
                    judge_zero(&answer, number)?;
                }
                Ok(())
            },
        ),
        Check::harmless(
            "6-unknown-write",
            "6",
            "Writing a value outside the range, a read-only port or an unknown port changes nothing: the DSP acknowledges the command and reports error 30.",
            "writes of port 9 with 16 and 32 bits, of 20000 with 16 bits and 10000 with 32",
            "an acknowledgement and error 30 for each; ports 20000 and 10000 as before",
            |bench| async move {
                let speed = bench.read_32(port::CRUISE_SPEED_MPS).await?;
                let mask = bench.read_16(port::STATUS_MASK).await?;
                let writes = [
                    Harmless::write_16(QuietPort16::Unknown, 1),
                    Harmless::write_32(QuietPort32::Unknown, 1.0),
                    Harmless::write_16(QuietPort16::OtherWidth, 3),
                    Harmless::write_32(QuietPort32::OtherWidth, 3.0),
                ];
                for write in writes {
                    bench.expect_command(write, &[INVALID]).await?;
                }
                let after = (
                    bench.read_32(port::CRUISE_SPEED_MPS).await?,
                    bench.read_16(port::STATUS_MASK).await?,
                );
                ensure(after == (speed, mask), || {
                    format!(
                        "ports 20000 and 10000 were {:?} and are {after:?}",
                        (speed, mask)
                    )
                })
            },
        ),
        Check::harmless(
            "6-read-only",
            "6",
            "bit 15 is always 1; bits 14…0 count the waypoints taken into the path buffer since boot, modulo 32768",
            "a read, a write and a read of port 10003",
            "bit 15, error 30 for the write, and the same value",
            |bench| async move {
                let mark = bench.mark();
                let count = bench.read_16(port::WAYPOINT_COUNT).await?;
                if count == 0 && has_no_such_port(&bench, mark).await? {
                    return not_judged("the DSP has no port 10003, which may be missing");
                }
                ensure(count & 0x8000 != 0, || {
                    format!("port 10003 reads 0x{count:04X}: bit 15 is not 1")
                })?;
                let write = Harmless::write_16(QuietPort16::WaypointCount, 0x8005);
                bench.expect_command(write, &[INVALID]).await?;
                let after = bench.read_16(port::WAYPOINT_COUNT).await?;
                ensure(after == count, || {
                    format!("port 10003 reads 0x{after:04X} after a write, 0x{count:04X} before")
                })
            },
        ),
        Check::harmless(
            "6-read-keeps",
            "6",
            "Reading a port never consumes its value.",
            "three reads of each of the ports that have a value",
            "the same value each time",
            |bench| async move {
                let words = PORTS_16.iter().map(|port| port.number);
                for number in words.filter(|number| !matches!(*number, port::TAKE_OFF | port::LAND))
                {
                    let first = bench.read_16(number).await?;
                    for _ in 0..2 {
                        let again = bench.read_16(number).await?;
                        ensure(again == first, || {
                            format!("port {number} reads {first}, and then {again}")
                        })?;
                    }
                }
                for number in PORTS_32.iter().map(|port| port.number) {
                    let first = bench.read_32(number).await?;
                    for _ in 0..2 {
                        let again = bench.read_32(number).await?;
                        ensure(again.to_bits() == first.to_bits(), || {
                            format!("port {number} reads {first}, and then {again}")
                        })?;
                    }
                }
                Ok(())
            },
        ),
    ]
}

fn judge_zero(answer: &Arrival, number: u16) -> Judged {
    use dsp_protocol::Downlink::{Ack16, Ack32};
    match answer.event {
        Ok(Ack16 { value: 0, .. }) => Ok(()),
        Ok(Ack32 { value, .. }) if value.to_bits() == 0 => Ok(()),
        Ok(other) => broken(format!(
            "unknown port {number} is answered with another value than 0: {}",
            describe_downlink(&other)
        )),
        Err(error) => broken(format!(
            "unknown port {number} is answered with a frame that the PC rejects: {}",
            error.name()
        )),
    }
}
