//! A whole run: whether the helicopter stands, each check, and the DSP as it was found.

use std::cell::RefCell;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Waker};
use std::time::Duration;

use dsp_protocol::{Downlink, Group, StatusMask, port};

use crate::arrival::Arrival;
use crate::bench::Bench;
use crate::check::{Check, How, StartPlace};
use crate::outcome::{Judged, Stop};
use crate::permitted::{Harmless, QuietPort16, QuietPort32, RotorDisconnected};
use crate::pilot;
use crate::report::{CheckReport, Ended, Report, Verdict};
use crate::table::chosen;
use crate::wire::{Reset, Setup, Wire};

/// The status period between checks, ms: at 9600 baud a status of the time alone takes 18 ms in the extended profile.
const PERIOD_MS: u16 = 50;
/// How often a check is tried on a line that damages bytes.
const LOSSY_ATTEMPTS: usize = 60;
/// How many of the attempts must fail without a sign of damage from the DSP, or after repetitions that agree, before it
/// is blamed.
const LOSSY_FAILURES: usize = 15;
/// How often a command between checks is tried, as the PC does.
const ATTEMPTS: usize = 3;
/// How often at first, when the line may be full of a status that is being received.
const FIRST_ATTEMPTS: usize = 5;

/// What a run is given.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The line.
    pub setup: Setup,
    /// Whether the DSP can be reset when a check asks for it.
    pub can_reset: bool,
    /// The proof that no rotor can turn; `None`: nothing is sent that can move one.
    pub proof: Option<RotorDisconnected>,
    /// Names of checks or sections, or their beginnings; empty: all.
    pub only: Vec<String>,
}

/// How far a run is.
#[derive(Debug, Default)]
struct RunProgress {
    reports: Vec<CheckReport>,
    ended_early: Option<Ended>,
    is_finished: bool,
}

/// What plays the PC as a value: it is given time and bytes, and is drained of bytes.
pub trait Player {
    /// Takes bytes that came until `now`, and the time; goes on as far as that leads.
    fn step(&mut self, now: Duration, bytes: &[u8]);

    /// The bytes to send.
    fn take_outbox(&mut self) -> Vec<u8>;

    /// When [`Player::step`] has something to do though nothing came; `None` when all is done, or a reset is waited
    /// for.
    fn next_deadline(&self) -> Option<Duration>;

    /// Whether all is done.
    fn is_finished(&self) -> bool;
}

/// A whole run.
pub struct Conformance {
    settings: Settings,
    wire: Rc<RefCell<Wire>>,
    progress: Rc<RefCell<RunProgress>>,
    run: Option<Pin<Box<dyn Future<Output = ()>>>>,
}

impl Conformance {
    /// A run that begins at time 0.
    pub fn new(settings: Settings) -> Conformance {
        let wire = Rc::new(RefCell::new(Wire::new(
            settings.setup,
            settings.proof.is_some(),
        )));
        let progress = Rc::new(RefCell::new(RunProgress::default()));
        let run = run(
            Bench::new(Rc::clone(&wire)),
            Rc::clone(&wire),
            settings.clone(),
            Rc::clone(&progress),
        );
        Conformance {
            settings,
            wire,
            progress,
            run: Some(Box::pin(run)),
        }
    }

    /// Whether the DSP is to be reset now: then [`Conformance::was_reset`] or [`Conformance::decline_reset`] goes on.
    pub fn wants_reset(&self) -> bool {
        self.wire.borrow().wants_reset()
    }

    /// The DSP was reset at `now`.
    pub fn was_reset(&mut self, now: Duration) {
        self.wire.borrow_mut().end_reset(Reset::Done(now));
        self.step(now, &[]);
    }

    /// The DSP is not reset.
    pub fn decline_reset(&mut self, now: Duration) {
        self.wire.borrow_mut().end_reset(Reset::Declined);
        self.step(now, &[]);
    }

    /// How many checks are done.
    pub fn done(&self) -> usize {
        self.progress.borrow().reports.len()
    }

