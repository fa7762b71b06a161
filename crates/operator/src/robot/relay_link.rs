//! The link of a relay to a robot on another machine: `LinkWatch` says whether a topic comes over it, [`LinkReport`]
//! says how it is, as text for people and as part of a JSON object for programs.

use std::fmt;
use std::time::Duration;

use ipc_types::code::{Reason, RelayLinkState};
use ipc_types::payload::RelayLink;
use ipc_types::{MonotonicNs, Source};
use runtime::duration::DurationText;
use runtime::exit::Failure;

use crate::render::fields::Tree;
use crate::render::words::count;
use crate::robot::freshness::{SampleAge, age_ms, named};
use crate::session::{Latest, Session, Topics};

/// A sample of the relay older than this says nothing of the present: the relay publishes once a second, so this is
/// three of them.
pub const STALE_AFTER: Duration = Duration::from_secs(3);

/// A sample of the stations older than this says nothing of the present: it comes to other machines every two seconds.
pub const STATIONS_STALE_AFTER: Duration = STALE_AFTER.saturating_mul(2);

/// The link of this machine to a robot on another one.
#[derive(Clone, Debug)]
pub struct LinkReport {
    link: RelayLink,
    now: MonotonicNs,
}

impl LinkReport {
    /// What `link` says at `now`.
    pub fn new(link: &RelayLink, now: MonotonicNs) -> LinkReport {
        LinkReport { link: *link, now }
    }

    fn sample(&self) -> SampleAge {
        let link = &self.link;
        SampleAge::with_limit(link.sequence, link.published(), self.now, STALE_AFTER)
    }

    /// Whether the relay has said this too long ago to say how the link is now.
    pub fn is_stale(&self) -> bool {
        self.sample().is_stale()
    }

    /// Whether the relay says that the link is up, and has said so lately.
    pub fn is_up(&self) -> bool {
        self.link.is_up() && !self.is_stale()
    }

    /// That two robots answer under the robot's number, and what to do; `None` if they do not.
    pub fn two_robots(&self) -> Option<(String, String)> {
        let has_two = self.link.refusal() == Some(Reason::RelayTwoRobots);
        let number = self.link.robot;
        (has_two && !self.is_stale()).then(|| {
            (
                format!("two robots answer under number {number}: neither is ordered"),
                "the log of this station's relay names both: end the relay of one, or give it another number".to_owned(),
            )
        })
    }

    /// Why nothing comes over the link, and what to do; `None` if it is up.
    pub fn trouble(&self) -> Option<(String, String)> {
        let link = &self.link;
        let for_ms = since_ms(link.since_ns, self.now);
        let lasted =
            for_ms.map_or_else(|| "an unknown time".to_owned(), |ms| shown(ms).to_string());
        let is_heard = link.last_heard().is_some();
        let what = match link.state() {
            _ if self.is_stale() => {
                let text = "the relay runs and does not report its link to the robot";
                let next_step =
                    "is it stopped, or is the machine overloaded? If it stays so, restart it";
                return Some((text.to_owned(), next_step.to_owned()));
            }
            Some(RelayLinkState::Up) => return None,
            Some(RelayLinkState::Connecting) if is_heard => {
                let text = format!(
                    "the link to the robot is not up: the robot answers, and is asked for {lasted} already what it has"
                );
                return Some((text, "wait some seconds and try again".to_owned()));
            }
            Some(RelayLinkState::Connecting) => "connecting",
            _ => "down",
        };
        let over = link.link().unwrap_or(UNREADABLE);
        let text = format!("the link to the robot is not up: {what} for {lasted} over {over}");
        let next_step = format!(
            "the relay tries again by itself; if it does not get there: on the robot's machine `ril relay status` must show a relay that \
             listens there, `ping` that the network is there. An attempt is given up after {} s: round trips longer than a tenth of that \
             need a longer `open_timeout_ms`. Over a VPN or a tunnel `ping -M do -s 1372` to the robot shows whether large packets pass",
            link.open_timeout_s
        );
        Some((text, next_step))
    }

