//! Tests of `expression`.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use lacuna::data::{Layout, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::registry::from_text;
use lacuna::text::read::read;
use lacuna::text::{Node, Problems, Sources};

use super::*;

fn parameters(names: &[&str]) -> Vec<Parameter> {
    let parameter = |name: &&str| Parameter {
        name: (*name).to_owned(),
        symbol: (*name).to_owned(),
        unit: Unit::dimensionless(),
        design: Distribution::Uniform([0.0, 1.0]),
        prior: Distribution::Uniform([0.0, 1.0]),
        reference: None,
    };
    names.iter().map(parameter).collect()
}

/// Returns a target with these definitions and data.
fn target(log_density: &str, definitions: &[(&str, &str)], data: &[(&str, Data)]) -> Expression {
    let definition = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
    let known = |(name, data): &(&str, Data)| ((*name).to_owned(), Known(data.clone()));
    Expression {
        log_density: log_density.to_owned(),
        definitions: definitions.iter().map(definition).collect(),
        data: data.iter().map(known).collect(),
        includes_prior: true,
    }
}

use lacuna::expression::Data;

/// Returns the problems that `check` reports for a section, as a user sees them.
fn complaints(section: &str) -> String {
    let mut sources = Sources::default();
    let mut problems = Problems::new();
    let id = sources.add_file(Path::new("study.toml"), section.to_owned());
    let root = read(id, &sources, &mut problems).unwrap();
    let node: &Node = root.get("target").unwrap();
    let options: Option<Expression> = lacuna::text::decode(node, &mut problems);
    let layout = Layout { name: "none".into(), unit: Unit::dimensionless(), axes: Vec::new() };
    let parameters = parameters(&["a", "sigma"]);
    let context = Context::new(Path::new("."), &parameters, &layout);
    if let Some(options) = options {
        options.check(&context, &mut Complaints::new(node, &mut problems));
    }
    problems.render(&sources)
}

#[test]
fn complaints_point_into_the_string() {
    let text = "[target]\nlog_density = \"-(a / sigmma)^2\"\n";
    assert_eq!(
        complaints(text),
        "study.toml:2:22: unknown name `sigmma`\n  \
         |\n\
         2 | log_density = \"-(a / sigmma)^2\"\n  \
         |                      ^^^^^^\n  \
         = help: did you mean `sigma`?\n"
    );
    let text = "[target]\nlog_density = '''\n  a\n  + sum(b)\n'''\nwhere = { b = \"a * sigma\" }\n";
    assert_eq!(
        complaints(text),
        "study.toml:4:9: one number stands where a vector belongs\n  \
         |\n\
         4 |   + sum(b)\n  \
         |         ^\n  \
         = expected a vector\n"
    );
}

#[test]
fn every_fault_is_told_at_its_option() {
    for (options, told) in [
        ("log_density = 'b'\nwhere = { b = 'a +' }", ":3:19: a value is missing"),
        ("log_density = 'b'\nwhere = { b = 'a + c' }", ":3:20: unknown name `c`"),
        ("log_density = 'y'\ndata = { y = [1, 2] }", ":2:16: the log density is a vector"),
        ("log_density = 'y'\ndata = { y = [] }", "the data `y` are empty"),
        ("log_density = 'a'\ndata = { a = 1 }", "there are two of the name `a`"),
        ("log_density = 'y'\ndata = { y = [1, [2]] }", "found both"),
        ("log_density = 'y'\ndata = { y = [[1], [2, 3]] }", "found 2 in row 2"),
        (
            "log_density = 'y'\ndata = { y = 'one' }",
            "a number, a list of numbers or a list of rows",
        ),
        ("log_density = 'y'\ndata = { y = nan }", "expected a finite number"),
        ("log_density = 'a > 1'", "a condition is not a number"),
        ("log_density = 'a'\nincludes_prior = true", "does not depend on `sigma`"),
        ("density = 'a'", "unknown key `density`"),
    ] {
        let found = complaints(&format!("[target]\n{options}\n"));
        assert!(found.contains(told), "{options}: {found}");
    }
    assert_eq!(complaints("[target]\nlog_density = '-a^2'\n"), "");
}

