//! Quantities bounded over intervals of parameters, against closed forms and published ranges.
//!
//! A tolerance is a multiple of the Monte Carlo standard error of a bound as printed; where the exact bound has none, the
//! tolerance is that of the search, as a share of the width of the bounds.

use std::f64::consts::E;
use std::fs;
use std::path::Path;

use lacuna_engine::stage::quantities::PROBABILITIES;
use serde_json::Value;
use tempfile::TempDir;

use crate::quick;

/// Multiple of a standard error: exceeded with a probability of 6e-5 per figure.
const ERRORS: f64 = 4.0;

/// Share of the width of bounds by which a search may miss an end inside the intervals.
const SEARCH: f64 = 1e-4;

/// 97.5 % quantile of the standard normal distribution.
const Z: f64 = 1.959_964;

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer}"))
}

/// A study of one formula; each quantity is its value.
fn written(parameters: &[(&str, &str)], formula: &str, more: &str) -> TempDir {
    let parameter = |(name, prior): &(&str, &str)| {
        format!("[[parameter]]\nname = \"{name}\"\nprior = {prior}\n\n")
    };
    let parameters: String = parameters.iter().map(parameter).collect();
    let text = format!(
        "[study]\ntitle = \"Intervals\"\nseed = 5\n\n{parameters}[response]\nname = \"response\"\n\
         axes = {{ place = {{ first = 0.0, last = 1.0, count = 2 }} }}\n\n[model]\nuse = \"equations\"\n\
         observe = \"{formula} + 0 * place\"\n\n[[quantity]]\nname = \"y\"\nuse = \"at\"\nplace = 0\n\n{more}"
    );
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    folder
}

fn run(folder: &Path, settings: &[&str]) -> (quick::Ran, Value) {
    let ran = quick::run(&folder.join("study.toml"), settings, &folder.join("out"));
    let ran = ran.unwrap_or_else(|stop| panic!("{stop}"));
    (ran, quick::summary(&folder.join("out")))
}

/// Requires both bounds of a figure: within the error of the draws and that of the search.
fn bounded(found: &Value, figure: &str, [lower, upper]: [f64; 2]) {
    for (end, exact) in [("lower", lower), ("upper", upper)] {
        let value = number(found, &format!("/bounds/{figure}/{end}"));
        let error = number(found, &format!("/bounds/{figure}/{end}_error"));
        let allowed = ERRORS * error + SEARCH * (upper - lower) + 1e-12 * exact.abs();
        assert!((value - exact).abs() <= allowed, "{figure} {end}: {value} ± {error}, {exact}");
    }
    let difference = number(found, &format!("/bounds/{figure}/difference"));
    assert!(difference <= 0.01 * (upper - lower) + 1e-12, "{figure}: {difference}");
}

/// Requires the standard error of a figure of a normal distribution.
fn error_of_normal(found: &Value, figure: &str, sd: f64) {
    let draws = number(found, "/bounds/draws");
    // In standard deviations times the root of the number of draws: 1, 1/√2, √(p (1 - p)) / φ(z).
    let (factor, allowed) = match figure {
        "mean" => (1.0, 0.1),
        "sd" => (0.707, 0.15),
        "median" => (1.253, 0.35),
        _ => (2.671, 0.5),
    };
    for end in ["lower_error", "upper_error"] {
        let ratio =
            number(found, &format!("/bounds/{figure}/{end}")) / (factor * sd / draws.sqrt());
        assert!((ratio - 1.0).abs() < allowed, "{figure} {end}: {ratio}");
    }
}

