//! Explores every end that the writes to a tail may have when its publisher is killed, in every order that a compiler
//! may give them.

use super::*;

/// A write to a tail.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Write {
    Store(Field, u64),
    Byte(usize, u8),
    Fence,
}

const FIELDS: usize = Field::Beginnings as usize + 1;

/// A tail, and what is written to it.
#[derive(Clone, Debug, Default)]
struct Paper {
    head: [u64; FIELDS],
    bytes: [u8; 4],
    writes: Vec<Write>,
}

impl Paper {
    fn apply(&mut self, write: Write) {
        match write {
            Write::Store(field, value) => self.head[field as usize] = value,
            Write::Byte(at, byte) => self.bytes[at] = byte,
            Write::Fence => {}
        }
    }

    fn write(&mut self, write: Write) {
        self.apply(write);
        self.writes.push(write);
    }

    /// Number, beginnings and bytes of the piece; `None` if nothing waits.
    fn read(&self) -> Option<(u64, u64, u64, &[u8])> {
        let field = |field: Field| self.head[field as usize];
        let bytes = &self.bytes[..field(Field::Length) as usize];
        let sequence = field(Field::Sequence);
        (sequence > 0).then(|| {
            (
                sequence,
                field(Field::Epoch),
                field(Field::Beginnings),
                bytes,
            )
        })
    }
}

impl TailMemory for Paper {
    fn load(&self, field: Field) -> u64 {
        self.head[field as usize]
    }

    fn store(&mut self, field: Field, value: u64) {
        self.write(Write::Store(field, value));
    }

    fn fence(&mut self) {
        self.write(Write::Fence);
    }

    fn copy(&mut self, at: usize, bytes: &[u8]) {
        for (index, byte) in bytes.iter().enumerate() {
            self.write(Write::Byte(at + index, *byte));
        }
    }
}

/// Whether whichever writes a compiler may put first leave the piece before, nothing, or the piece after. A store
/// of the head comes after all that is before it; bytes may come earlier, but for a fence.
fn holds_wherever_it_ends(before: &Paper, writes: &[Write]) -> bool {
    let count = writes.len();
    let must_follow = |later: usize, earlier: usize| {
        let is_fenced = writes[earlier..=later].contains(&Write::Fence);
        is_fenced || matches!(writes[later], Write::Store(..))
    };
    let mut after = before.clone();
    writes.iter().for_each(|write| after.apply(*write));
    (0_u32..1 << count).all(|done| {
        let is_done = |index: &usize| done >> index & 1 == 1;
        let is_possible = (0..count).filter(is_done).all(|later| {
            let mut missing = (0..later).filter(|earlier| !is_done(earlier));
            !missing.any(|earlier| must_follow(later, earlier))
        });
        let mut left = before.clone();
        (0..count)
            .filter(is_done)
            .for_each(|index| left.apply(writes[index]));
        let left = left.read();
        !is_possible || left.is_none() || left == before.read() || left == after.read()
    })
}

/// Every step from one piece to another: more bytes of it, the next one, one begun anew.
fn steps_of_a_tail() -> Vec<(Paper, Vec<Write>)> {
    let piece = |tail: &mut Paper, sequence, beginnings, bytes: &[u8]| {
        keep(
            tail,
            MonotonicNs(9),
            [7, sequence],
            beginnings == 1,
            beginnings,
            bytes,
        );
    };
    let mut before = Paper::default();
    piece(&mut before, 3, 1, &[1, 2]);
    before.writes.clear();
    let next: [(u64, u32, &[u8]); 5] = [
        (3, 1, &[1, 2, 3]),
        (3, 1, &[1, 2, 3, 4]),
        (4, 1, &[5, 6, 7]),
        (3, 2, &[5, 6, 7]),
        (4, 2, &[5]),
    ];
    let steps = next.map(|(sequence, beginnings, bytes)| {
        let mut tail = before.clone();
        piece(&mut tail, sequence, beginnings, bytes);
        (before.clone(), tail.writes)
    });
    steps.into()
}

#[test]
fn a_tail_whose_publisher_is_killed_at_any_write_holds_a_whole_piece() {
    for (before, writes) in steps_of_a_tail() {
        assert!(holds_wherever_it_ends(&before, &writes), "{writes:?}");
    }
}

#[test]
fn a_tail_with_writes_in_another_order_is_found() {
    let is_found = |change: &dyn Fn(&mut Vec<Write>)| {
        steps_of_a_tail().into_iter().any(|(before, mut writes)| {
            change(&mut writes);
            !holds_wherever_it_ends(&before, &writes)
        })
    };
    assert!(!is_found(&|_| {}));
    assert!(
        is_found(&|writes| writes.retain(|write| *write != Write::Fence)),
        "no fence"
    );
    assert!(
        is_found(&|writes| writes.sort_by_key(|write| matches!(write, Write::Byte(..)))),
        "bytes last"
    );
    assert!(
        is_found(&|writes| writes.rotate_right(1)),
        "the number first"
    );
    let is_first = |write: &Write| *write == Write::Store(Field::Sequence, 0);
    assert!(
        is_found(&|writes| writes.retain(|write| !is_first(write))),
        "not taken back first"
    );
}
