//! What the `[realtime]` of bridge and status means on this machine, in findings: what is asked for, and what of it is
//! lacking. Pure, as [`diagnosis`](super::diagnosis) is.

use runtime::finding::Finding;
use runtime::realtime::RealtimeConfig;
use runtime::realtime::lack::Lack;

use super::facts::{LoopFacts, RealtimeFacts, UnitLimits};

/// How to set the units right.
const DROP_IN: &str =
    "install the drop-in /usr/share/doc/ril/examples/realtime.conf (docs/install.md, Real time)";

/// Nothing if no process asks for anything.
pub fn diagnose(facts: &RealtimeFacts) -> Vec<Finding> {
    let mut findings: Vec<Finding> = facts.loops.iter().flat_map(of_loop).collect();
    if facts.loops.iter().any(|it| it.asked.priority > 0) {
        findings.extend(throttle(facts.runtime_us));
    }
    let asks_latency = facts.loops.iter().any(|it| it.asked.low_latency_processor);
    if let Some(why) = facts.latency_fault.as_ref().filter(|_| asks_latency) {
        findings.push(Finding::warning(
            "realtime-latency",
            format!(
                "processors sleep in flight, unless the process may do more than this user: {why}"
            ),
            "give the device to the group `hero` by a udev rule (docs/install.md, Real time)",
        ));
    }
    findings
}

fn of_loop(facts: &LoopFacts) -> Vec<Finding> {
    let LoopFacts {
        command,
        asked,
        process,
        lacking,
        unit,
    } = facts;
    if !asked.is_of_loop() {
        return Vec::new();
    }
    let who = match process {
        Some(process) => format!("{command} (process {process})"),
        None => format!("`ril run {command}`, started from here"),
    };
    let finding = |lack: &Lack| {
        let text = format!("{who}: {lack}");
        Finding::warning("realtime-lacking", text, lack.next_step())
    };
    // Where the unit starts it, the limits of this shell say nothing; processors are the same for both.
    if let Some(unit) = unit.as_ref().filter(|_| process.is_none()) {
        let short = unit.lacking(asked).join(", ");
        let of_unit = match short.is_empty() {
            true => Finding::note(
                "realtime-right",
                format!("the unit ril-{command}@ has the limits that `ril run {command}` needs"),
            ),
            false => {
                let text = format!("the unit ril-{command}@ has {short}");
                Finding::warning("realtime-unit", text, DROP_IN)
            }
        };
        let lacking = lacking.iter().flatten();
        let of_both = lacking.filter(|lack| matches!(lack, Lack::Processors { .. }));
        return std::iter::once(of_unit)
            .chain(of_both.map(finding))
            .collect();
    }
    match lacking {
        Ok(lacking) if lacking.is_empty() => {
            let text = format!("{who} has what it asks for in `[realtime]`");
            vec![Finding::note("realtime-right", text)]
        }
        Ok(lacking) => lacking.iter().map(finding).collect(),
        Err(trouble) => vec![Finding::warning(
            "realtime-unclear",
            format!("looking what {who} has {trouble}"),
            "`chrt -p PROCESS` and `grep VmLck /proc/PROCESS/status` show it",
        )],
    }
}

/// How much of the time real-time threads may run, µs of each second.
fn throttle(runtime_us: Option<i64>) -> Option<Finding> {
    const FILE: &str = "/proc/sys/kernel/sched_rt_runtime_us";
    match runtime_us? {
        0 => Some(Finding::warning(
            "realtime-throttled",
            format!("{FILE} is 0: real-time threads do not run"),
            "`sudo sysctl kernel.sched_rt_runtime_us=950000`, the kernel's own value",
        )),
        ..0 => Some(Finding::note(
            "realtime-unthrottled",
            format!(
                "{FILE} is -1: a real-time thread that never sleeps keeps a processor for ever"
            ),
        )),
        _ => None,
    }
}

