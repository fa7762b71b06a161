//! The messages of `hero.view.v1`, between the server and its page: one JSON object in a text frame, whose `type` says
//! what it is. First what the server says, then what a page says, then the words: fields that have one of a few values.
//!
//! `docs/view-protocol.md` describes them. Field names carry units. What is not known is `None`, which is null in JSON,
//! and never 0; a number that is not finite is null, too.

pub use operator::robot::changes::Weight;
pub use operator::robot::chart::ChartArea;
use serde::{Deserialize, Serialize};

/// The name of the WebSocket subprotocol, and of these messages.
pub const PROTOCOL: &str = "hero.view.v1";

/// A page that has heard nothing for so long covers itself.
pub const STALE_AFTER_MS: u64 = 1500;

/// `hello`: the first message, which says what server this is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL`].
    pub protocol: String,
    /// Hash of the page's files: a page of another build loads itself again.
    pub build: String,
    /// Changes with each start of the server: then nothing that the page knew holds.
    pub instance: String,
    /// What this page may do.
    pub role: Role,
    /// The robots that are shown.
    pub robots: Vec<u32>,
    /// `None` if robots are shown live.
    pub replay: Option<ReplayInfo>,
    /// Whether `/report` gives this page the report of the recording.
    pub report: bool,
    /// The zooms of which there are tiles under the map; `None` without any.
    pub tiles: Option<TileRange>,
    /// [`STALE_AFTER_MS`].
    pub stale_after_ms: u64,
}

/// The zooms of which there are tiles, from 0 to 23; between them a zoom may be missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileRange {
    /// The least one.
    pub min_zoom: u8,
    /// The deepest one. Deeper ones are drawn by enlarging it.
    pub max_zoom: u8,
}

/// The recording that is played.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayInfo {
    /// Name of the file.
    pub file: String,
    /// Length of the recording.
    pub duration_s: f64,
    /// UTC wall time of its beginning; `None` if the recording has none.
    pub start_unix_ms: Option<u64>,
    /// What flew when, in seconds from the beginning.
    pub phases: Vec<Phase>,
    /// What happened.
    pub events: Vec<ReplayEvent>,
}

/// Something that happened in a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayEvent {
    /// Seconds from its beginning.
    pub at_s: f64,
    /// How much weight it has.
    pub severity: Weight,
    /// What happened.
    pub text: String,
}

/// `robots`: the list of all robots, at changes and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Robots {
    /// One line each.
    pub robots: Vec<RobotSummary>,
}

/// A robot in the list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotSummary {
    /// Its number.
    pub robot: u32,
    /// Of its worst alarm.
    pub severity: Severity,
    /// Its worst alarm, or what it does.
    pub text: String,
    /// `None` if it is not known.
    pub flying: Option<bool>,
    /// `None` if it is not known.
    pub battery_v: Option<f64>,
    /// Of its bridge.
    pub link: Freshness,
}

/// `robot`: one robot in words, at changes and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotStatus {
    /// Its number.
    pub robot: u32,
    /// What the helicopter does.
    pub phase: String,
    /// What its module does.
    pub activity: String,
    /// State of its module.
    pub module: String,
    /// Whether the module takes no movement.
    pub blocked: bool,
    /// The link to the DSP.
    pub link: LinkStatus,
    /// `None` if it is not known.
    pub switch: Option<Switch>,
    /// The station that commands over a relay; `None` if none does.
    pub commander: Option<Commander>,
    /// The sender that has control in the bridge.
    pub control: Control,
    /// What lasts, the worst first.
    pub alarms: Vec<Alarm>,
    /// `None` if there is none.
    pub movement: Option<Movement>,
    /// For how long it has been in the air; `None` if it is not, or its take-off was not seen.
    pub flown_s: Option<f64>,
    /// Whether it is a recorded flight that is played.
    pub replayed: bool,
    /// Whether it comes over a relay.
    pub relayed: bool,
}

/// The link between bridge and DSP.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkStatus {
    /// In words.
    pub text: String,
    /// Its state by name.
    pub state: String,
    /// Since when nothing has come over it; `None` if it is not known.
    pub age_s: Option<f64>,
}

/// A station that commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Commander {
    /// Its name.
    pub text: String,
}

/// The sender that has control in the bridge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// Whether others are refused.
    pub exclusive: bool,
    /// `None` if no sender has it.
    pub holder: Option<String>,
}

/// An alarm that lasts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alarm {
    /// Stays the same while it lasts.
    pub id: String,
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong.
    pub text: String,
    /// What to do about it; `None` if there is no advice.
    pub next_step: Option<String>,
    /// For how long it has lasted.
    pub since_s: f64,
}

