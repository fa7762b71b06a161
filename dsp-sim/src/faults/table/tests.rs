//! What a file means, and what is wrong with it.

use runtime::config::proof::assert_refused;

use super::*;
use crate::faults::Direction;

fn parse(text: &str) -> Result<Script, String> {
    runtime::config::parse(text, "x.toml").map_err(|error| error.to_string())
}

fn s(count: u64) -> Duration {
    Duration::from_secs(count)
}

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

/// The kind of the table that a fault was read from.
fn kind_of(fault: &Fault) -> FaultKind {
    match fault {
        Fault::Bytes { damage, .. } => match damage {
            Damage::FlipBits { .. } => FaultKind::FlipBits,
            Damage::Drop { .. } => FaultKind::DropBytes,
            Damage::Duplicate { .. } => FaultKind::DuplicateBytes,
            Damage::Insert { .. } => FaultKind::InsertBytes,
            Damage::Delay { .. } => FaultKind::DelayBytes,
            Damage::Split { .. } => FaultKind::SplitBytes,
            Damage::Burst { .. } => FaultKind::Burst,
            Damage::Stall { .. } => FaultKind::Stall,
            Damage::Outage => FaultKind::Outage,
        },
        Fault::Messages { act, .. } => match act {
            Act::Drop => FaultKind::Drop,
            Act::Repeat => FaultKind::Repeat,
            Act::Late(_) => FaultKind::Late,
            Act::Reorder => FaultKind::Reorder,
        },
        Fault::Dsp { event, .. } => match event {
            DspEvent::RaiseError(_) => FaultKind::RaiseError,
            DspEvent::Reboot => FaultKind::Reboot,
            DspEvent::StopStatus => FaultKind::StopStatus,
            DspEvent::Hang(_) => FaultKind::Hang,
            DspEvent::ClockJump(_) => FaultKind::ClockJump,
            DspEvent::ChangeMask(_) => FaultKind::ChangeMask,
        },
        Fault::Helicopter { event, .. } => match event {
            HelicopterEvent::PilotTakesOver(_) => FaultKind::PilotTakesOver,
            HelicopterEvent::BatteryLow { .. } => FaultKind::BatteryLow,
            HelicopterEvent::FuelLow { .. } => FaultKind::FuelLow,
            HelicopterEvent::GpsAltitudeDrift { .. } => FaultKind::GpsAltitudeDrift,
            HelicopterEvent::LoseFix(_) => FaultKind::LoseFix,
        },
        Fault::HangUp { .. } => FaultKind::HangUp,
    }
}

#[test]
fn the_annotated_example_has_every_kind_and_every_key() {
    let example = include_str!("../../../faults.toml");
    let script = parse(example).unwrap();
    for &kind in FaultKind::ALL {
        assert!(
            script.faults.iter().any(|fault| kind_of(fault) == kind),
            "{} is not in the example",
            kind.name()
        );
    }
    assert_eq!(script.faults.len(), FaultKind::ALL.len());
    let keys = "direction message from_s until_s at_s every_s for_s rate bit_error_rate length_bytes chunk_bytes \
                delay_ms jitter_ms gap_ms then code jump_ms elsewhere mask volts percent drift_mps seed";
    for key in keys.split_whitespace() {
        let shown = example.lines().any(|line| {
            let written = line.split('=').next().unwrap_or_default();
            written.trim() == key
        });
        assert!(shown, "{key} is not in the example");
    }
    let burst = Fault::Bytes {
        direction: Directions::Both,
        window: Window::between(s(45), s(50)),
        damage: Damage::Burst {
            rate: 0.001,
            length_bytes: 40,
        },
    };
    assert!(script.faults.contains(&burst));
}

