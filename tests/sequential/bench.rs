//! Runs needed for a posterior: a fixed design, refinement by error and distance, and an ensemble followed by refinement
//! by the posterior's variance.
//!
//! ```sh
//! cargo test --workspace --test all -- --ignored --nocapture sequential::bench
//! ```

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lacuna::math::moments;
use lacuna::run::Silent;
use lacuna_engine::stage::calibrate;
use lacuna_engine::stage::direct::Direct;
use lacuna_run::{RunDirectory, Stage};
use tempfile::TempDir;

use super::published::{BANANA, BIMODAL, UNIMODAL, draws};
use crate::quick;

/// A study, and how its runs are placed.
struct Case {
    name: &'static str,
    folder: TempDir,
    /// Settings that make the study's own model the forward map.
    direct: Vec<&'static str>,
    /// Runs of the fixed designs.
    fixed: &'static [usize],
    /// Runs of the first design before a refinement, of each round, and of the ensemble.
    sizes: [usize; 3],
    /// Largest number of rounds.
    rounds: usize,
}

fn founding() -> Case {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    quick::replace(
        &path,
        "use = \"polynomial_chaos\"\ndegree = { max = 4 }\nvalidation = 8",
        "use = \"gaussian_process\"",
    );
    // Differences at the bound of zero would leave the range of the model.
    quick::replace(&path, "uniform = [0.0, 1.0e6]", "uniform = [1e3, 1.0e6]");
    quick::replace(&path, "walkers = 24\nsteps = 60", "walkers = 24\nsteps = 600");
    let direct =
        vec!["surrogate=false", "design=false", "simulations=false", "validate.emulator_check=0"];
    Case {
        name: "founding study",
        folder,
        direct,
        fixed: &[20, 40, 80, 160],
        sizes: [20, 10, 12],
        rounds: 5,
    }
}

/// Furs of hares and lynxes, Hudson's Bay Company 1901 to 1920 in thousands (Howard 2009, as in Carpenter, *Predator-Prey
/// Population Dynamics: the Lotka-Volterra model in Stan*, 2018), with the noise that is found there and wide priors.
const FURS: [[f64; 20]; 2] = [
    [
        47.2, 70.2, 77.4, 36.3, 20.6, 18.1, 21.4, 22.0, 25.4, 27.1, 40.3, 57.0, 76.6, 52.3, 19.5,
        11.2, 7.6, 14.6, 16.2, 24.7,
    ],
    [
        6.1, 9.8, 35.2, 59.4, 41.7, 19.0, 13.0, 8.3, 9.1, 7.4, 8.0, 12.3, 19.5, 45.7, 51.1, 29.7,
        15.8, 9.7, 10.1, 8.6,
    ],
];

fn lotka_volterra() -> Case {
    let folder = tempfile::tempdir().unwrap();
    let mut measured = "replicate,species,t [1],y [1]\n".to_owned();
    for (species, furs) in ["hare", "lynx"].iter().zip(FURS) {
        for (i, count) in furs.iter().enumerate() {
            writeln!(measured, "1,{species},{},{:e}", i + 1, count.ln()).unwrap();
        }
    }
    fs::write(folder.path().join("measured.csv"), measured).unwrap();
    let text = "[study]\ntitle = \"hares and lynxes\"\nseed = 1900\n\
        [[parameter]]\nname = \"birth\"\nprior = { uniform = [0.1, 1.5] }\n\
        [[parameter]]\nname = \"eaten\"\nprior = { uniform = [0.005, 0.1] }\n\
        [[parameter]]\nname = \"death\"\nprior = { uniform = [0.1, 1.5] }\n\
        [[parameter]]\nname = \"fed\"\nprior = { uniform = [0.005, 0.1] }\n\
        [response]\nname = \"y\"\nunit = \"1\"\n[response.axes]\nspecies = [\"hare\", \"lynx\"]\n\
        t = { first = 1.0, last = 20.0, count = 20, unit = \"1\" }\n\
        [model]\nuse = \"equations\"\nstate = { u = 33.9, v = 5.9 }\n\
        rate = { u = \"(birth - eaten * v) * u\", v = \"(fed * u - death) * v\" }\n\
        observe = { hare = \"log(u)\", lynx = \"log(v)\" }\n\
        [design]\nuse = \"latin_hypercube\"\nruns = 40\n\
        [measurements]\nuse = \"csv\"\npath = \"measured.csv\"\n\
        [surrogate]\nuse = \"gaussian_process\"\n\
        [discrepancy]\nuse = \"gaussian\"\nvariance = { known = 0.0625 }\n\
        [sampler]\nuse = \"sequential_monte_carlo\"\nparticles = 1000\n";
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let direct = vec!["surrogate=false", "design=false"];
    let fixed = &[40, 80, 160, 320, 640];
    Case { name: "hares and lynxes", folder, direct, fixed, sizes: [40, 15, 16], rounds: 4 }
}

