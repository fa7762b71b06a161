//! For tests: explores every order in which processes can take their steps.
//!
//! The processes run the real code. What they share is a value, a [`World`], and each of its calls to the world is one
//! step. To take a step, a process is run again from the beginning of its stage with the answers that it had so far, up
//! to the next call. So a state is a value, too, and one that was seen before is not explored again.
//!
//! A process that stands still takes no step for as long as the others like; each process may be killed between any two
//! of its steps.

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::fmt::{Debug, Write};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::rc::Rc;

/// What the processes share.
pub(crate) trait World: Clone + Hash {
    /// What a process asks of it.
    type Call: Clone + Debug;
    /// What the process gets to know.
    type Answer: Clone + Debug + Hash;

    /// What may come of a call of the process `who`; nothing if it has to wait.
    fn call(&self, who: usize, call: &Self::Call) -> Vec<(Self, Self::Answer)>;

    /// What the kernel does when the process is killed.
    fn kill(&mut self, who: usize);
}

/// The answers that a process has had, in its present stage.
#[derive(Debug)]
pub(crate) struct Script<W: World> {
    answers: Vec<W::Answer>,
    taken: Cell<usize>,
    next: RefCell<Option<W::Call>>,
}

impl<W: World> Script<W> {
    /// The answer to a call; `None` when it is not known yet. From then on the process only has to end.
    pub(crate) fn call(&self, call: W::Call) -> Option<W::Answer> {
        let mut next = self.next.borrow_mut();
        if next.is_some() {
            return None;
        }
        let answer = self.answers.get(self.taken.get());
        match answer {
            Some(_) => self.taken.set(self.taken.get() + 1),
            None => *next = Some(call),
        }
        answer.cloned()
    }

    /// Whether the process only has to end.
    pub(crate) fn has_stopped(&self) -> bool {
        self.next.borrow().is_some()
    }
}

/// What the processes do, and what must hold.
pub(crate) trait Play<W: World> {
    /// What a process keeps from stage to stage.
    type Local: Clone + Debug + Hash;

    /// Runs a stage of the process `who` and says what it keeps; `None` if it has ended. What is returned after the
    /// script has stopped means nothing.
    fn run(&self, who: usize, local: &Self::Local, script: &Rc<Script<W>>) -> Option<Self::Local>;

    /// What must hold in every state.
    fn check(&self, state: &State<W, Self::Local>) -> Result<(), String>;

    /// What must hold when no process can take a step.
    fn check_end(&self, state: &State<W, Self::Local>) -> Result<(), String>;
}

/// How a process is.
#[derive(Clone, Debug, Hash, PartialEq)]
pub(crate) enum Life<L> {
    Lives(L),
    Ended(L),
    Killed,
}

impl<L> Life<L> {
    /// What a process keeps that was not killed.
    pub(crate) fn local(&self) -> Option<&L> {
        match self {
            Life::Lives(local) | Life::Ended(local) => Some(local),
            Life::Killed => None,
        }
    }
}

#[derive(Clone, Debug)]
struct Process<W: World, L> {
    life: Life<L>,
    answers: Vec<W::Answer>,
    next: Option<W::Call>,
}

/// The world and all processes between two steps.
#[derive(Clone, Debug)]
pub(crate) struct State<W: World, L> {
    pub(crate) world: W,
    processes: Vec<Process<W, L>>,
    kills: u32,
}

impl<W: World, L: Clone + Debug + Hash> State<W, L> {
    /// How each process is.
    pub(crate) fn lives(&self) -> impl Iterator<Item = &Life<L>> {
        self.processes.iter().map(|process| &process.life)
    }

    /// Processes that have not taken a step yet.
    pub(crate) fn begin(world: W, locals: Vec<L>, kills: u32) -> State<W, L> {
        let processes = locals.into_iter().map(|local| Process {
            life: Life::Lives(local),
            answers: Vec::new(),
            next: None,
        });
        State {
            world,
            processes: processes.collect(),
            kills,
        }
    }

    /// Whether the process has taken no step of its present stage.
    pub(crate) fn begins_stage(&self, who: usize) -> bool {
        self.processes[who].answers.is_empty()
    }

    /// Lets one process take its steps, the first that may be each time, while it keeps such a thing.
    pub(crate) fn run_while(
        &mut self,
        who: usize,
        play: &impl Play<W, Local = L>,
        goes_on: impl Fn(&L) -> bool,
    ) {
        self.advance(who, play);
        while let Life::Lives(local) = &self.processes[who].life
            && goes_on(local)
        {
            let Some(call) = &self.processes[who].next else {
                return;
            };
            let Some((world, answer)) = self.world.call(who, call).into_iter().next() else {
                return;
            };
            self.world = world;
            self.processes[who].answers.push(answer);
            self.advance(who, play);
        }
    }

