//! Random fences, random legs that aim at their edges, and the comparison of two judges.

use std::f64::consts::TAU;

use bridge::safety::fence::{AreaConfig, AreaKind, Breach, Fence, FenceRule};
use dsp_protocol::Waypoint;
use fastrand::Rng;

use super::oracle::{GREY_M, Oracle, Site, metres_per_degree, normal_deg};

/// How many legs one random fence is asked about.
const LEGS_PER_SITE: u64 = 200;

/// What came out of a comparison.
#[derive(Clone, Debug, Default)]
struct Counts {
    legs: u64,
    allowed: u64,
    floor: u64,
    ceiling: u64,
    exclusion: u64,
    inclusion: u64,
    /// Of all legs, those that touch so exactly that both answers are right: each is still checked for the rest.
    doubtful: u64,
    /// Breaches whose amount was compared as well.
    amounts: u64,
}

/// Compares `legs` legs.
///
/// # Panics
/// The judges disagree; the message has all that is needed to repeat it.
fn compare(seed: u64, legs: u64) -> Counts {
    let mut counts = Counts::default();
    for site_number in 0..legs.div_ceil(LEGS_PER_SITE) {
        let mut random = Rng::with_seed(seed ^ site_number.wrapping_mul(0xD6E8_FEB8_6659_FD93));
        let place = Place::random(&mut random);
        let site = place.site(&mut random);
        let (fence, oracle) = (site.fence(), Oracle::new(&site));
        for _ in 0..LEGS_PER_SITE.min(legs - counts.legs) {
            let (from, to) = place.leg(&site, &mut random);
            let outcome = compare_leg(&fence, &oracle, &from, &to, &mut counts);
            if let Err(why) = outcome {
                panic!(
                    "{why}\nseed {seed}, fence {site_number}: {site:?}\nfrom {from:?}\nto {to:?}"
                );
            }
        }
    }
    counts
}

fn compare_leg(
    fence: &Fence,
    oracle: &Oracle,
    from: &Waypoint,
    to: &Waypoint,
    counts: &mut Counts,
) -> Result<(), String> {
    let breach = fence.check_leg(from, to);
    let hits = oracle.judge(from, to);
    counts.legs += 1;
    counts.doubtful += u64::from(hits.iter().any(|hit| hit.surely.is_none()));
    let surely = hits.iter().filter_map(|hit| hit.surely).reduce(f64::min);
    let Some(breach) = breach else {
        counts.allowed += 1;
        return match surely {
            Some(_) => Err(format!("allowed, but {hits:?}")),
            None => Ok(()),
        };
    };
    *match breach.rule {
        FenceRule::Floor => &mut counts.floor,
        FenceRule::Ceiling => &mut counts.ceiling,
        FenceRule::Exclusion => &mut counts.exclusion,
        FenceRule::Inclusion => &mut counts.inclusion,
        FenceRule::Unjudgeable | FenceRule::Ahead | FenceRule::Ground => {
            return Err("unjudgeable".to_owned());
        }
    } += 1;
    // The area of an inclusion is only the nearest one.
    let area = breach.area.filter(|_| breach.rule == FenceRule::Exclusion);
    let constraint = (breach.rule, area);
    let hit = hits.iter().find(|hit| hit.constraint == constraint);
    let hit = hit.ok_or_else(|| format!("refused with {breach:?}, but {hits:?}"))?;
    if surely.is_some_and(|first| first + 1e-9 < hit.possibly) {
        return Err(format!("{breach:?} is not the first of {hits:?}"));
    }
    if counts.legs.is_multiple_of(8) {
        counts.amounts += 1;
        check_amount(oracle, &breach, constraint, from, to)?;
    }
    Ok(())
}

/// The amount is never too large, and too small by at most 1/256 of the length in breach.
fn check_amount(
    oracle: &Oracle,
    breach: &Breach,
    constraint: (FenceRule, Option<usize>),
    from: &Waypoint,
    to: &Waypoint,
) -> Result<(), String> {
    const SPACES: u32 = 256;
    let length_m = oracle.length_m(from, to);
    let sampled_m = oracle.largest_amount_m(constraint, from, to, SPACES);
    let most_m = sampled_m + length_m / f64::from(2 * SPACES) + GREY_M;
    let least_m = sampled_m - length_m / 256.0 - GREY_M;
    if (least_m..=most_m).contains(&breach.amount_m) {
        return Ok(());
    }
    Err(format!(
        "{breach:?}, but {sampled_m} of a leg of {length_m} m"
    ))
}

/// Where a random fence is: metres round an origin.
struct Place {
    origin_deg: [f64; 2],
    scale: [f64; 2],
    size_m: f64,
}

impl Place {
    fn random(random: &mut Rng) -> Place {
        let latitude_deg = between(random, -84.0, 84.0);
        let longitude_deg = if random.u64(..4) == 0 {
            normal_deg(between(random, 179.99, 180.01))
        } else {
            between(random, -180.0, 180.0)
        };
        Place {
            origin_deg: [latitude_deg, longitude_deg],
            scale: metres_per_degree(latitude_deg),
            size_m: random.choice([20.0, 200.0, 2000.0]).unwrap(),
        }
    }

