//! What the checks of a plan found: an error forbids the flight, a warning must be known to the operator.

use runtime::finding::{Finding, Severity};

/// What follows from a finding, for programs.
pub fn effect(finding: &Finding) -> &'static str {
    match (finding.is_checked, finding.severity) {
        (false, _) => "not-checked",
        (true, Severity::Error) => "forbids",
        (true, _) => "warns",
    }
}

/// Sorts findings: those that forbid the flight, those that warn, what was not checked; otherwise the order stays.
pub fn sort(findings: &mut [Finding]) {
    findings.sort_by_key(|finding| (!finding.is_checked, std::cmp::Reverse(finding.severity)));
}

fn is_like(one: &Finding, other: &Finding) -> bool {
    let alike = |finding: &Finding| Finding {
        items: Vec::new(),
        ..finding.clone()
    };
    one.amount_m.is_none() && one.text == other.text && alike(one) == alike(other)
}

/// Findings, of which those that say the same of several items are joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings(Vec<Finding>);

impl Findings {
    /// Adds a finding.
    pub fn push(&mut self, finding: Finding) {
        match self.0.iter_mut().find(|other| is_like(other, &finding)) {
            Some(other) => other.items.extend(
                finding
                    .items
                    .into_iter()
                    .filter(|item| other.items.last() != Some(item))
                    .collect::<Vec<_>>(),
            ),
            None => self.0.push(finding),
        }
    }

    /// All of them, the most severe first, otherwise in the order in which they were found.
    pub fn sorted(mut self) -> Vec<Finding> {
        sort(&mut self.0);
        self.0
    }

    /// Adds those of `other`.
    pub fn extend(&mut self, other: Findings) {
        other.0.into_iter().for_each(|finding| self.push(finding));
    }
}
