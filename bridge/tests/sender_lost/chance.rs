//! Senders that are killed, stopped or that end at random moments, some of them replaced by others before. What must
//! follow is worked out here from what happened to them alone.

use bridge::{Input, RequestKey};
use dsp_protocol::Command;
use fastrand::Rng;
use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, Reason, SenderLost, Stage};
use ipc_types::payload::MovementData;

use super::{MS, sender};
use crate::rig::{Rig, go_to, north};

/// What the flights had in them.
#[derive(Debug, Default)]
pub struct Seen {
    /// The process of the path's sender ended, or it gave the path up.
    pub ended: u64,
    /// It hung, and its lease ended.
    pub hung: u64,
    /// A sender was lost whose path another had replaced, or that went on without it.
    pub untouched: u64,
    /// From the loss, or the end of the lease, to the empty buffer.
    pub worst_ms: u64,
}

/// One sender and its path.
struct One {
    process: u32,
    request: u64,
    lost: SenderLost,
    lease_ms: u64,
    renews: bool,
    renewed: MonotonicNs,
}

/// Plays so many flights, from the seed `first` on.
pub fn play(first: u64, count: u64) -> Seen {
    let mut seen = Seen::default();
    for seed in first..first + count {
        fly(&mut Rng::with_seed(seed), &mut seen, seed);
    }
    seen
}

fn fly(random: &mut Rng, seen: &mut Seen, seed: u64) {
    let mut rig = Rig::flying();
    let senders = random.u32(1..=3);
    let mut all: Vec<One> = vec![];
    for number in 0..senders {
        let one = order(&mut rig, random, 100 + number);
        all.push(one);
        let pause_ms = 10 * random.u32(0..60);
        pass(&mut rig, &mut all, pause_ms);
    }
    let last = all.len() - 1;
    let victim = random.usize(0..all.len());
    let how = random.u8(0..3);
    let (present, lost) = (&all[last], &all[victim]);
    let goes_on = victim != last || how < 2 && lost.lost == SenderLost::Continue || {
        how == 2 && lost.lease_ms == 0
    };
    let present_request = present.request;
    let hangs = how == 2;
    rig.dsp.commands.clear();
    let begin = rig.now;
    match how {
        0 => rig.apply(Input::ProcessEnded(lost.process)),
        1 => rig.apply(Input::SenderGone(RequestKey::Movement(lost.request))),
        _ => all[victim].renews = false,
    }
    rig.exchange();
    // A lease runs out that long after it was renewed last.
    let due = match hangs {
        true => MonotonicNs(all[victim].renewed.0 + all[victim].lease_ms * MS),
        false => begin,
    };
    if goes_on {
        pass(&mut rig, &mut all, 2000);
        assert_eq!(
            rig.functionality(),
            Functionality::FollowingPath,
            "seed {seed}"
        );
        seen.untouched += 1;
        return;
    }
    let limit = MonotonicNs(due.0.max(begin.0) + 300 * MS);
    while rig.last(present_request).0 != Stage::Aborted || !rig.dsp.held.is_empty() {
        assert!(
            rig.now <= limit,
            "seed {seed}: {:?}",
            rig.last(present_request)
        );
        pass(&mut rig, &mut all, 10);
    }
    assert!(rig.now >= due || !hangs, "seed {seed}: too soon");
    seen.worst_ms = seen.worst_ms.max((rig.now.0 - due.0.max(begin.0)) / MS);
    assert_eq!(
        rig.last(present_request).1,
        Reason::SenderLost,
        "seed {seed}"
    );
    assert!(rig.dsp.commands.contains(&Command::InvalidatePath));
    let lands = all[last].lost == SenderLost::Land;
    assert_eq!(
        rig.functionality() == Functionality::Landing,
        lands,
        "seed {seed}"
    );
    let sent = rig.dsp.waypoints.len();
    pass(&mut rig, &mut all, 1000);
    assert_eq!(
        rig.dsp.waypoints.len(),
        sent,
        "seed {seed}: nothing follows"
    );
    match hangs {
        true => seen.hung += 1,
        false => seen.ended += 1,
    }
}

/// A path of some waypoints, which replaces the one before.
fn order(rig: &mut Rig, random: &mut Rng, process: u32) -> One {
    rig.sender = sender(process);
    let lost = random.choice([SenderLost::Continue, SenderLost::Hold, SenderLost::Land]);
    let lost = lost.unwrap_or(SenderLost::Hold);
    let lease_ms = random.choice([0, 500, 700]).unwrap_or(0);
    let count = random.u16(1..5);
    let mut request = 0;
    for number in 0..count {
        request = rig.movement(MovementData {
            path_id: process.into(),
            first: u16::from(number == 0),
            last: u16::from(number + 1 == count),
            lease_ms,
            sender_lost: lost.code(),
            ..go_to(north(500 + i32::from(number))).preempting()
        });
    }
    assert_ne!(
        rig.last(request).0,
        Stage::Refused,
        "{:?}",
        rig.last(request)
    );
    One {
        process,
        request,
        lost,
        lease_ms: lease_ms.into(),
        renews: true,
        renewed: rig.now,
    }
}

/// Time passes; who lives renews every 250 ms, and the bridge looks at the lease as its shell does.
fn pass(rig: &mut Rig, all: &mut [One], ms: u32) {
    for _ in 0..ms / 10 {
        for one in all.iter_mut() {
            if one.renews && rig.now.since(one.renewed).as_millis() >= 250 {
                one.renewed = rig.now;
            }
        }
        if let Some((path, until)) = rig.bridge.lease()
            && until.0 <= rig.now.0 + 10 * MS
            && let Some(one) = all.iter().find(|one| u64::from(one.process) == path)
        {
            rig.apply(Input::LeaseRenewed(one.renewed));
        }
        rig.run(10);
    }
}