    /// The report of the check with this place in the run; `None` if it is not done.
    pub fn check(&self, index: usize) -> Option<CheckReport> {
        self.progress.borrow().reports.get(index).cloned()
    }

    /// What was found so far.
    pub fn report(&self) -> Report {
        let progress = self.progress.borrow();
        Report {
            profile: self.settings.setup.profile,
            checks: progress.reports.clone(),
            own_errors: self.wire.borrow().monitor().own_errors().to_vec(),
            ended_early: progress.ended_early.clone(),
        }
    }
}

impl Player for Conformance {
    fn step(&mut self, now: Duration, bytes: &[u8]) {
        {
            let mut wire = self.wire.borrow_mut();
            wire.advance(now);
            wire.receive(now, bytes);
        }
        let mut context = Context::from_waker(Waker::noop());
        if let Some(run) = &mut self.run
            && run.as_mut().poll(&mut context).is_ready()
        {
            self.run = None;
            self.progress.borrow_mut().is_finished = true;
        }
    }

    fn take_outbox(&mut self) -> Vec<u8> {
        self.wire.borrow_mut().take_outbox()
    }

    fn next_deadline(&self) -> Option<Duration> {
        self.run.as_ref()?;
        self.wire.borrow().next_deadline()
    }

    fn is_finished(&self) -> bool {
        self.run.is_none()
    }
}

/// Why a check is left out; `None` if it is done.
pub fn left_out(check: &Check, settings: &Settings) -> Option<String> {
    if check.moves_rotor() && settings.proof.is_none() {
        return Some("it can move a rotor: --rotor-disconnected allows it".to_owned());
    }
    if check.needs_reset && !settings.can_reset {
        return Some("it needs a reset of the DSP: --reset-command or --reset-by-hand".to_owned());
    }
    None
}

async fn run(
    bench: Bench,
    wire: Rc<RefCell<Wire>>,
    settings: Settings,
    progress: Rc<RefCell<RunProgress>>,
) {
    if let Err(ended) = begin(&bench, settings.proof.is_none()).await {
        progress.borrow_mut().ended_early = Some(ended);
        return;
    }
    let found = OriginalPorts::read(&bench).await;
    for check in chosen(settings.setup.profile, &settings.only) {
        let (verdict, dialogue) = match (left_out(&check, &settings), &check.how) {
            (Some(why), _) => (Verdict::NotJudged { why }, Vec::new()),
            (None, How::Watched(rule)) => {
                let wire = wire.borrow();
                let monitor = wire.monitor();
                let verdict = match monitor.breach(*rule) {
                    Some(_) if settings.setup.is_lossy && rule.may_be_damage() => {
                        Verdict::NotJudged {
                            why: "the line damages bytes".to_owned(),
                        }
                    }
                    Some(found) => Verdict::Broken {
                        found: found.to_owned(),
                    },
                    None if monitor.messages() == 0 => Verdict::NotJudged {
                        why: "no message came".to_owned(),
                    },
                    None => Verdict::Kept,
                };
                (verdict, monitor.dialogue(*rule))
            }
            (None, _) => {
                let verdict = attempts(&bench, &wire, &check, settings.proof).await;
                (verdict, wire.borrow().lines())
            }
        };
        let is_broken = matches!(verdict, Verdict::Broken { .. });
        progress.borrow_mut().reports.push(CheckReport {
            id: check.id,
            section: check.section,
            sentence: check.sentence,
            sends: check.sends,
            expects: check.expects,
            verdict,
            dialogue: match is_broken {
                true => dialogue,
                false => Vec::new(),
            },
        });
    }
    if let Some(proof) = settings.proof {
        settle(&bench, Some(proof)).await;
        // Whether it lands is not judged here.
        let _ = pilot::to_ground(&bench, proof).await;
    }
    found.restore(&bench).await;
}

