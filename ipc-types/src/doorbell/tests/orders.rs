//! Explores every order of the steps of ringers and sleepers, over a model of the processor's memory and of the futex.
//!
//! The memory is that of the language: a load may return any value that was not overwritten before something that its
//! process knows of. Releasing stores, acquiring loads and barriers make known; what the page does in one total order
//! (`SeqCst`) has no more than that here. The kernel looks at the newest value.

use std::cell::Cell;
use std::rc::Rc;

use crate::doorbell::*;
use crate::tests::explore::{Explored, Life, Play, Script, State, World, explore};

/// The words of the memory: those of the page, and the data of each ringer.
const RINGS: usize = 0;
const SLEEPERS: usize = 1;
const DATA: usize = 2;
const RINGERS: usize = 2;
const WORDS: usize = DATA + RINGERS;

/// How many of each word's values are older than the oldest that may still be read.
type View = [u8; WORDS];

fn join(one: View, other: View) -> View {
    std::array::from_fn(|word| one[word].max(other[word]))
}

#[derive(Clone, Debug, Hash)]
struct Memory {
    /// All values of each word, and what those know who read it.
    words: [Vec<(u64, View)>; WORDS],
    /// What each process knows.
    known: Vec<View>,
    /// What each process will know after a barrier.
    read: Vec<View>,
    /// What a process knows after a barrier, of all barriers so far.
    barrier: View,
    /// For what each process sleeps.
    asleep: Vec<u32>,
}

#[derive(Clone, Debug)]
enum Call {
    Load(usize),
    LoadRelaxed(usize),
    Store(usize, u64),
    Count,
    Announce(u32),
    Clear(u64, u32),
    /// As the mutants clear.
    ClearAnyhow(u32),
    Barrier,
    Wake(u32),
    FallAsleep(u32, u32),
    Sleep,
}

impl Memory {
    fn new(processes: usize) -> Memory {
        Memory {
            words: std::array::from_fn(|_| vec![(0, View::default())]),
            known: vec![View::default(); processes],
            read: vec![View::default(); processes],
            barrier: View::default(),
            asleep: vec![0; processes],
        }
    }

    fn store(&mut self, who: usize, word: usize, value: u64, before: View) {
        self.known[who][word] = self.words[word].len() as u8;
        self.words[word].push((value, join(self.known[who], before)));
    }

    /// Reads the newest value and writes another in one step.
    fn update(&mut self, who: usize, word: usize, change: impl Fn(u64) -> u64) -> u64 {
        let (value, view) = *self.newest(word);
        self.known[who] = join(self.known[who], view);
        self.store(who, word, change(value), view);
        value
    }

    /// Drops the values that no process can read any more.
    fn forget(&mut self) {
        for word in 0..WORDS {
            let old = self
                .known
                .iter()
                .map(|known| known[word])
                .min()
                .unwrap_or(0);
            if old == 0 {
                continue;
            }
            self.words[word].drain(..usize::from(old));
            let kept = self.words.iter_mut().flatten().map(|(_, view)| view);
            let known = self.known.iter_mut().chain(&mut self.read);
            for view in kept.chain(known).chain([&mut self.barrier]) {
                view[word] = view[word].saturating_sub(old);
            }
        }
    }

    fn newest(&self, word: usize) -> &(u64, View) {
        self.words[word].last().unwrap()
    }
}

impl World for Memory {
    type Call = Call;
    type Answer = u64;

