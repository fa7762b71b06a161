//! The report as text: a title and a few lines for each part.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ModuleId, ModuleStatus};
use ipc_types::module::State;
use ipc_types::payload::{DspErrorCounters, LinkHealth, ModuleState, SafetyState};
use operator::render::fields::{Selection, Tree};
use operator::render::messages::details;
use operator::render::terminal::Size;
use operator::render::words::{count, error_words, module_words, or_dash, wrap};
use operator::robot::freshness::{age_ms, named};
use operator::robot::pilot;
use operator::robot::relay_link::UNREADABLE;
use runtime::duration::DurationText;

use super::{StateReport, implausible, known_dsp_errors, pc_timeout_supported};

/// Columns of a title.
const TITLE: usize = 12;

/// The parts that a terminal can do without, the first one first; an empty title stands for further lines of a part.
const LESS: [&str; 12] = [
    "hero",
    "dsp",
    "",
    "refused",
    "DSP path",
    "status",
    "control",
    "GPS",
    "DSP errors",
    "movement",
    "supply",
    "speed",
];

/// The report for a terminal: lines are broken between words, and what its rows have no room for is left out, the least
/// important first, which the last line says. A row is left for the shell.
pub fn fitted(text: &str, size: Size) -> String {
    let columns = size.columns.max(2 * TITLE);
    let mut parts: Vec<(&str, String)> = text
        .lines()
        .map(|line| {
            let title_end = line
                .char_indices()
                .nth(TITLE)
                .map_or(line.len(), |(at, _)| at);
            let (title, words) = line.split_at(title_end);
            (title.trim(), wrap(title, words, columns))
        })
        .collect();
    let rows = |parts: &[(&str, String)]| -> usize {
        parts.iter().map(|(_, text)| text.lines().count()).sum()
    };
    let room = size.rows.saturating_sub(2);
    let is_too_long = rows(&parts) >= size.rows;
    for title in LESS.iter().filter(|_| is_too_long) {
        if rows(&parts) > room {
            parts.retain(|(other, _)| other != title);
        }
    }
    let text: String = parts.into_iter().map(|(_, text)| text).collect();
    if !is_too_long {
        return text;
    }
    let lines = text.lines().take(room);
    lines
        .chain(["more in a taller terminal, or by `ril status | less`"])
        .map(|line| format!("{line}\n"))
        .collect()
}

impl fmt::Display for StateReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let samples = &self.samples;
        let state = samples.state.as_ref();
        writeln!(f, "robot       {}", self.robot)?;
        if state.is_some_and(ModuleState::is_replayed) {
            writeln!(
                f,
                "replay      a recorded flight, replayed by `ril replay`: no robot"
            )?;
        }
        self.write_flight(f)?;
        match &self.relay {
            Some(link) => writeln!(f, "relay       {}", link.in_short())?,
            None if self.is_relayed => {
                writeln!(f, "relay       relayed over an unknown link: no sample")?
            }
            None => {}
        }
        let module = state.map(|state| self.module_text(state));
        let status = samples
            .status
            .as_ref()
            .map(|status| self.status_text(status));
        for (title, text) in [("module", module), ("status", status)] {
            writeln!(f, "{title:<12}{}", text.as_deref().unwrap_or("no sample"))?;
        }
        if let Some(state) = state {
            let control = self.senders().in_words(state, self.now);
            writeln!(f, "control     {control}")?;
            writeln!(f, "movement    {}", movement(state, self.now))?;
            self.write_link(f, &state.link)?;
            writeln!(f, "safety      {}", safety(&state.safety))?;
            writeln!(f, "refused     {}", refused(state))?;
            write_dsp_errors(f, &state.dsp_errors)?;
        }
        for (title, sample) in [("dsp", self.dsp()), ("hero", self.hero())] {
            match sample {
                Some(sample) => writeln!(f, "{title:<12}{sample}")?,
                None => writeln!(f, "{title:<12}no sample")?,
            }
        }
        Ok(())
    }
}