#[test]
fn options_are_written_as_they_are_read() {
    let text = "log_density = \"y[1] * a + sum(matrix_product(X, b))\"\nincludes_prior = false\n\
                [data]\nX = [[1.0, 2.0], [3.0, 4.0]]\nk = 2.0\ny = [1.0, 2.0]\n\
                [where]\nb = \"[a, sigma]\"\n";
    let built = from_text::<dyn Density>("expression", text).unwrap();
    let again = lacuna::text::emit::to_toml(&built.options).unwrap();
    assert_eq!(from_text::<dyn Density>("expression", &again).unwrap().options, built.options);
    let bound = built.plugin.bind(&parameters(&["a", "sigma"])).unwrap();
    let (value, gradient) = bound.gradient(&[1.0, 10.0]);
    assert_eq!((value, &gradient[..]), (65.0, &[5.0, 6.0][..]));
}

#[test]
fn what_is_undefined_or_infinite_has_no_density() {
    let bound = target("log(a) - 0 * b", &[], &[]).bind(&parameters(&["a", "b"])).unwrap();
    let points = [[-1.0, 0.0], [0.0, 0.0], [f64::INFINITY, 0.0], [f64::NAN, 0.0], [1.0, 2.0]];
    let values = bound.log_density(&Matrix::from_rows(2, points));
    assert_eq!(values, [[f64::NEG_INFINITY; 4].as_slice(), &[0.0]].concat());
    assert_eq!(bound.gradient(&[-1.0, 0.0]), (f64::NEG_INFINITY, vec![0.0, 0.0]));
}

#[test]
fn large_batches_have_the_bits_of_single_points() {
    let y: Vec<f64> = (0..500).map(|i| (0.1 * f64::from(i)).sin()).collect();
    let density = target("sum(normal_log_density(y, a, s))", &[], &[("y", Data::Vector(y))]);
    let bound = density.bind(&parameters(&["a", "s"])).unwrap();
    let mut rng = Stream::root(3).generator();
    let points = Matrix::from_fn(301, 2, |_, _| uniform(&mut rng));
    let together = bound.log_density(&points);
    for (i, value) in together.iter().enumerate() {
        assert_eq!(bound.log_density(&points.select_rows(&[i])), [*value]);
        assert_eq!(bound.gradient(points.row(i)).0, *value);
    }
}

/// Asserts the values of a formula and, by differences, its gradient.
fn is(bound: &dyn BoundDensity, formula: impl Fn(&[f64]) -> f64, points: &[Vec<f64>]) {
    for point in points {
        let (value, gradient) = bound.gradient(point);
        let expected = formula(point);
        let close = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * b.abs().max(1.0);
        assert!(close(value, expected, 1e-11), "{value}, expected {expected} at {point:?}");
        for j in 0..point.len() {
            let by = |h: f64| {
                let moved = |step: f64| {
                    let mut moved = point.clone();
                    moved[j] += step;
                    formula(&moved)
                };
                (moved(h) - moved(-h)) / (2.0 * h)
            };
            let h = 1e-4 * point[j].abs().max(1e-2);
            let slope = (4.0 * by(h) - by(2.0 * h)) / 3.0;
            assert!(
                close(gradient[j], slope, 1e-5),
                "slope {j}: {}, expected {slope}",
                gradient[j]
            );
        }
    }
}

fn normal(x: f64, mean: f64, sd: f64) -> f64 {
    -0.5 * ((x - mean) / sd).powi(2) - sd.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
}

fn cauchy(x: f64, scale: f64) -> f64 {
    -(std::f64::consts::PI * scale * (1.0 + (x / scale).powi(2))).ln()
}