    fn call(&self, who: usize, call: &Call) -> Vec<(Memory, u64)> {
        let mut next = self.clone();
        let answer = match *call {
            Call::Load(word) | Call::LoadRelaxed(word) => {
                let oldest = self.known[who][word] as usize;
                let values = self.words[word].iter().enumerate().skip(oldest);
                let read = values.map(|(index, (value, view))| {
                    let mut next = self.clone();
                    next.known[who][word] = index as u8;
                    match call {
                        Call::Load(_) => next.known[who] = join(next.known[who], *view),
                        _ => next.read[who] = join(next.read[who], *view),
                    }
                    next.forget();
                    (next, *value)
                });
                return read.collect();
            }
            Call::Store(word, value) => {
                next.store(who, word, value, View::default());
                0
            }
            Call::Count => next.update(who, RINGS, |rings| rings + 1),
            Call::Announce(bits) => next.update(who, SLEEPERS, |now| announced(now, bits)),
            Call::Clear(sleepers, bits) => match self.newest(SLEEPERS).0 == sleepers {
                true => next.update(who, SLEEPERS, |now| now & !u64::from(bits)),
                false => 0,
            },
            Call::ClearAnyhow(bits) => next.update(who, SLEEPERS, |now| now & !u64::from(bits)),
            Call::Barrier => {
                let known = join(join(self.known[who], self.read[who]), self.barrier);
                (next.known[who], next.barrier) = (known, known);
                0
            }
            Call::Wake(bits) => {
                let asleep = next.asleep.iter_mut().filter(|asleep| **asleep & bits != 0);
                asleep.for_each(|asleep| *asleep = 0);
                0
            }
            Call::FallAsleep(rings, bits) => {
                let falls = self.newest(RINGS).0 == u64::from(rings);
                next.asleep[who] = if falls { bits } else { 0 };
                // Who is not put to sleep was told by the kernel, behind a barrier.
                next.known[who][RINGS] = (self.words[RINGS].len() - 1) as u8;
                falls.into()
            }
            Call::Sleep if self.asleep[who] != 0 => return Vec::new(),
            Call::Sleep => 0,
        };
        next.forget();
        vec![(next, answer)]
    }

    fn kill(&mut self, who: usize) {
        self.asleep[who] = 0;
        for word in 0..WORDS {
            self.known[who][word] = (self.words[word].len() - 1) as u8;
        }
        self.forget();
    }
}

/// What is wrong with the doorbell.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    NoBarrierInRing,
    NoBarrierInListen,
    /// The rings are counted after the bits were set.
    SeenLate,
    /// A bit is cleared before its sleepers are woken, by which who is killed takes others' wake-ups.
    ClearsFirst,
    /// A bit is cleared although a process has announced itself since.
    ClearsAnyhow,
    /// A ring is not counted before the wake.
    CountsAfterWake,
}

/// The doorbell of one process.
struct Model<'a> {
    script: &'a Script<Memory>,
    fault: Fault,
    bits: u32,
    is_ringer: bool,
    seen_late: Cell<u32>,
}

impl Model<'_> {
    fn call(&self, call: Call) -> u64 {
        self.script.call(call).unwrap_or_default()
    }
}

impl Bell for Model<'_> {
    fn barrier(&self) {
        let is_missing = match self.fault {
            Fault::NoBarrierInRing => self.is_ringer,
            Fault::NoBarrierInListen => !self.is_ringer,
            _ => false,
        };
        if !is_missing {
            self.call(Call::Barrier);
        }
    }

    fn rings(&self) -> u32 {
        match self.fault {
            Fault::SeenLate => 0,
            _ => self.call(Call::Load(RINGS)) as u32,
        }
    }

    fn count_ring(&self) {
        if self.fault != Fault::CountsAfterWake {
            self.call(Call::Count);
        }
    }

    fn sleepers(&self) -> u64 {
        let sleepers = self.call(Call::LoadRelaxed(SLEEPERS));
        if self.fault == Fault::ClearsFirst && sleepers & u64::from(self.bits) != 0 {
            self.call(Call::ClearAnyhow(self.bits));
        }
        sleepers
    }

    fn announce(&self, bits: u32) {
        self.call(Call::Announce(bits));
        if self.fault == Fault::SeenLate {
            self.seen_late.set(self.call(Call::Load(RINGS)) as u32);
        }
    }

    fn clear(&self, sleepers: u64, bits: u32) {
        match self.fault {
            Fault::ClearsFirst => {}
            Fault::ClearsAnyhow => drop(self.call(Call::ClearAnyhow(bits))),
            _ => drop(self.call(Call::Clear(sleepers, bits))),
        }
    }

    fn wake(&self, bits: Bits) {
        self.call(Call::Wake(bits.get()));
        if self.fault == Fault::CountsAfterWake {
            self.call(Call::Count);
        }
    }

    fn wait(&self, rings: u32, bits: Bits, _until: MonotonicNs) -> Result<Slept, Errno> {
        let rings = match self.fault {
            Fault::SeenLate => self.seen_late.get(),
            _ => rings,
        };
        if self.call(Call::FallAsleep(rings, bits.get())) == 0 {
            return Ok(Slept::Passed);
        }
        self.call(Call::Sleep);
        Ok(Slept::Signalled)
    }
}