impl StateReport {
    /// What a pilot asks first.
    fn write_flight(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "flight      {}", self.flight_in_words())?;
        if self.view.flying.is_some() {
            writeln!(f, "altitude    {}", self.altitude())?;
            writeln!(f, "position    {}", self.position())?;
            writeln!(f, "speed       {}", self.speed())?;
            writeln!(f, "supply      {}", self.supply())?;
            writeln!(f, "GPS         {}", or_dash(self.view.gps))?;
        }
        let age = |time: MonotonicNs| {
            let age = match age_ms(time, self.now) {
                Some(age) => format!("{age} ms old"),
                None => "of unknown age".to_owned(),
            };
            let stale = if self.is_old(time) { ", STALE" } else { "" };
            format!("{age}{stale}")
        };
        match self.view.received {
            Some(received) => write!(f, "data        telemetry {}", age(received))?,
            None => write!(f, "data        no telemetry")?,
        }
        match &self.samples.state {
            Some(state) => writeln!(f, "; bridge's state {}", age(state.published())),
            None if self.samples.has_bridge => writeln!(f, "; no state of the bridge"),
            None => writeln!(f, "; no bridge runs"),
        }
    }

    fn flight_in_words(&self) -> String {
        let up_or_down = match self.view.flying {
            Some(true) => "in the air",
            Some(false) => "on the ground",
            None => "no telemetry",
        };
        match self.phase() {
            Some(phase) if phase != up_or_down => format!("{up_or_down}, {phase}"),
            _ => up_or_down.to_owned(),
        }
    }

    fn altitude(&self) -> String {
        let climb = self.view.climb_mps;
        or_dash(self.view.altitude_m.map(|altitude_m| match climb {
            Some(climb_mps) => format!("{altitude_m:.1} m, climb {climb_mps:+.1} m/s"),
            None => format!("{altitude_m:.1} m"),
        }))
    }

    fn position(&self) -> String {
        or_dash(self.view.place)
    }

    fn speed(&self) -> String {
        let course = self.view.course_deg;
        or_dash(self.view.ground_speed_mps.map(|speed_mps| match course {
            Some(course) => format!("{speed_mps:.1} m/s over ground, course {course:03.0}°"),
            None => format!("{speed_mps:.1} m/s over ground"),
        }))
    }

    fn supply(&self) -> String {
        let switch = self.view.switch;
        let switch = switch.map(|switch| format!("pilot's switch {}", switch.name()));
        let parts: Vec<String> = self.view.supply().into_iter().chain(switch).collect();
        or_dash((!parts.is_empty()).then(|| parts.join(", ")))
    }

    fn module_text(&self, state: &ModuleState) -> String {
        let activity = match state.functionality() {
            Some(functionality) => pilot::activity(functionality, self.view.flying).to_owned(),
            None => format!("unknown-{}", state.functionality),
        };
        let mut text = format!(
            "{} {}, {activity}",
            named(ModuleId::from_code(state.module_id), state.module_id),
            words(state.status(), state.status, state.is_blocked()),
        );
        if says_blocked(state.status(), state.is_blocked()) {
            text += ", blocked";
        }
        if state.is_unable_to_abort() {
            text += ", unable to abort";
        }
        let sample = self.sample(state.sequence, state.published_ns);
        format!("{text}; {}; {sample}", error_words(state.imi_error()))
    }

    fn status_text(&self, state: &State) -> String {
        let mut text = format!(
            "{} {}, {}",
            named(ModuleId::from_code(state.module_id), state.module_id),
            words(state.status(), state.status, state.is_blocked()),
            // Text of another process: it must not command the terminal.
            state.doing().unwrap_or(UNREADABLE).escape_debug()
        );
        if says_blocked(state.status(), state.is_blocked()) {
            text += ", blocked";
        }
        let sample = self.status_sample(state);
        format!("{text}; {}; {sample}", error_words(state.error()))
    }

    fn write_link(&self, f: &mut fmt::Formatter<'_>, link: &LinkHealth) -> fmt::Result {
        let ago = |time_ns: u64, ever: bool| match age_ms(MonotonicNs(time_ns), self.now) {
            _ if !ever => "never".to_owned(),
            Some(age) => format!("{age} ms ago"),
            None => "of unknown age".to_owned(),
        };
        let since_ns = Some(link.state_since_ns).filter(|since_ns| *since_ns > 0);
        let since = match since_ns.and_then(|ns| age_ms(MonotonicNs(ns), self.now)) {
            Some(ms) => format!("for {}", DurationText(Duration::from_millis(ms))),
            None => "since an unknown time".to_owned(),
        };
        let delivery = match link.delivery_verified {
            1 => "verified",
            _ => "not verified",
        };
        let without_bridge = match pc_timeout_supported(link) {
            Some(true) => "the DSP stops the helicopter by itself",
            Some(false) => "the DSP flies on to the end of its path",
            None => "not known yet what the DSP does",
        };
        for (title, line) in [
            (
                "link",
                format!(
                    "{} {since}; port opened {}, DSP boots seen {}",
                    named(link.state(), link.state),
                    count(link.port_openings, "time"),
                    link.dsp_boots
                ),
            ),
            (
                "",
                format!(
                    "last message {}, last telemetry {}",
                    ago(link.last_message_ns, link.messages_received > 0),
                    ago(link.last_telemetry_ns, link.telemetry_published > 0)
                ),
            ),
            (
                "",
                format!(
                    "{}, {}; {} published, {} incoherent",
                    count(link.bytes_received, "byte"),
                    count(link.messages_received, "message"),
                    count(link.telemetry_published, "sample"),
                    link.telemetry_incoherent
                ),
            ),
            (
                "",
                format!(
                    "{} acknowledged, {} repeated, {} failed, {} unmatched",
                    count(link.commands_acknowledged, "command"),
                    link.commands_repeated,
                    link.commands_failed,
                    count(link.acks_unmatched, "ack"),
                ),
            ),
            (
                "",
                format!(
                    "{} sent, {} of them again, delivery {delivery}",
                    count(link.waypoints_sent, "waypoint"),
                    link.waypoints_repeated,
                ),
            ),
            (
                "DSP path",
                format!(
                    "{}; when the bridge is gone: {without_bridge}",
                    named(link.dsp_path(), link.dsp_path)
                ),
            ),
        ] {
            writeln!(f, "{title:<12}{line}")?;
        }
        Ok(())
    }

    /// All that `--watch` reports in a line. Another text than before is a change; numbers that always change are not
    /// in it.
    pub fn situation(&self) -> String {
        let view = &self.view;
        let mut parts = vec![self.flight_in_words()];
        parts.extend(
            view.switch
                .map(|switch| format!("switch {}", switch.name())),
        );
        parts.extend(view.gps.map(|gps| format!("fix {}", gps.name())));
        if let Some(state) = &self.samples.state {
            let is_blocked = state.is_blocked();
            let status = words(state.status(), state.status, is_blocked);
            let blocked = match says_blocked(state.status(), is_blocked) {
                true => ", blocked",
                false => "",
            };
            parts.push(format!("module {status}{blocked}"));
            let link = &state.link;
            parts.push(format!("link {}", named(link.state(), link.state)));
            let broken = details::broken_rule(&state.safety);
            parts.extend(broken.map(|broken| broken.words_without_amount));
        }
        parts.extend(self.trouble().map(|(_, trouble)| trouble));
        parts.join("; ")
    }

    /// The situation with the numbers of this moment.
    pub fn line(&self) -> String {
        let view = &self.view;
        let numbers = [
            view.altitude_m
                .map(|altitude_m| format!("{altitude_m:.1} m")),
            view.ground_speed_mps
                .map(|speed_mps| format!("{speed_mps:.1} m/s")),
            view.battery_v.map(|battery_v| format!("{battery_v:.1} V")),
        ];
        let numbers: Vec<String> = numbers.into_iter().flatten().collect();
        match numbers.is_empty() {
            true => self.situation(),
            false => format!("{}; {}", self.situation(), numbers.join(", ")),
        }
    }
}

