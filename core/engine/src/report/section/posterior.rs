//! The posterior: summary table, correlation, marginals, pairs.

use lacuna_linalg::Matrix;
use maud::{Markup, html};

use super::sampling::{kept_draws, marks};
use super::{coordinate_unit, first_of, response_unit, titled};
use crate::page::chart::{
    Curve, Key, MOST_PAIRED, Marginal, Mark, PairColumn, Row, SecondAxis, correlation_map,
    marginals, pair_matrix, row_chart,
};
use crate::page::curve::named_density;
use crate::page::number::{decimals, fixed, percent, rounded, significant, typeset};
use crate::page::scale::{extent, printed};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{CalibrationFindings, CoordinateFindings, Findings, Role};

/// The posterior; `None` without a calibration.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let calibration = findings.calibration.as_ref()?;
    let several = calibration.coordinates.len() > 1;
    let content = html! {
        (summary(calibration, numbers))
        @if several { (correlation(calibration, numbers)) }
        @if !calibration.draws.is_empty() {
            (parameter_marginals(findings, calibration, numbers))
            (narrowing(calibration, numbers))
            (hyperparameter_marginals(findings, calibration, numbers))
            (derived_marginals(findings, calibration, numbers))
            @if several { (pairs(calibration, numbers)) }
        }
        (fits(calibration, numbers))
    };
    Some(Section { id: "posterior", title: "Posterior", content })
}

/// Summary of all coordinates, with as many digits as the Monte Carlo error allows.
pub fn posterior_table(calibration: &CalibrationFindings) -> Table {
    let heads =
        ["mean", "sd", "2.5 %", "median", "97.5 %", "MAP", "R-hat", "ESS bulk", "ESS tail", "MCSE"];
    let mut table = Table::new(&["parameter", "unit"], &heads);
    for c in &calibration.coordinates {
        let unit = coordinate_unit(c);
        let places = decimals(unit.show(c.mcse_mean), unit.show(c.sd));
        let number = |value: f64| fixed(unit.show(value), places);
        let shown = unit.unit.clone();
        let mut cells = vec![c.name.clone(), shown];
        cells.extend([c.mean, c.sd, c.q025, c.median, c.q975, c.map].map(number));
        cells.extend([fixed(c.r_hat, 3), fixed(c.ess_bulk, 0), fixed(c.ess_tail, 0)]);
        cells.push(significant(unit.show(c.mcse_mean), 2));
        table.row(cells);
    }
    table
}

fn summary(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let caption = Caption::new(
        "Posterior of the parameters, of the hyperparameters and of derived quantities. Mean, sd and quantiles are those of \
         the draws after the burn-in; the MAP is the optimised maximum of the density. Numbers end \
         at the first digit of the Monte Carlo standard error (MCSE) of the mean.",
        "posterior, given this model and this discrepancy: doubt about the form of either is not in it.",
        "R-hat above 1.1 for the walkers of an ensemble or 1.01 for independent chains, effective sample sizes (ESS) below some hundreds.",
    );
    numbers.table(&posterior_table(calibration), &caption)
}

fn correlation(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let names: Vec<String> = calibration.coordinates.iter().map(|c| c.name.clone()).collect();
    let drawing = correlation_map(&names, &calibration.correlation, "posterior correlation matrix");
    let caption = Caption::new(
        "Correlation of the coordinates; blue is positive, red negative.",
        "the posterior.",
        "numbers near ±1: the data fix a combination of the two and not each of them.",
    );
    numbers.figure("correlation", &[drawing], &[], &caption)
}

/// Largest number of coordinates of one role that are shown in histograms.
const MOST_SHOWN: usize = 16;