/// `y = x + c` with normal `x`: every figure moves with `c`, the standard deviation stays.
#[test]
fn a_shift_by_an_interval() {
    let parameters = [("x", "{ normal = [1.0, 0.5] }"), ("c", "{ interval = [-1.0, 2.0] }")];
    let folder = written(&parameters, "x + c", "");
    let (ran, summary) = run(folder.path(), &[]);
    let found = &summary["quantities"]["y"];
    for (figure, z) in [("mean", 0.0), ("q025", -Z), ("median", 0.0), ("q975", Z)] {
        bounded(found, figure, [0.5 * z, 3.0 + 0.5 * z]);
        error_of_normal(found, figure, 0.5);
        assert_eq!(number(found, &format!("/bounds/{figure}/lower_at/c")), -1.0);
        assert_eq!(number(found, &format!("/bounds/{figure}/upper_at/c")), 2.0);
    }
    bounded(found, "sd", [0.5, 0.5]);
    error_of_normal(found, "sd", 0.5);
    // The middle of the interval, and the shares of `x` alone.
    let error = number(found, "/mcse_mean");
    assert!((number(found, "/mean") - 1.5).abs() < ERRORS * error, "{found}");
    assert!((number(found, "/sensitivity/x/total") - 1.0).abs() < 0.1);
    assert!(found["sensitivity"].get("c").is_none());
    // The box: both curves of the distribution are those of normal variables.
    let ends = |key: &str| found.pointer(&format!("/bounds/distribution/{key}")).unwrap().clone();
    for (k, p) in PROBABILITIES.into_iter().enumerate() {
        let z = lacuna::math::special::normal_quantile(p);
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let error = 0.5 * (p * (1.0 - p) / number(found, "/bounds/draws")).sqrt() / density;
        for (key, shift) in [("lower", 0.0), ("upper", 3.0)] {
            let off = ends(key)[k].as_f64().unwrap() - (shift + 0.5 * z);
            // Outermost quantiles are those of a few draws.
            assert!(off.abs() < 1.5 * ERRORS * error, "{key} {p}: {off} {error}");
        }
    }
    // 368 points with 200 draws, 16 with all 1000, 2000 for the shares of one input, and the middle.
    let said = |text: &&String| text.contains("at most 91601 runs of the model");
    assert!(ran.warnings.iter().chain(&ran.notes).any(|text| said(&text)), "{:?}", ran.notes);
    assert_eq!(ran.findings.assessment.of_code("interval_search").count(), 0);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Bounds over intervals") && page.contains("probability box of y"));
    assert!(page.contains("interval [−1, 2]") || page.contains("interval [-1, 2]"));
    // Everything is kept, also by the resolved study.
    let (again, same) = run(folder.path(), &[]);
    assert!(
        again.made.is_empty() && same["quantities"] == summary["quantities"],
        "{:?}",
        again.made
    );
    let resolved = fs::read_to_string(folder.path().join("out/resolved.toml")).unwrap();
    assert!(resolved.contains("interval"), "{resolved}");
    quick::load(&folder.path().join("out/resolved.toml"), &[]);
}

/// `y = c x`: the standard deviation has its bounds at the ends, and with zero in the interval its smallest value inside.
#[test]
fn a_factor_in_an_interval() {
    for (interval, sd) in [("[0.5, 2.0]", [0.25, 1.0]), ("[-1.0, 2.0]", [0.0, 1.0])] {
        let interval = format!("{{ interval = {interval} }}");
        let parameters = [("x", "{ normal = [0.0, 0.5] }"), ("c", &*interval)];
        let folder = written(&parameters, "c * x", "[forward.intervals]\npoints = 250\n");
        let (_, summary) = run(folder.path(), &["forward.draws=2000"]);
        let found = &summary["quantities"]["y"];
        let value = |end: &str| number(found, &format!("/bounds/sd/{end}"));
        assert!((value("upper") - sd[1]).abs() < ERRORS * value("upper_error"), "{found}");
        let allowed = ERRORS * value("lower_error") + 0.01 * (sd[1] - sd[0]);
        assert!((value("lower") - sd[0]).abs() < allowed, "{found}");
        assert_eq!(number(found, "/bounds/sd/upper_at/c"), 2.0);
    }
}