    /// The link as part of a JSON object.
    pub fn tree(&self) -> Tree {
        let link = &self.link;
        let clock = Tree::nested([
            ("offset_ns", link.clock_offset_ns.into()),
            ("uncertainty_s", link.clock_uncertainty().into()),
            ("round_trip_s", link.round_trip().into()),
            ("drift_ppb", link.clock_drift_ppb.into()),
            ("resets", link.clock_resets.into()),
        ]);
        let samples = Tree::nested([
            ("received", link.samples_received.into()),
            ("lost_on_air", link.samples_lost_on_air.into()),
            ("lost_on_air_percent", lost_percent(link).into()),
            ("lost_in_relay", link.samples_lost_in_relay.into()),
            ("left_out", link.samples_left_out.into()),
        ]);
        let orders = Tree::nested([
            ("sent", link.orders_sent.into()),
            ("repeated", link.orders_repeated.into()),
            ("open", link.orders_open.into()),
            ("unknown", link.orders_unknown.into()),
        ]);
        Tree::nested([
            ("state", named(link.state(), link.state).into()),
            ("up", self.is_up().into()),
            ("state_since_ms", since_ms(link.since_ns, self.now).into()),
            ("over", link.link().into()),
            ("open_timeout_s", link.open_timeout_s.into()),
            ("station", link.station().into()),
            ("robot_there", link.robot.into()),
            ("refusal", refusal_name(link.refusal).into()),
            (
                "last_heard_age_ms",
                heard_ms(link.last_heard(), self.now).into(),
            ),
            ("outages", link.outages.into()),
            (
                "clock",
                if link.clock_valid != 0 {
                    clock
                } else {
                    Tree::NULL
                },
            ),
            ("samples", samples),
            ("bytes_received", link.bytes_received.into()),
            ("bytes_sent", link.bytes_sent.into()),
            ("orders", orders),
            ("sample", self.sample().tree()),
        ])
    }
}

/// ms since `since_ns`; `None` for 0, which stands for "never", and for a time in the future.
pub fn since_ms(since_ns: u64, now: MonotonicNs) -> Option<u64> {
    let since = (since_ns > 0).then_some(MonotonicNs(since_ns))?;
    age_ms(since, now)
}

/// ms since the last message; `None` before the first, and for a time in the future.
pub fn heard_ms(last: Option<MonotonicNs>, now: MonotonicNs) -> Option<u64> {
    age_ms(last?, now)
}

/// The name of the reason for which requests are refused; `None` if they are taken.
pub fn refusal_name(code: u32) -> Option<String> {
    (code != 0).then(|| named(Reason::from_code(code), code))
}

/// The part of the robot's samples that was lost on the air, to the hundredth of a percent, because more would be
/// noise; `None` if the robot's relay sent none.
fn lost_percent(link: &RelayLink) -> Option<f64> {
    let part = link.lost_on_air()?;
    Some((part * 1e4).round() / 100.0)
}

/// Whether a topic comes from another machine, and how the link to that machine is.
#[derive(Default)]
pub struct LinkWatch {
    /// `None` as long as the topic was not seen to come from the relay.
    link: Option<Latest<RelayLink>>,
    is_relayed: bool,
}

impl LinkWatch {
    /// Looks which process provides the topic `key`. While none does, the last answer holds.
    pub fn look(&mut self, session: &Session, key: &str) -> Result<(), Failure> {
        if let Some(provider) = session.provider(key)? {
            self.is_relayed = session.is_relayed(key, &provider)?;
        }
        if self.is_relayed && self.link.is_none() {
            self.link = Latest::open_if_provided(session)?;
        }
        Ok(())
    }

    /// Whether the topic comes from another machine.
    pub fn is_relayed(&self) -> bool {
        self.is_relayed
    }

    /// Whether the link's sample is still to come.
    pub fn is_missing(&self) -> bool {
        let link = self.link.as_ref().filter(|_| self.is_relayed);
        link.is_some_and(|link| link.sample.is_none())
    }

    /// The newest sample of the link; `None` if the topic is of this machine, or when none came.
    pub fn newest(&self) -> Option<&RelayLink> {
        let link = self.link.as_ref().filter(|_| self.is_relayed)?;
        link.sample.as_ref()
    }

    /// Waits for the link's sample, at most so long.
    pub fn wait(&mut self, session: &Session, timeout: Duration) -> Result<(), Failure> {
        let give_up = MonotonicNs::now() + timeout;
        let is_enough = |link: &mut LinkWatch, _| Ok(!link.is_missing());
        session.gather(self, give_up, is_enough).map(drop)
    }
}

