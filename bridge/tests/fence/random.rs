//! Random legs: beside an independent judge, and with numbers of every kind.

use super::chance;

#[test]
fn an_independent_judge_agrees_on_random_legs() {
    // For the long form, such as a million of other legs.
    let number = |name| std::env::var(name).map(|text| text.parse().expect("a whole number"));
    let seed = number("RIL_SEED").unwrap_or(20);
    let counts = chance::compare(seed, number("RIL_LEGS").unwrap_or(20_000));
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
    let mut chance = chance::Chance(7);
    for _ in 0..200 {
        let place = chance::Place::random(&mut chance);
        let site = place.site(&mut chance);
        let fence = site.fence();
        for _ in 0..50 {
            let (mut from, mut to) = place.leg(&site, &mut chance);
            for value in [
                &mut from.latitude_deg,
                &mut from.altitude_m,
                &mut to.longitude_deg,
                &mut to.altitude_m,
            ] {
                let any = f64::from_bits(chance.bits());
                let edge = [f64::NAN, f64::MIN_POSITIVE, -0.0, 180.0, -85.0, 1e5];
                *value = match chance.below(3) {
                    0 => any,
                    1 => edge[chance.below(edge.len())],
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