/// A minimum inside the interval: the corners alone give 0.09 and 0.49 for the square.
#[test]
fn a_minimum_inside_an_interval() {
    let parameters = [("x", "{ normal = [1.0, 0.2] }"), ("c", "{ interval = [0.0, 1.0] }")];
    let folder = written(&parameters, "(c - 0.3)^2 + x", "");
    let (_, summary) = run(folder.path(), &[]);
    let found = &summary["quantities"]["y"];
    for (figure, z) in [("mean", 0.0), ("q025", -Z), ("median", 0.0), ("q975", Z)] {
        bounded(found, figure, [1.0 + 0.2 * z, 1.49 + 0.2 * z]);
        assert!((number(found, &format!("/bounds/{figure}/lower_at/c")) - 0.3).abs() < 0.01);
        assert_eq!(number(found, &format!("/bounds/{figure}/upper_at/c")), 1.0);
    }
}

/// Challenge problem 1 of Oberkampf et al. (Reliability Engineering and System Safety 85 (2004) 11): `y = (a + b)^a` with `a` in
/// [0.1, 1] and `b` in [0, 1] has the range [0.692, 2.0]; the minimum is exp(-1/e) at `a = 1/e`, `b = 0`.
#[test]
fn the_algebraic_challenge_problem_with_intervals() {
    let parameters = [("a", "{ interval = [0.1, 1.0] }"), ("b", "{ interval = [0.0, 1.0] }")];
    let folder = written(&parameters, "(a + b)^a", "");
    let (ran, summary) = run(folder.path(), &[]);
    let found = &summary["quantities"]["y"];
    for figure in ["mean", "q025", "median", "q975"] {
        bounded(found, figure, [(-1.0 / E).exp(), 2.0]);
        assert!((number(found, &format!("/bounds/{figure}/lower_at/a")) - 1.0 / E).abs() < 0.01);
        assert_eq!(number(found, &format!("/bounds/{figure}/lower_at/b")), 0.0);
        assert_eq!(number(found, &format!("/bounds/{figure}/lower_error")), 0.0);
    }
    bounded(found, "sd", [0.0, 0.0]);
    assert_eq!((number(found, "/draws"), number(found, "/sd")), (1.0, 0.0));
    // One run for each point, one for the middle of the box as the draw and as its centre.
    let points = number(found, "/bounds/points");
    assert!(points <= 128.0 + 5.0 * 80.0, "{points}");
    assert!(ran.findings.propagated.unwrap().inputs.is_empty());
    assert!(run(folder.path(), &[]).0.made.is_empty());
}

/// The same with a log-normal `b`, as in the later problems there: the logarithm is normal, and its mean in [0, 1] and standard
/// deviation in [0.1, 0.5] are intervals themselves. At given parameters a quantile of `y` is `(a + b_p)^a`, since `y`
/// grows with `b`; its extremes over the parameters follow from a fine grid.
#[test]
fn the_algebraic_challenge_problem_with_a_log_normal_input() {
    let parameters = [
        ("a", "{ interval = [0.1, 1.0] }"),
        ("mu", "{ interval = [0.0, 1.0] }"),
        ("sigma", "{ interval = [0.1, 0.5] }"),
        ("z", "{ normal = [0.0, 1.0] }"),
    ];
    let folder = written(&parameters, "(a + exp(mu + sigma * z))^a", "");
    let (_, summary) = run(folder.path(), &["forward.draws=2000"]);
    let found = &summary["quantities"]["y"];
    for (figure, z) in [("q025", -Z), ("median", 0.0), ("q975", Z)] {
        let at = |a: f64, mu: f64, sigma: f64| (a + (mu + sigma * z).exp()).powf(a);
        let grid =
            (0..=20).flat_map(|i| (0..=20).flat_map(move |j| (0..=20).map(move |k| [i, j, k])));
        let share = |i: i32| f64::from(i) / 20.0;
        let values: Vec<f64> = grid
            .map(|[i, j, k]| at(0.1 + 0.9 * share(i), share(j), 0.1 + 0.4 * share(k)))
            .collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(0.0, f64::max);
        bounded(found, figure, [low, high]);
    }
    // The mean has its largest value at the ends: 1 + exp(mu + sigma² / 2).
    let upper = number(found, "/bounds/mean/upper");
    let error = number(found, "/bounds/mean/upper_error");
    assert!((upper - 1.0 - 1.125_f64.exp()).abs() < ERRORS * error, "{upper} ± {error}");
    for (name, value) in [("a", 1.0), ("mu", 1.0), ("sigma", 0.5)] {
        assert_eq!(number(found, &format!("/bounds/mean/upper_at/{name}")), value);
    }
}

