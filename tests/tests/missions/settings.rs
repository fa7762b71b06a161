//! One mission with varied settings: masks, rules of coherence, ports of both widths, speeds of the line.

use std::num::NonZeroU32;

use bridge::link::coherence::Rule;
use dsp_protocol::port::{self, Access, Port16, Port32};
use dsp_protocol::{Command, DspErrorCode, Group};
use ipc_types::code::LinkState;

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, await_link, fly, point};
use crate::missions::world::{Trouble, World};

fn short_mission() -> [Step; 4] {
    [
        Step::Start,
        Step::TakeOff(5.0),
        Step::Path(vec![
            point(0.0, 8.0, 6.0),
            point(6.0, 8.0, 8.0),
            point(0.0, 0.0, 5.0),
        ]),
        Step::Land,
    ]
}

#[test]
fn any_mask_with_a_position_flies_and_what_it_leaves_out_is_not_valid() {
    let optional: Vec<_> = Group::ALL
        .into_iter()
        .filter(|group| *group != Group::Geographic)
        .collect();
    let mut masks: Vec<Vec<Group>> = optional.iter().map(|group| vec![*group]).collect();
    masks.push(optional.clone());
    masks.push(
        optional
            .into_iter()
            .filter(|group| *group != Group::Time)
            .collect(),
    );
    for left_out in masks {
        let config = WorldConfig::new().without(&left_out);
        let mask = config.bridge.status.mask();
        let mut world = World::new(&config);
        fly(&mut world, &short_mission());
        world.finish();
        let sample = world.witness.latest().expect("samples");
        assert_eq!(sample.valid_groups, mask.0, "without {left_out:?}");
        assert!(world.witness.samples > 500);
    }
}

#[test]
fn both_rules_of_coherence_fly_and_only_the_source_s_holds_samples_back() {
    for (rule, held_back) in [(Rule::Immediate, 0), (Rule::Confirmed, 1)] {
        let mut config = WorldConfig::new();
        config.bridge.status.coherence = rule;
        let mut world = World::new(&config);
        fly(&mut world, &short_mission());
        // On the ground, long after the last command: what was queued has arrived.
        world.run_for(std::time::Duration::from_millis(990));
        world.finish();
        let on_the_way = u64::from(world.simulator.dsp().output().status_pending());
        let statuses = world.simulator.dsp().counters().statuses;
        assert_eq!(
            statuses - on_the_way - world.witness.samples,
            held_back,
            "{rule:?}"
        );
    }
}

/// A value of the port that is not the one at boot.
fn other_16(port: &Port16) -> i32 {
    if port.number == port::STATUS_PERIOD_MS {
        40
    } else {
        port.max / 2 + port.min / 4
    }
}

fn other_32(port: &Port32) -> f32 {
    port.boot * 0.9
}

#[test]
fn parameters_of_both_widths_reach_their_ports_also_after_a_reboot() {
    let ports_16: Vec<_> = port::PORTS_16
        .iter()
        .filter(|port| port.access != Access::Bridge)
        .collect();
    let table_16 = ports_16
        .iter()
        .map(|port| format!("{} = {}\n", port.name, other_16(port)));
    let table_32 = port::PORTS_32
        .iter()
        .map(|port| format!("{} = {:?}\n", port.name, other_32(port)));
    let table: String = table_16.chain(table_32).collect();
    let mut world = World::new(&WorldConfig::new().parameters(&table).unsound());
    for boots in 0..2 {
        await_link(&mut world);
        assert_eq!(world.witness.state.link.dsp_boots, boots);
        let values = world.simulator.dsp().ports();
        for port in &ports_16 {
            let bits = values.read_16(port.number).expect("a port");
            assert_eq!(port.value_of(bits), other_16(port), "{}", port.name);
        }
        for port in port::PORTS_32 {
            assert_eq!(
                values.read_32(port.number),
                Some(other_32(port)),
                "{}",
                port.name
            );
        }
        world.plan(Trouble::Reboot, |_| true);
        world.run_until("the reboot is noticed", |world| {
            world.bridge().link() == LinkState::Connecting
        });
    }
    // Each width with its own command.
    let writes = |is_wide: bool| {
        let commands = world.probe.commands.iter();
        commands
            .filter(|command| match command {
                Command::Write16 { port, .. } => {
                    !is_wide && ports_16.iter().any(|other| other.number == *port)
                }
                Command::Write32 { .. } => is_wide,
                _ => false,
            })
            .count()
    };
    assert_eq!(writes(false), 2 * ports_16.len());
    assert_eq!(writes(true), 2 * port::PORTS_32.len());
    world.finish();
}

#[test]
fn a_slow_line_leaves_out_whole_samples_and_the_mission_is_flown() {
    for (baud, fewest, most) in [(9_600, 5, 8), (38_400, 22, 30), (1_000_000, 48, 51)] {
        let mut config = WorldConfig::new();
        config.simulator.baud = NonZeroU32::new(baud);
        config.bridge.link.ack_timeout_ms = 500;
        config.bridge.link.pc_timeout_ms = 2250;
        let mut world = World::new(&config);
        fly(&mut world, &short_mission());
        world.finish();
        let per_second = world.witness.samples * 1000 / world.now().as_millis() as u64;
        assert!(
            (fewest..=most).contains(&per_second),
            "{per_second} samples a second at {baud} baud"
        );
        let refused: u64 = world.simulator.dsp().counters().rejections.iter().sum();
        assert_eq!(refused, 0, "the DSP refused bytes");
    }
}

#[test]
fn errors_of_the_boot_end_nothing() {
    // Two that would end a movement, one that nobody knows, and as many more as the DSP's queue takes.
    let mut config = WorldConfig::new();
    config.simulator.boot_errors = [8, 18, 102, 999]
        .into_iter()
        .chain([40; 12])
        .map(DspErrorCode)
        .collect();
    let mut world = World::new(&config);
    fly(&mut world, &short_mission());
    world.finish();
    let errors = &world.witness.state.dsp_errors;
    assert_eq!(errors.escalated, 0);
    assert!(errors.total <= 16);
}
