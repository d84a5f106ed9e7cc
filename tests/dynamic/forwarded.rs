//! Optional methods of plugins cross the interface too: a twin in a library gives the same bits.

use lacuna::data::{Axis, Layout, Layouts, Measurements, Parameter, Replicate, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, Known};
use lacuna::plugin::forward::Wanted;
use lacuna::plugin::model::Call;
use lacuna::plugin::reader::MeasurementSource;
use lacuna::plugin::registry::{self, Built, Kind};
use lacuna::plugin::surrogate::{Summand, Training};
use lacuna::plugin::{
    Design, Discrepancy, Emulator, Likelihood, Model, Reader, Sampler, Surrogate, Target,
};
use lacuna::run::{Progress, Silent};
use lacuna_linalg::Matrix;

use super::twin;

/// A built-in plugin and its twin.
fn pair<K: Kind + ?Sized>(name: &str, options: &str) -> [Built<K>; 2] {
    twin();
    [name.to_owned(), format!("twin_{name}")]
        .map(|name| registry::from_text::<K>(&name, options).unwrap_or_else(|e| panic!("{e}")))
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

fn parameters() -> [Parameter; 2] {
    ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 2.0])))
}

#[test]
fn a_library_gives_the_revisions_of_its_plugins() {
    let [own, other] = pair::<dyn Design>("latin_hypercube", "");
    assert_eq!((own.revision, other.revision), (1, 1));
    let rigid = registry::from_text::<dyn Design>("rigid", "").unwrap();
    assert_eq!(rigid.revision, 3);
    assert_eq!(rigid.revisions()["design.rigid"], 3);
    assert_eq!(registry::find::<dyn Design>("rigid").unwrap().revision, 3);
}

#[test]
fn further_points_of_a_design_are_the_same() {
    for (name, options) in [
        ("latin_hypercube", ""),
        ("latin_hypercube", "optimise = \"maximin\""),
        ("quadrature", "level = 1"),
    ] {
        let [own, other] = pair::<dyn Design>(name, options).map(|built| {
            let (stream, parameters) = (Stream::root(7), parameters());
            let known = built.plugin.place(&parameters, 12, &stream).unwrap();
            let further = built.plugin.extend(&parameters, &known, 5, &stream).unwrap();
            assert_eq!((further.rows(), further.columns()), (5, 2));
            assert_eq!(
                built.plugin.faults().iter().find_map(|f| f.said().map(str::to_owned)),
                None
            );
            bits(further.as_slice())
        });
        assert_eq!(own, other, "{name} {options}");
    }
    // A quadrature rule whose nodes would move gives the same error, with the same advice.
    let [own, other] = pair::<dyn Design>("quadrature", "").map(|built| {
        let (stream, parameters) = (Stream::root(7), parameters());
        let known = built.plugin.place(&parameters, 9, &stream).unwrap();
        built.plugin.extend(&parameters, &known, 40, &stream).unwrap_err()
    });
    assert!(other.message.ends_with(&own.message), "{other}");
    assert_eq!((own.help.is_some(), own.help), (true, other.help));
}

const OUTPUTS: usize = 6;

fn layout() -> Layout {
    let axes = vec![
        Axis::labels("sensor", ["A", "B"]),
        Axis::grid("time", vec![0.0, 1.0, 2.0], Unit::parse("s").unwrap()),
    ];
    Layout { name: "strain".to_owned(), unit: Unit::dimensionless(), axes }
}

/// Three replicates with missing values and without stated noise.
fn data() -> Measurements {
    let mut rng = Stream::root(3).generator();
    let mut replicate = |r: usize| {
        let value = |i: usize, e: f64| ((r, i) != (1, 4)).then_some((i as f64).sin() + 0.2 * e);
        let values = (0..OUTPUTS).map(|i| value(i, uniform(&mut rng))).collect();
        Replicate::new(format!("p{r}"), values)
    };
    let replicates = (0..3).map(&mut replicate).collect();
    Measurements::new(layout(), replicates)
}