/// A uniform prior over the interval says that the extremes are improbable: `y > 2.95` has a probability of 1.7 % then, and
/// 84 % if `c` is 2, which the interval allows.
#[test]
fn a_uniform_prior_excludes_what_the_interval_allows() {
    let x = ("x", "{ normal = [1.0, 0.05] }");
    let exceeds =
        |draws: &[f64]| draws.iter().filter(|&&y| y > 2.95).count() as f64 / draws.len() as f64;
    let folder = written(&[x, ("c", "{ uniform = [-1.0, 2.0] }")], "x + c", "");
    let uniform = run(folder.path(), &[]).0.findings.quantities.remove(0);
    let probable = exceeds(&uniform.values);
    // The density of the sum is 1/3 except near its ends: 0.05 / 3.
    assert!((probable - 0.05 / 3.0).abs() < ERRORS * (0.0167_f64 / 1000.0).sqrt(), "{probable}");
    assert!(uniform.total.q975 < 2.97 && uniform.bounds.is_none());
    let folder = written(&[x, ("c", "{ interval = [-1.0, 2.0] }")], "x + c", "");
    let interval = run(folder.path(), &[]).0.findings.quantities.remove(0);
    let bounds = interval.bounds.unwrap();
    let [least, most] = bounds.probability(2.95);
    // P(y <= 2.95) is 1 at c = -1, and Φ(-1) = 0.159 at c = 2; the box is widened to the next of the probabilities.
    assert!(least < 0.159 + ERRORS * 0.012 && least > 0.159 - 0.025 - ERRORS * 0.012, "{least}");
    assert_eq!(most, 1.0);
    let upper = bounds.q975.upper;
    assert!((upper.value - 3.0 - 0.05 * Z).abs() < ERRORS * upper.error, "{upper:?}");
}

/// The error of an emulator stays in the bounds: a straight line fitted to a parabola.
#[test]
fn the_error_of_the_emulator_is_in_the_bounds() {
    let parameters = [("x", "{ uniform = [-1.0, 1.0] }"), ("c", "{ interval = [0.0, 2.0] }")];
    let more = "[design]\nuse = \"latin_hypercube\"\nruns = 120\n\n[surrogate]\nuse = \"polynomial_chaos\"\n\
                degree = { max = 1 }\nvalidation = 0\n\n[[quantity]]\nname = \"alone\"\nuse = \"at\"\nplace = 0\n\
                include = []\n\n[forward.intervals]\npoints = 150\n";
    let folder = written(&parameters, "c + x + 0.5 * x^2", more);
    let (_, summary) = run(folder.path(), &["forward.draws=4000"]);
    let [whole, alone] = ["y", "alone"].map(|name| {
        let found = &summary["quantities"][name];
        assert!(number(found, "/bounds/mean/upper") - number(found, "/bounds/mean/lower") > 1.9);
        [number(found, "/bounds/sd/lower"), number(found, "/bounds/sd/upper")]
    });
    for (whole, alone) in whole.into_iter().zip(alone) {
        // x² / 2 has the variance (1/5 - 1/9) / 4 = 1/45 beside 1/3; the fit to 120 runs adds some per cent to the errors.
        assert!((alone * alone * 3.0 - 1.0).abs() < 0.1, "{alone}");
        assert!(((whole * whole - alone * alone) * 45.0 - 1.0).abs() < 0.4, "{whole} {alone}");
    }
    assert_eq!(summary["quantities"]["y"]["includes"], serde_json::json!(["emulator"]));
}

