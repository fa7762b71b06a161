//! What a check gives: the sentence is kept, broken, or cannot be judged.

/// Why a check ends before its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The DSP breaks the sentence: what came, and what should have.
    Broken(String),
    /// The sentence cannot be judged: why.
    NotJudged(String),
}

/// What a check gives.
pub type Judged<T = ()> = Result<T, Stop>;

/// Ends a check: the DSP breaks the sentence.
pub fn broken<T>(found: impl Into<String>) -> Judged<T> {
    Err(Stop::Broken(found.into()))
}

/// Ends a check: it cannot be judged.
pub fn not_judged<T>(why: impl Into<String>) -> Judged<T> {
    Err(Stop::NotJudged(why.into()))
}

/// Breaks the sentence unless `holds`.
pub fn ensure(holds: bool, found: impl FnOnce() -> String) -> Judged {
    match holds {
        true => Ok(()),
        false => broken(found()),
    }
}
