//! Processes that are being watched: what each uses, by [`Usage`].

use anyhow::Result;
use ipc_types::MonotonicNs;
use ril_tests::Process;
use runtime::usage::Usage;

use crate::measured::Round;

/// Share of a processor.
pub const CPU: &str = "% of a core";
/// How often a process slept and was woken.
pub const WAKES: &str = "wake-ups a second";

/// Processes that are being watched.
pub struct Watch {
    begin: MonotonicNs,
    before: Vec<(&'static str, u32, Usage)>,
}

impl Watch {
    /// Begins now. Each has a name of its own.
    ///
    /// # Errors
    /// One has ended.
    pub fn begin<'a>(
        processes: impl IntoIterator<Item = (&'static str, &'a Process)>,
    ) -> Result<Watch> {
        let usage = |(name, process): (&'static str, &Process)| -> Result<_> {
            let id = process.id();
            Ok((name, id, Usage::of(id)?))
        };
        Ok(Watch {
            before: processes.into_iter().map(usage).collect::<Result<_>>()?,
            begin: MonotonicNs::now(),
        })
    }

    /// When it began.
    pub fn since(&self) -> MonotonicNs {
        self.begin
    }

    /// Adds what each has used since the beginning to the figures of its name. Says how long that was, s.
    ///
    /// # Errors
    /// One has ended.
    pub fn end(&self, round: &mut Round) -> Result<f64> {
        let elapsed_s = MonotonicNs::now().since(self.begin).as_secs_f64();
        for (name, id, before) in &self.before {
            let load = Usage::of(*id)?.since(before);
            round.add_figure(name, CPU, load.all_percent);
            round.add_figure(name, WAKES, load.wakes_per_s);
        }
        Ok(elapsed_s)
    }
}
