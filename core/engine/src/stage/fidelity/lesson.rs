//! Selection of the rule that relates fine to cheap runs, by cross-validation at fine runs.

use lacuna::data::layout::Group;
use lacuna::data::{Layouts, Parameter};
use lacuna::math::moments;
use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Emulator, Surrogate};
use lacuna::run::{Progress, Silent, Stop};
use lacuna_linalg::Matrix;

use super::rule::Regression;
use super::{Difference, Rule, Scale, Shape, Verdict};

/// Number of runs up to which they are left out one by one; more are left out in [`PARTS`].
const ONE_BY_ONE: usize = 20;
/// Number of parts for more runs.
const PARTS: usize = 10;

/// Smallest number of runs to which an emulator is fitted.
const LEAST: usize = 3;

/// Fine runs with the cheap responses at the same points.
pub struct Lesson<'a> {
    /// Surrogate for the difference.
    pub plugin: &'a dyn Surrogate,
    /// Parameters with their design distributions.
    pub parameters: &'a [Parameter],
    /// Layouts of the response of one run.
    pub layouts: &'a Layouts,
    /// Parameters of each fine run, `runs x parameters`.
    pub points: &'a Matrix,
    /// Fine responses, `runs x outputs`.
    pub fine: &'a Matrix,
    /// Cheap responses at these points, of a cheap run at the point or of the emulator of the cheap runs
    /// (`runs x outputs`).
    pub cheap: &'a Matrix,
    /// Cheap responses at these points as predicted without a cheap run at the point (`runs x outputs`).
    pub predicted: &'a Matrix,
    /// Rules that are tried: first the default, then from simple to complex.
    pub rules: &'a [Rule],
    /// Random stream of the surrogate.
    pub stream: &'a Stream,
}

/// One rule fitted to some of the runs.
struct Fit {
    scale: Vec<f64>,
    offset: Vec<f64>,
    emulator: Option<Box<dyn Emulator>>,
}

/// Performance of a rule at left-out runs.
struct Tried {
    rule: Rule,
    /// Errors of the rule, `runs x outputs`; `None` if it cannot be fitted.
    residuals: Option<Matrix>,
}