impl UnitLimits {
    /// What a unit's file and its drop-ins say, in the order in which systemd reads them: the last word counts.
    pub fn read(texts: &[String]) -> UnitLimits {
        let value = |key: &str| {
            let lines = texts.iter().flat_map(|text| text.lines());
            let mut values = lines.filter_map(|line| {
                line.trim()
                    .strip_prefix(key)?
                    .trim_start()
                    .strip_prefix('=')
            });
            values.next_back().map(|value| value.trim().to_owned())
        };
        let no_limit = |value: &String| value == "infinity";
        let is_yes = |value: String| ["yes", "true", "on", "1"].contains(&&*value);
        let allows = |line: &str| line.trim().starts_with("DeviceAllow=/dev/cpu_dma_latency");
        let is_open = value("DevicePolicy").is_none_or(|policy| policy == "auto")
            || texts.iter().flat_map(|text| text.lines()).any(allows);
        let realtime = value("RestrictRealtime");
        let priority = value("LimitRTPRIO");
        UnitLimits {
            restricts_realtime: realtime.is_some_and(is_yes),
            has_latency_device: is_open && !value("PrivateDevices").is_some_and(is_yes),
            priority: priority.map_or(0, |it| match no_limit(&it) {
                true => u64::MAX,
                // Of `soft:hard` the first counts.
                false => it
                    .split(':')
                    .next()
                    .and_then(|it| it.parse().ok())
                    .unwrap_or(0),
            }),
            locks_memory: value("LimitMEMLOCK").is_some_and(|it| no_limit(&it)),
        }
    }

