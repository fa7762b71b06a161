//! Judges the bridge's serial port for the doctor: whether it is there, may be opened, and which process has it open.

use bridge::shell::serial::Adapter;
use bridge::shell::serial::holders::{Hold, Holder};
use operator::robot::domain::Look;
use runtime::finding::{Finding, Severity};

use super::facts::{Device, PortFacts, PortHolders};

/// What is to be said of the port, when `bridge` is the process of the live bridge.
pub(super) fn diagnose(port: &PortFacts, bridge: Option<u32>) -> Finding {
    let path = port.path.display();
    let unknown = PortHolders::default();
    let holders = port.holders.as_ref().unwrap_or(&unknown);
    if let Some(elsewhere) = elsewhere(port, holders, bridge) {
        return elsewhere;
    }
    let finding = match &port.device {
        Err(trouble) => Finding::error(
            "port-unclear",
            format!("looking at {path} {trouble}"),
            "look what stands in its place",
        ),
        Ok(Device::Missing) => Finding::error(
            "port-missing",
            format!("{path} does not exist"),
            "is the cable plugged in, and is `serial.port` right? The bridge waits for it and opens it by itself",
        ),
        Ok(Device::Other(what)) => Finding::error(
            "port-not-a-terminal",
            format!("{path} is {what}, not a serial port"),
            "name a terminal device in `serial.port`, such as /dev/ttyUSB0",
        ),
        Ok(Device::Stale) => Finding::error(
            "port-stale",
            format!(
                "{path} was made by a simulator that has ended, and its terminal may be another one's by now"
            ),
            format!("start the simulator again: `ril run sim --link {path}`"),
        ),
        Ok(Device::Terminal {
            forbidden: Some(hint),
            ..
        }) => Finding::error(
            "port-forbidden",
            format!("{path} may not be opened by this user"),
            hint.clone(),
        ),
        Ok(Device::Terminal { adapter, .. }) => {
            let finding = held(port, &port.holders, bridge);
            match (adapter, finding.severity) {
                (Some(adapter), Severity::Note) => with_timer(finding, adapter, port, bridge),
                _ => finding,
            }
        }
    };
    // A default that was not chosen may not be needed.
    match port.is_chosen || finding.severity == Severity::Note {
        true => finding,
        false => Finding {
            severity: Severity::Note,
            text: format!(
                "{}; no configuration names it, it is the built-in default",
                finding.text
            ),
            ..finding
        },
    }
}

/// What is to be said of the port while the live bridge runs in another PID namespace: trouble that is seen from here
/// is perhaps none. There may be other devices, and the process that has the port open may be the bridge itself.
pub(super) fn of_a_bridge_elsewhere(finding: Finding) -> Finding {
    if finding.severity == Severity::Note {
        return finding;
    }
    let text = format!(
        "{}; the live bridge runs in another PID namespace or on another machine, where that may be different",
        finding.text
    );
    Finding::note(finding.id, text)
        .with_next_step("to look at the bridge's port, run `ril doctor` there")
}

/// The live bridge has another port open than the one that was asked about.
fn elsewhere(port: &PortFacts, holders: &PortHolders, bridge: Option<u32>) -> Option<Finding> {
    let pid = bridge?;
    let mut of_port = holders.of_port.processes.iter();
    if holders.by_bridge.is_empty() || of_port.any(|holder| holder.pid == pid) {
        return None;
    }
    let theirs: Vec<String> = holders
        .by_bridge
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let text = format!(
        "the live bridge (process {pid}) has {} open",
        theirs.join(", ")
    );
    if !port.is_chosen {
        return Some(Finding::note("port-right", text));
    }
    let text = format!("{text}, not {}", port.path.display());
    let finding = Finding::note("port-of-another-configuration", text);
    Some(finding.with_next_step(
        "to look at its port, name it with --port, or its configuration with --bridge",
    ))
}

/// The processes that use a port that is as it should be.
fn held(port: &PortFacts, holders: &Look<PortHolders>, bridge: Option<u32>) -> Finding {
    let path = port.path.display();
    let holders = match holders {
        Ok(holders) => holders,
        Err(trouble) => {
            let text = format!("{path} can be opened; looking who has it open {trouble}");
            return Finding::note("port-right", text);
        }
    };
    let processes = &holders.of_port.processes;
    let strangers: Vec<String> = processes
        .iter()
        .filter_map(|holder| intrusion(holder, bridge))
        .chain(
            holders
                .of_port
                .is_console
                .then(|| "is a console of the kernel".to_owned()),
        )
        .collect();
    if !strangers.is_empty() {
        return Finding::error(
            "port-in-use",
            format!("{path} {}", strangers.join(", ")),
            "end what uses it, or name another port in `serial.port`: the bridge leaves a port alone that another process uses, and opens it when it is free",
        );
    }
    let mut text = format!("{path} is a serial port that this user may open");
    for holder in processes {
        let part = match Some(holder.pid) == bridge {
            true => format!("; the bridge (process {}) has it open", holder.pid),
            false => format!("; its other end is in {}", named(holder)),
        };
        text += &part;
    }
    if processes.is_empty() && holders.of_port.hidden > 0 {
        text += "; whether another user has it open cannot be known";
    }
    Finding::note("port-right", text)
}

