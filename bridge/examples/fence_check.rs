//! Compares the geofence with an independent judge on random legs, and times it.
//!
//! `cargo run --release -p bridge --example fence_check [LEGS [SEED]]`; a million legs and seed 1 without arguments. Ends
//! with status 101 and the leg when the judges disagree.

use std::hint::black_box;
use std::time::Instant;

use bridge::safety::fence::{AreaConfig, AreaKind, Fence, MAX_AREAS, MAX_VERTICES};
use dsp_protocol::Waypoint;

#[path = "../tests/fence/chance.rs"]
mod chance;
#[path = "../tests/fence/oracle.rs"]
mod oracle;

fn main() {
    let mut args = std::env::args().skip(1).map(|arg| {
        arg.parse()
            .expect("usage: fence_check [LEGS [SEED]], both whole numbers")
    });
    let legs: u64 = args.next().unwrap_or(1_000_000);
    let seed: u64 = args.next().unwrap_or(1);
    let began = Instant::now();
    println!("{:#?}", chance::compare(seed, legs));
    println!("in {:.1} s; no disagreement", began.elapsed().as_secs_f64());
    for (areas, vertices) in [(16, 32), (MAX_AREAS, MAX_VERTICES)] {
        measure(areas, vertices);
    }
}

/// One large inclusion, and exclusions in it in a row along the equator.
fn measure(areas: usize, vertices: usize) {
    let circle = |name: String, kind, [lat, lon]: [f64; 2], radius_deg: f64| AreaConfig {
        name,
        kind,
        polygon: Some(
            (0..vertices)
                .map(|vertex| {
                    let angle = std::f64::consts::TAU * vertex as f64 / vertices as f64;
                    [
                        lat + radius_deg * angle.sin(),
                        lon + radius_deg * angle.cos(),
                    ]
                })
                .collect(),
        ),
        centre: None,
        radius_m: None,
        floor_m: None,
        ceiling_m: None,
    };
    let field = circle("field".to_owned(), AreaKind::Inclusion, [0.0, 0.0], 0.4);
    let masts = (1..areas).map(|number| {
        let place = number as f64 / areas as f64;
        circle(
            format!("mast {number}"),
            AreaKind::Exclusion,
            [0.0, place * 0.6 - 0.3],
            1e-3,
        )
    });
    let site = oracle::Site {
        areas: std::iter::once(field).chain(masts).collect(),
        ..oracle::Site::default()
    };
    let fence = site.fence();
    let at = |latitude_deg, longitude_deg| Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m: 50.0,
    };
    println!("{areas} areas of {vertices} vertices:");
    time(
        "  a leg far from all exclusions",
        &fence,
        at(0.1, -0.3),
        at(0.1, 0.3),
    );
    time(
        "  a leg across their row, between two",
        &fence,
        at(-0.25, -0.25),
        at(0.25, 0.27),
    );
    time(
        "  a leg through all exclusions",
        &fence,
        at(0.0, -0.35),
        at(0.0, 0.35),
    );
    time(
        "  a leg that leaves the inclusion",
        &fence,
        at(0.0, 0.39),
        at(0.0, 0.6),
    );
}

fn time(what: &str, fence: &Fence, from: Waypoint, to: Waypoint) {
    const ROUNDS: u32 = 1000;
    let began = Instant::now();
    for _ in 0..ROUNDS {
        black_box(black_box(fence).check_leg(&from, &to));
    }
    let each_us = began.elapsed().as_secs_f64() * 1e6 / f64::from(ROUNDS);
    println!("{what}: {each_us:.1} µs, {:?}", fence.check_leg(&from, &to));
}
