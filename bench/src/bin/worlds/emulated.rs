//! The workflow on worlds whose missing physics has no form in the library: a box of liquid, and a pipe.

use std::error::Error;
use std::fmt::Write;

use generator::world::{Found, Measured, Secret, World, measured};
use lacuna::data::{Axis, Layout, Layouts, Measurements, Observations, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin};
use lacuna::plugin::effect::Situation;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_engine::gap::candidates::proposed;
use lacuna_engine::gap::experiment::Experiment;
use lacuna_engine::gap::noise::{Noise, ResponseTangents};
use lacuna_engine::gap::search::{
    MissingEffect, ModelAverage, SearchOptions, Support, Traits, Verdict, search, verdict,
};
use lacuna_engine::gap::system::emulator_error::error_covariance;
use lacuna_linalg::Matrix;
use rayon::prelude::*;

use crate::{Told, Workflow};

/// The number of runs whose errors count.
const NEAR: usize = 80;

/// A world with its emulator.
pub struct Emulated<W> {
    pub world: W,
    pub name: &'static str,
    pub layouts: Layouts,
    pub parameters: Vec<Parameter>,
    pub emulator: Box<dyn Emulator>,
    pub error: CommonError,
}

/// The answer to a case.
struct Answer {
    pub measured: Measured,
    pub verdict: Verdict,
    pub p: [f64; 3],
    /// The energy of the gap before the search and after it.
    pub excess: [f64; 2],
    pub inexact: [f64; 2],
    /// The time of the answer, s, and that of all processors together, s.
    pub seconds: f64,
    pub processors: f64,
    pub supports: Vec<Support>,
    /// The types of each effect with their probabilities.
    pub types: Vec<Vec<(String, f64)>>,
    /// The probabilities of all types over the models that were compared.
    pub average: ModelAverage,
}

