//! Groups of the file.

use lacuna::data::{Condition, Observations, Scenario};
use lacuna_linalg::Matrix;
use netcdf_writer::{DimensionId, Error, NcAttrValue};

use super::cells::Cells;
use super::file::File;
use super::predicted::{FromPosterior, FromPrior};
use super::suffix;
use crate::stage::calibrate::Calibrated;
use crate::stage::curves::Curves;
use crate::stage::evidence::Weighed;
use crate::stage::quantities::{Quantified, Variant};
use crate::stage::validate::Validated;
use crate::study::Study;

/// Contents of the file.
pub struct Given<'a> {
    pub study: &'a Study,
    /// Posterior with the derived quantities.
    pub calibrated: &'a Calibrated,
    pub weighed: Option<&'a Weighed>,
    pub validated: Option<&'a Validated>,
    pub quantities: Option<&'a Quantified>,
    /// Data of the likelihood.
    pub data: Option<&'a Observations>,
    pub from_posterior: Option<FromPosterior>,
    pub from_prior: FromPrior,
}

/// Reason why predictions are missing.
const TOO_MANY: &str = "log_likelihood and posterior_predictive are omitted: even the smallest useful number of \
                        draws gives more than ten million values";

/// Reason why the data are missing.
const MANY: &str =
    "observed_data is omitted: there are more than ten million data; they are in the folder 3-read";

