//! [`Lack`]: what was asked for in `[realtime]` and is not to be had, in words, and what to do about it.

use std::fmt;

use super::config::RealtimeConfig;

/// What a thread has, and what its limits allow.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Granted {
    /// Whether its process has locked memory.
    pub is_locked: bool,
    /// Its priority as a real-time thread; 0 if it is none.
    pub priority: u8,
    /// The processors on which it may run, in order.
    pub processors: Vec<u16>,
    /// How much memory may be locked, bytes; `None` without a limit.
    pub memory_limit: Option<u64>,
    /// The highest priority that may be asked for; `None` without a limit.
    pub priority_limit: Option<u64>,
}

/// One thing that was asked for and is not to be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lack {
    /// Memory may be locked up to this limit only, bytes.
    MemoryLimit(u64),
    /// No memory is locked, and no limit says why.
    Memory,
    /// The limit of priorities is below the one that was asked for.
    PriorityLimit {
        /// What was asked for.
        asked: u8,
        /// The limit.
        limit: u64,
    },
    /// The loop is an ordinary thread, or one of a lower priority, and no limit says why.
    Priority(u8),
    /// Processors that are not there, or not for this process.
    Processors {
        /// These.
        missing: Vec<u16>,
        /// Where the loop runs.
        left: Vec<u16>,
    },
}

