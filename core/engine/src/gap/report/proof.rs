//! The proof of the names, and the members of a class: sentences and tables.

use maud::Markup;

use crate::gap::experiment::hold_out::HeldOutKind;
use crate::gap::report::sentences::{capitalised, probability};
use crate::gap::result::names::{NameProof, ProofKind, RivalComparison};
use crate::gap::result::{GapFindings, names};
use crate::gap::search::LeftOut;
use crate::page::number::{fixed, significant, typeset};
use crate::page::scale::ShownUnit;
use crate::page::table::Table;
use crate::page::{Caption, Numbers};

/// The limit of a proof by replicates alone.
pub const LIMIT: &str =
    "replicates share the mean curve, so this does not show that the effect holds elsewhere";

/// The limit of a proof by blocks of one record; `docs/gap_rates.md` counts how often false names pass it.
const SIMILAR: &str =
    " Blocks of one record do not tell similar forms apart: another condition would.";

/// The outcome of the proof in words; empty without effects.
pub fn sentences(gap: &GapFindings) -> Vec<String> {
    let Some(proof) = gap.proof() else { return Vec::new() };
    let mut sentences = vec![outcome(gap, &proof)];
    if gap.added.is_some()
        && let Some(reason) = names::contradiction(gap.held_out())
    {
        sentences.push(format!(
            "Take the effects out of the study again: {reason}, with the study that was written."
        ));
    }
    sentences
}

fn outcome(gap: &GapFindings, proof: &NameProof) -> String {
    let failed: Vec<&RivalComparison> = proof.rivals.iter().filter(|rival| !rival.passed).collect();
    let against = names::contradiction(gap.held_out());
    match (proof.kind, proof.passed) {
        (ProofKind::Transfer, true) => format!(
            "Proof passed: the name transfers. On left-out data it predicts better than its rival, {}: {}.{}",
            rival(gap),
            listed(&proof.rivals.iter().collect::<Vec<_>>()),
            if is_of_one_record(gap, proof) { SIMILAR } else { "" }
        ),
        (ProofKind::Reproducible, true) => {
            format!("Reproducible: the gap closes on data that were not used; {LIMIT}.")
        }
        (ProofKind::Transfer, false) if !failed.is_empty() => format!(
            "Proof failed: the name does not transfer. On left-out data it does not predict clearly better than its rival, {}: {}.",
            rival(gap),
            listed(&failed)
        ),
        (ProofKind::Reproducible, false) if !failed.is_empty() => format!(
            "Proof failed: on left-out replicates the effect does not predict clearly better than its rival, {}: {}.",
            rival(gap),
            listed(&failed)
        ),
        (_, false) if against.is_some() => {
            format!("Proof failed: {}.", against.unwrap_or_default())
        }
        (_, false) if proof.rivals.is_empty() => {
            "Not proven: no data could be left out.".to_owned()
        }
        (_, false) => "Not proven: there is no sure name.".to_owned(),
    }
}

/// True if nothing but parts of the curves was left out or held out.
fn is_of_one_record(gap: &GapFindings, proof: &NameProof) -> bool {
    let elsewhere = [HeldOutKind::Scenarios, HeldOutKind::Curves, HeldOutKind::Replicates];
    let is_held_out = gap.held_out().iter().any(|part| elsewhere.contains(&part.kind));
    !is_held_out && proof.rivals.iter().all(|rival| rival.score.left_out == LeftOut::Block)
}

fn rival(gap: &GapFindings) -> &'static str {
    if gap.result.additions.first().is_some_and(|first| first.model) {
        "the study's model with its effects"
    } else {
        "a free form in its place"
    }
}

