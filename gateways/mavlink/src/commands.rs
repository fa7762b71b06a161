//! [`Commands`]: each command is carried out at most once, however often it comes, and none that something newer has
//! outdated.
//!
//! A copy is a command of the same sender with the same bits, at most [`MEMORY`] after the answer to the first one,
//! while nothing else of its [`Subject`] has come in between. Any other command that has been here with the same bits
//! is not answered as the first one was, since that would not be true any more:
//!
//! | a command comes | since it came first: nothing of its subject | anything ([`Since`]) |
//! |---|---|---|
//! | with the same bits, the first one has no answer | open: the answer to come is for it, too | past |
//! | with the same bits, within [`MEMORY`] after the answer | answered: the same answer | past |
//! | later, or with other bits | new: refused while 16 of its sender are known | new |
//! | whose frame was sent before that of the newest order of its subject and sender | – | outdated |
//! | the same, and that very frame has been here before | – | doubled: the network did that, and no answer is due |
//!
//! One that had waited for too long to be read was refused: its copies that had come by then are answered as it was.
//! One that comes later is new, since the answer asked for it.
//!
//! Stations repeat a command that they got no answer for without a mark. So a *past* one may be such a repetition, or a
//! new command: it is new when only the sender itself has commanded something in between. After a stop it begins no
//! movement, and after an order of another station it does nothing: it is refused, and the sender can command it again.
//! *Outdated* ones are refused, unless they stop the helicopter. Hold and land are remembered until they are answered
//! only: a repeated stop is harmless, and a lost one is not.
//!
//! The order of a sender's frames is that of their numbers, which have eight bits: a number that lies up to 128 behind
//! that of an order of the last [`MEMORY`] is of an older frame. Only orders are compared, and only for so long, so
//! that neither lost frames nor a station that starts again, nor one that does not count, is shut out.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::number::command;
use crate::stations::StationAddress;
use crate::verdict::CommandAck;

/// How long after the answer a copy gets that answer: MAVSDK sends a command four times in 1.5 s, QGroundControl a mode
/// three times in 2.6 s, and the first copy was before the answer.
pub const MEMORY: Duration = Duration::from_millis(2_500);

/// Most commands of a sender that are known at a time. A further one is refused.
const MAX_COMMANDS: usize = 16;

/// What a command is about: those of one subject replace each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Whether and where the helicopter moves.
    Motion,
    Speed,
    Home,
    /// The items of the mission.
    Mission,
    Fence,
}

/// What a station has sent that asks for something, and so how it is answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// COMMAND_LONG or COMMAND_INT with this MAV_CMD: by COMMAND_ACK.
    Command(u16),
    /// SET_MODE: by the heartbeat.
    Mode,
    /// MISSION_SET_CURRENT: by MISSION_CURRENT, and a refusal by MISSION_ACK.
    CurrentItem,
    /// An item to be flown to at once: by MISSION_ACK.
    GuidedItem,
}

impl Form {
    fn subject(self) -> Subject {
        match self {
            Form::Command(command::CHANGE_SPEED) => Subject::Speed,
            Form::Command(command::SET_HOME) => Subject::Home,
            _ => Subject::Motion,
        }
    }
}

/// The frame that a command came in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTime {
    /// Its number among those of its sender.
    pub sequence: u8,
    /// When it came.
    pub came: MonotonicNs,
}

/// What tells a command from another one.
#[derive(Clone, Copy, Debug)]
pub struct CommandKey {
    pub sender: StationAddress,
    pub form: Form,
    pub bits: [u32; 8],
    /// Numbers those that were taken, so that each gets its own answer; 0 before.
    pub number: u64,
}

impl CommandKey {
    pub fn new(sender: StationAddress, form: Form, bits: [u32; 8]) -> CommandKey {
        CommandKey {
            sender,
            form,
            bits,
            number: 0,
        }
    }

    /// Whether it asks for a stop of the module.
    pub fn is_disarming(&self) -> bool {
        self.is_switch() && f32::from_bits(self.bits[0]) == 0.0
    }

    /// Whether it asks for a start or a stop of the module.
    pub fn is_switch(&self) -> bool {
        self.form == Form::Command(command::ARM_DISARM)
    }

    /// Of the same sender with the same bits.
    pub fn looks_like(&self, other: &CommandKey) -> bool {
        (self.sender, self.form, self.bits) == (other.sender, other.form, other.bits)
    }
}

/// What a command is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Copy {
    New,
    Open,
    Answered(CommandAck),
    Past(Since),
    Outdated,
    Doubled,
}

/// What has come of a subject since a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Since {
    Nothing,
    /// Further commands of its sender.
    Own,
    /// A hold, a landing or a disarming.
    Stop,
    /// Orders of another station, or of the gateway itself.
    Others,
}