/// The module's state, or a number that is not in the contract.
fn words(status: Option<ModuleStatus>, number: u32, is_blocked: bool) -> String {
    module_words(status, is_blocked).map_or_else(|| format!("unknown-{number}"), str::to_owned)
}

/// Whether it is worth a word that no movement is taken: a module that was not started, or was stopped, takes none.
fn says_blocked(status: Option<ModuleStatus>, is_blocked: bool) -> bool {
    let is_at_work = !matches!(
        status,
        Some(ModuleStatus::WaitingDataToStart | ModuleStatus::Ended)
    );
    is_blocked && is_at_work
}

fn movement(state: &ModuleState, now: MonotonicNs) -> String {
    let movement = &state.movement;
    if movement.kind == 0 {
        return "none yet".to_owned();
    }
    let mut text = named(movement.kind(), movement.kind);
    if movement.waypoints_total > 0 {
        text += &format!(
            ", {}, {} sent, {} reached",
            count(movement.waypoints_total, "waypoint"),
            movement.waypoints_sent,
            movement.waypoints_reached
        );
    }
    if let Some(distance) = movement.distance_to_go().filter(|m| m.is_finite()) {
        text += &format!(", {distance:.1} m to go");
    }
    let ended = state.last_end.ended();
    if let Some((end, age)) = pilot::ended_early(state).zip(ended.and_then(|at| age_ms(at, now))) {
        let before = match pilot::is_end_of_shown(state) {
            true => "",
            false => "the one before: ",
        };
        let ago = DurationText(Duration::from_millis(age));
        text += &format!("; {before}{end}, {ago} ago");
    }
    text
}

