//! Response of compiled equations to inputs, and its derivatives.

use lacuna::expression::Evaluator;
use lacuna::plugin::Fact;
use lacuna_linalg::Matrix;

use super::flow::Flow;
use super::integrate::integrate;
use super::options::Solver;
use super::shape::Shape;
use super::system::System;

/// Answer of the equations.
pub struct Answer {
    /// Values on the layout.
    pub values: Vec<f64>,
    /// Derivatives with respect to each input, if requested (`values x inputs`).
    pub jacobian: Option<Matrix>,
    /// Facts about the run.
    pub facts: Vec<Fact>,
}

/// Evaluator of equations on a layout.
pub struct Responder<'a> {
    pub system: &'a System,
    pub shape: &'a Shape<'a>,
    pub solver: &'a Solver,
    pub inputs: &'a [f64],
    /// Number of values of the layout.
    pub length: usize,
}

impl Responder<'_> {
    /// Computes the response, and its derivatives if requested.
    pub fn answer(&self, derivatives: bool) -> Result<Answer, String> {
        let system = self.system;
        let moving = (0..system.inputs).filter(|i| derivatives && system.moves_states(*i));
        let channels: Vec<usize> = moving.collect();
        let mut observer = Observer::new(self, derivatives, &channels);
        if system.states.is_empty() {
            (0..self.shape.points()).for_each(|index| observer.observe(index, &[], &[]));
            return observer.finish(Vec::new());
        }
        let flow = Flow::new(system, self.inputs, &channels);
        let mut sink = |index: usize, states: &[f64], sensitivities: &[f64]| {
            observer.observe(index, states, sensitivities);
        };
        let effort = integrate(&flow, self.solver, self.shape.times(), &mut sink)?;
        let method = effort.method.name();
        observer.finish(vec![Fact::new("method", method), Fact::new("steps", effort.steps)])
    }
}

/// Writes the observed quantities at each point to their positions in the response.
struct Observer<'o> {
    of: &'o Responder<'o>,
    channels: &'o [usize],
    observed: Evaluator<'o>,
    point: Vec<f64>,
    direction: Vec<f64>,
    /// Observed quantities at one point, or their slopes.
    row: Vec<f64>,
    values: Vec<f64>,
    jacobian: Option<Matrix>,
}

impl<'o> Observer<'o> {
    fn new(of: &'o Responder<'_>, derivatives: bool, channels: &'o [usize]) -> Self {
        let system = of.system;
        let mut point = vec![0.0; system.coordinates()];
        let variables = system.variables.len();
        point[variables..variables + system.inputs].copy_from_slice(of.inputs);
        Self {
            of,
            channels,
            observed: Evaluator::new(&system.observed),
            direction: vec![0.0; point.len()],
            point,
            row: vec![0.0; system.labels.len()],
            values: vec![0.0; of.length],
            jacobian: derivatives.then(|| Matrix::zeros(of.length, system.inputs)),
        }
    }

    /// Evaluates the observed quantities at point `index`, for these states and their derivatives with respect to the
    /// channels.
    fn observe(&mut self, index: usize, states: &[f64], sensitivities: &[f64]) {
        let (system, shape) = (self.of.system, self.of.shape);
        let variables = system.variables.len();
        let first = shape.point(index, &mut self.point[..variables]);
        let state = variables + system.inputs;
        self.point[state..].copy_from_slice(states);
        self.observed.at(&self.point);
        self.observed.values(&mut self.row);
        for (place, observed) in shape.places(first) {
            self.values[place] = self.row[observed];
        }
        let Some(jacobian) = &mut self.jacobian else { return };
        for input in 0..system.inputs {
            self.direction.fill(0.0);
            self.direction[variables + input] = 1.0;
            if let Some(channel) = self.channels.iter().position(|of| *of == input) {
                let sensitivity = &sensitivities[channel * states.len()..][..states.len()];
                self.direction[state..].copy_from_slice(sensitivity);
            }
            self.observed.slopes(&self.direction, &mut self.row);
            for (place, observed) in shape.places(first) {
                jacobian[(place, input)] = self.row[observed];
            }
        }
    }

    fn finish(self, facts: Vec<Fact>) -> Result<Answer, String> {
        let (system, shape) = (self.of.system, self.of.shape);
        if self.values.iter().all(|value| value.is_finite()) {
            return Ok(Answer { values: self.values, jacobian: self.jacobian, facts });
        }
        let mut coordinates = vec![0.0; system.variables.len()];
        for index in 0..shape.points() {
            let first = shape.point(index, &mut coordinates);
            let wrong = shape.places(first).find(|(place, _)| !self.values[*place].is_finite());
            if let Some((place, observed)) = wrong {
                let what = match system.labels[observed].as_str() {
                    "" => "what is observed".to_owned(),
                    label => format!("the observed `{label}`"),
                };
                let at = system.variables.iter().zip(&coordinates);
                let at = at.map(|(name, x)| format!("{name} = {x}")).collect::<Vec<_>>().join(", ");
                let at = if at.is_empty() { at } else { format!(" at {at}") };
                return Err(format!("{what} is {}{at}", self.values[place]));
            }
        }
        unreachable!("a value that is no number stands at a point")
    }
}
