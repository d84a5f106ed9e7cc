//! The density of members of populations in their coordinates: gradients, Jacobians, pooling and draws of the prior.

use lacuna::data::{Dependence, Form, JointPrior, Parameter, Population};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::{Fact, Hyperparameter, Target};
use lacuna_linalg::Matrix;

use lacuna_engine::posterior::{LogLikelihood, Posterior};

const DATA: [f64; 3] = [1.9, 0.8, 3.1];
const SD: [f64; 3] = [0.3, 0.5, 0.2];

/// One datum of known standard deviation for each of three members, on the scale of the population.
struct OneEach {
    log: bool,
    hyper: [Hyperparameter; 1],
}

impl LogLikelihood for OneEach {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }
    fn values(&self, theta: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let of = |i: usize| self.value_and_gradient(theta.row(i), hyper.row(i)).0;
        (0..theta.rows()).map(of).collect()
    }
    fn value_and_gradient(&self, theta: &[f64], hyper: &[f64]) -> (f64, Vec<f64>) {
        let (mut value, mut gradient) = (-hyper[0], vec![0.0; theta.len() + 1]);
        gradient[theta.len()] = -1.0;
        for g in 0..3 {
            let u = if self.log { theta[g].ln() } else { theta[g] };
            let z = (u - DATA[g]) / SD[g];
            value -= 0.5 * z * z;
            gradient[g] = -z / SD[g] * if self.log { 1.0 / theta[g] } else { 1.0 };
        }
        (value, gradient)
    }
    fn facts(&self) -> Vec<Fact> {
        Vec::new()
    }
}

fn parts(form: Form, centred: Option<f64>) -> (Vec<Parameter>, Dependence, OneEach) {
    let any = Distribution::Normal([0.0, 100.0]);
    let mut parameters: Vec<Parameter> =
        ["x[a]", "x[b]", "x[c]"].iter().map(|name| Parameter::plain(name, any.clone())).collect();
    parameters.push(Parameter::plain("x.mean", Distribution::LogNormal([0.6, 0.5])));
    parameters.push(Parameter::plain("x.sd", Distribution::HalfNormal(0.8)));
    let population = Population {
        name: "x".into(),
        form,
        members: vec![0, 1, 2],
        groups: ["a", "b", "c"].map(String::from).to_vec(),
        location: 3,
        scale: 4,
        typical: 0.54,
        centred,
    };
    let dependence = Dependence { populations: vec![population], ..Dependence::default() };
    let hyper = Hyperparameter {
        name: "sigma".into(),
        symbol: String::new(),
        unit: lacuna::data::Unit::dimensionless(),
        log: true,
        start: 1.0,
        prior: Distribution::HalfNormal(1.0),
    };
    (parameters, dependence, OneEach { log: form == Form::LogNormal, hyper: [hyper] })
}

const FORMS: [Form; 3] = [Form::Normal, Form::LogNormal, Form::StudentT(4.0)];
const DEGREES: [f64; 3] = [0.0, 0.35, 1.0];
const NATURAL: [f64; 6] = [1.7, 1.1, 2.6, 1.5, 0.7, 0.4];

