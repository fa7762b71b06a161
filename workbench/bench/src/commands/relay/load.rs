//! What processes use while something else is measured.

use anyhow::Result;
use ipc_types::MonotonicNs;

use crate::process::Child;
use crate::usage::Usage;

/// What a process uses on average.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Share of a processor, %.
    pub cpu_percent: f64,
    /// Wake-ups a second.
    pub wakes_hz: f64,
}

impl Load {
    fn of(usage: Usage, elapsed_s: f64) -> Load {
        Load {
            cpu_percent: usage.cpu_ns as f64 / 1e7 / elapsed_s,
            wakes_hz: usage.wakes as f64 / elapsed_s,
        }
    }

    /// The mean of several processes; all zero of none.
    pub fn mean(loads: &[Load]) -> Load {
        let count = loads.len().max(1) as f64;
        let mean = |of: fn(&Load) -> f64| loads.iter().map(of).sum::<f64>() / count;
        Load {
            cpu_percent: mean(|load| load.cpu_percent),
            wakes_hz: mean(|load| load.wakes_hz),
        }
    }
}

/// Processes that are being watched.
pub struct Watch {
    begin: MonotonicNs,
    before: Vec<(u32, Usage)>,
}

impl Watch {
    /// Begins now.
    pub fn begin<'a>(processes: impl IntoIterator<Item = &'a Child>) -> Result<Watch> {
        let usage = |child: &Child| Ok((child.id(), Usage::of(child.id())?));
        Ok(Watch {
            before: processes.into_iter().map(usage).collect::<Result<_>>()?,
            begin: MonotonicNs::now(),
        })
    }

    /// What each has used since the beginning, in the same order, and how long that was, s.
    pub fn end(&self) -> Result<(Vec<Load>, f64)> {
        let elapsed_s = MonotonicNs::now().since(self.begin).as_secs_f64();
        let load =
            |(id, before): &(u32, Usage)| Ok(Load::of(Usage::of(*id)?.since(*before), elapsed_s));
        let loads = self.before.iter().map(load).collect::<Result<_>>()?;
        Ok((loads, elapsed_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_is_told_per_second_and_has_a_mean() {
        let usage = Usage {
            cpu_ns: 20_000_000,
            wakes: 40,
            preemptions: 0,
        };
        let load = Load::of(usage, 4.0);
        assert_eq!((load.cpu_percent, load.wakes_hz), (0.5, 10.0));
        let mean = Load::mean(&[load, Load::default()]);
        assert_eq!((mean.cpu_percent, mean.wakes_hz), (0.25, 5.0));
        assert_eq!(Load::mean(&[]), Load::default());
    }
}
