//! Coverage of calibrations through an emulator of few runs, including truths at the edges of the prior.
//!
//! Truths are drawn from the prior, and data are the model in closed form with independent noise; random numbers are
//! those of `SplitMix64` (Steele, Lea and Flood, OOPSLA 2014) and Box and Muller, so that no code of the engine makes
//! the data. The bounds are the nominal fraction less 2.58 standard errors of a binomial count over the truths.

use std::fmt::Write as _;

use lacuna::data::{Measurements, Observations, Replicate};
use lacuna::math::moments;
use lacuna::run::Silent;
use lacuna_engine::pipeline;
use lacuna_engine::stage::calibrate::{self, Parts};
use lacuna_engine::stage::inverse_problem::{InverseProblem, Route};
use lacuna_engine::study::resolve;
use lacuna_run::{RunDirectory, Stage};

struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Latin hypercube: three columns, each with one value in every one of `n` equal slices.
    fn latin(&mut self, n: usize) -> Vec<[f64; 3]> {
        let mut all = vec![[0.0; 3]; n];
        for k in 0..3 {
            let mut slices: Vec<usize> = (0..n).collect();
            for i in (1..n).rev() {
                slices.swap(i, (self.uniform() * (i + 1) as f64) as usize);
            }
            for (point, slice) in all.iter_mut().zip(slices) {
                point[k] = (slice as f64 + self.uniform()) / n as f64;
            }
        }
        all
    }
}

const OUTPUTS: usize = 30;

/// A front with unknown position, width and height.
fn front([a, b, c]: [f64; 3]) -> Vec<f64> {
    let (place, width, height) = (0.3 + 0.4 * a, 0.1 + 0.2 * b, 0.5 + c);
    let value = |t: f64| height * ((t - place) / width).tanh() + 0.5 * height * place * t;
    (0..OUTPUTS).map(|i| value(i as f64 / (OUTPUTS - 1) as f64)).collect()
}

/// A quadratic function of the parameters, which an expansion of degree two represents exactly.
fn quadratic([a, b, c]: [f64; 3]) -> Vec<f64> {
    let value = |t: f64| a + b * t + c * (6.0 * t).sin() + 0.3 * a * b * t * t - 0.2 * c * c;
    (0..OUTPUTS).map(|i| value(i as f64 / (OUTPUTS - 1) as f64)).collect()
}

/// Counts over calibrations: for each parameter, whether the 50, 90 and 95 % intervals contain it, and its standard
/// deviation.
struct Found {
    held: [Vec<bool>; 3],
    widths: Vec<f64>,
}