/// Over data of many seeds the exact bounds lie within two printed standard errors as often as those of a normal error,
/// 95.4 %: the search over the interval adds nothing to the error of the draws.
#[test]
fn bounds_are_as_near_as_their_errors_say() {
    let parameters = [("x", "{ normal = [1.0, 0.5] }"), ("c", "{ interval = [0.0, 1.0] }")];
    let search = "[forward.intervals]\npoints = 60\n";
    let folder = written(&parameters, "(c - 0.3)^2 + (1 + c) * x", search);
    // The mean is largest at 1, and smallest at 0: the slope 2 (c - 0.3) + 1 is positive. At given c the standard deviation is
    // (1 + c) / 2.
    let figures = [("mean", 0.0), ("sd", 0.0), ("median", 0.0), ("q975", Z)];
    let exact = |figure: &str, z: f64, c: f64| {
        let sd = 0.5 * (1.0 + c);
        if figure == "sd" { sd } else { (c - 0.3).powi(2) + 1.0 + c + z * sd }
    };
    let mut inside = [[0; 2]; 4];
    for seed in 0..SEEDS {
        let out = folder.path().join(format!("out{seed}"));
        let settings = [format!("study.seed={seed}"), String::from("forward.draws=400")];
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        quick::run(&folder.path().join("study.toml"), &settings, &out).unwrap();
        let summary = quick::summary(&out);
        let found = &summary["quantities"]["y"];
        for (k, (figure, z)) in figures.into_iter().enumerate() {
            for (end, (side, c)) in [("lower", 0.0), ("upper", 1.0)].into_iter().enumerate() {
                let value = number(found, &format!("/bounds/{figure}/{side}"));
                let error = number(found, &format!("/bounds/{figure}/{side}_error"));
                inside[k][end] += usize::from((value - exact(figure, z, c)).abs() < 2.0 * error);
            }
        }
    }
    // Eight counts: each is outside its band with a probability of 0.1 %.
    let band = lacuna::diagnose::coverage::binomial::band(SEEDS, 0.9545, 0.001);
    for (counts, (figure, _)) in inside.into_iter().zip(figures) {
        assert!(
            counts.iter().all(|count| (band[0]..=band[1]).contains(count)),
            "{figure}: {counts:?}"
        );
    }
}

/// Number of seeds that are counted.
const SEEDS: usize = 25;

/// A peak in a corner that neither search finds: the bound holds it, and the assessment says that the searches differ.
#[test]
fn a_search_that_misses_is_told() {
    let parameters = [("a", "{ interval = [0.0, 1.0] }"), ("b", "{ interval = [0.0, 1.0] }")];
    let formula = "a + exp(-1e7 * ((1 - a)^2 + b^2))";
    let folder = written(&parameters, formula, "[forward.intervals]\npoints = 60\n");
    let (ran, summary) = run(folder.path(), &[]);
    let found = &summary["quantities"]["y"];
    assert_eq!(number(found, "/bounds/mean/upper"), 2.0);
    assert!(number(found, "/bounds/mean/difference") > 0.9, "{found}");
    let assessed = &ran.findings.assessment;
    let told: Vec<&str> = assessed.of_code("interval_search").map(|f| f.place.as_str()).collect();
    assert_eq!(told, ["y"], "{assessed:?}");
    assert_eq!(assessed.level.words(), "trusted with reservations");
}

