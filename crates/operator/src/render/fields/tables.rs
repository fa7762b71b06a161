//! Which field of a sample depends on what, and which numbers are codes: the one place that knows.

use std::sync::LazyLock;

use ipc_types::code::{
    DspPathState, Functionality, ImiCode, LinkState, ModuleId, ModuleStatus, MovementKind,
    OutlineKind, PilotSwitch, PortKind, Reason, SafetyAction, SafetyRule, Stage,
};
use ipc_types::payload::{BridgeOutline, DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::{Schema, TelemetryGroup, Topic};

/// A field, plain or nested, and whether it means something in a sample.
pub type Condition<T> = (&'static str, fn(&T) -> bool);

/// A field whose number stands for something, and the name of the number; `None` when it is not in the contract.
pub type Naming = (&'static str, fn(u32) -> Option<String>);

/// A sample that can be shown field by field.
pub trait Shown: Topic {
    /// The fields that do not always mean something.
    const CONDITIONS: &'static [Condition<Self>];

    /// The fields that are codes.
    const CODES: &'static [Naming];

    /// Where its fields lie, read from its text once in a process.
    fn schema() -> &'static Schema;
}

/// The schema of a [`Shown`].
macro_rules! schema_once {
    ($type:ty) => {
        fn schema() -> &'static Schema {
            static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<$type>);
            &SCHEMA
        }
    };
}

/// What is known of a struct beyond its schema.
#[derive(Clone, Copy)]
pub struct Meaning {
    void: fn(&[u8]) -> Vec<&'static str>,
    codes: &'static [Naming],
}

impl Meaning {
    /// Nothing: every field always means something, and no number has a name.
    pub const NONE: Meaning = Meaning {
        void: |_| Vec::new(),
        codes: &[],
    };

    /// What is known of `T`.
    pub const fn of<T: Shown>() -> Meaning {
        Meaning {
            void: void::<T>,
            codes: T::CODES,
        }
    }

    /// What is known of the struct with this type name, such as `hero.ModuleState.v7`.
    pub fn of_type(type_name: &str) -> Meaning {
        match type_name {
            DspTelemetry::TYPE_NAME => Meaning::of::<DspTelemetry>(),
            HeroTelemetry::TYPE_NAME => Meaning::of::<HeroTelemetry>(),
            ModuleState::TYPE_NAME => Meaning::of::<ModuleState>(),
            BridgeOutline::TYPE_NAME => Meaning::of::<BridgeOutline>(),
            _ => Meaning::NONE,
        }
    }

    /// What is known of what a core says on the topic with this key, or about `requests`.
    pub fn of_key(key: &str) -> Meaning {
        match key {
            DspTelemetry::KEY => Meaning::of::<DspTelemetry>(),
            HeroTelemetry::KEY => Meaning::of::<HeroTelemetry>(),
            ModuleState::KEY => Meaning::of::<ModuleState>(),
            "requests" => Meaning {
                codes: OF_REPORT,
                ..Meaning::NONE
            },
            _ => Meaning::NONE,
        }
    }

    /// Names of the fields that mean nothing in this sample.
    pub(super) fn void(self, payload: &[u8]) -> Vec<&'static str> {
        (self.void)(payload)
    }

    /// Name of the number `code` in the field `path`; `None` if it has none.
    pub fn name_of(self, path: &str, code: u32) -> Option<String> {
        let (_, name_of) = self.codes.iter().find(|(name, _)| *name == path)?;
        name_of(code)
    }
}

fn void<T: Shown>(payload: &[u8]) -> Vec<&'static str> {
    let Some(sample) = T::from_bytes(payload) else {
        return Vec::new();
    };
    let conditions = T::CONDITIONS.iter();
    conditions
        .filter(|(_, means_something)| !means_something(&sample))
        .map(|(name, _)| *name)
        .collect()
}

/// Rows `"field" => Group` of [`Shown::CONDITIONS`].
macro_rules! by_group {
    ($($field:literal => $group:ident),+ $(; $other:literal if $condition:expr)* $(,)?) => {
        &[
            $(($field, |sample| sample.valid(TelemetryGroup::$group)),)+
            $(($other, $condition),)*
            ("last_dsp_error_code", |sample| sample.last_dsp_error().is_some()),
        ]
    };
}

/// Rows `"field" => Code` of [`Shown::CODES`].
macro_rules! codes {
    ($($field:literal => $code:ident),+; $($other:literal as $name:expr),* $(,)?) => {
        &[
            $(($field, |number| $code::from_code(number).map(|code| code.to_string())),)+
            $(($other, $name),)*
        ]
    };
}

