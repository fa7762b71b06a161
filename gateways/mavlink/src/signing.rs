//! [`Signing`]: MAVLink 2's signatures: <https://mavlink.io/en/guide/message_signing.html>.
//!
//! A signature is 48 bits of SHA-256 over the key and the frame with a timestamp. The timestamps of a stream, which is
//! a system, a component and a link, rise strictly, so that a frame that another sender repeats is not taken:
//!
//! | a right signature comes | its timestamp is newer | it is not |
//! |---|---|---|
//! | of a stream that is known | taken | replayed |
//! | of another, and there is room | taken, unless it is more than a minute behind: replayed | – |
//! | of another, and there is none | replayed, unless a stream that is more than a minute behind makes room | – |
//! | of another, and not newer than all that the gateway before a restart may have taken | of before | – |
//!
//! The program around keeps a timestamp that lies up to a minute ahead of ours and of all that were taken. After a
//! restart ours are newer than it, so that they rise, and the first one of a stream must be: what was taken before is
//! not taken again, also from another address. A station whose clock lies behind the kept timestamp learns ours from a
//! frame that it gets of us, and goes on from there, as the standard wants it. Ours never lies behind one that was
//! taken, so that stations with clocks ahead of ours take our frames.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;
use sha2::{Digest, Sha256};

use crate::wire::Signature;

/// Units of a timestamp in a second: it counts 10 µs from the beginning of 2015.
const PER_SECOND: u64 = 100_000;

/// The beginning of 2015 in Unix time, s.
const EPOCH_UNIX_S: u64 = 1_420_070_400;

/// How far behind the first frame of a stream may be.
const MAX_BEHIND: u64 = 60 * PER_SECOND;

/// How far ahead the timestamp that is kept lies, and from which rest on it is kept anew.
const AHEAD: u64 = 60 * PER_SECOND;
const REST: u64 = 30 * PER_SECOND;

/// Streams whose timestamps are known: as many as stations with two links each. The table says what becomes of a
/// further one.
const MAX_STREAMS: usize = 16;

/// Which of our links our frames go over: there is one.
const LINK: u8 = 0;

/// A timestamp has 48 bits.
const MAX_TIMESTAMP: u64 = (1 << 48) - 1;

/// A secret that the helicopter and its stations share.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SigningKey(pub [u8; 32]);

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(…)")
    }
}

impl SigningKey {
    /// The key of a text: 64 hexadecimal digits are the key itself, anything else is a passphrase, of which stations
    /// make a key by SHA-256.
    pub fn of(text: &str) -> SigningKey {
        let digit = |at: usize| u8::from_str_radix(text.get(at..at + 2)?, 16).ok();
        let is_hex = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let bytes: Option<Vec<u8>> = (0..32).map(|index| digit(2 * index)).collect();
        let bytes = bytes
            .filter(|_| is_hex)
            .and_then(|bytes| bytes.try_into().ok());
        SigningKey(bytes.unwrap_or_else(|| Sha256::digest(text).into()))
    }

    fn signature(&self, covered: &[u8]) -> [u8; 6] {
        let hash = Sha256::new()
            .chain_update(self.0)
            .chain_update(covered)
            .finalize();
        std::array::from_fn(|index| hash[index])
    }
}

/// The timestamp of a moment in Unix time.
pub fn timestamp(unix: Duration) -> u64 {
    let since = unix.saturating_sub(Duration::from_secs(EPOCH_UNIX_S));
    u64::try_from(since.as_micros() / 10).map_or(MAX_TIMESTAMP, |units| units.min(MAX_TIMESTAMP))
}

/// Why a signed frame is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forged {
    /// It was signed with another key.
    Signature,
    /// It is not newer than one that came before.
    Replayed,
    /// It may be one that was taken before the gateway was started again.
    OfBefore,
}

#[derive(Clone, Copy, Debug)]
struct SignedStream {
    system: u8,
    component: u8,
    link: u8,
    newest: u64,
}

/// Signs frames, and judges the signatures of frames that come.
#[derive(Clone, Debug)]
pub struct Signing {
    key: SigningKey,
    began: MonotonicNs,
    /// What our clock and what is kept say of the beginning.
    clock: u64,
    own: u64,
    kept: u64,
    /// What an earlier gateway has taken is not newer.
    before: u64,
    newest: u64,
    streams: Vec<SignedStream>,
}

impl Signing {
    /// With what the clock says at `now`, and the timestamp that was kept last, 0 if there is none.
    pub fn new(key: SigningKey, clock: u64, kept: u64, now: MonotonicNs) -> Signing {
        // A file has any number; above this one timestamps do not rise.
        let kept = kept.min(MAX_TIMESTAMP);
        Signing {
            key,
            began: now,
            clock: clock.max(kept.saturating_sub(AHEAD)),
            own: clock.max(kept),
            kept: 0,
            before: kept,
            newest: 0,
            streams: Vec::new(),
        }
    }

