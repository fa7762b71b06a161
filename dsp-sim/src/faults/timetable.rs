//! Which events of a script come next.

use std::time::Duration;

use super::script::{Fault, Happening, Times};

/// Something that happens at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    /// To the DSP or the helicopter.
    Happens(Happening),
    /// The port goes for a time.
    HangUp {
        /// For how long.
        length: Duration,
        /// Whether it comes back as another device.
        elsewhere: bool,
    },
}

/// All events of a script.
#[derive(Clone, Debug, Default)]
pub(super) struct Timetable {
    entries: Vec<TimetableEntry>,
    /// The earliest moment of all entries: it is asked for at every step.
    next: Option<Duration>,
}

#[derive(Clone, Debug)]
struct TimetableEntry {
    times: Times,
    next: Option<Duration>,
    event: Event,
}

impl Timetable {
    /// The events among `faults`.
    pub(super) fn new(faults: &[Fault]) -> Timetable {
        let events = faults.iter().filter_map(|fault| match *fault {
            Fault::Dsp { times, event } => Some((times, Event::Happens(Happening::Dsp(event)))),
            Fault::Helicopter { times, event } => {
                Some((times, Event::Happens(Happening::Helicopter(event))))
            }
            Fault::HangUp {
                times,
                length,
                elsewhere,
            } => Some((times, Event::HangUp { length, elsewhere })),
            Fault::Bytes { .. } | Fault::Messages { .. } => None,
        });
        let entries = events.map(|(times, event)| TimetableEntry {
            times,
            next: Some(times.first()),
            event,
        });
        let mut timetable = Timetable {
            entries: entries.collect(),
            next: None,
        };
        timetable.look_ahead();
        timetable
    }

    /// When the next event is due.
    pub(super) fn next_deadline(&self) -> Option<Duration> {
        self.next
    }

    /// Takes out the earliest event that is due by `now`, and its moment; of those of one moment the first of the
    /// script.
    pub(super) fn take(&mut self, now: Duration) -> Option<(Duration, Event)> {
        let due = self.next.filter(|due| *due <= now)?;
        let mut entries = self.entries.iter_mut();
        let entry = entries.find(|entry| entry.next == Some(due))?;
        entry.next = entry.times.after(due);
        let event = entry.event;
        self.look_ahead();
        Some((due, event))
    }

    fn look_ahead(&mut self) {
        self.next = self.entries.iter().filter_map(|entry| entry.next).min();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::DspEvent;

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn events_come_in_their_order_and_again() {
        let reboot = |times| Fault::Dsp {
            times,
            event: DspEvent::Reboot,
        };
        let stop = |times| Fault::Dsp {
            times,
            event: DspEvent::StopStatus,
        };
        let mut timetable = Timetable::new(&[
            reboot(Times::every(ms(20), ms(20))),
            stop(Times::once(ms(30))),
            stop(Times::every(ms(10), ms(30))),
        ]);
        assert_eq!(timetable.next_deadline(), Some(ms(10)));
        assert_eq!(timetable.take(ms(9)), None);
        let events = std::iter::from_fn(|| timetable.take(ms(60)));
        let events: Vec<(u128, bool)> = events
            .map(|(at, event)| {
                (
                    at.as_millis(),
                    event == Event::Happens(Happening::Dsp(DspEvent::Reboot)),
                )
            })
            .collect();
        let expected = [
            (10, false),
            (20, true),
            (30, false),
            (40, true),
            (40, false),
            (60, true),
        ];
        assert_eq!(events, expected);
        assert_eq!(timetable.next_deadline(), Some(ms(70)));
    }

    #[test]
    fn a_script_without_events_has_no_deadline() {
        let mut timetable = Timetable::new(&[]);
        assert_eq!(timetable.next_deadline(), None);
        assert_eq!(timetable.take(Duration::MAX), None);
    }
}