impl Given<'_> {
    /// The file. The largest tables are given up as soon as they are in the file under construction.
    pub fn file(mut self) -> Result<File, Error> {
        let version = env!("CARGO_PKG_VERSION");
        let mut attributes = vec![
            ("title", self.study.about.title.as_str()),
            ("inference_library", "lacuna"),
            ("inference_library_version", version),
        ];
        if self.data.is_some() && self.from_posterior.is_none() {
            attributes.push(("note", TOO_MANY));
        }
        if self.data.is_some_and(|data| Cells::of(data).are_many()) {
            attributes.push(("note_on_data", MANY));
        }
        let mut file = File::new(&attributes)?;
        self.posterior(&mut file)?;
        self.prior(&mut file)?;
        let draws = match self.data {
            Some(data) => self.of_data(&mut file, &Cells::of(data))?,
            None => None,
        };
        self.quantities(&mut file, draws)?;
        if let Some(data) = self.data {
            self.by_curve(&mut file, data)?;
        }
        self.constants(&mut file)?;
        let mut groups = vec!["posterior", "sample_stats", "prior"];
        if self.data.is_some_and(|data| !Cells::of(data).are_many()) {
            groups.push("observed_data");
        }
        for group in groups {
            for (name, text) in
                [("inference_library", "lacuna"), ("inference_library_version", version)]
            {
                file.describe(group, name, NcAttrValue::Chars(text.to_owned()))?;
            }
        }
        Ok(file)
    }

    fn posterior(&self, file: &mut File) -> Result<(), Error> {
        let outcome = &self.calibrated.outcome;
        let first = outcome.burn_in;
        let kept = self.calibrated.draws.from_step(first);
        let (chain, draw) = all_draws(file, "posterior", kept.chains, kept.steps)?;
        for (j, coordinate) in outcome.coordinates.iter().enumerate() {
            let path = format!("posterior/{}", coordinate.name);
            let unit = coordinate.unit.to_string();
            file.numbers(&path, &[chain, draw], &kept.pooled(j), Some(&unit))?;
        }
        file.describe("posterior", "burn_in", NcAttrValue::Int64s(vec![first as i64]))?;
        let (chain, draw) = all_draws(file, "sample_stats", kept.chains, kept.steps)?;
        file.numbers("sample_stats/lp", &[chain, draw], &kept.log_density, None)?;
        let statistics = &self.calibrated.statistics;
        for (s, (name, kind)) in statistics.names.iter().enumerate() {
            let values = statistics.from_step(s, first);
            file.of_kind(&format!("sample_stats/{name}"), &[chain, draw], &values, *kind)?;
        }
        let acceptance = &outcome.acceptance;
        let told = statistics.names.iter().any(|(name, _)| name == "acceptance_rate");
        if told || acceptance.is_empty() {
            return Ok(());
        }
        file.numbers("sample_stats/acceptance_rate", &[chain], acceptance, None).map(|_| ())
    }

    fn prior(&self, file: &mut File) -> Result<(), Error> {
        let points = &self.from_prior.points;
        let (chain, draw) = all_draws(file, "prior", 1, points.rows())?;
        let coordinates = &self.calibrated.outcome.coordinates;
        let derived = self.study.derived();
        for (j, coordinate) in coordinates.iter().enumerate() {
            let values: Vec<f64> = if j < points.columns() {
                points.column(j)
            } else {
                points.iter_rows().map(|p| derived[j - points.columns()].value(p)).collect()
            };
            let unit = coordinate.unit.to_string();
            let path = format!("prior/{}", coordinate.name);
            file.numbers(&path, &[chain, draw], &values, Some(&unit))?;
        }
        Ok(())
    }

    /// Writes the predicted quantities; `draws` are the dimensions of the predictions of data, which are at the same
    /// draws.
    fn quantities(&self, file: &mut File, draws: Option<[DimensionId; 2]>) -> Result<(), Error> {
        let Some(found) = self.quantities else { return Ok(()) };
        let about = &found.about;
        let dimensions = match draws {
            Some(draws) => draws,
            None => chosen_of(file, PREDICTIVE, &about.chains, &about.steps)?,
        };
        for (i, quantity) in about.quantities.iter().enumerate() {
            let values = found.draws_of(i, &Variant::Total).unwrap_or_default();
            let path = format!("{PREDICTIVE}/{}", quantity.name);
            file.numbers(&path, &dimensions, values, Some(&quantity.unit))?;
        }
        Ok(())
    }

    /// Writes the groups that are arranged like the data; returns the dimensions of the predictions, if there are any.
    fn of_data(
        &mut self,
        file: &mut File,
        cells: &Cells<'_>,
    ) -> Result<Option<[DimensionId; 2]>, Error> {
        let mut dimensions = None;
        let layouts = &self.study.layouts;
        let (name, unit) = (layouts.name(), layouts.unit().to_string());
        let unit = Some(unit.as_str());
        if cells.are_many() {
            let axes = cells.axes(file, PREDICTIVE)?;
            self.band(file, &axes)?;
            return Ok(None);
        }
        let place = cells.place(file, "observed_data")?;
        place.variable(file, &format!("observed_data/{name}"), &[], &cells.values(), unit)?;
        if let Some(from) = &mut self.from_posterior {
            let place = cells.place(file, PREDICTIVE)?;
            let draws = chosen(file, PREDICTIVE, from)?;
            dimensions = Some(draws);
            let path = format!("{PREDICTIVE}/{name}");
            let data = std::mem::take(&mut from.data);
            place.variable(file, &path, &draws, data.as_slice(), unit)?;
            drop(data);
            let densities = from.log_likelihood.take();
            self.band(file, &place.axes())?;
            if let (Some(densities), Some(from)) = (densities, &self.from_posterior) {
                let place = cells.place(file, "log_likelihood")?;
                let draws = chosen(file, "log_likelihood", from)?;
                let path = format!("log_likelihood/{name}");
                place.variable(file, &path, &draws, densities.as_slice(), None)?;
                described(
                    file,
                    "log_likelihood",
                    from,
                    "the log density of each value given all others and the unknowns",
                )?;
            }
        } else {
            let place = cells.place(file, PREDICTIVE)?;
            self.band(file, &place.axes())?;
        }
        if let Some((numbers, data)) = self.from_prior.data.take() {
            let group = "prior_predictive";
            let place = cells.place(file, group)?;
            let chain = file.counted(group, "chain", &[0])?.0;
            let draw = file.counted(group, "draw", &numbers)?.0;
            let path = format!("{group}/{name}");
            place.variable(file, &path, &[chain, draw], data.as_slice(), unit)?;
        }
        Ok(dimensions)
    }

    /// Writes the band of a new replicate.
    fn band(&self, file: &mut File, axes: &[Vec<DimensionId>]) -> Result<(), Error> {
        let Some((low, high)) = self.validated.and_then(|v| v.predictive.as_ref()) else {
            return Ok(());
        };
        let layouts = &self.study.layouts;
        let unit = layouts.unit().to_string();
        for (i, (layout, range)) in layouts.parts().enumerate() {
            let block = suffix(i, layouts.blocks.len());
            for (end, values) in [("q025", low), ("q975", high)] {
                let path = format!("{PREDICTIVE}/{}_{end}{block}", layout.name);
                file.numbers(&path, &axes[i], &values[range.clone()], Some(&unit))?;
            }
        }
        Ok(())
    }

    /// Writes the log density of each curve given all others.
    fn by_curve(&self, file: &mut File, data: &Observations) -> Result<(), Error> {
        let densities: Option<&Matrix> = self.weighed.and_then(|w| w.by_curve.as_ref());
        let (Some(densities), Some(from)) = (densities, &self.from_posterior) else {
            return Ok(());
        };
        let group = "log_likelihood_by_curve";
        let draws = chosen(file, group, from)?;
        let names: Vec<String> = Curves::of(data).all.into_iter().map(|curve| curve.name).collect();
        let curve = file.labels(group, "curve", &names)?;
        let path = format!("{group}/{}", self.study.layouts.name());
        file.numbers(&path, &[draws[0], draws[1], curve], densities.as_slice(), None)?;
        described(
            file,
            group,
            from,
            "the log density of each curve given all others and the unknowns",
        )
    }

    /// Writes known values: reference values of the parameters, conditions of the scenarios.
    fn constants(&self, file: &mut File) -> Result<(), Error> {
        let group = "constant_data";
        for parameter in &self.study.parameters {
            if let Some(value) = parameter.reference {
                let path = format!("{group}/{}_reference", parameter.name);
                file.numbers(&path, &[], &[value], Some(&parameter.unit.to_string()))?;
            }
        }
        let scenarios: &[Scenario] = &self.study.scenarios;
        let mut names: Vec<&str> = Vec::new();
        for condition in scenarios.iter().flat_map(|scenario| &scenario.values) {
            if !names.contains(&condition.name.as_str()) {
                names.push(&condition.name);
            }
        }
        if names.is_empty() || scenarios.iter().any(|scenario| scenario.label().is_none()) {
            return Ok(());
        }
        let labels: Vec<String> = scenarios.iter().map(|scenario| scenario.name.clone()).collect();
        let dimension = file.labels(group, "scenario", &labels)?;
        for name in names {
            let problem: Vec<Option<&Condition>> =
                scenarios.iter().map(|scenario| scenario.value(name)).collect();
            let unit = |c: &Condition| c.unit.as_ref().map(ToString::to_string);
            let first = problem.iter().flatten().next().and_then(|c| unit(c));
            // A variable has a single unit.
            if problem.iter().flatten().any(|c| unit(c) != first) {
                continue;
            }
            let values: Vec<f64> =
                problem.iter().map(|c| c.map_or(f64::NAN, |c| c.value)).collect();
            file.numbers(&format!("{group}/{name}"), &[dimension], &values, first.as_deref())?;
        }
        Ok(())
    }
}