impl Lesson<'_> {
    /// Selects and fits the rules.
    pub fn learn(&self, progress: &Progress<'_>) -> Result<Difference, Stop> {
        let groups = self.layouts.groups();
        let mut fault = None;
        let tried: Vec<Tried> = self
            .rules
            .iter()
            .map(|&rule| {
                let residuals = self.left_out(rule, &groups);
                let residuals = residuals.map_err(|stop| fault = Some(stop)).ok();
                Tried { rule, residuals }
            })
            .collect();
        let chosen: Option<Vec<usize>> =
            groups.iter().map(|group| best(&tried, &group.indices)).collect();
        let Some(chosen) = chosen else {
            let few = || Stop::new("no rule can be fitted to the fine runs");
            return Err(fault.unwrap_or_else(few));
        };
        self.whole(&groups, &tried, &chosen, progress)
    }

    /// Errors of a rule at each run, which is left out of everything that is fitted.
    fn left_out(&self, rule: Rule, groups: &[Group]) -> Result<Matrix, Stop> {
        let runs = self.points.rows();
        let parts = if runs <= ONE_BY_ONE { runs } else { PARTS };
        let mut residuals = Matrix::zeros(runs, self.fine.columns());
        if runs < 2 && rule != Rule::SAME {
            return Err(Stop::new("cross-validation needs at least two fine runs"));
        }
        for part in 0..parts {
            // Runs are assigned to the parts in turn, so that each part covers the whole design.
            let (out, kept): (Vec<usize>, Vec<usize>) = (0..runs).partition(|i| i % parts == part);
            let rules = vec![rule; groups.len()];
            let fit = self.fit(&rules, groups, &kept, &Progress::new(&Silent))?;
            let predicted = self.predict(&fit, &out);
            for (row, &i) in out.iter().enumerate() {
                for j in 0..self.fine.columns() {
                    residuals[(i, j)] = self.fine[(i, j)] - predicted[(row, j)];
                }
            }
        }
        if residuals.as_slice().iter().all(|r| r.is_finite()) {
            Ok(residuals)
        } else {
            Err(Stop::new("the emulator of the difference is not finite"))
        }
    }

    /// Fits one rule per group to some of the runs.
    fn fit(
        &self,
        rules: &[Rule],
        groups: &[Group],
        rows: &[usize],
        progress: &Progress<'_>,
    ) -> Result<Fit, Stop> {
        let outputs = self.fine.columns();
        let points = self.points.select_rows(rows);
        let (fine, cheap) = (self.fine.select_rows(rows), self.cheap.select_rows(rows));
        let (mut scale, mut offset) = (vec![1.0; outputs], vec![0.0; outputs]);
        let mut targets = Matrix::zeros(rows.len(), outputs);
        for (rule, group) in rules.iter().zip(groups) {
            let factor = self.factor(*rule, &points, &fine, &cheap, group);
            for &j in &group.indices {
                scale[j] = factor;
                let rest: Vec<f64> =
                    (0..rows.len()).map(|i| fine[(i, j)] - factor * cheap[(i, j)]).collect();
                match rule.difference {
                    Shape::Nothing => {}
                    Shape::Constant => offset[j] = moments::mean(&rest),
                    Shape::Emulated => (0..rows.len()).for_each(|i| targets[(i, j)] = rest[i]),
                }
            }
        }
        let emulator = if rules.iter().any(|rule| rule.difference == Shape::Emulated) {
            if rows.len() < LEAST {
                return Err(Stop::new(format!(
                    "{} fine runs are too few for an emulator",
                    rows.len()
                )));
            }
            let training = Training {
                parameters: self.parameters,
                layouts: self.layouts,
                points: &points,
                responses: &targets,
                gradients: None,
            };
            Some(self.plugin.fit(&training, self.stream, progress)?)
        } else {
            None
        };
        Ok(Fit { scale, offset, emulator })
    }

    fn factor(
        &self,
        rule: Rule,
        points: &Matrix,
        fine: &Matrix,
        cheap: &Matrix,
        group: &Group,
    ) -> f64 {
        match rule.scale {
            Scale::Zero => 0.0,
            Scale::One => 1.0,
            Scale::Regressed => {
                // Two more runs than unknowns, so that one degree of freedom is left when a run is left out.
                let linear = rule.difference == Shape::Emulated
                    && self.points.rows() >= self.points.columns() + 3;
                Regression::new(points, linear).factor(fine, cheap, &group.indices)
            }
        }
    }

    /// Predictions of a fit at runs that it may not have been fitted to.
    fn predict(&self, fit: &Fit, rows: &[usize]) -> Matrix {
        let cheap = self.predicted.select_rows(rows);
        let difference =
            fit.emulator.as_ref().map(|emulator| emulator.mean(&self.points.select_rows(rows)));
        Matrix::from_fn(rows.len(), cheap.columns(), |i, j| {
            let difference = difference.as_ref().map_or(0.0, |d| d[(i, j)]);
            fit.scale[j] * cheap[(i, j)] + fit.offset[j] + difference
        })
    }

    /// The chosen rules fitted to all runs.
    fn whole(
        &self,
        groups: &[Group],
        tried: &[Tried],
        chosen: &[usize],
        progress: &Progress<'_>,
    ) -> Result<Difference, Stop> {
        let rules: Vec<Rule> = chosen.iter().map(|&k| tried[k].rule).collect();
        let all: Vec<usize> = (0..self.points.rows()).collect();
        let fit = self.fit(&rules, groups, &all, progress)?;
        let mut residuals = Matrix::zeros(all.len(), self.fine.columns());
        let mut emulated = vec![false; self.fine.columns()];
        let mut verdicts = Vec::new();
        for (group, &k) in groups.iter().zip(chosen) {
            let rule = tried[k].rule;
            for &j in &group.indices {
                emulated[j] = rule.difference == Shape::Emulated;
                if let Some(of_rule) = &tried[k].residuals {
                    for &i in &all {
                        residuals[(i, j)] = of_rule[(i, j)];
                    }
                }
            }
            let error = |tried: &Tried| {
                let squares = squares(tried.residuals.as_ref()?, &group.indices);
                Some((moments::mean(&squares) / group.indices.len() as f64).sqrt())
            };
            let left_out = tried.iter().map(|tried| (tried.rule, error(tried))).collect();
            let scale = group.indices.first().map_or(1.0, |&j| fit.scale[j]);
            verdicts.push(Verdict { group: group.name.clone(), rule, scale, left_out });
        }
        let emulator = fit.emulator.map(|emulator| emulator.save()).transpose()?;
        let (scale, offset) = (fit.scale, fit.offset);
        let relative = relative(&residuals, self.fine);
        Ok(Difference { scale, offset, emulated, emulator, residuals, relative, verdicts })
    }
}

/// Sum of squares over some outputs, one value per run.
fn squares(residuals: &Matrix, outputs: &[usize]) -> Vec<f64> {
    residuals.iter_rows().map(|row| outputs.iter().map(|&j| row[j] * row[j]).sum()).collect()
}

/// Mean square of errors divided by the variance of each output.
fn relative(residuals: &Matrix, fine: &Matrix) -> Vec<f64> {
    let of = |j: usize| {
        let (errors, responses) = (residuals.column(j), fine.column(j));
        let centre = moments::mean(&responses);
        let spread: f64 = responses.iter().map(|y| (y - centre).powi(2)).sum();
        let error: f64 = errors.iter().map(|e| e * e).sum();
        if spread > 0.0 { error / spread } else { 0.0 }
    };
    (0..fine.columns()).map(of).collect()
}

/// Best rule for some outputs: a later one is preferred only if its sum of squares is smaller by more than the standard
/// error of the mean difference over the runs.
fn best(tried: &[Tried], outputs: &[usize]) -> Option<usize> {
    let mut best: Option<(usize, Vec<f64>)> = None;
    for (k, tried) in tried.iter().enumerate() {
        let Some(residuals) = &tried.residuals else { continue };
        let own = squares(residuals, outputs);
        let better = best.as_ref().is_none_or(|(_, other)| {
            let gains: Vec<f64> = other.iter().zip(&own).map(|(a, b)| a - b).collect();
            let error = (moments::variance(&gains) / gains.len() as f64).sqrt();
            gains.len() > 1 && moments::mean(&gains) > error
        });
        if better {
            best = Some((k, own));
        }
    }
    best.map(|(k, _)| k)
}