/// The movement that is under way, or was last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Movement {
    /// In words.
    pub text: String,
    /// Waypoints of its path.
    pub waypoints_total: u32,
    /// Waypoints that were reached.
    pub waypoints_reached: u32,
    /// `None` if it is not known.
    pub distance_to_go_m: Option<f64>,
    /// `None` if it is not known.
    pub time_to_go_s: Option<f64>,
}

/// `chart`: what is drawn under a robot, at changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// The robot's number.
    pub robot: u32,
    /// The source of fence and path.
    pub source: ChartSource,
    /// Of the bridge's outline; grows at each change.
    pub number: u64,
    /// Areas of the fence.
    pub fence: Vec<ChartArea>,
    /// Floor everywhere; `None` if there is none.
    pub floor_m: Option<f64>,
    /// Ceiling everywhere; `None` if there is none.
    pub ceiling_m: Option<f64>,
    /// Waypoints: latitude, longitude (degrees), altitude (m).
    pub path: Vec<[f64; 3]>,
    /// Latitude, longitude (degrees), altitude (m); `None` if it is not known.
    pub home: Option<[f64; 3]>,
}

/// Whether values are of the present, and how old they were when they were sent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Age {
    /// What the server judges.
    pub freshness: Freshness,
    /// `None` if there are no values.
    pub age_ms: Option<u64>,
}

/// Attitude of the helicopter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attitude {
    /// Right side down is positive.
    pub roll_deg: f64,
    /// Nose up is positive.
    pub pitch_deg: f64,
    /// From north, clockwise.
    pub yaw_deg: f64,
}

/// `now`: what changes all the time, at most 20 times a second. Of these a viewer gets the newest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Now {
    /// The robot's number.
    pub robot: u32,
    /// Grows by one; `seen` and orders name it.
    pub n: u64,
    /// The server's monotonic time when this was made, to which the ages refer.
    pub sent_ms: u64,
    /// Age of the telemetry.
    pub telemetry: Age,
    /// Age of the bridge's state.
    pub bridge: Age,
    /// Latitude and longitude, degrees; `None` if it is not known.
    pub position: Option<[f64; 2]>,
    /// The last one that was known, while `position` is not.
    pub lost_position: Option<[f64; 2]>,
    /// How old that is.
    pub lost_position_age_ms: Option<u64>,
    /// `None` if it is not known.
    pub altitude_m: Option<f64>,
    /// Above the place of the take-off; `None` if it is not known.
    pub height_m: Option<f64>,
    /// `None` if it is not known.
    pub attitude: Option<Attitude>,
    /// `None` if it is not known.
    pub ground_speed_mps: Option<f64>,
    /// `None` if it is not known.
    pub climb_mps: Option<f64>,
    /// `None` if it is not known, or nothing moves.
    pub course_deg: Option<f64>,
    /// `None` if it is not known.
    pub battery_v: Option<f64>,
    /// `None` if it is not known.
    pub fuel_percent: Option<f64>,
    /// Of the GPS; `None` if it is not known.
    pub fix: Option<String>,
    /// `None` if it is not known.
    pub flying: Option<bool>,
    /// How many were replaced by newer ones since the last one that this viewer was sent, because it is slow. The
    /// server fills it in, so it must stay the last field.
    pub left_out: u64,
}

/// `past`: the last minutes, for a page that comes, or that was hidden.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Past {
    /// The robot's number.
    pub robot: u32,
    /// Latitude and longitude, degrees; `None` where it is not known how the robot came from one place to the next.
    pub track: Vec<Option<[f64; 2]>>,
    /// Seconds before now, negative: the moments of the following rows.
    pub t_s: Vec<f64>,
    /// `None` where it was not known.
    pub altitude_m: Vec<Option<f64>>,
    /// `None` where it was not known.
    pub ground_speed_mps: Vec<Option<f64>>,
    /// `None` where it was not known.
    pub battery_v: Vec<Option<f64>>,
    /// What flew when, in seconds before now.
    pub phases: Vec<Phase>,
    /// The newest last.
    pub events: Vec<PastEvent>,
}

/// A stretch of time in which the helicopter did one thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Its beginning.
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
    /// What it did.
    pub text: String,
}

/// An event of the past.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PastEvent {
    /// UTC wall time.
    pub at_unix_ms: u64,
    /// How much weight it has.
    pub severity: Weight,
    /// What happened.
    pub text: String,
}

