//! [`EventLog`]: what happened in a flight, bounded: of each kind at most [`MAX_OF_A_KIND`] events are kept, so that no
//! kind crowds out another, and the others are counted. What repeats within some seconds is one event.

use operator::robot::geo::Place;
use view::page::Weight;
use view::report::flight::Event;

/// Most events of a kind: more than a person reads.
pub const MAX_OF_A_KIND: usize = 50;

/// An event that comes again within this time after the last one of its kind is the same one, s.
const SETTLE_S: f64 = 5.0;

/// What an event is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoggedEventKind {
    /// Take-off or landing.
    Flying,
    /// Samples that are missing; amounts are added.
    Lost,
    /// A time without samples.
    Gap,
    /// The bridge began anew.
    Restart,
    /// The DSP booted.
    Boot,
    /// An error of the DSP; amounts are added.
    DspError,
    /// The pilot's switch.
    Switch,
    /// The GPS fix.
    Fix,
    /// The link to the DSP.
    Link,
    /// A rule of flight safety.
    Safety,
    /// The module.
    Module,
    /// A process said so in its log.
    Process,
    /// The recording itself.
    Recording,
}

impl LoggedEventKind {
    /// Whether an event that comes again soon is the same one.
    fn is_joined(self) -> bool {
        matches!(
            self,
            LoggedEventKind::Lost
                | LoggedEventKind::DspError
                | LoggedEventKind::Process
                | LoggedEventKind::Recording
        )
    }
}

/// Something that happened, and where.
#[derive(Clone, Debug, PartialEq)]
struct LoggedEvent {
    kind: LoggedEventKind,
    at_s: f64,
    until_s: f64,
    weight: Weight,
    /// How many, for kinds whose amounts are added.
    amount: u64,
    text: String,
    place: Option<Place>,
}

/// What happened in a flight: at most [`MAX_OF_A_KIND`] events of each kind; the others are counted.
#[derive(Clone, Debug, Default)]
pub struct EventLog {
    all: Vec<LoggedEvent>,
    left_out: u64,
}

impl EventLog {
    /// Something happened once.
    pub fn add(
        &mut self,
        kind: LoggedEventKind,
        at_s: f64,
        weight: Weight,
        text: impl Into<String>,
        place: Option<Place>,
    ) {
        self.count(kind, at_s, weight, 1, text, place);
    }

    /// Something happened `amount` times; `text` says what, without the number.
    pub fn count(
        &mut self,
        kind: LoggedEventKind,
        at_s: f64,
        weight: Weight,
        amount: u64,
        text: impl Into<String>,
        place: Option<Place>,
    ) {
        let text = text.into();
        let last = self.all.iter_mut().rev().find(|entry| entry.kind == kind);
        if let Some(last) = last
            && kind.is_joined()
            && last.text == text
            && at_s - last.until_s <= SETTLE_S
        {
            last.until_s = at_s;
            last.amount = last.amount.saturating_add(amount);
            return;
        }
        let of_kind = self.all.iter().filter(|entry| entry.kind == kind);
        if of_kind.count() >= MAX_OF_A_KIND {
            self.left_out += 1;
            return;
        }
        self.all.push(LoggedEvent {
            kind,
            at_s,
            until_s: at_s,
            weight,
            amount,
            text,
            place,
        });
    }

    /// The events in the order of time, and how many were left out.
    pub fn finish(mut self) -> (Vec<Event>, u64) {
        self.all
            .sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        let event = |entry: LoggedEvent| Event {
            at_s: entry.at_s,
            weight: entry.weight,
            text: entry.words(),
            place: entry.place.map(Place::degrees),
        };
        (self.all.into_iter().map(event).collect(), self.left_out)
    }
}

impl LoggedEvent {
    fn words(&self) -> String {
        let text = &self.text;
        let lasted_s = self.until_s - self.at_s;
        let within = if lasted_s >= 0.1 {
            format!(" within {lasted_s:.1} s")
        } else {
            String::new()
        };
        match (self.kind, self.amount) {
            (LoggedEventKind::Lost, 1) => "1 sample was lost".to_owned(),
            (LoggedEventKind::Lost, amount) => format!("{amount} samples were lost{within}"),
            (_, 1) => text.clone(),
            (_, amount) => format!("{text}, {amount} times{within}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_repeats_soon_is_one_event_and_amounts_are_added() {
        let mut event_log = EventLog::default();
        for (at_s, amount) in [(1.0, 2), (3.5, 1), (20.0, 1)] {
            event_log.count(
                LoggedEventKind::Lost,
                at_s,
                Weight::Warning,
                amount,
                "",
                None,
            );
        }
        event_log.add(LoggedEventKind::Flying, 2.0, Weight::Note, "took off", None);
        let (events, left_out) = event_log.finish();
        let texts: Vec<&str> = events.iter().map(|event| event.text.as_str()).collect();
        assert_eq!(
            texts,
            [
                "3 samples were lost within 2.5 s",
                "took off",
                "1 sample was lost"
            ]
        );
        assert_eq!(left_out, 0);
    }

    #[test]
    fn a_flood_of_one_kind_is_bounded_and_crowds_out_no_other() {
        let mut event_log = EventLog::default();
        for index in 0..10_000 {
            event_log.add(
                LoggedEventKind::Switch,
                f64::from(index),
                Weight::Note,
                index.to_string(),
                None,
            );
        }
        event_log.add(
            LoggedEventKind::Flying,
            10_000.0,
            Weight::Note,
            "landed",
            None,
        );
        let (events, left_out) = event_log.finish();
        assert_eq!(events.len(), MAX_OF_A_KIND + 1);
        assert_eq!(left_out, 10_000 - MAX_OF_A_KIND as u64);
        assert_eq!(events[MAX_OF_A_KIND].text, "landed");
    }
}
