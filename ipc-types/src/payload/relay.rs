//! [`RelayLink`] and [`RelayStations`]: how the relay's links between machines are, on either side of them.

use super::text::ascii_text;
use crate::code::{Reason, RelayLinkState};
use crate::time::MonotonicNs;

/// Stations that [`RelayStations`] shows: the eight whose requests a robot's relay takes at a time, and as many that
/// only watch, wait for a place among those, or have fallen silent. More are served with telemetry and are not shown.
pub const MAX_STATIONS: usize = 16;

/// More than this of a clock or a way, s, says nothing: thirty years.
const MAX_CLOCK_NUMBER_S: f64 = 1e9;

/// Bytes of a station's name, in [`RelayLink::station`] and [`RelayStation::name`].
pub const STATION_NAME_LEN: usize = 32;

/// Bytes of [`RelayLink::link`]: an IPv6 address with its port and protocol has 52.
pub const LINK_TEXT_LEN: usize = 64;

shared_struct! {
    /// The link between this machine and a robot on another machine. Topic `relay/link`, published on the station's machine by
    /// the relay that provides the robot's services there; at every change and at least once a second.
    ///
    /// Times are host monotonic nanoseconds of this machine; 0 stands for "never". Counts begin with the relay's process.
    pub struct RelayLink("hero.RelayLink.v3") = 272 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// Since when `state` holds.
        pub since_ns: u64,
        /// When the last message of the robot came, 0 before the first.
        pub last_heard_ns: u64,
        /// The robot's monotonic clock minus this machine's; means something when `clock_valid` is 1.
        pub clock_offset_ns: i64,
        /// How far `clock_offset_ns` may be from the truth, to either side, s; means something when `clock_valid` is 1.
        pub clock_uncertainty_s: f64,
        /// Of the quickest exchange among the recent ones, from this machine to the robot and back, s; means something when
        /// `clock_valid` is 1.
        pub round_trip_s: f64,
        /// How long the relay's attempt to connect may take, s: at least ten round trips of the link.
        pub open_timeout_s: f64,
        /// Samples that came from the robot.
        pub samples_received: u64,
        /// Samples that the robot's relay sent and that did not come.
        pub samples_lost_on_air: u64,
        /// Samples that the robot's processes published and that the robot's relay did not read in time.
        pub samples_lost_in_relay: u64,
        /// Samples that were left out on purpose: by the rate of their topic, or because a newer one was there.
        pub samples_left_out: u64,
        /// Bytes received from the robot, without those of the network's own headers.
        pub bytes_received: u64,
        /// Bytes sent to the robot, without those of the network's own headers.
        pub bytes_sent: u64,
        /// Requests sent to the robot.
        pub orders_sent: u64,
        /// Messages about requests that were sent again because no answer came in time.
        pub orders_repeated: u64,
        /// Requests whose outcome the relay had to report as unknown.
        pub orders_unknown: u64,
        /// A [`RelayLinkState`](crate::code::RelayLinkState).
        pub state: u32 => state: RelayLinkState,
        /// The robot's number on its own machine.
        pub robot: u32,
        /// By how much the robot's clock is faster than this machine's, parts per billion; means something when `clock_valid`
        /// is 1.
        pub clock_drift_ppb: i32,
        /// 1 when offset, uncertainty, round trip and drift of the clock are known; they are not before the first exchange.
        pub clock_valid: u32,
        /// How often the robot's clock was seen to jump: a reboot, a suspend, a step. The offset was then measured anew.
        pub clock_resets: u32,
        /// How often the link went from up to down.
        pub outages: u32,
        /// Requests that were sent and have no final report yet.
        pub orders_open: u32,
        /// Why the robot takes no requests from this station: a [`Reason`], relay-not-permitted, relay-too-many-stations or
        /// relay-two-robots; 0 when it takes them, when this station is configured to send none, and before the first answer.
        pub refusal: u32 => refusal: Reason,
        /// The endpoint of the link such as `tcp/10.0.0.2:7447`, several divided by spaces; ASCII, filled up with zeros.
        pub link: [u8; LINK_TEXT_LEN],
        /// The name of this station, ASCII, filled up with zeros.
        pub station: [u8; STATION_NAME_LEN],
    }
}

shared_struct! {
    /// The stations that a robot is relayed to. Topic `relay/stations`, published on the robot's machine by its relay; at every
    /// change and at least once a second. It is relayed: every station shows who commands.
    ///
    /// Times are host monotonic nanoseconds; 0 stands for "never".
    pub struct RelayStations("hero.RelayStations.v4") = 1696 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// The stations, the first `count` of which mean something; the others are all zero.
        pub stations: [RelayStation; MAX_STATIONS],
        /// How many stations there are, 0 … 16.
        pub count: u32,
        /// Bytes of samples a second that go out at most, because the links to the stations carry no more or it is not known yet what
        /// they carry; 0 when all go out.
        pub samples_bytes_per_s: u32,
    }
}