impl<W: World> Emulated<W> {
    /// The world with a polynomial chaos expansion of a table of `runs` runs over the ranges of its parameters.
    pub fn new(
        world: W,
        name: &'static str,
        runs: usize,
        degree: usize,
    ) -> Result<Self, Box<dyn Error>> {
        let seconds = Unit::parse("s")?;
        let axes = || {
            let labels = world.sensors();
            vec![Axis::labels("sensor", labels), Axis::grid("time", world.times(), seconds.clone())]
        };
        let layout = || Layout { name: "y".into(), unit: Unit::dimensionless(), axes: axes() };
        let layouts = if world.conditions() == 1 {
            Layouts::from(layout())
        } else {
            Layouts::of_scenarios(["first", "second"].map(|name| (name, layout())))
        };
        let parameters: Vec<Parameter> = world
            .parameters()
            .into_iter()
            .map(|(name, range, _)| Parameter {
                name: name.into(),
                symbol: name.into(),
                unit: Unit::dimensionless(),
                design: Distribution::Uniform(range),
                prior: Distribution::Uniform(range),
                reference: None,
            })
            .collect();
        let d = parameters.len();
        let design = registry::from_text::<dyn Design>("latin_hypercube", "")?.plugin;
        let unit = design.points(runs, d, &Stream::root(1))?;
        let points = Matrix::from_fn(runs, d, |i, j| parameters[j].design.quantile(unit[(i, j)]));
        let rows: Vec<&[f64]> = points.iter_rows().collect();
        let rows: Vec<Vec<f64>> = rows.into_par_iter().map(|p| world.response(p)).collect();
        let responses = Matrix::from_rows(layouts.len(), rows);
        let options = format!("degree = {{ max = {degree} }}");
        let surrogate = registry::from_text::<dyn Surrogate>("polynomial_chaos", &options)?;
        let training = Training {
            parameters: &parameters,
            layouts: &layouts,
            points: &points,
            responses: &responses,
            gradients: None,
        };
        let fitted = surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent));
        let emulator = fitted?;
        let residuals = &emulator.fit_error().residuals;
        // The errors where the data are: those of the runs nearest to the middle.
        let centre: Vec<f64> = world.parameters().iter().map(|p| p.2).collect();
        let far = |r: usize| -> f64 {
            let each = world.parameters().into_iter().enumerate();
            each.map(|(j, (_, [low, high], _))| {
                ((points[(r, j)] - centre[j]) / (high - low)).powi(2)
            })
            .sum()
        };
        let mut near: Vec<usize> = (0..runs).collect();
        near.sort_by(|a, b| far(*a).total_cmp(&far(*b)));
        near.truncate(NEAR);
        let scale = (NEAR as f64).sqrt();
        let factor = Matrix::from_fn(layouts.len(), NEAR, |i, k| residuals[(near[k], i)] / scale);
        let error =
            CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true };
        Ok(Self { world, name, layouts, parameters, emulator, error })
    }

    fn observations(&self, measured: &Measured) -> Observations {
        let count = measured.replicates[0].len();
        let replicate = |r: usize| {
            let values = measured.replicates.iter().flat_map(|c| c[r].iter().map(|y| Some(*y)));
            Replicate::new(r.to_string(), values.collect())
        };
        Measurements::new(self.layouts.blocks[0].clone(), (0..count).map(replicate).collect())
            .into()
    }

    fn answer(
        &self,
        seed: u64,
        secrets: &[Secret],
        ratio: f64,
        replicates: usize,
    ) -> Result<Answer, Box<dyn Error>> {
        let measured = measured(&self.world, seed, secrets, ratio, replicates);
        let begun = (std::time::Instant::now(), of_processors());
        let data = self.observations(&measured);
        let mut experiment =
            Experiment::new(&self.layouts, &self.parameters, &*self.emulator, &data);
        let centre: Vec<f64> = self.world.parameters().iter().map(|p| p.2).collect();
        let response = self.emulator.mean(&Matrix::from_rows(centre.len(), [&centre])).into_vec();
        let noise = Noise::of(&experiment, &ResponseTangents::fixed(&response), None);
        let errors = std::slice::from_ref(&self.error);
        let all = error_covariance(&experiment, &noise, &response, errors);
        (experiment.common, experiment.independent) = (all.common, all.independent);
        let sd = noise.sd(&experiment, &response);
        let situation = Situation { layouts: &self.layouts, response: &response, noise: &sd };
        let candidates = proposed(None, &[], &situation)?.candidates;
        let options = SearchOptions { naming: 0.03, unlisted: 0.02, simulations: 199, most: 3 };
        let stream = Stream::root(seed);
        let found = search(&experiment, &candidates, &[centre], options, &stream)
            .ok_or("the emulator has no response")?;
        let first = found.first();
        Ok(Answer {
            p: first.p,
            excess: [first.tolerant.gap, found.last.tolerant.gap],
            inexact: [first.tolerant.inexact, found.last.tolerant.inexact],
            verdict: verdict(&found, &candidates, options),
            supports: found.support.clone(),
            types: found.types.clone(),
            average: found.average.clone(),
            measured,
            seconds: begun.0.elapsed().as_secs_f64(),
            processors: of_processors() - begun.1,
        })
    }
}

impl<W: World> Workflow for Emulated<W> {
    type World = W;

    fn world(&self) -> &W {
        &self.world
    }

    fn name(&self) -> &'static str {
        self.name
    }

    fn ask(
        &self,
        seed: u64,
        secrets: &[Secret],
        ratio: f64,
        replicates: usize,
    ) -> Result<Told, Box<dyn Error>> {
        let answer = self.answer(seed, secrets, ratio, replicates)?;
        let (said, values) = (answer.said(&self.world, ratio), answer.values(&self.world, ratio));
        Ok(Told { said, values })
    }
}

/// The time of all processors that this process used, s; NaN where the system does not tell.
fn of_processors() -> f64 {
    let told = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in parentheses, may contain spaces; times are in hundredths of a second.
    let after = told.rsplit(") ").next().unwrap_or_default();
    let times = after.split(' ').skip(11).take(2).filter_map(|n| n.parse::<f64>().ok());
    let times: Vec<f64> = times.collect();
    if times.len() == 2 { times.iter().sum::<f64>() / 100.0 } else { f64::NAN }
}

/// The types in decreasing order of probability, with its logarithm.
fn ahead(types: &[(String, f64)]) -> String {
    let each = types.iter().take(3).map(|(kind, p)| format!("{kind} {:.1}", p.ln()));
    each.collect::<Vec<_>>().join(", ")
}

