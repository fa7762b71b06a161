//! Judges the helicopter and the rules it flies by for the preflight: switch, position, GPS, battery, fuel, geofence.

use ipc_types::code::PilotSwitch;
use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, TelemetryGroup};
use operator::config::{PreflightLimits, Threshold};
use operator::render::messages::details::broken_rule;
use operator::render::words::count;
use operator::robot::pilot::GpsFix;
use runtime::finding::Finding;

use super::facts::PreflightFacts;
use super::robot::{CheckOutcome, age_s, either, state};

/// What to do about a group that the DSP does not send.
const ADD_GROUP: &str = "add the group to `status.groups` of bridge.toml and restart the bridge";

/// The checks of the helicopter and its rules.
pub(super) fn judge(facts: &PreflightFacts, limits: &PreflightLimits) -> Vec<Finding> {
    let mut checks: Vec<Finding> = [
        ground(facts, limits),
        switch(facts),
        home(facts, limits),
        gps_fix(facts, limits),
        battery(facts, limits),
        fuel(facts, limits),
        fence(facts),
        safety_rules(facts),
    ]
    .map(either)
    .into();
    checks.push(supply_rules(facts));
    checks
}

/// A sample of the present that has `group`, or the check that cannot be made without it.
fn sample<'a>(
    facts: &'a PreflightFacts,
    limits: &PreflightLimits,
    id: &'static str,
    group: Option<TelemetryGroup>,
) -> Result<&'a DspTelemetry, Finding> {
    let Some(dsp) = &facts.live.dsp else {
        return Err(Finding::unchecked(id, "no telemetry came"));
    };
    let age = age_s(MonotonicNs(dsp.received_ns), facts.now);
    if age.is_none_or(|age| age > limits.max_age_s) {
        return Err(Finding::unchecked(
            id,
            "the telemetry is not of the present",
        ));
    }
    match group {
        Some(group) if !dsp.valid(group) => {
            let why = format!("the DSP sends no plausible group `{}`", group.name());
            Err(Finding::unchecked(id, why).with_next_step(ADD_GROUP))
        }
        _ => Ok(dsp),
    }
}

/// The check that the helicopter stands.
pub(super) const GROUND: &str = "ground";

fn ground(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = GROUND;
    let check = match sample(facts, limits, ID, None)?.flying {
        0 => Finding::note(ID, "on the ground"),
        _ => Finding::warning(ID, "flying", "these checks are for before the take-off"),
    };
    Ok(check.with_limit("on the ground"))
}

fn switch(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "mode-switch";
    let state = state(facts, ID)?;
    let check = match PilotSwitch::from_code(state.safety.pilot_switch) {
        Some(PilotSwitch::Auto) => Finding::note(ID, "auto"),
        Some(PilotSwitch::Manual) => Finding::error(
            ID,
            "manual: the pilot flies",
            "set the pilot's switch to auto; the bridge refuses movements until then",
        ),
        Some(PilotSwitch::Unknown) | None => Finding::unchecked(
            ID,
            "the DSP does not send the switch, or what it sent is old",
        )
        .with_next_step(
            "look at the pilot's transmitter; add `supply` to `status.groups` of bridge.toml",
        ),
    };
    Ok(check.with_limit("auto"))
}

/// Where the helicopter stands: without it no take-off and no path is taken.
fn home(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = "home";
    let without_fix =
        |dsp: &DspTelemetry| dsp.valid(TelemetryGroup::GpsQuality) && dsp.gps_quality == 0;
    if without_fix(sample(facts, limits, ID, None)?) {
        let why = "the GPS has no fix, and without one a position means nothing";
        return Err(Finding::unchecked(ID, why));
    }
    sample(facts, limits, ID, Some(TelemetryGroup::Geographic))?;
    let Some(place) = state(facts, ID)?.home() else {
        let why = "the bridge has not seen the helicopter on the ground";
        return Err(Finding::unchecked(ID, why));
    };
    let text = format!(
        "{:.6}, {:.6}, altitude {:.1} m",
        place.latitude_deg, place.longitude_deg, place.altitude_m
    );
    Ok(Finding::note(ID, text).with_limit("a position"))
}

fn gps_fix(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = "gps-fix";
    let dsp = sample(facts, limits, ID, Some(TelemetryGroup::GpsQuality))?;
    let quality = u32::from(dsp.gps_quality);
    let value = format!("quality {quality} ({})", GpsFix(quality).name());
    let check = if limits.gps_quality_pass.contains(&quality) {
        Finding::note(ID, value)
    } else if limits.gps_quality_warn.contains(&quality) {
        let next_step = "wait for a better fix, or widen `[arrival]` of bridge.toml: positions may be metres wrong";
        Finding::warning(ID, value, next_step)
    } else {
        Finding::error(
            ID,
            value,
            "wait for a fix with a free view of the sky; look at the antenna",
        )
    };
    Ok(check.with_limit(format!(
        "quality {} (warn with {})",
        list(&limits.gps_quality_pass),
        list(&limits.gps_quality_warn)
    )))
}