impl Topics for LinkWatch {
    /// While the topic comes from another machine.
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        match self.is_relayed {
            true => self.link.ports(),
            false => Vec::new(),
        }
    }

    fn drain(&mut self) {
        self.link.drain();
    }
}

/// Stands for a text of another process that is none.
pub const UNREADABLE: &str = "unreadable";

impl LinkReport {
    /// In a few words, for a report about something else.
    pub fn in_short(&self) -> String {
        let link = &self.link;
        let round_trip = match link.round_trip() {
            Some(seconds) => format!("round trip {}", milliseconds(seconds)),
            None => "round trip unknown".to_owned(),
        };
        let lost = match lost_percent(link) {
            Some(percent) => format!("{percent:.2} % lost on the air"),
            None => "no samples yet".to_owned(),
        };
        format!(
            "relayed over {}, link {}, {round_trip}, {lost}{}",
            link.link().unwrap_or(UNREADABLE),
            named(link.state(), link.state),
            if self.is_stale() { ", STALE" } else { "" }
        )
    }
}

impl fmt::Display for LinkReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let link = &self.link;
        write!(f, "link        {}", named(link.state(), link.state))?;
        match since_ms(link.since_ns, self.now) {
            Some(ms) => write!(f, " for {}", shown(ms))?,
            None => f.write_str(" since an unknown time")?,
        }
        writeln!(
            f,
            " over {}, last message {}; {}",
            link.link().unwrap_or(UNREADABLE),
            ago(heard_ms(link.last_heard(), self.now)),
            count(link.outages, "outage")
        )?;
        write!(
            f,
            "            robot {} on its own machine; this station is {}",
            link.robot,
            link.station().unwrap_or(UNREADABLE)
        )?;
        match refusal_name(link.refusal) {
            Some(reason) => writeln!(f, ", and its requests are refused ({reason})")?,
            None => writeln!(f)?,
        }
        writeln!(f, "clock       {}", clock(link))?;
        let percent = lost_percent(link);
        writeln!(
            f,
            "samples     {} received, {} lost on the air{}, {} lost in the robot's relay, {} left out on purpose",
            link.samples_received,
            link.samples_lost_on_air,
            percent.map_or_else(String::new, |percent| format!(" ({percent:.2} %)")),
            link.samples_lost_in_relay,
            link.samples_left_out
        )?;
        writeln!(
            f,
            "bytes       {} received, {} sent",
            link.bytes_received, link.bytes_sent
        )?;
        writeln!(
            f,
            "orders      {} sent, {} repeated, {} open, {} of unknown outcome",
            link.orders_sent,
            count(link.orders_repeated, "message"),
            link.orders_open,
            link.orders_unknown
        )?;
        writeln!(f, "relay       {}", self.sample())
    }
}

/// How the robot's clock is to this machine's.
fn clock(link: &RelayLink) -> String {
    if link.clock_valid == 0 {
        return "not compared with the robot's yet".to_owned();
    }
    let relation = match link.clock_offset_ns < 0 {
        true => "behind",
        false => "ahead",
    };
    let seconds = link.clock_offset_ns.unsigned_abs() as f64 / 1e9;
    let truth = match link.clock_uncertainty() {
        Some(uncertainty) => format!("true within {}", milliseconds(uncertainty)),
        None => "of unknown truth".to_owned(),
    };
    let round_trip = match link.round_trip() {
        Some(round_trip) => milliseconds(round_trip),
        None => "unknown".to_owned(),
    };
    format!(
        "the robot's is {seconds:.6} s {relation}, {truth}; round trip {round_trip}, drift {:.3} ppm, {}",
        f64::from(link.clock_drift_ppb) / 1e3,
        count(link.clock_resets, "reset")
    )
}

/// A time of so many milliseconds in words.
pub fn shown(ms: u64) -> DurationText {
    DurationText(Duration::from_millis(ms))
}

/// Seconds as milliseconds, with the digits that mean something.
fn milliseconds(seconds: f64) -> String {
    let milliseconds = seconds * 1e3;
    match milliseconds < 10.0 {
        true => format!("{milliseconds:.3} ms"),
        false => format!("{milliseconds:.1} ms"),
    }
}

/// How long ago in words.
pub fn ago(age: Option<u64>) -> String {
    age.map_or_else(|| "never".to_owned(), |age| format!("{age} ms ago"))
}
