//! [`Ports`]: what the gateway reads of the robot, and the requests that its orders become.

use std::path::PathBuf;
use std::time::Duration;

use bridge::BridgeConfig;
use dsp_protocol::port;
use ipc_types::code::ControlCommand;
use ipc_types::configuration::BridgeConfiguration;
use ipc_types::payload::{
    BridgeOutline, HeroTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RequestReport,
};
use ipc_types::{
    Client, Ipc, MonotonicNs, Provider, Request, SendError, Source, Subscriber, Topic,
    fresh_request_id,
};
use operator::render::messages::Verb;
use operator::request::ports::{OrderRequest, RobotOrder, send};
use operator::robot::running::{RunningBridge, file_of};
use operator::session::Topics;
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::followed::SentOrders;
use crate::number::{MissionRefusal, MissionResult};
use crate::{Gateway, Order, OrderKind};

/// How long the bridge may need to say its configuration, which takes it milliseconds.
const RULES_LIMIT: Duration = Duration::from_millis(500);

/// What the gateway reads of the robot, and the requests that its orders become.
pub(crate) struct Ports {
    ipc: Ipc,
    telemetry: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    outline: Subscriber<BridgeOutline>,
    movement: Option<Client<MovementData>>,
    control: Option<Client<ModuleControl>>,
    parameters: Option<Client<ParameterRequest>>,
    open: SentOrders,
    /// A bridge that was asked for its configuration, and until when it may answer.
    rules: Option<(RunningBridge, MonotonicNs)>,
    /// Whether its configuration is asked for, and no bridge is there that could say it.
    has_no_rules: bool,
    /// The bridge's configuration file, if the operator has named it.
    bridge_file: Option<PathBuf>,
}

/// The bridge's configuration file: the one that the operator has named, else that which the live bridge was started
/// with.
#[derive(Debug)]
pub struct BridgeFile {
    named: Option<PathBuf>,
    provider: Option<Provider>,
}

impl BridgeFile {
    /// Its path. The kernel is asked about the bridge, which may take as long as that process is held up.
    pub fn find(self) -> Result<PathBuf, MissionRefusal> {
        let of_process = || {
            let provider = self.provider.as_ref()?;
            file_of(provider, "bridge", bridge::cli::DEFAULT_CONFIG_FILE)
        };
        let file = self.named.or_else(of_process);
        file.ok_or_else(|| MissionRefusal {
            result: MissionResult::Error,
            text: "the file of a bridge on this machine is not known: name it by `[fence] bridge` in mavlink.toml".to_owned(),
        })
    }
}

impl Ports {
    pub fn open(ipc: Ipc, bridge_file: Option<PathBuf>) -> Result<Ports, Failure> {
        Ok(Ports {
            telemetry: ipc.subscriber().or_fail(ExitCode::Internal)?,
            state: ipc.subscriber().or_fail(ExitCode::Internal)?,
            outline: ipc.subscriber().or_fail(ExitCode::Internal)?,
            ipc,
            movement: None,
            control: None,
            parameters: None,
            open: SentOrders::default(),
            rules: None,
            has_no_rules: false,
            bridge_file,
        })
    }

    /// Where the bridge's configuration file is to be looked for.
    pub fn bridge_file(&self) -> BridgeFile {
        BridgeFile {
            named: self.bridge_file.clone(),
            provider: self.ipc.provider(ModuleState::KEY).ok().flatten(),
        }
    }

    /// Numbers the run of the bridge, also through a relay; `None` if none runs.
    pub fn bridge_run(&self) -> Option<u64> {
        let provider = self.ipc.provider(ModuleState::KEY).ok()??;
        Some(provider.since_ns)
    }

    /// What to wait for. Without a station no sample wakes the process.
    pub fn sources(&mut self, with_samples: bool) -> impl Iterator<Item = &mut dyn Source> {
        let telemetry = with_samples.then_some(&mut self.telemetry as &mut dyn Source);
        let movement = self.movement.as_mut().map(|client| client as _);
        let control = self.control.as_mut().map(|client| client as _);
        let parameters = self.parameters.as_mut().map(|client| client as _);
        let state = Some(&mut self.state as _);
        let outline = Some(&mut self.outline as _);
        let rules = self.rules.iter_mut().flat_map(|(rules, _)| rules.ports());
        [telemetry, state, outline, movement, control, parameters]
            .into_iter()
            .flatten()
            .chain(rules)
    }

