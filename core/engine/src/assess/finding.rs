//! Findings of checks, and the verdict.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Severity of a finding.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Information; the result is valid.
    Note,
    /// The result is valid with this reservation.
    Reservation,
    /// The result is wrong, or cannot be shown to be right.
    Failure,
}

/// Level of trust in a result.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// No finding contradicts the result.
    Trusted,
    /// The result is valid with the reservations that are listed.
    TrustedWithReservations,
    /// At least one finding means that the result is wrong or cannot be shown to be right.
    NotTrusted,
}

impl Level {
    /// The verdict in words, in capitals if the result must not be used, so that it is readable without colour.
    pub fn words(self) -> &'static str {
        match self {
            Self::Trusted => "trusted",
            Self::TrustedWithReservations => "trusted with reservations",
            Self::NotTrusted => "NOT TRUSTED",
        }
    }
}

/// A finding for or against a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// Code of the check, such as `posterior_at_bound`; `docs/assessment.md` lists all of them.
    pub code: String,
    /// Parameter, sensor, run or stage that the finding is about; empty for the result as a whole.
    #[serde(rename = "where")]
    pub place: String,
    /// Figure that was found; `null` where it is not finite.
    pub figure: Option<f64>,
    /// Threshold beyond which the figure is a finding.
    pub threshold: f64,
    /// Severity of the finding.
    pub severity: Severity,
    /// Message: the observation, and why it matters.
    pub message: String,
    /// Remedy that would help most.
    pub action: String,
}

impl Finding {
    /// A finding from all its parts: code and place, figure and threshold, severity, message and action.
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

    /// Place and message in one sentence.
    pub fn sentence(&self) -> String {
        if self.place.is_empty() {
            self.message.clone()
        } else {
            format!("{}: {}", self.place, self.message)
        }
    }
}

/// The verdict on a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Assessment {
    /// Level of trust: that of the most severe finding.
    pub level: Level,
    /// Findings, the most severe first.
    pub findings: Vec<Finding>,
}

impl Default for Assessment {
    fn default() -> Self {
        Self::of(Vec::new())
    }
}

impl Assessment {
    /// The verdict on some findings.
    pub fn of(mut findings: Vec<Finding>) -> Self {
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        let level = match findings.first().map(|finding| finding.severity) {
            Some(Severity::Failure) => Level::NotTrusted,
            Some(Severity::Reservation) => Level::TrustedWithReservations,
            Some(Severity::Note) | None => Level::Trusted,
        };
        Self { level, findings }
    }

    /// The verdict with further findings.
    pub fn with(&self, further: impl IntoIterator<Item = Finding>) -> Self {
        Self::of(self.findings.iter().cloned().chain(further).collect())
    }

    /// Number of findings of a severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// Findings with a code.
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
