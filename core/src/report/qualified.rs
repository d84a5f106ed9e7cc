//! Convergence and evidence in words, with what limits them.

use super::findings::{CalibrationFindings, Findings};
use crate::assess::modes;

fn misses_modes(findings: &Findings) -> bool {
    findings.assessment.of_code(modes::CODE).next().is_some()
}

/// Why the run did or did not converge; where a mode has no draws, converged means on the modes that have some.
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

/// Why the evidence is that of a part of the posterior.
pub fn evidence(findings: &Findings) -> Option<&'static str> {
    let limit =
        "of the visited modes only: a further mode has no draw, so that this is a lower bound";
    misses_modes(findings).then_some(limit)
}
