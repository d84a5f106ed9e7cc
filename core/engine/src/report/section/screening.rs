//! Screening of the inputs by the runs.

use maud::{Markup, html};

use crate::page::number::significant;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, paragraph};
use crate::report::findings::EnsembleFindings;
use crate::screening::{ActiveSubspace, Screening};

/// Largest number of inputs that a sentence names.
const MOST_NAMED: usize = 12;

/// Tables of the screening with the inputs without effect, and of the active subspace, as far as there are any.
pub fn part(ensemble: &EnsembleFindings, numbers: &mut Numbers) -> Markup {
    html! {
        (screened(ensemble, numbers))
        @if let Some(found) = &ensemble.active { (directions(found, ensemble, numbers)) }
    }
}

/// Largest number of eigenvalues that are listed.
const MOST_LISTED: usize = 10;

/// The eigenvalues of the active subspace, beside the inputs along which the response changes most.
fn directions(
    found: &ActiveSubspace,
    ensemble: &EnsembleFindings,
    numbers: &mut Numbers,
) -> Markup {
    let mut table =
        Table::new(&["direction"], &["eigenvalue", "lower", "upper", "share up to here"]);
    let total: f64 = found.eigenvalues.iter().sum();
    let mut sum = 0.0;
    let pairs = found.eigenvalues.iter().zip(&found.spread).enumerate();
    for (i, (value, (lower, upper))) in pairs.take(MOST_LISTED) {
        sum += value;
        let cells = [*value, *lower, *upper].map(|x| significant(x, 3));
        let name = (i + 1).to_string();
        table.row([name].into_iter().chain(cells).chain([significant(sum / total, 4)]));
    }
    let caption = Caption::new(
        "Directions of the inputs in which the response changes (active subspace), from the derivatives at the runs: \
         mean square slope along each, and the central 95 % of it over resampled runs.",
        "inputs in standard deviations of the design, and all outputs together in theirs over the runs.",
        "few directions with nearly the whole share: the response depends on as many combinations of the inputs.",
    );
    let mut order: Vec<usize> = (0..found.activity.len()).collect();
    order.sort_by(|&a, &b| found.activity[b].total_cmp(&found.activity[a]));
    let name = |&j: &usize| {
        let share = significant(found.activity[j] / total, 2);
        Some(format!("`{}` ({share})", ensemble.inputs.get(j)?.name))
    };
    let most: Vec<String> = order.iter().take(MOST_IN_SENTENCE).filter_map(name).collect();
    let sentence = format!(
        "{} of {} directions carry 99 % of the mean square slope; the largest shares along single inputs are those of {}.",
        found.directions(0.99),
        found.eigenvalues.len(),
        most.join(", ")
    );
    html! {
        p { (paragraph(&sentence)) }
        (numbers.table(&table, &caption))
    }
}

/// Largest number of inputs whose shares a sentence names.
const MOST_IN_SENTENCE: usize = 5;

fn screened(ensemble: &EnsembleFindings, numbers: &mut Numbers) -> Markup {
    let Some(found) = &ensemble.screening else { return html! {} };
    let names = ensemble.inputs.iter().map(|input| input.name.clone());
    let (table, caption) = match found {
        Screening::Dependence(all) => {
            let mut table = Table::new(&["input"], &["HSIC index", "p"]);
            for (name, d) in names.zip(all) {
                table.row([name, significant(d.index, 2), probability(d.p)]);
            }
            let caption = Caption::new(
                "Dependence of the response on each input, from the runs alone: normalised Hilbert-Schmidt \
                 independence criterion, and the probability of at least this dependence without an effect.",
                "inputs over the design, and all outputs together (of more than ten million values evenly spaced outputs).",
                "a large p: the runs show no effect of that input. Of the inputs without effect, one in twenty \
                 has a p below 0.05.",
            );
            (table, caption)
        }
        Screening::Effects(all) => {
            let mut table = Table::new(&["input"], &["mu*", "sigma", "effects"]);
            for (name, e) in names.zip(all) {
                let cells = [significant(e.mean_absolute, 3), significant(e.sd, 3)];
                table.row([name].into_iter().chain(cells).chain([e.count.to_string()]));
            }
            let caption = Caption::new(
                "Elementary effects of each input: change of the response over the range of the input, in standard \
                 deviations of the response over the runs; mean absolute effect (mu*) and standard deviation (sigma).",
                "inputs over the design, and all outputs together (of more than ten million values evenly spaced outputs).",
                "a mu* far below the others: the input hardly matters. A sigma as large as mu*: it acts \
                 nonlinearly or together with others.",
            );
            (table, caption)
        }
    };
    html! {
        @if let Some(sentence) = sentence(ensemble) { p { (paragraph(&sentence)) } }
        (numbers.table(&table, &caption))
    }
}

/// Smallest probability that is shown: the gamma approximation is not known to hold further out.
const LEAST_SHOWN: f64 = 1e-6;

fn probability(p: f64) -> String {
    if p < LEAST_SHOWN { "< 10⁻⁶".to_owned() } else { significant(p, 2) }
}

/// Names the inputs of which the runs show no effect; `None` if there is none.
pub fn sentence(ensemble: &EnsembleFindings) -> Option<String> {
    let found = ensemble.screening.as_ref()?;
    let acts = found.acts();
    let still: Vec<usize> = (0..acts.len()).filter(|&j| !acts[j]).collect();
    if still.is_empty() {
        return None;
    }
    let figure = |j: usize| match found {
        Screening::Dependence(all) => format!("p = {}", significant(all[j].p, 2)),
        Screening::Effects(all) => format!("mu* = {}", significant(all[j].mean_absolute, 2)),
    };
    let name = |&j: &usize| Some(format!("`{}` ({})", ensemble.inputs.get(j)?.name, figure(j)));
    let named: Vec<String> = still.iter().take(MOST_NAMED).filter_map(name).collect();
    let rest = still.len() - named.len();
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    Some(format!("The runs show no effect of {}{more}.", named.join(", ")))
}
