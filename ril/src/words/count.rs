//! Numbers of things in words.

use std::fmt::Display;

/// `1 sample`, `2 samples`: the plural is the singular with an s.
pub fn count<N: Display + PartialEq + From<u8>>(number: N, singular: &str) -> String {
    count_irregular(number, singular, &format!("{singular}s"))
}

/// `1 thing half removed`, `2 things half removed`: of things whose plural is another.
pub fn count_irregular<N: Display + PartialEq + From<u8>>(
    number: N,
    singular: &str,
    plural: &str,
) -> String {
    let noun = if number == N::from(1) {
        singular
    } else {
        plural
    };
    format!("{number} {noun}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        let texts = [0, 1, 2].map(|number: u64| count(number, "sample"));
        assert_eq!(texts, ["0 samples", "1 sample", "2 samples"]);
        let texts =
            [1, 2].map(|number: usize| count_irregular(number, "piece left", "pieces left"));
        assert_eq!(texts, ["1 piece left", "2 pieces left"]);
    }
}
