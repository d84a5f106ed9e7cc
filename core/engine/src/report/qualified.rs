//! Convergence and evidence in words, with their limits.

use super::findings::{CalibrationFindings, Findings};
use crate::assess::modes;

fn misses_modes(findings: &Findings) -> bool {
    findings.assessment.of_code(modes::CODE).next().is_some()
}

/// Reason why the run did or did not converge. If a mode has no draws, convergence is stated for the visited modes
/// only.
pub fn convergence(findings: &Findings, calibration: &CalibrationFindings) -> String {
    let verdict = &calibration.verdict;
    if !misses_modes(findings) || !calibration.converged {
        return verdict.clone();
    }
    let limit = "converged on the modes that the chains visit, and a further mode has no draw";
    match verdict.as_str() {
        "" | "converged" => limit.to_owned(),
        more => format!("{limit}; {more}"),
    }
}

/// Reason why the evidence covers a part of the posterior only; `None` if it covers all of it.
pub fn evidence(findings: &Findings) -> Option<&'static str> {
    let limit =
        "of the visited modes only: a further mode has no draw, so that this is a lower bound";
    misses_modes(findings).then_some(limit)
}
