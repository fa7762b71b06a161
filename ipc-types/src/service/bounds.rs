//! Bounds: every quality-of-service value of a service. iceoryx2's defaults lose data without an error (subscriber buffer 2,
//! history 0, overflow of requests), therefore nothing is left to a default.

/// Providers (publishers or servers) of one generation of a service: the process that began it.
pub const MAX_PROVIDERS: usize = 1;

/// Subscribers of a published service, in all processes. One more is refused at its creation.
pub const MAX_SUBSCRIBERS: usize = 32;

/// Samples that wait for a subscriber that does not read; the oldest is dropped for the newest.
///
/// At 5 kHz a buffer of 16 lost samples to scheduling alone; 128 are 2.5 s of telemetry at its default 50 Hz.
pub const SUBSCRIBER_BUFFER: usize = 128;

/// Samples that a subscriber may hold at once: one that is being read, one of reserve.
pub const MAX_BORROWED_SAMPLES: usize = 2;

/// Samples that a subscriber gets at once that comes to a service for the first time: a blackboard slot holds one value.
pub const LATEST: usize = 1;

/// Samples that a subscriber can get at once that was there before the publisher, or follows it to a new generation. It enters
/// some milliseconds after the publisher has begun: a tenth of a second at 500 Hz is enough for a machine that stalls.
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
/// Switched off, iceoryx2 drops them itself and forgets to give them back: it then keeps what it had mapped of each such
/// client, and ends the process at the 129th (`port/server.rs:714`, `port/details/receiver.rs:313`).
pub const FIRE_AND_FORGET: bool = true;

/// Reports about one request that a client may hold at once: the one being read, and the anchor of its round.
pub const MAX_BORROWED_REPORTS: usize = 2;

/// Requests that a client may fill in at once.
pub const MAX_LOANED_REQUESTS: usize = 1;

/// Nodes that may open one service: every port's process, and tools that only look.
pub const MAX_NODES: usize = 64;
