//! [`ConnectedPage`]: one page that is connected, and why it may not give an order.

use std::sync::Arc;

use ipc_types::MonotonicNs;

use crate::authority::access::Permit;
use crate::authority::lease::Lease;
use crate::event::{Peer, ViewerId};
use crate::outbox::{Outbox, SEEN_AGE};
use crate::pace::RateLimit;
use crate::page::{self, Holder, OrderRequest, Outgoing, Role};

/// What is the same in each `hello`.
#[derive(Debug)]
pub(crate) struct Greeting {
    pub build: String,
    pub instance: String,
    pub replay: Option<page::ReplayInfo>,
    pub tiles: Option<page::TileRange>,
    pub has_report: bool,
}

impl Greeting {
    /// For a page with this role. `is_free`: it may look without a token.
    pub fn hello(&self, role: Role, is_free: bool, robots: &[u32]) -> page::Hello {
        page::Hello {
            protocol: page::PROTOCOL.to_owned(),
            build: self.build.clone(),
            instance: self.instance.clone(),
            role,
            robots: robots.to_vec(),
            replay: self.replay.clone(),
            report: self.has_report && is_free,
            tiles: self.tiles,
            stale_after_ms: page::STALE_AFTER_MS,
        }
    }
}

/// A page that is connected.
#[derive(Debug)]
pub(crate) struct ConnectedPage {
    pub peer: Peer,
    pub connected: MonotonicNs,
    /// What it may do; `None` until it has opened.
    pub permit: Option<Permit>,
    /// What it calls itself, over connections; `None` if it does not say it.
    pub name: Option<String>,
    /// What it looks at; `None` if there is nothing.
    pub robot: Option<u32>,
    /// Since when it looks at that.
    pub looks_since: MonotonicNs,
    pub is_hidden: bool,
    /// Whether `Event::Joined` is to be emitted.
    pub has_joined: bool,
    pub orders: RateLimit,
    pub outbox: Outbox,
}

impl ConnectedPage {
    /// Address and name of its token, for the log.
    pub fn from(&self) -> String {
        let name = self
            .permit
            .as_ref()
            .and_then(|permit| permit.name.as_deref());
        from(&self.peer, name)
    }

    /// When an order was given that names the values of number `seen`, not later than it truly was: they were made
    /// before the page drew them. A page that has drawn none yet had asked for them.
    pub fn issued(&self, seen: u64) -> MonotonicNs {
        self.outbox.made(seen).unwrap_or(self.looks_since)
    }

    pub fn may_order(&self) -> bool {
        self.permit
            .as_ref()
            .is_some_and(|permit| permit.role == Role::Command)
    }

    pub fn send(&mut self, message: &Outgoing<'_>) {
        self.outbox.push(Arc::from(message.text()));
    }
}

/// Who a peer is, for the log.
pub(crate) fn from(peer: &Peer, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("{} ({name})", peer.address),
        None => peer.address.to_string(),
    }
}

pub(crate) const REPLAYED: &str = "REPLAY: a recording takes no orders";
pub(crate) const ONLY_LOOKS: &str = "this page may only look: open it with `ril view`";
pub(crate) const OTHER_ROBOT: &str = "this page looks at another robot";

/// Why an order may not be given; `None` if it may.
pub(crate) fn refusal(
    page: &ConnectedPage,
    viewer: ViewerId,
    order: &OrderRequest,
    lease: Lease,
    is_replay: bool,
    now: MonotonicNs,
) -> Option<&'static str> {
    if is_replay {
        return Some(REPLAYED);
    }
    if !page.may_order() {
        return Some(ONLY_LOOKS);
    }
    if page.robot != Some(order.robot) {
        return Some(OTHER_ROBOT);
    }
    if order.kind.is_everyones() {
        return None;
    }
    match lease.holder() {
        None => return Some("no page commands this robot: take command first"),
        Some(holder) if holder != viewer => {
            return Some("another page commands this robot: ask for command");
        }
        Some(_) => {}
    }
    let made = page.outbox.made(order.seen);
    let is_recent = made.is_some_and(|made| now.since(made) <= SEEN_AGE);
    (!is_recent).then_some("what the page showed was more than 2 s old")
}

/// The lease, as a message to a page.
pub(crate) fn lease_message(
    robot: u32,
    lease: Lease,
    viewer: ViewerId,
    now: MonotonicNs,
) -> page::Lease {
    match lease {
        Lease::Free => page::Lease {
            robot,
            holder: Holder::None,
            asked: false,
            asks: false,
            expires_ms: None,
        },
        Lease::Held { by, until, asked } => page::Lease {
            robot,
            holder: if by == viewer {
                Holder::You
            } else {
                Holder::Other
            },
            asked: asked.is_some(),
            asks: asked.is_some_and(|asker| asker.viewer == viewer),
            expires_ms: Some(u64::try_from(until.since(now).as_millis()).unwrap_or(u64::MAX)),
        },
    }
}

/// Monotonic time as messages have it.
pub(crate) fn millis(now: MonotonicNs) -> u64 {
    now.0 / 1_000_000
}
