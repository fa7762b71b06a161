//! Two robots and one station through a router.

use std::path::Path;

use ipc_types::code::ModuleStatus;
use ipc_types::payload::ModuleState;
use ril_tests::Process;
use ril_tests::chain::beside_or_skip;

use crate::machine::{Crew, Machine, end, free_endpoint};
use crate::rig::RELAY;

/// What is started.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Router,
    Robots,
    Station,
}

/// Starts a star in this order, and flies both robots one after the other.
fn fly_a_star(order: [Part; 3]) {
    let Some(ril) = beside_or_skip(Path::new(RELAY)) else {
        return;
    };
    let endpoint = free_endpoint();
    let through = "[network]\nthrough = \"router\"\n[robot]\nlisten = []\n";
    let machines = [1_u32, 2].map(|number| {
        let machine = Machine::new(&ril, "star");
        machine.write("relay.toml", through);
        let crew = Crew::start(&machine, number);
        (machine, number, crew)
    });
    let station = Machine::new(&ril, "star");
    station.write(
        "relay.toml",
        &format!("{through}[station]\nrobots = [{{ number = 1 }}, {{ number = 2 }}]\n"),
    );
    let mut relays: Vec<Process> = Vec::new();
    for part in order {
        match part {
            Part::Router => {
                relays.push(station.start_ready(&format!("relay router --listen {endpoint}")));
            }
            Part::Robots => {
                for (machine, number, _) in &machines {
                    // It is ready when it has reached the router.
                    relays.push(machine.start(&format!(
                        "relay robot --robot {number} --connect {endpoint} --may-command gcs"
                    )));
                }
            }
            Part::Station => relays.push(
                // And so is this one.
                station.start(&format!("relay station --name gcs --connect {endpoint}")),
            ),
        }
    }
    station.await_link(1);
    station.await_link(2);
    // Only the robot that is meant starts.
    station.run("start --robot 2", 0);
    let is_running = |state: &ModuleState| state.status == ModuleStatus::Running.code();
    station
        .subscribe::<ModuleState>(2)
        .until("robot 2 runs", is_running);
    assert!(!is_running(&station.subscribe::<ModuleState>(1).next()));
    for number in [2, 1] {
        station.run(
            &format!("start --robot {number}"),
            if number == 2 { 5 } else { 0 },
        );
        station.run(&format!("takeoff --robot {number} --altitude 5"), 0);
        station.run(&format!("land --robot {number}"), 0);
    }
    relays.into_iter().rev().for_each(|relay| {
        end(relay);
    });
    for (_machine, _, crew) in machines {
        crew.end();
    }
}

#[test]
fn a_star_works_when_the_router_comes_first() {
    fly_a_star([Part::Router, Part::Robots, Part::Station]);
}

#[test]
fn a_star_works_when_the_router_comes_last() {
    fly_a_star([Part::Station, Part::Robots, Part::Router]);
}