#[derive(Clone, Copy, Debug)]
struct KnownCommand {
    key: CommandKey,
    subject: Subject,
    /// The number of the frame that it came in last.
    sequence: u8,
    is_remembered: bool,
    answered: Option<(CommandAck, MonotonicNs)>,
    since: Since,
}

/// The newest order of a sender about a subject.
#[derive(Clone, Copy, Debug)]
struct NewestOrder {
    sender: StationAddress,
    subject: Subject,
    frame: FrameTime,
}

/// The commands that came of late, by which copies and outdated ones are known.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    known: Vec<KnownCommand>,
    /// One for a station and a subject.
    newest: Vec<NewestOrder>,
    /// Commands that were refused because they had waited for too long, with the answer and when it was given.
    late: Vec<(CommandKey, CommandAck, MonotonicNs)>,
    last_number: u64,
}

impl Commands {
    /// A command is open from now on; one that `is_stop` is not remembered when it is answered. False if there is no
    /// room for it.
    pub fn take(&mut self, key: &mut CommandKey, is_stop: bool, frame: FrameTime) -> bool {
        let own = self.known.iter().filter(|one| one.key.sender == key.sender);
        if own.count() >= MAX_COMMANDS {
            // The oldest answer makes room for a stop.
            let oldest = self
                .known
                .iter()
                .position(|one| one.key.sender == key.sender && one.answered.is_some());
            match oldest.filter(|_| is_stop) {
                Some(index) => _ = self.known.remove(index),
                None => return false,
            }
        }
        let subject = key.form.subject();
        self.order(
            Some(key.sender),
            subject,
            is_stop || key.is_disarming(),
            frame,
        );
        self.last_number += 1;
        key.number = self.last_number;
        self.known.push(KnownCommand {
            key: *key,
            subject,
            sequence: frame.sequence,
            is_remembered: !is_stop,
            answered: None,
            since: Since::Nothing,
        });
        true
    }

    /// Something about a subject was ordered: what came before is past. `None` is no station, such as a step of a
    /// mission.
    pub fn order(
        &mut self,
        sender: Option<StationAddress>,
        subject: Subject,
        is_stop: bool,
        frame: FrameTime,
    ) {
        for one in self.known.iter_mut().filter(|one| one.subject == subject) {
            let since = match is_stop {
                _ if sender != Some(one.key.sender) => Since::Others,
                true => Since::Stop,
                false => Since::Own,
            };
            one.since = one.since.max(since);
        }
        let Some(sender) = sender.filter(|_| !self.is_outdated(sender, subject, frame)) else {
            return;
        };
        self.newest
            .retain(|one| (one.sender, one.subject) != (sender, subject));
        self.newest.push(NewestOrder {
            sender,
            subject,
            frame,
        });
    }

    /// Whether a frame was sent before that of the sender's newest order about a subject.
    pub fn is_outdated(
        &self,
        sender: Option<StationAddress>,
        subject: Subject,
        frame: FrameTime,
    ) -> bool {
        let is_same = |one: &&NewestOrder| (Some(one.sender), one.subject) == (sender, subject);
        self.newest.iter().find(is_same).is_some_and(|one| {
            let ahead = frame
                .sequence
                .wrapping_sub(one.frame.sequence)
                .cast_signed();
            ahead < 0 && frame.came.since(one.frame.came) < MEMORY
        })
    }

    /// What this command is.
    pub fn look(&mut self, key: &CommandKey, frame: FrameTime, now: MonotonicNs) -> Copy {
        self.known.retain(|one| match one.answered {
            None => true,
            Some((_, moment)) => now.since(moment) < MEMORY,
        });
        let is_outdated = self.is_outdated(Some(key.sender), key.form.subject(), frame);
        let known = self.known.iter_mut().rfind(|one| one.key.looks_like(key));
        let mut late = self.late.iter();
        let late = late.find(|(other, _, at)| other.looks_like(key) && frame.came <= *at);
        if let (None, Some((_, answer, _))) = (&known, late) {
            return Copy::Answered(*answer);
        }
        match known {
            Some(one) if one.since == Since::Nothing => {
                one.sequence = frame.sequence;
                match one.answered {
                    Some((answer, _)) => Copy::Answered(answer),
                    None => Copy::Open,
                }
            }
            Some(one) if is_outdated && one.sequence == frame.sequence => Copy::Doubled,
            _ if is_outdated => Copy::Outdated,
            Some(one) => Copy::Past(one.since),
            None => Copy::New,
        }
    }

