//! The messages of `hero.view.v1`, between the server and its page: one JSON object in a text frame, whose `type` says what it is.
//!
//! `docs/view-protocol.md` describes them. Field names carry units. What is not known is `None`, which is null in JSON, and never 0; a
//! number that is not finite is null, too.

mod from_page;
mod to_page;
mod words;

pub(crate) use from_page::Incoming;
pub use from_page::{CheckRequest, OrderRequest, ReplayRequest};
pub(crate) use to_page::Outgoing;
pub use to_page::{
    Age, Alarm, Area, Attitude, Chart, CheckResult, Commander, Control, Event, Finding, Hello,
    Lease, LinkStatus, Movement, Now, OrderReport, Past, PastEvent, Phase, ReplayEvent, ReplayInfo,
    ReplayStatus, RobotStatus, RobotSummary, Robots, TileRange,
};
pub use words::{
    ChartSource, CheckKind, Freshness, Holder, LeaseAction, OrderKind, OrderStage, PROTOCOL,
    ReplayAction, Role, STALE_AFTER_MS, Severity, Switch, Weight,
};
