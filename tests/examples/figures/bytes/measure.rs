//! So many bytes into the decoders and the core, and what became of them.

use std::time::Duration;

use dsp_protocol::Profile;
use fastrand::Rng;

use super::core::{Core, Heard};
use super::decoders::Decoders;
use super::heap::Heap;
use super::obliging::STATUS_PERIOD_MS;
use super::stream;

/// Bytes that go in at a time at the most; longer than any frame.
const CHUNK: usize = 512;
/// Memory of a buffer: a chunk, all of it twice, and a frame over.
const BUFFER: usize = 4 * CHUNK;
/// How many bytes of a usual line pass in a second.
const BYTES_PER_SECOND: u64 = 11_520;
/// Status periods with one rate of damage; then there is another.
const PERIODS_ALIKE: u32 = 2_000;
/// A share of the bytes goes in before growth is measured: whatever is taken once has been taken then.
const WARM_UP: u64 = 10;

/// What a run has seen.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    /// Bytes that went in.
    pub bytes: u64,
    /// What was taken from the allocator after the warm-up.
    pub heap: Heap,
    /// Messages that were understood, or samples that were published.
    pub messages: u64,
    /// What else there was: rejections by the decoders, or requests to the core.
    pub others: u64,
    /// Waypoints that the core sent.
    pub waypoints: u64,
}

/// Lets `feed` put bytes in until there were `bytes`; it answers how many it put in.
fn run(bytes: u64, mut feed: impl FnMut() -> usize) -> (u64, Heap) {
    let mut done = 0;
    let mut heap = Heap::now();
    let mut is_warm = false;
    while done < bytes {
        done += feed() as u64;
        if !is_warm && done >= bytes / WARM_UP {
            heap = Heap::now();
            is_warm = true;
        }
    }
    (done, heap.since())
}

/// Noise and damaged frames in turn, each byte into all four decoders.
pub fn decoders(bytes: u64, seed: u64) -> Tally {
    let mut random = Rng::with_seed(seed);
    let mut decoders = Decoders::new();
    let (mut line, mut spare) = (Vec::with_capacity(BUFFER), Vec::with_capacity(BUFFER));
    let (bytes, heap) = run(bytes, || {
        line.clear();
        if random.bool() {
            stream::noise(random.usize(..CHUNK), &mut random, &mut line);
        } else {
            while line.len() < CHUNK {
                stream::frame(&mut random, &mut line);
            }
            let one_in = 1 << (2 + random.usize(..10));
            stream::damage(one_in, &mut random, &mut line, &mut spare);
        }
        decoders.hear(&line);
        line.len()
    });
    let (messages, rejected) = decoders.heard();
    Tally {
        bytes,
        heap,
        messages,
        others: rejected,
        waypoints: 0,
    }
}

/// Nothing but noise and damaged frames into a bridge that hardly ever hears its DSP.
pub fn core_in_noise(profile: Profile, bytes: u64, seed: u64) -> Tally {
    let mut random = Rng::with_seed(seed);
    let mut core = Core::new(profile);
    let (mut line, mut spare) = (Vec::with_capacity(BUFFER), Vec::with_capacity(BUFFER));
    let (bytes, heap) = run(bytes, || {
        line.clear();
        if random.bool() {
            stream::noise(random.usize(..CHUNK), &mut random, &mut line);
        } else {
            stream::frame(&mut random, &mut line);
            stream::damage(32, &mut random, &mut line, &mut spare);
        }
        core.receive(&line);
        let time_us = line.len() as u64 * 1_000_000 / BYTES_PER_SECOND;
        core.advance(Duration::from_micros(time_us));
        if random.usize(..64) == 0 {
            core.act(random.u8(..), random.u64(..));
        }
        line.len()
    });
    tally(bytes, heap, core.finish())
}

/// Whole flights with a DSP that obliges, on a line that damages from nothing to every fourth byte, and puts in noise.
pub fn core_in_flight(profile: Profile, bytes: u64, seed: u64) -> Tally {
    let mut random = Rng::with_seed(seed);
    let mut core = Core::new(profile);
    let (mut line, mut spare) = (Vec::with_capacity(BUFFER), Vec::with_capacity(BUFFER));
    let (mut periods, mut one_in) = (0, usize::MAX);
    let (bytes, heap) = run(bytes, || {
        periods += 1;
        if periods % PERIODS_ALIKE == 0 {
            one_in = [usize::MAX, 10_000, 1_000, 100, 20, 4][random.usize(..6)];
        }
        line.clear();
        core.listen(&mut line);
        line.truncate(CHUNK);
        if one_in != usize::MAX {
            stream::damage(one_in, &mut random, &mut line, &mut spare);
            if random.usize(..50) == 0 {
                stream::frame(&mut random, &mut line);
            }
            if random.usize(..200) == 0 {
                stream::noise(random.usize(..64), &mut random, &mut line);
            }
        }
        // In two pieces, cut anywhere.
        let (front, back) = line.split_at(random.usize(..line.len() + 1));
        core.receive(front);
        core.receive(back);
        core.advance(Duration::from_millis(STATUS_PERIOD_MS.into()));
        if random.usize(..25) == 0 {
            core.act(random.u8(..), random.u64(..));
        }
        line.len()
    });
    tally(bytes, heap, core.finish())
}

fn tally(bytes: u64, heap: Heap, heard: Heard) -> Tally {
    Tally {
        bytes,
        heap,
        messages: heard.samples,
        others: heard.requests,
        waypoints: heard.waypoints,
    }
}
