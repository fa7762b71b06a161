//! What holds after a boot: sections 6, 8.1 and 11. One reset of the DSP serves all of these checks.

use std::time::Duration;

use dsp_protocol::port::{self, PORTS_16, PORTS_32};
use dsp_protocol::{Command, Group, Profile, StatusMask};

use crate::arrival::Arrival;
use crate::bench::{Bench, Observed};
use crate::check::{Check, StartPlace};
use crate::outcome::{Judged, ensure};
use crate::permitted::{Harmless, QuietPort16};

/// How long the line is watched after a reset, before the kit sends anything.
const QUIET: Duration = Duration::from_millis(1_500);
/// Status period of the first status, ms: long, so that one that comes at once is not taken for a late one.
const FIRST_PERIOD_MS: u16 = 400;
/// How late after the reset the DSP may have booted.
const BOOT_TIME_MS: u32 = 10_000;

/// What one reset has shown.
#[derive(Clone, Debug, Default)]
struct AfterBoot {
    /// Messages that came before the kit sent anything.
    unasked: usize,
    /// The first number of the DSP.
    first_number: Option<u8>,
    words: Vec<u16>,
    floats: Vec<f32>,
    waypoint_count: u16,
    /// Errors that came before status transmission was active, and flow control.
    too_early: usize,
    /// From the acknowledgement of the activation to the first status, ms.
    first_status_ms: f64,
    time_ms: Option<u32>,
    mask: StatusMask,
    flying: bool,
}

/// The checks.
pub fn checks() -> Vec<Check> {
    let observed = Observed::<AfterBoot>::default();
    let check = |id: &str,
                 section: &'static str,
                 sentence: &str,
                 expects: &str,
                 judge: fn(&Bench, &AfterBoot) -> Judged| {
        let observed = observed.clone();
        let sends =
            "a reset; after 1.5 s of silence reads of all ports, and activate status transmission";
        Check::harmless(id, section, sentence, sends, expects, move |bench| {
            let observed = observed.clone();
            async move { judge(&bench, &observed.or(&bench, observe(&bench)).await?) }
        })
        .with_reset()
    };
    vec![
        check(
            "8.1-boot-silent",
            "8.1",
            "At boot the DSP sends nothing.",
            "nothing",
            |_, facts| {
                ensure(facts.unasked == 0, || {
                    format!("{} messages came before a command was sent", facts.unasked)
                })
            },
        ),
        check(
            "8.1-boot-inactive",
            "8.1",
            "status transmission off, following off",
            "acknowledgements alone until status transmission is activated",
            |_, facts| {
                ensure(facts.too_early == 0, || {
                    format!(
                        "{} messages that are no acknowledgement came before status transmission was activated",
                        facts.too_early
                    )
                })
            },
        ),
        check(
            "8.3-first-status",
            "8.3",
            "The first comes one period after the activation",
            "with a period of 400 ms a status 400 ms after the acknowledgement",
            |bench, facts| {
                let late = 1e3 * (bench.slack() + bench.frame_time()).as_secs_f64();
                let passed = facts.first_status_ms;
                let period = f64::from(FIRST_PERIOD_MS);
                ensure(
                    (period - 20.0 - late..=period + 4.0 + late).contains(&passed),
                    || format!("the first status came {passed:.1} ms after the activation"),
                )
            },
        ),
        check(
            "6-at-boot",
            "6",
            "at boot",
            "each port with its value at boot",
            |_, facts| {
                for (port, bits) in PORTS_16.iter().zip(&facts.words) {
                    let value = port.value_of(*bits);
                    ensure(value == port.boot, || {
                        format!("port {} reads {value} after a boot", port.number)
                    })?;
                }
                for (port, value) in PORTS_32.iter().zip(&facts.floats) {
                    ensure(value.to_bits() == port.boot.to_bits(), || {
                        format!("port {} reads {value} after a boot", port.number)
                    })?;
                }
                Ok(())
            },
        ),
        check(
            "6-count-at-boot",
            "6",
            "`0x8000`",
            "0x8000 in port 10003, or 0 if the DSP does not have it",
            |_, facts| {
                ensure(matches!(facts.waypoint_count, 0 | 0x8000), || {
                    format!("port 10003 reads 0x{:04X}", facts.waypoint_count)
                })
            },
        ),
        check(
            "8.1-boot-clock",
            "8.1",
            "numbers, copies, clock 0",
            "a time of less than 10 s in the first status",
            |_, facts| {
                let time = facts.time_ms.unwrap_or(0);
                ensure(time < BOOT_TIME_MS, || {
                    format!("the clock reads {time} ms after a boot")
                })
            },
        ),
        check(
            "8.1-boot-mask",
            "8.1",
            "mask 0, periods, PC time-out 0, all other ports as in section 6",
            "a first status without a group",
            |_, facts| {
                ensure(facts.mask == StatusMask::NONE, || {
                    format!("the first status has mask 0x{:04X}", facts.mask.0)
                })
            },
        ),
        check(
            "8.1-boot-flag",
            "8.1",
            "the flying flag is right from the first status on",
            "the flag 0: the helicopter stands",
            |_, facts| ensure(!facts.flying, || "the flag is 1 on the ground".to_owned()),
        ),
        check(
            "11-first-number",
            "11",
            "0 for the first message after boot",
            "number 0",
            |_, facts| {
                ensure(facts.first_number == Some(0), || match facts.first_number {
                    Some(number) => format!("the first message has number {number}"),
                    None => "no message came".to_owned(),
                })
            },
        )
        .only_in(Profile::Extended),
        before_start_up(),
    ]
}

