//! Priors that depend on each other, against posteriors and evidences in closed form.
//!
//! A tolerance is four times the printed Monte Carlo error; exceeded with a probability of 6e-5 per figure.

mod closed;

use std::fs;
use std::path::Path;

use lacuna::diagnose::coverage::{Noise, Word};
use serde_json::Value;
use tempfile::TempDir;

use crate::coverage::verb;
use crate::quick;
use closed::Linear;

/// A study of a log density with these sections.
fn target(
    parameters: &[(&str, &str)],
    sections: &str,
    log_density: &str,
    sampler: &str,
) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let one = |(name, prior): &(&str, &str)| {
        if prior.is_empty() {
            format!("[[parameter]]\nname = \"{name}\"\n\n")
        } else {
            format!("[[parameter]]\nname = \"{name}\"\nprior = {prior}\n\n")
        }
    };
    let parameters: String = parameters.iter().map(one).collect();
    let text = format!(
        "[study]\ntitle = \"priors\"\nseed = 11\n\n{parameters}{sections}\n\n[target]\nuse = \"expression\"\n\
         log_density = \"{log_density}\"\n\n[sampler]\n{sampler}\n"
    );
    fs::write(folder.path().join("study.toml"), text).unwrap();
    folder
}

fn summary(folder: &Path) -> Value {
    let ran = quick::run(&folder.join("study.toml"), &[], &folder.join("out"));
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(&folder.join("out"))
}

fn number(value: &Value, pointer: &str) -> f64 {
    value
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no {pointer} in {value}"))
}

fn mean_is(summary: &Value, name: &str, expected: f64) {
    let (mean, error) = (
        number(summary, &format!("/parameters/{name}/mean")),
        number(summary, &format!("/parameters/{name}/mcse_mean")),
    );
    assert!((mean - expected).abs() < 4.0 * error, "{name}: {mean} ± {error}, exactly {expected}");
}

/// The error of a standard deviation of a normal distribution is `sd / sqrt(2 n)`, with `n = (sd / mcse_mean)²` draws.
fn sd_is(summary: &Value, name: &str, expected: f64) {
    let sd = number(summary, &format!("/parameters/{name}/sd"));
    let draws = (sd / number(summary, &format!("/parameters/{name}/mcse_mean"))).powi(2);
    let error = 4.0 / (2.0 * draws).sqrt();
    assert!(
        (sd / expected - 1.0).abs() < error,
        "{name}: sd {sd}, exactly {expected}, {draws} draws"
    );
}

fn evidence_is(summary: &Value, expected: f64) {
    let (log, error) = (number(summary, "/evidence/log"), number(summary, "/evidence/error"));
    assert!((log - expected).abs() < 4.0 * error, "{log} ± {error}, exactly {expected}");
    assert!(error < 0.1, "{error}");
}

const NUTS: &str = "use = \"no_u_turn\"";
const PARTICLES: &str = "use = \"sequential_monte_carlo\"\nparticles = 4000";
const NESTED: &str = "use = \"nested\"";

/// A straight line with normal noise and correlated normal priors: the posterior and the evidence are those of the conjugate
/// normal model (Gelman et al., Bayesian Data Analysis (2013), section 14.2).
#[test]
fn a_line_with_correlated_priors_has_its_conjugate_posterior() {
    let line = Linear {
        mean: [0.5, -1.0],
        sd: [2.0, 0.7],
        rho: -0.8,
        x: vec![0.0, 1.0, 2.0, 4.0],
        y: vec![1.1, 0.2, -0.4, -2.9],
        noise: 1.0,
    };
    let exact = line.posterior();
    for sampler in [NUTS, PARTICLES, NESTED] {
        let folder = target(
            &[("a", "{ normal = [0.5, 2.0] }"), ("b", "{ normal = [-1.0, 0.7] }")],
            "[[dependence]]\nparameters = [\"a\", \"b\"]\ncorrelation = -0.8",
            &line.log_likelihood(),
            sampler,
        );
        let found = summary(folder.path());
        for (j, name) in ["a", "b"].into_iter().enumerate() {
            mean_is(&found, name, exact.mean[j]);
            sd_is(&found, name, exact.sd[j]);
        }
        evidence_is(&found, exact.log_evidence);
    }
}

