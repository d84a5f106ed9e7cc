//! A weighted sum of emulators as one emulator.

use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{FitError, Processes, Summand, Tables};
use lacuna::plugin::{Emulator, Fact, Forward, Sensitivity, Surrogate};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply};

/// The sum `y(x) = offset + sum_k weight_k y_k(x)` of emulators with the same parameters and outputs.
pub struct Combined {
    form: Form,
    fit_error: FitError,
    facts: Vec<Fact>,
    saved: Vec<u8>,
}

enum Form {
    /// One emulator in the plugin's own form, including exact sensitivity indices.
    One(Box<dyn Emulator>),
    /// Several emulators.
    Several(Several),
}

struct Several {
    parts: Vec<(Box<dyn Emulator>, Vec<f64>)>,
    offset: Vec<f64>,
    /// True if all parts are linear.
    linear: bool,
    /// For linear parts: the weighted coefficients of all parts, and the offset.
    coefficients: Matrix,
}

/// One term of the sum: the plugin that fitted a part, its name, the saved part, its weights.
pub struct Source<'a> {
    /// Plugin that fitted the part.
    pub plugin: &'a dyn Surrogate,
    /// Name of the plugin.
    pub name: &'a str,
    /// The part, as saved.
    pub bytes: Vec<u8>,
    /// Weight of each output.
    pub weights: Vec<f64>,
}

impl Combined {
    /// The sum of parts: in the form of their plugin if they share one that is closed under sums.
    ///
    /// `fit_error`, `facts` and `saved` are returned by the corresponding methods of the sum.
    pub fn new(
        sources: &[Source<'_>],
        offset: &[f64],
        fit_error: FitError,
        facts: Vec<Fact>,
        saved: Vec<u8>,
    ) -> Result<Self, Stop> {
        let mut used: Vec<&Source<'_>> =
            sources.iter().filter(|s| s.weights.iter().any(|w| *w != 0.0)).collect();
        if used.is_empty() {
            used.extend(sources.first());
        }
        let first = used.first().ok_or_else(|| Stop::new("a sum of no emulators"))?;
        let one = if used.iter().all(|source| source.name == first.name) {
            let summands: Vec<Summand<'_>> =
                used.iter().map(|s| Summand { bytes: &s.bytes, weights: &s.weights }).collect();
            first.plugin.sum(&summands, offset)?
        } else {
            None
        };
        let form = match one {
            Some(emulator) => Form::One(emulator),
            None => Form::Several(Several::new(&used, offset)?),
        };
        Ok(Self { form, fit_error, facts, saved })
    }

    fn inner(&self) -> &dyn Forward {
        match &self.form {
            Form::One(emulator) => &**emulator,
            Form::Several(several) => several,
        }
    }
}

impl Several {
    fn new(sources: &[&Source<'_>], offset: &[f64]) -> Result<Self, Stop> {
        let parts = sources
            .iter()
            .map(|source| Ok((source.plugin.load(&source.bytes)?, source.weights.clone())));
        let parts: Vec<(Box<dyn Emulator>, Vec<f64>)> = parts.collect::<Result<_, Stop>>()?;
        let whole = |(emulator, _): &(Box<dyn Emulator>, _)| {
            emulator.outputs() == offset.len() && emulator.dimension() == parts[0].0.dimension()
        };
        if !parts.iter().all(whole) {
            return Err(Stop::new("the emulators of two ensembles are of different shapes"));
        }
        let mut rows = Vec::new();
        let mut linear = true;
        for (emulator, weights) in &parts {
            match emulator.linear() {
                Some(part) => {
                    rows.extend(part.coefficients().iter_rows().map(|row| {
                        row.iter().zip(weights).map(|(c, w)| c * w).collect::<Vec<f64>>()
                    }));
                }
                None => linear = false,
            }
        }
        rows.push(offset.to_vec());
        let coefficients =
            if linear { Matrix::from_rows(offset.len(), rows) } else { Matrix::default() };
        Ok(Self { parts, offset: offset.to_vec(), linear, coefficients })
    }

    /// Adds up one matrix per part, whose columns are the outputs, with weights raised to `power`.
    fn sum(&self, start: impl Fn(usize) -> f64, parts: &[Matrix], power: i32) -> Matrix {
        Matrix::from_fn(parts[0].rows(), self.offset.len(), |i, j| {
            let each = parts.iter().zip(&self.parts);
            start(j) + each.map(|(m, (_, w))| w[j].powi(power) * m[(i, j)]).sum::<f64>()
        })
    }
}

impl Forward for Several {
    fn dimension(&self) -> usize {
        self.parts[0].0.dimension()
    }

