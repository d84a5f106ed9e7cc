//! A small mercury target: ten gauges, a polynomial chaos in place of the model, and truths on a finer mesh with physics
//! that the model does not have.

use std::sync::{Arc, OnceLock};

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Unit};
use lacuna::gap::candidates::{Candidate, proposed};
use lacuna::gap::common::shared;
use lacuna::gap::experiment::Experiment;
use lacuna::gap::name::{Found, Options, Verdict, search, verdict};
use lacuna::gap::noise::Noise;
use lacuna::gap::whitener::condensed;
use lacuna::gap::wide::{Freed, Switched, Wide};
use lacuna::linalg::Matrix;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::CommonError;
use lacuna::plugin::effect::{Description, Situation};
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Design, Emulator, Forward, Surrogate, registry};
use lacuna::run::{Progress, Silent};
use lacuna_plugins::models::mercury_target::{
    Cells, Gas, Mercury, Sampling, Settings, Target as Vessel,
};
use rayon::prelude::*;

fn env(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default)
}

fn cells(k: usize) -> [usize; 2] {
    [10 * k, 45 * k]
}

const SENSORS: [(&str, f64); 10] = [
    ("B", 16.0),
    ("C", 26.0),
    ("G", 7.0),
    ("M", 6.0),
    ("R", 14.0),
    ("T", 15.0),
    ("U", 28.0),
    ("V", 13.0),
    ("Y", 14.0),
    ("Z", 12.0),
];

/// Parameters, then what the study holds fixed: name, absent value, prior.
fn unknowns() -> Vec<(&'static str, f64, Distribution)> {
    use Distribution::Uniform;
    vec![
        ("tensile_cutoff", 1.5e5, Uniform([0.0, 5e5])),
        ("density", 13_500.0, Uniform([10_000.0, 13_600.0])),
        ("sound_speed", 1456.0, Uniform([800.0, 1800.0])),
        ("void_fraction", 0.0, Uniform([0.0, 4e-4])),
        ("void_gradient", 0.0, Uniform([-0.8, 0.8])),
        ("void_depletion", 0.0, Uniform([0.0, 0.9])),
        ("damping", 0.0, Uniform([0.0, 600.0])),
        ("pulse_energy", 1.0, Distribution::TruncatedNormal([1.0, 0.05, 0.8, 1.2])),
        ("beam_width", 0.032, Distribution::TruncatedNormal([0.032, 0.002, 0.026, 0.038])),
        ("wall_thickness", 1.0, Distribution::TruncatedNormal([1.0, 0.05, 0.85, 1.15])),
    ]
}