fn parameter_marginals(
    findings: &Findings,
    calibration: &CalibrationFindings,
    numbers: &mut Numbers,
) -> Markup {
    let all = findings.parameters.len().min(calibration.coordinates.len());
    let shown = 0..all.min(MOST_SHOWN);
    let panels: Vec<Marginal> = shown.map(|i| marginal(findings, calibration, i)).collect();
    let mut keys = marginal_keys().to_vec();
    if calibration.coordinates[..all].iter().any(|c| c.reference.is_some()) {
        keys.push(Key::line("m-reference", "reference"));
    }
    let caption = Caption::new(
        format!(
            "Marginals of the parameters, scaled to area one. An arrow at the edge points to a mark \
             beyond the axis.{}",
            first_of(all, MOST_SHOWN)
        ),
        "histogram and fitted curve the posterior, grey dots the prior.",
        "a histogram cut off at the prior's bound; a posterior as wide as the prior, which means that \
         the data said nothing; a reference in the tail.",
    );
    let drawings = marginals(&panels, "marginal of a parameter");
    numbers.figure("marginals", &drawings, &keys, &caption)
}

fn hyperparameter_marginals(
    findings: &Findings,
    calibration: &CalibrationFindings,
    numbers: &mut Numbers,
) -> Markup {
    let first = findings.parameters.len().min(calibration.coordinates.len());
    let all = count_of(calibration, Role::Hyperparameter);
    if all == 0 {
        return html! {};
    }
    let shown = first..first + all.min(MOST_SHOWN);
    let panels: Vec<Marginal> = shown.map(|i| marginal(findings, calibration, i)).collect();
    let second = if panels.iter().any(|m| m.second.is_some()) {
        " Where there is an upper axis, the lower one is the variance and the upper one its square \
         root, the standard deviation in the response's unit; the density is that of the variance."
    } else {
        ""
    };
    let caption = Caption::new(
        format!(
            "Marginals of the hyperparameters, scaled to area one.{second}{}",
            first_of(all, MOST_SHOWN)
        ),
        "histogram and fitted curve the posterior, grey dots the prior. A discrepancy's standard \
         deviation is that of single data around the model, not an uncertainty of the parameters.",
        "a standard deviation far above the spread of the replicates: the model misses something.",
    );
    let drawings = marginals(&panels, "marginal of a hyperparameter");
    numbers.figure("hyperparameter-marginals", &drawings, &marginal_keys(), &caption)
}

/// Number of coordinates with this role.
fn count_of(calibration: &CalibrationFindings, role: Role) -> usize {
    calibration.coordinates.iter().filter(|c| c.role == role).count()
}

fn derived_marginals(
    findings: &Findings,
    calibration: &CalibrationFindings,
    numbers: &mut Numbers,
) -> Markup {
    let all = count_of(calibration, Role::Derived);
    if all == 0 {
        return html! {};
    }
    let first = calibration.coordinates.len() - all;
    let shown = first..first + all.min(MOST_SHOWN);
    let panels: Vec<Marginal> = shown.map(|i| marginal(findings, calibration, i)).collect();
    let caption = Caption::new(
        format!(
            "Marginals of the derived quantities, scaled to area one: each draw of the parameters gives one \
             value.{}",
            first_of(all, MOST_SHOWN)
        ),
        "histogram and fitted curve the posterior. The MAP is the value at the MAP of the parameters, not the \
         peak of this histogram.",
        "quantities that are far better known than the parameters of which they are made.",
    );
    let [draws, fit, _, map] = marginal_keys();
    let drawings = marginals(&panels, "marginal of a derived quantity");
    numbers.figure("derived-marginals", &drawings, &[draws, fit, map], &caption)
}

/// Width of the posterior against that of the prior.
fn narrowing(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let ratio = |c: &CoordinateFindings| {
        let prior = c.prior.as_ref()?;
        let width = prior.quantile(0.975) - prior.quantile(0.025);
        let ratio = (c.q975 - c.q025) / width;
        (ratio.is_finite() && width > 0.0).then_some(ratio)
    };
    let row = |c: &CoordinateFindings| {
        let (unit, share) = (coordinate_unit(c), ratio(c)?);
        let number = |v: f64| typeset(&significant(unit.show(v), 3));
        let interval = unit.join(&format!("{} to {}", number(c.q025), number(c.q975)));
        let text = format!("{} · {interval}", percent(share));
        Some(Row { name: titled(&c.name, &c.symbol), value: share, text })
    };
    let rows: Vec<Row> =
        calibration.coordinates.iter().filter_map(row).take(2 * MOST_SHOWN).collect();
    if rows.is_empty() {
        return html! {};
    }
    let all = calibration.coordinates.iter().filter(|c| ratio(c).is_some()).count();
    let caption = Caption::new(
        format!(
            "Prior against posterior: the width of the posterior's central 95 % as a share of that of the prior, with its ends.{}",
            first_of(all, 2 * MOST_SHOWN)
        ),
        "posterior over prior, each unknown by itself.",
        "shares near 100 %: the data say nothing about that unknown by itself. Above: data and prior contradict each other.",
    );
    let drawing = row_chart(&rows, "bar s-part", "posterior width as a share of the prior's");
    numbers.figure("prior-and-posterior", &[drawing], &[], &caption)
}