/// Data in which the second replicate states no noise, or all replicates state it.
fn with_sd(all: bool) -> Measurements {
    let mut data = data();
    for (r, replicate) in data.replicates.iter_mut().enumerate() {
        if all || r != 1 {
            let sd = |(i, y): (usize, &Option<f64>)| y.map_or(0.0, |_| 0.1 + 0.02 * i as f64);
            replicate.sd = Some(replicate.values.iter().enumerate().map(sd).collect());
        }
    }
    data
}

fn with_covariance() -> Measurements {
    let covariance =
        Matrix::from_fn(OUTPUTS, OUTPUTS, |i, j| 0.04 * 0.6_f64.powi(i.abs_diff(j) as i32));
    Measurements { covariance: Some(covariance), ..data() }
}

/// All results of a likelihood for a response: value, derivatives, leave-one-out densities, simulated data, and facts.
fn told(likelihood: &dyn Likelihood) -> (Vec<u64>, Vec<Measurements>, String) {
    let response: Vec<f64> = (0..OUTPUTS).map(|i| (1.1 * i as f64).sin()).collect();
    let hyper: Vec<f64> = likelihood.hyperparameters().iter().map(|h| h.start).collect();
    let (by_response, by_hyper) = likelihood.gradient(&response, &hyper);
    let cheap = f64::from(u8::from(likelihood.is_cheap()));
    let mut numbers = vec![likelihood.log_likelihood(&response, &hyper), cheap];
    numbers.extend(by_response.into_iter().chain(by_hyper));
    numbers.extend(likelihood.left_out(&response, &hyper).unwrap_or_default());
    if let Some(errors) = likelihood.sampled_errors(&hyper) {
        numbers.extend(errors.noise);
        numbers.extend(errors.sampled.into_vec());
        numbers.extend(errors.left_out.into_vec());
    }
    for part in likelihood.predictive(&response, &hyper) {
        numbers.extend(part.variance);
    }
    let made = likelihood.simulate(&response, &hyper, &Stream::root(5));
    let facts = format!("{:?}", likelihood.facts());
    assert_eq!(likelihood.failure(), None);
    (bits(&numbers), made, facts)
}

/// Likelihoods of a discrepancy: of all data, and of a part of them.
fn likelihoods(
    built: &Built<dyn Discrepancy>,
    data: &Measurements,
) -> [Option<Box<dyn Likelihood>>; 2] {
    let factor = Matrix::from_fn(OUTPUTS, 1, |i, _| 0.02 * (1.0 + i as f64));
    let common =
        [CommonError { origin: ErrorOrigin::Emulator, factor: factor.into(), predictive: true }];
    let slopes = || Ok(Matrix::from_fn(OUTPUTS, 2, |i, j| (0.4 * (i + 3 * j) as f64).sin()));
    let known = Known { data, common: &common, slopes: &slopes, parameters: &[] };
    let mut part = data.clone();
    part.replicates[0].values[2] = None;
    part.replicates[2].values.fill(None);
    let whole = built.plugin.likelihood(&known).unwrap_or_else(|e| panic!("{e}"));
    [Some(whole), built.plugin.likelihood_of_part(&known, &part).unwrap_or_else(|e| panic!("{e}"))]
}

#[test]
fn likelihoods_of_parts_and_of_data_that_state_their_noise_are_the_same() {
    let stated = "variance = { measured = { known = 1 } }";
    for (name, options, data, has_part) in [
        ("gaussian", "variance = { half_normal = 1.0 }", data(), true),
        ("gaussian", stated, with_sd(true), true),
        ("gaussian", stated, with_covariance(), true),
        ("gaussian", "variance = { half_normal = 1.0 }", with_sd(true), true),
        ("student_t", "scale = { half_normal = 1.0 }", data(), true),
        (
            "autoregressive",
            "variance = { half_normal = 1.0 }\ncorrelation_time = { log_normal = [-1, 1] }",
            data(),
            true,
        ),
        (
            "gaussian_process",
            "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-1, 1] }\n\
             variance = { half_normal = 1.0 }",
            data(),
            true,
        ),
    ] {
        let [own, other] = pair::<dyn Discrepancy>(name, options);
        assert_eq!(own.plugin.takes_stated_noise(), other.plugin.takes_stated_noise(), "{name}");
        let [own, other] = [own, other].map(|built| {
            let made = likelihoods(&built, &data);
            made.map(|likelihood| likelihood.map(|likelihood| told(&*likelihood)))
        });
        assert_eq!(own[1].is_some(), has_part, "{name} {options}");
        assert!(own == other, "{name} {options}: {own:?} {other:?}");
    }
    // Noise that only some replicates state crosses unchanged, whatever a discrepancy does with it.
    let mixed = with_sd(false);
    let [own, other] = pair::<dyn Discrepancy>("gaussian", stated).map(|built| {
        let made = built.plugin.likelihood(&Known::without_slopes(&mixed, &[]));
        made.map(|made| told(&*made)).map_err(|stop| stop.message)
    });
    match (own, other) {
        (Ok(own), Ok(other)) => assert!(own == other, "{own:?} {other:?}"),
        (Err(own), Err(other)) => assert!(other.ends_with(&own), "{own} {other}"),
        (own, other) => panic!("{own:?} {other:?}"),
    }
}

