//! Judges a robot for the preflight: its processes, the link to its DSP, and whether the data is of the present.

use ipc_types::code::{LinkState, ModuleStatus};
use ipc_types::payload::{LastMinute, ModuleState};
use ipc_types::{Module, MonotonicNs, RelayModule};
use operator::config::PreflightLimits;
use operator::render::messages::details::dsp_error;
use operator::render::words::{count, module_words};
use operator::robot::domain::Provided;
use runtime::finding::Finding;

use super::facts::PreflightFacts;

/// With fewer messages than this a share of rejected ones says little: the share is then taken of so many. 1,000
/// messages are 20 s of status messages.
const LEAST_MESSAGES: u64 = 1000;

/// A check, or why it could not be made.
pub(super) type CheckOutcome = Result<Finding, Finding>;

pub(super) fn either(check: CheckOutcome) -> Finding {
    check.unwrap_or_else(|unmade| unmade)
}

/// The checks of processes, link and data.
pub(super) fn judge(facts: &PreflightFacts, limits: &PreflightLimits) -> Vec<Finding> {
    vec![
        process(facts, "bridge"),
        process(facts, "status"),
        orders(facts),
        either(link(facts)),
        either(losses(facts, limits)),
        either(dsp_errors(facts)),
        telemetry(facts, limits),
        robot_telemetry(facts, limits),
        either(module(facts)),
        either(without_bridge(facts)),
    ]
}

/// Whether a live process provides what `command` should.
fn process(facts: &PreflightFacts, command: &'static str) -> Finding {
    let robot = facts.robot;
    let start = format!("start it: `ril run {command} --robot {robot}`");
    let providers = facts
        .machine
        .domain
        .as_ref()
        .map(|domain| &domain.providers);
    let providers = match providers {
        Ok(Ok(providers)) => providers,
        _ => return Finding::unchecked(command, "the shared memory cannot be read"),
    };
    let of_command =
        |one: &&Provided| one.robot.get() == robot && one.service.provider() == command;
    match providers.iter().find(of_command) {
        None => Finding::error(command, "not running", start),
        Some(one) if one.by.process == RelayModule::NAME => Finding::note(
            command,
            format!("relayed from another machine (process {})", one.by.pid),
        ),
        Some(one) => Finding::note(command, format!("running (process {})", one.by.pid)),
    }
    .with_limit("running")
}

/// Whether an order would be answered.
fn orders(facts: &PreflightFacts) -> Finding {
    const ID: &str = "orders";
    match &facts.live.answer {
        None => Finding::unchecked(ID, "no process takes orders"),
        Some(Ok(())) => Finding::note(ID, "the bridge answers"),
        Some(Err(reason)) => Finding::error(
            ID,
            reason.clone(),
            "an order would get no answer: end consumers, or raise the bridge's limit of descriptors (`LimitNOFILE=`, `ulimit -n`); \
             `ril doctor` says whether the bridge is stopped",
        ),
    }
    .with_limit("an answer")
}

/// The newest state of the bridge, or the check that cannot be made without it.
pub(super) fn state<'a>(
    facts: &'a PreflightFacts,
    id: &'static str,
) -> Result<&'a ModuleState, Finding> {
    let state = facts.live.state.as_ref();
    state.ok_or_else(|| Finding::unchecked(id, "no state came from the bridge"))
}

fn link(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "dsp-link";
    let state = state(facts, ID)?;
    // 0: a state that has held since the bridge began, which is no moment to count from.
    let since = MonotonicNs(state.link.state_since_ns);
    let since = Some(since).filter(|since| since.0 > 0);
    let since = since.and_then(|since| age_s(since, facts.now));
    let since = since.map_or(String::new(), |age| format!(" for {age:.1} s"));
    Ok(match state.link.state() {
        Some(LinkState::Up) => Finding::note(ID, format!("up{since}")),
        Some(LinkState::Gone) => Finding::error(
            ID,
            format!("gone{since}: the bridge has no serial port"),
            "look at cable, power and `serial.port`; `ril doctor` looks at the port",
        ),
        Some(LinkState::Connecting) => Finding::error(
            ID,
            format!("connecting{since}: the DSP does not answer"),
            "switch the DSP on; compare `baud_rate` and `profile` with the DSP's",
        ),
        Some(LinkState::Silent) => Finding::error(
            ID,
            format!("silent{since}: no message comes from the DSP"),
            "wait some seconds; if it stays so, look at cable and power",
        ),
        None => Finding::error(
            ID,
            format!("in a state with the unknown number {}", state.link.state),
            "use `ril` of the bridge's version",
        ),
    }
    .with_limit("up"))
}