fn borehole() -> Case {
    let folder = tempfile::tempdir().unwrap();
    let from = quick::root().join("configs/borehole");
    fs::copy(from.join("measurements.csv"), folder.path().join("measurements.csv")).unwrap();
    let text = fs::read_to_string(from.join("study.toml")).unwrap();
    let model = "[model]\nuse = \"equations\"\nobserve = \"2 * 3.141592653589793 * upper_transmissivity * (upper_head \
                 + drawdown - lower_head) / (l * (1 + 2 * length * upper_transmissivity / (l * (radius * reamed)^2 * \
                 conductivity) + upper_transmissivity / lower_transmissivity))\"\nwhere = { l = \"log(influence / \
                 (radius * reamed))\" }\n[design]\nuse = \"latin_hypercube\"\nruns = 40\n";
    let begin = text.find("[simulations]").unwrap();
    let end = text.find("[measurements]").unwrap();
    let text = format!("{}{model}{}", &text[..begin], &text[end..]);
    let begin = text.find("[surrogate]").unwrap();
    let end = text.find("[discrepancy]").unwrap();
    let text =
        format!("{}[surrogate]\nuse = \"gaussian_process\"\n{}", &text[..begin], &text[end..]);
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let direct = vec!["surrogate=false", "design=false"];
    Case {
        name: "borehole",
        folder,
        direct,
        fixed: &[40, 80, 160, 320],
        sizes: [40, 20, 24],
        rounds: 4,
    }
}

fn cases() -> Vec<Case> {
    let published = [BANANA, BIMODAL, UNIMODAL].map(|problem| Case {
        name: problem.name,
        folder: problem.study(),
        direct: vec!["surrogate=false", "design=false"],
        fixed: &[10, 20, 40],
        sizes: [10, 5, 10],
        rounds: 2,
    });
    let mut all: Vec<Case> = published.into();
    all.extend([founding(), lotka_volterra(), borehole()]);
    let wanted = std::env::var("LACUNA_SEQUENTIAL").unwrap_or_default();
    all.into_iter().filter(|case| wanted.is_empty() || wanted.contains(case.name)).collect()
}

/// Draws of the posterior of the model itself.
fn direct(path: &Path, settings: &[&str], out: &Path) -> Vec<Vec<f64>> {
    let study = quick::load(path, settings);
    let mut run = RunDirectory::open(out).unwrap();
    let direct = Direct::of(&study, &mut run, &Silent).unwrap();
    let folder = Stage::Calibrate.folder();
    let kept = calibrate::stage(&study, &direct.problem(), &folder, &mut run, &Silent).unwrap();
    let calibrated = kept.unwrap().value;
    let draws = calibrated.draws.from_step(calibrated.outcome.burn_in);
    (0..study.parameters.len()).map(|j| draws.pooled(j)).collect()
}

/// Largest error of a mean in posterior standard deviations, and largest distance of Kolmogorov between marginal laws.
fn distance(found: &[Vec<f64>], truth: &[Vec<f64>]) -> (f64, f64) {
    let (mut off, mut apart) = (0.0_f64, 0.0_f64);
    for (a, b) in found.iter().zip(truth) {
        off = off.max((moments::mean(a) - moments::mean(b)).abs() / moments::variance(b).sqrt());
        let (a, b) = (moments::sorted(a), moments::sorted(b));
        let below = |x: f64| b.partition_point(|y| *y <= x) as f64 / b.len() as f64;
        apart = apart.max(moments::kolmogorov_distance(&a, below));
    }
    (off, apart)
}

#[test]
#[ignore = "takes an hour: cargo test --workspace --test all -- --ignored --nocapture sequential::bench"]
fn runs_needed_for_a_posterior() {
    println!(
        "| case | placement | runs | error of the mean, sd | distance of the laws |\n|---|---|---|---|---|"
    );
    for case in cases() {
        let path = case.folder.path().join("study.toml");
        let out = |name: &str| case.folder.path().join(name);
        let truth = direct(&path, &case.direct, &out("direct"));
        let again = direct(&path, &[&case.direct[..], &["study.seed=5"]].concat(), &out("again"));
        let show = |what: &str, runs: usize, (off, apart): (f64, f64)| {
            println!("| {} | {what} | {runs} | {off:.3} | {apart:.3} |", case.name);
        };
        show("the model itself, another seed", 0, distance(&again, &truth));
        for seed in ["study.seed=1", "study.seed=2", "study.seed=3"] {
            for runs in case.fixed {
                let design = format!("design.runs={runs}");
                let name = format!("fixed-{seed}");
                let (found, runs) = draws(&path, &[&design, seed], &out(&name));
                show("fixed", runs, distance(&found, &truth));
            }
            let [first, round, ensemble] = case.sizes;
            for rounds in 1..=case.rounds {
                let refine = |choose: &str| {
                    format!(
                        "surrogate.refine={{ runs = {round}, rounds = {rounds}, until = 1e-6, choose = \"{choose}\" }}"
                    )
                };
                let design = format!("design.runs={first}");
                for choose in ["emulator_error", "posterior_variance"] {
                    let name = format!("{choose}-{seed}");
                    let (found, runs) =
                        draws(&path, &[&design, &refine(choose), seed], &out(&name));
                    show(choose, runs, distance(&found, &truth));
                }
                let design = format!("design={{ use = \"ensemble_kalman\", runs = {ensemble} }}");
                let settings = [design.as_str(), &refine("posterior_variance"), seed];
                let (found, runs) = draws(&path, &settings, &out(&format!("ensemble-{seed}")));
                show("ensemble, then posterior_variance", runs, distance(&found, &truth));
            }
        }
    }
}
