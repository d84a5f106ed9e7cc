//! Modes of the posterior without draws.

use super::words::{count, short};
use super::{Finding, Rule, Severity};

/// Code of the only finding here, which qualifies statements on convergence and evidence.
pub const CODE: &str = "unvisited_mode";
const UNREACHED: &str = "map_not_found";

/// Distance below the best log density up to which a mode counts.
const BELOW: f64 = 10.0;
/// Distance below the best log density within which a mode may contain as much of the posterior.
const CLOSE: f64 = 3.0;
/// Excess of a draw's log density over that of the optimised maximum that gives a finding.
const ABOVE: f64 = 1.0;

const START: &str = "use a sampler that finds all modes (see `lacuna plugins sampler`), or start the chains from \
                     the prior: `[sampler] start = \"prior\"`";
const SEARCH: &str = "inspect the traces: the density has a ridge or several modes; run more steps";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: CODE,
            looks_at: format!(
                "local maxima of the posterior density within {BELOW} of the best log density that have no \
                 draw nearer to them than to another maximum"
            ),
            threshold: format!("within {CLOSE}: failure; otherwise reservation"),
            why: "the probability of a mode without draws is unknown; chains that agree on one mode have converged \
                  only there, and the evidence includes the visited modes only",
            action: START,
        },
        Rule {
            code: UNREACHED,
            looks_at: "excess of the largest log density of a draw over that of the optimised MAP"
                .to_owned(),
            threshold: format!("{ABOVE}: reservation"),
            why: "the MAP is not the maximum: values at the MAP and the starting points of the chains belong to \
                  another point",
            action: SEARCH,
        },
    ]
}

/// Finding about modes without draws: `below` holds the distance of each below the best log density, `modes` is the
/// number of all modes.
pub fn unvisited(below: &[f64], modes: usize) -> Option<Finding> {
    let nearest = below.iter().copied().filter(|b| *b < BELOW).fold(f64::INFINITY, f64::min);
    if !nearest.is_finite() {
        return None;
    }
    let severity = if nearest < CLOSE { Severity::Failure } else { Severity::Reservation };
    let highest = if nearest > 0.0 {
        format!("the highest is {} below the best in log density", short(nearest))
    } else {
        String::from("the global maximum is one of them")
    };
    let message = format!(
        "{} of {} of the posterior density {} no draw nearby; {highest}: its posterior probability is unknown, and \
         all intervals omit it",
        below.len(),
        count(modes, "local maximum").replace("maximums", "maxima"),
        if below.len() == 1 { "has" } else { "have" }
    );
    Some(Finding::new((CODE, ""), (nearest, BELOW), severity, message, START))
}

/// Finding about the excess of the log density of the best draw over that of the MAP.
pub fn unreached(above: f64) -> Option<Finding> {
    (above > ABOVE).then(|| {
        let message = format!(
            "the best draw has a log density {} above that of the MAP: the optimiser did not find the maximum",
            short(above)
        );
        let figures = (above, ABOVE);
        Finding::new((UNREACHED, "map"), figures, Severity::Reservation, message, SEARCH)
    })
}
