//! Derivatives of the response, by columns or by rows.

use lacuna::plugin::model::{Call, EvalError, Gradient};
use lacuna_linalg::Matrix;
use lacuna_um_bridge::client::Place;
use lacuna_um_bridge::protocol::About;

use super::arrangement::Question;
use super::{UmBridge, refused};

/// Request for the derivatives at one point.
struct Asked<'a> {
    model: &'a UmBridge,
    about: About,
    question: Question,
    /// Index and length of each output vector of the response.
    outputs: Vec<(usize, usize)>,
}

impl Gradient for UmBridge {
    fn jacobian(&self, call: &Call<'_>) -> Result<Matrix, EvalError> {
        let support = self.support().map_err(refused)?;
        let question = self.arranged(call)?;
        let about = self.about(question.config.clone());
        let outputs = self.chosen_outputs(call.layout.len())?;
        let asked = Asked { model: self, about, question, outputs };
        let by_columns = asked.inputs().count() * asked.outputs.len();
        let by_rows = call.layout.len() * asked.vectors().count();
        match (support.apply_jacobian, support.gradient) {
            (true, rows) if !rows || by_columns <= by_rows => asked.columns(call.layout.len()),
            (_, true) => asked.rows(call.layout.len()),
            _ => Err(EvalError::Fatal(format!(
                "`{}` at {} offers no derivatives",
                self.model,
                self.place()
            ))),
        }
    }
}

impl UmBridge {
    /// Index and length of each output vector of the response. Fails if the lengths do not add up to `total`, the
    /// length of the response.
    fn chosen_outputs(&self, total: usize) -> Result<Vec<(usize, usize)>, EvalError> {
        let sizes = self.output_sizes().map_err(refused)?;
        let all: Vec<usize> = (0..sizes.len()).collect();
        let chosen = self.outputs.as_deref().unwrap_or(&all);
        let outputs: Option<Vec<(usize, usize)>> =
            chosen.iter().map(|&i| Some((i, *sizes.get(i)?))).collect();
        let fits = |outputs: &Vec<(usize, usize)>| {
            outputs.iter().map(|(_, length)| length).sum::<usize>() == total
        };
        outputs.filter(fits).ok_or_else(|| {
            EvalError::Fatal(format!(
                "`{}` at {} has output vectors of the sizes {sizes:?}, the response has {total} values",
                self.model, self.place()
            ))
        })
    }
}

impl Asked<'_> {
    /// The inputs that are part of a vector: column, vector, position.
    fn inputs(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let places = self.question.places.iter().enumerate();
        places.filter_map(|(j, place)| place.map(|(v, k)| (j, v, k)))
    }

    /// The indices of the input vectors that have values.
    fn vectors(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.question.input.len()).filter(|&v| !self.question.input[v].is_empty())
    }

    /// The derivatives, with one request per input and output vector; `rows` is the length of the response.
    fn columns(&self, rows: usize) -> Result<Matrix, EvalError> {
        let mut jacobian = Matrix::zeros(rows, self.question.places.len());
        for (j, v, k) in self.inputs() {
            let direction = unit(self.question.input[v].len(), k);
            let mut first = 0;
            for &(output, length) in &self.outputs {
                let at = Place { output, input: v };
                let answer = self.model.ask(|client| {
                    client.apply_jacobian(&self.about, at, &self.question.input, &direction)
                });
                let column = self.sized(answer.map_err(refused)?, length)?;
                for (i, value) in column.into_iter().enumerate() {
                    jacobian.row_mut(first + i)[j] = value;
                }
                first += length;
            }
        }
        Ok(jacobian)
    }

    /// The derivatives, with one request per value of the response and input vector.
    fn rows(&self, rows: usize) -> Result<Matrix, EvalError> {
        let mut jacobian = Matrix::zeros(rows, self.question.places.len());
        let places = self
            .outputs
            .iter()
            .flat_map(|&(output, length)| (0..length).map(move |k| (output, unit(length, k))));
        for (i, (output, weight)) in places.enumerate() {
            for v in self.vectors() {
                let at = Place { output, input: v };
                let answer = self
                    .model
                    .ask(|client| client.gradient(&self.about, at, &self.question.input, &weight));
                let row = self.sized(answer.map_err(refused)?, self.question.input[v].len())?;
                for (j, _, k) in self.inputs().filter(|&(_, vector, _)| vector == v) {
                    jacobian.row_mut(i)[j] = row[k];
                }
            }
        }
        Ok(jacobian)
    }

    fn sized(&self, answer: Vec<f64>, expected: usize) -> Result<Vec<f64>, EvalError> {
        let found = answer.len();
        if found == expected {
            return Ok(answer);
        }
        Err(EvalError::Rejected(format!(
            "the server at {} answered {found} derivatives, expected {expected}",
            self.model.place()
        )))
    }
}

/// A vector with 1 at `k` and 0 elsewhere.
fn unit(length: usize, k: usize) -> Vec<f64> {
    (0..length).map(|i| if i == k { 1.0 } else { 0.0 }).collect()
}
