//! Made-up results with the shape, units and sizes of the mercury target study (Radaideh et al., arXiv 2202.03959).

use lacuna::data::{Axis, Layout, Measurements, Parameter, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal, uniform};
use lacuna::plugin::Fact;
use lacuna_linalg::Matrix;

use crate::report::findings::{
    CalibrationFindings, CoordinateFindings, Findings, FittedDistribution, MeasuredFindings, Role,
    SurrogateFindings,
};
use crate::stage::screen::FlaggedCurve;

pub const SENSORS: [&str; 10] = ["B", "C", "G", "M", "R", "T", "U", "V", "Y", "Z"];
pub const TIMES: usize = 100;
const REPLICATES: usize = 16;
pub(super) const RUNS: usize = 603;
const NAMES: [&str; 4] = ["tensile_cutoff", "density", "sound_speed", "variance"];
pub const MEAN: [f64; 4] = [6.49e4, 12_111.8, 1849.7, 1.02e-9];
pub const SD: [f64; 4] = [2.39e3, 14.9, 5.3, 1.15e-11];

/// Results of all stages.
pub fn findings() -> Findings {
    let layout = layout();
    Findings {
        title: "SNS first target station: mercury equation of state".into(),
        study: "sns".into(),
        seed: 20_220_415,
        fields: Vec::new(),
        intervals: Vec::new(),
        prior: Vec::new(),
        version: "0.1.0".into(),
        components: [
            ("model", "mercury_target"),
            ("design", "latin_hypercube"),
            ("executor", "local"),
            ("measurements", "csv"),
            ("surrogate", "polynomial_chaos"),
            ("discrepancy", "gaussian"),
            ("sampler", "affine_invariant_ensemble"),
        ]
        .map(|(kind, plugin)| (kind.to_owned(), plugin.to_owned()))
        .to_vec(),
        parameters: parameters(),
        ensemble: Some(super::runs::ensemble()),
        measured: Some(measured(&layout)),
        surrogate: Some(surrogate(&layout)),
        calibration: Some(calibration()),
        drawn: Some(super::drawn::drawn(&layout)),
        validation: Some(super::drawn::validation(&layout)),
        layouts: layout.into(),
        quantities: Vec::new(),
        propagated: None,
        reliability: Vec::new(),
        gap: None,
        made_by: vec![("calibrate".to_owned(), "0.0.9".to_owned())],
        assessment: crate::assess::Assessment::default(),
        seconds: [
            ("design", 0.004),
            ("simulate", 1834.0),
            ("read", 2.1),
            ("surrogate", 4.8),
            ("calibrate", 41.7),
            ("validate", 3.3),
        ]
        .map(|(stage, seconds)| (stage.to_owned(), seconds))
        .to_vec(),
        warnings: vec![
            "2 of 120 chains are stranded far below the bulk of the density (chains 18, 78); every \
             summary holds them"
                .into(),
            "3 of 606 runs were left out: they have no response".into(),
        ],
        note: Some(
            "The measurements and the simulator are stand-ins of the target's shape; nothing here \
             is a measurement of the SNS target."
                .into(),
        ),
    }
}

/// Findings of the study before any stage was run.
pub fn bare() -> Findings {
    Findings {
        ensemble: None,
        measured: None,
        surrogate: None,
        calibration: None,
        drawn: None,
        validation: None,
        made_by: Vec::new(),
        seconds: Vec::new(),
        warnings: Vec::new(),
        note: None,
        ..findings()
    }
}

pub fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap()
}

fn layout() -> Layout {
    let times = (1..=TIMES).map(|i| i as f64 * 1e-5).collect();
    Layout {
        name: "strain".into(),
        unit: unit("1"),
        axes: vec![Axis::labels("sensor", SENSORS), Axis::grid("time", times, unit("s"))],
    }
}

pub(super) fn parameters() -> Vec<Parameter> {
    let parameter = |name: &str, symbol: &str, text: &str, design, prior, reference| Parameter {
        name: name.into(),
        symbol: symbol.into(),
        unit: unit(text),
        design: Distribution::Uniform(design),
        prior: Distribution::Uniform(prior),
        reference: Some(reference),
    };
    vec![
        parameter("tensile_cutoff", "x1", "Pa", [0.0, 1.5e7], [0.0, 1.5e6], 1.5e5),
        parameter("density", "x2", "kg/m3", [1e4, 1.6e4], [1.1e4, 1.5e4], 13_500.0),
        parameter("sound_speed", "x3", "m/s", [1e3, 3e3], [1.2e3, 1.9e3], 1456.0),
    ]
}