impl RealtimeConfig {
    /// What of it was not granted.
    pub fn lacking(&self, granted: &Granted) -> Vec<Lack> {
        let memory = match granted.memory_limit {
            Some(limit) => Lack::MemoryLimit(limit),
            None => Lack::Memory,
        };
        let asked = self.priority;
        let priority = match granted.priority_limit {
            Some(limit) if limit < u64::from(asked) => Lack::PriorityLimit { asked, limit },
            _ => Lack::Priority(asked),
        };
        let (wanted, left) = (&self.processors, &granted.processors);
        let mut missing = wanted.clone();
        // A loop that runs on others too has got none of them for itself.
        if left.iter().all(|number| wanted.contains(number)) {
            missing.retain(|number| !left.contains(number));
        }
        let processors = Lack::Processors {
            missing: missing.clone(),
            left: left.clone(),
        };
        [
            (self.lock_memory && !granted.is_locked).then_some(memory),
            (granted.priority < asked).then_some(priority),
            (!missing.is_empty()).then_some(processors),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

impl Granted {
    /// From `stat`, `status` and `limits` of a thread's folder in `/proc`; `None` if they have another form.
    pub fn read(stat: &str, status: &str, limits: &str) -> Option<Granted> {
        // The name of the program, in brackets, may have anything in it. The field behind it is the third.
        let stat: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let (priority, policy) = (stat.get(40 - 3)?, stat.get(41 - 3)?);
        let is_real_time = ["1", "2"].contains(policy);
        let of = |text: &'_ str, name: &str| -> Option<String> {
            let line = text.lines().find_map(|line| line.strip_prefix(name))?;
            Some(line.trim_start_matches(':').trim().to_owned())
        };
        let limit = |name| -> Option<Option<u64>> {
            let line = of(limits, name)?;
            match line.split_whitespace().next()? {
                "unlimited" => Some(None),
                value => Some(Some(value.parse().ok()?)),
            }
        };
        Some(Granted {
            is_locked: of(status, "VmLck")?.split(' ').next()? != "0",
            priority: if is_real_time {
                priority.parse().ok()?
            } else {
                0
            },
            processors: numbers(&of(status, "Cpus_allowed_list")?)?,
            memory_limit: limit("Max locked memory")?,
            priority_limit: limit("Max realtime priority")?,
        })
    }
}

/// The numbers of a list such as `0-3,7`.
fn numbers(list: &str) -> Option<Vec<u16>> {
    let mut all = Vec::new();
    for range in list.split(',') {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        all.extend(first.parse::<u16>().ok()?..=last.parse().ok()?);
    }
    Some(all)
}

fn list(numbers: &[u16]) -> String {
    let numbers: Vec<String> = numbers.iter().map(u16::to_string).collect();
    numbers.join(", ")
}

impl Lack {
    /// What to do about it.
    pub fn next_step(&self) -> String {
        match self {
            Lack::MemoryLimit(_) => "take the limit away: `ulimit -l unlimited` of the shell, or `LimitMEMLOCK=infinity` of the unit".to_owned(),
            Lack::Memory => "is there enough memory, and does no filter of system calls forbid `mlockall`?".to_owned(),
            Lack::PriorityLimit { asked, .. } => format!(
                "raise the limit: `ulimit -r {asked}` of the shell, or `LimitRTPRIO={asked}` and `RestrictRealtime=no` of the unit"
            ),
            Lack::Priority(_) => "let the unit have `RestrictRealtime=no`, and its control group some `cpu.rt_runtime_us` where there is such a file".to_owned(),
            Lack::Processors { .. } => "name processors that this computer has and the unit allows (`nproc --all`, `AllowedCPUs=`)".to_owned(),
        }
    }
}

impl fmt::Display for Lack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Lack::MemoryLimit(limit) => write!(
                f,
                "no memory is locked: the limit `memlock` is {limit} bytes, and with a limit what is needed later could be refused"
            ),
            Lack::Memory => f.write_str("no memory is locked, and no limit forbids it"),
            Lack::PriorityLimit { asked, limit } => {
                write!(
                    f,
                    "the loop has no priority {asked}: the limit `rtprio` is {limit}"
                )
            }
            Lack::Priority(asked) => {
                write!(
                    f,
                    "the loop has no priority {asked}, and no limit forbids it"
                )
            }
            Lack::Processors { missing, left } => write!(
                f,
                "the loop does not get the processors {} for itself; it runs on {}",
                list(missing),
                list(left)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A process that has got everything it asked for.
    fn granted() -> Granted {
        Granted {
            is_locked: true,
            priority: 30,
            processors: vec![2, 3],
            memory_limit: None,
            priority_limit: Some(40),
        }
    }

    #[test]
    fn each_thing_that_is_asked_for_is_lacking_by_itself_with_its_reason() {
        let asked = RealtimeConfig {
            lock_memory: true,
            priority: 30,
            processors: vec![3, 2],
            low_latency_processor: true,
        };
        let limit = 8 << 20;
        let processors = |missing: &[u16], left: &[u16]| Lack::Processors {
            missing: missing.to_vec(),
            left: left.to_vec(),
        };
        type Change = fn(&mut Granted);
        #[rustfmt::skip]
        let cases: [(Change, Vec<Lack>); 10] = [
            (|_| {}, vec![]),
            (|it| it.priority = 31, vec![]),
            (|it| it.is_locked = false, vec![Lack::Memory]),
            (|it| (it.is_locked, it.memory_limit) = (false, Some(8 << 20)), vec![Lack::MemoryLimit(limit)]),
            (|it| it.priority = 29, vec![Lack::Priority(30)]),
            (|it| (it.priority, it.priority_limit) = (0, None), vec![Lack::Priority(30)]),
            (|it| (it.priority, it.priority_limit) = (0, Some(30)), vec![Lack::Priority(30)]),
            (|it| (it.priority, it.priority_limit) = (0, Some(29)), vec![Lack::PriorityLimit { asked: 30, limit: 29 }]),
            (|it| it.processors = vec![2], vec![processors(&[3], &[2])]),
            (|it| it.processors = vec![0, 1, 2, 3], vec![processors(&[3, 2], &[0, 1, 2, 3])]),
        ];
        for (change, expected) in cases {
            let mut granted = granted();
            change(&mut granted);
            assert_eq!(asked.lacking(&granted), expected, "{granted:?}");
            // Nothing that was not asked for is lacking.
            assert_eq!(RealtimeConfig::default().lacking(&granted), []);
        }
    }

    #[test]
    fn what_a_thread_has_is_read_from_its_folder() {
        let fields = |priority: u32, policy: u32| {
            format!(
                "7 (a ) b) S {} {priority} {policy} 0 0",
                "0 ".repeat(36).trim_end()
            )
        };
        let status = "Name:\ta\nVmLck:\t   16384 kB\nCpus_allowed_list:\t0-1,3\n";
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
            Max locked memory         unlimited            unlimited            bytes     \n\
            Max realtime priority     40                   40                   \n";
        let read = |stat: &str| Granted::read(stat, status, limits).unwrap();
        let expected = Granted {
            processors: vec![0, 1, 3],
            ..granted()
        };
        assert_eq!(read(&fields(30, 1)), expected);
        // An ordinary thread, whatever its priority is called.
        assert_eq!(read(&fields(30, 0)).priority, 0);
        let unlocked = status.replace("16384", "0");
        let limited = limits.replace("unlimited", "8388608  ");
        let read = Granted::read(&fields(30, 1), &unlocked, &limited).unwrap();
        assert_eq!((read.is_locked, read.memory_limit), (false, Some(8 << 20)));
        for wrong in ["", "7 (a) S 1 2"] {
            assert_eq!(Granted::read(wrong, status, limits), None);
        }
        assert_eq!(Granted::read(&fields(30, 1), "", limits), None);
        assert_eq!(Granted::read(&fields(30, 1), status, ""), None);
    }
}
