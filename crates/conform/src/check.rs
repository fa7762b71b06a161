//! What a check is: a sentence of docs/protocol.md, what is sent, what must come back, and how both are compared.

use std::pin::Pin;

use dsp_protocol::Profile;

use crate::bench::Bench;
use crate::monitor::Rule;
use crate::outcome::Judged;
use crate::permitted::RotorDisconnected;

/// A check that is under way.
pub type Running = Pin<Box<dyn Future<Output = Judged>>>;

/// Where the helicopter must be when a check begins. The runner brings it there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartPlace {
    /// On the ground, following off.
    Ground,
    /// In a hover, with an empty path buffer and following on.
    Hover,
}

/// How a sentence is judged.
pub enum How {
    /// By sending what moves no rotor.
    Harmless(Box<dyn Fn(Bench) -> Running>),
    /// By sending what can move a rotor.
    Moving(StartPlace, Box<dyn Fn(Bench, RotorDisconnected) -> Running>),
    /// By the messages of all other checks.
    Watched(Rule),
}

/// A check.
pub struct Check {
    /// Its name, such as `8.2-ack-time`: the section, and what it is about.
    pub id: String,
    /// The section of docs/protocol.md.
    pub section: &'static str,
    /// The words of docs/protocol.md that it judges, or those of a row of a table there.
    pub sentence: String,
    /// What the kit sends.
    pub sends: String,
    /// What must come back.
    pub expects: String,
    /// The profile that it is about; `None` if both.
    pub profile: Option<Profile>,
    /// Whether the DSP is reset for it.
    pub needs_reset: bool,
    /// How it is done.
    pub how: How,
}

impl Check {
    /// A check that moves no rotor.
    pub fn harmless<F>(
        id: &str,
        section: &'static str,
        sentence: &str,
        sends: &str,
        expects: &str,
        run: impl Fn(Bench) -> F + 'static,
    ) -> Check
    where
        F: Future<Output = Judged> + 'static,
    {
        let how = How::Harmless(Box::new(move |bench| Box::pin(run(bench))));
        Check::new(id, section, sentence, sends, expects, how)
    }

    /// A check that can move a rotor.
    pub fn moving<F>(
        place: StartPlace,
        id: &str,
        section: &'static str,
        sentence: &str,
        sends: &str,
        expects: &str,
        run: impl Fn(Bench, RotorDisconnected) -> F + 'static,
    ) -> Check
    where
        F: Future<Output = Judged> + 'static,
    {
        let how = How::Moving(
            place,
            Box::new(move |bench, proof| Box::pin(run(bench, proof))),
        );
        Check::new(id, section, sentence, sends, expects, how)
    }

    /// A check of all messages of the run.
    pub fn watched(
        rule: Rule,
        id: &str,
        section: &'static str,
        sentence: &str,
        expects: &str,
    ) -> Check {
        let sends = "nothing of its own: it judges the messages of all other checks";
        Check::new(id, section, sentence, sends, expects, How::Watched(rule))
    }

    fn new(
        id: &str,
        section: &'static str,
        sentence: &str,
        sends: &str,
        expects: &str,
        how: How,
    ) -> Check {
        Check {
            id: id.to_owned(),
            section,
            sentence: sentence.to_owned(),
            sends: sends.to_owned(),
            expects: expects.to_owned(),
            profile: None,
            needs_reset: false,
            how,
        }
    }

    /// Restricts the check to one profile.
    #[must_use]
    pub fn only_in(self, profile: Profile) -> Check {
        Check {
            profile: Some(profile),
            ..self
        }
    }

    /// Has the DSP reset before the check.
    #[must_use]
    pub fn with_reset(self) -> Check {
        Check {
            needs_reset: true,
            ..self
        }
    }

    /// Whether it can move a rotor.
    pub const fn moves_rotor(&self) -> bool {
        matches!(self.how, How::Moving(..))
    }
}