/// A check: one attempt, or several on a line that damages bytes.
async fn attempts(
    bench: &Bench,
    wire: &Rc<RefCell<Wire>>,
    check: &Check,
    proof: Option<RotorDisconnected>,
) -> Verdict {
    if !bench.is_lossy() {
        return attempt(bench, wire, check, proof).await;
    }
    let mut sure = 0;
    for _ in 0..LOSSY_ATTEMPTS {
        let verdict = attempt(bench, wire, check, proof).await;
        if !matches!(verdict, Verdict::Broken { .. }) {
            return verdict;
        }
        sure += usize::from(bench.is_sure() || !bench.is_disturbed(0));
        if sure == LOSSY_FAILURES {
            return verdict;
        }
    }
    Verdict::NotJudged {
        why: "the line damages too many bytes: too few attempts were undisturbed".to_owned(),
    }
}

/// One attempt of a check, from a known state on.
async fn attempt(
    bench: &Bench,
    wire: &Rc<RefCell<Wire>>,
    check: &Check,
    proof: Option<RotorDisconnected>,
) -> Verdict {
    wire.borrow_mut().begin_check();
    settle(bench, proof).await;
    let outcome = match (&check.how, proof) {
        (How::Harmless(run), _) => {
            begin_seeing(wire);
            run(bench.clone()).await
        }
        (How::Moving(place, run), Some(proof)) => {
            let prepared = match place {
                StartPlace::Ground => pilot::to_ground(bench, proof).await,
                StartPlace::Hover => pilot::to_hover(bench, proof).await,
            };
            match prepared {
                Ok(()) => {
                    settle_errors(bench).await;
                    begin_seeing(wire);
                    run(bench.clone(), proof).await
                }
                Err(Stop::Broken(why) | Stop::NotJudged(why)) => {
                    Err(Stop::NotJudged(format!("the check could not begin: {why}")))
                }
            }
        }
        (How::Moving(..), None) | (How::Watched(_), _) => Ok(()),
    };
    let overflowed = wire.borrow().overflowed();
    match outcome {
        _ if overflowed => Verdict::NotJudged {
            why: "more messages came than a check can keep".to_owned(),
        },
        Ok(()) => Verdict::Kept,
        Err(Stop::Broken(found)) => Verdict::Broken { found },
        Err(Stop::NotJudged(why)) => Verdict::NotJudged { why },
    }
}

/// What the check sees begins here; the dialogue has what led to it as well, so that it can be played to a DSP that was
/// reset.
fn begin_seeing(wire: &Rc<RefCell<Wire>>) {
    wire.borrow_mut().forget_arrivals();
}

/// A command between checks: repeated as the PC does, and not judged.
async fn insist(bench: &Bench, command: Harmless) -> bool {
    for _ in 0..ATTEMPTS {
        if bench.ask(command).await.is_ok() {
            return true;
        }
    }
    false
}

/// Brings the DSP to where a check can begin: a status of the time alone every 50 ms, usual periods, no PC time-out, an
/// empty path buffer, no errors. What the DSP does not do of it is left to the check that judges it.
async fn settle(bench: &Bench, proof: Option<RotorDisconnected>) {
    let time = StatusMask::NONE.with(Group::Time);
    insist(bench, Harmless::ACTIVATE_STATUS).await;
    for (quiet, value) in [
        (QuietPort16::StatusPeriod, PERIOD_MS),
        (QuietPort16::StatusMask, time.0),
        (QuietPort16::FlowControlPeriod, 100),
        (QuietPort16::PcTimeout, 0),
    ] {
        insist(bench, Harmless::write_16(quiet, value)).await;
    }
    insist(bench, Harmless::INVALIDATE_PATH).await;
    if proof.is_none() {
        insist(bench, Harmless::FOLLOWING_OFF).await;
    }
    settle_errors(bench).await;
}

/// Empties the queue of errors, and waits until none is on its way.
async fn settle_errors(bench: &Bench) {
    insist(bench, Harmless::CLEAR_ERRORS).await;
    // Whether statuses come is judged by the checks.
    let _ = bench.statuses(2).await;
    bench.forget_mask();
    bench.forget();
}