/// The mean of a quantity that is 1 or 0 is a probability: `P(x + c > 2.5)` for normal `x` is Φ(-3) at `c = 0` and Φ(1) at `c = 2`.
#[test]
fn the_mean_of_an_indicator_bounds_a_probability() {
    let parameters = [("x", "{ normal = [1.0, 0.5] }"), ("c", "{ interval = [0.0, 2.0] }")];
    let more =
        "[[quantity]]\nname = \"exceeds\"\nuse = \"expression\"\nformula = \"if(y > 2.5, 1, 0)\"\n";
    let folder = written(&parameters, "x + c", more);
    let (_, summary) = run(folder.path(), &["forward.draws=4000"]);
    let found = &summary["quantities"]["exceeds"];
    for (end, p) in [("lower", 0.001_35_f64), ("upper", 0.841_34)] {
        let off = number(found, &format!("/bounds/mean/{end}")) - p;
        assert!(off.abs() < ERRORS * (p * (1.0 - p) / 4000.0).sqrt(), "{end}: {off}");
    }
    assert_eq!(number(found, "/bounds/mean/upper_at/c"), 2.0);
}

/// Ten intervals, the corners of which are too many: a square with its summit at the middle of some and at the ends of others.
#[test]
fn many_intervals() {
    let names: Vec<String> = (0..10).map(|j| format!("c{j}")).collect();
    let mut parameters: Vec<(&str, &str)> =
        names.iter().map(|name| (name.as_str(), "{ interval = [0.0, 1.0] }")).collect();
    parameters.push(("x", "{ normal = [0.0, 0.1] }"));
    let term = |j: usize| format!("(c{j} - {}) ^ 2", 0.3 + 0.04 * j as f64);
    let sum: Vec<String> = (0..10).map(term).collect();
    let folder = written(&parameters, &format!("x + {}", sum.join(" + ")), "");
    let (ran, summary) = run(folder.path(), &[]);
    let found = &summary["quantities"]["y"];
    let upper: f64 =
        (0..10).map(|j| 0.3 + 0.04 * f64::from(j)).map(|s| s.max(1.0 - s).powi(2)).sum();
    for (figure, z) in [("mean", 0.0), ("median", 0.0), ("q975", Z)] {
        bounded(found, figure, [0.1 * z, upper + 0.1 * z]);
    }
    assert_eq!(ran.findings.assessment.of_code("interval_search").count(), 0);
}

/// A parameter for each scenario is an interval for each, and a quantity that is undefined in a part of the box is told.
#[test]
fn intervals_by_scenario_and_undefined_values() {
    let text = "[study]\ntitle = \"Two scenarios\"\n\n[[parameter]]\nname = \"c\"\nscenario = \"each\"\nunit = \"m\"\n\
                prior = { interval = [1.0, 3.0] }\n\n[[parameter]]\nname = \"x\"\nunit = \"m\"\n\
                prior = { normal = [0.0, 0.1] }\n\n[[scenario]]\nname = \"one\"\n\n[[scenario]]\nname = \"two\"\n\n\
                [response]\nname = \"length\"\nunit = \"m\"\naxes = { place = { first = 0.0, last = 1.0, count = 2 } }\n\n\
                [model]\nuse = \"equations\"\nobserve = \"c + x + 0 {m} * place\"\n\n[[quantity]]\nname = \"y\"\n\
                use = \"at\"\nplace = 0\nunit = \"mm\"\n\n[[quantity]]\nname = \"root\"\nuse = \"expression\"\n\
                formula = \"sqrt(x / 1 {m})\"\n";
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let (ran, summary) = run(folder.path(), &[]);
    for name in ["one", "two"] {
        let found = &summary["quantities"][format!("y[{name}]")];
        let at = number(found, &format!("/bounds/mean/upper_at/c[{name}]"));
        assert_eq!(at, 3.0, "{found}");
        let upper = number(found, "/bounds/mean/upper");
        let error = number(found, "/bounds/mean/upper_error");
        assert!((upper - 3000.0).abs() < ERRORS * error, "{upper} ± {error}");
    }
    let undefined = number(&summary["quantities"]["root"], "/bounds/undefined");
    assert!((undefined / 1000.0 - 0.5).abs() < ERRORS * 0.0158, "{undefined}");
    let told = |text: &String| text.contains("`root` is undefined at up to");
    assert!(ran.warnings.iter().any(told), "{:?}", ran.warnings);
}