    /// When [`Ports::drain`] is to be called though nothing has come.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let rules = self.rules.as_ref().map(|(_, until)| *until);
        rules.into_iter().chain(self.open.deadline()).min()
    }

    /// Asks the bridge for its configuration.
    pub fn ask_rules(&mut self, now: MonotonicNs) -> Result<(), Failure> {
        let key = BridgeConfiguration::KEY;
        self.has_no_rules = self
            .ipc
            .provider(key)
            .or_fail(ExitCode::Internal)?
            .is_none();
        self.rules = match self.has_no_rules {
            true => None,
            false => {
                let running = RunningBridge::open(&self.ipc).or_fail(ExitCode::Internal)?;
                Some((running, now + RULES_LIMIT))
            }
        };
        Ok(())
    }

    /// Gives the gateway the configuration of the bridge, if it was asked for and has come, or does not come.
    pub fn take_rules(&mut self, gateway: &mut Gateway, now: MonotonicNs) {
        let rules: Option<BridgeConfig> = match &mut self.rules {
            Some((running, until)) => {
                running.drain();
                match running.take() {
                    Some(config) => Some(config),
                    None if now >= *until => None,
                    None => return,
                }
            }
            None if self.has_no_rules => None,
            None => return,
        };
        (self.rules, self.has_no_rules) = (None, false);
        gateway.rules(rules.as_ref(), now);
    }

    /// Gives the gateway what has come. The clock is read behind each sample: a process that was stopped in between
    /// must not take a sample for one of the future.
    pub fn drain(&mut self, gateway: &mut Gateway) {
        let states = self
            .state
            .drain(|state| gateway.state(state, MonotonicNs::now()));
        // Of telemetry the newest counts.
        let newest = self.telemetry.latest().map(|newest| {
            if let Some(telemetry) = newest {
                gateway.telemetry(&telemetry, MonotonicNs::now());
            }
        });
        let outlines = self.outline.drain(|piece| gateway.outline(piece));
        for error in [states.err(), newest.err(), outlines.err()]
            .into_iter()
            .flatten()
        {
            tracing::warn!(%error, "samples could not be received");
        }
        let mut reports = Vec::new();
        drain(&mut self.movement, &mut reports);
        drain(&mut self.control, &mut reports);
        drain(&mut self.parameters, &mut reports);
        let now = MonotonicNs::now();
        let movement = &mut self.movement;
        let mut send = |request: &MovementData| match movement {
            Some(client) => client.send(request).is_ok(),
            None => false,
        };
        for report in reports {
            self.open.report(&report, gateway, &mut send, now);
        }
        // What the bridge does not answer.
        self.open.advance(gateway, &mut send, now);
    }

    /// Why an order was not sent.
    fn unsent(&self, verb: Verb, error: &SendError) -> String {
        let verb = verb.name();
        match error {
            SendError::NoServer { .. } => {
                let robot = self.ipc.robot();
                format!("{verb} was refused: robot {robot}'s bridge is not running")
            }
            error => format!("{verb} was refused: {error}"),
        }
    }

    /// Sends an order; one that cannot be sent is reported to the gateway.
    pub fn send(
        &mut self,
        order: Order,
        gateway: &mut Gateway,
        now: MonotonicNs,
    ) -> Result<(), Failure> {
        let (issued_ns, begin_by_ns) = (order.issued.0, order.begin_by.map_or(0, |by| by.0));
        let after = order.after;
        let (verb, wanted) = wanted(&order, gateway);
        let mut path = Vec::new();
        let (request_id, sent) = match wanted {
            Wanted::Movement(requests) => {
                let requests = requests.into_iter().map(|request| MovementData {
                    issued_ns,
                    begin_by_ns,
                    after,
                    preempt: u16::from(order.preempts),
                    ..request
                });
                path = requests.collect();
                let Some(first) = path.first() else {
                    return Ok(());
                };
                let sent = send(&self.ipc, &mut self.movement, first)?;
                (first.request_id, sent)
            }
            Wanted::Control(request) => {
                let request = ModuleControl {
                    issued_ns,
                    begin_by_ns,
                    after,
                    ..request
                };
                let sent = send(&self.ipc, &mut self.control, &request)?;
                (request.request_id, sent)
            }
            Wanted::Parameter(request) => {
                let request = ParameterRequest {
                    issued_ns,
                    begin_by_ns,
                    after,
                    ..request
                };
                let sent = send(&self.ipc, &mut self.parameters, &request)?;
                (request.request_id, sent)
            }
        };
        if let Err(error) = sent {
            gateway.not_sent(order.number, &self.unsent(verb, &error), now);
            return Ok(());
        }
        self.open.begin(&order, verb, request_id, path, now);
        Ok(())
    }
}

/// The requests of an order, by the service that takes them.
enum Wanted {
    /// Several are a path.
    Movement(Vec<MovementData>),
    Control(ModuleControl),
    Parameter(ParameterRequest),
}

/// What an order is in the words of `ril`, and its requests.
fn wanted(order: &Order, gateway: &Gateway) -> (Verb, Wanted) {
    let write = |port, value| {
        let request = ParameterRequest::write(fresh_request_id(), port, value);
        (Verb::SetParameter, Wanted::Parameter(request))
    };
    let robot_order = match order.kind {
        OrderKind::Start => RobotOrder::Start,
        OrderKind::Stop => RobotOrder::Stop,
        OrderKind::TakeOff(height_m) => RobotOrder::TakeOff(height_m),
        OrderKind::Hold => RobotOrder::Hold,
        OrderKind::Land => RobotOrder::Land,
        OrderKind::GoTo(position) => RobotOrder::GoTo(position),
        OrderKind::Path => {
            let positions = gateway.path(order.number);
            let path = MovementData::path(fresh_request_id(), positions, fresh_request_id);
            return (Verb::GoTo, Wanted::Movement(path.collect()));
        }
        OrderKind::ReloadFence => {
            let request = ModuleControl::new(fresh_request_id(), ControlCommand::ReloadFence);
            return (Verb::ReloadFence, Wanted::Control(request));
        }
        OrderKind::Speed(speed_mps) => return write(port::CRUISE_SPEED_MPS, speed_mps),
        OrderKind::WritePort(port, value) => return write(port, value),
        OrderKind::ReadPort(port) => {
            let request = ParameterRequest::read(fresh_request_id(), port);
            return (Verb::GetParameter, Wanted::Parameter(request));
        }
    };
    let wanted = match robot_order.request(0) {
        OrderRequest::Movement(request) => Wanted::Movement(vec![request]),
        OrderRequest::Control(request) => Wanted::Control(request),
    };
    (robot_order.verb(), wanted)
}

fn drain<R: Request>(client: &mut Option<Client<R>>, reports: &mut Vec<RequestReport>) {
    if let Some(client) = client {
        client.drain(|report| reports.push(*report));
    }
}