/// The longest time for which an adapter keeps bytes back that is as short as it can be, ms.
const SHORTEST_TIMER_MS: u32 = 1;

/// Adds for how long the adapter keeps bytes back, and what would be gained.
fn with_timer(
    finding: Finding,
    adapter: &Adapter,
    port: &PortFacts,
    bridge: Option<u32>,
) -> Finding {
    let Finding { id, text, .. } = finding;
    let text = format!("{text}; its adapter (`{}`)", adapter.driver);
    let Some(ms) = adapter.latency_ms else {
        return Finding::note(id, format!("{text} has no timer that could be set"));
    };
    let text = format!("{text} keeps bytes back for at most {ms} ms");
    if ms <= SHORTEST_TIMER_MS {
        return Finding::note(id, text);
    }
    let is_open = |holders: &PortHolders| {
        let mut of_port = holders.of_port.processes.iter();
        of_port.any(|holder| Some(holder.pid) == bridge)
    };
    if port.low_latency && !port.holders.as_ref().is_ok_and(is_open) {
        let text = format!("{text}, and for {SHORTEST_TIMER_MS} ms when the bridge has it open");
        return Finding::note(id, text);
    }
    let gain = ms - SHORTEST_TIMER_MS;
    Finding::note(id, format!("{text}: telemetry is up to {gain} ms older, and acknowledgements later, than with {SHORTEST_TIMER_MS} ms")).with_next_step(
        "set `low_latency = true` in `[serial]` of bridge.toml and restart the bridge, or let the udev rule set `latency_timer`",
    )
}

/// What a process does with the port that the live bridge does not like; `None` if it may.
fn intrusion(holder: &Holder, bridge: Option<u32>) -> Option<String> {
    match holder.hold {
        Hold::Controlling => Some(format!("is the terminal of {}", named(holder))),
        _ if Some(holder.pid) == bridge => None,
        Hold::Open => Some(format!("is open in {}", named(holder))),
        Hold::Locked => Some(format!("is locked by {}", named(holder))),
        Hold::OtherEnd => None,
    }
}

fn named(holder: &Holder) -> String {
    format!("`{}` (process {})", holder.program, holder.pid)
}

#[cfg(test)]
mod tests {
    use bridge::shell::serial::holders::Holders;

    use super::*;
    use operator::robot::domain::Trouble;

    const BRIDGE: Option<u32> = Some(7);

    fn holder(pid: u32, program: &str) -> Holder {
        Holder {
            pid,
            program: program.to_owned(),
            hold: match program {
                "dsp-sim" => Hold::OtherEnd,
                "bash" => Hold::Controlling,
                "other user's" => Hold::Locked,
                _ => Hold::Open,
            },
            leads_session: false,
        }
    }

    fn port(device: Device, processes: &[Holder]) -> PortFacts {
        let of_port = Holders {
            processes: processes.to_vec(),
            ..Holders::default()
        };
        PortFacts {
            path: "/dev/ttyUSB0".into(),
            is_chosen: true,
            low_latency: true,
            device: Ok(device),
            holders: Ok(PortHolders {
                of_port,
                ..PortHolders::default()
            }),
        }
    }

    /// A port about which this is known, and nothing else.
    fn free_port(of_port: Holders) -> PortFacts {
        PortFacts {
            holders: Ok(PortHolders {
                of_port,
                ..PortHolders::default()
            }),
            ..port(FREE, &[])
        }
    }

    const FREE: Device = Device::Terminal {
        forbidden: None,
        adapter: None,
    };