fn marginal_keys() -> [Key; 4] {
    [
        Key::area("s-histogram", "draws"),
        Key::line("s-fit", "best-fitting named distribution"),
        Key::line("s-prior", "prior"),
        Key::line("m-map", "MAP"),
    ]
}

fn marginal(findings: &Findings, calibration: &CalibrationFindings, i: usize) -> Marginal {
    let c = &calibration.coordinates[i];
    let unit = coordinate_unit(c);
    let draws = kept_draws(calibration, i, &unit);
    let natural = extent(draws.iter().map(|d| d * unit.factor));
    let span = natural.map(|(low, high)| {
        let margin = 0.12 * (high - low);
        (low - margin, high + margin)
    });
    let shown = |points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        points.into_iter().map(|(x, d)| (unit.show(x), d * unit.factor)).collect()
    };
    let mut curves = Vec::new();
    if let Some(span) = span.filter(|(low, high)| high > low) {
        let prior =
            c.prior.as_ref().map_or_else(Vec::new, |prior| shown(named_density(prior, span, 160)));
        curves.push(Curve { class: "s-prior", name: String::from("prior"), points: prior });
        if let Some(fit) = c.fits.first() {
            let name = fit.distribution.name().replace('_', "-");
            let points = shown(named_density(&fit.distribution, span, 160));
            curves.push(Curve { class: "s-fit", name, points });
        }
    }
    let remark = c.fits.first().map_or_else(String::new, |fit| {
        let name = fit.distribution.name().replace('_', "-");
        format!("best fit {name}, KS p = {}", significant(fit.p_value, 2))
    });
    let per_unit =
        if unit.unit.is_empty() { String::new() } else { format!(" [1/({})]", unit.unit) };
    Marginal {
        title: titled(&c.name, &c.symbol),
        remark,
        label: unit.label(&c.name),
        density_label: format!("density{per_unit}"),
        draws,
        curves,
        marks: marks(c, &unit),
        second: is_variance(c).then(|| sd_axis(findings, unit.factor)),
    }
}

/// Returns true if a hyperparameter is a variance of the response, so that its root can be shown too.
fn is_variance(c: &CoordinateFindings) -> bool {
    c.role == Role::Hyperparameter && c.name.contains("variance") && c.q025 > 0.0
}

/// Axis of standard deviations in the unit of the response, above an axis of variances whose displayed unit has this
/// size.
fn sd_axis(findings: &Findings, variance_factor: f64) -> SecondAxis {
    let unit = response_unit(findings);
    SecondAxis {
        label: unit.label("standard deviation"),
        factor: unit.factor / variance_factor.sqrt(),
        to_first: |sd| sd * sd,
        from_first: f64::sqrt,
    }
}

fn pairs(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let chosen = paired(&calibration.correlation);
    let column = |&i: &usize| {
        let c = &calibration.coordinates[i];
        let unit = coordinate_unit(c);
        PairColumn {
            index: i,
            label: unit.label(&titled(&c.name, &c.symbol)),
            draws: kept_draws(calibration, i, &unit),
            effective: c.ess_bulk,
            marks: pair_marks(c, &unit),
        }
    };
    let columns: Vec<PairColumn> = chosen.iter().map(column).collect();
    let mut keys = vec![Key::area("hex h-4", "draws (darker: more)"), Key::line("m-map", "MAP")];
    if calibration.coordinates.iter().any(|c| c.reference.is_some()) {
        keys.push(Key::line("m-reference", "reference"));
    }
    let all = calibration.coordinates.len();
    let further = if all > chosen.len() {
        format!(
            " Of {all} coordinates the {} with the strongest correlations are shown.",
            chosen.len()
        )
    } else {
        String::new()
    };
    let caption = Caption::new(
        format!(
            "The coordinates in pairs: counts of draws in hexagons, shaded by the root of the count, \
             with densities on the diagonal. The axes hold 99.9 % of the draws; crosses mark the MAP \
             and, where it is that near, the reference.{further}"
        ),
        "the posterior.",
        "narrow ridges, bananas, several islands.",
    );
    let said = in_pairs(calibration, &chosen);
    numbers.figure("pairs", &[pair_matrix(&columns, &said)], &keys, &caption)
}

