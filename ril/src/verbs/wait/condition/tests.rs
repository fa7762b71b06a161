//! Conditions: how they are read, and by which samples they are met.

use ipc_types::code::{Functionality, LinkState};
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, TelemetryGroup};
use operator::render::fields::{Selection, Tree};

use super::{Condition, Newest};

const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

fn state() -> ModuleState {
    let mut state = ModuleState {
        published_ns: NOW.0,
        functionality: Functionality::AtRest.code(),
        ..ModuleState::default()
    };
    state.link.state = LinkState::Up.code();
    state
}

fn hero() -> HeroTelemetry {
    let mut hero = HeroTelemetry {
        received_ns: NOW.0,
        flying: 1,
        valid_groups: u32::from(u16::MAX),
        gps_quality: 4,
        ..HeroTelemetry::default()
    };
    hero.geodetic.altitude_m = 20.5;
    hero.geodetic.latitude_rad = 37.5_f64.to_radians();
    hero.supply.battery_v = 22.5;
    hero.supply.fuel_fraction = 0.3;
    hero.attitude.yaw_rad = std::f32::consts::FRAC_PI_2;
    hero
}

/// Whether the condition is met, and how things are.
fn judge(text: &str, state: Option<&ModuleState>, hero: Option<&HeroTelemetry>) -> (bool, String) {
    let condition = Condition::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let standing = condition.judge(&Newest { state, hero }, NOW);
    (standing.is_met, standing.value)
}

#[test]
fn values_are_compared_in_the_unit_of_their_name() {
    for (text, is_met, value) in [
        ("altitude>20", true, "20.5 m"),
        ("altitude > 20m", true, "20.5 m"),
        ("altitude>20.5", false, "20.5 m"),
        ("altitude>=20.5", true, "20.5 m"),
        ("battery<22.5V", false, "22.5 V"),
        ("battery<=22.5", true, "22.5 V"),
        ("fuel<31%", true, "30 %"),
        ("fix=4", true, "4"),
        ("fix==4", true, "4"),
        ("fix!=4", false, "4"),
        ("geodetic.altitude_m<30", true, "20.5 m"),
        ("geodetic.latitude_deg>37.4", true, "37.5 deg"),
        ("heading>89.9deg", true, "90"),
        ("speed<-1", false, "0 m/s"),
        ("flying", true, "flying"),
        ("landed", false, "flying"),
        ("up", true, "link up"),
        (
            "hovering",
            true,
            "at-rest, 0.0 m/s over ground, 0.0 m/s upwards",
        ),
    ] {
        let (met, found) = judge(text, Some(&state()), Some(&hero()));
        assert_eq!(met, is_met, "{text}: {found}");
        assert!(found.starts_with(value), "{text}: {found}");
    }
}

#[test]
fn what_is_not_of_the_present_fulfils_nothing() {
    let old_state = ModuleState {
        published_ns: NOW.0 - 1_000_000_001,
        ..state()
    };
    let old_hero = HeroTelemetry {
        received_ns: NOW.0 - 1_000_000_001,
        flying: 0,
        ..hero()
    };
    let future = HeroTelemetry {
        received_ns: NOW.0 + 1,
        flying: 0,
        ..hero()
    };
    for (text, state, hero, value) in [
        ("up", Some(&old_state), None, "the bridge's state is old"),
        ("up", None, None, "no state of the bridge"),
        ("landed", None, Some(&old_hero), "the telemetry is old"),
        ("landed", None, Some(&future), "the telemetry is old"),
        ("altitude<100", None, None, "no telemetry"),
        ("hovering", None, Some(&old_hero), "no state of the bridge"),
    ] {
        assert_eq!(
            judge(text, state, hero),
            (false, value.to_owned()),
            "{text}"
        );
    }
}

#[test]
fn a_group_that_is_not_sent_fulfils_nothing() {
    let mut hero = hero();
    hero.valid_groups &=
        !u32::from(TelemetryGroup::Supply.bit() | TelemetryGroup::GpsVelocity.bit());
    let (met, value) = judge("battery<30", None, Some(&hero));
    assert!(!met && value.contains("does not send"), "{value}");
    let (met, value) = judge("hovering", Some(&state()), Some(&hero));
    assert!(!met && value.contains("no velocity"), "{value}");
}