fn list(numbers: &[u32]) -> String {
    let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
    match numbers.is_empty() {
        true => "none".to_owned(),
        false => numbers.join(", "),
    }
}

fn battery(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = "battery";
    let dsp = sample(facts, limits, ID, Some(TelemetryGroup::Supply))?;
    let volts = f64::from(dsp.supply.battery_mv) / 1000.0;
    let next_step = "charge or replace the battery";
    Ok(at_least(ID, volts, "V", limits.battery_v, next_step))
}

fn fuel(facts: &PreflightFacts, limits: &PreflightLimits) -> CheckOutcome {
    const ID: &str = "fuel";
    let dsp = sample(facts, limits, ID, Some(TelemetryGroup::Supply))?;
    let percent = f64::from(dsp.supply.fuel_percent);
    Ok(at_least(ID, percent, "%", limits.fuel_percent, "refuel"))
}

/// A value that should not be below its limits.
fn at_least(
    id: &'static str,
    value: f64,
    unit: &str,
    threshold: Threshold,
    next_step: &str,
) -> Finding {
    let text = format!("{value:.1} {unit}");
    let check = if value < threshold.fail {
        Finding::error(id, text, next_step)
    } else if value < threshold.warn {
        Finding::warning(id, text, next_step)
    } else {
        Finding::note(id, text)
    };
    check.with_limit(format!(
        "at least {} {unit} (fail below {} {unit})",
        threshold.warn, threshold.fail
    ))
}

fn fence(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "fence";
    let state = state(facts, ID)?;
    let in_force = state.safety.fence_areas as usize;
    let in_file = facts.bridge.as_ref().map(|config| &config.fence);
    let origin = &facts.bridge_origin;
    let areas = |number: usize| count(number as u64, "area");
    let check = match in_file {
        Some(file) if file.areas() != in_force => Finding::warning(
            ID,
            format!(
                "{} in force, {} in {origin}",
                areas(in_force),
                areas(file.areas())
            ),
            "`ril fence reload`; or name the bridge's file with --bridge",
        ),
        Some(file) if in_force == 0 && !file.is_empty() => {
            Finding::note(ID, format!("no areas; {origin} limits the altitude"))
        }
        _ if in_force == 0 => Finding::warning(
            ID,
            "no areas: the helicopter may fly anywhere",
            "add `[[fence.area]]` to bridge.toml, then `ril fence reload`",
        ),
        _ => Finding::note(ID, format!("{} in force", areas(in_force))),
    };
    Ok(check.with_limit("as in bridge.toml, at least 1 area"))
}

/// Whether a safety rule is broken now.
fn safety_rules(facts: &PreflightFacts) -> CheckOutcome {
    const ID: &str = "safety-rules";
    let state = state(facts, ID)?;
    let check = match broken_rule(&state.safety) {
        None => Finding::note(ID, "none broken"),
        Some(broken) => Finding::new(
            broken.severity,
            ID,
            format!(
                "{} broken{}; the bridge's action: {}",
                broken.name, broken.by, broken.action
            ),
        )
        .with_next_step("remove the cause; docs/safety.md says what each rule does"),
    };
    Ok(check.with_limit("none broken"))
}

/// Whether the bridge watches battery and fuel in flight.
fn supply_rules(facts: &PreflightFacts) -> Finding {
    const ID: &str = "supply-rules";
    let Some(config) = &facts.bridge else {
        let why = "no bridge.toml that can be read is here";
        return Finding::unchecked(ID, why).with_next_step("name the bridge's file with --bridge");
    };
    let origin = &facts.bridge_origin;
    let unwatched: Vec<&str> = [
        ("battery_v", &config.safety.battery_v),
        ("fuel_percent", &config.safety.fuel_percent),
    ]
    .into_iter()
    .filter(|(_, limits)| limits.steps().next().is_none())
    .map(|(name, _)| name)
    .collect();
    let check = match unwatched.as_slice() {
        [] => Finding::note(
            ID,
            format!("battery and fuel are watched in flight, as {origin} says"),
        ),
        names => Finding::warning(
            ID,
            format!("no limits in {origin} for {}", names.join(" and ")),
            "set them in `[safety]` of bridge.toml, then restart the bridge",
        ),
    };
    check.with_limit("battery and fuel watched")
}