/// Coordinates that are shown in pairs: all, or those with the strongest correlations, in their order.
fn paired(correlation: &Matrix) -> Vec<usize> {
    let n = correlation.rows();
    let strongest = |i: usize| {
        let others = (0..n).filter(|&j| j != i).map(|j| correlation[(i, j)].abs());
        others.filter(|size| size.is_finite()).fold(0.0, f64::max)
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| strongest(b).total_cmp(&strongest(a)));
    order.truncate(MOST_PAIRED);
    order.sort_unstable();
    order
}

/// Description of the pairs: the strongest correlation among the coordinates that are drawn.
fn in_pairs(calibration: &CalibrationFindings, chosen: &[usize]) -> String {
    let pairs = chosen.iter().flat_map(|&i| chosen.iter().map(move |&j| (i, j)));
    let pairs = pairs.filter(|(i, j)| j < i);
    let size = |&(i, j): &(usize, usize)| calibration.correlation[(i, j)].abs();
    let known = pairs.filter(|pair| size(pair).is_finite());
    match known.max_by(|a, b| size(a).total_cmp(&size(b))) {
        Some((i, j)) => format!(
            "the posterior in pairs; the strongest correlation is {}, of {} and {}",
            typeset(&fixed(calibration.correlation[(i, j)], 2)),
            calibration.coordinates[j].name,
            calibration.coordinates[i].name
        ),
        None => "the posterior in pairs; no correlation is known".to_owned(),
    }
}

/// The MAP and the reference; every column has both, so that they form pairs.
fn pair_marks(c: &CoordinateFindings, unit: &crate::page::scale::ShownUnit) -> Vec<Mark> {
    let mark = |class, label: &str, value: f64| Mark {
        class,
        label: label.to_owned(),
        value: unit.show(value),
    };
    vec![
        mark("m-map", "MAP", c.map),
        mark("m-reference", "reference", c.reference.unwrap_or(f64::NAN)),
    ]
}

fn fits(calibration: &CalibrationFindings, numbers: &mut Numbers) -> Markup {
    let heads = ["KS distance", "p", "ΔAIC"];
    let mut table = Table::new(&["parameter", "unit", "distribution"], &heads);
    for c in &calibration.coordinates {
        for fit in &c.fits {
            table.row([
                c.name.clone(),
                printed(&c.unit),
                rounded(&fit.distribution.to_string(), 5),
                fixed(fit.ks, 4),
                significant(fit.p_value, 2),
                fixed(fit.delta_aic, 1),
            ]);
        }
    }
    let caption = Caption::new(
        "Named distributions fitted to the marginals, best first, in the unit of the row. The \
         p-value is that of the Kolmogorov-Smirnov distance at the effective sample size.",
        "the posterior, marginally: independent draws from these lose the correlations.",
        "small p-values: then no named distribution stands in for the draws.",
    );
    html! { @if !table.is_empty() { (numbers.table(&table, &caption)) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_coordinates_the_most_correlated_are_paired() {
        let few = Matrix::from_fn(5, 5, |i, j| if i == j { 1.0 } else { 0.0 });
        assert_eq!(paired(&few), [0, 1, 2, 3, 4]);
        // Neighbours 2k, 2k + 1 are correlated, the later the stronger.
        let many = Matrix::from_fn(20, 20, |i, j| match (i == j, i / 2 == j / 2) {
            (true, _) => 1.0,
            (_, true) => -0.04 * (i / 2) as f64,
            _ => 0.0,
        });
        assert_eq!(paired(&many), (8..20).collect::<Vec<_>>());
    }
}