/// A likelihood inside one order of `n` numbers has `n!` times the evidence if only that order is possible.
#[test]
fn an_order_multiplies_the_evidence_by_the_number_of_orders() {
    let centres = [0.2, 0.5, 0.8];
    let term = |(j, c): (usize, &f64)| format!("normal_log_density(k{j}, {c}, 0.04)");
    let terms: Vec<String> = centres.iter().enumerate().map(term).collect();
    let prior = "{ uniform = [0, 1] }";
    for sampler in [NUTS, PARTICLES, NESTED] {
        let folder = target(
            &[("k0", prior), ("k1", prior), ("k2", prior)],
            "[[constraint]]\nformula = \"k0 < k1 and k1 < k2\"",
            &terms.join(" + "),
            sampler,
        );
        let found = summary(folder.path());
        (0..3).for_each(|j| mean_is(&found, &format!("k{j}"), centres[j]));
        evidence_is(&found, 6.0_f64.ln());
    }
}

/// Without data the posterior is the prior: the mean of `u v`, by quadrature of the copulas' distribution functions.
#[test]
fn posteriors_without_data_are_the_joint_priors() {
    // E[UV] is the integral of C(u, v) over the unit square (Hoeffding).
    for (copula, expected) in [
        ("copula = \"clayton\"\ntheta = 2.0", 0.306_852_819_44),
        ("copula = \"gumbel\"\nkendall = 0.5", 0.306_852_819_46),
        ("copula = \"frank\"\ntheta = 5.0", 0.303_623_925_67),
        ("copula = \"frank\"\ntheta = -4.0", 0.203_565_250_11),
        // 1/4 + asin(r / 2) / (2 pi), with r = 2 sin(pi rho_s / 6) for Spearman's rho_s = 0.6: (rho_s + 3) / 12.
        ("spearman = 0.6", 0.3),
    ] {
        let folder = target(
            &[("u", "{ uniform = [0, 1] }"), ("v", "{ uniform = [0, 1] }")],
            &format!(
                "[[dependence]]\nparameters = [\"u\", \"v\"]\n{copula}\n\n[[derived]]\nname = \"product\"\nexpression = \"u * v\""
            ),
            "0 * u",
            NUTS,
        );
        let found = summary(folder.path());
        mean_is(&found, "u", 0.5);
        mean_is(&found, "v", 0.5);
        mean_is(&found, "product", expected);
        evidence_is(&found, 0.0);
    }
}

/// Counts of three kinds with a Dirichlet prior: the posterior is Dirichlet, the evidence Dirichlet-multinomial without the
/// number of orders (Gelman et al., section 3.4).
#[test]
fn counts_with_dirichlet_shares_have_their_conjugate_posterior() {
    let (a, n) = ([2.0, 1.0, 1.5], [7.0, 3.0, 12.0]);
    let (sum, all): (f64, f64) = (a.iter().sum(), n.iter().sum());
    let ln_gamma = lacuna::math::special::ln_gamma;
    let log_evidence = ln_gamma(sum) - ln_gamma(sum + all)
        + (0..3).map(|i| ln_gamma(a[i] + n[i]) - ln_gamma(a[i])).sum::<f64>();
    for sampler in [NUTS, PARTICLES, NESTED] {
        let folder = target(
            &[("w1", ""), ("w2", "")],
            "[[dependence]]\nparameters = [\"w1\", \"w2\"]\ndirichlet = [2.0, 1.0, 1.5]",
            "7 * log(w1) + 3 * log(w2) + 12 * log(1 - w1 - w2)",
            sampler,
        );
        let found = summary(folder.path());
        for (i, name) in ["w1", "w2"].into_iter().enumerate() {
            let mean = (a[i] + n[i]) / (sum + all);
            mean_is(&found, name, mean);
        }
        evidence_is(&found, log_evidence);
    }
}

