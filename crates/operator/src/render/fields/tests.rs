//! What is shown of samples, and by which names it can be chosen.

use ipc_types::code::{ImiError, ModuleStatus};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Schema, TelemetryGroup};
use serde_json::Value;

use super::*;

fn everything<T: Shown>(sample: &T) -> Tree {
    Tree::of(sample, &Selection::default())
}

fn json<T: Shown>(sample: &T, names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let tree = Tree::of(sample, &Selection::of(&Schema::of::<T>(), &names).unwrap());
    let schema = T::TYPE_NAME;
    serde_json::to_string(&JsonLine {
        schema,
        tree: &tree,
    })
    .unwrap()
}

#[test]
fn chosen_fields_keep_their_place_and_their_digits() {
    let mut dsp = DspTelemetry {
        sequence: 7,
        valid_groups: TelemetryGroup::Geographic.bit() | TelemetryGroup::Attitude.bit(),
        ..DspTelemetry::default()
    };
    dsp.geographic.latitude_deg = -37.123_456_7;
    dsp.attitude.yaw_deg = 0.1;
    for (names, expected) in [
        (
            &["sequence"][..],
            r#"{"schema":"hero.DspTelemetry.v3","sequence":7}"#,
        ),
        (
            &["attitude.yaw_deg", "geographic.latitude_deg", "xy.x_m"],
            r#"{"schema":"hero.DspTelemetry.v3","geographic":{"latitude_deg":-37.1234567},"xy":{"x_m":null},"attitude":{"yaw_deg":0.1}}"#,
        ),
        (
            &["xy", "xy.x_m"],
            r#"{"schema":"hero.DspTelemetry.v3","xy":{"x_m":null,"y_m":null}}"#,
        ),
    ] {
        assert_eq!(json(&dsp, names), expected);
    }
    dsp.attitude.yaw_deg = f32::NAN;
    let expected = r#"{"schema":"hero.DspTelemetry.v3","attitude":{"yaw_deg":null}}"#;
    assert_eq!(json(&dsp, &["attitude.yaw_deg"]), expected);
}

