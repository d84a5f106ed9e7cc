//! Results of each plugin for a small task.

mod options;

use std::collections::BTreeMap;
use std::path::Path;

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::amend::State;
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known};
use lacuna::plugin::effect::Situation;
use lacuna::plugin::model::Call;
use lacuna::plugin::quantity::{Arguments, Curve, Number};
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::reliability::LimitState;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::term::{Place, Time};
use lacuna::plugin::{
    Context, Density, Design, Discrepancy, Effect, Given, Model, Quantity, Reader, Reliability,
    Sampler, Surrogate, Target, Term,
};
use lacuna::run::{Progress, Silent, Stop};
use lacuna_linalg::Matrix;

use super::{Bits, Made};
use options::OPTIONS;

/// Plugins that compute nothing themselves, or call other programs, so that their results are not their own.
const OTHERS: [&str; 3] = ["model.external", "model.python", "model.um_bridge"];

/// Each plugin of the program with its revision and the hash of its results.
pub fn all() -> BTreeMap<String, Made> {
    let mut found = BTreeMap::new();
    add::<dyn Design>(&mut found, design);
    add::<dyn Discrepancy>(&mut found, discrepancy);
    add::<dyn Effect>(&mut found, effect);
    add::<dyn Model>(&mut found, model);
    add::<dyn Quantity>(&mut found, quantity);
    add::<dyn Reader>(&mut found, reader);
    add::<dyn Reliability>(&mut found, reliability);
    add::<dyn Sampler>(&mut found, sampler);
    add::<dyn Surrogate>(&mut found, surrogate);
    add::<dyn Density>(&mut found, target);
    add::<dyn Term>(&mut found, term);
    // An executor moves runs and computes nothing.
    let kinds: Vec<&str> = registry::kinds().iter().map(|kind| kind.name).collect();
    let known = ["design", "discrepancy", "effect", "executor", "model", "quantity", "reader"];
    let others = ["reliability", "sampler", "surrogate", "target", "term"];
    assert_eq!(kinds, [&known[..], &others].concat());
    found
}

fn add<K: Kind + ?Sized>(found: &mut BTreeMap<String, Made>, compute: fn(&str, &K, &mut Bits)) {
    for entry in registry::entries::<K>() {
        let name = entry.full_name();
        if OTHERS.contains(&&*name) {
            continue;
        }
        let options = OPTIONS.iter().find(|(plugin, _)| *plugin == name).map_or("", |(_, o)| o);
        let built = registry::from_text::<K>(entry.name, options).unwrap_or_else(|error| {
            panic!("{error}\ngive `{name}` options in revisions/artifacts.rs")
        });
        let mut bits = Bits::default();
        compute(entry.name, &built.plugin, &mut bits);
        found.insert(name, Made { revision: entry.revision, hash: bits.hash() });
    }
}

fn parameters() -> Vec<Parameter> {
    ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 2.0]))).to_vec()
}

fn layout() -> Layout {
    let times = (1..=8).map(f64::from).collect();
    Layout {
        name: "y".into(),
        unit: Unit::dimensionless(),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    }
}

fn response(shift: f64) -> Vec<f64> {
    (0..16).map(|i| 1.5 + shift + (0.7 * f64::from(i)).sin()).collect()
}

fn design(_: &str, design: &dyn Design, bits: &mut Bits) {
    let stream = Stream::root(1);
    bits.matrix(&design.points(25, 2, &stream).unwrap());
    bits.matrix(&design.place(&parameters(), 25, &stream).unwrap());
}

fn discrepancy(_: &str, discrepancy: &dyn Discrepancy, bits: &mut Bits) {
    let replicate = |r: usize| {
        let mut rng = Stream::root(7).at(r as u64).generator();
        let values = response(0.0).iter().map(|y| Some(y + 0.2 * normal(&mut rng))).collect();
        Replicate::new(format!("p{r}"), values)
    };
    let data = Measurements::new(layout(), (0..4).map(replicate).collect());
    let mut rng = Stream::root(8).generator();
    let factor = Matrix::from_fn(16, 2, |_, _| 0.05 * normal(&mut rng));
    let common =
        [CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }];
    let slopes = || Ok(Matrix::from_fn(16, 2, |i, j| (0.3 * i as f64 + j as f64).cos()));
    let parameters = parameters();
    let known = Known { data: &data, common: &common, slopes: &slopes, parameters: &parameters };
    let likelihood = discrepancy.likelihood(&known).unwrap();
    let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|h| h.start).collect();
    let y = response(0.05);
    bits.add(&[likelihood.log_likelihood(&y, &hyper)]);
    let (by_response, by_hyper) = likelihood.gradient(&y, &hyper);
    bits.add(&by_response);
    bits.add(&by_hyper);
    likelihood.predictive(&y, &hyper).iter().for_each(|part| bits.add(&part.variance));
    for made in likelihood.simulate(&y, &hyper, &Stream::root(3)) {
        made.replicates
            .iter()
            .for_each(|r| bits.add(&r.values.iter().flatten().copied().collect::<Vec<_>>()));
    }
}