#[test]
fn each_table_becomes_what_it_says() {
    let bytes = |direction, window, damage| Fault::Bytes {
        direction,
        window,
        damage,
    };
    #[rustfmt::skip]
    let cases = [
        (
            "kind = 'flip_bits'\ndirection = 'to_pc'\nfrom_s = 1\nbit_error_rate = 1e-3",
            bytes(
                Directions::ToPc,
                Window::since(s(1)),
                Damage::FlipBits {
                    bit_error_rate: 1e-3,
                },
            ),
        ),
        ("kind = 'outage'", bytes(Directions::Both, Window::ALWAYS, Damage::Outage)),
        (
            "kind = 'stall'\ndirection = 'to_dsp'\nfrom_s = 1\nuntil_s = 1.5\nevery_s = 2\nthen = 'drop'",
            bytes(
                Directions::ToDsp,
                Window::between(s(1), ms(1_500)).every(s(2)),
                Damage::Stall {
                    then: AfterStall::Drop,
                },
            ),
        ),
        (
            "kind = 'delay_bytes'\ndelay_ms = 1.5",
            bytes(
                Directions::Both,
                Window::ALWAYS,
                Damage::Delay {
                    delay: Duration::from_micros(1_500),
                    jitter: Duration::ZERO,
                },
            ),
        ),
        (
            "kind = 'late'\nmessage = 'flow_control'\ndelay_ms = 7\nrate = 0.5\nuntil_s = 3",
            Fault::Messages {
                message: MessageKind::FlowControl,
                window: Window::between(s(0), s(3)),
                rate: 0.5,
                act: Act::Late(ms(7)),
            },
        ),
        (
            "kind = 'drop'\nmessage = 'waypoint'",
            Fault::Messages {
                message: MessageKind::Waypoint,
                window: Window::ALWAYS,
                rate: 1.0,
                act: Act::Drop,
            },
        ),
        (
            "kind = 'raise_error'\nat_s = 2\nevery_s = 3\ncode = 300",
            Fault::Dsp {
                times: Times::every(s(2), s(3)),
                event: DspEvent::RaiseError(DspErrorCode(300)),
            },
        ),
        ("kind = 'clock_jump'\nat_s = 2\njump_ms = -7", Fault::Dsp { times: Times::once(s(2)), event: DspEvent::ClockJump(-7) }),
        (
            "kind = 'change_mask'\nat_s = 2\nmask = 0x0401",
            Fault::Dsp {
                times: Times::once(s(2)),
                event: DspEvent::ChangeMask(StatusMask(0x0401)),
            },
        ),
        (
            "kind = 'pilot_takes_over'\nat_s = 2\nfor_s = 3\nevery_s = 10",
            Fault::Helicopter {
                times: Times::every(s(2), s(10)),
                event: HelicopterEvent::PilotTakesOver(s(3)),
            },
        ),
        (
            "kind = 'gps_altitude_drift'\nat_s = 2\nfor_s = 3\ndrift_mps = -0.5",
            Fault::Helicopter {
                times: Times::once(s(2)),
                event: HelicopterEvent::GpsAltitudeDrift {
                    rate_mps: -0.5,
                    length: s(3),
                },
            },
        ),
        ("kind = 'hang_up'\nat_s = 2\nfor_s = 0.25", Fault::HangUp { times: Times::once(s(2)), length: ms(250), elsewhere: false }),
    ];
    for (table, expected) in cases {
        let script = parse(&format!("seed = 9\n[[fault]]\n{table}")).unwrap();
        assert_eq!(script.seed, 9);
        assert_eq!(script.faults, [expected], "{table}");
    }
    assert_eq!(parse("").unwrap(), Script::default());
}