shared_struct! {
    /// A station as the robot's relay knows it. Counts are of this life of the station.
    pub struct RelayStation("hero.RelayStation.v3") = 104 {
        /// The station's name, ASCII, filled up with zeros.
        pub name: [u8; STATION_NAME_LEN],
        /// When the last message of the station came.
        pub last_heard_ns: u64,
        /// Since when `is_up` holds.
        pub since_ns: u64,
        /// When the last request of the station was taken: the station with the latest one commands now.
        pub last_order_ns: u64,
        /// Requests of the station that were handed to the robot's processes.
        pub orders_executed: u64,
        /// Requests of the station that the relay refused.
        pub orders_refused: u64,
        /// Samples sent to the station.
        pub samples_sent: u64,
        /// 1 when the robot's configuration lets the station send requests.
        pub may_command: u32,
        /// 1 when messages of the station come, 0 when none has come for the configured time.
        pub is_up: u32,
        /// Requests of the station that have no final report yet.
        pub orders_open: u32,
        /// Why the relay takes no requests from the station: a [`Reason`], relay-not-permitted or relay-too-many-stations;
        /// 0 when it takes them.
        pub refusal: u32 => refusal: Reason,
        /// The `origin` that the relay writes into the requests of this life of the station.
        pub origin: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

impl RelayLink {
    /// Whether messages of the robot come.
    pub fn is_up(&self) -> bool {
        self.state() == Some(RelayLinkState::Up)
    }

    /// When it was published.
    pub const fn published(&self) -> MonotonicNs {
        MonotonicNs(self.published_ns)
    }

    /// When the last message of the robot came, `None` before the first.
    pub fn last_heard(&self) -> Option<MonotonicNs> {
        (self.last_heard_ns != 0).then_some(MonotonicNs(self.last_heard_ns))
    }

    /// How far the times of relayed samples may be from the truth, s; `None` if that is not known.
    pub fn clock_uncertainty(&self) -> Option<f64> {
        self.clock_number(self.clock_uncertainty_s)
    }

    /// The quickest way to the robot and back, s; `None` if that is not known.
    pub fn round_trip(&self) -> Option<f64> {
        self.clock_number(self.round_trip_s)
    }

    /// Part of the samples sent by the robot's relay that did not come, 0 … 1; `None` if none was sent.
    pub fn lost_on_air(&self) -> Option<f64> {
        let sent = self
            .samples_received
            .saturating_add(self.samples_lost_on_air);
        (sent > 0).then(|| self.samples_lost_on_air as f64 / sent as f64)
    }

    /// What the link has carried since the `earlier` sample of it: samples that came, and samples that were lost on the
    /// air. `None` if the relay has begun anew meanwhile, or no sample was sent.
    pub fn since(&self, earlier: &RelayLink) -> Option<(u64, u64)> {
        let came = self
            .samples_received
            .checked_sub(earlier.samples_received)?;
        let lost = self
            .samples_lost_on_air
            .checked_sub(earlier.samples_lost_on_air)?;
        (self.epoch_ns == earlier.epoch_ns && (came, lost) != (0, 0)).then_some((came, lost))
    }

    /// The endpoint of the link; `None` if it is not printable ASCII.
    pub fn link(&self) -> Option<&str> {
        ascii_text(&self.link)
    }

    /// The name of this station; `None` if it is not printable ASCII.
    pub fn station(&self) -> Option<&str> {
        ascii_text(&self.station)
    }

    fn clock_number(&self, seconds: f64) -> Option<f64> {
        let is_known = self.clock_valid != 0 && (0.0..=MAX_CLOCK_NUMBER_S).contains(&seconds);
        is_known.then_some(seconds)
    }
}

impl RelayStations {
    /// The stations. A count that the contract does not have is that of all places.
    pub fn stations(&self) -> &[RelayStation] {
        let count = usize::try_from(self.count).unwrap_or(MAX_STATIONS);
        &self.stations[..count.min(MAX_STATIONS)]
    }

    /// The station whose requests have this `origin`; `None` for 0, which is a program on the robot, and for one that
    /// is not shown.
    pub fn of_origin(&self, origin: u32) -> Option<&RelayStation> {
        let mut stations = self.stations().iter();
        stations.find(|station| origin != 0 && station.origin == origin)
    }

    /// The station that commands now: that of the latest request; `None` if no station has sent one.
    pub fn commanding(&self) -> Option<&RelayStation> {
        let ordered = self.stations().iter();
        let ordered = ordered.filter(|station| station.last_order_ns != 0);
        ordered.max_by_key(|station| station.last_order_ns)
    }

    /// Bytes of samples a second that go out at most; `None` when all go out.
    pub fn samples_rate(&self) -> Option<u32> {
        (self.samples_bytes_per_s != 0).then_some(self.samples_bytes_per_s)
    }

    /// When it was published.
    pub const fn published(&self) -> MonotonicNs {
        MonotonicNs(self.published_ns)
    }
}

impl RelayStation {
    /// The station's name; `None` if it is not printable ASCII.
    pub fn name(&self) -> Option<&str> {
        ascii_text(&self.name)
    }

    /// When the last message of the station came, `None` before the first.
    pub fn last_heard(&self) -> Option<MonotonicNs> {
        (self.last_heard_ns != 0).then_some(MonotonicNs(self.last_heard_ns))
    }

    /// When the last request of the station was taken, `None` before the first.
    pub fn last_order(&self) -> Option<MonotonicNs> {
        (self.last_order_ns != 0).then_some(MonotonicNs(self.last_order_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::ascii_bytes;
    use super::*;

    #[test]
    fn what_is_not_known_of_the_clock_is_nothing() {
        let known = RelayLink {
            clock_valid: 1,
            clock_uncertainty_s: 0.004,
            round_trip_s: 0.02,
            ..RelayLink::default()
        };
        assert_eq!(known.clock_uncertainty(), Some(0.004));
        assert_eq!(known.round_trip(), Some(0.02));
        let unknown = RelayLink {
            clock_valid: 0,
            ..known
        };
        assert_eq!(
            (unknown.clock_uncertainty(), unknown.round_trip()),
            (None, None)
        );
        for (clock_uncertainty_s, round_trip_s) in [(f64::NAN, -1.0), (f64::INFINITY, f64::MAX)] {
            let absurd = RelayLink {
                clock_uncertainty_s,
                round_trip_s,
                ..known
            };
            assert_eq!(
                (absurd.clock_uncertainty(), absurd.round_trip()),
                (None, None)
            );
        }
    }

    #[test]
    fn the_loss_on_the_air_is_a_part_of_what_was_sent() {
        let link = |samples_received, samples_lost_on_air| RelayLink {
            samples_received,
            samples_lost_on_air,
            ..RelayLink::default()
        };
        assert_eq!(link(0, 0).lost_on_air(), None);
        assert_eq!(link(75, 25).lost_on_air(), Some(0.25));
        assert_eq!(link(0, 1).lost_on_air(), Some(1.0));
        assert!(link(u64::MAX, u64::MAX).lost_on_air().is_some());
        assert_eq!(link(80, 25).since(&link(75, 22)), Some((5, 3)));
        assert_eq!(link(80, 25).since(&link(80, 25)), None);
        assert_eq!(link(1, 0).since(&link(80, 25)), None, "it began anew");
    }

    #[test]
    fn texts_are_printable_or_nothing() {
        let link = RelayLink {
            link: ascii_bytes("tcp/10.0.0.2:7447"),
            station: ascii_bytes("a name that is longer than there is room for"),
            ..RelayLink::default()
        };
        assert_eq!(link.link(), Some("tcp/10.0.0.2:7447"));
        assert_eq!(link.station().map(str::len), Some(STATION_NAME_LEN));
        let mut hostile = link;
        hostile.link[0] = 0x1b;
        assert_eq!(hostile.link(), None);
    }

    #[test]
    fn only_as_many_stations_as_there_are_places_are_shown() {
        let stations = |count| RelayStations {
            count,
            ..RelayStations::default()
        };
        assert_eq!(stations(2).stations().len(), 2);
        assert_eq!(stations(u32::MAX).stations().len(), MAX_STATIONS);
        assert_eq!(RelayStation::default().last_heard(), None);
    }

    #[test]
    fn the_station_with_the_latest_request_commands_and_a_request_names_its_station() {
        let mut stations = RelayStations {
            count: 3,
            ..RelayStations::default()
        };
        assert_eq!(stations.commanding(), None);
        for (index, (name, origin, last_order_ns)) in
            [("watcher", 7, 0), ("gcs", 8, 200), ("spare", 9, 100)]
                .into_iter()
                .enumerate()
        {
            stations.stations[index] = RelayStation {
                name: ascii_bytes(name),
                origin,
                last_order_ns,
                ..RelayStation::default()
            };
        }
        let name = |station: Option<&RelayStation>| station?.name().map(str::to_owned);
        assert_eq!(name(stations.commanding()).as_deref(), Some("gcs"));
        assert_eq!(name(stations.of_origin(9)).as_deref(), Some("spare"));
        assert_eq!(stations.of_origin(0), None, "a program on the robot");
        assert_eq!(stations.of_origin(10), None);
    }
}
