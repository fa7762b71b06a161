//! The same mission with other settings: masks, rules of coherence, speeds of the line.

use std::num::NonZeroU32;

use bridge::link::coherence::Rule;
use dsp_protocol::Group;

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, fly, point};
use crate::missions::world::World;

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