fn parameter((name, _, prior): &(&'static str, f64, Distribution)) -> Parameter {
    let design = match prior {
        Distribution::TruncatedNormal([_, _, a, b]) => Distribution::Uniform([*a, *b]),
        other => other.clone(),
    };
    Parameter {
        name: (*name).into(),
        symbol: (*name).into(),
        unit: Unit::dimensionless(),
        design,
        prior: prior.clone(),
        reference: None,
    }
}

fn layouts() -> Layouts {
    let seconds = Unit::parse("s").unwrap();
    let times = (1..=100).map(|i| f64::from(i) * 1e-5).collect();
    let axes = vec![
        Axis::labels("sensor", SENSORS.map(|(name, _)| name)),
        Axis::grid("time", times, seconds),
    ];
    Layout { name: "strain".into(), unit: Unit::parse("microstrain").unwrap_or_default(), axes }
        .into()
}

fn settings(mesh: [usize; 2]) -> Settings {
    let mut settings = Settings::default();
    settings.numerics.mesh = Cells::Explicit(mesh);
    settings.sampling = Sampling { interval: 1e-5, count: 100 };
    settings
}

fn in_order(settings: &Settings, strain: &[Vec<f64>]) -> Vec<f64> {
    let row = |name: &str| settings.gauges.0.iter().position(|g| g.name == name).unwrap();
    SENSORS.iter().flat_map(|(name, _)| strain[row(name)].iter().map(|y| 1e6 * y)).collect()
}

/// The model: parameters and, after them, what is free beside.
fn model(mesh: [usize; 2], x: &[f64]) -> Vec<f64> {
    let mut settings = settings(mesh);
    let mercury = Mercury { tensile_cutoff: x[0], density: x[1], sound_speed: x[2] };
    let mut gas = Gas { void_fraction: 0.0, bubble_radius: 0.0, ..Gas::default() };
    if x.len() > 3 {
        (gas.void_fraction, gas.gradient, gas.depletion) = (x[3], x[4], x[5]);
        settings.damping = x[6];
        settings.pulse.peak_pressure *= x[7];
        settings.pulse.wall_strain *= x[7];
        settings.pulse.width = x[8];
        settings.wall.cap_thickness *= x[9];
        settings.wall.cylinder_thickness *= x[9];
    }
    let vessel = Vessel::new(&settings).unwrap();
    let outcome = if gas.void_fraction > 0.0 {
        vessel.simulate_with_gas(&mercury, &gas)
    } else {
        vessel.simulate(&mercury)
    };
    in_order(&settings, &outcome.unwrap().strain)
}

fn design(parameters: &[Parameter], runs: usize, seed: u64) -> Matrix {
    let design = registry::from_text::<dyn Design>("latin_hypercube", "").unwrap().plugin;
    let unit = design.points(runs, parameters.len(), &Stream::root(seed)).unwrap();
    Matrix::from_fn(runs, parameters.len(), |i, j| parameters[j].design.quantile(unit[(i, j)]))
}

fn simulated(mesh: [usize; 2], points: &Matrix) -> Matrix {
    let rows: Vec<Vec<f64>> =
        (0..points.rows()).into_par_iter().map(|i| model(mesh, points.row(i))).collect();
    Matrix::from_rows(1000, rows)
}

fn fitted(
    parameters: &[Parameter],
    points: &Matrix,
    responses: &Matrix,
    options: &str,
) -> Box<dyn Emulator> {
    let layouts = layouts();
    let surrogate = registry::from_text::<dyn Surrogate>("polynomial_chaos", options).unwrap();
    let training = Training { parameters, layouts: &layouts, points, responses };
    surrogate.plugin.fit(&training, &Stream::root(2), &Progress::new(&Silent)).unwrap()
}

fn error_of(origin: &str, samples: &Matrix) -> CommonError {
    let scale = (samples.rows() as f64).sqrt();
    let factor = Matrix::from_fn(samples.columns(), samples.rows(), |i, r| samples[(r, i)] / scale);
    CommonError { origin: origin.into(), factor, predictive: true }
}

/// `base(x) + change(x, s) - change(x, absent)`.
struct Widened {
    base: Box<dyn Emulator>,
    change: Box<dyn Emulator>,
    absent: Vec<f64>,
}

impl Forward for Widened {
    fn dimension(&self) -> usize {
        self.change.dimension()
    }
    fn outputs(&self) -> usize {
        1000
    }
    fn mean(&self, points: &Matrix) -> Matrix {
        let own: Vec<usize> = (0..3).collect();
        let absent = points.iter_rows().map(|p| [&p[..3], &self.absent[..]].concat());
        let absent = self.change.mean(&Matrix::from_rows(points.columns(), absent));
        let mut all = self.base.mean(&points.select_columns(&own));
        let change = self.change.mean(points);
        for ((y, a), b) in
            all.as_mut_slice().iter_mut().zip(change.as_slice()).zip(absent.as_slice())
        {
            *y += a - b;
        }
        all
    }
    fn jacobian(&self, point: &[f64]) -> Matrix {
        let mut all = self.change.jacobian(point);
        let absent = self.change.jacobian(&[&point[..3], &self.absent[..]].concat());
        let base = self.base.jacobian(&point[..3]);
        for i in 0..1000 {
            for j in 0..3 {
                all[(i, j)] += base[(i, j)] - absent[(i, j)];
            }
        }
        all
    }
}

struct Lab {
    parameters: Vec<Parameter>,
    base: Box<dyn Emulator>,
    wide: Wide<'static>,
    common: Vec<CommonError>,
}

fn rms(m: &Matrix) -> f64 {
    (m.as_slice().iter().map(|x| x * x).sum::<f64>() / m.as_slice().len() as f64).sqrt()
}

fn lab() -> &'static Lab {
    static MADE: OnceLock<Lab> = OnceLock::new();
    MADE.get_or_init(|| {
        let k = env("LACUNA_TARGET_MESH", 1);
        let (runs, wide_runs, finer) = (
            env("LACUNA_TARGET_RUNS", 150),
            env("LACUNA_TARGET_WIDE", 400),
            env("LACUNA_TARGET_FINER", 20),
        );
        let all = unknowns();
        let everything: Vec<Parameter> = all.iter().map(parameter).collect();
        let parameters = everything[..3].to_vec();
        let clock = std::time::Instant::now();
        let points = design(&parameters, runs, 1);
        let responses = simulated(cells(k), &points);
        let base = fitted(&parameters, &points, &responses, "degree = { max = 14 }");
        let residuals = base.fit_error().residuals.clone();
        println!(
            "base {:.1} s, leave-one-out {:.2}",
            clock.elapsed().as_secs_f64(),
            rms(&residuals)
        );
        let some: Vec<usize> = (0..finer).collect();
        let fine = simulated(cells(2 * k), &points.select_rows(&some));
        let whole = 1.0 / (1.0 - 2.0_f64.powf(-1.8));
        let difference =
            Matrix::from_fn(finer, 1000, |i, j| whole * (fine[(i, j)] - responses[(i, j)]));
        println!("mesh {:.1} s, {:.2}", clock.elapsed().as_secs_f64(), rms(&difference));
        let points = design(&everything, wide_runs, 3);
        let own: Vec<usize> = (0..3).collect();
        let mut changes = simulated(cells(k), &points);
        let at = base.mean(&points.select_columns(&own));
        changes.as_mut_slice().iter_mut().zip(at.as_slice()).for_each(|(y, b)| *y -= b);
        println!("wide runs {:.1} s", clock.elapsed().as_secs_f64());
        let change = fitted(&everything, &points, &changes, "degree = { max = 6 }\nq_norm = 0.7");
        let wide_residuals = change.fit_error().residuals.clone();
        println!(
            "wide {:.1} s, {:.2} of {:.2}",
            clock.elapsed().as_secs_f64(),
            rms(&wide_residuals),
            rms(&changes)
        );
        let freed = |(name, absent, prior): &(&str, f64, Distribution)| {
            Freed::new(name, Unit::dimensionless(), *absent, prior.clone())
        };
        let absent = all[3..].iter().map(|(_, absent, _)| *absent).collect();
        let again =
            fitted(&parameters, &design(&parameters, runs, 1), &responses, "degree = { max = 14 }");
        let wide = Wide {
            forward: Box::new(Widened { base: again, change, absent }),
            inputs: all[3..].iter().map(freed).collect(),
            common: vec![error_of("wide", &wide_residuals)],
        };
        let common = vec![error_of("emulator", &residuals), error_of("numerics", &difference)];
        Lab { parameters, base, wide, common }
    })
}

