//! The power is cut at any byte: what was flushed before is read, and a whole file is made of it.

use std::time::Duration;

use proptest::prelude::*;
use recording::read::{check, messages, recover};
use recording::{FileAction, Part, Settings};

use crate::disk::Disk;
use crate::session::Session;
use crate::stock;

/// Time that passes, channel, and length of a message.
type Script = Vec<(u64, usize, usize)>;

fn script() -> impl Strategy<Value = Script> {
    let step = (0..120_u64, 0..3_usize, 0..1500_usize);
    prop::collection::vec(step, 1..60)
}

fn run(script: &Script, ends: bool) -> Session {
    let mut session = Session::new(Settings::default(), 2);
    session.settle();
    for (index, (pause_ms, number, len)) in script.iter().enumerate() {
        session.pass(Duration::from_millis(*pause_ms));
        if index == script.len() / 2 {
            // A topic that comes later.
            let late = session.recorder.channel(crate::session::channel(2));
            session.channels.push(late.expect("room"));
        }
        let number = (*number).min(session.channels.len() - 1);
        session.add(number, *len);
        session.settle();
    }
    session.pass(Duration::from_secs(1));
    if ends {
        session.end();
    }
    session
}

/// Whether a process can be killed when `bytes` of the parts are written: between two parts, and within a part that
/// does not lie in one page.
fn can_be_killed_at(parts: &[Part], mut bytes: usize) -> bool {
    for Part { at, bytes: part } in parts {
        if bytes < part.len() {
            let last = at + part.len() as u64 - 1;
            return bytes == 0 || at / 4096 != last / 4096;
        }
        bytes -= part.len();
    }
    true
}

/// The disk when the power was cut within an action, with the messages that were flushed before. `is_within_page` is
/// whether the kernel would have let the cut happen there.
struct Cut {
    bytes: Vec<u8>,
    flushed: u64,
    is_possible: bool,
}

fn cut(session: &Session, index: usize, bytes: usize) -> Cut {
    let mut disk = Disk::default();
    for (action, _) in &session.done[..index] {
        disk.perform(action).expect("a disk that works");
    }
    let (action, flushed) = &session.done[index];
    let mut is_possible = true;
    match action {
        FileAction::Write { parts } => {
            let total: usize = parts.iter().map(|part| part.bytes.len()).sum();
            let bytes = bytes % (total + 1);
            disk.perform_cut(parts, bytes);
            is_possible = can_be_killed_at(parts, bytes);
        }
        action => disk.perform(action).expect("a disk that works"),
    }
    Cut {
        bytes: disk.files.pop().unwrap_or_default(),
        flushed: *flushed,
        is_possible: is_possible && index > 1,
    }
}

proptest! {
    #[test]
    fn nothing_that_was_flushed_is_missing_wherever_the_power_is_cut(
        script in script(),
        ends: bool,
        action in 1..200_usize,
        bytes: usize,
    ) {
        let session = run(&script, ends);
        let index = 1 + action % (session.done.len() - 1);
        let cut = cut(&session, index, bytes);
        let flushed = cut.flushed as usize;

        // The reader of the crate `mcap` goes from the beginning until something is wrong.
        let (stock, error) = stock::until_error(&cut.bytes);
        prop_assert!(stock.len() >= flushed, "{} of {flushed}: {error:?}", stock.len());
        let order: Vec<_> = stock.iter().map(|(_, _, time_ns, _)| *time_ns).collect();
        prop_assert!(order.is_sorted());

        // Ours finds the same, and perhaps what was about to become part of the file. Of a chunk whose length was being
        // written the stock one gives messages before it notices; ours reads none of it.
        let ours: Vec<_> = messages(&cut.bytes).flatten().collect();
        let fewest = if error.is_none() { stock.len() } else { flushed };
        prop_assert!(ours.len() >= fewest, "{} of {fewest}: {error:?}", ours.len());
        for (ours, stock) in ours.iter().zip(&stock) {
            prop_assert_eq!((ours.topic(), ours.sequence, ours.data()), (&*stock.0, stock.1, &*stock.3));
        }

        if cut.is_possible {
            // Both ends are as they should be, so that readers which begin at the end open it too.
            prop_assert!(error.is_none(), "{error:?}");
            let summary = mcap::Summary::read(&cut.bytes);
            prop_assert!(summary.is_ok(), "{summary:?}");
        }

        if cut.bytes.starts_with(mcap::MAGIC) {
            let mut whole = Vec::new();
            let recovered = recover(&cut.bytes, &mut whole).expect("a file");
            prop_assert_eq!(recovered.messages as usize, ours.len());
            prop_assert_eq!(stock::all(&whole).len(), ours.len());
            let stats = mcap::Summary::read(&whole).expect("a summary").expect("one").stats;
            prop_assert_eq!(stats.expect("statistics").message_count as usize, ours.len());
            let check = check(&whole);
            prop_assert!(check.is_complete, "{:?}", check.errors);
        }
    }
}

#[test]
fn any_byte_of_a_flush_can_be_the_last() {
    let script = vec![(0, 0, 300), (10, 1, 20), (300, 0, 700), (300, 1, 1)];
    let session = run(&script, true);
    for index in 2..session.done.len() {
        let total = written_by(&session.done[index].0);
        for bytes in (0..=total)
            .step_by(7)
            .chain(total.saturating_sub(12)..=total)
        {
            assert_readable(&session, index, bytes);
        }
    }
}

/// The file is extended twice.
#[test]
fn every_step_of_an_extension_can_be_the_last() {
    let script = vec![(300, 0, 700_000); 3];
    let session = run(&script, true);
    for index in 2..session.done.len() {
        let FileAction::Write { parts } = &session.done[index].0 else {
            continue;
        };
        let mut end = 0;
        for part in parts {
            end += part.bytes.len();
            for bytes in end - 3..end + 3 {
                assert_readable(&session, index, bytes);
            }
        }
    }
    let len = session.disk.files[0].len();
    assert!(len > 2_100_000 && len < 2_110_000, "{len}");
}

fn written_by(action: &FileAction) -> usize {
    match action {
        FileAction::Write { parts } => parts.iter().map(|part| part.bytes.len()).sum(),
        _ => 0,
    }
}

fn assert_readable(session: &Session, index: usize, bytes: usize) {
    let cut = cut(session, index, bytes);
    let (stock, error) = stock::until_error(&cut.bytes);
    assert!(stock.len() as u64 >= cut.flushed, "{index} {bytes}");
    assert!(
        error.is_none() || !cut.is_possible,
        "{index} {bytes}: {error:?}"
    );
    assert!(messages(&cut.bytes).flatten().count() as u64 >= cut.flushed);
}