impl Shown for DspTelemetry {
    const CONDITIONS: &'static [Condition<Self>] = by_group! {
        "dsp_time_ms" => Time,
        "geographic" => Geographic,
        "xy" => Xy,
        "gps_velocity" => GpsVelocity,
        "gps_quality" => GpsQuality,
        "attitude" => Attitude,
        "acceleration" => Acceleration,
        "angular_rate" => AngularRate,
        "pilot_pwm" => PilotPwm,
        "sonar_adc" => Sonar,
        "supply" => Supply,
        "pan_tilt" => PanTilt,
        "rotor_rpm" => RotorSpeed,
        "barometer_adc" => Barometer,
        "actuation" => Actuation,
        "references" => References,
    };

    const CODES: &'static [Naming] = &[("last_dsp_error_code", dsp_error_name)];

    schema_once!(DspTelemetry);
}

impl Shown for HeroTelemetry {
    const CONDITIONS: &'static [Condition<Self>] = by_group! {
        "dsp_time_s" => Time,
        "geodetic" => Geographic,
        "local" => Xy,
        "velocity" => GpsVelocity,
        "gps_quality" => GpsQuality,
        "attitude" => Attitude,
        "acceleration" => Acceleration,
        "angular_rate" => AngularRate,
        "pilot" => PilotPwm,
        "sonar_height_m" => Sonar,
        "supply" => Supply,
        "pan_rad" => PanTilt,
        "tilt_rad" => PanTilt,
        "rotor_radps" => RotorSpeed,
        "barometer_altitude_m" => Barometer,
        "actuation" => Actuation,
        "references" => References;
        "estimate" if |sample| sample.estimate.valid != 0
    };

    const CODES: &'static [Naming] = &[("last_dsp_error_code", dsp_error_name)];

    schema_once!(HeroTelemetry);
}

impl Shown for ModuleState {
    const CONDITIONS: &'static [Condition<Self>] = &[
        ("movement", |state| state.movement.kind != 0),
        ("movement.distance_to_go_m", |state| {
            state.movement.distance_to_go().is_some()
        }),
        ("link.last_message_ns", |state| {
            state.link.last_message().is_some()
        }),
        ("link.last_telemetry_ns", |state| {
            state.link.telemetry_published > 0
        }),
        ("link.state_since_ns", |state| state.link.state_since_ns > 0),
        ("dsp_errors.last_code", |state| state.dsp_errors.total > 0),
        ("safety.rule", |state| state.safety.rule != 0),
        ("safety.amount", |state| state.safety.rule != 0),
        ("safety.action", |state| state.safety.action != 0),
        ("control.since_ns", |state| state.holder().is_some()),
        ("control.last_order_ns", |state| {
            state.control.last_order_ns > 0
        }),
        ("control.holder", |state| state.holder().is_some()),
        ("control.asker", |state| state.asker().is_some()),
    ];

    const CODES: &'static [Naming] = codes! {
        "module_id" => ModuleId,
        "status" => ModuleStatus,
        "functionality" => Functionality,
        "movement.kind" => MovementKind,
        "link.state" => LinkState,
        "link.dsp_path" => DspPathState,
        "safety.rule" => SafetyRule,
        "safety.action" => SafetyAction,
        "safety.pilot_switch" => PilotSwitch;
        // Every number of these has a name.
        "imi_error" as |code| Some(ImiCode(code).to_string()),
        "dsp_errors.last_code" as dsp_error_name,
    };

    schema_once!(ModuleState);
}

impl Shown for BridgeOutline {
    const CONDITIONS: &'static [Condition<Self>] = &[
        ("area", |piece| piece.kind() != Some(OutlineKind::Path)),
        ("inclusion", |piece| piece.kind() == Some(OutlineKind::Area)),
        ("name", |piece| piece.kind() == Some(OutlineKind::Area)),
        ("floor_m", |piece| piece.floor().is_some()),
        ("ceiling_m", |piece| piece.ceiling().is_some()),
        ("radius_m", |piece| piece.radius_m > 0.0),
        ("points", |piece| piece.count > 0),
    ];

    const CODES: &'static [Naming] = codes! { "kind" => OutlineKind; };

    schema_once!(BridgeOutline);
}

/// The codes of a [`RequestReport`](ipc_types::payload::RequestReport).
const OF_REPORT: &[Naming] = codes! {
    "stage" => Stage,
    "reason" => Reason,
    "rule" => SafetyRule,
    "port.kind" => PortKind;
    "imi_error" as |code| Some(ImiCode(code).to_string()),
    "dsp_error_code" as dsp_error_name,
};