fn effect(_: &str, effect: &dyn Effect, bits: &mut Bits) {
    let (layout, y) = (layout(), response(0.0));
    let (layouts, noise) = (layout.clone().into(), vec![0.1; 16]);
    let situation = Situation { layouts: &layouts, response: &y, noise: &noise };
    for values in effect.starts(&layout, &situation).iter().take(5) {
        bits.add(values);
        bits.add(&effect.apply(&layout, &y, values));
        bits.matrix(&effect.by_parameters(&layout, &y, values));
    }
}

fn model(_: &str, model: &dyn Model, bits: &mut Bits) {
    let parameters = parameters();
    let given: Vec<Given> = parameters
        .iter()
        .map(|p| Given { name: p.name.clone(), unit: Some(p.unit.clone()) })
        .collect();
    let scenario = Scenario::default();
    let times = (1..=5).map(f64::from).collect();
    let axes = vec![Axis::grid("time", times, Unit::parse("s").unwrap())];
    let layout = Layout { name: "y".into(), unit: Unit::dimensionless(), axes };
    let context = Context {
        given: &given,
        scenarios: std::slice::from_ref(&scenario),
        ..Context::new(Path::new("."), &parameters, &layout)
    };
    let signature = model.signature(&context);
    let names: Vec<String> = signature.inputs.iter().map(|input| input.name.clone()).collect();
    let units: Vec<Unit> = signature.inputs.iter().map(|input| input.unit.clone()).collect();
    let inputs: Vec<f64> = signature.inputs.iter().map(|i| i.default.unwrap_or(0.7)).collect();
    let call = Call { units: &units, ..Call::new(&inputs, &names, &signature.layout, &scenario) };
    bits.add(&model.predict(&call).unwrap().values);
}

fn quantity(_: &str, quantity: &dyn Quantity, bits: &mut Bits) {
    let seconds = Unit::parse("s").unwrap();
    let (grid, unit): (Vec<f64>, _) = ((1..=16).map(f64::from).collect(), Unit::dimensionless());
    let curve = Curve { name: "y", unit: &unit, axis: "time", grid: &grid, grid_unit: &seconds };
    let numbers = ["a", "b"].map(|name| Number { name, unit: Some(&unit) });
    let of_curve = quantity.of_curve();
    let arguments = if of_curve { Arguments::Curve(curve) } else { Arguments::Numbers(&numbers) };
    let functional = quantity.bind(&arguments).unwrap();
    let values = response(0.0);
    let count = if of_curve { values.len() } else { 2 };
    bits.add(&[functional.value(&values[..count])]);
    bits.text(functional.unit().as_str());
}

fn reader(name: &str, reader: &dyn Reader, bits: &mut Bits) {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let file = match name {
        "csv" => "base.csv",
        "netcdf" => "hist_nc4.h",
        "tdms" => "records.tdms",
        _ => "hist_cdf5.h",
    };
    // The contents of a file; the numbers read for a study are covered by the read stage.
    let said = match reader.inspect(&samples.join(file)) {
        Ok(contents) => format!("{contents:?}"),
        Err(error) => error.to_string(),
    };
    bits.text(&said.replace(&samples.display().to_string(), ""));
}

/// A curved limit at a distance of 2.5 from the origin.
struct Curved;

impl LimitState for Curved {
    fn dimension(&self) -> usize {
        2
    }
    fn values(&self, points: &Matrix) -> Result<Vec<f64>, Stop> {
        Ok(points.iter_rows().map(|u| 2.5 - u[0] + 0.1 * (u[1] - 0.5).powi(2)).collect())
    }
}

fn reliability(_: &str, method: &dyn Reliability, bits: &mut Bits) {
    let progress = Progress::new(&Silent);
    let found = method.estimate(&Curved, &Stream::root(4), &progress).unwrap();
    bits.add(&[found.probability]);
    found.interval.iter().for_each(|interval| bits.add(interval));
    found.design_points.iter().for_each(|place| bits.add(&place.point));
}

/// Two correlated coordinates and a third one between bounds.
struct Three;

