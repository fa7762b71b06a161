//! Whatever happens in whatever order: every request has exactly one final report, and nothing panics.

mod desk;

use std::collections::HashMap;

use bridge::Input;
use desk::{Desk, north};
use ipc_types::code::{ControlCommand, Stage};

/// SplitMix64: small, seeded, the same everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % bound
    }
}

fn one_step(desk: &mut Desk, random: &mut Random) {
    let point = north(random.below(20) as i32);
    match random.below(20) {
        0 => drop(desk.control(ControlCommand::Start)),
        1 => drop(desk.control(ControlCommand::Stop)),
        2 => drop(desk.take_off()),
        3 => drop(desk.land()),
        4..=8 => {
            let (id, first, last) = (random.below(2), random.below(2), random.below(2));
            desk.waypoint(id, first as u16, last as u16, point);
        }
        9 => desk.dsp.acknowledges = random.below(3) > 0,
        10 => desk.dsp.silent = random.below(3) == 0,
        11 => desk.dsp.grants = random.below(3) > 0,
        12 => desk.dsp.status.flying = random.below(2) > 0,
        13 => desk.dsp.at(point),
        14 => desk.dsp_error([8, 18, 30, 40, 102, 999][random.below(6) as usize]),
        15 if random.below(4) == 0 => desk.apply(Input::PortClosed),
        15 if random.below(2) == 0 => desk.apply(Input::PortOpened),
        16 if random.below(4) == 0 => (desk.dsp.mask, desk.dsp.time_ms) = (0, 0),
        17 => {
            let noise: Vec<u8> = (0..random.below(40))
                .map(|_| random.below(256) as u8)
                .collect();
            desk.apply(Input::Received(&noise));
        }
        _ => desk.run(10 << random.below(8)),
    }
}

#[test]
fn every_request_has_exactly_one_final_report() {
    for seed in 0..400 {
        let mut desk = Desk::started();
        let mut random = Random(seed);
        for _ in 0..200 {
            one_step(&mut desk, &mut random);
        }
        desk.apply(Input::Close);
        let mut finals: HashMap<u64, u32> = HashMap::new();
        for report in &desk.out.reports {
            let stage = Stage::from_code(report.stage).unwrap();
            let count = finals.entry(report.request_id).or_default();
            assert_eq!(
                *count, 0,
                "seed {seed}: {stage} after the final report of request {}",
                report.request_id
            );
            *count += u32::from(stage.is_final());
        }
        for (request, count) in finals {
            assert_eq!(count, 1, "seed {seed}: request {request}");
        }
    }
}