    #[test]
    fn each_state_of_the_port() {
        let forbidden = Device::Terminal {
            forbidden: Some("join the group `dialout`".to_owned()),
            adapter: None,
        };
        let bridge = holder(7, "ril");
        let hidden = free_port(Holders {
            hidden: 3,
            ..Holders::default()
        });
        let console = free_port(Holders {
            is_console: true,
            ..Holders::default()
        });
        let unclear = PortFacts {
            holders: Err(Trouble::Failed("no /proc".to_owned())),
            ..port(FREE, &[])
        };
        #[rustfmt::skip]
        let cases = [
            (port(Device::Missing, &[]), "port-missing", "does not exist", "plugged in"),
            (port(Device::Stale, &[]), "port-stale", "simulator that has ended", "ril run sim --link"),
            (port(Device::Other("a folder"), &[]), "port-not-a-terminal", "is a folder", "/dev/ttyUSB0"),
            (port(forbidden, &[]), "port-forbidden", "may not be opened", "`dialout`"),
            (port(FREE, &[]), "port-right", "may open", ""),
            (port(FREE, std::slice::from_ref(&bridge)), "port-right", "the bridge (process 7) has it open", ""),
            (port(FREE, &[holder(8, "dsp-sim")]), "port-right", "other end is in `dsp-sim`", ""),
            (port(FREE, &[bridge, holder(9, "minicom")]), "port-in-use", "is open in `minicom` (process 9)", "end what uses it"),
            (
                port(FREE, &[holder(8, "dsp-sim"), holder(9, "bash")]),
                "port-in-use",
                "is the terminal of `bash` (process 9)",
                "another port",
            ),
            (port(FREE, &[holder(9, "other user's")]), "port-in-use", "is locked by", "end what uses it"),
            (console, "port-in-use", "console of the kernel", "another port"),
            (hidden, "port-right", "cannot be known", ""),
            (unclear, "port-right", "failed: no /proc", ""),
        ];
        for (facts, id, text, next_step) in cases {
            let finding = diagnose(&facts, BRIDGE);
            assert_eq!(finding.id, id, "{finding:?}");
            assert!(finding.text.contains(text), "{finding:?}");
            let is_note = next_step.is_empty();
            assert_eq!(finding.severity == Severity::Note, is_note, "{finding:?}");
            assert!(finding.next_step.unwrap_or_default().contains(next_step));
        }
    }

    #[test]
    fn what_an_adapter_keeps_back_is_said_with_what_there_is_to_gain() {
        let bridge = [holder(7, "ril")];
        for (latency_ms, holders, low_latency, text, is_to_gain) in [
            (None, &bridge[..], true, "(`cp210x`) has no timer", false),
            (Some(1), &bridge, true, "for at most 1 ms", false),
            (
                Some(16),
                &[],
                true,
                "at most 16 ms, and for 1 ms when the bridge",
                false,
            ),
            (Some(16), &bridge, true, "up to 15 ms older", true),
            (Some(16), &[], false, "up to 15 ms older", true),
        ] {
            let device = Device::Terminal {
                forbidden: None,
                adapter: Some(Adapter {
                    driver: "cp210x".to_owned(),
                    latency_ms,
                }),
            };
            let facts = PortFacts {
                low_latency,
                ..port(device, holders)
            };
            let finding = diagnose(&facts, BRIDGE);
            assert_eq!(
                (finding.severity, finding.id),
                (Severity::Note, "port-right")
            );
            assert!(finding.text.contains(text), "{finding:?}");
            assert_eq!(finding.next_step.is_some(), is_to_gain, "{finding:?}");
        }
    }

    #[test]
    fn a_default_that_was_not_chosen_is_not_missed() {
        let facts = PortFacts {
            is_chosen: false,
            ..port(Device::Missing, &[])
        };
        let finding = diagnose(&facts, None);
        assert_eq!(
            (finding.severity, finding.id),
            (Severity::Note, "port-missing")
        );
        assert!(finding.text.contains("built-in default"), "{finding:?}");
    }

    #[test]
    fn a_port_of_a_bridge_in_another_pid_namespace_is_not_judged_from_here() {
        let finding = diagnose(&port(FREE, &[holder(7, "ril")]), None);
        assert_eq!(
            (finding.severity, finding.id),
            (Severity::Error, "port-in-use")
        );
        let finding = of_a_bridge_elsewhere(finding);
        assert_eq!(
            (finding.severity, finding.id),
            (Severity::Note, "port-in-use")
        );
        let finding = diagnose(&port(FREE, &[]), None);
        assert_eq!(of_a_bridge_elsewhere(finding.clone()), finding);
    }

    #[test]
    fn a_bridge_at_another_port_is_not_reproached_with_this_one() {
        let mut facts = port(Device::Missing, &[]);
        facts.holders = Ok(PortHolders {
            by_bridge: vec!["/dev/pts/3".into()],
            ..PortHolders::default()
        });
        let finding = diagnose(&facts, BRIDGE);
        assert_eq!(finding.severity, Severity::Note);
        assert!(
            finding
                .text
                .contains("has /dev/pts/3 open, not /dev/ttyUSB0")
        );
        assert_eq!(diagnose(&facts, None).id, "port-missing");
        // The built-in port is no configuration.
        facts.is_chosen = false;
        let finding = diagnose(&facts, BRIDGE);
        assert!(
            finding.text.ends_with("has /dev/pts/3 open"),
            "{}",
            finding.text
        );
    }
}