#[test]
fn every_mistake_is_reported_with_its_line() {
    assert_refused::<Script>(
        r#"
        sead = 1 #! did you mean `seed`?
        ---
        seed = -1 #! expected u64
        ---
        [[fault]]
        kind = 'reboot'
        at_s = 1
        [[fault]]
        kind = 'rebot' #! did you mean `reboot`?
        ---
        [[fault]]
        kind = 'outage'
        untill_s = 1 #! did you mean `until_s`?
        ---
        [[fault]]
        kind = 'outage'

        direction = 'to_pcs' #! did you mean `to_pc`?
        ---
        [[fault]]
        kind = 'drop'
        message = 'nack' #! did you mean `ack`?
        ---
        [[fault]]
        kind = 'drop_bytes'
        rate = 1.1 #! 1.1 is out of range: it must be from 0.0 to 1.0
        ---
        [[fault]]
        kind = 'drop_bytes'
        rate = nan #! NaN is out of range
        ---
        [[fault]]
        kind = 'hang'
        at_s = 1
        for_s = 0 #! 0 is out of range
        ---
        [[fault]]
        kind = 'outage'
        from_s = -1 #! -1 is out of range
        ---
        [[fault]]
        kind = 'burst'
        rate = 0.1
        length_bytes = 0 #! 0 is out of range
        ---
        [[fault]]
        kind = 'split_bytes'
        chunk_bytes = 2000 #! 2000 is out of range
        gap_ms = 1
        ---
        [[fault]]
        kind = 'delay_bytes'
        delay_ms = 5001 #! 5001 is out of range
        ---
        [[fault]]
        kind = 'raise_error'
        at_s = 1
        code = 65536 #! expected u16
        ---
        [[fault]]
        kind = 'clock_jump'
        at_s = 1
        jump_ms = 86400001 #! is out of range
        ---
        [[fault]]
        kind = 'battery_low'
        at_s = 1
        volts = 61 #! 61 is out of range
        ---
        [[fault]]
        kind = 'fuel_low'
        at_s = 1
        percent = -1 #! -1 is out of range
        ---

        [[fault]] #! a fault of kind `fuel_low` needs `percent`
        kind = 'fuel_low'
        at_s = 1
        volts = 20
        ---

        [[fault]] #! missing field `kind`
        at_s = 1
        ---

        [[fault]] #! a fault of kind `reboot` has no `rate`
        kind = 'reboot'
        at_s = 1
        rate = 0.5
        ---

        [[fault]] #! has no `direction`
        kind = 'drop'
        message = 'ack'
        direction = 'to_pc'
        ---

        [[fault]] #! has no `message`
        kind = 'outage'
        message = 'ack'
        ---

        [[fault]] #! a fault of kind `hang` needs `for_s`
        kind = 'hang'
        at_s = 1
        ---

        [[fault]] #! needs `at_s`
        kind = 'reboot'
        ---

        [[fault]] #! a fault of kind `stall` needs `until_s`
        kind = 'stall'
        from_s = 1
        ---

        [[fault]] #! `until_s` must be later than `from_s`
        kind = 'outage'
        from_s = 2
        until_s = 2
        ---

        [[fault]] #! `every_s` must be longer
        kind = 'outage'
        until_s = 2
        every_s = 2
        ---

        [[fault]] #! `every_s` needs `until_s`
        kind = 'outage'
        every_s = 2
        "#,
    );
}

#[test]
fn every_kind_says_what_it_needs() {
    // With nothing but its name, each kind but the outage misses something.
    for &kind in FaultKind::ALL {
        let outcome = parse(&format!("[[fault]]\nkind = '{}'", kind.name()));
        match kind {
            FaultKind::Outage => assert!(outcome.is_ok()),
            _ => {
                let error = outcome.unwrap_err();
                let needed = format!("a fault of kind `{}` needs `", kind.name());
                assert!(error.contains(&needed), "{error}");
            }
        }
    }
}

#[test]
fn a_file_holds_no_more_faults_than_a_line_can_ask() {
    let fault = "[[fault]]\nkind = 'outage'\n";
    assert_eq!(
        parse(&fault.repeat(MAX_FAULTS)).unwrap().faults.len(),
        MAX_FAULTS
    );
    let error = parse(&fault.repeat(MAX_FAULTS + 1)).unwrap_err();
    assert!(error.contains("at most 256 faults"), "{error}");
}

#[test]
fn messages_go_one_way() {
    for (message, direction) in [
        (MessageKind::Ack, Direction::ToPc),
        (MessageKind::FlowControl, Direction::ToPc),
        (MessageKind::Status, Direction::ToPc),
        (MessageKind::Error, Direction::ToPc),
        (MessageKind::Command, Direction::ToDsp),
        (MessageKind::Waypoint, Direction::ToDsp),
    ] {
        assert_eq!(message.direction(), direction);
    }
}