impl Answer {
    /// The case and its answer as values that are separated by tabs.
    fn values<W: World>(&self, world: &W, ratio: f64) -> String {
        let mut text = format!(
            "{}\t{ratio:.3}\t{:?}\t{:.3}\t{:.2}\t{:.1}",
            hidden(world, &self.measured.hidden, false),
            self.verdict.word,
            self.verdict.closed,
            self.inexact[1],
            self.seconds
        );
        self.verdict.effects.iter().for_each(|effect| text += &traits(effect));
        text
    }

    /// The case and its answer in a line.
    fn said<W: World>(&self, world: &W, ratio: f64) -> String {
        let mut text = format!(
            "rms {ratio} [{}] -> {:?} closed {:.2} p {:.2?} gap {:.0} to {:.0} inexact {:.1?} {:.1} s, {:.1} s of processors",
            hidden(world, &self.measured.hidden, true),
            self.verdict.word,
            self.verdict.closed,
            self.p,
            self.excess[0],
            self.excess[1],
            self.inexact,
            self.seconds,
            self.processors
        );
        for e in &self.verdict.effects {
            let _ = write!(text, "\n    {}", words(e));
        }
        for (support, types) in self.supports.iter().zip(&self.types) {
            let scores: Vec<String> = support
                .against_free_form
                .iter()
                .map(|c| {
                    format!("{:?} {:.0}±{:.0}", c.left_out, c.difference, c.error.unwrap_or(0.0))
                })
                .collect();
            let (share, local) = (support.share, support.local);
            let _ = write!(
                text,
                "\n    * share {share:.2} local {local:.2} {} | {}",
                scores.join(", "),
                ahead(types)
            );
        }
        let ModelAverage { models: [compared, inside], nothing, inclusion } = &self.average;
        let included = inclusion.iter().take(4).map(|i| format!("{} {:.3}", i.kind, i.probability));
        let included: Vec<String> = included.collect();
        let _ = write!(
            text,
            "\n    * {inside} of {compared} models: nothing {nothing:.3}, {}",
            included.join(", ")
        );
        for reason in &self.verdict.reasons {
            let _ = write!(text, "\n    - {reason}");
        }
        text
    }
}

/// An effect with its places, its probability and its values.
pub fn words(e: &MissingEffect) -> String {
    let places: Vec<String> = e.on.values().map(|labels| labels.join("+")).collect();
    let values: Vec<String> =
        e.values.iter().zip(&e.sd).map(|(x, sd)| format!("{x:.3e}±{sd:.1e}")).collect();
    let certain = if e.certain { ", certain" } else { "" };
    format!(
        "{} on {} P {:.2}{certain} ({})",
        e.class.join("/"),
        places.join(" "),
        e.probability,
        values.join(" ")
    )
}

/// The types of an effect with its places, and an exclamation mark if it is certain.
fn place(e: &MissingEffect) -> String {
    let on: Vec<String> = e.on.values().map(|labels| labels.join("+")).collect();
    let certain = if e.certain { "!" } else { "" };
    format!("{}@{}{certain}", e.class.join("/"), on.join(" "))
}

/// An effect with its share, its probability and the quantities from which that follows.
pub fn traits(e: &MissingEffect) -> String {
    let Traits { log_odds, local, transfer, closed, inexact } = e.traits.unwrap_or_default();
    format!(
        "\t{};{:.3};{:.2};{log_odds:.2} {local:.3} {transfer:.2} {closed:.3} {inexact:.2}",
        place(e),
        e.share,
        e.probability
    )
}

/// The hidden causes, with their sizes or without.
pub fn hidden<W: World>(world: &W, all: &[Found], sized: bool) -> String {
    let names = world.sensors();
    let each = all.iter().map(|found| {
        let cause = match &found.secret {
            Secret::Fault(kind, sensors) => {
                let on: Vec<&str> = sensors.iter().map(|&s| names[s]).collect();
                format!("{kind:?}@{}", on.join("+"))
            }
            Secret::Inside(i) => format!("inside:{}", world.changes()[*i].name),
        };
        if sized { format!("{cause} {:.3e}", found.size) } else { cause }
    });
    each.collect::<Vec<_>>().join(" & ")
}