    /// What a first frame is compared with.
    fn reference(&self, now: MonotonicNs) -> u64 {
        let passed = now.since(self.began).as_micros() / 10;
        let clock = self.clock + u64::try_from(passed).unwrap_or(0);
        clock.max(self.newest)
    }

    /// Signs a frame that says that it is signed.
    pub fn sign(&mut self, frame: &mut Vec<u8>, now: MonotonicNs) {
        self.own = (self.own + 1).max(self.reference(now)).min(MAX_TIMESTAMP);
        frame.push(LINK);
        frame.extend(&self.own.to_le_bytes()[..6]);
        let signature = self.key.signature(frame);
        frame.extend(signature);
    }

    /// Whether a frame is taken.
    ///
    /// # Errors
    ///
    /// Why it is not.
    pub fn check(
        &mut self,
        (system, component): (u8, u8),
        signature: &Signature<'_>,
        now: MonotonicNs,
    ) -> Result<(), Forged> {
        if self.key.signature(signature.covered) != signature.bytes {
            return Err(Forged::Signature);
        }
        let Signature {
            link, timestamp, ..
        } = *signature;
        let oldest = self.reference(now).saturating_sub(MAX_BEHIND);
        let is_same = |one: &&mut SignedStream| {
            (one.system, one.component, one.link) == (system, component, link)
        };
        match self.streams.iter_mut().find(is_same) {
            Some(one) if timestamp > one.newest => one.newest = timestamp,
            Some(_) => return Err(Forged::Replayed),
            None if timestamp <= self.before && self.before > 0 => return Err(Forged::OfBefore),
            None if timestamp < oldest => return Err(Forged::Replayed),
            None => {
                if self.streams.len() == MAX_STREAMS {
                    // Frames of those are too old to be taken again.
                    self.streams.retain(|one| one.newest >= oldest);
                }
                if self.streams.len() == MAX_STREAMS {
                    return Err(Forged::Replayed);
                }
                self.streams.push(SignedStream {
                    system,
                    component,
                    link,
                    newest: timestamp,
                });
            }
        }
        self.newest = self.newest.max(timestamp);
        Ok(())
    }