impl Target for Three {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| self.gradient(x).0).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        let inside = |x: &[f64]| (0.0..=1.0).contains(&x[2]);
        let density = |x: &[f64]| {
            if inside(x) { -(x[0] * x[0] + x[1] * x[1]) / 50.0 } else { f64::NEG_INFINITY }
        };
        points.iter_rows().map(density).collect()
    }
    fn gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        if !(0.0..=1.0).contains(&x[2]) {
            return (f64::NEG_INFINITY, vec![0.0; 3]);
        }
        let (u, v) = (x[0] - 1.0, x[1] - 0.5 * x[0]);
        let value = -0.5 * (u * u + 4.0 * v * v) - 2.0 * x[2] - (x[0] * x[0] + x[1] * x[1]) / 50.0;
        let slope = vec![-u + 2.0 * v - x[0] / 25.0, -4.0 * v - x[1] / 25.0, -2.0];
        (value, slope)
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        vec![free, free, (0.0, 1.0)]
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        let uniform = Distribution::Uniform([0.0, 1.0]);
        Matrix::from_fn(count, 3, |_, j| {
            if j < 2 { 5.0 * normal(&mut rng) } else { uniform.sample(&mut rng) }
        })
    }
}

fn sampler(_: &str, sampler: &dyn Sampler, bits: &mut Bits) {
    const FEW: usize = 40;
    let (plan, root) = (sampler.plan(3), Stream::root(5));
    let points = Three.prior_draws(plan.chains, &root.named("start"));
    let mut state = sampler.start(&Three, points).unwrap();
    let harvests = !matches!(sampler.harvest(&Three, &state, &root), Ok(None));
    let steps = if harvests { plan.steps } else { plan.steps.min(plan.warm_up + FEW) };
    for step in 0..steps {
        if sampler.finished(&state) {
            break;
        }
        sampler.step(&Three, &mut state, &root.named("step").at(step as u64)).unwrap();
    }
    bits.matrix(&state.points);
    bits.add(&state.log_density);
    if let Ok(Some(harvest)) = sampler.harvest(&Three, &state, &root.named("harvest")) {
        bits.matrix(&harvest.points);
        bits.add(&[harvest.effective_size]);
        harvest.evidence.iter().for_each(|evidence| bits.add(&[evidence.log, evidence.error]));
    }
}

fn surrogate(_: &str, surrogate: &dyn Surrogate, bits: &mut Bits) {
    let parameters = parameters();
    let mut rng = Stream::root(9).generator();
    let law = Distribution::Uniform([0.0, 2.0]);
    let points = Matrix::from_fn(30, 2, |_, _| law.sample(&mut rng));
    let answer = |x: &[f64]| -> Vec<f64> {
        (0..16).map(|i| (x[0] + 0.1 * f64::from(i)).sin() * (1.0 + 0.3 * x[1])).collect()
    };
    let responses = Matrix::from_rows(16, points.iter_rows().map(answer));
    let layouts = layout().into();
    let training = Training {
        parameters: &parameters,
        layouts: &layouts,
        points: &points,
        responses: &responses,
        gradients: None,
    };
    let emulator = surrogate.fit(&training, &Stream::root(2), &Progress::new(&Silent)).unwrap();
    let new = Matrix::from_rows(2, [[0.3, 1.7], [1.0, 1.0], [1.9, 0.1]]);
    bits.matrix(&emulator.mean(&new));
    emulator.variance(&new).iter().for_each(|variance| bits.matrix(variance));
    bits.matrix(&emulator.jacobian(&[0.8, 1.2]));
    bits.add(&emulator.fit_error().relative);
}

fn target(_: &str, target: &dyn Density, bits: &mut Bits) {
    let bound = target.bind(&parameters()).unwrap();
    bits.add(&bound.log_density(&Matrix::from_rows(2, [[0.3, 1.7], [1.0, 1.0]])));
    let (value, slope) = bound.gradient(&[0.8, 1.2]);
    bits.add(&[value]);
    bits.add(&slope);
}

/// A term is text until a model of equations uses it.
fn term(_: &str, term: &dyn Term, bits: &mut Bits) {
    let unit = |text: &str| Unit::parse(text).unwrap();
    let state = State {
        name: "v".into(),
        unit: unit("m/s"),
        rate_unit: Some(unit("m/s2")),
        rate: "-v".into(),
        uses: vec!["v".into()],
        start: "1".into(),
        ..State::default()
    };
    let seconds = unit("s");
    let time = Time { name: "t", unit: &seconds, duration: 10.0, step: 0.1 };
    let place = Place { state: &state, name: "c", time: Some(time), size: &|_| Ok(0.5) };
    bits.text(&format!("{:?}", term.summand(&place)));
}
