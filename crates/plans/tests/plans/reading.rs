//! Everything that is done with the bytes of a plan: for the tests of chance, and for the fuzz target of each reader.

use std::path::Path;

use dsp_protocol::Waypoint;
use plans::check::check;
use plans::flight::Flight;
use plans::site::{Endurance, HomeSource, Site, Start};
use plans::timeline::timeline;
use plans::write::to_qgc_plan;

const HOME: Waypoint = Waypoint {
    latitude_deg: 37.411,
    longitude_deg: -6.001,
    altitude_m: 10.0,
};

/// Panics where a promise is broken: an item is neither flown nor named, or what was written cannot be read.
pub fn use_plan(name: &str, text: &[u8]) {
    let Ok(plan) = plans::read(Path::new(name), text) else {
        return;
    };
    let site = Site {
        home: HOME,
        is_home_altitude_known: true,
        home_source: HomeSource::Operator,
        start: Start::Ground(HOME),
        zero_above_sea_m: None,
        take_off_m: Some(10.0),
        from: 1,
        is_for_flight: true,
    };
    let endurance = Endurance {
        cruise_speed_mps: Some(5.0),
        climb_speed_mps: None,
        endurance_s: Some(600.0),
        reserve_s: 60.0,
    };
    let flight = Flight::new(&plan, &site);
    let _ = timeline(&flight, &endurance);
    let findings = check(&plan, &flight, &site, None, &endurance);
    assert!(findings.iter().all(|finding| !finding.text.is_empty()));
    // Each item is flown, or named by a finding.
    for item in &plan.items {
        let is_named = findings
            .iter()
            .any(|finding| finding.items.contains(&item.number));
        assert!(
            flight.is_flown(item.number) || is_named,
            "{item:?}\n{findings:#?}"
        );
    }
    if let Ok(text) = to_qgc_plan(&plan) {
        plans::read(Path::new("x.plan"), text.as_bytes()).expect("what was written can be read");
    }
}