/// Strain at a wall: a rise, then two damped modes.
pub fn strain(sensor: usize, t: f64, shift: f64) -> f64 {
    let s = sensor as f64;
    let arrival = 5e-5 + 4e-5 * (s * 1.7).sin().abs() * (s + 1.0) * 0.4;
    let tau = (t - arrival).max(0.0) * (1.0 + shift);
    let rise = 1.0 - (-tau / 3e-5).exp();
    let slow = (2.0 * std::f64::consts::PI * (1500.0 + 130.0 * s) * tau).sin();
    let fast = (2.0 * std::f64::consts::PI * (5200.0 + 310.0 * s) * tau).cos();
    let size = 1e-6 * (90.0 + 150.0 * (s * 2.3).cos().abs());
    size * rise * (0.75 * slow * (-tau / 6e-4).exp() + 0.3 * fast * (-tau / 3e-4).exp() + 0.25)
}

pub fn response(layout: &Layout, shift: f64, gain: f64) -> Vec<f64> {
    (0..layout.len())
        .map(|i| gain * strain(i / TIMES, (i % TIMES + 1) as f64 * 1e-5, shift))
        .collect()
}

pub fn measured(layout: &Layout) -> MeasuredFindings {
    let replicates = (0..REPLICATES).map(|r| {
        let mut rng = Stream::root(2).named("replicate").at(r as u64).generator();
        let gain = 1.0 + 0.05 * normal(&mut rng);
        let mut noise = 0.0;
        let values = (0..layout.len()).map(|i| {
            noise = 0.8 * noise + 9e-6 * normal(&mut rng);
            let clean = gain * strain(i / TIMES, (i % TIMES + 1) as f64 * 1e-5, 0.0);
            let odd = if r == 5 && i / TIMES == 4 { 8e-5 } else { 0.0 };
            // Sensor M fails late in one pulse.
            (!(r == 3 && i / TIMES == 3 && i % TIMES > 60)).then_some(clean + noise + odd)
        });
        Replicate::new(format!("pulse {}", r + 1), values.collect())
    });
    let used = Measurements::new(layout.clone(), replicates.collect());
    let flagged = |replicate: &str, group: &str, distance, left_out| FlaggedCurve {
        replicate: replicate.into(),
        group: group.into(),
        distance,
        threshold: 6.0,
        left_out,
    };
    MeasuredFindings {
        fingerprint: String::from("0123456789abcdef"),
        data_count: used.count(),
        used: used.into(),
        flagged: vec![flagged("pulse 6", "R", 9.4, false), flagged("pulse 17", "B", 31.0, true)],
        added_curves: vec!["mean".into(), "q025".into(), "q975".into()],
    }
}

fn surrogate(layout: &Layout) -> SurrogateFindings {
    let mut rng = Stream::root(3).generator();
    let truth = response(layout, 0.1, 1.0);
    let pairs = (0..3000).map(|i| {
        let value = truth[i * 7 % truth.len()] * (1.0 + 2.0 * uniform(&mut rng));
        (value, value + 3.2e-5 * normal(&mut rng))
    });
    SurrogateFindings {
        refinement: Some((2, 0.08, "the discrepancy", true)),
        facts: vec![
            Fact::new("basis", "Legendre, hyperbolic truncation q = 0.75"),
            Fact::new("largest degree", 14),
            Fact::new("terms kept per output", "21 to 136"),
        ],
        training: 480,
        validation: 123,
        mae: 3.2e-5,
        rmse: 5.8e-5,
        loo: 3.84e-3,
        by_group: SENSORS
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let size = 0.6 + 0.08 * i as f64;
                ((*s).to_owned(), 3.2e-5 * size, 5.8e-5 * size, 3.84e-3 * size)
            })
            .collect(),
        near_posterior: Some((1.1e-5, 41)),
        pairs: pairs.collect(),
        loo_by_output: truth.iter().map(|y| 1e-3 + y.abs()).collect(),
        total_by_output: Some(Matrix::from_fn(truth.len(), 3, |i, j| {
            [0.1, 0.4, 0.6][j] + 1e-4 * i as f64
        })),
        sobol: Some(vec![(0.06, 0.11), (0.34, 0.43), (0.49, 0.61)]),
        main_effects: super::drawn::main_effects(),
    }
}

