//! Right and wrong configurations: what is refused, where it stands, and what to do.

use std::time::Duration;

use super::*;
use crate::telemetry::Selection;

fn parse(text: &str) -> Result<Config, String> {
    runtime::config::parse(text, "relay.toml").map_err(|error| error.to_string())
}

#[test]
fn the_annotated_example_has_the_defaults() {
    runtime::config::proof::assert_annotated::<Config>(include_str!("../../relay.toml"), &[]);
    let example = Config::default();
    assert_eq!(example.check(), Ok(()));
    for side in Side::ALL {
        assert_eq!(example.check_side(side), Ok(()));
    }
}

#[test]
fn rules_and_patterns_choose_what_is_relayed() {
    let config = parse(
        "[topics]\nexclude = [\"camera/*\"]\nrate_hz = 10\n\
         rules = [{ key = \"dsp*\", rate_hz = 0 }, { key = \"*\", priority = \"low\" }]\n",
    )
    .unwrap();
    assert_eq!(config.check(), Ok(()));
    let plan = |key| config.topics.plan(key);
    assert_eq!(plan("camera/picture"), None);
    assert_eq!(plan("relay/link"), None);
    let stations = plan("relay/stations").unwrap();
    assert_eq!(
        stations.selection,
        Selection::Newest(Duration::from_secs(2))
    );
    let outline = plan("bridge/outline").unwrap();
    assert_eq!(outline.selection, Selection::Pieces, "whatever the rate is");
    assert_eq!(plan("bridge/journal"), None);
    let raw = plan("dsp_telemetry").unwrap();
    assert_eq!(
        (raw.selection, raw.priority),
        (Selection::All, Priority::Data)
    );
    let other = plan("hero_telemetry").unwrap();
    assert_eq!(
        other.selection,
        Selection::Newest(Duration::from_millis(100))
    );
    assert_eq!(other.priority, Priority::Low);
}

#[test]
fn a_rate_of_next_to_nothing_is_one_sample() {
    for rate_hz in ["1e-20", "5e-324"] {
        let config = parse(&format!("[topics]\nrate_hz = {rate_hz}\n")).unwrap();
        let plan = config.topics.plan("hero_telemetry").unwrap();
        let Selection::Newest(period) = plan.selection else {
            panic!("{rate_hz}: {:?}", plan.selection);
        };
        assert!(period > Duration::from_secs(1 << 40), "{rate_hz}");
    }
}

#[test]
fn a_journal_is_relayed_only_if_it_is_named() {
    for (include, is_relayed) in [("*", false), ("bridge/*", false), ("bridge/journal", true)] {
        let text = format!("[topics]\ninclude = [\"{include}\"]\n");
        let config = parse(&text).unwrap();
        let plan = config.topics.plan("bridge/journal");
        assert_eq!(plan.is_some(), is_relayed, "{include}");
        assert_eq!(config.topics.plan("status/journal"), None, "{include}");
    }
}

#[test]
fn patterns_are_keys_or_the_beginning_of_keys() {
    for pattern in [
        "*",
        "dsp*",
        "dsp_*",
        "a/*",
        "hero_telemetry",
        "battery_watch/charge",
    ] {
        assert_eq!(check_pattern(pattern), Ok(()), "{pattern}");
    }
    for pattern in [
        "", "**", "*/state", "a*b", "Dsp*", "/a", "a//*", "a b", "a.b*", "a/", "a_",
    ] {
        let error = check_pattern(pattern).unwrap_err();
        assert!(error.contains("such as `battery_watch/*`"), "{error}");
    }
}

#[test]
fn a_side_that_goes_through_routers_must_know_one() {
    let text = "[network]\nthrough = \"router\"\n";
    let config = parse(text).unwrap();
    let fault = config.check_side(Side::Robot).unwrap_err();
    assert!(
        fault.reason().contains("`robot.connect` names none"),
        "{fault}"
    );
    assert_eq!(
        config.check_side(Side::Station),
        Ok(()),
        "it has the default"
    );
    assert_eq!(config.check_side(Side::Router), Ok(()), "it is one");
    for more in ["discovery = true\n", "[robot]\nconnect = [\"tcp/hub:1\"]\n"] {
        let config = parse(&format!("{text}{more}")).unwrap();
        assert_eq!(config.check_side(Side::Robot), Ok(()));
    }
}
