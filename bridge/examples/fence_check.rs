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

/// Times a fence like one in use, a large field with masts in a row, and the worst one: equal fields one upon another.
fn measure(areas: usize, vertices: usize) {
    println!("{areas} areas of {vertices} vertices:");
    let field = |name| round(name, AreaKind::Inclusion, [0.0, 0.0], 0.4, vertices);
    let masts = (1..areas).map(|number| {
        let place_deg = 0.6 * number as f64 / areas as f64 - 0.3;
        round(
            number,
            AreaKind::Exclusion,
            [0.0, place_deg],
            1e-3,
            vertices,
        )
    });
    let masts = fence(std::iter::once(field(0)).chain(masts));
    time("far from all masts", &masts, [0.1, -0.3], [0.1, 0.3]);
    time("through all masts", &masts, [0.0, -0.35], [0.0, 0.35]);
    time("that leaves the field", &masts, [0.0, 0.39], [0.0, 0.6]);
    let fields = fence((0..areas).map(field));
    time("inside equal fields", &fields, [0.1, -0.3], [0.1, 0.3]);
    time("that leaves equal fields", &fields, [0.0, 0.39], [0.0, 0.6]);
}

fn fence(areas: impl Iterator<Item = AreaConfig>) -> Fence {
    let site = oracle::Site {
        areas: areas.collect(),
        ..oracle::Site::default()
    };
    site.fence()
}

/// A polygon of equal edges.
fn round(
    number: usize,
    kind: AreaKind,
    [latitude_deg, longitude_deg]: [f64; 2],
    radius_deg: f64,
    vertices: usize,
) -> AreaConfig {
    let vertex = |index: usize| {
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / vertices as f64).sin_cos();
        [
            latitude_deg + radius_deg * sin,
            longitude_deg + radius_deg * cos,
        ]
    };
    AreaConfig {
        name: format!("area {number}"),
        kind,
        polygon: Some((0..vertices).map(vertex).collect()),
        centre: None,
        radius_m: None,
        floor_m: None,
        ceiling_m: None,
    }
}

fn time(what: &str, fence: &Fence, from: [f64; 2], to: [f64; 2]) {
    const ROUNDS: u32 = 100;
    let [from, to] = [from, to].map(|[latitude_deg, longitude_deg]| Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m: 50.0,
    });
    let began = Instant::now();
    for _ in 0..ROUNDS {
        black_box(black_box(fence).check_leg(&from, &to));
    }
    let each_us = began.elapsed().as_secs_f64() * 1e6 / f64::from(ROUNDS);
    let answer = fence
        .check_leg(&from, &to)
        .map(|breach| (breach.rule, breach.amount_m));
    println!("  a leg {what}: {each_us:.1} µs, {answer:?}");
}
