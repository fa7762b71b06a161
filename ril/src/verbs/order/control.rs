//! `ril control …`: who commands the bridge, and taking, releasing and passing that on.

use clap::{Args, Subcommand};
use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, ModuleState, RelayStations};
use ipc_types::{MonotonicNs, Request, Topic};
use operator::options::{RequestArgs, SampleArgs};
use operator::render::fields::{JsonLine, Tree};
use operator::render::messages::Verb;
use operator::render::print_as;
use operator::request::{ask, control_request};
use operator::robot::absence::{absent, nothing_came};
use operator::robot::controller::{Senders, own_session};
use operator::session::{Latest, Session, is_relayed};
use runtime::exit::Failure;

/// Name of the JSON object's layout.
const SCHEMA: &str = "ril.Control.v1";

/// `ril control`
#[derive(Args, Clone, Debug)]
pub struct HolderArgs {
    /// What to do with control.
    #[command(subcommand)]
    pub command: HolderCommand,
}

/// `ril control …`
#[derive(Clone, Debug, Subcommand)]
pub enum HolderCommand {
    /// Show who commands the bridge, and who asks for it
    Show(SampleArgs),
    /// Take control for this terminal; while another has exclusive control, ask its holder for it
    Take(RequestArgs),
    /// Give control back, or do not ask for it any more
    Release(RequestArgs),
    /// Hand control over to the sender that asks for it
    Pass(RequestArgs),
}

/// `ril control …`
///
/// # Errors
///
/// As all requests; of `show` code 3 when there is no bridge, 4 when nothing comes of it in time.
pub fn control(command: &HolderCommand) -> Result<(), Failure> {
    let (verb, code, args) = match command {
        HolderCommand::Show(args) => return show(args),
        HolderCommand::Take(args) => (Verb::TakeControl, ControlCommand::TakeControl, args),
        HolderCommand::Release(args) => {
            (Verb::ReleaseControl, ControlCommand::ReleaseControl, args)
        }
        HolderCommand::Pass(args) => (Verb::PassControl, ControlCommand::PassControl, args),
    };
    ask(verb, ModuleControl::KEY, args, |asked| {
        Ok(vec![control_request(code, asked.issued, asked.deadline_ms)])
    })
}

fn show(args: &SampleArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(args)?;
    let Some(provider) = session.provider(ModuleState::KEY)? else {
        return Err(absent(&session, ModuleState::KEY));
    };
    let state = Latest::<ModuleState>::open(&session.ipc)?;
    // Their names.
    let stations = Latest::<RelayStations>::open(&session.ipc)?;
    let mut newest = (state, stations);
    let give_up = MonotonicNs::now() + timeout;
    // A name that comes late is one that is not known.
    session.gather(&mut newest, give_up, |(state, stations), _| {
        let holder = state.sample.map(|state| state.control.holder);
        let is_named = stations.sample.is_some();
        Ok(holder.is_some_and(|holder| holder.origin == 0 || is_named))
    })?;
    let (state, stations) = newest;
    let Some(state) = state.sample else {
        return Err(nothing_came(&session, ModuleState::KEY, timeout)?);
    };
    let senders = Senders {
        own_session: own_session().filter(|_| !is_relayed(ModuleState::KEY, &provider)),
        stations: stations.sample.as_ref(),
    };
    let (robot, now) = (session.ipc.robot().get(), MonotonicNs::now());
    let control = senders.tree(&state.control, now);
    let tree = &Tree::nested([("robot", robot.into()), ("control", control)]);
    let schema = SCHEMA;
    let text = senders.in_words(&state, now);
    let text = format_args!("control of robot {robot}: {text}\n");
    print_as(args.json, &JsonLine { schema, tree }, text)
}
