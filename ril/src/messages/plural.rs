//! Numbers of things in words.

/// `1 sample`, `2 samples`: the plural is the singular with an s.
pub fn count(number: u64, singular: &str) -> String {
    match number {
        1 => format!("1 {singular}"),
        _ => format!("{number} {singular}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        let texts = [0, 1, 2].map(|number| count(number, "sample"));
        assert_eq!(texts, ["0 samples", "1 sample", "2 samples"]);
    }
}