/// `event`: something that happened just now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// The robot's number.
    pub robot: u32,
    /// UTC wall time.
    pub at_unix_ms: u64,
    /// How much weight it has.
    pub severity: Weight,
    /// What happened.
    pub text: String,
}

/// `check`: the answer to a [`CheckRequest`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckResult {
    /// The number that the page chose.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// Of the worst finding. An order with an alarm is not taken.
    pub severity: Severity,
    /// What was found.
    pub findings: Vec<Finding>,
    /// `None` if it is not known.
    pub distance_m: Option<f64>,
    /// `None` if it is not known.
    pub duration_s: Option<f64>,
}

/// Something that a check found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What was found.
    pub text: String,
    /// What to do about it; `None` if there is no advice.
    pub next_step: Option<String>,
}

/// `order`: how far an order has come. All pages that look at the robot get it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderReport {
    /// The number that the page chose.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// What was ordered.
    pub kind: OrderKind,
    /// How far it has come.
    pub stage: OrderStage,
    /// In words.
    pub text: String,
    /// Whether this is the last word.
    #[serde(rename = "final")]
    pub is_final: bool,
}

/// `lease`: which page commands a robot, at changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lease {
    /// The robot's number.
    pub robot: u32,
    /// Which page commands.
    pub holder: Holder,
    /// Whether a page asks for it.
    pub asked: bool,
    /// Whether that is this page.
    pub asks: bool,
    /// When it ends without a sign of the holder; `None` if no page holds it.
    pub expires_ms: Option<u64>,
}

/// `replay`: where a recording is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayStatus {
    /// Seconds from its beginning.
    pub position_s: f64,
    /// Whether it goes on.
    pub playing: bool,
    /// How much faster than it was recorded.
    pub speed: f64,
}

/// A message to a page.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub(crate) enum Outgoing<'a> {
    Hello(&'a Hello),
    Robots(&'a Robots),
    Robot(&'a RobotStatus),
    Chart(&'a Chart),
    Now(&'a Now),
    Past(&'a Past),
    Event(&'a Event),
    Check(&'a CheckResult),
    Order(&'a OrderReport),
    Lease(&'a Lease),
    Replay(&'a ReplayStatus),
    /// Twice a second, also without any sample: it proves contact with the server, and no more.
    Beat {
        sent_ms: u64,
        /// The wall clock of the server's machine; `None` if it is not known.
        unix_ms: Option<u64>,
    },
    /// The answer to a `ping`, by which the page knows how long messages are on their way.
    Pong {
        id: &'a str,
        sent_ms: u64,
    },
    /// Why the server closes.
    Refused {
        text: &'a str,
    },
}

impl Outgoing<'_> {
    /// The message as JSON.
    pub(crate) fn text(&self) -> String {
        // Serde fails for maps whose keys are no texts; these messages have none.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// `order`: what a page orders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderRequest {
    /// A number that the page chose at random: the same one is executed once.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// What is ordered.
    pub kind: OrderKind,
    /// The newest `now` that was drawn when the pilot ordered.
    pub seen: u64,
    /// Latitude and longitude, degrees; `None` if the order needs none.
    pub position: Option<[f64; 2]>,
    /// `None` if the order needs none.
    pub altitude_m: Option<f64>,
    /// The word that confirms; `None` if none was asked for.
    pub confirm: Option<String>,
}

/// `check`: what a page asks before it orders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRequest {
    /// A number that the page chose; the answer has it.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// What would be ordered.
    pub kind: CheckKind,
    /// Latitude and longitude, degrees; `None` if the order needs none.
    pub position: Option<[f64; 2]>,
    /// `None` if the order needs none.
    pub altitude_m: Option<f64>,
}

/// `replay`: what a page wants of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayRequest {
    /// What to do.
    pub action: ReplayAction,
    /// Where to go to, for [`ReplayAction::Seek`].
    pub position_s: Option<f64>,
    /// How fast, for [`ReplayAction::Speed`].
    pub speed: Option<f64>,
}

/// `open`: what a page says first, and when it looks at another robot.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct OpenRequest {
    pub token: Option<String>,
    pub robot: Option<u32>,
    pub rate_hz: f64,
    /// What the page calls itself over reloads and connections; `None` if it never comes back as the same.
    #[serde(default)]
    pub page: Option<String>,
}

/// A message from a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub(crate) enum Incoming {
    Open(OpenRequest),
    Seen { n: u64 },
    Order(OrderRequest),
    Check(CheckRequest),
    Lease { robot: u32, action: LeaseAction },
    Replay(ReplayRequest),
    Hidden { hidden: bool },
    Ping { id: String },
}

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
    /// A page other than the one that gets the message.
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
