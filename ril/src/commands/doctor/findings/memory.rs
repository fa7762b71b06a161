//! Room in `/dev/shm`: bytes and inodes.

use super::super::facts::{FreeMemory, Look};
use super::finding::{About, Finding, Subject};

const ABOUT: About = About(Subject::Memory);

const MIB: u64 = 1 << 20;

/// With less no process starts: below this `ipc-types` lays its failures to the room.
const FULL_BYTES: u64 = 4 * MIB;
const FULL_INODES: u64 = 32;

/// What a robot may take. Its bridge takes 8.6 MiB and 232 inodes, its status 2.8 MiB and 101, each consumer 14 inodes; and twice
/// that while a provider that was restarted has begun a generation and consumers are in the former one.
const ROBOT_BYTES: u64 = 24 * MIB;
const ROBOT_INODES: u64 = 768;

/// How much is free of bytes or of inodes.
struct Room {
    /// Names of the findings: as good as full, and nearly full.
    ids: [&'static str; 2],
    free: u64,
    full: u64,
    for_a_robot: u64,
    /// An amount in words.
    words: fn(u64) -> String,
    next_step: &'static str,
}

/// Whether there is room for the processes of another robot.
pub(super) fn diagnose(free: &Look<FreeMemory>) -> Vec<Finding> {
    let free = match free {
        Ok(free) => free,
        Err(trouble) => {
            return vec![ABOUT.error(
                "memory-unclear",
                format!("looking at /dev/shm {trouble}"),
                "mount it: `mount -t tmpfs tmpfs /dev/shm`; nothing works without it",
            )];
        }
    };
    let bytes = Room {
        ids: ["memory-short", "memory-low"],
        free: free.bytes,
        full: FULL_BYTES,
        for_a_robot: ROBOT_BYTES,
        words: |bytes| format!("{} MiB", bytes / MIB),
        next_step: "remove what fills it (`df -h /dev/shm`), or enlarge it: `mount -o remount,size=256m /dev/shm`",
    };
    let inodes = free.inodes.map(|inodes| Room {
        ids: ["inodes-short", "inodes-low"],
        free: inodes,
        full: FULL_INODES,
        for_a_robot: ROBOT_INODES,
        words: |inodes| format!("{inodes} inodes"),
        next_step: "remove files that fill it (`df -i /dev/shm`), or allow more: `mount -o remount,nr_inodes=64k /dev/shm`",
    });
    let rooms: Vec<Room> = [Some(bytes), inodes].into_iter().flatten().collect();
    let troubles: Vec<Finding> = rooms.iter().filter_map(trouble).collect();
    if !troubles.is_empty() {
        return troubles;
    }
    let words: Vec<String> = rooms.iter().map(|room| (room.words)(room.free)).collect();
    let text = format!("/dev/shm has {} free", words.join(" and "));
    vec![ABOUT.note("memory-right", text)]
}

fn trouble(room: &Room) -> Option<Finding> {
    let [short, low] = room.ids;
    let [free, wanted] = [room.free, room.for_a_robot].map(room.words);
    if room.free < room.full {
        let text = format!("/dev/shm is as good as full, {free} are free: no process starts");
        Some(ABOUT.error(short, text, room.next_step))
    } else if room.free < room.for_a_robot {
        let text = format!("/dev/shm is nearly full, {free} are free: a robot may take {wanted}");
        Some(ABOUT.warning(low, text, room.next_step))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::facts::Trouble;
    use super::super::finding::Severity::{self, Error, Note, Warning};
    use super::*;

    fn said(free: &Look<FreeMemory>) -> Vec<(Severity, &'static str)> {
        let findings = diagnose(free);
        for finding in &findings {
            assert_eq!(finding.next_step.is_some(), finding.severity > Note);
        }
        findings.iter().map(|one| (one.severity, one.id)).collect()
    }

    #[test]
    fn bytes_and_inodes_are_enough_or_low_or_as_good_as_gone() {
        let right = (Note, "memory-right");
        let many = Some(ROBOT_INODES);
        for (bytes, inodes, expected) in [
            (ROBOT_BYTES, many, &[right][..]),
            (ROBOT_BYTES, None, &[right]),
            (ROBOT_BYTES - 1, many, &[(Warning, "memory-low")]),
            (FULL_BYTES, None, &[(Warning, "memory-low")]),
            (FULL_BYTES - 1, None, &[(Error, "memory-short")]),
            (
                ROBOT_BYTES,
                Some(ROBOT_INODES - 1),
                &[(Warning, "inodes-low")],
            ),
            (ROBOT_BYTES, Some(FULL_INODES), &[(Warning, "inodes-low")]),
            (
                ROBOT_BYTES,
                Some(FULL_INODES - 1),
                &[(Error, "inodes-short")],
            ),
            (
                0,
                Some(0),
                &[(Error, "memory-short"), (Error, "inodes-short")],
            ),
        ] {
            let free = Ok(FreeMemory { bytes, inodes });
            assert_eq!(said(&free), expected, "{free:?}");
        }
        let unclear = Err(Trouble::Failed("no such folder".to_owned()));
        assert_eq!(said(&unclear), [(Error, "memory-unclear")]);
    }

    #[test]
    fn amounts_are_reported() {
        let free = |bytes, inodes| Ok(FreeMemory { bytes, inodes });
        let text = |free| diagnose(&free)[0].text.clone();
        assert_eq!(
            text(free(64 * MIB, Some(800))),
            "/dev/shm has 64 MiB and 800 inodes free"
        );
        assert_eq!(text(free(64 * MIB, None)), "/dev/shm has 64 MiB free");
        assert_eq!(
            text(free(64 * MIB, Some(77))),
            "/dev/shm is nearly full, 77 inodes are free: a robot may take 768 inodes"
        );
    }
}
