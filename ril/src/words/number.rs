//! Distances, and the numbers of items of a plan.

/// Metres, such as `950 m`, `12.3 km`.
pub fn distance(metres: f64) -> String {
    match metres {
        metres if metres.abs() < 9_999.5 => format!("{metres:.0} m"),
        metres => format!("{:.1} km", metres / 1000.0),
    }
}

/// Numbers of items, such as `item 3`, `items 3, 4 and 7`, `items 3, 4, 5 and 12 more`.
pub fn items(numbers: &[u32]) -> String {
    const MOST: usize = 5;
    let list = |numbers: &[u32]| {
        let texts: Vec<String> = numbers.iter().map(u32::to_string).collect();
        texts.join(", ")
    };
    match numbers {
        [] => "the plan".to_owned(),
        [one] => format!("item {one}"),
        [first @ .., last] if numbers.len() <= MOST => {
            format!("items {} and {last}", list(first))
        }
        _ => format!(
            "items {} and {} more",
            list(&numbers[..MOST - 1]),
            numbers.len() - MOST + 1
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_matter() {
        assert_eq!(distance(949.6), "950 m");
        assert_eq!(distance(12_345.0), "12.3 km");
        assert_eq!(items(&[3]), "item 3");
        assert_eq!(items(&[3, 4, 7]), "items 3, 4 and 7");
        assert_eq!(items(&[1, 2, 3, 4, 5, 6, 7]), "items 1, 2, 3, 4 and 3 more");
    }
}