const PREDICTIVE: &str = "posterior_predictive";

/// Adds the dimensions of all chains and draws to a group.
fn all_draws(
    file: &mut File,
    group: &str,
    chains: usize,
    draws: usize,
) -> Result<(DimensionId, DimensionId), Error> {
    let chain = file.counted(group, "chain", &(0..chains).collect::<Vec<_>>())?.0;
    let draw = file.counted(group, "draw", &(0..draws).collect::<Vec<_>>())?.0;
    Ok((chain, draw))
}

/// Adds the dimensions of the selected chains and draws to a group.
fn chosen(file: &mut File, group: &str, from: &FromPosterior) -> Result<[DimensionId; 2], Error> {
    chosen_of(file, group, &from.chosen.chains, &from.chosen.steps)
}

fn chosen_of(
    file: &mut File,
    group: &str,
    chains: &[usize],
    steps: &[usize],
) -> Result<[DimensionId; 2], Error> {
    let chain = file.counted(group, "chain", chains)?.0;
    Ok([chain, file.counted(group, "draw", steps)?.0])
}

/// Describes a group of log-likelihoods, with the efficiency of its draws.
fn described(file: &mut File, group: &str, from: &FromPosterior, what: &str) -> Result<(), Error> {
    file.describe(group, "description", NcAttrValue::Chars(what.to_owned()))?;
    let efficiency = NcAttrValue::Doubles(vec![from.chosen.efficiency]);
    file.describe(group, "relative_efficiency", efficiency)
}
