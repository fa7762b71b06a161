//! Which messages of the PC are copies of one that has been served (`docs/protocol.md` section 11).
//!
//! Only the extended profile numbers messages; in the classic profile nothing is a copy here.

use dsp_protocol::{Command, Downlink, Frame, Sequence, Uplink};

/// The last command and the last waypoint that were served under a number.
#[derive(Clone, Debug, Default)]
pub struct Copies {
    command: Option<Served>,
    waypoint: Option<Sequence>,
}

#[derive(Clone, Debug)]
struct Served {
    sequence: Sequence,
    /// Its bytes, which differ even where float values are equal, and are equal where a float is not equal to itself.
    bytes: Frame,
    answer: Downlink,
}

impl Copies {
    /// How `command` was answered, if it is a copy of the last one.
    pub fn answer(&self, sequence: Option<Sequence>, command: Command) -> Option<Downlink> {
        let served = self.command.as_ref()?;
        let is_copy = sequence == Some(served.sequence) && bytes_of(command) == served.bytes;
        is_copy.then_some(served.answer)
    }

    /// `command` was executed and answered.
    pub fn executed(&mut self, sequence: Option<Sequence>, command: Command, answer: Downlink) {
        self.command = sequence.map(|sequence| Served {
            sequence,
            bytes: bytes_of(command),
            answer,
        });
    }

    /// The path was invalidated: the next waypoint is none of its copies.
    pub fn forget_waypoint(&mut self) {
        self.waypoint = None;
    }

    /// Whether a waypoint with this number is a copy of the last one that was taken.
    pub fn has_waypoint(&self, sequence: Option<Sequence>) -> bool {
        sequence.is_some() && sequence == self.waypoint
    }

    /// A waypoint with this number was taken. One that was discarded does not count: the PC may send it again.
    pub fn took_waypoint(&mut self, sequence: Option<Sequence>) {
        self.waypoint = sequence;
    }
}

fn bytes_of(command: Command) -> Frame {
    Uplink::Command(command).encode()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANSWER: Downlink = Downlink::Ack { command: 1 };

    fn number(number: u8) -> Option<Sequence> {
        Some(Sequence::new(number))
    }

    fn write(value: f32) -> Command {
        Command::Write32 {
            port: 20_000,
            value,
        }
    }

    #[test]
    fn a_command_is_a_copy_when_number_and_bytes_are_those_of_the_last() {
        let mut copies = Copies::default();
        assert_eq!(copies.answer(number(0), write(1.0)), None);
        copies.executed(number(7), write(f32::NAN), ANSWER);
        for (sequence, command, answer) in [
            (number(7), write(f32::NAN), Some(ANSWER)),
            (number(8), write(f32::NAN), None),
            (number(7), write(1.0), None),
            (number(7), Command::ClearErrors, None),
            (None, write(f32::NAN), None),
        ] {
            assert_eq!(copies.answer(sequence, command), answer, "{command:?}");
        }
        copies.executed(number(8), Command::ClearErrors, ANSWER);
        assert_eq!(copies.answer(number(7), write(f32::NAN)), None);
    }

    #[test]
    fn without_numbers_nothing_is_a_copy() {
        let mut copies = Copies::default();
        copies.executed(None, Command::ClearErrors, ANSWER);
        copies.took_waypoint(None);
        assert_eq!(copies.answer(None, Command::ClearErrors), None);
        assert!(!copies.has_waypoint(None));
    }

    #[test]
    fn a_waypoint_is_a_copy_until_another_is_taken_or_the_path_is_invalidated() {
        let mut copies = Copies::default();
        assert!(!copies.has_waypoint(number(0)));
        copies.took_waypoint(number(3));
        copies.executed(number(3), Command::ClearErrors, ANSWER);
        assert!(copies.has_waypoint(number(3)));
        assert!(!copies.has_waypoint(number(4)));
        copies.took_waypoint(number(4));
        assert!(!copies.has_waypoint(number(3)));
        copies.forget_waypoint();
        assert!(!copies.has_waypoint(number(4)));
    }
}