/// Two ringers, each with data of its own, and sleepers.
struct Ringing {
    fault: Fault,
    /// How often each ringer writes data and rings.
    rounds: u64,
    /// For what each process rings or sleeps.
    bits: Vec<u32>,
}

/// How often a ringer has rung, or up to which data of each ringer a sleeper has looked.
type Local = [u64; RINGERS];

impl Play<Memory> for Ringing {
    type Local = Local;

    fn run(&self, who: usize, local: &Local, script: &Rc<Script<Memory>>) -> Option<Local> {
        let bits = Bits::new(self.bits[who]).unwrap();
        let bell = Model {
            script,
            fault: self.fault,
            bits: bits.get(),
            is_ringer: who < RINGERS,
            seen_late: Cell::new(0),
        };
        if who < RINGERS {
            let round = local[0] + 1;
            bell.call(Call::Store(DATA + who, round));
            ring(&bell, bits);
            return (round < self.rounds).then_some([round, 0]);
        }
        let seen = listen(&bell, bits);
        let hears = |ringer: usize| self.bits[who] & self.bits[ringer] != 0;
        let looked = std::array::from_fn(|ringer| match hears(ringer) {
            true => bell.call(Call::Load(DATA + ringer)),
            false => 0,
        });
        if looked == *local {
            let slept = bell.wait(seen.0, bits | GENERATION, MonotonicNs(0));
            assert!(slept.is_ok());
        }
        Some(looked)
    }

    fn check(&self, _state: &State<Memory, Local>) -> Result<(), String> {
        Ok(())
    }

    /// Who sleeps has seen all that was rung for by those who were not killed.
    fn check_end(&self, state: &State<Memory, Local>) -> Result<(), String> {
        let lives: Vec<_> = state.lives().collect();
        for (ringer, life) in lives[..RINGERS].iter().enumerate() {
            let rung = matches!(life, Life::Ended(_));
            for (sleeper, life) in lives.iter().enumerate().skip(RINGERS) {
                let hears = self.bits[sleeper] & self.bits[ringer] != 0;
                if let Life::Lives(looked) = life
                    && rung
                    && hears
                    && looked[ringer] != self.rounds
                {
                    return Err(format!("{sleeper} sleeps and has not looked at {ringer}'s"));
                }
            }
        }
        Ok(())
    }
}

fn play(fault: Fault, rounds: u64, bits: &[u32], kills: u32) -> Result<Explored, String> {
    let ringing = Ringing {
        fault,
        rounds,
        bits: bits.to_vec(),
    };
    let locals = vec![[0; RINGERS]; bits.len()];
    explore(
        &ringing,
        State::begin(Memory::new(bits.len()), locals, kills),
    )
}

/// Rounds, bits of the ringers and sleepers, kills.
type Plays<'a> = &'a [(u64, &'a [u32], u32)];

const SHORT: Plays<'_> = &[(1, &[1, 1, 1], 1), (1, &[1, 2, 3], 1)];

fn play_all(fault: Fault, plays: Plays<'_>) -> Result<(), String> {
    for (rounds, bits, kills) in plays {
        let explored = play(fault, *rounds, bits, *kills)?;
        println!("{fault:?}, {rounds} rounds, {bits:?}, {kills} kills: {explored:?}");
    }
    Ok(())
}

#[test]
fn no_order_loses_the_wake_up_of_a_ringer_that_lives() {
    play_all(Fault::None, SHORT).unwrap();
}

#[test]
fn a_doorbell_with_a_fault_loses_a_wake_up() {
    for fault in [
        Fault::NoBarrierInRing,
        Fault::NoBarrierInListen,
        Fault::SeenLate,
        Fault::ClearsFirst,
        Fault::ClearsAnyhow,
        Fault::CountsAfterWake,
    ] {
        let found = play_all(fault, &[(1, &[1, 1, 1], 1), (2, &[1, 1, 1], 0)]);
        println!("{fault:?}: {}", found.expect_err("the fault was not found"));
    }
}

#[test]
#[ignore = "the long form, of docs/reliability.md"]
fn no_order_of_two_ringers_and_two_sleepers_loses_a_wake_up() {
    let plays: Plays<'_> = &[
        (1, &[1, 2, 1, 2], 0),
        (1, &[1, 2, 1, 2], 1),
        (2, &[1, 1, 1], 0),
    ];
    play_all(Fault::None, plays).unwrap();
}