    /// What comes when a process begins with `local`, and takes up to so many steps while all others stand still.
    pub(crate) fn run_alone(
        &self,
        who: usize,
        local: L,
        play: &impl Play<W, Local = L>,
        steps: usize,
    ) -> State<W, L> {
        let mut state = self.clone();
        state.processes[who] = Process {
            life: Life::Lives(local),
            answers: Vec::new(),
            next: None,
        };
        let left = Cell::new(steps);
        state.run_while(who, play, |_| {
            left.replace(left.get().saturating_sub(1)) > 0
        });
        state
    }

    fn key(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.world.hash(&mut hasher);
        for process in &self.processes {
            process.life.hash(&mut hasher);
            process.answers.hash(&mut hasher);
        }
        self.kills.hash(&mut hasher);
        hasher.finish()
    }

    /// Runs a process up to its next call.
    fn advance(&mut self, who: usize, play: &impl Play<W, Local = L>) {
        loop {
            let process = &mut self.processes[who];
            let Life::Lives(local) = &process.life else {
                return;
            };
            let script = Rc::new(Script {
                answers: std::mem::take(&mut process.answers),
                taken: Cell::new(0),
                next: RefCell::new(None),
            });
            let kept = play.run(who, local, &script);
            let script = Rc::try_unwrap(script).unwrap_or_else(|_| panic!("the script was kept"));
            process.next = script.next.into_inner();
            if process.next.is_some() {
                process.answers = script.answers;
                return;
            }
            process.life = match kept {
                Some(local) => Life::Lives(local),
                None => Life::Ended(local.clone()),
            };
        }
    }

    /// Every step that can come next, in words, and what it leads to.
    fn steps(&self, play: &impl Play<W, Local = L>) -> Vec<(String, State<W, L>)> {
        let mut steps = Vec::new();
        for (who, process) in self.processes.iter().enumerate() {
            let Some(call) = process.next.as_ref() else {
                continue;
            };
            for (world, answer) in self.world.call(who, call) {
                let mut state = self.clone();
                state.world = world;
                state.processes[who].answers.push(answer.clone());
                state.advance(who, play);
                steps.push((format!("{who}: {call:?} -> {answer:?}"), state));
            }
        }
        if self.kills == 0 {
            return steps;
        }
        for (who, process) in self.processes.iter().enumerate() {
            if process.next.is_some() {
                let mut state = self.clone();
                state.kills -= 1;
                state.world.kill(who);
                let killed = &mut state.processes[who];
                (killed.life, killed.next) = (Life::Killed, None);
                killed.answers.clear();
                steps.push((format!("{who}: is killed"), state));
            }
        }
        steps
    }
}

/// What was explored.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Explored {
    pub(crate) states: usize,
    pub(crate) steps: usize,
    /// States in which no process could take a step.
    pub(crate) ends: usize,
}

/// Explores everything from a beginning. An error is the first thing found that must not be, with all steps that lead
/// there.
pub(crate) fn explore<W: World, P: Play<W>>(
    play: &P,
    mut state: State<W, P::Local>,
) -> Result<Explored, String> {
    for who in 0..state.processes.len() {
        state.advance(who, play);
    }
    let mut explored = Explored::default();
    let mut seen = HashSet::from([state.key()]);
    // The steps that led here, each with those that can be taken instead.
    let mut path = Vec::new();
    let mut label = "begin".to_owned();
    loop {
        explored.states += 1;
        let steps = state.steps(play);
        let found = match steps.is_empty() {
            true => {
                explored.ends += 1;
                play.check(&state).and_then(|()| play.check_end(&state))
            }
            false => play.check(&state),
        };
        path.push((label, steps));
        if let Err(found) = found {
            let mut text = format!("{found}\n");
            for (label, _) in &path {
                let _ = writeln!(text, "  {label}");
            }
            return Err(text);
        }
        (label, state) = loop {
            let Some((_, steps)) = path.last_mut() else {
                return Ok(explored);
            };
            match steps.pop() {
                Some((label, state)) => {
                    explored.steps += 1;
                    if seen.insert(state.key()) {
                        break (label, state);
                    }
                }
                None => drop(path.pop()),
            }
        };
    }
}
