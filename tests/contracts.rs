//! Every registered plugin fulfils the contract of its kind: a listed plugin is a tested plugin.
//!
//! Plugins are built from their names and options as a study builds them. A plugin that the tables below do not list is
//! tested with its defaults; one that needs options, or is worth testing with several, has an entry there.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "contracts/discrepancies.rs"]
mod discrepancies;
#[path = "contracts/effects.rs"]
mod effects;
#[path = "contracts/executors.rs"]
mod executors;
#[path = "contracts/faults.rs"]
mod faults;
#[path = "contracts/gain.rs"]
mod gain;
#[path = "contracts/models.rs"]
mod models;
#[path = "contracts/quantities.rs"]
mod quantities;
#[path = "contracts/served.rs"]
mod served;
#[path = "contracts/skeletons.rs"]
mod skeletons;
#[path = "slurm/mod.rs"]
mod slurm;
#[path = "contracts/walk_through.rs"]
mod walk_through;

use std::path::{Path, PathBuf};

use lacuna::data::{Axis, Layout, Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::{Density, Design, Reader, Sampler, Surrogate, Term, model};
use lacuna_contract::Sample;
use lacuna_run::write_response;
// Without this line the linker leaves the plugins out.
use lacuna_plugins as _;

/// Plugins of a kind with the options, as TOML, with which each is tested; the others are tested with their defaults.
type Table = [(&'static str, &'static [&'static str])];

/// One plugin with one set of options.
struct Case<'a> {
    plugin: &'static str,
    /// Name of the plugin with its options, for messages.
    label: String,
    /// An empty folder.
    scratch: &'a Path,
}

/// Registered plugins of a kind, each with the options with which it is tested.
fn cases<K: Kind + ?Sized>(table: &Table) -> Vec<(&'static str, &'static [&'static str])> {
    let registered: Vec<&str> = registry::entries::<K>().iter().map(|entry| entry.name).collect();
    let gone: Vec<&str> =
        table.iter().map(|(name, _)| *name).filter(|name| !registered.contains(name)).collect();
    assert!(
        gone.is_empty(),
        "no plugin of kind {} is called {gone:?}: they are tested here",
        K::NAME
    );
    let options =
        |name: &str| table.iter().find(|(listed, _)| *listed == name).map(|(_, all)| *all);
    registered.into_iter().map(|name| (name, options(name).unwrap_or(&[""]))).collect()
}

/// A plugin built from its name and options.
fn built<K: Kind + ?Sized>(plugin: &str, options: &str) -> Box<K> {
    let built = registry::from_text::<K>(plugin, options).unwrap_or_else(|error| {
        let help = format!(
            "{error}\n{0} `{plugin}` cannot be tested with the options `{options}`; give it others in the table of its \
             kind, in tests/contracts.rs or tests/contracts/",
            K::NAME
        );
        panic!("{help}")
    });
    built.plugin
}

/// Runs every plugin of a kind through its suite.
fn all<K: Kind + ?Sized>(table: &Table, suite: impl Fn(&Case<'_>, &K) -> Result<(), Vec<String>>) {
    let mut breaches = Vec::new();
    for (plugin, all_options) in cases::<K>(table) {
        for options in all_options {
            let scratch = tempfile::tempdir().unwrap();
            let label = format!("{plugin} {}", options.replace('\n', ", "));
            let case = Case { plugin, label: label.trim().to_owned(), scratch: scratch.path() };
            breaches.extend(suite(&case, &*built::<K>(plugin, options)).err().unwrap_or_default());
        }
    }
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
#[should_panic(expected = "no plugin of kind design is called [\"gone\"]")]
fn a_tested_plugin_that_is_gone_is_missed() {
    cases::<dyn Design>(&[("random", &[""]), ("gone", &[""])]);
}

#[test]
#[should_panic(expected = "give it others in the table of its kind")]
fn a_plugin_that_needs_options_says_where_it_gets_them() {
    built::<dyn Term>("relaxation", "");
}

#[test]
fn every_kind_has_a_suite() {
    let kinds: Vec<&str> = registry::kinds().iter().map(|kind| kind.name).collect();
    let suites = [
        "design",
        "discrepancy",
        "effect",
        "executor",
        "model",
        "quantity",
        "reader",
        "reliability",
        "sampler",
        "surrogate",
        "target",
        "term",
    ];
    assert_eq!(kinds, suites);
    assert!(registry::audit().is_empty());
}

#[test]
fn designs() {
    let table: &Table = &[
        (
            "latin_hypercube",
            &["", "optimise = \"maximin\"", "optimise = \"correlation\"", "centred = true"],
        ),
        ("quadrature", &["", "rule = \"smolyak\""]),
        ("random", &[""]),
        ("sobol", &["", "scramble = \"none\""]),
    ];
    all::<dyn Design>(table, |case, design| lacuna_contract::design(&case.label, design));
}

#[test]
fn terms() {
    let table: &Table = &[
        ("ageing", &["", "of = \"x\""]),
        ("bouc_wen", &["", "of = \"v - 1\"\nunit = \"m/s\""]),
        ("constant_rate", &[""]),
        ("convection", &["ambient = \"293 {K}\"", "ambient = \"293 {K}\"\npower = 1.33"]),
        ("coulomb_friction", &["", "of = \"v - 1\"\nwidth = \"0.01\""]),
        ("cubic_stiffness", &["of = \"x\"", "of = \"x\"\nabout = \"2\""]),
        ("dahl_friction", &["", "deflection = { uniform = [0.1, 1] }"]),
        ("dead_zone", &["", "of = \"x\"\nunit = \"m\""]),
        ("delayed", &["", "of = \"2 * v\"\nstart = \"2\"\nlags = 1"]),
        ("evaporation", &["ambient = \"293 {K}\"\nscale = \"16 {K}\"", "ambient = \"293 {K}\""]),
        ("expression", &["shape = \"v * x\"", "shape = \"t\"\nsign = \"positive\""]),
        ("forcing", &["", "frequency = { uniform = [1, 2] }"]),
        ("fractional_damping", &["", "order = { uniform = [0.4, 0.6] }"]),
        ("limiter", &["", "of = \"x\"\nunit = \"m\""]),
        ("linear_friction", &["", "of = \"v - 1\""]),
        ("maxwell_damping", &["", "time = { uniform = [1, 2] }"]),
        (
            "overflow",
            &["", "level = \"2\"", "of = \"x\"\nprior = { uniform = [0, 2] }\nunit = \"m\""],
        ),
        ("carreau_friction", &["", "power = { uniform = [0, 1] }"]),
        ("power_friction", &["", "power = { uniform = [1, 2] }"]),
        ("power_stiffness", &["of = \"x\"\nunit = \"m\""]),
        ("pull", &["of = \"x\"\ndistance = \"hypot(x, y)\"\nbeside = { w = \"y\" }"]),
        ("quadratic_friction", &[""]),
        ("quadratic_stiffness", &["of = \"x\""]),
        ("radiation", &["ambient = \"293 {K}\""]),
        ("relaxation", &["toward = \"1\""]),
        ("stribeck_friction", &["", "width = \"0.01\"\nrise = { uniform = [0, 1] }"]),
    ];
    all::<dyn Term>(table, |case, term| lacuna_contract::term(&case.label, term));
}

#[test]
fn surrogates() {
    let table: &Table = &[
        (
            "gaussian_process",
            &[
                "nugget = 1e-8",
                "kernel = \"matern_3_2\"\ntrend = \"linear\"\ncomponents = \"none\"",
                "kernel = \"squared_exponential\"\nlength_scales = \"shared\"\nnugget = 1e-8",
            ],
        ),
        (
            "polynomial_chaos",
            &[
                "degree = { max = 8 }",
                "degree = 5\nsolver = \"least_squares\"",
                "degree = { max = 8 }\nsolver = \"orthogonal_matching_pursuit\"",
                "degree = { max = 8 }\nsolver = \"subspace_pursuit\"",
                "degree = { max = 8 }\nsolver = \"bayesian_compressive_sensing\"",
                "degree = { max = 8 }\nq_norm = { min = 0.6, step = 0.2 }\nselection = { k_fold = 5 }",
                "degree = { max = 8 }\nbasis = \"arbitrary\"",
                "degree = { max = 6 }\nbasis = \"jacobi\"\ncomponents = { variance = 0.9999 }",
            ],
        ),
        (
            "polynomial_chaos_kriging",
            &[
                "nugget = 1e-8",
                "kernel = \"matern_3_2\"\nselection = \"sequential\"\ntrend = { degree = { max = 3 } }",
            ],
        ),
    ];
    all::<dyn Surrogate>(table, |case, plugin| lacuna_contract::surrogate(&case.label, plugin));
}

#[test]
fn samplers() {
    // With fewer steps the Monte Carlo error of the suite itself is too large for a test.
    let table: &Table = &[
        (
            "adaptive_metropolis",
            &["steps = 4000\nwarm_up = 1000", "adapt = \"always\"\nproposal = { prior = 0.5 }"],
        ),
        (
            "affine_invariant_ensemble",
            &[
                "walkers = 40\nsteps = 2000",
                "walkers = 20\nsteps = 2000\nupdate = \"sequential\"",
                "walkers = 40\nsteps = 2000\nmoves = { differential_evolution = 0.8, snooker = 0.2 }",
                "walkers = 40\nsteps = 2000\nmoves = { stretch = 0.5, walk = 0.5 }\nsubset = 4",
            ],
        ),
        (
            "delayed_rejection_adaptive_metropolis",
            &["steps = 4000\nwarm_up = 1000", "proposal = { prior = 0.5 }\nshrink = 0.1"],
        ),
        (
            "differential_evolution",
            &["steps = 4000\nwarm_up = 1000", "archive = { prior = 1.0 }\nsnooker = 0.3"],
        ),
        ("hamiltonian", &["warm_up = 300", "warm_up = 300\ntrajectory = { leapfrog_steps = 8 }"]),
        ("metropolis", &["steps = 4000", "proposal = { prior = 0.5 }"]),
        ("nested", &["live = 300", "live = 300\nmutation = \"automatic\""]),
        ("no_u_turn", &["warm_up = 300", "warm_up = 300\nmetric = \"diagonal\""]),
        (
            "sequential_monte_carlo",
            &["particles = 400", "particles = 400\nmutation = \"random_walk\""],
        ),
        ("variational", &["", "refine = false"]),
    ];
    all::<dyn Sampler>(table, |case, plugin| lacuna_contract::sampler(&case.label, plugin));
}

#[test]
fn targets() {
    let parameters = [
        Parameter::plain("intercept", Distribution::Normal([0.0, 10.0])),
        Parameter::plain("slope", Distribution::Uniform([-10.0, 10.0])),
        Parameter::plain("sigma", Distribution::HalfNormal(2.0)),
    ];
    let table: &Table = &[(
        "expression",
        &[
            "log_density = '-(intercept^2 + slope^2) / 2 - exp(sigma)'\nincludes_prior = true",
            "log_density = 'sum(normal_log_density(y, intercept + slope * x, sigma))'\n\
             data = { x = [0, 1, 2, 3], y = [0.9, 3.1, 5.0, 6.8] }",
            "log_density = 'if(slope > 0, log(slope), log(-1)) + student_t_log_density(z, 4, 0, 1)'\n\
             where = { z = 'hypot(intercept, sigma) - atan2(sigma, slope)' }",
        ],
    )];
    all::<dyn Density>(table, |case, plugin| {
        lacuna_contract::density(&case.label, plugin, &parameters)
    });
}

/// Two gauges at one hundred times, as in `samples/base.csv`, in microstrain.
fn layout() -> Layout {
    let times = (1..=100).map(|i| f64::from(i) * 1e-5).collect();
    Layout {
        name: "strain".into(),
        unit: Unit::parse("strain").unwrap(),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", times, Unit::parse("s").unwrap()),
        ],
    }
}

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("samples")
}

fn strain() -> Vec<f64> {
    let text = std::fs::read_to_string(samples().join("base.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| {
        let j = rows[0].iter().position(|heading| *heading == name).unwrap();
        rows[1..].iter().map(move |row| 1e-6 * row[j].parse::<f64>().unwrap()).collect()
    };
    let (b, c): (Vec<f64>, Vec<f64>) = (column("B"), column("C"));
    [b, c].concat()
}

/// The signals of `base.csv` in the formats of a reader.
fn sound_files(name: &str, reader: &dyn Reader, folder: &Path) -> Vec<Sample> {
    let (layout, values) = (layout(), strain());
    let sample = |file: PathBuf, tolerance: f64| Sample {
        file,
        layout: layout.clone(),
        values: values.clone(),
        tolerance,
    };
    match name {
        "hdf5" => vec![sample(samples().join("records.h5"), 1e-12)],
        "matlab" => ["records.mat", "records_plain.mat", "records_73.mat"]
            .map(|file| sample(samples().join(file), 1e-12))
            .to_vec(),
        "tdms" => vec![sample(samples().join("records.tdms"), 1e-12)],
        "netcdf" => {
            let response = model::Response { values: values.clone(), valid: true, facts: vec![] };
            let file = write_response(folder, "sound", &layout, &response).unwrap();
            vec![sample(folder.join(file), 0.0)]
        }
        // `base.csv` holds the signals to a thousandth of a microstrain, the other files to all digits.
        "sierra" => ["hist_cdf2.h", "hist_cdf5.h", "hist_nc4.h", "hb_spyhis.txt"]
            .map(|file| sample(samples().join(file), 1e-5))
            .to_vec(),
        // A table in long form, which readers that are not listed must read too: as `csv`, or under the name in a
        // skeleton.
        _ => {
            let row = |(i, y): (usize, &f64)| {
                let place = layout.place(i);
                format!("{},{},{y}\n", layout.axes[0].text(place[0]), layout.axes[1].text(place[1]))
            };
            let rows: String = values.iter().enumerate().map(row).collect();
            let text = format!("sensor,time,strain\n{rows}");
            let named = ["sound.columns", "sound.csv"].map(|file| folder.join(file));
            let own = named.iter().find(|path| reader.recognises(path, &text.as_bytes()[..4096]));
            let path = own.unwrap_or(&named[1]).clone();
            std::fs::write(&path, text).unwrap();
            vec![sample(path, 0.0)]
        }
    }
}

#[test]
fn readers() {
    let table: &Table = &[
        ("csv", &[""]),
        ("hdf5", &["dataset = \"strain_{sensor}\"\ntime = \"time\""]),
        (
            "matlab",
            &[
                "dataset = \"record.strain\"\naxes = [\"time\", \"sensor\"]\ntime = \"record.t\"\ntime_unit = \"ms\"\n\
               unit = \"microstrain\"",
            ],
        ),
        ("netcdf", &[""]),
        ("sierra", &["variable = \"strain_{sensor}\"", ""]),
        ("tdms", &["dataset = \"strain/{sensor}\""]),
    ];
    let folder = tempfile::tempdir().unwrap();
    all::<dyn Reader>(table, |case, reader| {
        let samples = sound_files(case.plugin, reader, folder.path());
        let judge = |sample: &Sample| {
            let name = sample.file.file_name().unwrap_or_default().display();
            let label = format!("{} on {name}", case.label);
            lacuna_contract::reader(&label, reader, sample, case.scratch).err().unwrap_or_default()
        };
        let breaches: Vec<String> = samples.iter().flat_map(judge).collect();
        if breaches.is_empty() { Ok(()) } else { Err(breaches) }
    });
}
