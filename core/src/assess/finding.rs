//! What a check found, and the verdict.

use serde::{Deserialize, Serialize};

/// How much a finding takes away from a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Worth knowing; the result stands.
    Note,
    /// The result stands with this in mind.
    Reservation,
    /// The result is wrong, or nobody can know that it is right.
    Failure,
}

/// Whether a result can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// No finding speaks against it.
    Trusted,
    /// It stands with the reservations that are listed.
    TrustedWithReservations,
    /// At least one finding means that it is wrong, or that nobody can know that it is right.
    NotTrusted,
}

impl Level {
    /// The level in words, in capitals where the result must not be used: readable without colour.
    pub fn words(self) -> &'static str {
        match self {
            Self::Trusted => "trusted",
            Self::TrustedWithReservations => "trusted with reservations",
            Self::NotTrusted => "NOT TRUSTED",
        }
    }
}

/// One thing that speaks for or against a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What was looked at, such as `posterior_at_bound`.
    pub code: String,
    /// The parameter, sensor, run or stage that it is about.
    #[serde(rename = "where")]
    pub place: String,
    /// The number that was found; nothing where it is not finite.
    pub figure: Option<f64>,
    /// The number from which on this is a finding.
    pub threshold: f64,
    /// How much it takes away.
    pub severity: Severity,
    /// What was found and why it matters.
    pub message: String,
    /// What would help most.
    pub action: String,
}

impl Finding {
    /// A finding with all its parts: code and place, figure and threshold, severity, message and action.
    pub fn new(
        (code, place): (&str, &str),
        (figure, threshold): (f64, f64),
        severity: Severity,
        message: String,
        action: &str,
    ) -> Self {
        Self {
            code: code.to_owned(),
            place: place.to_owned(),
            figure: figure.is_finite().then_some(figure),
            threshold,
            severity,
            message,
            action: action.to_owned(),
        }
    }

    /// What it is about and what was found, in one sentence.
    pub fn sentence(&self) -> String {
        if self.place.is_empty() {
            self.message.clone()
        } else {
            format!("{}: {}", self.place, self.message)
        }
    }
}

/// The verdict on a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Assessment {
    /// The worst of the findings decides.
    pub level: Level,
    /// What was found, the worst first.
    pub findings: Vec<Finding>,
}

impl Default for Assessment {
    fn default() -> Self {
        Self::of(Vec::new())
    }
}

impl Assessment {
    /// The verdict over some findings.
    pub fn of(mut findings: Vec<Finding>) -> Self {
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        let level = match findings.first().map(|finding| finding.severity) {
            Some(Severity::Failure) => Level::NotTrusted,
            Some(Severity::Reservation) => Level::TrustedWithReservations,
            Some(Severity::Note) | None => Level::Trusted,
        };
        Self { level, findings }
    }

    /// How many findings are of a severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// The findings with a code.
    pub fn of_code<'a>(&'a self, code: &'a str) -> impl Iterator<Item = &'a Finding> {
        self.findings.iter().filter(move |finding| finding.code == code)
    }

    /// The verdict in one line.
    pub fn line(&self) -> String {
        let failures = self.count(Severity::Failure);
        let reservations = self.count(Severity::Reservation);
        let count = |number: usize, what: &str| match number {
            1 => format!("1 {what}"),
            _ => format!("{number} {what}s"),
        };
        let words = self.level.words();
        match (failures, reservations) {
            (0, 0) => words.to_owned(),
            (0, some) => format!("{words}: {}", count(some, "reservation")),
            (some, 0) => format!("{words}: {}", count(some, "reason")),
            (some, further) => {
                format!("{words}: {}, {}", count(some, "reason"), count(further, "reservation"))
            }
        }
    }
}