    /// The point at [north, east] metres.
    fn degrees(&self, [north_m, east_m]: [f64; 2]) -> [f64; 2] {
        [
            self.origin_deg[0] + north_m / self.scale[0],
            normal_deg(self.origin_deg[1] + east_m / self.scale[1]),
        ]
    }

    fn anywhere(&self, random: &mut Rng) -> [f64; 2] {
        let size_m = self.size_m * 1.5;
        [
            between(random, -size_m, size_m),
            between(random, -size_m, size_m),
        ]
    }

    fn site(&self, random: &mut Rng) -> Site {
        let count = 1 + random.u64(..5);
        let altitude = |random: &mut Rng, low, high| {
            let value = between(random, low, high);
            (random.u64(..3) == 0).then_some(value)
        };
        Site {
            floor_m: altitude(random, 0.0, 20.0),
            ceiling_m: altitude(random, 80.0, 120.0),
            areas: (0..count)
                .map(|number| AreaConfig {
                    floor_m: altitude(random, 10.0, 50.0),
                    ceiling_m: altitude(random, 51.0, 90.0),
                    ..self.area(format!("area {number}"), random)
                })
                .collect(),
        }
    }

    fn area(&self, name: String, random: &mut Rng) -> AreaConfig {
        let kind = random
            .choice([AreaKind::Inclusion, AreaKind::Exclusion])
            .unwrap();
        // Inclusion areas are larger, so that some legs stay inside.
        let size_m = match kind {
            AreaKind::Inclusion => self.size_m * between(random, 0.7, 1.5),
            AreaKind::Exclusion => self.size_m * between(random, 0.1, 0.6),
        };
        let spread = if kind == AreaKind::Inclusion {
            0.3
        } else {
            0.6
        };
        let [north_m, east_m] = self.anywhere(random).map(|metres| metres * spread);
        let outline = match random.u64(..3) {
            0 => None,
            1 => Some(star(random)),
            _ => Some(comb(1 + random.u64(..4) as usize, random)),
        };
        let vertex = |[north, east]: [f64; 2]| {
            self.degrees([north_m + north * size_m, east_m + east * size_m])
        };
        AreaConfig {
            name,
            kind,
            centre: outline.is_none().then(|| vertex([0.0, 0.0])),
            radius_m: outline.is_none().then_some(size_m),
            polygon: outline.map(|outline| outline.into_iter().map(vertex).collect()),
            floor_m: None,
            ceiling_m: None,
        }
    }

    /// A leg that is anywhere, or aims at what is difficult.
    fn leg(&self, site: &Site, random: &mut Rng) -> (Waypoint, Waypoint) {
        let altitudes: Vec<f64> = site
            .areas
            .iter()
            .flat_map(|area| [area.floor_m, area.ceiling_m])
            .chain([site.floor_m, site.ceiling_m])
            .flatten()
            .collect();
        let altitude_m = |random: &mut Rng| match random.u64(..8) {
            0 if !altitudes.is_empty() => *random.choice(&altitudes).unwrap(),
            1 if !altitudes.is_empty() => {
                *random.choice(&altitudes).unwrap() + between(random, -0.02, 0.02)
            }
            _ => between(random, 5.0, 95.0),
        };
        let [start, end] = self.ground(site, random);
        let low_m = altitude_m(random);
        let level = random.u64(..3) == 0;
        let high_m = if level { low_m } else { altitude_m(random) };
        let waypoint = |[latitude_deg, longitude_deg]: [f64; 2], altitude_m| Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m,
        };
        (waypoint(start, low_m), waypoint(end, high_m))
    }

    /// Begin and end of a leg on the ground, degrees.
    fn ground(&self, site: &Site, random: &mut Rng) -> [[f64; 2]; 2] {
        let any = [self.anywhere(random), self.anywhere(random)].map(|point| self.degrees(point));
        let edges: Vec<[[f64; 2]; 2]> = site
            .areas
            .iter()
            .filter_map(|area| area.polygon.as_ref())
            .flat_map(|outline| {
                let next = outline.iter().cycle().skip(1);
                outline.iter().zip(next).map(|(&a, &b)| [a, b])
            })
            .collect();
        if edges.is_empty() {
            return if random.u64(..10) == 0 {
                [any[0]; 2]
            } else {
                any
            };
        }
        let [a, b] = *random.choice(&edges).unwrap();
        let on_line = |t: f64| {
            let east_deg = normal_deg(b[1] - a[1]);
            [a[0] + t * (b[0] - a[0]), normal_deg(a[1] + t * east_deg)]
        };
        match random.u64(..12) {
            // To a vertex; to a point of an edge.
            0 => [any[0], a],
            1 => [any[0], on_line(between(random, 0.0, 1.0))],
            // Through a vertex.
            2 => {
                let opposite_deg = 2.0 * normal_deg(any[0][1] - a[1]);
                [
                    any[0],
                    [2.0 * a[0] - any[0][0], normal_deg(any[0][1] - opposite_deg)],
                ]
            }
            // Along an edge and beyond it; part of an edge; the edge itself.
            3 => [
                on_line(between(random, -1.0, 0.0)),
                on_line(between(random, 1.0, 2.0)),
            ],
            4 => [
                on_line(between(random, 0.0, 0.5)),
                on_line(between(random, 0.5, 1.0)),
            ],
            5 => [a, b],
            // Beside an edge, at about the distance that counts as touching.
            6 => {
                let along = [
                    (b[0] - a[0]) * self.scale[0],
                    normal_deg(b[1] - a[1]) * self.scale[1],
                ];
                let edge_m = along[0].hypot(along[1]);
                let beside = between(random, -0.02, 0.02) / edge_m;
                // Short, because the other judge walks all of it in millimetres.
                let begin = between(random, -0.1, 1.0);
                let end = begin + between(random, 0.0, 5.0) / edge_m;
                [on_line(begin), on_line(end)].map(|[lat, lon]| {
                    [
                        lat + along[1] * beside / self.scale[0],
                        normal_deg(lon - along[0] * beside / self.scale[1]),
                    ]
                })
            }
            // Up or down, or no way at all.
            7 => [any[0]; 2],
            8 => [a; 2],
            _ => any,
        }
    }
}

