//! Screening of the inputs by the runs.

use maud::{Markup, html};

use crate::page::number::significant;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, paragraph};
use crate::report::findings::EnsembleFindings;
use crate::screening::Screening;

/// Largest number of inputs that a sentence names.
const MOST_NAMED: usize = 12;

/// Table of the screening and the inputs without effect; nothing if the runs were not screened.
pub fn part(ensemble: &EnsembleFindings, numbers: &mut Numbers) -> Markup {
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
                "inputs over the design, and all outputs together.",
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
                "inputs over the design, and all outputs together.",
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