#[test]
fn a_helicopter_that_moves_or_is_moved_does_not_hover() {
    let mut quick = hero();
    quick.velocity.ground_speed_mps = 0.5;
    let mut sinking = hero();
    sinking.velocity.up_mps = -0.5;
    let landed = HeroTelemetry {
        flying: 0,
        ..hero()
    };
    for hero in [quick, sinking, landed] {
        assert!(
            !judge("hovering", Some(&state()), Some(&hero)).0,
            "{hero:?}"
        );
    }
    let on_a_path = ModuleState {
        functionality: Functionality::FollowingPath.code(),
        ..state()
    };
    assert!(!judge("hovering", Some(&on_a_path), Some(&hero())).0);
    let holding = ModuleState {
        functionality: Functionality::Holding.code(),
        ..state()
    };
    assert!(judge("hovering", Some(&holding), Some(&hero())).0);
}

#[test]
fn a_mistake_is_named_with_what_may_have_been_meant() {
    for (text, expected) in [
        ("", "a condition is up, landed"),
        ("landet", "did you mean `landed`?"),
        ("altitude", "a condition is up, landed"),
        ("altitude!20", "an operator is"),
        ("altitude>", "is not a number of m, such as 20 or 20m"),
        ("altitude>20V", "is not a number of m"),
        ("altitude>10,5m", "`10,5m` has a decimal comma: write 10.5"),
        ("altitude>nan", "is not a number of m"),
        ("altitude_m>20", "did you mean `geodetic.altitude_m`"),
        ("altitud>20", "did you mean `altitude`?"),
        ("geodetic>20", "is not one number"),
        ("zzz>20", "the fields are"),
        (">20", "the fields are"),
    ] {
        let error = Condition::parse(text).unwrap_err();
        assert!(error.contains(expected), "{text:?}: {error}");
    }
}

#[test]
fn a_condition_says_what_it_needs() {
    for (text, needs_state, needs_telemetry) in [
        ("up", true, false),
        ("landed", false, true),
        ("hovering", true, true),
        ("altitude>1", false, true),
    ] {
        let condition = Condition::parse(text).unwrap();
        assert_eq!(
            (condition.needs_state(), condition.needs_telemetry()),
            (needs_state, needs_telemetry),
            "{text}"
        );
        assert_eq!(condition.to_string(), text);
    }
}

#[test]
fn every_number_that_echo_prints_can_be_waited_for_with_its_own_name() {
    let printed = Tree::of(&HeroTelemetry::default(), &Selection::default());
    let names: Vec<String> = printed
        .plain_fields()
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    assert!(
        names.contains(&"geodetic.latitude_rad".to_owned()),
        "{names:?}"
    );
    for name in &names {
        let condition = Condition::parse(&format!("{name}>0"));
        assert!(condition.is_ok(), "{name}: {condition:?}");
        if let Some(angle) = name.strip_suffix("_rad") {
            let condition = Condition::parse(&format!("{angle}_deg>0deg"));
            assert!(condition.is_ok(), "{name} in degrees: {condition:?}");
        }
    }
}

#[test]
fn a_quantity_that_a_log_has_too_is_called_as_there() {
    let hero = HeroTelemetry {
        received_ns: 1,
        valid_groups: u32::MAX,
        geodetic: ipc_types::payload::HeroGeodetic {
            latitude_rad: 0.5_f64.to_radians(),
            ..Default::default()
        },
        ..HeroTelemetry::default()
    };
    let newest = Newest {
        hero: Some(&hero),
        state: None,
    };
    for (condition, expected) in [
        ("latitude_deg>0.4", "0.5 deg"),
        ("geodetic.latitude_deg>0.4", "0.5 deg"),
        ("geodetic.latitude_rad>0", "0.009 rad"),
    ] {
        let standing = Condition::parse(condition)
            .unwrap()
            .judge(&newest, MonotonicNs(1));
        assert_eq!(
            (standing.is_met, standing.value.as_str()),
            (true, expected),
            "{condition}"
        );
    }
    // Of several of the name the one that is meant is asked for.
    let error = Condition::parse("altitude_m>0").unwrap_err();
    assert!(
        error.contains("did you mean `geodetic.altitude_m`"),
        "{error}"
    );
}
