//! [`Alarms`]: what is wrong now. Each alarm is told once when it begins and once when it is over; one that comes and goes is told
//! once as well.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::changes::Weight;

/// An alarm that is over for less than this and comes back is the same one: it is not told again. Several seconds, so that a link
/// which loses every other message does not fill the journal.
pub const SETTLE: Duration = Duration::from_secs(5);

/// Most alarms at a time: there are fewer kinds, but for DSP errors, of which there are 65,536. Further ones are not shown.
const MAX_ALARMS: usize = 32;

/// What an alarm is about. Amounts are not part of it: they change while it lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The bridge's process is gone.
    BridgeGone,
    /// The bridge lives and says nothing.
    BridgeSilent,
    /// The link to the DSP is not up.
    DspLink,
    /// The relay's link to the robot is not up.
    RelayLink,
    /// Telemetry is old.
    Telemetry,
    /// A rule of flight safety is violated, by its number.
    Safety(u32),
    /// No GPS fix in flight.
    NoFix,
    /// The DSP reported an error with this code.
    DspError(u32),
    /// The module was blocked by an error with this number.
    Blocked(u32),
    /// The process status is gone.
    StatusGone,
}

/// What is wrong at the moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What it is about.
    pub kind: Kind,
    /// Warning or alarm.
    pub weight: Weight,
    /// In words.
    pub text: String,
}

/// An alarm that lasts, or was over a short while ago.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// What it is about.
    pub kind: Kind,
    /// Warning or alarm.
    pub weight: Weight,
    /// In words, with the present amount.
    pub text: String,
    /// When it began.
    pub since: MonotonicNs,
    /// Since when it is over, if it is.
    ended: Option<MonotonicNs>,
}

/// What is to be told.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// An alarm has begun.
    Began(Alarm),
    /// An alarm is over.
    Ended(Alarm),
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Alarms {
    alarms: Vec<Alarm>,
}

impl Alarms {
    /// Takes all that is wrong at `now`, and says what is to be told.
    pub fn update(&mut self, findings: Vec<Finding>, now: MonotonicNs) -> Vec<Change> {
        let mut changes = Vec::new();
        for alarm in &mut self.alarms {
            let lasts = findings.iter().any(|finding| finding.kind == alarm.kind);
            match (lasts, alarm.ended) {
                (true, _) => alarm.ended = None,
                (false, None) => alarm.ended = Some(now),
                (false, Some(_)) => {}
            }
        }
        self.alarms.retain(|alarm| {
            let is_over = alarm.ended.is_some_and(|ended| now.since(ended) >= SETTLE);
            if is_over {
                changes.push(Change::Ended(alarm.clone()));
            }
            !is_over
        });
        for finding in findings {
            let is_full = self.alarms.len() >= MAX_ALARMS;
            let known = self
                .alarms
                .iter_mut()
                .find(|alarm| alarm.kind == finding.kind);
            match known {
                Some(alarm) => {
                    alarm.text = finding.text;
                    alarm.weight = finding.weight;
                }
                None if !is_full => {
                    let alarm = Alarm {
                        kind: finding.kind,
                        weight: finding.weight,
                        text: finding.text,
                        since: now,
                        ended: None,
                    };
                    changes.push(Change::Began(alarm.clone()));
                    self.alarms.push(alarm);
                }
                None => {}
            }
        }
        self.alarms.sort_by_key(|alarm| {
            (
                std::cmp::Reverse(alarm.weight),
                alarm.ended.is_some(),
                alarm.kind,
            )
        });
        changes
    }

    /// The alarms that last, the worst first.
    pub fn lasting(&self) -> impl Iterator<Item = &Alarm> {
        self.alarms.iter().filter(|alarm| alarm.ended.is_none())
    }

    /// When an alarm is over for good if nothing changes.
    pub fn next(&self) -> Option<MonotonicNs> {
        let ends = self.alarms.iter().filter_map(|alarm| alarm.ended);
        ends.map(|ended| ended + SETTLE).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn finding(kind: Kind, text: &str) -> Finding {
        Finding {
            kind,
            weight: Weight::Alarm,
            text: text.to_owned(),
        }
    }

    fn link() -> Vec<Finding> {
        vec![finding(Kind::DspLink, "silent")]
    }

    #[test]
    fn an_alarm_is_told_when_it_begins_and_when_it_is_over() {
        let mut alarms = Alarms::default();
        let changes = alarms.update(link(), at(0));
        assert!(matches!(&changes[..], [Change::Began(alarm)] if alarm.since == at(0)));
        assert!(alarms.update(link(), at(100)).is_empty());
        assert!(alarms.update(vec![], at(200)).is_empty());
        assert_eq!(alarms.lasting().count(), 0, "it is not shown any more");
        assert_eq!(alarms.next(), Some(at(5200)));
        let changes = alarms.update(vec![], at(5200));
        assert!(matches!(&changes[..], [Change::Ended(alarm)] if alarm.kind == Kind::DspLink));
        assert_eq!(alarms.next(), None);
    }

    #[test]
    fn an_alarm_that_comes_and_goes_is_told_once() {
        let mut alarms = Alarms::default();
        let mut told = 0;
        for second in 0..60 {
            let findings = if second % 2 == 0 { link() } else { vec![] };
            told += alarms.update(findings, at(second * 1000)).len();
        }
        assert_eq!(told, 1);
    }

    #[test]
    fn an_amount_that_changes_is_shown_and_is_no_other_alarm() {
        let mut alarms = Alarms::default();
        let battery = |text| vec![finding(Kind::Safety(6), text)];
        alarms.update(battery("by 0.3 V"), at(0));
        assert!(alarms.update(battery("by 0.4 V"), at(1)).is_empty());
        assert_eq!(alarms.lasting().next().unwrap().text, "by 0.4 V");
    }

    #[test]
    fn the_worst_comes_first_and_a_flood_is_bounded() {
        let mut alarms = Alarms::default();
        let mut flood: Vec<Finding> = (0..1000)
            .map(|code| finding(Kind::DspError(code), ""))
            .collect();
        flood.insert(
            0,
            Finding {
                weight: Weight::Warning,
                ..finding(Kind::StatusGone, "")
            },
        );
        flood.insert(1, finding(Kind::BridgeGone, ""));
        assert_eq!(alarms.update(flood, at(0)).len(), MAX_ALARMS);
        let kinds: Vec<Kind> = alarms.lasting().map(|alarm| alarm.kind).collect();
        assert_eq!(
            (kinds[0], kinds[MAX_ALARMS - 1]),
            (Kind::BridgeGone, Kind::StatusGone)
        );
    }
}