    /// The timestamp that is to be kept for the next start, if there is another one.
    pub fn take_kept(&mut self) -> Option<u64> {
        let is_due = self.own.max(self.newest) + REST >= self.kept;
        is_due.then(|| {
            self.kept = self.own.max(self.newest) + AHEAD;
            self.kept
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::HEARTBEAT;
    use crate::wire::{MessageWriter, frames};

    const SECOND: u64 = 1_000_000_000;

    fn at(seconds: u64) -> MonotonicNs {
        MonotonicNs(seconds * SECOND)
    }

    fn heartbeat(signing: &mut Signing, system: u8, now: MonotonicNs) -> Vec<u8> {
        let message = MessageWriter::new(HEARTBEAT)
            .u32(0)
            .u8(6)
            .u8(8)
            .u8(0)
            .u8(4)
            .u8(3);
        let mut frame = message.frame_to_sign(0, system, 190);
        signing.sign(&mut frame, now);
        frame
    }

    fn check(signing: &mut Signing, frame: &[u8], now: MonotonicNs) -> Result<(), Forged> {
        let frame = frames(frame).next().unwrap().unwrap();
        let signature = frame.signature.unwrap();
        signing.check((frame.system, frame.component), &signature, now)
    }

    fn signing(key: &str, clock: u64, kept: u64) -> Signing {
        Signing::new(SigningKey::of(key), clock, kept, at(0))
    }

    #[test]
    fn a_key_is_hexadecimal_or_made_of_a_passphrase_as_stations_make_it() {
        assert_eq!(SigningKey::of(&"0f".repeat(32)), SigningKey([15; 32]));
        // printf correct-horse | sha256sum
        let SigningKey(made) = SigningKey::of("correct-horse");
        let other = SigningKey::of("correct-horsf");
        assert_eq!(made.len(), 32);
        assert_ne!(SigningKey(made), other);
        assert_eq!(format!("{other:?}"), "Key(…)");
        assert_eq!(timestamp(Duration::from_secs(EPOCH_UNIX_S + 1)), 100_000);
        assert_eq!(timestamp(Duration::ZERO), 0);
    }

    #[test]
    fn what_is_signed_is_taken_once_and_only_with_the_key() {
        let mut station = signing("secret", 1_000, 0);
        let mut own = signing("secret", 1_000, 0);
        let first = heartbeat(&mut station, 255, at(1));
        let second = heartbeat(&mut station, 255, at(1));
        assert_eq!(check(&mut own, &first, at(1)), Ok(()));
        assert_eq!(check(&mut own, &first, at(1)), Err(Forged::Replayed));
        assert_eq!(check(&mut own, &second, at(1)), Ok(()));
        assert_eq!(check(&mut own, &first, at(1)), Err(Forged::Replayed));
        let mut other = signing("another secret", 1_000, 0);
        let forged = heartbeat(&mut other, 255, at(9));
        assert_eq!(check(&mut own, &forged, at(9)), Err(Forged::Signature));
        let last = second.len() - 1;
        for place in [last, last - 6, last - 12] {
            let mut changed = heartbeat(&mut station, 255, at(2));
            changed[place] ^= 1;
            assert_eq!(check(&mut own, &changed, at(2)), Err(Forged::Signature));
        }
    }

    #[test]
    fn the_first_frame_of_a_stream_is_at_most_a_minute_behind() {
        let now = 10_000 * PER_SECOND;
        for (behind_s, expected) in [(59, Ok(())), (61, Err(Forged::Replayed))] {
            let mut own = signing("secret", now, 0);
            let mut station = signing("secret", now - behind_s * PER_SECOND, 0);
            let frame = heartbeat(&mut station, 255, at(0));
            assert_eq!(check(&mut own, &frame, at(0)), expected, "{behind_s} s");
        }
        // A robot without a clock takes it, and is not behind from then on.
        let mut own = signing("secret", 0, 0);
        let mut station = signing("secret", now, 0);
        let frame = heartbeat(&mut station, 255, at(0));
        assert_eq!(check(&mut own, &frame, at(0)), Ok(()));
        let answer = heartbeat(&mut own, 1, at(0));
        assert_eq!(check(&mut station, &answer, at(0)), Ok(()));
    }

    #[test]
    fn the_table_is_bounded_and_only_old_streams_make_room() {
        let mut own = signing("secret", 0, 0);
        let mut station = signing("secret", 0, 0);
        for system in 1..=16 {
            let frame = heartbeat(&mut station, system, at(1));
            assert_eq!(check(&mut own, &frame, at(1)), Ok(()));
        }
        let frame = heartbeat(&mut station, 17, at(2));
        assert_eq!(check(&mut own, &frame, at(2)), Err(Forged::Replayed));
        let first = heartbeat(&mut station, 1, at(50));
        assert_eq!(check(&mut own, &first, at(50)), Ok(()));
        let frame = heartbeat(&mut station, 17, at(100));
        assert_eq!(check(&mut own, &frame, at(100)), Ok(()));
        assert_eq!(own.streams.len(), 2);
        assert_eq!(check(&mut own, &first, at(100)), Err(Forged::Replayed));
    }

    #[test]
    fn our_own_rises_over_a_restart_with_a_clock_that_was_set_back() {
        let mut own = signing("secret", 1_000_000_000, 0);
        let before = heartbeat(&mut own, 1, at(0));
        let kept = own.take_kept().unwrap();
        assert_eq!(own.take_kept(), None);
        let _ = heartbeat(&mut own, 1, at(29));
        assert_eq!(own.take_kept(), None);
        let _ = heartbeat(&mut own, 1, at(31));
        assert!(own.take_kept().unwrap() > kept);
        let mut station = signing("secret", 1_000_000_000, 0);
        assert_eq!(check(&mut station, &before, at(0)), Ok(()));
        let mut again = signing("secret", 5, kept);
        let after = heartbeat(&mut again, 1, at(0));
        assert_eq!(check(&mut station, &after, at(0)), Ok(()));
        // A number that is no timestamp was kept.
        let mut full = signing("secret", 5, u64::MAX);
        let _ = heartbeat(&mut full, 1, at(1));
        assert_eq!(full.own, MAX_TIMESTAMP);
        assert!(full.take_kept().is_some());
        // A station that has heard it goes on from there, so that its frames are newer than what was kept.
        let mut theirs = heartbeat(&mut station, 255, at(1));
        assert_eq!(check(&mut again, &theirs, at(1)), Ok(()));
        // One that has not is told first.
        let mut late = signing("secret", 1_000_000_000, 0);
        theirs = heartbeat(&mut late, 254, at(1));
        assert_eq!(check(&mut again, &theirs, at(1)), Err(Forged::OfBefore));
        let told = heartbeat(&mut again, 1, at(1));
        assert_eq!(check(&mut late, &told, at(1)), Ok(()));
        theirs = heartbeat(&mut late, 254, at(1));
        assert_eq!(check(&mut again, &theirs, at(1)), Ok(()));
    }

    #[test]
    fn what_was_taken_before_a_restart_is_not_taken_after_it() {
        let clock = 1_000 * PER_SECOND;
        let mut own = signing("secret", clock, 0);
        let mut station = signing("secret", clock + 20 * PER_SECOND, 0);
        let mut kept = own.take_kept();
        let mut recorded = Vec::new();
        for second in 0..90 {
            let frame = heartbeat(&mut station, 255, at(second));
            assert_eq!(check(&mut own, &frame, at(second)), Ok(()));
            recorded.push(frame);
            // What the disk has is a second old.
            let passed = clock + second * PER_SECOND;
            let mut again = signing("secret", passed, kept.unwrap_or(0));
            for frame in recorded.iter().rev().take(60) {
                assert_eq!(
                    check(&mut again, frame, at(0)),
                    Err(Forged::OfBefore),
                    "{second} s"
                );
            }
            kept = own.take_kept().or(kept);
        }
    }
}
