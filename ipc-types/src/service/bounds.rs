//! Bounds: every quality-of-service value of a service, and what its events say. iceoryx2's defaults lose data without
//! an error (subscriber buffer 2, history 0, overflow of requests), therefore nothing is left to a default.

/// Providers (publishers or servers) of one generation of a service: the process that began it.
pub const MAX_PROVIDERS: usize = 1;

/// Subscribers of a published service, in all processes. One more is refused at its creation.
pub const MAX_SUBSCRIBERS: usize = 32;

/// Most memory for the samples of one topic, bytes. It is allocated when the publisher begins.
pub const MAX_TOPIC_MEMORY: usize = 64 << 20;

/// Subscribers that a topic can have whose samples are of this size, and which asks for `wanted`: as many as
/// [`MAX_TOPIC_MEMORY`] holds the samples for. With 32 a sample of up to 15,936 bytes has all of them, one of more than
/// 370,767 bytes none.
pub const fn subscribers_within_memory(sample_size: usize, wanted: usize) -> usize {
    let samples = match sample_size {
        0 => return wanted,
        size => MAX_TOPIC_MEMORY / size,
    };
    // The sample that is being filled in, and those that a late subscriber gets.
    let left = samples.saturating_sub(1 + HISTORY);
    let fitting = left / (SUBSCRIBER_BUFFER + MAX_BORROWED_SAMPLES);
    if fitting < wanted { fitting } else { wanted }
}

/// Samples that wait for a subscriber that does not read; the oldest is dropped for the newest.
///
/// At 5 kHz a buffer of 16 lost samples to scheduling alone; 128 are 2.5 s of telemetry at its default 50 Hz.
pub const SUBSCRIBER_BUFFER: usize = 128;

/// Samples that a subscriber may hold at once: one that is being read, one of reserve.
pub const MAX_BORROWED_SAMPLES: usize = 2;

/// Samples that a subscriber gets at once that comes to a service for the first time: a blackboard slot holds one
/// value.
pub const LATEST: usize = 1;

/// Samples that a subscriber can get at once that was there before the publisher, or follows it to a new generation. It
/// enters some milliseconds after the publisher has begun: a tenth of a second at 500 Hz is enough for a machine that
/// stalls.
pub const HISTORY: usize = 50;

/// Clients of a request service, in all processes. One more is refused at its creation.
pub const MAX_CLIENTS: usize = 16;

/// Requests that a client may have open: a path keeps two open at a time, the rest is reserve.
///
/// The server's memory, the cost of each report and the time that it takes to let a dead client go all grow with this
/// number: iceoryx2 makes `2 * MAX_OUTSTANDING + 1` channels for every client, 17, and looks at each of
/// them for each report.
pub const MAX_OUTSTANDING: usize = 8;

/// Reports that wait for a client that does not read: accepted, progress and final twice over.
///
/// At the bound progress is refused to the server, and the final report is kept by it until there is room.
pub const RESPONSE_BUFFER: usize = 8;

/// Whether a server is given the requests of clients that are gone. Our server drops these unseen.
///
/// Switched off, iceoryx2 drops them itself and forgets to give them back: it then keeps what it had mapped of each
/// such client, and ends the process at the 129th (`port/server.rs:714`, `port/details/receiver.rs:313`).
pub const FIRE_AND_FORGET: bool = true;

/// Reports about one request that a client may hold at once: the one being read, and the anchor of its round.
pub const MAX_BORROWED_REPORTS: usize = 2;

/// Requests that a client may fill in at once.
pub const MAX_LOANED_REQUESTS: usize = 1;

/// Nodes that may open one service: every port's process, and tools that only look.
pub const MAX_NODES: usize = 64;

/// What an event says. Every event is only a reason to wake up and drain; the data is in the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum EventCode {
    /// There is something to receive: a sample, a request, a report, or a request that was given up.
    Data = 1,
    /// A port of the other side was created.
    Arrived = 2,
    /// A port of the other side was dropped.
    Left = 3,
    /// A port of the other side died; sent by the provider, which cleans up after it.
    Died = 4,
}

/// The largest event id; four are used, the rest is room.
pub const EVENT_ID_MAX: usize = 15;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_samples_have_fewer_subscribers() {
        let of = |size| subscribers_within_memory(size, MAX_SUBSCRIBERS);
        assert_eq!([of(1), of(15_936), of(15_937)], [32, 32, 31]);
        assert_eq!([of(370_767), of(370_768), of(1 << 20)], [1, 0, 0]);
        for size in [1, 4096, 15_936, 15_937, 100_000, 370_767] {
            let per_subscriber = SUBSCRIBER_BUFFER + MAX_BORROWED_SAMPLES;
            let samples = of(size) * per_subscriber + HISTORY + 1;
            assert!(samples * size <= MAX_TOPIC_MEMORY, "{size}");
        }
        assert_eq!(subscribers_within_memory(4096, 4), 4);
    }
}