    fn outputs(&self) -> usize {
        self.offset.len()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        if self.linear {
            return multiply(&self.basis(points), &self.coefficients);
        }
        let means: Vec<Matrix> = self.parts.iter().map(|(part, _)| part.mean(points)).collect();
        self.sum(|j| self.offset[j], &means, 1)
    }

    /// The errors of the parts are independent of each other, as in co-kriging.
    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let variances: Option<Vec<Matrix>> =
            self.parts.iter().map(|(part, _)| part.variance(points)).collect();
        Some(self.sum(|_| 0.0, &variances?, 2))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let mut whole = Matrix::zeros(self.outputs(), self.dimension());
        for (part, weights) in &self.parts {
            let jacobian = part.jacobian(point);
            for (j, weight) in weights.iter().enumerate() {
                let slopes = whole.row_mut(j).iter_mut().zip(jacobian.row(j));
                slopes.for_each(|(sum, slope)| *sum += weight * slope);
            }
        }
        whole
    }

    fn linear(&self) -> Option<&dyn Linear> {
        self.linear.then_some(self as &dyn Linear)
    }

    fn failure(&self) -> Option<String> {
        self.parts.iter().find_map(|(part, _)| part.failure())
    }
}

impl Several {
    /// Linear forms of the parts.
    fn linears(&self) -> impl Iterator<Item = &dyn Linear> {
        self.parts.iter().filter_map(|(part, _)| part.linear())
    }
}

/// Basis functions of all parts one after the other, then the constant.
impl Linear for Several {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let parts: Vec<Matrix> = self.linears().map(|part| part.basis(points)).collect();
        let columns = parts.iter().map(Matrix::columns).sum::<usize>() + 1;
        let rows = (0..points.rows()).map(|i| {
            let mut row: Vec<f64> = parts.iter().flat_map(|part| part.row(i)).copied().collect();
            row.push(1.0);
            row
        });
        Matrix::from_rows(columns, rows)
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let parts: Vec<Matrix> = self.linears().map(|part| part.basis_gradient(point)).collect();
        let constant = vec![0.0; point.len()];
        let rows = parts.iter().flat_map(Matrix::iter_rows).chain([&constant[..]]);
        Matrix::from_rows(point.len(), rows)
    }
}

impl Forward for Combined {
    fn dimension(&self) -> usize {
        self.inner().dimension()
    }

    fn outputs(&self) -> usize {
        self.inner().outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.inner().mean(points)
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        self.inner().variance(points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.inner().jacobian(point)
    }

    fn linear(&self) -> Option<&dyn Linear> {
        // Forms that a plugin implements for sums of squares are kept.
        self.inner().linear()
    }

    fn failure(&self) -> Option<String> {
        self.inner().failure()
    }
}

impl Emulator for Combined {
    /// Known for a single emulator in the plugin's own form; the parts of a sum have directions of their own.
    fn processes(&self) -> Option<&dyn Processes> {
        match &self.form {
            Form::One(emulator) => emulator.processes(),
            Form::Several(_) => None,
        }
    }

    fn sensitivity(&self) -> Option<Sensitivity> {
        match &self.form {
            Form::One(emulator) => emulator.sensitivity(),
            Form::Several(_) => None,
        }
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        self.facts.clone()
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        Ok(self.saved.clone())
    }

    fn tables(&self) -> Result<Tables, String> {
        match &self.form {
            Form::One(emulator) => emulator.tables(),
            Form::Several(_) => Err("it is the sum of emulators of two fidelities".to_owned()),
        }
    }
}