/// Learns whether the DSP answers and the helicopter stands. It writes nothing: another PC may fly the helicopter.
/// `can_move`: the rotor may turn, so a DSP that sends no status is left alone.
pub(crate) async fn look(bench: &Bench, can_move: bool) -> Result<(), Ended> {
    let mark = bench.mark();
    let first = [
        Harmless::read_16(port::TAKE_OFF),
        Harmless::read_16(port::LAND),
        Harmless::ACTIVATE_STATUS,
    ];
    for _ in 0..FIRST_ATTEMPTS {
        let mut all = true;
        for command in first {
            all &= bench.ask(command).await.is_ok();
        }
        if all {
            break;
        }
    }
    if !bench.since(mark).iter().any(|seen| seen.event.is_ok()) {
        return Err(match bench.rejected() {
            Some(rejected) => Ended::Garbled(rejected),
            None => Ended::Silent,
        });
    }
    // Whether statuses come is judged below, and by the checks.
    let _ = bench.statuses(1).await;
    let seen = bench.since(mark);
    if flies_or_moves(&seen) {
        return Err(Ended::Flies);
    }
    match can_move && !seen.iter().any(|seen| seen.status().is_some()) {
        true => Err(Ended::NoStatus),
        false => Ok(()),
    }
}

/// Looks twice: the second time at statuses that come quickly.
async fn begin(bench: &Bench, can_move: bool) -> Result<(), Ended> {
    let mark = bench.mark();
    look(bench, can_move).await?;
    let period = Harmless::write_16(QuietPort16::StatusPeriod, PERIOD_MS);
    insist(bench, period).await;
    let _ = bench.statuses(2).await;
    match flies_or_moves(&bench.since(mark)) {
        true => Err(Ended::Flies),
        false => Ok(()),
    }
}

/// Whether the newest status says that the helicopter flies, or an answer that it takes off or lands.
fn flies_or_moves(seen: &[Arrival]) -> bool {
    let mut statuses = seen.iter().filter_map(Arrival::status);
    let is_flying = statuses.next_back().is_some_and(|status| status.flying);
    let moves = |arrival: &Arrival| matches!(arrival.event, Ok(Downlink::Ack16 { value: 1, .. }));
    is_flying || seen.iter().any(moves)
}

/// The ports that the kit writes, as it found them.
struct OriginalPorts {
    words: Vec<(QuietPort16, u16)>,
    floats: Vec<(QuietPort32, f32)>,
}

impl OriginalPorts {
    async fn read(bench: &Bench) -> OriginalPorts {
        let mut found = OriginalPorts {
            words: Vec::new(),
            floats: Vec::new(),
        };
        for quiet in [
            QuietPort16::StatusMask,
            QuietPort16::FlowControlPeriod,
            QuietPort16::PcTimeout,
        ] {
            if let Some(value) = again(|| bench.read_16(quiet as u16)).await {
                found.words.push((quiet, value));
            }
        }
        for quiet in [
            QuietPort32::CruiseSpeed,
            QuietPort32::ClimbSpeed,
            QuietPort32::AcceptanceRadius,
            QuietPort32::TakeOffAltitude,
        ] {
            if let Some(value) = again(|| bench.read_32(quiet as u16)).await {
                found.floats.push((quiet, value));
            }
        }
        found
    }

    async fn restore(self, bench: &Bench) {
        for (quiet, value) in self.floats {
            insist(bench, Harmless::write_32(quiet, value)).await;
        }
        // The period at boot: that of the line before the run was replaced before it was read.
        insist(bench, Harmless::write_16(QuietPort16::StatusPeriod, 20)).await;
        for (quiet, value) in self.words {
            insist(bench, Harmless::write_16(quiet, value)).await;
        }
        insist(bench, Harmless::FOLLOWING_OFF).await;
        insist(bench, Harmless::CLEAR_ERRORS).await;
    }
}

/// What `read` gives, at the third attempt at the latest.
async fn again<T, F: Future<Output = Judged<T>>>(read: impl Fn() -> F) -> Option<T> {
    for _ in 0..ATTEMPTS {
        if let Ok(value) = read().await {
            return Some(value);
        }
    }
    None
}