async fn observe(bench: &Bench) -> Judged<AfterBoot> {
    bench.reset().await?;
    let mut facts = AfterBoot::default();
    let mark = bench.mark();
    bench.sleep(QUIET).await;
    let unasked = bench.since(mark);
    facts.unasked = unasked.iter().filter(|one| one.event.is_ok()).count();
    for port in PORTS_16 {
        facts.words.push(bench.read_16(port.number).await?);
    }
    for port in PORTS_32 {
        facts.floats.push(bench.read_32(port.number).await?);
    }
    facts.waypoint_count = bench.read_16(port::WAYPOINT_COUNT).await?;
    // An error that waits for a status must not come without one.
    bench.ask(Harmless::read_16(9)).await?;
    bench.sleep(Duration::from_millis(400)).await;
    let seen = bench.since(mark);
    let numbers = seen.iter().filter_map(|arrival| arrival.sequence);
    facts.first_number = numbers.map(|number| number.number()).next();
    let other = seen
        .iter()
        .filter(|seen| seen.event.is_ok() && seen.ack().is_none());
    facts.too_early = other.count();
    bench.set_period(FIRST_PERIOD_MS).await?;
    bench.forget();
    let ack = bench.ask(Harmless::ACTIVATE_STATUS).await?;
    let first = bench.statuses(1).await?;
    if let Some((at, status)) = first.first() {
        facts.first_status_ms = (*at - ack.at).as_secs_f64() * 1e3;
        facts.mask = status.mask();
        facts.flying = status.flying;
    }
    let time = StatusMask::NONE.with(Group::Time);
    let write = Harmless::write_16(QuietPort16::StatusMask, time.0);
    bench.ask(write).await?;
    let later = bench.statuses(3).await?;
    facts.time_ms = later.last().and_then(|(_, status)| status.time_ms);
    Ok(facts)
}

/// A take-off that the DSP must refuse because following was never on since the boot.
fn before_start_up() -> Check {
    Check::moving(
        StartPlace::Ground,
        "8.5-take-off-before-start-up",
        "8.5",
        "The DSP refuses 10121 with error 30 until it was started up",
        "a reset, activate status transmission, write 1 to 10121",
        "error 30; 10121 reads 0; no flow control",
        |bench, proof| async move {
            bench.reset().await?;
            bench.sleep(QUIET).await;
            bench.ask(Harmless::ACTIVATE_STATUS).await?;
            let mark = bench.mark();
            let write = proof.permit(Command::Write16 {
                port: port::TAKE_OFF,
                value: 1,
            });
            bench.expect_command(write, &[30]).await?;
            let reads = bench.read_16(port::TAKE_OFF).await?;
            ensure(reads == 0, || {
                format!("10121 reads {reads} after a take-off that should have been refused")
            })?;
            // Three flow control periods.
            bench.sleep(Duration::from_millis(300)).await;
            let seen = bench.since(mark);
            let flows = seen.iter().filter_map(Arrival::flow);
            ensure(flows.count() == 0, || {
                "flow control came with following off".to_owned()
            })
        },
    )
    .with_reset()
}
