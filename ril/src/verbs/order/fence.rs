//! `ril fence show`: the geofence that the running bridge has in force. `ril fence reload`, with what is wrong in the
//! file that it reads.

use std::path::Path;

use bridge::BridgeConfig;
use bridge::safety::fence::{AreaConfig, AreaKind, FenceConfig};
use ipc_types::Topic;
use ipc_types::code::{ControlCommand, Reason};
use ipc_types::configuration::BridgeConfiguration;
use ipc_types::payload::{ModuleControl, ModuleState};
use operator::options::{RequestArgs, SampleArgs};
use operator::render::messages::Verb;
use operator::render::print_as;
use operator::render::words::count;
use operator::request::{Conversation, Format, Until, control_request};
use operator::robot::absence::{absent, nothing_came};
use operator::robot::running;
use operator::session::{OrderContext, Session, is_relayed};
use runtime::config::ConfigError;
use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

/// Name of the JSON object's layout.
const SCHEMA: &str = "ril.Fence.v1";

/// The fence, for programs: the keys of `[fence]` in bridge.toml.
#[derive(Serialize)]
struct FenceObject {
    schema: &'static str,
    robot: u32,
    #[serde(flatten)]
    fence: FenceConfig,
}

/// `ril fence show`
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it does not say its fence in time.
pub fn show(args: &SampleArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(args)?;
    if !session.is_provided(BridgeConfiguration::KEY)? && !session.is_provided(ModuleState::KEY)? {
        return Err(absent(&session, ModuleState::KEY));
    }
    if is_elsewhere(&session)? {
        let robot = session.ipc.robot();
        let text =
            format!("robot {robot}'s bridge runs on another machine, and its fence is not relayed");
        return Err(Failure::new(ExitCode::ServiceAbsent, text)
            .with_next_step("`ril fence show` on the robot's own machine shows it"));
    }
    let Some(running) = running::bridge(&session, timeout)? else {
        let failure = nothing_came(&session, BridgeConfiguration::KEY, timeout)?;
        return Err(failure.with_next_step(
            "ask on the robot's own machine, with the same version of all programs",
        ));
    };
    let robot = session.ipc.robot().get();
    let fence = FenceConfig::from(running.fence);
    let text = text(robot, &fence);
    let object = FenceObject {
        schema: SCHEMA,
        robot,
        fence,
    };
    print_as(args.json, &object, text)
}

/// Whether the bridge runs on another machine, from which its state comes and its configuration does not.
fn is_elsewhere(session: &Session) -> Result<bool, Failure> {
    let state = session.provider(ModuleState::KEY)?;
    let is_relayed = state.is_some_and(|provider| is_relayed(ModuleState::KEY, &provider));
    Ok(is_relayed && !session.is_provided(BridgeConfiguration::KEY)?)
}

/// The fence as a table.
fn text(robot: u32, fence: &FenceConfig) -> String {
    let areas = count(fence.area.len(), "area");
    let mut text = format!("fence of robot {robot}, in force: {areas}\n");
    for (name, limit_m) in [("floor", fence.floor_m), ("ceiling", fence.ceiling_m)] {
        text += &format!("{name:<9} {}\n", altitude(limit_m));
    }
    for area in &fence.area {
        let AreaConfig {
            name,
            kind,
            polygon: _,
            centre: _,
            radius_m: _,
            floor_m,
            ceiling_m,
        } = area.config();
        let kind = match kind {
            AreaKind::Inclusion => "inclusion",
            AreaKind::Exclusion => "exclusion",
        };
        text += &format!(
            "{kind:<9} {name}: {}; floor {}, ceiling {}\n",
            shape(area.config()),
            altitude(*floor_m),
            altitude(*ceiling_m)
        );
    }
    text + "Altitudes are telemetry altitudes; positions are latitude, longitude in degrees.\n"
}

fn altitude(limit_m: Option<f64>) -> String {
    limit_m.map_or_else(|| "none".to_owned(), |metres| format!("{metres:.1} m"))
}

fn shape(area: &AreaConfig) -> String {
    let place = |[latitude, longitude]: [f64; 2]| format!("{latitude:.7}, {longitude:.7}");
    match (&area.polygon, area.centre.zip(area.radius_m)) {
        (Some(corners), _) => {
            let corners: Vec<String> = corners.iter().copied().map(place).collect();
            format!("polygon of [{}]", corners.join("], ["))
        }
        (None, Some((centre, radius_m))) => {
            format!("circle of {radius_m:.1} m round {}", place(centre))
        }
        (None, None) => "no shape".to_owned(),
    }
}

/// `ril fence reload`
///
/// # Errors
///
/// As [`stop`](super::stop); what is wrong in the file is named, if the bridge refuses it and the file can be seen from
/// here.
pub fn reload(args: &RequestArgs) -> Result<(), Failure> {
    let asked = OrderContext::of(&args.ask)?;
    let request = control_request(ControlCommand::ReloadFence, asked.issued, asked.deadline_ms);
    let mut bridge =
        Conversation::<ModuleControl>::open(&asked.session, Verb::ReloadFence, asked.timeout)?;
    let reloaded = bridge.follow(&[request], Until::of(args), Format::of(args.ask.json));
    let failed = bridge.failed();
    reloaded.map(drop).map_err(|failure| match failed {
        // The bridge says only that the fence is not valid, and its log why.
        Some(Reason::InvalidFence) => with_mistake(failure, mistake(&asked.session)),
        _ => failure,
    })
}

fn with_mistake(failure: Failure, mistake: Option<String>) -> Failure {
    match mistake {
        Some(mistake) => Failure::new(failure.code(), mistake)
            .context(failure.chain().join(": "))
            .with_next_step("correct the file, then reload it again"),
        None => failure,
    }
}

/// What is wrong with the file that the live bridge reads; `None` if nothing is, or the file cannot be read from here.
fn mistake(session: &Session) -> Option<String> {
    let default = bridge::cli::DEFAULT_CONFIG_FILE;
    let provider = session.provider(ModuleState::KEY).ok()??;
    let file = running::file_of(&provider, "bridge", default)?;
    match runtime::config::load::<BridgeConfig>(Some(&file), Path::new(default)) {
        Err(error @ (ConfigError::Invalid { .. } | ConfigError::Unfit { .. })) => {
            Some(error.to_string())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fence_is_shown_with_names_limits_and_units() {
        let fence: FenceConfig = runtime::config::parse(
            "ceiling_m = 60.0\n[[area]]\nname = 'mast'\nkind = 'exclusion'\ncentre = [37.0, -6.0]\nradius_m = 5.0\nceiling_m = 40\n\
             [[area]]\nname = 'field'\nkind = 'inclusion'\npolygon = [[37.0, -6.0], [37.1, -6.0], [37.1, -6.1]]\n",
            "a test",
        )
        .unwrap();
        let shown = text(7, &fence);
        for expected in [
            "fence of robot 7, in force: 2 areas\nfloor     none\nceiling   60.0 m\n",
            "exclusion mast: circle of 5.0 m round 37.0000000, -6.0000000; floor none, ceiling 40.0 m\n",
            "inclusion field: polygon of [37.0000000, -6.0000000], [",
        ] {
            assert!(shown.contains(expected), "{shown}");
        }
    }
}