/// The comparisons in words: `damping` by sensor +12.3 ± 3.1.
fn listed(rivals: &[&RivalComparison]) -> String {
    let one = |rival: &&RivalComparison| {
        let score = &rival.score;
        let error = score.error.map_or_else(String::new, |e| format!(" ± {}", fixed(e, 1)));
        format!(
            "`{}` by {} {}{error}",
            rival.effect,
            score.left_out.words(),
            signed(score.difference)
        )
    };
    rivals.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn signed(x: f64) -> String {
    if x > 0.0 { format!("+{}", fixed(x, 1)) } else { typeset(&fixed(x, 1)) }
}

/// The comparisons of the effects with their rivals.
pub fn table(gap: &GapFindings, proof: &NameProof, numbers: &mut Numbers) -> Markup {
    let columns = ["parts", "difference", "standard error", "passed"];
    let mut table = Table::new(&["effect", "left out in turn"], &columns);
    for rival in &proof.rivals {
        let score = &rival.score;
        table.row([
            format!("`{}`", rival.effect),
            score.left_out.words().to_owned(),
            score.parts.to_string(),
            signed(score.difference),
            score.error.map_or_else(String::new, |e| fixed(e, 1)),
            if rival.passed { "yes" } else { "no" }.to_owned(),
        ]);
    }
    let kind = match proof.kind {
        ProofKind::Transfer => {
            "A wrong name describes what it was found from, and fails here.".to_owned()
        }
        ProofKind::Reproducible => format!("Only replicates could be left out: {LIMIT}."),
    };
    let caption = Caption::new(
        format!(
            "Proof of the name: log predictive density of left-out data with the effect, less that with its rival, {}. Both \
             are calibrated to the rest. {kind}",
            rival(gap)
        ),
        "standard errors pair the replicates, or the parts.",
        "differences below 2.5 standard errors: then the name is not proven, unless each of at least four parts of a record \
         without replicates favours the effect by more than 20 to 1.",
    );
    numbers.table(&table, &caption)
}

/// The members of a class with their weights, one sentence.
pub fn members(gap: &GapFindings) -> Option<String> {
    let all = &gap.result.members;
    let each = all.iter().map(|m| format!("`{}` {}", m.kinds.join(" + "), probability(m.weight)));
    let each: Vec<String> = each.collect();
    let averaged = gap.added.as_ref().is_some_and(|added| !added.averaged.is_empty());
    let more = if averaged {
        "; the study of each was run, and the parameters are averaged with these weights"
    } else {
        ""
    };
    (!all.is_empty())
        .then(|| format!("Members of the class by probability: {}{more}.", each.join(", ")))
}

/// The parameters in the study of each member, and averaged over them; `None` if they were not run.
pub fn averages(gap: &GapFindings, numbers: &mut Numbers) -> Option<Markup> {
    let added = gap.added.as_ref().filter(|added| !added.averaged.is_empty())?;
    let heads: Vec<String> = added
        .members
        .iter()
        .map(|m| format!("{} ({})", m.kinds.join(" + "), fixed(m.weight, 2)))
        .collect();
    let columns: Vec<&str> =
        heads.iter().map(String::as_str).chain(["averaged", "95 % interval"]).collect();
    let mut table = Table::new(&["parameter"], &columns);
    for average in &added.averaged {
        let unit = ShownUnit::for_values(&average.unit, [average.mean, average.q975]);
        let show = |x: f64, digits: usize| significant(unit.show(x), digits);
        let pair = |mean: f64, sd: f64| format!("{} ± {}", show(mean, 4), show(sd, 2));
        let own = added.members.iter().map(|member| {
            let found = member.unknowns.iter().find(|u| u.name == average.name);
            found.map_or_else(|| "–".to_owned(), |u| pair(u.mean, u.sd))
        });
        let mut cells = vec![unit.label(&average.name)];
        cells.extend(own);
        cells.push(pair(average.mean, average.sd));
        cells.push(format!("{} to {}", show(average.q025, 4), show(average.q975, 4)));
        table.row(cells);
    }
    let caption = Caption::new(
        "The parameters in the study of each member of the class, with its probability, and averaged over the members: the \
         mixture of their posteriors. Predictions averaged in the same way are in `averaged.csv` in the folder of the search.",
        "posterior given the class: other physics is not in it.",
        "members that disagree by more than their standard deviations: then the average has two humps.",
    );
    Some(numbers.table(&table, &caption))
}

/// The warning about the parameters as a sentence.
pub fn warning(gap: &GapFindings) -> Option<String> {
    gap.result.warning().map(|text| format!("{}.", capitalised(text)))
}