/// What the line lost in the last minute: an outage before that is over.
fn losses(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = "link-losses";
    let state = state(facts, ID)?;
    let LastMinute {
        duration_s,
        messages,
        rejected,
        commands_repeated,
        commands_failed,
    } = state.last_minute;
    let all = u64::from(messages) + u64::from(rejected);
    let percent = f64::from(rejected) * 100.0 / all.max(LEAST_MESSAGES) as f64;
    let value = format!(
        "{percent:.2} % of {all} messages of the last {duration_s} s rejected, {} repeated and {commands_failed} failed",
        count(commands_repeated, "command"),
    );
    let next_step = "look at cable, ground and `baud_rate`; `ril status` has the counters";
    let threshold = limits.link_loss_percent;
    let check = if percent > threshold.fail || commands_failed > 0 {
        Finding::error(ID, value, next_step)
    } else if percent > threshold.warn {
        Finding::warning(ID, value, next_step)
    } else {
        Finding::note(ID, value)
    };
    Ok(check.with_limit(format!(
        "at most {} % (fail above {} %), none failed",
        threshold.warn, threshold.fail
    )))
}

fn dsp_errors(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "dsp-errors";
    let state = state(facts, ID)?;
    let errors = &state.dsp_errors;
    let check = match errors.total {
        0 => Finding::note(ID, "none since the bridge began"),
        total => Finding::warning(
            ID,
            format!(
                "{} since the bridge began, last {}",
                count(total, "error"),
                dsp_error(errors.last_code)
            ),
            "find the cause; `ril status` counts them by code",
        ),
    };
    Ok(check.with_limit("none"))
}

/// Whether what the DSP sends is of the present.
fn telemetry(facts: &PreflightFacts, limits: &PreflightLimits) -> Finding {
    const ID: &str = "telemetry";
    if facts.live.state.is_none() && facts.live.dsp.is_none() {
        return Finding::unchecked(ID, "no state came from the bridge");
    }
    let received = facts
        .live
        .dsp
        .as_ref()
        .map(|dsp| MonotonicNs(dsp.received_ns));
    let next_step = "see the check dsp-link; is the bridge stopped, or its machine overloaded?";
    fresh(ID, received, facts.now, limits, next_step)
}

/// Whether status translates what the DSP sends.
fn robot_telemetry(facts: &PreflightFacts, limits: &PreflightLimits) -> Finding {
    const ID: &str = "robot-telemetry";
    if facts.live.dsp.is_none() && facts.live.hero.is_none() {
        return Finding::unchecked(ID, "no raw telemetry came");
    }
    let received = facts
        .live
        .hero
        .as_ref()
        .map(|hero| MonotonicNs(hero.received_ns));
    let next_step = "see the check status; is the process stopped, or its machine overloaded?";
    fresh(ID, received, facts.now, limits, next_step)
}

fn fresh(
    id: &'static str,
    received: Option<MonotonicNs>,
    now: MonotonicNs,
    limits: &PreflightLimits,
    next_step: &str,
) -> Finding {
    let age = received.map(|received| age_s(received, now));
    let check = match age {
        None => Finding::error(id, "no sample came", next_step),
        Some(None) => Finding::error(id, "the newest sample is dated in the future", next_step),
        Some(Some(age)) if age > limits.max_age_s => Finding::error(
            id,
            format!("the newest sample is {age:.3} s old"),
            next_step,
        ),
        Some(Some(age)) => Finding::note(id, format!("{age:.3} s old")),
    };
    check.with_limit(format!("at most {} s old", limits.max_age_s))
}

/// Whether the module takes a start.
fn module(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "module";
    let state = state(facts, ID)?;
    let words = module_words(state.status(), state.is_blocked());
    Ok(match (state.status(), words) {
        (Some(ModuleStatus::Aborted), _) => Finding::warning(
            ID,
            format!("aborted: {}", state.imi_error()),
            "find the cause in the bridge's log, then `ril start`",
        ),
        (_, Some(words)) => Finding::note(ID, words),
        (_, None) => Finding::warning(
            ID,
            format!("in a state with the unknown number {}", state.status),
            "use `ril` of the bridge's version",
        ),
    })
}

/// What stops the helicopter when the bridge is gone.
fn without_bridge(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "dsp-timeout";
    let state = state(facts, ID)?;
    if state.link.state() != Some(LinkState::Up) {
        return Err(Finding::unchecked(
            ID,
            "the DSP was not asked: the link is not up",
        ));
    }
    let check = match state.link.pc_timeout_supported {
        1 => Finding::note(ID, "the DSP stops the helicopter when the bridge is gone"),
        _ => Finding::warning(
            ID,
            "the DSP flies on to the end of its path when the bridge is gone",
            "fly short paths, or set `link.pc_timeout_ms` on a DSP that has port 10004",
        ),
    };
    Ok(check.with_limit("the DSP stops by itself"))
}

/// Seconds from `time` to `now`; `None` if it lies in the future.
pub(super) fn age_s(time: MonotonicNs, now: MonotonicNs) -> Option<f64> {
    (time <= now).then(|| now.since(time).as_secs_f64())
}