/// Returns the data of a posteriordb posterior if its file is available.
fn posteriordb(name: &str) -> Option<serde_json::Value> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/reference/posteriordb");
    let Ok(text) = std::fs::read_to_string(Path::new(folder).join(format!("{name}.json"))) else {
        println!("skipped: {folder} is not there");
        return None;
    };
    let mut file: serde_json::Value = serde_json::from_str(&text).unwrap();
    Some(file["data"].take())
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Rubin, Estimation in parallel randomized experiments, J. Educ. Stat. 6 (1981) 377; the model in posteriordb's form
/// `eight_schools_noncentered`.
#[test]
fn eight_schools() {
    let y = [28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0];
    let sigma = [15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0];
    let names = ["mu", "tau", "t1", "t2", "t3", "t4", "t5", "t6", "t7", "t8"];
    let density = target(
        "if(tau > 0, prior + sum(normal_log_density(y, mu + tau * t, sigma)), log(0))",
        &[
            ("t", "[t1, t2, t3, t4, t5, t6, t7, t8]"),
            (
                "prior",
                "sum(normal_log_density(t, 0, 1)) + normal_log_density(mu, 0, 5)
                 + cauchy_log_density(tau, 0, 5)",
            ),
        ],
        &[("y", Data::Vector(y.to_vec())), ("sigma", Data::Vector(sigma.to_vec()))],
    );
    let bound = density.bind(&parameters(&names)).unwrap();
    let formula = |p: &[f64]| {
        let (mu, tau, t) = (p[0], p[1], &p[2..]);
        let schools: f64 =
            (0..8).map(|j| normal(t[j], 0.0, 1.0) + normal(y[j], mu + tau * t[j], sigma[j])).sum();
        schools + normal(mu, 0.0, 5.0) + cauchy(tau, 5.0)
    };
    let point = vec![4.4, 3.6, 0.3, 0.1, -0.2, 0.0, -0.3, -0.1, 0.5, 0.2];
    let other = vec![-1.0, 12.0, 1.3, -0.4, 0.2, 1.0, 0.3, -2.1, 0.6, 0.7];
    is(&*bound, formula, &[point, other]);
    let outside = vec![4.4, -3.6, 0.3, 0.1, -0.2, 0.0, -0.3, -0.1, 0.5, 0.2];
    assert_eq!(bound.gradient(&outside).0, f64::NEG_INFINITY);
}

/// posteriordb, `kidiq-kidscore_momhsiq`.
#[test]
fn scores_of_children() {
    let Some(data) = posteriordb("kidiq-kidscore_momhsiq") else { return };
    let of = |name: &str| numbers(&data[name]);
    let (score, hs, iq) = (of("kid_score"), of("mom_hs"), of("mom_iq"));
    let density = target(
        "sum(normal_log_density(score, b1 + b2 * hs + b3 * iq, sigma)) + cauchy_log_density(sigma, 0, 2.5)",
        &[],
        &[
            ("score", Data::Vector(score.clone())),
            ("hs", Data::Vector(hs.clone())),
            ("iq", Data::Vector(iq.clone())),
        ],
    );
    let bound = density.bind(&parameters(&["b1", "b2", "b3", "sigma"])).unwrap();
    let formula = |p: &[f64]| {
        let one = |i: usize| normal(score[i], p[0] + p[1] * hs[i] + p[2] * iq[i], p[3]);
        (0..score.len()).map(one).sum::<f64>() + cauchy(p[3], 2.5)
    };
    is(&*bound, formula, &[vec![25.79, 5.99, 0.563, 18.14], vec![20.0, 3.0, 0.6, 25.0]]);
}