/// A polygon round the origin whose vertices lie in all directions at any distance up to 1; most are concave.
fn star(random: &mut Rng) -> Vec<[f64; 2]> {
    let count = 3 + random.u64(..10);
    (0..count)
        .map(|index| {
            // Steps below half a turn keep it simple.
            let angle = TAU * (index as f64 + between(random, 0.0, 0.49)) / count as f64;
            let radius = between(random, 0.2, 1.0);
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect()
}

/// A comb: right angles, and edges on one line.
fn comb(teeth: usize, random: &mut Rng) -> Vec<[f64; 2]> {
    let width = 2.0 / (2 * teeth - 1) as f64;
    let gap_depth = between(random, -0.8, 0.8);
    let mut outline = vec![[-1.0, 1.0], [-1.0, -1.0]];
    for tooth in 0..teeth {
        let left = -1.0 + 2.0 * width * tooth as f64;
        if tooth > 0 {
            outline.push([gap_depth, left]);
        }
        outline.extend([[1.0, left], [1.0, left + width]]);
        if tooth + 1 < teeth {
            outline.push([gap_depth, left + width]);
        }
    }
    // The sum of the widths is 2 but for rounding.
    if let Some(last) = outline.last_mut() {
        last[1] = 1.0;
    }
    outline
}

#[test]
fn an_independent_judge_agrees_on_random_legs() {
    // For the long form, such as a million of other legs.
    let number = |name| std::env::var(name).map(|text| text.parse().expect("a whole number"));
    let seed = number("RIL_SEED").unwrap_or(20);
    let counts = compare(seed, number("RIL_LEGS").unwrap_or(20_000));
    println!("{counts:?}");
    // All kinds of answers occur often, and few legs touch so exactly that both answers are right.
    let answers = [
        counts.allowed,
        counts.floor,
        counts.ceiling,
        counts.exclusion,
        counts.inclusion,
    ];
    assert!(answers.iter().all(|&count| count > 400), "{counts:?}");
    assert_eq!(answers.iter().sum::<u64>(), counts.legs);
    assert!(counts.doubtful < counts.legs / 50, "{counts:?}");
    assert!(counts.amounts > 1000, "{counts:?}");
}

#[test]
fn no_numbers_make_it_panic_and_every_amount_is_a_length() {
    let mut random = Rng::with_seed(7);
    for _ in 0..200 {
        let place = Place::random(&mut random);
        let site = place.site(&mut random);
        let fence = site.fence();
        for _ in 0..50 {
            let (mut from, mut to) = place.leg(&site, &mut random);
            for value in [
                &mut from.latitude_deg,
                &mut from.altitude_m,
                &mut to.longitude_deg,
                &mut to.altitude_m,
            ] {
                let any = f64::from_bits(random.u64(..));
                let edge = [f64::NAN, f64::MIN_POSITIVE, -0.0, 180.0, -85.0, 1e5];
                *value = match random.u64(..3) {
                    0 => any,
                    1 => *random.choice(&edge).unwrap(),
                    _ => *value,
                };
            }
            let amount_m = fence
                .check_leg(&from, &to)
                .map_or(0.0, |breach| breach.amount_m);
            assert!(
                amount_m.is_finite() && amount_m >= 0.0,
                "{fence:?} {from:?} {to:?}"
            );
        }
    }
}

/// A number from `low` up to, but not including, `high`.
fn between(random: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.f64()
}
