//! Populations: partial pooling of their members, and the prediction for a new one.

use lacuna::data::Form;
use maud::html;

use super::coordinate_unit;
use crate::page::number::{decimals, fixed, significant};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section, paragraph};
use crate::report::findings::{CalibrationFindings, CoordinateFindings};
use crate::stage::calibrate::{NewMember, PopulationOutcome};

/// The populations; `None` if the study has none.
pub fn section(
    calibration: Option<&CalibrationFindings>,
    numbers: &mut Numbers,
) -> Option<Section> {
    let calibration = calibration.filter(|calibration| !calibration.populations.is_empty())?;
    let caption = Caption::new(
        "Members of the populations, location and scale of each, and the prediction for a new member, of which nothing was \
         measured. Pooling is the mean share of the population's variance that the data leave to a member: its estimate is pulled \
         by this share from its own data towards the population's location.",
        "posterior of all unknowns together; the row of a new member contains the scatter between members.",
        "pooling near 1: the row is what the other members say. A scale whose range is that of its prior: too few members.",
    );
    let sentences = calibration.populations.iter().map(sentence);
    let content = html! {
        @for sentence in sentences { p { (paragraph(&sentence)) } }
        (numbers.table(&population_table(calibration), &caption))
    };
    Some(Section { id: "populations", title: "Populations", content })
}

fn sentence(found: &PopulationOutcome) -> String {
    let form = match found.form {
        Form::Normal => "normal".to_owned(),
        Form::LogNormal => "log-normal".to_owned(),
        Form::StudentT(dof) => format!("Student t with {dof} degrees of freedom"),
    };
    let measured = found.members.iter().filter(|member| member.measured).count();
    let centred = found.members.iter().map(|member| member.centred);
    let low = centred.clone().fold(f64::INFINITY, f64::min);
    let high = centred.fold(f64::NEG_INFINITY, f64::max);
    format!(
        "`{}` has {measured} measured members of a population that is {form}. Their coordinates were centred to the degree {} to \
         {} (0: standardised, 1: the values themselves).",
        found.parameter,
        significant(low, 2),
        significant(high, 2)
    )
}

/// Table of members, location, scale and new member of each population.
pub fn population_table(calibration: &CalibrationFindings) -> Table {
    let heads = ["mean", "sd", "2.5 %", "median", "97.5 %", "pooling"];
    let mut table = Table::new(&["parameter", "unit"], &heads);
    for population in &calibration.populations {
        let of = |name: &str| calibration.coordinates.iter().find(|c| c.name == name);
        for member in &population.members {
            let Some(found) = of(&member.name) else { continue };
            table.row(row(found, &found.name, summary_of(found), Some(member.pooling)));
        }
        for name in [&population.location, &population.scale] {
            let Some(found) = of(name) else { continue };
            table.row(row(found, name, summary_of(found), None));
        }
        let Some(first) = population.members.first().and_then(|member| of(&member.name)) else {
            continue;
        };
        let name = format!("{}, new member", population.parameter);
        table.row(row(first, &name, population.new_member, Some(1.0)));
    }
    table
}

fn summary_of(found: &CoordinateFindings) -> NewMember {
    let CoordinateFindings { mean, sd, q025, median, q975, .. } = *found;
    NewMember { mean, sd, q025, median, q975 }
}

/// A row with the digits that the Monte Carlo error of the coordinate allows.
fn row(of: &CoordinateFindings, name: &str, found: NewMember, pooling: Option<f64>) -> Vec<String> {
    let unit = coordinate_unit(of);
    let places = decimals(unit.show(of.mcse_mean), unit.show(of.sd));
    let number = |value: f64| fixed(unit.show(value), places);
    let mut cells = vec![name.to_owned(), unit.unit.clone()];
    let NewMember { mean, sd, q025, median, q975 } = found;
    cells.extend([mean, sd, q025, median, q975].map(number));
    cells.push(pooling.map_or_else(String::new, |pooling| fixed(pooling, 2)));
    cells
}
