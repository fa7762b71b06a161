//! [`Event`]: what viewers want of the program around the server.

use std::collections::VecDeque;

use crate::http::tile::FileRequest;
use crate::id::{Call, ChannelId, ConnectionId, ViewerId};
use crate::page::{CheckRequest, OrderRequest, ReplayRequest};

/// What the program around the server is to do, or may want to log.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A page looks at `robot` from now on, is back from being hidden, or has been too slow for what happened: it is to get
    /// [`Past`](crate::page::Past) and all states anew.
    Joined {
        /// The page.
        viewer: ViewerId,
        /// The robot's number.
        robot: u32,
    },
    /// A page that looked at `robot` does so no more.
    Left {
        /// The page.
        viewer: ViewerId,
        /// The robot's number.
        robot: u32,
        /// Whether it commanded the robot.
        commanded: bool,
    },
    /// An order that the rules about pages allow. It is to be answered with [`OrderReport`](crate::page::OrderReport)s, of which one is
    /// the last.
    Order {
        /// The page.
        viewer: ViewerId,
        /// What is ordered.
        order: OrderRequest,
        /// Address of the page and name of its token.
        from: String,
    },
    /// An order that they do not allow, for the log: the page has its answer. Those beyond five in a second do not come.
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
    /// A channel has lost its last subscriber.
    Unsubscribed(ChannelId),
    /// A Foxglove client calls a service. It is to be answered with [`Server::respond`](crate::Server::respond).
    ServiceCall {
        /// What the answer is for.
        call: Call,
        /// Name of the service.
        service: String,
        /// The request, JSON of its schema if the client keeps to it.
        request: Vec<u8>,
        /// Address of the client and name of its token.
        from: String,
    },
    /// A Foxglove client sets a parameter. Its new value is to be sent with [`Server::parameter`](crate::Server::parameter).
    SetParameter {
        /// Its name.
        name: String,
        /// The wanted value.
        value: serde_json::Value,
        /// Address of the client and name of its token.
        from: String,
    },
    /// Something that a peer may not, or cannot mean, for the log. It comes at the 1st, 2nd, 4th, 8th … time of each reason, so that
    /// a flood of it does not fill the log.
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
