//! Plugins that panic, each in the call that its option names.

use lacuna_plugin::data::{Measurements, Statistic};
use lacuna_plugin::linalg::Matrix;
use lacuna_plugin::math::distribution::Distribution;
use lacuna_plugin::math::random::Stream;
use lacuna_plugin::plugin::discrepancy::{Discrepancy, Known, Likelihood, VariancePart};
use lacuna_plugin::plugin::sampler::{Plan, Sampler, Start, State, Target};
use lacuna_plugin::plugin::{Component, Context, Hyperparameter};
use lacuna_plugin::run::Stop;
use lacuna_plugin::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Panics in one call.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Panicking {
    /// Name of the call.
    pub call: String,
}

impl Panicking {
    fn at(&self, call: &str) {
        assert!(self.call != call, "as I was told");
    }
}

impl Component for Panicking {
    fn check(&self, _: &Context<'_>, _: &mut Complaints<'_>) {
        self.at("check");
    }
}

impl Discrepancy for Panicking {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        self.at("likelihood");
        let hyper = Hyperparameter {
            name: "v".to_owned(),
            symbol: "v".to_owned(),
            unit: known.data.layout.unit.clone(),
            prior: Distribution::HalfNormal(1.0),
            log: true,
            start: 1.0,
        };
        Ok(Box::new(Panics { own: self.clone(), hyper: [hyper], data: known.data.clone() }))
    }

    fn likelihood_of_part(
        &self,
        _: &Known<'_>,
        _: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        self.at("likelihood_of_part");
        Ok(None)
    }

    fn takes_stated_noise(&self) -> bool {
        self.at("takes_stated_noise");
        true
    }
}

struct Panics {
    own: Panicking,
    hyper: [Hyperparameter; 1],
    data: Measurements,
}

impl Likelihood for Panics {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, _: &[f64], _: &[f64]) -> f64 {
        self.own.at("log_likelihood");
        -1.0
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        self.own.at("gradient");
        (vec![0.0; response.len()], vec![0.0; hyper.len()])
    }

    fn predictive(&self, response: &[f64], _: &[f64]) -> Vec<VariancePart> {
        self.own.at("predictive");
        vec![VariancePart { origin: "discrepancy".into(), variance: vec![1.0; response.len()] }]
    }

    fn simulate(&self, _: &[f64], _: &[f64], _: &Stream) -> Vec<Measurements> {
        self.own.at("simulate");
        vec![self.data.clone()]
    }
}

impl Drop for Panics {
    fn drop(&mut self) {
        self.own.at("drop");
    }
}

impl Sampler for Panicking {
    fn plan(&self, _: usize) -> Plan {
        self.at("plan");
        Plan { chains: 2, steps: 5, warm_up: 0, ensemble: false }
    }

    fn uses_starts(&self) -> bool {
        self.at("uses_starts");
        false
    }

    fn start_where(&self) -> Start {
        self.at("start_where");
        Start::Prior
    }

    fn steps_are_draws(&self) -> bool {
        self.at("steps_are_draws");
        true
    }

    fn statistics(&self, _: &State) -> Vec<Statistic> {
        self.at("statistics");
        Vec::new()
    }

    fn start(&self, target: &dyn Target, points: Matrix) -> Result<State, Stop> {
        self.at("start");
        let (log_density, accepted) = (target.log_density(&points), vec![true; points.rows()]);
        Ok(State { points, log_density, accepted, evaluations: 2, memory: 1.into() })
    }

    fn step(&self, target: &dyn Target, state: &mut State, _: &Stream) -> Result<(), Stop> {
        self.at("step");
        state.log_density = target.log_density(&state.points);
        Ok(())
    }
}