#[test]
fn noise_that_files_state_is_read_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    let data = with_sd(true);
    let mut plain = String::from("replicate,sensor,time,strain\n");
    let mut stated = String::from("replicate,sensor,time,strain,sigma\n");
    for replicate in &data.replicates {
        let sd = replicate.sd.as_ref().unwrap();
        for (i, value) in replicate.values.iter().enumerate() {
            let Some(value) = value else { continue };
            let place = format!("{},{},{}", replicate.name, ["A", "B"][i / 3], i % 3);
            plain += &format!("{place},{value}\n");
            stated += &format!("{place},{value},{}\n", sd[i]);
        }
    }
    write("plain.csv", plain);
    write("stated.csv", stated);
    let covariance = with_covariance().covariance.unwrap();
    let row = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    write("covariance.txt", covariance.iter_rows().map(row).collect::<Vec<_>>().join("\n"));
    let layout = layout();
    let source = MeasurementSource { directory: folder.path(), scenario: None, layout: &layout };
    for (options, expected) in [
        ("path = \"plain.csv\"", data_without_noise(&data)),
        ("path = \"stated.csv\"", data.clone()),
        (
            "path = \"plain.csv\"\ncovariance = \"covariance.txt\"",
            Measurements { covariance: Some(covariance.clone()), ..data_without_noise(&data) },
        ),
    ] {
        for built in pair::<dyn Reader>("csv", options) {
            let read = built.plugin.measurements(&source).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(read, expected, "{} {options}", built.name);
        }
    }
    for (options, expected) in [("", 0), ("allow_failed = 3", 3), ("allow_failed = 0.25", 10)] {
        for built in pair::<dyn Reader>("csv", options) {
            assert_eq!(built.plugin.allowed_failures(40), Some(expected), "{options}");
        }
    }
}

fn data_without_noise(data: &Measurements) -> Measurements {
    let bare = |r: &Replicate| Replicate::new(r.name.clone(), r.values.to_vec());
    Measurements::new(data.layout.clone(), data.replicates.iter().map(bare).collect())
}

/// A standard normal density.
struct Normal;

impl Target for Normal {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|x| -0.5 * x.iter().map(|x| x * x).sum::<f64>()).collect()
    }
    fn log_prior(&self, points: &Matrix) -> Vec<f64> {
        self.log_density(points)
    }
    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let density = -0.5 * point.iter().map(|x| x * x).sum::<f64>();
        (density, point.iter().map(|x| -x).collect())
    }
    fn bounds(&self) -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); 2]
    }
    fn prior_draws(&self, count: usize, stream: &Stream) -> Matrix {
        let mut rng = stream.generator();
        Matrix::from_fn(count, 2, |_, _| uniform(&mut rng))
    }
}

#[test]
fn samplers_say_the_same_of_their_starts_and_steps() {
    let mut told_of = 0;
    for name in ["adaptive_metropolis", "affine_invariant_ensemble", "nested", "no_u_turn"] {
        let [own, other] = pair::<dyn Sampler>(name, "").map(|built| {
            let sampler = built.plugin;
            let chains = sampler.plan(2).chains;
            let mut state =
                sampler.start(&Normal, Normal.prior_draws(chains, &Stream::root(1))).unwrap();
            let mut statistics = vec![sampler.statistics(&state)];
            for step in 0..3 {
                sampler.step(&Normal, &mut state, &Stream::root(2).at(step)).unwrap();
                statistics.push(sampler.statistics(&state));
            }
            let statistics: Vec<_> = statistics
                .into_iter()
                .flatten()
                .map(|one| (one.name, one.kind, bits(&one.values)))
                .collect();
            ((sampler.uses_starts(), sampler.start_where(), sampler.steps_are_draws()), statistics)
        });
        assert_eq!(own, other, "{name}");
        told_of += own.1.len();
    }
    assert!(told_of > 0);
}

