//! The words of `hero.view.v1`: fields that have one of a few values.

use serde::{Deserialize, Serialize};

/// The name of the WebSocket subprotocol, and of these messages.
pub const PROTOCOL: &str = "hero.view.v1";

/// A page that has heard nothing for so long covers itself.
pub const STALE_AFTER_MS: u64 = 1500;

/// How bad a state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// No finding.
    Ok,
    /// Good to know.
    Note,
    /// To be watched.
    Warning,
    /// To be acted on.
    Alarm,
}

/// How much an event matters, to a page, on a terminal and in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weight {
    /// Something went on as it should.
    Note,
    /// An order, or what became of it.
    Order,
    /// Something to look at.
    Warning,
    /// Something to act on.
    Alarm,
}

/// Whether values are of the present.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Freshness {
    /// Of the present.
    Fresh,
    /// Old: nothing newer has come.
    Stale,
    /// What made them has ended.
    Gone,
    /// None has ever come.
    Never,
}

/// The switch of the pilot's remote control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Switch {
    /// The autopilot flies.
    Auto,
    /// The pilot flies.
    Manual,
}

/// What can be ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrderKind {
    /// Hover where it is.
    Hold,
    /// Land where it is.
    Land,
    /// Fly to a place.
    Goto,
    /// Take off.
    Takeoff,
    /// Let the module take orders.
    Start,
    /// Let the module take no orders.
    Stop,
}

impl OrderKind {
    /// Whether any page with the right to order may give it at any time, because it only makes a flight calmer.
    pub fn is_everyones(self) -> bool {
        matches!(self, OrderKind::Hold | OrderKind::Land)
    }
}

/// How far an order has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrderStage {
    /// It did not leave the server, and will not later.
    NotSent,
    /// It is on its way to the bridge.
    Sent,
    /// The bridge has it.
    Accepted,
    /// The helicopter does it.
    InProgress,
    /// It is done.
    Done,
    /// The bridge did not take it.
    Refused,
    /// It was given up.
    Aborted,
    /// A newer order has taken its place.
    Replaced,
    /// What became of it is not known.
    Unknown,
}

/// What can be checked before it is ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CheckKind {
    /// A flight to a place.
    Goto,
    /// A take-off.
    Takeoff,
}

/// Where fence and path of a chart are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChartSource {
    /// The bridge publishes what it holds.
    Bridge,
    /// A file beside the server, which the bridge has not confirmed.
    File,
}

/// What a page may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Look.
    Watch,
    /// Look and order.
    Command,
}

/// Which page commands a robot, seen from one page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Holder {
    /// This page.
    You,
    /// Another page.
    Other,
    /// No page.
    None,
}

/// What a page wants of the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LeaseAction {
    /// To have it; the page that has it is asked.
    Take,
    /// Not to have it any more.
    Release,
    /// To give it to the page that asks.
    Give,
    /// Not to give it to the page that asks.
    Keep,
}

/// What can be done with a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReplayAction {
    /// Go on.
    Play,
    /// Stand still.
    Pause,
    /// Go to a place.
    Seek,
    /// Change the speed.
    Speed,
}