/// Every DSP error has a name, of a known code or not.
fn dsp_error_name(code: u32) -> Option<String> {
    Some(format!("dsp-error-{code}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::fields::{Selection, Tree, field_names};

    /// Fields of telemetry that mean something whatever was transmitted.
    const ALWAYS: [&str; 13] = [
        "sequence",
        "epoch_ns",
        "source_sequence",
        "source_epoch_ns",
        "received_ns",
        "sent_ns",
        "sent_uncertainty_s",
        "published_ns",
        "valid_groups",
        "flying",
        "dsp_boots",
        "dsp_errors",
        "last_dsp_error_code",
    ];

    fn everything<T: Shown>(sample: &T) -> Tree {
        Tree::of(sample, &Selection::default())
    }

    /// Names of the top-level fields of which something is shown.
    fn visible<T: Shown>(sample: &T) -> Vec<String> {
        let tree = everything(sample);
        let mut names: Vec<String> = tree
            .plain_fields()
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(path, _)| path.split('.').next().unwrap().to_owned())
            .filter(|name| !ALWAYS.contains(&name.as_str()))
            .collect();
        names.dedup();
        names
    }

    /// Every field of the layout belongs to a group or is always there, and each group shows its own fields alone.
    fn check_groups<T: Shown>(with_groups: impl Fn(u16) -> T) {
        assert_eq!(visible(&with_groups(0)), [""; 0], "{}", T::NAME);
        let mut seen = Vec::new();
        for group in TelemetryGroup::ALL {
            let names = visible(&with_groups(group.bit()));
            assert!(!names.is_empty(), "{group}: nothing is shown");
            assert!(
                !names.iter().any(|name| seen.contains(name)),
                "{group}: {names:?}"
            );
            seen.extend(names);
        }
        let all = T::FIELDS.iter().map(|field| field.name);
        for name in all.filter(|name| !ALWAYS.contains(name) && *name != "estimate") {
            assert!(
                seen.iter().any(|seen| seen == name),
                "{}: {name} is in no group",
                T::NAME
            );
        }
    }

    #[test]
    fn a_group_that_is_not_valid_never_looks_like_data() {
        check_groups(|valid_groups| DspTelemetry {
            valid_groups,
            ..DspTelemetry::default()
        });
        check_groups(|valid_groups| HeroTelemetry {
            valid_groups: u32::from(valid_groups),
            ..HeroTelemetry::default()
        });
    }

    #[test]
    fn an_estimate_is_shown_when_status_makes_one() {
        let mut sample = HeroTelemetry::default();
        assert_eq!(visible(&sample), [""; 0]);
        sample.estimate.valid = 1;
        assert_eq!(visible(&sample), ["estimate"]);
    }

    #[test]
    fn the_tables_name_fields_that_exist() {
        fn check<T: Shown>() {
            let known = field_names(T::schema().root());
            let named = T::CONDITIONS.iter().map(|(name, _)| name);
            for name in named.chain(T::CODES.iter().map(|(name, _)| name)) {
                assert!(
                    known.iter().any(|known| known == name),
                    "{}: {name}",
                    T::NAME
                );
            }
        }
        check::<DspTelemetry>();
        check::<HeroTelemetry>();
        check::<ModuleState>();
        check::<BridgeOutline>();
    }

    #[test]
    fn what_has_not_happened_is_nothing() {
        let mut state = ModuleState::default();
        let nothing = |state: &ModuleState| -> Vec<String> {
            let tree = everything(state);
            let fields = tree.plain_fields().into_iter();
            fields
                .filter(|(_, value)| value.is_null())
                .map(|(path, _)| path)
                .collect()
        };
        let before = nothing(&state);
        for path in [
            "movement.kind",
            "link.last_message_ns",
            "link.last_telemetry_ns",
            "link.state_since_ns",
            "dsp_errors.last_code",
            "safety.rule",
            "safety.amount",
            "safety.action",
            "control.since_ns",
            "control.last_order_ns",
            "control.holder.session",
            "control.asker.session",
        ] {
            assert!(before.iter().any(|name| name == path), "{path}");
        }
        state.movement.kind = MovementKind::Land.code();
        state.link.messages_received = 1;
        state.link.telemetry_published = 1;
        state.link.state_since_ns = 1;
        state.dsp_errors.total = 1;
        state.safety.rule = SafetyRule::Battery.code();
        state.safety.action = SafetyAction::Warn.code();
        (state.control.held, state.control.asked) = (1, 1);
        state.control.last_order_ns = 1;
        assert_eq!(nothing(&state), ["movement.distance_to_go_m"]);
        state.movement.distance_valid = 1;
        assert_eq!(nothing(&state), [""; 0]);
    }
}
