//! [`States`]: which state held from when to when, bounded.

use flight_report::flight::{Ink, Span};

/// Most spans. A flight has some dozens; a state that flutters is shown as changing from there on.
pub const MAX_SPANS: usize = 500;

/// What is shown when a state has changed too often.
const CHANGING: &str = "changing often";

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct States {
    spans: Vec<Span>,
    /// Whether the last span goes on.
    is_open: bool,
}

impl States {
    /// The state at a time.
    pub fn set(&mut self, at_s: f64, name: &str, ink: Ink) {
        let is_full = self.spans.len() >= MAX_SPANS;
        let (name, ink) = match is_full {
            true => (CHANGING, Ink::Grey),
            false => (name, ink),
        };
        if let Some(last) = self.spans.last_mut()
            && self.is_open
        {
            last.to_s = last.to_s.max(at_s);
            if last.name == name {
                return;
            }
        }
        let name = name.to_owned();
        let span = Span {
            from_s: at_s,
            to_s: at_s,
            name,
            ink,
        };
        match self.spans.last_mut() {
            Some(last) if is_full => {
                last.to_s = last.to_s.max(at_s);
                last.name.clone_from(&span.name);
                last.ink = ink;
            }
            _ => self.spans.push(span),
        }
        self.is_open = true;
    }

    /// From the last known time on the state is not known.
    pub fn interrupt(&mut self) {
        self.is_open = false;
    }

    /// The spans, the last of which ends at `end_s` if it goes on.
    pub fn finish(mut self, end_s: f64) -> Vec<Span> {
        if let Some(last) = self.spans.last_mut()
            && self.is_open
        {
            last.to_s = last.to_s.max(end_s);
        }
        self.spans
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_lasts_until_the_next_one_or_until_nothing_is_known() {
        let mut states = States::default();
        for (at_s, name) in [(0.0, "a"), (1.0, "a"), (2.0, "b")] {
            states.set(at_s, name, Ink::Blue);
        }
        states.interrupt();
        states.set(9.0, "b", Ink::Blue);
        let spans = states.finish(10.0);
        let shown: Vec<(f64, f64, &str)> = spans
            .iter()
            .map(|span| (span.from_s, span.to_s, span.name.as_str()))
            .collect();
        assert_eq!(shown, [(0.0, 2.0, "a"), (2.0, 2.0, "b"), (9.0, 10.0, "b")]);
    }

    #[test]
    fn a_state_that_flutters_is_bounded() {
        let mut states = States::default();
        for index in 0..10_000 {
            states.set(f64::from(index), ["a", "b"][index as usize % 2], Ink::Blue);
        }
        let spans = states.finish(10_000.0);
        assert_eq!(spans.len(), MAX_SPANS);
        let last = spans.last().unwrap();
        assert_eq!((last.name.as_str(), last.to_s), (CHANGING, 10_000.0));
    }
}
