//! [`JournalTopics`]: what is made of the bridge's journal for people and programs that do not read it: requests with
//! their reports.
//!
//! The journal itself is recorded too, as it is. What is frequent and long in it, the bytes of the serial line, is not
//! recorded twice.

use std::collections::{BTreeMap, VecDeque};

use bridge::journal::Record;
use bridge::{Input, Output, Sender};
use ipc_types::code::{ControlCommand, MovementKind, ParameterOperation, Reason, Stage};
use ipc_types::payload::{
    BridgeJournal, ModuleControl, MovementData, ParameterRequest, RelayStations, RequestReport,
    SharedStruct,
};
use ipc_types::{MonotonicNs, RobotId};
use module_kit::journal::{Entry, JournalReader};
use operator::render::messages::{self, Verb};
use operator::robot::relay_link::UNREADABLE;
use recording::Recorder;
use recording::{REQUEST_EVENT, REQUEST_EVENT_TEXT, RequestEvent, topic};
use ros_messages::{Level, Qos};

use super::log::{LogTopic, RecorderTopic};

/// Open requests whose command is remembered for their reports: many times as many as the bridge's clients can have
/// open. Of older ones the reports have no command.
const MAX_OPEN: usize = 1024;

/// Lives of stations whose names are remembered: four times as many as the relay shows. Requests of older ones have no
/// name.
const MAX_ORIGINS: usize = 64;

/// Makes messages of the bridge's journal.
#[derive(Debug)]
pub struct JournalTopics {
    reader: JournalReader,
    made: Made,
}

impl JournalTopics {
    /// Of `robot`.
    pub fn new(robot: RobotId) -> JournalTopics {
        let text = REQUEST_EVENT_TEXT.to_owned();
        let requests = topic(robot, "requests");
        JournalTopics {
            reader: JournalReader::new(),
            made: Made {
                requests: RecorderTopic::with_text(requests, REQUEST_EVENT, text, Qos::STATE),
                open: BTreeMap::new(),
                stations: VecDeque::new(),
            },
        }
    }

    /// Remembers what the stations are called, so that their requests have their names.
    pub fn stations(&mut self, stations: &RelayStations) {
        for station in stations.stations() {
            let known = &mut self.made.stations;
            if known.iter().any(|(origin, _)| *origin == station.origin) {
                continue;
            }
            if known.len() == MAX_ORIGINS {
                known.pop_front();
            }
            let name = station.name().unwrap_or(UNREADABLE).to_owned();
            known.push_back((station.origin, name));
        }
    }

    /// Takes a piece of the journal, as it lies in shared memory.
    pub fn take(
        &mut self,
        recorder: &mut Recorder,
        log: &mut LogTopic,
        piece: &[u8],
        now: MonotonicNs,
    ) {
        let Some(piece) = BridgeJournal::from_bytes(piece) else {
            return;
        };
        let JournalTopics { reader, made } = self;
        reader.take(&piece);
        let mut to = To { recorder, log, now };
        // After bytes that are no record, reading goes on at the next snapshot; the pieces are recorded as they are.
        while let Ok(Some(record)) = reader.next() {
            made.take(&mut to, &record);
        }
    }
}

/// Where messages go.
struct To<'a> {
    recorder: &'a mut Recorder,
    log: &'a mut LogTopic,
    now: MonotonicNs,
}

/// The topic that is made, and what is remembered for it.
#[derive(Debug)]
struct Made {
    requests: RecorderTopic,
    /// By request id.
    open: BTreeMap<u64, Open>,
    /// Names of stations, by the `origin` of their requests.
    stations: VecDeque<(u32, String)>,
}

/// What is known of a request: what was asked for, and by which process.
#[derive(Clone, Copy, Debug, Default)]
struct Open {
    service: &'static str,
    command: &'static str,
    verb: Option<Verb>,
    path_id: u64,
    sender_pid: u32,
    /// Of a request that came over the relay; else 0.
    origin: u32,
    position: [f64; 3],
}

/// No position.
const NOWHERE: [f64; 3] = [f64::NAN; 3];

impl Made {
    fn take(&mut self, to: &mut To<'_>, record: &Record<'_>) {
        let at = record.at;
        match &record.entry {
            Entry::Line(line) => to.log.process(to.recorder, (to.now, at), "bridge", line),
            Entry::Input(
                Input::Control {
                    sender, request, ..
                }
                | Input::NewFence {
                    sender, request, ..
                },
            ) => {
                self.request(to, at, request.request_id, of_control(request), *sender);
            }
            Entry::Input(Input::Movement {
                sender, request, ..
            }) => {
                self.request(to, at, request.request_id, of_movement(request), *sender);
            }
            Entry::Input(Input::Parameter {
                sender, request, ..
            }) => {
                self.request(to, at, request.request_id, of_parameter(request), *sender);
            }
            Entry::Output(Output::Report(_, report)) => self.report(to, at, report),
            Entry::Input(Input::PortOpened(_)) => {
                to.line(at, Level::Info, "the serial port is open")
            }
            Entry::Input(Input::PortClosed) => to.line(at, Level::Warn, "the serial port is gone"),
            Entry::Input(Input::WindDown) => to.line(at, Level::Info, "the bridge ends"),
            // Samples and states have topics of their own; the rest is the core's own matter.
            Entry::Input(_) | Entry::Output(_) | Entry::Snapshot(_) => {}
        }
    }