fn safety(safety: &SafetyState) -> String {
    let violation = match details::broken_rule(safety) {
        None => "no rule violated".to_owned(),
        Some(broken) => broken.words,
    };
    format!(
        "{violation}; pilot's switch {}, {}, {}",
        named(safety.pilot_switch(), safety.pilot_switch),
        count(safety.fence_areas, "fence area"),
        count(safety.interventions, "intervention")
    )
}

/// The counters that are not 0, by the names of the schema.
fn refused(state: &ModuleState) -> String {
    let counters = super::refused(
        Tree::of(state, &Selection::default()).take("refused"),
        &state.refused,
    );
    let counts: Vec<String> = counters
        .plain_fields()
        .into_iter()
        .filter(|(_, count)| count.as_u64().is_some_and(|count| count > 0))
        .map(|(name, count)| format!("{} {count}", name.replace('_', " ")))
        .collect();
    let groups = implausible(&state.refused);
    match (counts.is_empty(), groups.is_empty()) {
        (true, _) => "nothing".to_owned(),
        (false, true) => counts.join(", "),
        (false, false) => format!("{} (groups: {})", counts.join(", "), groups.join(", ")),
    }
}

fn write_dsp_errors(f: &mut fmt::Formatter<'_>, errors: &DspErrorCounters) -> fmt::Result {
    let Some(last) = errors.last() else {
        return writeln!(f, "DSP errors  none");
    };
    writeln!(
        f,
        "DSP errors  {}, {} of them fatal; last {}",
        errors.total,
        errors.escalated,
        details::dsp_error(last)
    )?;
    for (code, count) in known_dsp_errors(errors) {
        writeln!(f, "            {count} × {}: {}", code.0, code.text())?;
    }
    if errors.unknown > 0 {
        writeln!(f, "            {} × unknown codes", errors.unknown)?;
    }
    Ok(())
}
