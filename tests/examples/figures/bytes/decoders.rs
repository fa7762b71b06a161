//! The decoders of both directions and profiles.

use dsp_protocol::{Decoded, Decoder, Downlink, Profile, Uplink};
use fastrand::Rng;

use super::traffic::Traffic;

/// One decoder, and what it made of its bytes.
struct Listener<M> {
    profile: Profile,
    decoder: Decoder<M>,
    messages: u64,
    rejected: u64,
}

impl<M: Traffic> Listener<M> {
    fn new(profile: Profile) -> Self {
        Listener {
            profile,
            decoder: Decoder::with_profile(profile),
            messages: 0,
            rejected: 0,
        }
    }

    /// Every call takes a byte or answers something, and what is taken for a message is one: it means the same when it
    /// is written and read again.
    fn hear(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (used, decoded) = self.decoder.decode(bytes);
            assert!(used <= bytes.len(), "more bytes than there are");
            assert!(
                used > 0 || !matches!(decoded, Decoded::Incomplete),
                "the decoder stands still"
            );
            bytes = &bytes[used..];
            match decoded {
                Decoded::Incomplete => assert!(bytes.is_empty(), "bytes were left"),
                Decoded::Rejected(_) => self.rejected += 1,
                Decoded::Message(message) => {
                    self.messages += 1;
                    self.check(&message);
                }
            }
        }
    }

    fn check(&self, message: &M) {
        // Under the same numbers each time.
        let framed = |message: &M| message.frame(self.profile, &mut Rng::with_seed(0));
        let frame = framed(message);
        let (used, decoded) = Decoder::<M>::with_profile(self.profile).decode(frame.as_bytes());
        let Decoded::Message(again) = decoded else {
            panic!("{message:?} is written as {decoded:?}");
        };
        assert_eq!(used, frame.as_bytes().len());
        // Not the messages: a value that is not a number differs from itself.
        assert_eq!(
            framed(&again).as_bytes(),
            frame.as_bytes(),
            "{message:?} and {again:?}"
        );
    }
}

/// All four.
pub struct Decoders {
    downlink: [Listener<Downlink>; 2],
    uplink: [Listener<Uplink>; 2],
}

impl Decoders {
    /// Decoders that have heard nothing.
    pub fn new() -> Decoders {
        Decoders {
            downlink: Profile::ALL.map(Listener::new),
            uplink: Profile::ALL.map(Listener::new),
        }
    }

    /// Gives the same bytes to all of them.
    pub fn hear(&mut self, bytes: &[u8]) {
        self.downlink.iter_mut().for_each(|one| one.hear(bytes));
        self.uplink.iter_mut().for_each(|one| one.hear(bytes));
    }

    /// Messages and rejections of all of them.
    pub fn heard(&self) -> (u64, u64) {
        let down = self.downlink.iter().map(|one| (one.messages, one.rejected));
        let up = self.uplink.iter().map(|one| (one.messages, one.rejected));
        down.chain(up)
            .fold((0, 0), |(messages, rejected), (more, bad)| {
                (messages + more, rejected + bad)
            })
    }
}