#[test]
fn a_response_with_its_derivatives_is_the_same() {
    let options = "observe = \"a + sin(b * time / 1 {s}) + b\"";
    let axes = vec![Axis::grid("time", vec![1.0, 2.0, 3.0], Unit::parse("s").unwrap())];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    let (names, scenario) = (["a", "b"].map(str::to_owned), Scenario::default());
    let units = [Unit::dimensionless(), Unit::dimensionless()];
    let call = Call { units: &units, ..Call::new(&[0.3, 0.7], &names, &layout, &scenario) };
    let [own, other] = pair::<dyn Model>("equations", options).map(|built| {
        let both = built.plugin.gradient().unwrap().with_response(&call);
        let (response, slopes) = both.unwrap().unwrap_or_else(|e| panic!("{e}"));
        (bits(&response.values), response.valid, response.facts, bits(slopes.as_slice()))
    });
    assert_eq!(own.3.len(), 6);
    assert_eq!(own, other);
}

/// All results of an emulator at a point, separately and together with its derivatives.
fn said(emulator: &dyn Emulator) -> Vec<u64> {
    let point = [0.3, 1.2];
    let (mean, jacobian) = emulator.mean_and_jacobian(&point);
    let (again, some) = emulator.mean_and_jacobian_by(&point, Wanted::by(&[1]));
    assert_eq!((mean.len(), jacobian.columns(), some.columns()), (3, 2, 1));
    assert_eq!((&again, some), (&mean, jacobian.select_columns(&[1])));
    assert_eq!(emulator.mean_and_jacobian_by(&point, Wanted::by(&[])).1.columns(), 0);
    assert_eq!(emulator.failure(), None);
    bits(&[mean, jacobian.into_vec(), emulator.jacobian(&point).into_vec()].concat())
}

#[test]
fn emulators_and_their_sums_are_the_same() {
    let axes = vec![Axis::labels("sensor", ["A", "B", "C"])];
    let layouts = Layouts::from(Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes });
    let parameters = parameters();
    let mut rng = Stream::root(4).generator();
    let points = Matrix::from_fn(40, 2, |_, _| 2.0 * uniform(&mut rng));
    let of = |k: f64| {
        Matrix::from_fn(40, 3, |i, j| (points[(i, 0)] + k * points[(i, 1)] * j as f64).cos())
    };
    for (name, has_sum) in [("polynomial_chaos", true), ("gaussian_process", false)] {
        let options = if has_sum { "degree = { max = 4 }" } else { "nugget = 1e-8" };
        let [own, other] = pair::<dyn Surrogate>(name, options).map(|built| {
            let fit = |k: f64| {
                let (layouts, responses) = (&layouts, &of(k));
                let training = Training {
                    parameters: &parameters,
                    layouts,
                    points: &points,
                    responses,
                    gradients: None,
                };
                let progress = Progress::new(&Silent);
                built.plugin.fit(&training, &Stream::root(2), &progress).unwrap()
            };
            let emulators = [fit(0.3), fit(0.7)];
            let saved = emulators.each_ref().map(|emulator| emulator.save().unwrap());
            let weights = [[1.0, 2.0, 0.5], [-1.0, 0.25, 3.0]];
            let parts = [0, 1].map(|i| Summand { bytes: &saved[i], weights: &weights[i] });
            let sum = built.plugin.sum(&parts, &[0.1, 0.2, 0.3]).unwrap();
            // Emulators that cannot be combined have no sum.
            assert!(built.plugin.sum(&parts, &[0.1]).unwrap().is_none());
            (emulators.map(|emulator| said(&*emulator)), sum.map(|sum| said(&*sum)))
        });
        assert_eq!(own.1.is_some(), has_sum);
        assert_eq!(own, other, "{name}");
    }
}
