//! The simulation runs.

use maud::html;

use super::{first_of, screening, titled};
use crate::page::chart::{DesignColumn, Key, MOST_CROSSED, design_matrix};
use crate::page::number::count;
use crate::page::scale::ShownUnit;
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{EnsembleFindings, Findings, RunInput};

/// Largest number of failed runs that are listed; further ones are only counted.
const MOST_LISTED: usize = 20;

/// The runs; `None` if there are none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let ensemble = findings.ensemble.as_ref()?;
    let runs = ensemble.points.rows();
    let invalid = ensemble.valid.iter().filter(|valid| !**valid).count();
    let content = html! {
        p {
            b { (count(runs)) } " simulation runs have a response; "
            (count(ensemble.in_prior)) " of them lie inside the prior's support, "
            (count(invalid)) " outside the model's range of validity. "
            (count(ensemble.failed.len())) " runs were left out."
        }
        @if runs > 0 { (figure(findings, ensemble, numbers)) }
        (screening::part(ensemble, numbers))
        @if !ensemble.failed.is_empty() { (failures(ensemble, numbers)) }
    };
    Some(Section { id: "ensemble", title: "Simulation ensemble", content })
}

fn figure(findings: &Findings, ensemble: &EnsembleFindings, numbers: &mut Numbers) -> maud::Markup {
    let column = |input: &RunInput| column(findings, ensemble, input);
    let columns: Vec<DesignColumn> = ensemble.inputs.iter().filter_map(column).collect();
    let is_valid = |i: &usize| ensemble.valid.get(*i).copied().unwrap_or(true);
    let (valid, invalid): (Vec<usize>, Vec<usize>) =
        (0..ensemble.points.rows()).partition(|i| is_valid(i));
    let outside = invalid.len();
    let mut keys =
        vec![Key::dot("s-run", "run"), Key::area("s-box", "central 99.8 % of the prior")];
    if !invalid.is_empty() {
        keys.insert(1, Key::dot("s-invalid", "run outside the model's range of validity"));
    }
    let drawing = design_matrix(
        &columns,
        &vec![("s-run", valid), ("s-invalid", invalid)],
        &format!(
            "scatter plots of the design, one for each pair of parameters: {} runs, {} of them outside the model's range of \
             validity",
            count(ensemble.points.rows()),
            count(outside)
        ),
    );
    let caption = Caption::new(
        format!(
            "The design: every run in each pair of parameters, with histograms on the diagonal.{}",
            first_of(columns.len(), MOST_CROSSED)
        ),
        "the design's points are where the simulator was run and stand for no belief; the box holds \
         the central 99.8 % of the prior.",
        "runs inside the prior's box, for only there the surrogate's training bears on the posterior; \
         a box with few runs wants a second design.",
    );
    numbers.figure("design", &[drawing], &keys, &caption)
}

fn column(
    findings: &Findings,
    ensemble: &EnsembleFindings,
    input: &RunInput,
) -> Option<DesignColumn> {
    let j = *input.places.first()?;
    let parameter = &findings.parameters[j];
    let values = ensemble.points.column(j);
    let unit = ShownUnit::for_values(&parameter.unit, values.iter().copied());
    let box_ = (parameter.prior.quantile(0.001), parameter.prior.quantile(0.999));
    let logarithmic = matches!(parameter.design.name(), "log_uniform" | "log_normal");
    Some(DesignColumn {
        logarithmic,
        label: unit.label(&titled(&input.name, &input.symbol)),
        values: values.iter().map(|&v| unit.show(v)).collect(),
        prior: (box_.0.is_finite() && box_.1.is_finite())
            .then(|| (unit.show(box_.0), unit.show(box_.1))),
    })
}

fn failures(ensemble: &EnsembleFindings, numbers: &mut Numbers) -> maud::Markup {
    let mut table = Table::new(&["run", "why it was left out"], &[]);
    for failed in ensemble.failed.iter().take(MOST_LISTED) {
        table.row([failed.run.clone(), failed.reason.clone()]);
    }
    let rest = ensemble.failed.len().saturating_sub(MOST_LISTED);
    if rest > 0 {
        table.emphasised([String::from("…"), format!("and {} more", count(rest))]);
    }
    let caption = Caption::new(
        "Runs without a usable response.",
        "",
        "one reason for many runs, or failures in one corner of the design: the surrogate has not \
         seen that corner.",
    );
    numbers.table(&table, &caption)
}
