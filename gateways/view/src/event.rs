//! What the program around the server gives it at its start ([`Settings`]) and tells it of each peer, what viewers want
//! of the program ([`Event`]), and the names of connections, of the viewers at their other ends, and of channels.

use std::collections::VecDeque;
use std::net::{IpAddr, SocketAddr};

use ipc_types::MonotonicNs;

use crate::http::tile::FileRequest;
use crate::page::{CheckRequest, OrderRequest, ReplayInfo, ReplayRequest, Role, TileRange};

/// What the program around the server is to do, or may want to log.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A page looks at `robot` from now on, is back from being hidden, or has been too slow for what happened: it is to
    /// get [`Past`](crate::page::Past) and all states anew.
    Joined {
        /// The page.
        viewer: ViewerId,
        /// The robot's number.
        robot: u32,
    },
    /// An order that the rules about pages allow. It is to be answered with [`OrderReport`](crate::page::OrderReport)s,
    /// of which one is the last.
    Order {
        /// The page.
        viewer: ViewerId,
        /// What is ordered.
        order: OrderRequest,
        /// When it was given, not later than it truly was: when the values were made that the page had drawn.
        issued: MonotonicNs,
        /// Address of the page and name of its token.
        from: String,
    },
    /// An order that they do not allow, for the log: the page has its answer. Those beyond five in a second do not
    /// come.
    NotSent {
        /// What was ordered.
        order: OrderRequest,
        /// Address of the page and name of its token.
        from: String,
        /// Why it was not sent.
        text: String,
    },
    /// A question before an order. It is to be answered with a [`CheckResult`](crate::page::CheckResult).
    Check {
        /// The page.
        viewer: ViewerId,
        /// What is asked.
        check: CheckRequest,
    },
    /// Command of `robot` has passed among the pages: for the log, and to be sent to pages as an event.
    Lease {
        /// The robot's number.
        robot: u32,
        /// What happened.
        text: String,
    },
    /// A page wants the recording to go on, or to stand elsewhere.
    Replay {
        /// The page.
        viewer: ViewerId,
        /// What it wants.
        request: ReplayRequest,
    },
    /// A browser asks for what lies on a disk. It is to be answered with [`Server::file`](crate::Server::file).
    File {
        /// What the answer is for.
        connection: ConnectionId,
        /// What it wants.
        request: FileRequest,
    },
    /// A channel has its first subscriber.
    Subscribed(ChannelId),
    /// Something that a peer may not, or cannot mean, for the log. It comes at the 1st, 2nd, 4th, 8th … time of each
    /// reason, so that a flood of it does not fill the log.
    Rejected {
        /// Address of the peer.
        from: String,
        /// Why.
        why: &'static str,
        /// How often that was so since the start.
        count: u64,
    },
}

/// What was not taken yet. It is drained after each call that can add something, and those who send are limited to
/// [`MESSAGES_PER_S`](crate::pace::MESSAGES_PER_S), so that it holds one round of them at most.
pub(crate) type Events = VecDeque<Event>;

/// A connection that was accepted. No two have the same one, as long as the server lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ConnectionId(pub(crate) u64);

/// A page, or a Foxglove client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ViewerId(pub(crate) u64);

/// The number of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ChannelId(pub(crate) u32);

impl ConnectionId {
    /// The viewer at the other end.
    pub(crate) fn viewer(self) -> ViewerId {
        ViewerId(self.0)
    }
}

/// What distinguishes this start of the server from all others: a text without meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(pub String);

/// A secret by which a viewer may look or order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its name, for the log.
    pub name: String,
    /// What it allows.
    pub role: Role,
    /// At least 128 random bits in letters and digits.
    pub secret: String,
    /// Whether it is good on this machine alone.
    pub is_local: bool,
}

/// How a server behaves.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Names and addresses by which requests may call this machine, beside those of loopback. Without ports.
    pub names: Vec<String>,
    /// Origins of other programs' pages that may connect, as `https://studio.example`.
    pub origins: Vec<String>,
    /// Which viewers may do what.
    pub tokens: Vec<Token>,
    /// The recording that is played; `None` if robots are shown live. In a replay all orders are refused.
    pub replay: Option<ReplayInfo>,
    /// The zooms of which there are tiles; `None` without any.
    pub tiles: Option<TileRange>,
    /// Whether the recording that is played has a report.
    pub has_report: bool,
}

/// What is at the remote end of a connection, as the operating system knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its address.
    pub address: SocketAddr,
    /// The address of this machine at which it has come.
    pub at: IpAddr,
    /// Whether it is a process of the user that the server runs as, on this machine.
    pub is_own_user: bool,
    /// Whether the bytes are those of a TLS connection.
    pub is_encrypted: bool,
}

impl Peer {
    /// Whether it is on this machine.
    pub fn is_loopback(&self) -> bool {
        self.address.ip().to_canonical().is_loopback()
    }
}
