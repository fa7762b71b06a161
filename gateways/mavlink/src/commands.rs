//! [`Commands`]: each command is carried out at most once, however often it comes.
//!
//! | a copy comes | it is |
//! |---|---|
//! | of no command that is known | new: carried out; refused while 16 of its sender are known |
//! | while the first one has no answer | open: the answer to come is for it, too |
//! | at most [`MEMORY`] after the answer | answered: the same answer |
//! | later | new |
//!
//! Stations repeat a command that they got no answer for without a mark, so that a copy is one whose sender and whose bits are the same.
//! Hold and land are remembered until they are answered only: a repeated stop is harmless, and a lost one is not.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::stations::StationAddress;
use crate::verdict::CommandAck;

/// How long after the answer a copy gets that answer: MAVSDK sends a command four times in 1.5 s, QGroundControl a mode three times in
/// 2.6 s, and the first copy was before the answer.
pub const MEMORY: Duration = Duration::from_millis(2_500);

/// Most commands of a sender that are known at a time. A further one is refused.
const MAX_COMMANDS: usize = 16;

/// What tells a command from another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandKey {
    pub sender: StationAddress,
    pub command: u16,
    pub bits: [u32; 8],
}

/// What a command is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Copy {
    New,
    Open,
    Answered(CommandAck),
    /// There is no room for it.
    Full,
}

#[derive(Clone, Copy, Debug)]
struct KnownCommand {
    key: CommandKey,
    is_remembered: bool,
    answered: Option<(CommandAck, MonotonicNs)>,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    known: Vec<KnownCommand>,
}

impl Commands {
    /// What this command is. A new one is open from now on; one that `is_stop` is not remembered when it is answered.
    pub fn take(&mut self, key: CommandKey, is_stop: bool, now: MonotonicNs) -> Copy {
        match self.look(key, now) {
            Copy::New => {}
            known => return known,
        }
        let own = self.known.iter().filter(|one| one.key.sender == key.sender);
        if own.count() >= MAX_COMMANDS {
            // The oldest answer makes room for a stop.
            let oldest = self
                .known
                .iter()
                .position(|one| one.key.sender == key.sender && one.answered.is_some());
            match oldest.filter(|_| is_stop) {
                Some(index) => _ = self.known.remove(index),
                None => return Copy::Full,
            }
        }
        self.known.push(KnownCommand {
            key,
            is_remembered: !is_stop,
            answered: None,
        });
        Copy::New
    }

    /// What this command is; a new one stays new.
    pub fn look(&mut self, key: CommandKey, now: MonotonicNs) -> Copy {
        self.known.retain(|one| match one.answered {
            None => true,
            Some((_, moment)) => now.since(moment) < MEMORY,
        });
        match self.known.iter().find(|one| one.key == key) {
            None => Copy::New,
            Some(KnownCommand { answered: None, .. }) => Copy::Open,
            Some(KnownCommand {
                answered: Some((answer, _)),
                ..
            }) => Copy::Answered(*answer),
        }
    }

    /// The answer to a command. Of one that has an answer it is the later one, which copies get.
    pub fn answer(&mut self, key: &CommandKey, answer: CommandAck, now: MonotonicNs) {
        if let Some(index) = self.known.iter().position(|one| one.key == *key) {
            match self.known[index].is_remembered {
                true => self.known[index].answered = Some((answer, now)),
                false => _ = self.known.remove(index),
            }
        }
    }

    /// What an accepted command began has ended otherwise: copies get this answer, for as long as they would have got the first one.
    pub fn amend(&mut self, key: &CommandKey, answer: CommandAck) {
        if let Some(KnownCommand {
            answered: Some((known, _)),
            ..
        }) = self.known.iter_mut().find(|one| one.key == *key)
        {
            *known = answer;
        }
    }

    /// Forgets what a sender that is gone has commanded and was answered.
    pub fn forget(&mut self, sender: StationAddress) {
        self.known
            .retain(|one| one.key.sender != sender || one.answered.is_none());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::MavResult;

    fn key(port: u16, command: u16) -> CommandKey {
        CommandKey {
            sender: StationAddress {
                address: ([127, 0, 0, 1], port).into(),
                system: 255,
                component: 190,
            },
            command,
            bits: [0; 8],
        }
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn a_copy_is_what_the_table_says() {
        let mut commands = Commands::default();
        let (goto, other) = (key(1, 192), key(2, 192));
        let denied = CommandAck::plain(MavResult::Denied);
        assert_eq!(commands.take(goto, false, at(0)), Copy::New);
        assert_eq!(commands.take(goto, false, at(9_000)), Copy::Open);
        assert_eq!(
            commands.take(other, false, at(9_000)),
            Copy::New,
            "another station"
        );
        commands.answer(&goto, denied, at(10_000));
        assert_eq!(
            commands.take(goto, false, at(12_499)),
            Copy::Answered(denied)
        );
        let later = CommandAck::plain(MavResult::Failed);
        commands.answer(&goto, later, at(12_499));
        assert_eq!(
            commands.take(goto, false, at(14_998)),
            Copy::Answered(later)
        );
        assert_eq!(commands.take(goto, false, at(14_999)), Copy::New);
        commands.amend(&goto, denied);
        assert_eq!(
            commands.take(goto, false, at(15_000)),
            Copy::Open,
            "not answered yet"
        );
        commands.answer(&goto, later, at(15_000));
        commands.amend(&goto, denied);
        assert_eq!(commands.look(goto, at(17_499)), Copy::Answered(denied));
        assert_eq!(commands.look(goto, at(17_500)), Copy::New);
        // A stop is one while it is open only.
        let hold = key(1, 193);
        assert_eq!(commands.take(hold, true, at(0)), Copy::New);
        assert_eq!(commands.take(hold, true, at(0)), Copy::Open);
        commands.answer(&hold, denied, at(1));
        assert_eq!(commands.take(hold, true, at(1)), Copy::New);
    }

    #[test]
    fn a_sender_has_sixteen_and_a_stop_finds_room() {
        let mut commands = Commands::default();
        for command in 0..16 {
            assert_eq!(commands.take(key(1, command), false, at(0)), Copy::New);
        }
        assert_eq!(commands.take(key(1, 99), false, at(0)), Copy::Full);
        assert_eq!(commands.take(key(2, 99), false, at(0)), Copy::New);
        assert_eq!(
            commands.take(key(1, 21), true, at(0)),
            Copy::Full,
            "all are open"
        );
        commands.answer(&key(1, 3), CommandAck::plain(MavResult::Denied), at(1));
        assert_eq!(commands.take(key(1, 99), false, at(1)), Copy::Full);
        assert_eq!(commands.take(key(1, 21), true, at(1)), Copy::New);
    }
}
