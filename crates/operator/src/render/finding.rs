//! Findings for people: of a machine or a robot, and of a plan.

use runtime::finding::{Finding, Severity};

use super::words::{distance, items, wrap};

/// What was found, or that it could not be looked at and why.
pub fn shown(finding: &Finding) -> String {
    match finding.is_checked {
        true => finding.text.clone(),
        false => format!("not checked: {}", finding.text),
    }
}

/// A line of mark, heading, text and limit, and one of the next step. `width` is that of the heading; no line is longer
/// than `columns` if its words allow it.
pub fn lines(finding: &Finding, heading: &str, width: usize, columns: usize) -> String {
    let mark = match (finding.severity, finding.is_checked) {
        (Severity::Note, _) => "ok",
        (Severity::Warning, _) => "warn",
        (Severity::Error, true) => "FAIL",
        (Severity::Error, false) => "-",
    };
    let mut text = shown(finding);
    // Of something that is in order, a limit in words repeats the text.
    let is_number = |limit: &&String| limit.bytes().any(|byte| byte.is_ascii_digit());
    let limit = finding.limit.as_ref();
    if let Some(limit) = limit.filter(|limit| finding.severity > Severity::Note || is_number(limit))
    {
        text += &format!("; limit: {limit}");
    }
    let head = format!("{mark:<5} {heading:<width$}");
    let mut lines = wrap(&head, &text, columns);
    if let Some(next_step) = &finding.next_step {
        let indent = " ".repeat(head.chars().count());
        lines += &wrap(&indent, &format!("→ {next_step}"), columns);
    }
    lines
}

/// A finding of a plan: item, leg, rule and metres in its first line, then what is so, then what to do. `width` is that
/// of the heading.
pub fn of_plan(finding: &Finding, width: usize, columns: usize) -> String {
    let severity = match (finding.is_checked, finding.severity) {
        (false, _) => "not checked",
        (true, Severity::Error) => "FORBIDS",
        (true, _) => "warns",
    };
    let mut first = items(&finding.items);
    if let Some(leg) = finding.leg {
        first += &format!(", leg {leg}");
    }
    first += &format!(": {}", finding.id);
    match finding.amount_m {
        // What a rule cannot judge has none.
        None | Some(0.0) => {}
        // A breach of centimetres must not look like none.
        Some(amount_m) if amount_m.abs() < 0.1 => first += &format!(" by {amount_m:.3} m"),
        Some(amount_m) if amount_m.abs() < 9_999.5 => first += &format!(" by {amount_m:.1} m"),
        Some(amount_m) => first += &format!(" by {}", distance(amount_m)),
    }
    let indent = " ".repeat(width);
    let mut text = wrap(&format!("{severity:<width$}"), &first, columns);
    text += &wrap(&indent, &finding.text, columns);
    if let Some(next_step) = &finding.next_step {
        text += &wrap(&format!("{indent}next: "), next_step, columns);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_a_line_and_what_to_do_another_one() {
        let battery =
            || Finding::error("battery", "22.0 V", "charge it").with_limit("at least 24 V");
        #[rustfmt::skip]
        let cases = [
            (battery(), "FAIL  battery  22.0 V; limit: at least 24 V\n               → charge it\n"),
            (Finding::note("link", "up").with_limit("up"), "ok    link     up\n"),
            (Finding::note("battery", "25.0 V").with_limit("at least 24 V"), "ok    battery  25.0 V; limit: at least 24 V\n"),
            (Finding::unchecked("fuel", "no sample").with_limit("full"), "-     fuel     not checked: no sample; limit: full\n"),
            (
                Finding::unchecked("fuel", "no sample").may_be_unchecked(),
                "warn  fuel     not checked: no sample\n               → look at it yourself\n",
            ),
            (battery().may_be_unchecked(), &lines(&battery(), "battery", 9, 80)),
        ];
        for (finding, expected) in cases {
            assert_eq!(lines(&finding, finding.id, 9, 80), expected);
        }
        assert_eq!(
            lines(&Finding::note("a", "one two"), "a", 2, 12),
            "ok    a one\n        two\n"
        );
    }

    #[test]
    fn a_finding_of_a_plan_has_its_metres_where_it_has_some() {
        for (amount_m, expected) in [
            (0.0, "fence"),
            (0.02, "fence by 0.020 m"),
            (22.04, "fence by 22.0 m"),
            (6_585_496.4, "fence by 6585 km"),
        ] {
            let finding = Finding::new(Severity::Error, "fence", "text").by_m(amount_m);
            let shown = of_plan(&finding, 8, 80);
            assert!(shown.contains(&format!(": {expected}\n")), "{shown}");
        }
    }
}
