//! [`Gateway`]: all of it as one value.
//!
//! A command becomes an order, of which at most one request is made. Its asker gets one answer:
//!
//! | | answer |
//! |---|---|
//! | first report of the bridge | that of [`answer_of`](crate::answer_of); a refusal is said in a text as well |
//! | no report for `answer_within` | failed: the outcome is unknown |
//! | a hold, a landing or a stop, while its start is awaited | cancelled: what was to follow the start is not sent |
//!
//! What becomes of it later is a text to all stations.
//!
//! `frames`: what a frame asks for; `orders`: commands become orders, and reports become answers; `answers`: how those
//! are sent; `missions`: the steps of a mission; `starts`: how it begins; `uploads`: how it comes; `fence`: the
//! geofence; `home`: what is kept of home; `lost`: what becomes of those of a station that is lost; `output`: what is
//! sent, and what the gateway says of itself; `parameters`: what is asked about them; `pending`: an order on its way.

mod answers;
mod fence;
mod frames;
mod home;
mod lost;
mod missions;
mod orders;
mod output;
mod parameters;
mod pending;
mod starts;
mod uploads;

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{MavlinkVehicle, ModuleStatus, Reason, SafetyAction};
use ipc_types::payload::{HeroTelemetry, MavlinkStations, ModuleState};

use self::pending::Pending;
use crate::commands::{Commands, FrameTime};
use crate::event::{Datagram, Event, Order, Task};
use crate::fence::Fence;
use crate::home::{Home, HomeKeeper};
use crate::message::TIMESYNC;
use crate::mission::Missions;
use crate::number::MavSeverity;
use crate::parameters::Parameters;
use crate::settings::Settings;
use crate::signing::{Forged, Signing};
use crate::stations::{StationAddress, Stations};
use crate::telemetry::Signature;
use crate::texts::Texts;
use crate::vehicle::{Heard, Vehicle};
use crate::wire::{MavFrame, MessageWriter, Rejected, frames};

/// Frames that were rejected are logged at most so often.
const REJECTED_PERIOD: Duration = Duration::from_secs(10);

/// Stations whose first signatures are those of before a restart are answered at most so often.
const TIME_PERIOD: Duration = Duration::from_millis(200);

/// The whole gateway: datagrams, samples, reports and the time in; datagrams, orders and tasks out.
#[derive(Clone, Debug)]
pub struct Gateway {
    settings: Settings,
    robot: u32,
    vehicle: Vehicle,
    home: Home,
    keeper: HomeKeeper,
    stations: Stations,
    commands: Commands,
    texts: Texts,
    signing: Option<Signing>,
    /// Of the newest input.
    moment: MonotonicNs,
    /// Which frame is read, or was read last.
    frame: FrameTime,
    parameters: Parameters,
    fence: Fence,
    missions: Missions,
    pending: Vec<Pending>,
    last_number: u64,
    last_hold: Option<MonotonicNs>,
    /// When the module was last to be started or stopped, or the bridge has reported on that.
    switched: Option<MonotonicNs>,
    /// When a station was last told our timestamp.
    told_time: Option<MonotonicNs>,
    shown: Option<Signature>,
    /// What was read and sent, and what was not taken, by reason.
    counts: MavlinkStations,
    /// What of them is in the log, and since when.
    rejected_logged: (u64, MonotonicNs),
    /// Whether the helicopter is heard, in the words for programs, and since when.
    told_vehicle: (MavlinkVehicle, MonotonicNs),
    datagrams: VecDeque<Datagram>,
    orders: VecDeque<Order>,
    tasks: VecDeque<Task>,
    events: VecDeque<Event>,
}

/// Whence a message about missions or fences comes.
#[derive(Clone, Copy)]
struct Origin {
    sender: StationAddress,
    is_station: bool,
    /// MAV_MISSION_TYPE of what it is about.
    mission_type: u8,
    /// When it is read.
    now: MonotonicNs,
}

impl Gateway {
    /// A gateway of a robot that was not heard yet.
    pub fn new(settings: Settings, robot: u32) -> Gateway {
        Gateway {
            vehicle: Vehicle::new(settings.lost_after),
            stations: Stations::new(&settings.stations, settings.station_lost_after),
            settings,
            robot,
            home: Home::default(),
            keeper: HomeKeeper::default(),
            commands: Commands::default(),
            texts: Texts::default(),
            signing: None,
            moment: MonotonicNs(0),
            frame: FrameTime::default(),
            parameters: Parameters::default(),
            fence: Fence::default(),
            missions: Missions::new(),
            pending: Vec::new(),
            last_number: 0,
            last_hold: None,
            switched: None,
            told_time: None,
            shown: None,
            counts: MavlinkStations::default(),
            rejected_logged: (0, MonotonicNs(0)),
            told_vehicle: (MavlinkVehicle::NoState, MonotonicNs(0)),
            datagrams: VecDeque::new(),
            orders: VecDeque::new(),
            tasks: VecDeque::new(),
            events: VecDeque::new(),
        }
    }