fn each(check: impl Fn(&Posterior<'_>)) {
    for form in FORMS {
        for centred in DEGREES {
            let (parameters, dependence, likelihood) = parts(form, Some(centred));
            check(&Posterior::new(JointPrior::new(&parameters, &dependence), likelihood));
        }
    }
}

fn value(target: &dyn Target, point: &[f64]) -> f64 {
    target.log_density(&Matrix::from_vec(1, point.len(), point.to_vec()))[0]
}

#[test]
fn gradients_agree_with_differences() {
    each(|posterior| {
        let informed = posterior.with_centred(&posterior.centred(), &[2.0, 1.0, 4.0]);
        let point = posterior.coordinates(&NATURAL);
        let mode = informed.mode();
        for target in [posterior as &dyn Target, &mode] {
            let (at, gradient) = target.gradient(&point);
            assert!((at - value(target, &point)).abs() < 1e-12);
            for j in 0..point.len() {
                let moved = |h: f64| {
                    let mut moved = point.clone();
                    moved[j] += h;
                    value(target, &moved)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((gradient[j] - difference).abs() < 1e-6 * (1.0 + difference.abs()), "{j}");
            }
        }
    });
}

/// Determinant by elimination.
fn determinant(mut rows: Vec<Vec<f64>>) -> f64 {
    let mut product = 1.0;
    for k in 0..rows.len() {
        let best =
            (k..rows.len()).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap();
        if best != k {
            rows.swap(k, best);
            product = -product;
        }
        product *= rows[k][k];
        for i in k + 1..rows.len() {
            let factor = rows[i][k] / rows[k][k];
            let pivot = rows[k].clone();
            rows[i].iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    product
}

/// The density of the coordinates is that of the natural values times the determinant of the map between them.
#[test]
fn the_jacobian_is_the_determinant_of_the_coordinates() {
    each(|posterior| {
        let point = posterior.coordinates(&NATURAL);
        let back = posterior.natural(&point);
        back.iter().zip(NATURAL).for_each(|(a, b)| assert!((a - b).abs() < 1e-12 * b.abs()));
        let slope = |j: usize, h: f64| {
            let mut moved = point.clone();
            moved[j] += h;
            posterior.natural(&moved)
        };
        let rows = (0..point.len()).map(|j| {
            let (above, below) = (slope(j, 1e-5), slope(j, -1e-5));
            above.iter().zip(&below).map(|(a, b)| (a - b) / 2e-5).collect()
        });
        let jacobian = determinant(rows.collect()).abs().ln();
        let prior = posterior.prior();
        let hyper = posterior.hyperparameters()[0].prior.log_density(NATURAL[5]);
        let data = {
            let (_, _, likelihood) = parts(prior.dependence().populations[0].form, None);
            likelihood.value_and_gradient(&NATURAL[..5], &NATURAL[5..]).0
        };
        let expected = prior.log_density(&NATURAL[..5]) + hyper + data + jacobian;
        assert!((value(posterior, &point) - expected).abs() < 1e-8);
    });
}

/// With normal data of standard deviation `σ` a member is pulled to its population by the factor `σ² / (σ² + τ²)`.
#[test]
fn pooling_is_that_of_the_normal_model() {
    for form in [Form::Normal, Form::LogNormal] {
        let (parameters, dependence, likelihood) = parts(form, None);
        let posterior = Posterior::new(JointPrior::new(&parameters, &dependence), likelihood);
        let found = posterior.information(&NATURAL);
        assert_eq!(found.len(), 3);
        for (g, together) in found.iter().enumerate() {
            let (data, scatter) = (SD[g] * SD[g], NATURAL[4] * NATURAL[4]);
            let pooling = together.pooling(&NATURAL)[0];
            assert!((pooling - data / (data + scatter)).abs() < 1e-6, "{pooling}");
        }
    }
}

/// With the members at their conditional maxima the density whose maximum is reported is that of location and logarithm of the
/// scale with the members integrated out: `p(m) p(s) s prod_g N(y_g | m, s² + σ_g²)`, up to a constant.
#[test]
fn the_mode_is_that_of_location_and_scale() {
    let (parameters, dependence, likelihood) = parts(Form::Normal, None);
    let posterior = Posterior::new(JointPrior::new(&parameters, &dependence), likelihood);
    let precision = SD.map(|sd| 1.0 / (sd * sd));
    let posterior = posterior.with_centred(&[0.3, 0.0, 1.0], &precision);
    let difference = |m: f64, s: f64| {
        let mut natural = vec![0.0, 0.0, 0.0, m, s, 0.4];
        let mut marginal = parameters[3].prior.log_density(m) + parameters[4].prior.log_density(s);
        marginal += s.ln();
        for g in 0..3 {
            let own = 1.0 / (s * s);
            natural[g] = (precision[g] * DATA[g] + own * m) / (precision[g] + own);
            let variance = s * s + SD[g] * SD[g];
            marginal -= 0.5 * (variance.ln() + (DATA[g] - m).powi(2) / variance);
        }
        value(&posterior.mode(), &posterior.coordinates(&natural)) - marginal
    };
    let constant = difference(1.5, 0.7);
    for (m, s) in [(0.6, 0.2), (2.5, 3.0), (1.9, 1e-3)] {
        assert!((difference(m, s) - constant).abs() < 1e-9);
    }
}

/// Draws of the prior: given location and scale the standardised members are standard normal. The mean square of 3000 has the
/// standard error √(2 / 3000), the mean 1 / √3000.
#[test]
fn draws_of_the_prior_are_those_of_the_population() {
    let (parameters, dependence, likelihood) = parts(Form::Normal, None);
    let prior = JointPrior::new(&parameters, &dependence);
    let posterior = Posterior::new(prior, likelihood);
    let stream = lacuna::math::random::Stream::root(4);
    let draws = posterior.prior_draws(1000, &stream);
    let population = &dependence.populations[0];
    let standard: Vec<f64> = draws
        .iter_rows()
        .flat_map(|point| {
            let natural = posterior.natural(point);
            (0..3).map(move |g| population.standard(natural[g], natural[3], natural[4]))
        })
        .collect();
    let count = standard.len() as f64;
    let mean = standard.iter().sum::<f64>() / count;
    let square = standard.iter().map(|z| z * z).sum::<f64>() / count;
    assert!(mean.abs() < 4.0 / count.sqrt(), "{mean}");
    assert!((square - 1.0).abs() < 4.0 * (2.0 / count).sqrt(), "{square}");
}