fn switches(wide: &Wide<'_>) -> Vec<Candidate> {
    let one = |(i, input): (usize, &Freed)| Candidate {
        kind: input.name.clone(),
        plugin: input.name.clone(),
        options: toml::Table::new(),
        effect: Arc::new(Switched {
            places: vec![i],
            inputs: vec![input.clone()],
            description: Description {
                title: input.name.clone(),
                formula: String::new(),
                source: String::new(),
            },
        }),
    };
    wide.inputs.iter().enumerate().map(one).collect()
}

/// Replicates of a truth: gains, offsets and noise with memory.
fn measured(truth: &[f64], count: u64, seed: u64) -> Measurements {
    let root = Stream::root(seed);
    let replicate = |r: u64| {
        let mut rng = root.at(r).generator();
        let common = 0.015 * normal(&mut rng);
        let mut values = Vec::new();
        for (g, (_, sd)) in SENSORS.iter().enumerate() {
            let gain = 1.0 + common + 0.015 * normal(&mut rng);
            let offset = 2.0 * normal(&mut rng);
            let mut noise = normal(&mut rng);
            for y in &truth[100 * g..100 * (g + 1)] {
                values.push(Some(gain * y + offset + sd * noise));
                noise = 0.4 * noise + 0.84_f64.sqrt() * normal(&mut rng);
            }
        }
        Replicate { name: r.to_string(), values }
    };
    Measurements {
        layout: layouts().blocks[0].clone(),
        replicates: (0..count).map(replicate).collect(),
    }
}