/// posteriordb, `sblrc-blr`.
#[test]
fn linear_regression_with_a_matrix() {
    let Some(data) = posteriordb("sblrc-blr") else { return };
    let y = numbers(&data["y"]);
    let rows: Vec<Vec<f64>> = data["X"].as_array().unwrap().iter().map(numbers).collect();
    let density = target(
        "sum(normal_log_density(y, matrix_product(X, beta), sigma)) + prior",
        &[
            ("beta", "[b1, b2, b3, b4, b5]"),
            ("prior", "sum(normal_log_density(beta, 0, 10)) + normal_log_density(sigma, 0, 10)"),
        ],
        &[("y", Data::Vector(y.clone())), ("X", Data::Matrix(Matrix::from_rows(5, &rows)))],
    );
    let names = ["b1", "b2", "b3", "b4", "b5", "sigma"];
    let bound = density.bind(&parameters(&names)).unwrap();
    let formula = |p: &[f64]| {
        let (beta, sigma) = p.split_at(5);
        let line = |row: &[f64]| row.iter().zip(beta).map(|(x, b)| x * b).sum::<f64>();
        let data: f64 = y.iter().zip(&rows).map(|(y, row)| normal(*y, line(row), sigma[0])).sum();
        data + beta.iter().chain(sigma).map(|b| normal(*b, 0.0, 10.0)).sum::<f64>()
    };
    is(&*bound, formula, &[vec![1.0, 0.999, 0.998, 1.0, 0.9985, 1.04]]);
}

/// posteriordb, `low_dim_gauss_mix-low_dim_gauss_mix`.
#[test]
fn mixture_of_two_normal_laws() {
    let Some(data) = posteriordb("low_dim_gauss_mix-low_dim_gauss_mix") else { return };
    let y = numbers(&data["y"]);
    let density = target(
        "if(m1 < m2, prior + sum(log_sum_exp(log(p) + normal_log_density(y, m1, s1),
                                 log(1 - p) + normal_log_density(y, m2, s2))), log(0))",
        &[("prior", "sum(normal_log_density([m1, m2, s1, s2], 0, 2)) + beta_log_density(p, 5, 5)")],
        &[("y", Data::Vector(y.clone()))],
    );
    let bound = density.bind(&parameters(&["m1", "m2", "s1", "s2", "p"])).unwrap();
    let formula = |p: &[f64]| {
        let mix = |y: &f64| {
            let one = p[4] * normal(*y, p[0], p[2]).exp();
            (one + (1.0 - p[4]) * normal(*y, p[1], p[3]).exp()).ln()
        };
        // 9! / (4! 4!) = 630.
        let beta = 630f64.ln() + 4.0 * (p[4] * (1.0 - p[4])).ln();
        let prior: f64 = p[..4].iter().map(|x| normal(*x, 0.0, 2.0)).sum();
        y.iter().map(mix).sum::<f64>() + prior + beta
    };
    is(&*bound, formula, &[vec![-2.73, 2.87, 1.03, 1.02, 0.62], vec![-2.0, 2.0, 1.5, 0.7, 0.4]]);
}

/// posteriordb, `garch-garch11`: the variance of each value follows from the previous value and variance.
#[test]
fn recurrence_of_variances() {
    let Some(data) = posteriordb("garch-garch11") else { return };
    let (y, first) = (numbers(&data["y"]), data["sigma1"].as_f64().unwrap());
    let n = y.len();
    let density = target(
        "normal_log_density(y[1], mu, sigma1)
         + sum(normal_log_density(y[2:LAST], mu, sqrt(recurrence(sigma1^2, beta1, shock))))"
            .replace("LAST", &n.to_string())
            .as_str(),
        &[("shock", &format!("alpha0 + alpha1 * (y[1:{}] - mu)^2", n - 1))],
        &[("y", Data::Vector(y.clone())), ("sigma1", Data::Number(first))],
    );
    let bound = density.bind(&parameters(&["mu", "alpha0", "alpha1", "beta1"])).unwrap();
    let formula = |p: &[f64]| {
        let mut variance = first * first;
        let mut total = normal(y[0], p[0], first);
        for pair in y.windows(2) {
            variance = p[1] + p[2] * (pair[0] - p[0]).powi(2) + p[3] * variance;
            total += normal(pair[1], p[0], variance.sqrt());
        }
        total
    };
    is(&*bound, formula, &[vec![5.05, 1.5, 0.5, 0.3], vec![4.0, 0.3, 0.9, 0.05]]);
}
