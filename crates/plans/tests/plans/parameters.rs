//! Each parameter of each mission item that is flown is done, named by a finding, or forbids the flight.

use dsp_protocol::Waypoint;
use plans::Plan;
use plans::check::check;
use plans::finding::effect;
use plans::flight::{Flight, Step};
use plans::mavlink::MissionItem;
use plans::mavlink::parameters::parameter;
use plans::site::{Endurance, HomeSource, Site, Start};

const NAN: f64 = f64::NAN;

fn item(command: u16, params: [f64; 7]) -> MissionItem {
    MissionItem {
        frame: 3,
        command,
        params,
        auto_continue: true,
    }
}

/// The steps, whether the flight is forbidden, and all that is said.
fn flown(one: MissionItem) -> (Vec<Step>, bool, Vec<String>) {
    let home = Waypoint {
        latitude_deg: 37.411,
        longitude_deg: -6.001,
        altitude_m: 10.0,
    };
    let site = Site {
        home,
        is_home_altitude_known: true,
        home_source: HomeSource::Robot,
        start: Start::Ground(home),
        zero_above_sea_m: None,
        take_off_m: None,
        from: 1,
        is_for_flight: true,
    };
    let take_off = item(22, [0.0, 0.0, 0.0, NAN, NAN, NAN, 20.0]);
    let last = item(16, [0.0, 0.0, 0.0, NAN, 37.413, -6.001, 22.0]);
    let items = match one.command {
        22 => vec![one, last],
        20 | 21 => vec![take_off, last, one],
        _ => vec![take_off, one, last],
    };
    match Plan::from_items(items) {
        Err(error) => (Vec::new(), true, vec![error.to_string()]),
        Ok(plan) => {
            let flight = Flight::new(&plan, &site);
            let findings = check(&plan, &flight, &site, None, &Endurance::default());
            let forbids = findings.iter().any(|one| effect(one) == "forbids");
            let said = findings.iter().map(|one| one.text.clone()).collect();
            (flight.steps, forbids, said)
        }
    }
}

#[test]
fn each_parameter_of_each_item_is_done_or_named_or_forbids_the_flight() {
    let there = |a, d| [a, 0.0, 0.0, d, 37.412, -6.0015, 25.0];
    let good: [(u16, [f64; 7]); 8] = [
        (16, there(4.0, NAN)),
        (17, there(0.0, NAN)),
        (19, there(4.0, NAN)),
        (20, [0.0; 7]),
        (21, [0.0, 0.0, 0.0, NAN, 37.4131, -6.001, 0.0]),
        (22, [0.0, 0.0, 0.0, NAN, 37.4111, -6.001, 20.0]),
        (93, [5.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0]),
        (178, [1.0, 4.0, -1.0, 0.0, 0.0, 0.0, 0.0]),
    ];
    for (command, params) in good {
        let before = flown(item(command, params));
        assert!(!before.1, "{command}: {:?}", before.2);
        for number in 1..=7_u8 {
            let neutral = parameter(command, number).expect("an item that is flown").1;
            for value in [7.25, 2.0, -3.0, f64::INFINITY, f64::NEG_INFINITY] {
                if neutral.contains(&value) {
                    continue;
                }
                let mut params = params;
                params[usize::from(number) - 1] = value;
                let (steps, forbids, said) = flown(item(command, params));
                let is_new = |text: &&String| !before.2.contains(text);
                let names = |text: &String| text.contains(&value.to_string());
                let is_named = said.iter().filter(is_new).any(names);
                let what = format!("{command}, parameter {number} = {value}: {said:?}");
                assert!(forbids || is_named || steps != before.0, "{what}");
                // What is infinite is no time, place or speed.
                let is_named_alone = is_named && steps == before.0;
                assert!(value.is_finite() || forbids || is_named_alone, "{what}");
            }
        }
        // Not a number, and what stands for it, ask for nothing.
        for number in 1..=4_usize {
            let mut params = params;
            if params[number - 1] == 0.0 {
                params[number - 1] = NAN;
                assert_eq!(flown(item(command, params)), before, "{command}, {number}");
            }
        }
    }
}