fn ask(truth: &[f64], seed: u64) -> Verdict {
    let lab = lab();
    let layouts = layouts();
    let clock = std::time::Instant::now();
    let data = measured(truth, 12, seed).into();
    let mut experiment = Experiment::new(&layouts, &lab.parameters, &*lab.base, &data);
    experiment.wide = Some(&lab.wide);
    let starts = vec![vec![1.5e5, 13_000.0, 1400.0], vec![1.0e5, 12_000.0, 1100.0]];
    let response = lab.base.mean(&Matrix::from_rows(3, [&starts[0]])).row(0).to_vec();
    let noise = Noise::of(&experiment, &response, None);
    let samples = [&lab.common[..], &lab.wide.common].concat();
    let all = shared(&experiment, &noise, &response, &samples);
    (experiment.common, experiment.remainder) = (all.common, all.remainder);
    let sd = noise.sd(&experiment, &response);
    let situation = Situation { layouts: &layouts, response: &response, noise: &sd };
    let mut candidates = proposed(None, &situation).unwrap();
    candidates.extend(switches(&lab.wide));
    let options = Options { naming: 0.03, unlisted: 0.02, simulations: 99, most: 3 };
    let found: Found<'_> =
        search(&experiment, &candidates, &starts, options, &Stream::root(seed)).unwrap();
    for step in &found.path {
        println!(
            "  p {:?} energy {:.0} expected {:.0} at {:.5?} sd {:.3?}",
            step.before.p,
            step.before.statistics.energy,
            step.before.expected_energy,
            step.before.fit.at.point,
            step.before.fit.sd()
        );
        for j in step.judged.iter().take(12) {
            let n = j.fit.at.point.len();
            println!(
                "     {} {:?} score {:.1} absorbed {:.2} weight {:.1} at {:.4?}",
                candidates[j.suspect.candidate].kind,
                j.suspect.on.values().next(),
                j.score,
                j.absorbed,
                j.log_weight,
                &j.fit.at.point[..n]
            );
        }
        println!(
            "  added {:?} dropped {:?}",
            step.added.iter().map(|s| (&candidates[s.candidate].kind, &s.on)).collect::<Vec<_>>(),
            step.dropped
        );
    }
    let v = verdict(&found, &candidates, options);
    println!(
        "  last p {:?} energy {:.0} expected {:.0} at {:.5?} sd {:.3?}",
        found.last.p,
        found.last.statistics.energy,
        found.last.expected_energy,
        found.last.fit.at.point,
        found.last.fit.sd()
    );
    println!("  types {:?}", found.types);
    println!("  consistency {} stability {}", found.consistency, found.stability);
    println!(
        "  verdict {:?} {:?} closed {:.3} {:?} in {:.1} s",
        v.word,
        v.effects.iter().map(|e| (&e.name, &e.class, &e.values, &e.sd)).collect::<Vec<_>>(),
        v.closed,
        v.reasons,
        clock.elapsed().as_secs_f64()
    );
    v
}

fn truth(gas: Option<Gas>, change: impl FnOnce(&mut Settings)) -> Vec<f64> {
    let mut settings = settings(cells(3 * env("LACUNA_TARGET_MESH", 1)));
    change(&mut settings);
    let mercury = Mercury { density: 13_350.0, sound_speed: 1440.0, tensile_cutoff: 1.5e5 };
    let vessel = Vessel::new(&settings).unwrap();
    let outcome = match gas {
        Some(gas) => vessel.simulate_with_gas(&mercury, &gas),
        None => vessel.simulate(&mercury),
    };
    in_order(&settings, &outcome.unwrap().strain)
}

#[test]
fn gas_is_named() {
    let gas = Gas {
        void_fraction: 2e-4,
        gradient: 0.5,
        depletion: 0.4,
        bubble_radius: 8e-5,
        ..Gas::default()
    };
    ask(&truth(Some(gas), |_| ()), 5);
}

