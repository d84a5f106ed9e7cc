//! Modes of the posterior without draws.

use super::words::{count, short};
use super::{Finding, Rule, Severity};

/// The code of the only finding here, which qualifies what is said of convergence and evidence.
pub const CODE: &str = "unvisited_mode";
const UNREACHED: &str = "map_not_found";

/// How far below the best a mode may be to count.
const BELOW: f64 = 10.0;
/// A mode this close to the best may hold as much of the posterior.
const CLOSE: f64 = 3.0;
/// How far above the optimised maximum a draw may be.
const ABOVE: f64 = 1.0;

const START: &str = "use a sampler that finds all modes (`lacuna plugins sampler` tells which), or start the chains from \
                     the prior: `[sampler] start = \"prior\"`";
const SEARCH: &str = "look at the traces: the density has a ridge or several modes; draw more";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![
        Rule {
            code: CODE,
            looks_at: format!(
                "local maxima of the posterior density within {BELOW} of the best log density that have no \
                 draw nearer to them than to another maximum"
            ),
            threshold: format!("within {CLOSE}: failure; else reservation"),
            why: "draws that never saw a mode say nothing of its share; chains that agree on one mode are \
                  converged there and nowhere else, and the evidence counts the visited modes only",
            action: START,
        },
        Rule {
            code: UNREACHED,
            looks_at: "the largest log density of a draw above that of the optimised MAP"
                .to_owned(),
            threshold: format!("{ABOVE}: reservation"),
            why: "the MAP is not the maximum: its figures and the starts of the chains are another point's",
            action: SEARCH,
        },
    ]
}

/// Modes without draws: how far each is below the best log density; `modes` is the number of all.
pub fn unvisited(below: &[f64], modes: usize) -> Option<Finding> {
    let nearest = below.iter().copied().filter(|b| *b < BELOW).fold(f64::INFINITY, f64::min);
    if !nearest.is_finite() {
        return None;
    }
    let severity = if nearest < CLOSE { Severity::Failure } else { Severity::Reservation };
    let highest = if nearest > 0.0 {
        format!("the highest is {} below the best in log density", short(nearest))
    } else {
        String::from("the best of all is one of them")
    };
    let message = format!(
        "{} of {} of the posterior density {} no draw; {highest}: its share of the posterior is unknown, and all \
         intervals leave it out",
        below.len(),
        count(modes, "local maximum").replace("maximums", "maxima"),
        if below.len() == 1 { "has" } else { "have" }
    );
    Some(Finding::new((CODE, ""), (nearest, BELOW), severity, message, START))
}

/// The log density of the best draw above that of the MAP.
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