    /// Has the gateway sign its frames, and take none of other machines without a signature.
    #[must_use]
    pub fn signing(mut self, signing: Signing) -> Gateway {
        self.signing = Some(signing);
        self
    }

    /// A timestamp of signatures that is to be kept for the next start, if there is another one.
    pub fn poll_timestamp(&mut self) -> Option<u64> {
        self.signing.as_mut()?.take_kept()
    }

    /// A sample of telemetry has come.
    pub fn telemetry(&mut self, telemetry: &HeroTelemetry, now: MonotonicNs) {
        let before = self.vehicle.now().map(|known| known.is_flying());
        self.vehicle.set_telemetry(telemetry);
        self.look(now);
        let Some(known) = self.vehicle.now() else {
            return;
        };
        let is_flying = known.is_flying();
        if before.is_some_and(|before| before != is_flying) {
            let text = if is_flying {
                "in the air"
            } else {
                "on the ground"
            };
            self.say_to_all(MavSeverity::Info, text, now);
        }
    }

    /// A state of the bridge has come.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        let before = self.vehicle.last_state().copied();
        self.vehicle.set_state(state);
        self.home.follow(state.home());
        self.look(now);
        for (severity, text) in before.iter().flat_map(|before| changes(before, state)) {
            self.say_to_all(severity, &text, now);
        }
        self.look_at_mission(now);
    }

    /// A datagram that came at one moment is read at another one. What it orders was ordered when it came.
    pub fn datagram(
        &mut self,
        from: SocketAddr,
        bytes: &[u8],
        came: MonotonicNs,
        now: MonotonicNs,
    ) {
        self.moment = now;
        for frame in frames(bytes) {
            match frame {
                Ok(frame) if self.is_taken(from, &frame, now) => {
                    self.counts.frames_read += 1;
                    self.frame = FrameTime {
                        sequence: frame.sequence,
                        came: came.min(now),
                    };
                    self.frame(from, &frame, now);
                }
                Ok(_) => {}
                Err(why) => self.reject(why),
            }
        }
        let (logged, moment) = self.rejected_logged;
        let rejected = self.suspicious();
        if rejected > logged && now.since(moment) >= REJECTED_PERIOD {
            self.rejected_logged = (rejected, now);
            let text = format!(
                "{} frames were not taken, the last from {from}: `ril mavlink status` shows why",
                rejected - logged
            );
            self.note(Event::Warning(text));
        }
    }

    fn reject(&mut self, why: Rejected) {
        let counts = &mut self.counts;
        let count = match why {
            Rejected::Stray | Rejected::CutShort | Rejected::Flags => {
                &mut counts.refused_unreadable
            }
            // Stations send many.
            Rejected::UnknownMessage => &mut counts.refused_unknown,
            Rejected::Checksum => &mut counts.refused_checksum,
        };
        *count += 1;
    }

    /// How many frames were not taken that say that something is wrong.
    fn suspicious(&self) -> u64 {
        let counts = &self.counts;
        let forged = counts.refused_unsigned + counts.refused_signature + counts.refused_replayed;
        counts.refused_unreadable + counts.refused_checksum + counts.refused_full + forged
    }

    /// Whether a frame comes from where its sender may be without a signature, or has a right one.
    fn is_taken(&mut self, from: SocketAddr, frame: &MavFrame<'_>, now: MonotonicNs) -> bool {
        let count = match (&mut self.signing, &frame.signature) {
            (Some(signing), Some(signature)) => {
                match signing.check((frame.system, frame.component), signature, now) {
                    Ok(()) => return true,
                    Err(Forged::Signature) => &mut self.counts.refused_signature,
                    Err(why) => {
                        if why == Forged::OfBefore {
                            self.answer_of_before(from, now);
                        }
                        &mut self.counts.refused_replayed
                    }
                }
            }
            _ if from.ip().is_loopback() || self.settings.is_insecure => return true,
            _ => &mut self.counts.refused_unsigned,
        };
        *count += 1;
        false
    }

    /// Lets a station whose clock lies behind what an earlier gateway may have taken know our timestamp, so that its
    /// next ones are newer.
    fn answer_of_before(&mut self, to: SocketAddr, now: MonotonicNs) {
        let is_due = self.told_time.is_none_or(|at| now.since(at) >= TIME_PERIOD);
        if is_due {
            self.told_time = Some(now);
            let text = "the gateway has begun anew: send that again";
            self.say(&[to], MavSeverity::Warning, text, now);
            // Also when the text was said to it just before.
            let time = MessageWriter::new(TIMESYNC).i64(now.0 as i64).i64(0);
            self.send(to, &time);
        }
    }

    fn look(&mut self, now: MonotonicNs) {
        self.moment = now;
        match self.vehicle.look(now) {
            None => {}
            Some(Heard::Lost) => {
                let text = "the helicopter is not heard any more: nothing is sent until it is";
                self.say_to_all(MavSeverity::Critical, text, now);
                self.shown = None;
            }
            Some(_) => self.say_to_all(MavSeverity::Info, "the helicopter is heard", now),
        }
        let vehicle = self.vehicle.shown(now);
        if vehicle != self.told_vehicle.0 || self.told_vehicle.1.0 == 0 {
            self.told_vehicle = (vehicle, now);
        }
    }

    /// Does what is due. To be called after every input, and at the deadline.
    pub fn advance(&mut self, now: MonotonicNs) {
        self.look(now);
        self.look_for_lost_stations(now);
        for gone in self.stations.expire(now) {
            self.forget(gone);
            self.note(Event::Note(format!("{gone} at {} is gone", gone.address)));
        }
        self.give_up(now);
        self.advance_parameters(now);
        self.advance_missions(now);
        self.advance_fence(now);
        self.send_streams(now);
    }

    /// A station is not there any more.
    fn forget(&mut self, gone: StationAddress) {
        self.commands.forget(gone);
        self.fence.transfer.forget(gone);
        self.missions.transfer.forget(gone);
        if !self.stations.is_heard(gone.address) {
            self.parameters.forget(gone.address);
        }
    }

    /// When [`Gateway::advance`] is to be called at the latest.
    pub fn deadline(&mut self) -> Option<MonotonicNs> {
        let open = self.pending.iter().filter(|one| !one.is_answered);
        let answers = open.map(|one| one.answer_by).min();
        let streams = match self.vehicle.now() {
            Some(_) => {
                let routes = self.stations.routes();
                routes.filter_map(|route| route.streams.deadline()).min()
            }
            None => None,
        };
        [
            answers,
            streams,
            self.vehicle.deadline(),
            self.stations.deadline(),
            self.parameters.deadline(),
            self.missions.deadline(),
            self.fence.deadline(),
            self.deadline_of_home(),
            self.deadline_of_progress(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Whether there is a station, so that every sample counts.
    pub fn has_stations(&self) -> bool {
        !self.stations.is_empty()
    }

    /// The next datagram to be sent.
    pub fn poll_datagram(&mut self) -> Option<Datagram> {
        self.datagrams.pop_front()
    }

    /// The next order for the bridge.
    pub fn poll_order(&mut self) -> Option<Order> {
        self.orders.pop_front()
    }

    /// The next line for the log.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

/// What stations are told of two states, one after the other.
fn changes(before: &ModuleState, after: &ModuleState) -> Vec<(MavSeverity, String)> {
    let mut texts = Vec::new();
    let safety = |state: &ModuleState| state.safety.rule().zip(state.safety.action());
    match (safety(before), safety(after)) {
        (before, Some((rule, action))) if before != Some((rule, action)) => {
            let severity = match action {
                SafetyAction::Warn | SafetyAction::Refuse => MavSeverity::Warning,
                SafetyAction::Hold => MavSeverity::Critical,
                SafetyAction::Land => MavSeverity::Emergency,
            };
            texts.push((severity, format!("safety rule {rule}: {action}")));
        }
        (Some((rule, _)), None) => {
            texts.push((MavSeverity::Info, format!("safety rule {rule}: over")));
        }
        _ => {}
    }
    let end = &after.last_end;
    if end.is_another_than(&before.last_end)
        && let Some(reason @ Reason::SenderLost) = end.early()
    {
        texts.push((MavSeverity::Warning, format!("the path ended: {reason}")));
    }
    let aborted = |state: &ModuleState| state.status() == Some(ModuleStatus::Aborted);
    if aborted(after) && !aborted(before) && !after.imi_error().is_none() {
        let text = format!("the module was aborted: {}", after.imi_error());
        texts.push((MavSeverity::Critical, text));
    }
    texts
}
