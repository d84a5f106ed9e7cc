//! Complaints of a plugin about its options.

use std::ops::Range;

use lacuna::text::{Complaints, Problem, Problems};
use serde::{Deserialize, Serialize};

/// One complaint; its place is a path in the plugin's own section.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Complaint {
    /// Dotted path of the key; empty for the whole section.
    pub at: String,
    /// Byte range of the fault within a string value; `None` for the whole value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<Range<usize>>,
    /// The fault.
    pub message: String,
    /// The expected value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// The value that was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<String>,
    /// The remedy.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub help: Vec<String>,
}

impl Complaint {
    /// All complaints that were collected about a section.
    pub fn all(problems: &Problems) -> Vec<Self> {
        problems.sorted().into_iter().map(Self::of).collect()
    }

    fn of(problem: &Problem) -> Self {
        Self {
            at: problem.path.clone(),
            part: problem.part.clone(),
            message: problem.message.clone(),
            expected: problem.expected.clone(),
            found: problem.found.clone(),
            help: problem.help.clone(),
        }
    }

    /// The complaints in an answer: a JSON list, or plain text.
    pub fn read(text: &str) -> Vec<Self> {
        serde_json::from_str(text)
            .unwrap_or_else(|_| vec![Self { message: text.trim().to_owned(), ..Self::default() }])
    }

    /// Complains at the place in the study.
    pub fn report(self, complaints: &mut Complaints<'_>) {
        let problem = complaints.at(&self.at).say(self.message);
        problem.part = self.part;
        problem.expected = self.expected;
        problem.found = self.found;
        problem.help = self.help;
    }
}
