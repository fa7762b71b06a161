//! What a check found.

/// What follows from a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The plan is not flown.
    Forbids,
    /// The operator must know it.
    Warns,
    /// Something that the check needs is not known.
    NotChecked,
}

impl Severity {
    /// The name for people and programs.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Forbids => "forbids",
            Severity::Warns => "warns",
            Severity::NotChecked => "not-checked",
        }
    }
}

/// One finding. Equal ones about several items are one.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What follows.
    pub severity: Severity,
    /// The rule, in lower kebab case.
    pub rule: &'static str,
    /// The items concerned, in order; nothing when it is about the plan as a whole.
    pub items: Vec<u32>,
    /// The leg concerned, from 1: leg 1 leads to the first waypoint.
    pub leg: Option<u32>,
    /// By how much, metres.
    pub amount_m: Option<f64>,
    /// What is so, as a clause.
    pub text: String,
    /// What to do about it; empty when nothing need be done.
    pub remedy: String,
}

impl Finding {
    /// A finding about the plan as a whole.
    pub fn new(severity: Severity, rule: &'static str, text: impl Into<String>) -> Finding {
        Finding {
            severity,
            rule,
            items: Vec::new(),
            leg: None,
            amount_m: None,
            text: text.into(),
            remedy: String::new(),
        }
    }

    /// It forbids the flight.
    pub fn forbids(rule: &'static str, text: impl Into<String>) -> Finding {
        Finding::new(Severity::Forbids, rule, text)
    }

    /// It warns.
    pub fn warns(rule: &'static str, text: impl Into<String>) -> Finding {
        Finding::new(Severity::Warns, rule, text)
    }

    /// It was not checked.
    pub fn not_checked(rule: &'static str, text: impl Into<String>) -> Finding {
        Finding::new(Severity::NotChecked, rule, text)
    }

    /// About this item.
    #[must_use]
    pub fn item(mut self, number: u32) -> Finding {
        self.items.push(number);
        self
    }

    /// On this leg.
    #[must_use]
    pub fn leg(mut self, number: u32) -> Finding {
        self.leg = Some(number);
        self
    }

    /// By so many metres.
    #[must_use]
    pub fn by_m(mut self, amount_m: f64) -> Finding {
        self.amount_m = Some(amount_m);
        self
    }

    /// What to do.
    #[must_use]
    pub fn remedy(mut self, remedy: impl Into<String>) -> Finding {
        self.remedy = remedy.into();
        self
    }

    fn is_like(&self, other: &Finding) -> bool {
        let of = |finding: &Finding| (finding.severity, finding.rule, finding.leg);
        of(self) == of(other)
            && self.amount_m.is_none()
            && other.amount_m.is_none()
            && self.text == other.text
            && self.remedy == other.remedy
    }
}

/// Findings, of which those that say the same of several items are joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings(Vec<Finding>);

impl Findings {
    /// Adds a finding.
    pub fn push(&mut self, finding: Finding) {
        match self.0.iter_mut().find(|other| other.is_like(&finding)) {
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
        self.0.sort_by_key(|finding| finding.severity);
        self.0
    }

    /// Adds those of `other`.
    pub fn extend(&mut self, other: Findings) {
        other.0.into_iter().for_each(|finding| self.push(finding));
    }
}