/// Simulation-based calibration: truths from the joint prior have uniform ranks in their posteriors.
#[test]
fn a_study_with_dependent_priors_is_calibrated() {
    let folder = verb::study(0.5);
    let path = folder.path().join("study.toml");
    let text = fs::read_to_string(&path).unwrap();
    let (a, b) = ("level0", "rise");
    let more = format!(
        "\n[[dependence]]\nparameters = [\"{a}\", \"{b}\"]\ncopula = \"student_t\"\ncorrelation = 0.9\n\
         degrees_of_freedom = 3\n\n[[constraint]]\nformula = \"{a} > -0.5 {{m}} and {b} < 0.6 {{m/s}}\"\n"
    );
    fs::write(&path, text + &more).unwrap();
    let out = folder.path().join("out");
    let asked = verb::asked(60, Some(Noise::Prior));
    let found = verb::count(folder.path(), &out, &verb::SHORT, &asked).unwrap();
    assert_eq!(found.tally.verdict.word, Word::Nominal, "{}", found.tally.verdict.text);
    assert!(found.tally.rows.iter().all(|row| row.uniform == Some(true)), "{:?}", found.tally.rows);
}

/// A study whose prior of `a` and `b` is the posterior of the run `first`.
fn after(folder: &Path, log_density: &str, units: &str) -> Value {
    let parameter = |name: &str| {
        format!("[[parameter]]\nname = \"{name}\"\n{units}prior = {{ posterior = \"first\" }}\n\n")
    };
    let text = format!(
        "[study]\ntitle = \"second half\"\n\n{}{}[target]\nuse = \"expression\"\nlog_density = \"{log_density}\"\n\n\
         [sampler]\n{NUTS}\n",
        parameter("a"),
        parameter("b")
    );
    fs::write(folder.join("second.toml"), text).unwrap();
    let out = folder.join("second");
    quick::run(&folder.join("second.toml"), &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(&out)
}

/// Runs the first study of a folder into `first`.
fn before(folder: &Path) -> Value {
    let out = folder.join("first");
    quick::run(&folder.join("study.toml"), &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    quick::summary(&out)
}

/// Half of the data, then the other half with the posterior of the first as prior: the posterior of all data. The prior is
/// known to the Monte Carlo error of the first run, which is that of its mean, reduced by what the second half adds.
#[test]
fn two_halves_of_a_line_make_the_whole() {
    let half = |x: &[f64], y: &[f64]| Linear {
        mean: [0.5, -1.0],
        sd: [2.0, 0.7],
        rho: -0.8,
        x: x.to_vec(),
        y: y.to_vec(),
        noise: 1.0,
    };
    let (first, second) = (half(&[0.0, 1.0], &[1.1, 0.2]), half(&[2.0, 4.0], &[-0.4, -2.9]));
    let exact = half(&[0.0, 1.0, 2.0, 4.0], &[1.1, 0.2, -0.4, -2.9]).posterior();
    let folder = target(
        &[("a", "{ normal = [0.5, 2.0] }"), ("b", "{ normal = [-1.0, 0.7] }")],
        "[[dependence]]\nparameters = [\"a\", \"b\"]\ncorrelation = -0.8",
        &first.log_likelihood(),
        NUTS,
    );
    let earlier = before(folder.path());
    let found = after(folder.path(), &second.log_likelihood(), "");
    for (j, name) in ["a", "b"].into_iter().enumerate() {
        let of = |summary: &Value, key: &str| number(summary, &format!("/parameters/{name}/{key}"));
        let error = of(&found, "mcse_mean").hypot(of(&earlier, "mcse_mean"));
        let off = of(&found, "mean") - exact.mean[j];
        assert!(off.abs() < 4.0 * error, "{name}: {off} ± {error}");
        let draws = (of(&earlier, "sd") / of(&earlier, "mcse_mean")).powi(2);
        let ratio = of(&found, "sd") / exact.sd[j];
        assert!((ratio - 1.0).abs() < 4.0 / draws.sqrt(), "{name}: {ratio}, {draws}");
    }
    let page = fs::read_to_string(folder.path().join("second/report.html")).unwrap();
    assert!(
        page.contains("divergence from held-out draws"),
        "the report states the representation"
    );
    // A changed earlier run recomputes what depends on it.
    fs::remove_dir_all(folder.path().join("first")).unwrap();
    quick::replace(&folder.path().join("study.toml"), "seed = 11", "seed = 12");
    before(folder.path());
    let again =
        quick::run(&folder.path().join("second.toml"), &[], &folder.path().join("second")).unwrap();
    assert!(again.made.contains(&"5-calibrate".to_owned()), "{:?}", again.made);
}

/// The same with a posterior that is far from normal: a product is measured first, then a factor. The quantiles are those of
/// all data at once, within the errors of both runs.
#[test]
fn two_halves_of_a_product_make_the_whole() {
    let priors = [("a", "{ gamma = [4.0, 0.5] }"), ("b", "{ gamma = [4.0, 0.5] }")];
    let (one, two) = ("normal_log_density(a * b, 3, 0.5)", "normal_log_density(a, 1.2, 0.3)");
    let folder = target(&priors, "", one, NUTS);
    before(folder.path());
    let found = after(folder.path(), two, "");
    let whole = target(&priors, "", &format!("{one} + {two}"), NUTS);
    let exact = summary(whole.path());
    for name in ["a", "b"] {
        let of = |summary: &Value, key: &str| number(summary, &format!("/parameters/{name}/{key}"));
        let sd = of(&exact, "sd");
        // The representation has a divergence below 0.1 nats, which shifts no quantile by more than 0.25 standard deviations.
        for key in ["q025", "median", "q975"] {
            let off = (of(&found, key) - of(&exact, key)) / sd;
            assert!(off.abs() < 0.25, "{name} {key}: {off}");
        }
    }
}

/// A thin ring, which a dozen normal distributions do not describe: the result says that its prior is not that posterior.
#[test]
fn a_posterior_that_is_represented_poorly_is_stated() {
    let priors = [("a", "{ uniform = [-15, 15] }"), ("b", "{ uniform = [-15, 15] }")];
    let ring = "-0.5 * ((sqrt(a^2 + b^2) - 10) / 0.05)^2";
    let folder = target(&priors, "", ring, PARTICLES);
    before(folder.path());
    let found = after(folder.path(), "0 * a", "");
    assert!(found["assessment"].to_string().contains("prior_of_run"), "{}", found["assessment"]);
}

/// Units are converted, and what is wrong with a run is said.
#[test]
fn a_run_that_cannot_be_a_prior_is_refused() {
    let folder = target(&[("a", "{ normal = [0.5, 2.0] }")], "", "0 * a", NUTS);
    before(folder.path());
    let complaints = |parameter: &str| {
        let text = format!(
            "[study]\ntitle = \"second\"\n\n[[parameter]]\n{parameter}\n\n[target]\nuse = \"expression\"\nlog_density = \"0\"\n\n\
             [sampler]\n{NUTS}\n"
        );
        let path = folder.path().join("second.toml");
        lacuna_engine::study::resolve::load_text(&path, &text, &[]).complaints()
    };
    let missing = complaints("name = \"a\"\nprior = { posterior = \"nowhere\" }");
    assert!(missing.contains("`nowhere` is no run directory with a posterior"), "{missing}");
    let other = complaints("name = \"aa\"\nprior = { posterior = \"first\" }");
    assert!(
        other.contains("the run has no parameter `aa`") && other.contains("did you mean `a`"),
        "{other}"
    );
    let unit = complaints("name = \"a\"\nunit = \"m\"\nprior = { posterior = \"first\" }");
    assert!(unit.contains("the run has `a` in another unit"), "{unit}");
    let percent = complaints("name = \"a\"\nunit = \"%\"\nprior = { posterior = \"first\" }");
    assert!(percent.is_empty(), "{percent}");
}