fn calibrations(
    model: fn([f64; 3]) -> Vec<f64>,
    surrogate: &str,
    further: &str,
    truths: usize,
    seed: u64,
) -> Found {
    let sd = 0.02;
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(seed);
    let mut points = "run,p0,p1,p2\n".to_owned();
    let mut responses = "run,t [1],y [1]\n".to_owned();
    for (i, [a, b, c]) in random.latin(24).into_iter().enumerate() {
        writeln!(points, "r{i},{a:e},{b:e},{c:e}").unwrap();
        for (j, y) in model([a, b, c]).iter().enumerate() {
            writeln!(responses, "r{i},{j},{y:e}").unwrap();
        }
    }
    let mut measured = "replicate,t [1],y [1]\n".to_owned();
    for (j, y) in model([0.5; 3]).iter().enumerate() {
        writeln!(measured, "1,{j},{y:e}").unwrap();
    }
    for (name, text) in [("runs", points), ("responses", responses), ("measured", measured)] {
        std::fs::write(folder.path().join(format!("{name}.csv")), text).unwrap();
    }
    let mut text = "[study]\ntitle = \"Emulated\"\n".to_owned();
    for k in 0..3 {
        write!(text, "[[parameter]]\nname = \"p{k}\"\nprior = {{ uniform = [0.0, 1.0] }}\n")
            .unwrap();
    }
    let times: Vec<String> = (0..OUTPUTS).map(|i| format!("{i}.0")).collect();
    write!(
        text,
        "[response]\nname = \"y\"\nunit = \"1\"\n[response.axes]\nt = {{ values = [{}], unit = \"1\" }}\n\
         [simulations]\nuse = \"csv\"\nparameters = \"runs.csv\"\nresponses = \"responses.csv\"\n\
         [measurements]\nuse = \"csv\"\npath = \"measured.csv\"\n[surrogate]\n{surrogate}\n\
         [discrepancy]\nuse = \"gaussian\"\nvariance = {{ known = {:e} }}\n{further}\n\
         [sampler]\nuse = \"affine_invariant_ensemble\"\nwalkers = 20\nsteps = 400\n",
        times.join(", "),
        sd * sd,
    )
    .unwrap();
    let checked = resolve::load_text(&folder.path().join("study.toml"), &text, &[]);
    let complaints = checked.complaints();
    let study = checked.study.expect(&complaints);
    let mut run = RunDirectory::open(&folder.path().join("run")).unwrap();
    let (learned, _) = pipeline::calibrate_emulated(&study, &mut run, &Silent).unwrap();
    let mut found = Found { held: Default::default(), widths: Vec::new() };
    for i in 0..truths {
        let truth = [random.uniform(), random.uniform(), random.uniform()];
        let values = model(truth).iter().map(|y| Some(y + sd * random.normal())).collect();
        let replicates = vec![Replicate::new("1", values)];
        let layout = study.layouts.blocks[0].clone();
        let data = Observations { blocks: vec![Measurements::new(layout, replicates)] };
        let mut own = learned.data().clone();
        let measured = own.value.measured.as_mut().unwrap();
        (measured.read, measured.used, measured.likelihood) = (data.clone(), data.clone(), data);
        let known = InverseProblem::new(&own, Route::Emulated(&learned), None);
        let parts = Parts::of(&study, known.data.value.measured.as_ref().unwrap(), &known).unwrap();
        let posterior = parts.posterior(&study, &known);
        let folder = Stage::Calibrate.part(&format!("truth-{i}"));
        let kept =
            calibrate::draw(&study, &posterior, None, &folder, &i, &mut run, &Silent).unwrap();
        let draws = kept.value.draws.from_step(200);
        for (k, truth) in truth.iter().enumerate() {
            let sorted = moments::sorted(&draws.pooled(k));
            for (level, held) in [0.5, 0.9, 0.95].iter().zip(&mut found.held) {
                let end = |p: f64| moments::quantile(&sorted, p);
                let inside = end(0.5 - 0.5 * level) <= *truth && *truth <= end(0.5 + 0.5 * level);
                held.push(inside);
            }
            found.widths.push(moments::variance(&sorted).sqrt());
        }
    }
    found
}

/// Coverage over 12 truths for each of four designs; about half of the truths are within a tenth of an edge in some
/// parameter.
fn holds_the_truth(surrogate: &str) {
    let (designs, truths) = (4, 12);
    let found: Vec<Found> =
        (1..=designs).map(|seed| calibrations(front, surrogate, "", truths, seed)).collect();
    for (l, level) in [0.5, 0.9, 0.95_f64].into_iter().enumerate() {
        let held: Vec<bool> = found.iter().flat_map(|f| f.held[l].iter().copied()).collect();
        let share = held.iter().filter(|h| **h).count() as f64 / held.len() as f64;
        let count = designs as f64 * truths as f64;
        let least = level - 2.58 * (level * (1.0 - level) / count).sqrt();
        assert!(share >= least, "{surrogate}: intervals of {level} hold {share}, at least {least}");
    }
}

#[test]
fn intervals_through_an_expansion_of_24_runs_hold_the_truth() {
    holds_the_truth("use = \"polynomial_chaos\"\ndegree = { max = 3 }");
}

#[test]
fn intervals_through_a_gaussian_process_of_24_runs_hold_the_truth() {
    holds_the_truth("use = \"gaussian_process\"");
}

/// Compared with the same calibration that takes the emulator as exact, which it is.
#[test]
fn an_excellent_emulator_does_not_widen_the_posterior() {
    let surrogate = "use = \"polynomial_chaos\"\ndegree = { max = 3 }";
    let with = calibrations(quadratic, surrogate, "", 10, 7);
    let without = calibrations(quadratic, surrogate, "emulator_error = false", 10, 7);
    let ratios = with.widths.iter().zip(&without.widths).map(|(a, b)| a / b);
    let ratio = moments::mean(&ratios.collect::<Vec<_>>());
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}