#[test]
fn nothing() {
    ask(&truth(None, |_| ()), 6);
}

use lacuna::gap::fit::fit_from;
use lacuna::gap::locate::Projection;
use lacuna::gap::system::System;
use lacuna::gap::whitener::Whitener;

#[test]
fn energies() {
    let k = env("LACUNA_TARGET_MESH", 1);
    let all = unknowns();
    let everything: Vec<Parameter> = all.iter().map(parameter).collect();
    let parameters = everything[..3].to_vec();
    let points = design(&parameters, 150, 1);
    let responses = simulated(cells(k), &points);
    let base = fitted(&parameters, &points, &responses, "degree = { max = 14 }");
    let residuals = base.fit_error().residuals.clone();
    let some: Vec<usize> = (0..150).collect();
    let fine = simulated(cells(2 * k), &points.select_rows(&some));
    let whole = 1.0 / (1.0 - 2.0_f64.powf(-1.8));
    let difference = Matrix::from_fn(150, 1000, |i, j| whole * (fine[(i, j)] - responses[(i, j)]));
    println!("loo {:.2} mesh {:.2}", rms(&residuals), rms(&difference));
    let mut truths = design(&parameters, 16, 77);
    for i in 0..16 {
        truths[(i, 0)] = 5e4 + 0.5 * truths[(i, 0)];
        truths[(i, 1)] = 0.5 * (13_300.0 + truths[(i, 1)]);
        truths[(i, 2)] = 0.5 * (1400.0 + truths[(i, 2)]);
    }
    let same = simulated(cells(k), &truths);
    let finer = simulated(cells(3 * k), &truths);
    let lay = layouts();
    let energy = |truth: &[f64],
                  at: &[f64],
                  common: &[CommonError],
                  seed: u64,
                  shrink: bool|
     -> (f64, f64) {
        let data = measured(truth, 12, seed).into();
        let mut experiment = Experiment::new(&lay, &parameters, &*base, &data);
        experiment.common = common.to_vec();
        let response = base.mean(&Matrix::from_rows(3, [at])).row(0).to_vec();
        let noise = Noise::of(&experiment, &response, None);
        if shrink {
            let all = shared(&experiment, &noise, &response, common);
            (experiment.common, experiment.remainder) = (all.common, all.remainder);
        } else {
            experiment.common = condensed(&experiment, &noise, &response);
        }
        let system = System::new(&experiment, Vec::new());
        let whitener = Whitener::new(&experiment, &noise, &response);
        let fit = fit_from(&system, &whitener, &experiment.means().1, &[at.to_vec()]).unwrap();
        let left = Projection::of(&system, &fit).rest(&fit.residual);
        let sd = fit.sd();
        let off: f64 =
            (0..3).map(|j| ((fit.at.point[j] - at[j]) / sd[j]).powi(2)).sum::<f64>() / 3.0;
        (left.iter().map(|x| x * x).sum::<f64>(), off)
    };
    let run = |name: &str, which: &Matrix, common: &[CommonError]| {
        for shrink in [false, true] {
            let e: Vec<(f64, f64)> = (0..16)
                .into_par_iter()
                .map(|i| energy(which.row(i), truths.row(i), common, i as u64, shrink))
                .collect();
            let mut v: Vec<f64> = e.iter().map(|x| x.0).collect();
            v.sort_by(f64::total_cmp);
            println!(
                "{name} {shrink}: mean {:.0} min {:.0} med {:.0} max {:.0}; param offsets {:.2}",
                v.iter().sum::<f64>() / 16.0,
                v[0],
                v[8],
                v[15],
                e.iter().map(|x| x.1).sum::<f64>() / 16.0
            );
        }
    };
    let em = error_of("emulator", &residuals);
    let rows = |n: usize| difference.select_rows(&(0..n).collect::<Vec<_>>());
    run("same mesh, no error", &same, &[]);
    run("same mesh, emulator", &same, &[em.clone()]);
    run("finer, emulator", &finer, &[em.clone()]);
    for n in [20, 40, 80, 150] {
        run(&format!("finer, mesh {n}"), &finer, &[em.clone(), error_of("numerics", &rows(n))]);
    }
}