    /// The answer to a command. Of one that has an answer it is the later one, which copies get for as long as they
    /// would have got the first one.
    pub fn answer(&mut self, key: &CommandKey, answer: CommandAck, now: MonotonicNs) {
        let Some(index) = self
            .known
            .iter()
            .position(|one| one.key.number == key.number)
        else {
            return;
        };
        match &mut self.known[index] {
            KnownCommand {
                answered: Some((known, _)),
                ..
            } => *known = answer,
            one if one.is_remembered => one.answered = Some((answer, now)),
            _ => _ = self.known.remove(index),
        }
    }

    /// A command had waited for too long to be read, and is refused: so are its copies that wait behind it.
    pub fn refuse_late(&mut self, key: &CommandKey, answer: CommandAck, now: MonotonicNs) {
        self.late
            .retain(|(other, _, at)| !other.looks_like(key) && now.since(*at) < MEMORY);
        if self.late.len() == MAX_COMMANDS {
            self.late.remove(0);
        }
        self.late.push((*key, answer, now));
    }

    /// What an accepted command began has ended otherwise: copies get this answer.
    pub fn amend(&mut self, key: &CommandKey, answer: CommandAck, now: MonotonicNs) {
        let is_answered =
            |one: &KnownCommand| one.key.number == key.number && one.answered.is_some();
        if self.known.iter().any(is_answered) {
            self.answer(key, answer, now);
        }
    }