    fn lacking(&self, asked: &RealtimeConfig) -> Vec<String> {
        let priority = asked.priority;
        let restricts = priority > 0 && self.restricts_realtime;
        let is_low = self.priority < u64::from(priority);
        [
            restricts.then(|| "`RestrictRealtime=yes`".to_owned()),
            is_low.then(|| {
                format!(
                    "`LimitRTPRIO` at {}, and {priority} is asked for",
                    self.priority
                )
            }),
            (asked.lock_memory && !self.locks_memory)
                .then(|| "no `LimitMEMLOCK=infinity`".to_owned()),
            (asked.low_latency_processor && !self.has_latency_device)
                .then(|| "no /dev/cpu_dma_latency (`PrivateDevices=`, `DeviceAllow=`)".to_owned()),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::slice;
    use std::time::Duration;

    use operator::robot::domain::Trouble;
    use runtime::finding::Severity;

    use super::*;

    fn bridge() -> LoopFacts {
        LoopFacts {
            command: "bridge",
            asked: RealtimeConfig {
                lock_memory: true,
                priority: 30,
                low_latency_processor: true,
                ..RealtimeConfig::default()
            },
            process: None,
            lacking: Ok(Vec::new()),
            unit: None,
        }
    }

    fn facts(of_bridge: LoopFacts) -> RealtimeFacts {
        RealtimeFacts {
            loops: vec![of_bridge],
            runtime_us: Some(950_000),
            latency_fault: None,
        }
    }

    #[test]
    fn what_is_lacking_is_a_warning_of_its_own_with_what_to_do() {
        let limit = Lack::PriorityLimit {
            asked: 30,
            limit: 0,
        };
        let processors = Lack::Processors {
            missing: vec![9],
            left: vec![0, 1],
        };
        let low = UnitLimits {
            restricts_realtime: true,
            ..UnitLimits::default()
        };
        let right = UnitLimits {
            restricts_realtime: false,
            priority: 30,
            locks_memory: true,
            has_latency_device: true,
        };
        type Change<'a> = &'a dyn Fn(&mut RealtimeFacts);
        let given_up = || Err(Trouble::TookTooLong(Duration::from_secs(5)));
        #[rustfmt::skip]
        let cases: [(Change<'_>, &[(&str, &str)]); 11] = [
            (&|it| it.loops.clear(), &[]),
            (&|_| {}, &[("realtime-right", "`ril run bridge`, started from here has what it asks for in `[realtime]`")]),
            (&|it| it.loops[0].process = Some(7), &[("realtime-right", "bridge (process 7) has what it asks for in `[realtime]`")]),
            (&|it| it.loops[0].lacking = Ok(vec![limit.clone(), Lack::Memory]), &[
                ("realtime-lacking", "`ril run bridge`, started from here: the loop has no priority 30: the limit `rtprio` is 0"),
                ("realtime-lacking", "`ril run bridge`, started from here: no memory is locked, and no limit forbids it"),
            ]),
            (&|it| it.loops[0].lacking = given_up(), &[("realtime-unclear", "looking what `ril run bridge`, started from here has was given up after 5s")]),
            (&|it| (it.loops[0].unit, it.loops[0].lacking) = (Some(right), Ok(vec![limit.clone(), processors.clone()])), &[
                ("realtime-right", "the unit ril-bridge@ has the limits that `ril run bridge` needs"),
                ("realtime-lacking", "`ril run bridge`, started from here: the loop does not get the processors 9 for itself; it runs on 0, 1"),
            ]),
            (&|it| it.loops[0].unit = Some(low),
                &[("realtime-unit", "the unit ril-bridge@ has `RestrictRealtime=yes`, `LimitRTPRIO` at 0, and 30 is asked for, no `LimitMEMLOCK=infinity`, no /dev/cpu_dma_latency (`PrivateDevices=`, `DeviceAllow=`)")]),
            // What a live process has counts, whatever started it.
            (&|it| (it.loops[0].unit, it.loops[0].process) = (Some(low), Some(7)), &[("realtime-right", "bridge (process 7) has what it asks for in `[realtime]`")]),
            (&|it| it.runtime_us = Some(0), &[
                ("realtime-right", "`ril run bridge`, started from here has what it asks for in `[realtime]`"),
                ("realtime-throttled", "/proc/sys/kernel/sched_rt_runtime_us is 0: real-time threads do not run"),
            ]),
            (&|it| it.runtime_us = Some(-1), &[
                ("realtime-right", "`ril run bridge`, started from here has what it asks for in `[realtime]`"),
                ("realtime-unthrottled", "/proc/sys/kernel/sched_rt_runtime_us is -1: a real-time thread that never sleeps keeps a processor for ever"),
            ]),
            (&|it| it.latency_fault = Some("it is not there".to_owned()), &[
                ("realtime-right", "`ril run bridge`, started from here has what it asks for in `[realtime]`"),
                ("realtime-latency", "processors sleep in flight, unless the process may do more than this user: it is not there"),
            ]),
        ];
        for (change, expected) in cases {
            let mut facts = facts(bridge());
            change(&mut facts);
            let findings = diagnose(&facts);
            let said: Vec<_> = findings
                .iter()
                .map(|it| (it.id, it.text.as_str()))
                .collect();
            assert_eq!(said, expected);
            for finding in &findings {
                assert_eq!(
                    finding.next_step.is_some(),
                    finding.severity > Severity::Note,
                    "{finding:?}"
                );
            }
        }
    }

    #[test]
    fn the_last_word_of_a_unit_and_its_drop_ins_counts() {
        let unit = include_str!("../../../../package/systemd/ril-bridge@.service").to_owned();
        let of_status = include_str!("../../../../package/systemd/ril-status@.service").to_owned();
        let drop_in = include_str!("../../../../package/systemd/realtime.conf").to_owned();
        let asked = bridge().asked;
        let lacking = |texts: &[String]| UnitLimits::read(texts).lacking(&asked).len();
        assert_eq!(lacking(slice::from_ref(&unit)), 4);
        assert_eq!(lacking(&[unit.clone(), drop_in.clone()]), 0);
        // The device is for the bridge alone.
        assert_eq!(lacking(&[of_status, drop_in.clone()]), 1);
        let low = "[Service]\nLimitRTPRIO = 10:40".to_owned();
        assert_eq!(lacking(&[unit, drop_in, low]), 1);
        let highest = RealtimeConfig {
            priority: 99,
            ..RealtimeConfig::default()
        };
        let unit = UnitLimits::read(&["LimitRTPRIO=infinity".to_owned()]);
        assert_eq!(unit.lacking(&highest).len(), 0);
    }
}
