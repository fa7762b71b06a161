//! [`Waiter::wait_for_any`]: one wait for the ports of a whole fleet.

use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::sealed::Look;
use super::{
    Descriptors, MAX_SOURCES, ReadySet, SAFETY_BOUND, Sleep, Source, WaitError, Waiter, Wake, drain,
};
use crate::time::MonotonicNs;

impl Waiter {
    /// Sleeps as [`Waiter::wait`] does, for any number of sources, and gives the keys of those that are ready: none
    /// when the time is over or a signal came.
    ///
    /// Up to [`MAX_SOURCES`] it is that wait. For more it is one `poll` of all of them, and takes memory for each: for
    /// tools that look at a fleet. The number of sources of a loop that flies is bounded.
    ///
    /// # Errors
    ///
    /// See [`WaitError`]; the number of sources is none.
    pub fn wait_for_any<K: Copy>(
        &self,
        sources: &mut [(K, &mut dyn Source)],
        timeout: Option<Duration>,
    ) -> Result<Vec<K>, WaitError> {
        if sources.len() <= MAX_SOURCES {
            return Ok(match self.wait(sources, timeout)? {
                Wake::Ready(ready) => ready.keys().copied().collect(),
                Wake::TimedOut | Wake::Interrupted => Vec::new(),
            });
        }
        let deadline = timeout.map_or(MonotonicNs(u64::MAX), |timeout| {
            MonotonicNs::now() + timeout
        });
        loop {
            let tended: Vec<bool> = sources.iter_mut().map(|(_, one)| one.service()).collect();
            let sleeps: Vec<Sleep<'_>> = sources.chunks(MAX_SOURCES).map(Sleep::of).collect();
            let Some(ready) = until(&sleeps, deadline, self)? else {
                return Ok(Vec::new());
            };
            let is_ready = |place: usize| ready[place / MAX_SOURCES].contains(place % MAX_SOURCES);
            let ready = sources.iter().zip(tended).enumerate();
            let ready: Vec<K> = ready
                .filter(|(place, (_, tended))| is_ready(*place) && !tended)
                .map(|(_, ((key, _), _))| *key)
                .collect();
            if !ready.is_empty() {
                return Ok(ready);
            }
        }
    }
}

/// What is ready of each sleep; `None` when the time is `deadline` or a signal came.
fn until(
    sleeps: &[Sleep<'_>],
    deadline: MonotonicNs,
    waiter: &Waiter,
) -> Result<Option<Vec<ReadySet>>, WaitError> {
    // Before anything is looked at: a listener that is made here announces nothing of what came before it.
    let descriptors: Result<Vec<_>, WaitError> = sleeps.iter().map(Sleep::descriptors).collect();
    let descriptors = descriptors?;
    let mut has_slept = false;
    loop {
        let now = MonotonicNs::now();
        let look = waiter.look(now);
        let look = |sleep: &Sleep<'_>| match look {
            Look::Thorough => sleep.look_thoroughly(),
            Look::Quick => sleep.look(Look::Quick),
        };
        let mut ready: Vec<ReadySet> = sleeps.iter().map(look).collect();
        let is_ready = |ready: &[ReadySet]| ready.iter().any(|ready| !ready.is_empty());
        if has_slept && now >= deadline && !is_ready(&ready) {
            return Ok(None);
        }
        let bounds = descriptors.iter().map(|(_, bound)| *bound);
        let until = match is_ready(&ready) {
            false => waiter.until(deadline, bounds.min().unwrap_or(SAFETY_BOUND)),
            true => now,
        };
        let polled = poll_all(sleeps, &descriptors, until.since(now), &mut ready)?;
        if is_ready(&ready) {
            return Ok(Some(ready));
        }
        if !polled {
            return Ok(None);
        }
        has_slept = true;
    }
}

/// Sleeps once, and adds what is ready; the listeners among them are emptied. False when a signal came.
fn poll_all(
    sleeps: &[Sleep<'_>],
    descriptors: &[(Descriptors<'_>, Duration)],
    timeout: Duration,
    ready: &mut [ReadySet],
) -> Result<bool, WaitError> {
    let places = descriptors.iter().flat_map(|(all, _)| all).enumerate();
    let (places, mut polled): (Vec<usize>, Vec<PollFd<'_>>) = places
        .filter_map(|(place, one)| Some((place, PollFd::from_borrowed_fd((*one)?, PollFlags::IN))))
        .unzip();
    // Too long for the kernel is as good as for ever: the bound is shorter.
    let timeout = Timespec::try_from(timeout).ok();
    match poll(&mut polled, timeout.as_ref()) {
        Ok(_) => {}
        Err(Errno::INTR) => return Ok(false),
        Err(errno) => return Err(errno.into()),
    }
    for (polled, place) in polled.iter().zip(places) {
        if polled.revents().is_empty() {
            continue;
        }
        let (sleep, place) = (place / MAX_SOURCES, place % MAX_SOURCES);
        ready[sleep].insert(place);
        if let Some(source) = sleeps[sleep].sources[place] {
            drain(source);
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::fd::AsFd;

    use super::*;
    use crate::payload::ModuleState;
    use crate::{Descriptor, Domain, Ipc, Publisher, RobotId, Subscriber};

    #[test]
    fn a_wait_for_a_fleet_says_what_is_ready_and_ends_by_time() {
        let domain = Domain::isolated();
        let robots: Vec<RobotId> = (1..=32).filter_map(RobotId::new).collect();
        let join = |robot: &RobotId| Ipc::join(&domain, *robot, "test").unwrap();
        let ipcs: Vec<Ipc> = robots.iter().map(join).collect();
        let mut states: Vec<Subscriber<ModuleState>> =
            ipcs.iter().map(|ipc| ipc.subscriber().unwrap()).collect();
        let (pipe, mut writer) = std::io::pipe().unwrap();
        let waiter = Waiter::new();
        let wait =
            |states: &mut [Subscriber<ModuleState>], mut other: Option<&mut dyn Source>, ms| {
                let mut pipe = Descriptor::new(pipe.as_fd());
                let mut sources: Vec<(u32, &mut dyn Source)> = vec![(0, &mut pipe)];
                for (robot, state) in robots.iter().zip(states) {
                    sources.push((robot.get(), state));
                }
                if let Some(other) = &mut other {
                    sources.push((99, *other));
                }
                let timeout = Some(Duration::from_millis(ms));
                waiter.wait_for_any(&mut sources, timeout).unwrap()
            };
        assert_eq!(wait(&mut states, None, 1), [], "the time is over");
        let mut publisher: Publisher<ModuleState> = ipcs[30].publisher().unwrap();
        publisher.publish(|_| {}).unwrap();
        // A subscriber that joins its provider may wake before its first sample.
        while states[30].latest().unwrap().is_none() {
            // The publisher serves those that join in the wait.
            assert_eq!(wait(&mut states, Some(&mut publisher), 60_000), [31]);
        }
        writer.write_all(b"x").unwrap();
        let ready = wait(&mut states, None, 60_000);
        assert!(ready.contains(&0), "{ready:?}");
    }
}