fn calibration() -> CalibrationFindings {
    let (chains, steps, burn_in) = (120, 1200, 600);
    let mut draws = vec![0.0; chains * steps * 4];
    for chain in 0..chains {
        let mut rng = Stream::root(4).named("chain").at(chain as u64).generator();
        let start: Vec<f64> = (0..4).map(|_| 40.0 * (uniform(&mut rng) - 0.5)).collect();
        let stranded = chain == 17 || chain == 77;
        let mut z: [f64; 4] = std::array::from_fn(|_| normal(&mut rng));
        for step in 0..steps {
            // A correlated walk with an autocorrelation time of about 40 steps that moves at 45 %.
            if uniform(&mut rng) < if stranded { 0.02 } else { 0.45 } {
                for value in &mut z {
                    *value = 0.95 * *value + (1.0_f64 - 0.95 * 0.95).sqrt() * normal(&mut rng);
                }
            }
            let decay = if stranded { 0.4 } else { (-(step as f64) / 60.0).exp() };
            let x = [z[0], z[1], -0.86 * z[1] + 0.51 * z[2] + 0.2 * z[0], z[3]];
            for i in 0..4 {
                let start = if i == 3 { start[i].abs() } else { start[i] };
                let value = MEAN[i] + SD[i] * (x[i] + decay * start);
                draws[(chain * steps + step) * 4 + i] = value;
            }
        }
    }
    let mut rng = Stream::root(5).generator();
    let acceptance = (0..chains)
        .map(|c| if c == 17 || c == 77 { 0.02 } else { 0.45 + 0.02 * normal(&mut rng) })
        .collect();
    CalibrationFindings {
        evidence: Some(lacuna::plugin::sampler::Evidence {
            log: -1234.5,
            error: 0.05,
            method: String::from("bridge sampling"),
        }),
        populations: Vec::new(),
        left_out: Some(crate::report::findings::LeftOutFindings {
            elpd: -1200.0,
            error: 20.0,
            error_by_curve: Some(31.0),
            parameters: 3.9,
            unreliable: 0,
            limit: 0.67,
            count: 500,
            k_hat: (0..500).map(|i| 0.4 * (f64::from(i) * 0.7).sin() + 0.2).collect(),
            below: (0..500).map(|i| ((f64::from(i) + 0.5) / 500.0).powf(1.2)).collect(),
            curves: Some(crate::report::findings::CurvesLeftOutFindings {
                elpd: -1190.0,
                error: 33.0,
                parameters: 4.2,
                unreliable: 1,
                count: 5,
            }),
        }),
        coordinates: coordinates(),
        best_draw: MEAN.to_vec(),
        draws,
        chains,
        steps,
        burn_in,
        correlation: correlation(),
        acceptance,
        stranded: vec![17, 77],
        converged: false,
        verdict: "R-hat of `tensile_cutoff` is 1.013 (wanted: at most 1.01) and the chains are 29 \
                  autocorrelation times long (wanted: 50); about 900 more steps would do"
            .into(),
        log_density: (98_211.42, 98_210.07),
        mixing: super::drawn::mixing(),
        energies: Some(super::drawn::energies()),
        facts: vec![
            Fact::new("stretch", 2),
            Fact::new("log density evaluations", "144000 of the emulator, none of the simulator"),
        ],
    }
}

fn coordinates() -> Vec<CoordinateFindings> {
    let units = ["Pa", "kg/m3", "m/s", "1"];
    let references = [Some(1.5e5), Some(13_500.0), Some(1456.0), None];
    let priors = [
        Distribution::Uniform([0.0, 1.5e6]),
        Distribution::Uniform([1.1e4, 1.5e4]),
        Distribution::Uniform([1.2e3, 1.9e3]),
        Distribution::HalfNormal(1e-6),
    ];
    let fit = |distribution, ks, p_value, delta_aic| FittedDistribution {
        distribution,
        ks,
        p_value,
        delta_aic,
    };
    priors
        .into_iter()
        .enumerate()
        .map(|(i, prior)| {
            let (mean, sd) = (MEAN[i], SD[i]);
            let (shape, sigma) = ((mean / sd).powi(2), sd / mean);
            CoordinateFindings {
                name: NAMES[i].into(),
                symbol: ["x1", "x2", "x3", "σ²"][i].into(),
                unit: unit(units[i]),
                role: if i < 3 { Role::Parameter } else { Role::Hyperparameter },
                prior: Some(prior),
                reference: references[i],
                mean,
                sd,
                q025: mean - 1.96 * sd,
                median: mean,
                q975: mean + 1.96 * sd,
                map: mean + 0.03 * sd,
                r_hat: [1.013, 1.006, 1.004, 1.002][i],
                ess_bulk: [1740.0, 2214.0, 2380.0, 2901.0][i],
                ess_tail: [2620.0, 3105.0, 2970.0, 4010.0][i],
                mcse_mean: sd / 41.0,
                autocorrelation_time: 41.2,
                fits: vec![
                    fit(Distribution::Normal([mean, sd]), 0.011, 0.74, 0.0),
                    fit(Distribution::Gamma([shape, mean / shape]), 0.014, 0.48, 3.1),
                    fit(Distribution::LogNormal([mean.ln(), sigma]), 0.016, 0.34, 5.7),
                ],
            }
        })
        .collect()
}

fn correlation() -> Matrix {
    let entries = [
        [1.0, 0.04, 0.19, -0.01],
        [0.04, 1.0, -0.84, 0.02],
        [0.19, -0.84, 1.0, 0.00],
        [-0.01, 0.02, 0.00, 1.0],
    ];
    Matrix::from_rows(4, entries)
}