    /// Forgets what a sender that is gone has commanded and was answered.
    pub fn forget(&mut self, sender: StationAddress) {
        self.known
            .retain(|one| one.key.sender != sender || one.answered.is_none());
        self.newest.retain(|one| one.sender != sender);
        self.late.retain(|(key, ..)| key.sender != sender);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::MavResult;

    fn key(port: u16, command: u16) -> CommandKey {
        let sender = StationAddress {
            address: ([127, 0, 0, 1], port).into(),
            system: 255,
            component: 190,
        };
        CommandKey::new(sender, Form::Command(command), [0; 8])
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn frame(sequence: u8, ms: u64) -> FrameTime {
        FrameTime {
            sequence,
            came: at(ms),
        }
    }

    /// What a command is; a new one is taken.
    fn comes(
        commands: &mut Commands,
        key: &mut CommandKey,
        is_stop: bool,
        sequence: u8,
        ms: u64,
    ) -> Copy {
        let copy = commands.look(key, frame(sequence, ms), at(ms));
        if matches!(copy, Copy::New | Copy::Past(_)) {
            assert!(commands.take(key, is_stop, frame(sequence, ms)));
        }
        copy
    }

    const DENIED: CommandAck = CommandAck::plain(MavResult::Denied);

    #[test]
    fn a_copy_is_what_the_table_says() {
        let mut commands = Commands::default();
        let commands = &mut commands;
        let mut goto = key(1, 192);
        assert_eq!(comes(commands, &mut goto, false, 0, 0), Copy::New);
        assert_eq!(
            comes(commands, &mut key(1, 192), false, 1, 9_000),
            Copy::Open
        );
        commands.answer(&goto, DENIED, at(10_000));
        let again = |commands: &mut Commands, ms| comes(commands, &mut key(1, 192), false, 2, ms);
        assert_eq!(again(commands, 12_499), Copy::Answered(DENIED));
        // A later verdict is the answer for as long as the first one would have been, and no longer.
        let later = CommandAck::plain(MavResult::Failed);
        commands.answer(&goto, later, at(12_499));
        assert_eq!(again(commands, 12_499), Copy::Answered(later));
        assert_eq!(again(commands, 12_500), Copy::New);
        commands.answer(&goto, DENIED, at(60_000));
        assert_eq!(
            again(commands, 60_000),
            Copy::Open,
            "what was forgotten does not come back"
        );
        // A stop is one while it is open only.
        let mut hold = key(1, 193);
        assert_eq!(comes(commands, &mut hold, true, 3, 60_000), Copy::New);
        assert_eq!(
            comes(commands, &mut key(1, 193), true, 4, 60_000),
            Copy::Open
        );
        commands.answer(&hold, DENIED, at(60_001));
        assert_eq!(
            comes(commands, &mut key(1, 193), true, 5, 60_001),
            Copy::New
        );
    }

    #[test]
    fn what_comes_between_makes_the_same_bits_another_command() {
        for is_answered in [false, true] {
            let mut commands = Commands::default();
            let commands = &mut commands;
            let mut first = key(1, 192);
            assert_eq!(comes(commands, &mut first, false, 0, 0), Copy::New);
            if is_answered {
                commands.answer(&first, DENIED, at(0));
            }
            // Something else is between, and then the sender's own of the same subject.
            assert_eq!(comes(commands, &mut key(1, 178), false, 1, 1), Copy::New);
            let copy = comes(commands, &mut key(1, 192), false, 2, 2);
            assert!(matches!(copy, Copy::Open | Copy::Answered(_)), "{copy:?}");
            assert_eq!(comes(commands, &mut key(1, 22), false, 3, 3), Copy::New);
            let mut second = key(1, 192);
            assert_eq!(
                comes(commands, &mut second, false, 4, 4),
                Copy::Past(Since::Own)
            );
            // Each gets its own answer.
            commands.answer(&second, CommandAck::plain(MavResult::Failed), at(5));
            commands.answer(&first, DENIED, at(5));
            let failed = CommandAck::plain(MavResult::Failed);
            assert_eq!(
                comes(commands, &mut key(1, 192), false, 5, 6),
                Copy::Answered(failed)
            );
            // A stop, then another station's.
            assert_eq!(comes(commands, &mut key(1, 193), true, 6, 7), Copy::New);
            let stopped = commands.look(&key(1, 192), frame(7, 8), at(8));
            assert_eq!(stopped, Copy::Past(Since::Stop));
            assert_eq!(comes(commands, &mut key(2, 22), false, 0, 9), Copy::New);
            let overtaken = commands.look(&key(1, 192), frame(8, 10), at(10));
            assert_eq!(overtaken, Copy::Past(Since::Others));
            assert_eq!(
                comes(commands, &mut key(1, 192), false, 8, 2_505),
                Copy::New
            );
        }
    }

    #[test]
    fn a_frame_that_the_network_doubles_is_no_other_command() {
        for is_answered in [false, true] {
            let mut commands = Commands::default();
            let commands = &mut commands;
            let mut first = key(1, 192);
            assert_eq!(comes(commands, &mut first, false, 3, 0), Copy::New);
            // Its sender repeats it.
            assert_eq!(commands.look(&first, frame(4, 1), at(1)), Copy::Open);
            if is_answered {
                commands.answer(&first, DENIED, at(1));
            }
            assert_eq!(comes(commands, &mut key(1, 22), false, 6, 2), Copy::New);
            let look = |sequence, commands: &mut Commands| {
                commands.look(&key(1, 192), frame(sequence, 3), at(3))
            };
            assert_eq!(look(4, commands), Copy::Doubled);
            assert_eq!(look(5, commands), Copy::Outdated);
            assert_eq!(look(7, commands), Copy::Past(Since::Own));
            // A station that does not count its frames has none doubled.
            assert_eq!(look(6, commands), Copy::Past(Since::Own));
        }
    }

    #[test]
    fn the_order_of_frames_is_that_of_their_numbers_and_shuts_nobody_out() {
        // The number of the newest order, that of the frame, how much later it comes, and whether it is older.
        for (newest, sequence, ms, is_outdated) in [
            (11, 10, 1, true),
            (11, 11, 1, false),
            (11, 12, 1, false),
            (0, 255, 2_499, true),
            (0, 255, 2_500, false),
            (200, 73, 1, true),
            (200, 72, 1, true),
            // It starts again, or as many were lost.
            (200, 71, 1, false),
            (200, 0, 1, false),
            (255, 0, 1, false),
        ] {
            let mut commands = Commands::default();
            assert_eq!(
                comes(&mut commands, &mut key(1, 193), true, newest, 0),
                Copy::New
            );
            let found = comes(&mut commands, &mut key(1, 192), false, sequence, ms);
            let expected = match is_outdated {
                true => Copy::Outdated,
                false => Copy::New,
            };
            assert_eq!(found, expected, "{sequence} after {newest}, {ms} ms");
            // Other subjects and other stations have their own order.
            assert_eq!(
                comes(&mut commands, &mut key(1, 178), false, sequence, ms),
                Copy::New
            );
            assert_eq!(
                comes(&mut commands, &mut key(2, 192), false, sequence, ms),
                Copy::New
            );
        }
    }

    #[test]
    fn a_sender_has_sixteen_and_a_stop_finds_room() {
        let mut commands = Commands::default();
        let commands = &mut commands;
        let mut keys: Vec<_> = (0..16).map(|command| key(1, command)).collect();
        for one in &mut keys {
            assert!(commands.take(one, false, frame(0, 0)));
        }
        assert!(!commands.take(&mut key(1, 99), false, frame(0, 0)));
        assert!(commands.take(&mut key(2, 99), false, frame(0, 0)));
        assert!(
            !commands.take(&mut key(1, 21), true, frame(0, 0)),
            "all are open"
        );
        commands.answer(&keys[3], DENIED, at(1));
        assert!(!commands.take(&mut key(1, 99), false, frame(0, 1)));
        assert!(commands.take(&mut key(1, 21), true, frame(0, 1)));
    }
}
