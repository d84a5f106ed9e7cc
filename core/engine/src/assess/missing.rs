//! Effects that a search found to be missing from the calibrated model.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "missing_effect";

/// Shifts of an estimate, in posterior standard deviations, from which on the message names it, and above which there is a failure: the
/// thresholds of the emulator's errors.
const SHIFT: (f64, f64) = (0.5, 1.0);

const ADD: &str = "use the study with the missing effect, which `lacuna gap STUDY` writes and runs";
const UNNAMED: &str = "list further candidates in `[[gap.candidate]]`, or take the gap into account by a discrepancy with a \
                       correlation: `[discrepancy] use = \"gaussian_process\"`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "after `lacuna gap STUDY`: the change of each estimate that the missing effects cause, in posterior sd"
            .to_owned(),
        threshold: format!(
            "an effect or a gap without a name: reservation; a change of more than {} sd: failure",
            SHIFT.1
        ),
        why: "the estimates of a model without an effect that acts compensate for it, and its predictions lack it; a 95 % \
              interval whose centre is shifted by 1 sd covers 83 %",
        action: ADD,
    }]
}

/// The change of an estimate when the missing effects are added.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimateChange {
    /// Name of the parameter.
    pub parameter: String,
    /// Change, in standard deviations of the posterior without the effects.
    pub shift: f64,
}

/// Finding about missing effects, given as a sentence, and the changes of the estimates that they cause; `is_added` is false
/// if no study with them is to be written: their cause has no name, or held-out data contradict it.
pub fn effect(sentence: &str, changes: &[EstimateChange], is_added: bool) -> Finding {
    let most = changes.iter().max_by(|a, b| a.shift.abs().total_cmp(&b.shift.abs()));
    let largest = most.map_or(0.0, |change| change.shift.abs());
    let consequence = match most {
        Some(change) if largest >= SHIFT.0 => format!(
            "adding it changes `{}` by {} posterior standard deviations",
            change.parameter,
            short(change.shift)
        ),
        _ if is_added => "the predictions of the model lack it".to_owned(),
        _ => "how far the estimates compensate for it is unknown".to_owned(),
    };
    let severity = if largest > SHIFT.1 { Severity::Failure } else { Severity::Reservation };
    let message = format!("{}: {consequence}", sentence.trim_end_matches('.'));
    let action = if is_added { ADD } else { UNNAMED };
    Finding::new((CODE, ""), (largest, SHIFT.1), severity, message, action)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(parameter: &str, shift: f64) -> EstimateChange {
        EstimateChange { parameter: parameter.to_owned(), shift }
    }

    #[test]
    fn the_parameter_that_an_effect_moves_most_decides() {
        let changes = [change("mass", 0.2), change("frequency", -92.5)];
        let found = effect("The model misses `cubic_stiffness`.", &changes, true);
        assert_eq!((found.severity, found.figure), (Severity::Failure, Some(92.5)));
        let expected = "The model misses `cubic_stiffness`: adding it changes `frequency` by -92.5 posterior standard deviations";
        assert_eq!(found.message, expected);
    }

    #[test]
    fn an_effect_that_moves_nothing_and_a_gap_without_a_name_are_reservations() {
        for (changes, is_added, words) in [
            (vec![change("mass", 0.2)], true, "the predictions of the model lack it"),
            (Vec::new(), false, "how far the estimates compensate for it is unknown"),
        ] {
            let found = effect("Something is missing.", &changes, is_added);
            assert_eq!(found.severity, Severity::Reservation);
            assert!(found.message.ends_with(words), "{}", found.message);
        }
    }
}