#[test]
fn a_field_is_named_by_its_last_part_and_an_angle_in_degrees() {
    let mut hero = HeroTelemetry {
        valid_groups: u32::MAX,
        ..HeroTelemetry::default()
    };
    hero.geodetic.latitude_rad = 0.5;
    let schema = r#"{"schema":"hero.HeroTelemetry.v3","geodetic":"#;
    for (name, expected) in [
        ("latitude_deg", r#"{"latitude_deg":28.6478897565}}"#),
        (
            "geodetic.latitude_deg",
            r#"{"latitude_deg":28.6478897565}}"#,
        ),
        ("latitude_rad", r#"{"latitude_rad":0.5}}"#),
    ] {
        assert_eq!(json(&hero, &[name]), format!("{schema}{expected}"));
    }
    hero.valid_groups = 0;
    let nothing = format!(r#"{schema}{{"latitude_deg":null}}}}"#);
    assert_eq!(json(&hero, &["latitude_deg"]), nothing);
}

#[test]
fn codes_are_shown_by_name_and_unknown_ones_as_they_are() {
    let mut state = ModuleState {
        status: ModuleStatus::Running.code(),
        functionality: 99,
        imi_error: ImiError::CommunicationFatalError.code(),
        ..ModuleState::default()
    };
    state.dsp_errors.total = 1;
    state.dsp_errors.last_code = 8;
    assert_eq!(
        json(
            &state,
            &[
                "status",
                "functionality",
                "imi_error",
                "dsp_errors.last_code"
            ]
        ),
        r#"{"schema":"hero.ModuleState.v7","status":"running","imi_error":"communication-fatal-error","functionality":99,"dsp_errors":{"last_code":"dsp-error-8"}}"#
    );
}

#[test]
fn all_fields_are_shown_when_none_is_chosen() {
    let tree = everything(&ModuleState::default());
    let shown: Vec<String> = tree
        .plain_fields()
        .into_iter()
        .map(|(path, _)| path)
        .collect();
    let is_struct = |name: &str| {
        shown
            .iter()
            .any(|path| path.starts_with(&format!("{name}.")))
    };
    let expected: Vec<String> = field_names(Schema::of::<ModuleState>().root())
        .into_iter()
        .filter(|name| !is_struct(name))
        .collect();
    assert_eq!(shown, expected);
}

#[test]
fn an_unknown_field_is_refused_with_what_may_have_been_meant() {
    let schema = Schema::of::<DspTelemetry>();
    #[rustfmt::skip]
    let cases = [
        ("altitude_m", "did you mean `geographic.altitude_m` or `references.altitude_m`?"),
        ("altitud", "did you mean `geographic.altitude_m` or `references.altitude_m`?"),
        ("geografic", "did you mean `geographic`?"),
        ("geographic.", "did you mean `geographic`?"),
        ("geographic.latitud_deg", "did you mean `geographic.latitude_deg`?"),
        ("zzz", "has no field `zzz`; the fields are sequence, epoch_ns, "),
        ("", "has no field ``; the fields are"),
    ];
    for (name, expected) in cases {
        let error = Selection::of(&schema, &["xy".to_owned(), name.to_owned()]);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(expected), "{name}: {error}");
    }
}

#[test]
fn a_description_is_about_the_chosen_fields_and_what_they_lie_in() {
    let chosen = |names: &[&str]| Selection {
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        ..Selection::default()
    };
    for (names, path, expected) in [
        (&["cells[2]"][..], "cells", true),
        (&["cells[2]"], "cells[0].level", true),
        (&["cells[2].level"], "cells[0].flags", false),
        (&["attitude"], "attitude.yaw_deg", true),
        (&["attitude.yaw_deg"], "attitude", true),
        (&["attitude"], "sequence", false),
        (&[], "sequence", true),
    ] {
        assert_eq!(chosen(names).is_about(path), expected, "{names:?} {path}");
    }
}

#[test]
fn an_unknown_struct_is_shown_by_its_schema() {
    let schema = "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\na_msgs/B[2] cells\nfloat32[2] raw\n\
        ================================================================================\n\
        MSG: a_msgs/B\nint16 level\nuint8[2] flags\n";
    let schema = Schema::parse(schema).unwrap();
    let mut payload = vec![0; schema.size()];
    payload[0] = 5;
    payload[16..18].copy_from_slice(&(-2_i16).to_le_bytes());
    payload[23] = 9;
    payload[24..28].copy_from_slice(&0.1_f32.to_le_bytes());
    payload[28..32].copy_from_slice(&f32::INFINITY.to_le_bytes());
    for (names, expected) in [
        (
            &[][..],
            r#"{"schema":"a.A.v1","sequence":5,"epoch_ns":0,"cells":[{"level":-2,"flags":[0,0]},{"level":0,"flags":[0,9]}],"raw":[0.1,null]}"#,
        ),
        (
            &["raw[0]", "cells[1].flags[1]", "sequence"],
            r#"{"schema":"a.A.v1","sequence":5,"cells[1]":{"flags[1]":9},"raw[0]":0.1}"#,
        ),
        (
            &["cells[0]"],
            r#"{"schema":"a.A.v1","cells[0]":{"level":-2,"flags":[0,0]}}"#,
        ),
    ] {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let selection = Selection::of(&schema, &names).unwrap();
        let tree = Tree::read(&schema, Meaning::NONE, &payload, &selection);
        let line = JsonLine {
            schema: schema.type_name(),
            tree: &tree,
        };
        assert_eq!(serde_json::to_string(&line).unwrap(), expected);
    }
    let tree = Tree::read(&schema, Meaning::NONE, &payload, &Selection::default());
    let names: Vec<String> = tree
        .plain_fields()
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    assert_eq!(
        names[2..5],
        ["cells[0].level", "cells[0].flags", "cells[1].level"]
    );
    let error = Selection::of(&schema, &["level".to_owned()]).unwrap_err();
    assert!(error.to_string().contains("`cells[0].level`"), "{error}");
}

#[test]
fn people_see_a_dash_for_nothing_and_text_without_quotes() {
    for (value, expected) in [
        (Value::Null, "-"),
        (Value::from("running"), "running"),
        (Value::from(0.5), "0.5"),
        (Value::from(vec![0, 3]), "[0,3]"),
    ] {
        assert_eq!(Plain(&value).to_string(), expected);
    }
}