    fn request(&mut self, to: &mut To<'_>, at: MonotonicNs, id: u64, open: Open, sender: Sender) {
        let open = Open {
            sender_pid: sender.process.unwrap_or_default(),
            ..open
        };
        if self.open.len() == MAX_OPEN {
            self.open.pop_first();
        }
        self.open.insert(id, open);
        let by = match (self.station(open.origin), sender.process) {
            ("", None) => String::new(),
            ("", Some(pid)) => format!(" by process {pid}"),
            (station, _) => format!(" by station {station}"),
        };
        let text = format!("{} requested{by}", open.command);
        self.event(to, at, id, &open, ("request", "", ""), &text);
        to.line(at, Level::Info, &text);
    }

    /// What the station is called whose requests have this origin; empty if it is none, or not known.
    fn station(&self, origin: u32) -> &str {
        let mut stations = self.stations.iter();
        let known = stations.find(|(known, _)| origin != 0 && *known == origin);
        known.map_or("", |(_, name)| name)
    }

    fn report(&mut self, to: &mut To<'_>, at: MonotonicNs, report: &RequestReport) {
        let id = report.request_id;
        let open = self.open.get(&id).copied().unwrap_or_default();
        let stage = report.stage().map_or("unknown-stage", Stage::name);
        let reason = report.reason().map_or("unknown-reason", Reason::name);
        let (is_success, reason) = match report.stage() {
            Some(Stage::Refused | Stage::Aborted | Stage::Unknown) => (false, reason),
            _ => (true, ""),
        };
        let line = open
            .verb
            .and_then(|verb| messages::line(verb, 0, 1, report));
        let text = line.unwrap_or_else(|| format!("{}: {stage}", open.command));
        self.event(to, at, id, &open, ("report", stage, reason), &text);
        let is_progress = report.stage() == Some(Stage::Progress);
        match (is_success, is_progress) {
            (false, _) => to.line(at, Level::Warn, &text),
            (true, false) => to.line(at, Level::Info, &text),
            (true, true) => {}
        }
        if report.is_final() {
            self.open.remove(&id);
        }
    }

    fn event(
        &mut self,
        to: &mut To<'_>,
        at: MonotonicNs,
        request_id: u64,
        open: &Open,
        (event, stage, reason): (&str, &str, &str),
        text: &str,
    ) {
        let bytes = RequestEvent {
            at_ns: at.0,
            request_id,
            path_id: open.path_id,
            sender_pid: open.sender_pid,
            event,
            service: open.service,
            command: open.command,
            stage,
            reason,
            text,
            position: open.position,
            station: self.station(open.origin),
        }
        .write();
        self.requests.add(to.recorder, to.now, at, &bytes);
    }
}

impl To<'_> {
    fn line(&mut self, at: MonotonicNs, level: Level, text: &str) {
        self.log.add(self.recorder, (self.now, at), level, text);
    }
}

fn of_control(request: &ModuleControl) -> Open {
    let command = request.command();
    Open {
        service: "control",
        command: command.map_or("unknown", ControlCommand::name),
        verb: command.map(|command| match command {
            ControlCommand::Start => Verb::Start,
            ControlCommand::Stop => Verb::Stop,
            ControlCommand::ReloadFence => Verb::ReloadFence,
            ControlCommand::TakeControl => Verb::TakeControl,
            ControlCommand::ReleaseControl => Verb::ReleaseControl,
            ControlCommand::PassControl => Verb::PassControl,
        }),
        position: NOWHERE,
        origin: request.origin,
        ..Open::default()
    }
}

fn of_movement(request: &MovementData) -> Open {
    let kind = request.kind();
    let position = match kind {
        Some(MovementKind::GoToWaypoint) => [
            request.latitude_deg,
            request.longitude_deg,
            request.altitude_m,
        ],
        Some(MovementKind::TakeOff) => [f64::NAN, f64::NAN, request.altitude_m],
        _ => NOWHERE,
    };
    Open {
        service: "movement",
        command: kind.map_or("unknown", MovementKind::name),
        verb: kind.map(|kind| match kind {
            MovementKind::GoToWaypoint => Verb::GoTo,
            MovementKind::TakeOff => Verb::TakeOff,
            MovementKind::Land => Verb::Land,
            MovementKind::Hold => Verb::Hold,
        }),
        path_id: request.path_id,
        position,
        origin: request.origin,
        ..Open::default()
    }
}

fn of_parameter(request: &ParameterRequest) -> Open {
    let operation = request.operation();
    Open {
        service: "parameter",
        command: operation.map_or("unknown", ParameterOperation::name),
        verb: operation.map(|operation| match operation {
            ParameterOperation::Read => Verb::GetParameter,
            ParameterOperation::Write => Verb::SetParameter,
            ParameterOperation::List => Verb::ListParameters,
        }),
        position: NOWHERE,
        origin: request.origin,
        ..Open::default()
    }
}
