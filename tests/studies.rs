//! A small study from nothing to its report, and again: the same bits, whatever is reused, on any number of threads.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::quick::{self, Ran};
use crate::um_bridge::rod::{self, Rod};

fn run(folder: &Path, settings: &[&str], out: &str) -> Ran {
    let out = folder.join(out);
    quick::run(&folder.join("study.toml"), settings, &out).unwrap_or_else(|stop| panic!("{stop}"))
}

const STAGES: [&str; 8] = [
    "1-design",
    "2-simulate",
    "3-read",
    "4-surrogate",
    "5-calibrate",
    "6-evidence",
    "6-validate",
    "6-assess",
];

#[test]
fn a_study_runs_from_nothing_to_its_report() {
    let folder = quick::simulated();
    let ran = run(folder.path(), &[], "run");
    assert_eq!(ran.made, STAGES);
    let out = folder.path().join("run");
    for file in ["resolved.toml", "manifest.json", "posterior.nc", "report.html"] {
        assert!(fs::metadata(out.join(file)).unwrap().len() > 100, "{file}");
    }
    let bytes = |path: &Path| fs::read(path).unwrap();
    assert_eq!(bytes(&out.join("study.toml")), bytes(&folder.path().join("study.toml")));
    assert_eq!(bytes(&out.join("8-report/report.html")), bytes(&out.join("report.html")));
    let runs = fs::read_dir(out.join("2-simulate")).unwrap();
    let histories =
        runs.filter(|e| e.as_ref().unwrap().path().extension().is_some_and(|e| e == "h"));
    assert_eq!(histories.count(), 40);
    check_summary(&out);
    check_manifest(&out);
}

/// Checks that `summary.json` has the documented keys.
fn check_summary(out: &Path) {
    let summary = quick::summary(out);
    assert_eq!(summary["schema"], 1);
    assert_eq!(summary["study"], "quick");
    for key in ["mae", "rmse", "loo"] {
        let value = summary["surrogate"][key].as_f64().unwrap();
        assert!(value > 0.0 && value.is_finite(), "surrogate.{key}");
    }
    assert_eq!(summary["surrogate"]["unit"], "strain");
    let names = ["tensile_cutoff", "density", "sound_speed", "variance"];
    for name in names {
        let parameter = &summary["parameters"][name];
        for key in ["mean", "sd", "q025", "q975", "map", "r_hat", "ess_bulk", "ess_tail"] {
            assert!(parameter[key].is_f64(), "parameters.{name}.{key}: {}", parameter[key]);
        }
        assert!(parameter["unit"].is_string(), "parameters.{name}.unit");
        let [low, mean, high] = ["q025", "mean", "q975"].map(|k| parameter[k].as_f64().unwrap());
        assert!(low < mean && mean < high, "{name}: {low} {mean} {high}");
    }
    assert_eq!(summary["correlation"]["names"], serde_json::json!(names));
    for i in 0..4 {
        assert!((summary["correlation"]["matrix"][i][i].as_f64().unwrap() - 1.0).abs() < 1e-12);
    }
    let acceptance = ["min", "mean", "max"].map(|k| summary["acceptance"][k].as_f64().unwrap());
    assert!(acceptance.is_sorted() && acceptance[0] >= 0.0 && acceptance[2] <= 1.0);
    assert!(summary["converged"].is_boolean());
    for case in ["map", "reference"] {
        for group in ["B", "C", "U", "average"] {
            let share = summary["accuracy"][case][group].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&share), "accuracy.{case}.{group}");
        }
    }
    for stage in ["design", "simulate", "read", "surrogate", "calibrate", "evidence", "validate"] {
        assert!(summary["seconds"][stage].as_f64().unwrap() >= 0.0, "seconds.{stage}");
    }
}

fn check_manifest(out: &Path) {
    let text = fs::read_to_string(out.join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    let stages = manifest["stages"].as_array().unwrap();
    let names: Vec<&str> = stages.iter().map(|s| s["stage"].as_str().unwrap()).collect();
    assert_eq!(names, STAGES);
    for stage in stages {
        assert_eq!(stage["inputs"].as_str().unwrap().len(), 64);
        for (file, hash) in stage["outputs"].as_object().unwrap() {
            let path = out.join(stage["stage"].as_str().unwrap()).join(file);
            assert_eq!(lacuna::run::files::hash_file(&path).unwrap(), hash.as_str().unwrap());
        }
    }
}

#[test]
fn the_resolved_study_gives_the_same_bits_in_another_directory() {
    let folder = quick::simulated();
    run(folder.path(), &["sampler.steps=70"], "first");
    let first = folder.path().join("first");
    let resolved = first.join("resolved.toml");
    let second = folder.path().join("elsewhere/second");
    quick::run(&resolved, &[], &second).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(quick::results(&second), quick::results(&first));
    // The resolved study resolves to itself.
    let text = |path: &Path| fs::read_to_string(path.join("resolved.toml")).unwrap();
    assert_eq!(text(&second), text(&first));
}

#[test]
fn what_is_kept_is_taken_and_only_what_depends_on_a_change_is_made_again() {
    let folder = quick::simulated();
    run(folder.path(), &[], "run");
    let out = folder.path().join("run");
    let first = quick::results(&out);

    let begun = Instant::now();
    let again = run(folder.path(), &[], "run");
    assert_eq!(again.made, [""; 0]);
    assert_eq!(quick::results(&out), first);
    assert!(begun.elapsed().as_secs_f64() < 10.0, "{:?}", begun.elapsed());

    let longer = ["sampler.steps=80"];
    assert_eq!(
        run(folder.path(), &longer, "run").made,
        ["5-calibrate", "6-evidence", "6-validate", "6-assess"]
    );
    let changed = quick::results(&out);
    assert_ne!(changed["5-calibrate/draws.nc"], first["5-calibrate/draws.nc"]);
    assert_eq!(changed["4-surrogate/emulator.bin"], first["4-surrogate/emulator.bin"]);
    // Switching back and forth: nothing is made twice.
    assert_eq!(run(folder.path(), &[], "run").made, [""; 0]);
    assert_eq!(quick::results(&out), first);
    assert_eq!(run(folder.path(), &longer, "run").made, [""; 0]);
    assert_eq!(quick::results(&out), changed);

    let degree = ["surrogate.degree=2"];
    assert_eq!(run(folder.path(), &degree, "run").made, STAGES[3..]);
    assert_eq!(
        run(folder.path(), &["validate.emulator_check=1"], "run").made,
        ["6-validate", "6-assess"]
    );
    // The emulator is checked at the same draws, whether the cases are simulated or not.
    let validated = |settings: &[&str]| -> serde_json::Value {
        run(folder.path(), settings, "run");
        lacuna::run::files::read_json(&out.join("6-validate/validation.json")).unwrap()
    };
    let (again, emulated) = (validated(&[]), validated(&["validate.rerun_model=false"]));
    let cases = |v: &serde_json::Value| [0, 1].map(|i| v["cases"][i]["simulated"].clone());
    assert_eq!(
        (cases(&again), cases(&emulated)),
        ([true.into(), true.into()], [false.into(), false.into()])
    );
    assert_eq!(again["emulator_at_posterior"][1], 2);
    assert_eq!(again["emulator_at_posterior"], emulated["emulator_at_posterior"]);
    // A title that no result depends on.
    assert_eq!(run(folder.path(), &["study.title=\"Another title\""], "run").made, [""; 0]);
    // Another measurement: the runs are kept.
    let data = folder.path().join("strain.csv");
    let text = fs::read_to_string(&data).unwrap();
    let (rest, _) = text.trim_end().rsplit_once(',').unwrap();
    fs::write(&data, format!("{rest},1.5\n")).unwrap();
    assert_eq!(run(folder.path(), &[], "run").made[0], "3-read");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let folder = quick::simulated();
    let on = |threads: &str| {
        let out = folder.path().join(format!("on{threads}"));
        let mut command = quick::command();
        command.arg("run").arg(folder.path().join("study.toml")).arg("--out").arg(&out);
        let (code, text) = quick::said(command.args(["--threads", threads]));
        assert_eq!(code, Some(0), "{text}");
        quick::results(&out)
    };
    let one = on("1");
    assert_eq!(on("2"), one);
    // The library in its own thread pool gives the results of the command.
    let out = folder.path().join("pool");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let ran = pool.install(|| quick::run(&folder.path().join("study.toml"), &[], &out));
    assert_eq!(ran.unwrap_or_else(|stop| panic!("{stop}")).made, STAGES);
    assert_eq!(quick::results(&out), one);
}

#[test]
fn a_study_of_tables_runs_without_a_model() {
    let folder = quick::tables();
    let ran = run(folder.path(), &["sampler.steps=300"], "run");
    let made = ["3-read", "4-surrogate", "5-calibrate", "6-evidence", "6-validate", "6-assess"];
    assert_eq!(ran.made, made);
    let summary = quick::summary(&folder.path().join("run"));
    assert_eq!(summary["simulated"]["map"], false);
    let findings = ran.findings.calibration.unwrap();
    let names: Vec<&str> = findings.coordinates.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["frequency", "damping", "variance"]);
}

/// Every study below a folder, in the order of the paths.
fn studies(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(studies(&path));
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn shipped_studies_are_sound_and_have_run_directories_of_their_own() {
    let mut names = BTreeMap::new();
    for path in studies(&quick::root().join("configs")) {
        let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
        let study = match folder.to_str() {
            // The server of this study must be running.
            Some("um_bridge") => {
                rod::serving(&Rod::default(), |url| quick::load(&path, &[&rod::setting(url)]))
            }
            // ABAQUS is not installed on every machine.
            Some("abaqus") => quick::load(&path, &["model.command=[\"sh\"]"]),
            _ => quick::load(&path, &[]),
        };
        assert!(study.about.title.len() > 10, "{} has no title", path.display());
        if let Some(other) = names.insert(study.name.clone(), path.clone()) {
            panic!("{} and {} are both called {}", other.display(), path.display(), study.name);
        }
    }
    assert!(names.len() >= 17, "{names:?}");
}

/// The quick study in place of the focused one, and the shipped variants of that in their folders.
fn variants(kind: &str) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = quick::simulated();
    fs::rename(folder.path().join("study.toml"), folder.path().join("focused.toml")).unwrap();
    let copies = folder.path().join(kind);
    fs::create_dir(&copies).unwrap();
    for path in studies(&quick::root().join("configs/sns").join(kind)) {
        fs::copy(&path, copies.join(path.file_name().unwrap())).unwrap();
    }
    let copied = studies(&copies);
    (folder, copied)
}

/// Runs the shipped variants in one directory, which simulates once.
fn each_variant_runs(kind: &str, count: usize, made: &[&str]) {
    let (folder, paths) = variants(kind);
    assert_eq!(paths.len(), count);
    let out = folder.path().join("run");
    quick::run(&folder.path().join("focused.toml"), &[], &out).unwrap();
    for path in paths {
        let sampler = quick::load(&path, &[]).plugins.sampler.unwrap().built.name;
        let short: &[&str] = match sampler {
            "variational" => &["sampler.iterations=50", "sampler.draws=200"],
            _ => &["sampler.steps=24"],
        };
        let ran = quick::run(&path, short, &out);
        let ran = ran.unwrap_or_else(|stop| panic!("{}: {stop}", path.display()));
        assert_eq!(ran.made, made, "{}", path.display());
    }
}

#[test]
fn every_shipped_discrepancy_runs_on_the_runs_and_the_surrogate_that_are_there() {
    each_variant_runs("discrepancies", 8, &STAGES[4..]);
}

#[test]
fn every_shipped_surrogate_runs_on_the_runs_that_are_there() {
    each_variant_runs("surrogates", 3, &STAGES[3..]);
}

/// Posterior and evidence of `configs/target/regression.toml` in closed form, as stated in its README.
#[test]
fn a_regression_has_the_evidence_that_it_must_have() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let path = quick::root().join("configs/target/regression.toml");
    quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&out);
    assert_eq!(summary["converged"], true, "{}", summary["verdict"]);
    let number = |part: &str, key: &str| summary[part][key].as_f64().unwrap();
    let (log, error) = (number("evidence", "log"), number("evidence", "error"));
    assert!((log + 213.091_967_607_017).abs() < 3.0 * error && error < 0.1, "{log} ± {error}");
    for (name, mean, sd) in [("intercept", -17.181_624, 6.530_366), ("slope", 3.908_607, 0.401_818)]
    {
        let found = &summary["parameters"][name];
        let size = found["ess_bulk"].as_f64().unwrap();
        let [m, s] = ["mean", "sd"].map(|key| found[key].as_f64().unwrap());
        assert!((m - mean).abs() < 4.0 * sd / size.sqrt(), "{name}: mean {m}");
        assert!((s / sd - 1.0).abs() < 4.0 / (2.0 * size).sqrt(), "{name}: sd {s}");
    }
}

/// The truth of `configs/borehole/measurements.csv` is in `examples/borehole_data.rs` and in the study's references.
#[test]
fn the_borehole_study_finds_its_truth() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let path = quick::root().join("configs/borehole/study.toml");
    let short = ["surrogate.degree=3", "surrogate.q_norm=1.0", "sampler.particles=300"];
    quick::run(&path, &short, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let summary = quick::summary(&out);
    for parameter in &quick::load(&path, &[]).parameters {
        let found = &summary["parameters"][&parameter.name];
        let [mean, sd] = ["mean", "sd"].map(|key| found[key].as_f64().unwrap());
        let truth = parameter.reference.unwrap();
        assert!((mean - truth).abs() < 3.0 * sd, "{}: {mean} ± {sd}", parameter.name);
    }
}

/// A parameter about which the data say nothing keeps its prior, uniform from -0.5 to 0.5, whatever correlations the
/// design has by chance.
#[test]
fn a_parameter_that_the_model_does_not_use_keeps_its_prior() {
    let folder = quick::simulated();
    let path = folder.path().join("study.toml");
    let idle = "[[parameter]]\nname = \"void_gradient\"\nprior = { uniform = [-0.5, 0.5] }\nreference = 0.0\n\n[response]";
    quick::replace(&path, "[response]", idle);
    let settings = ["sampler.use=no_u_turn", "sampler.warm_up=200", "sampler.steps=500"];
    let out = folder.path().join("run");
    let ran = quick::run(&path, &settings, &out).unwrap_or_else(|stop| panic!("{stop}"));
    let idle: Vec<&str> =
        ran.findings.assessment.of_code("idle_parameter").map(|f| f.place.as_str()).collect();
    assert_eq!(idle, ["void_gradient"]);
    let summary = quick::summary(&out);
    let number = |name: &str, key: &str| summary["parameters"][name][key].as_f64().unwrap();
    let (size, sd) = (number("void_gradient", "ess_bulk"), 1.0 / 12_f64.sqrt());
    assert!(size > 200.0 && number("void_gradient", "mean").abs() < 4.0 * sd / size.sqrt());
    assert!((number("void_gradient", "sd") / sd - 1.0).abs() < 4.0 / (2.0 * size).sqrt());
    // A kept emulator is reused together with the parameter that it does not have.
    let again = quick::run(&path, &settings, &out).unwrap_or_else(|stop| panic!("{stop}"));
    assert_eq!(again.made, [""; 0]);
    assert!(summary["sobol"].is_null() || summary["sobol"].to_string().contains("void_gradient"));
}

/// The three studies differ from each other only in the names of model and study, and each runs as it is, here on the first
/// fifth of its record.
#[test]
fn the_helium_study_runs_with_each_of_its_models() {
    let short = [
        "response.axes.time={ first = 1e-5, last = 2e-4, count = 20, unit = \"s\" }",
        "design.runs=20",
        "model.numerics={ mesh = [6, 24] }",
        "numerical_error.runs=4",
        "numerical_error.model={ numerics = { mesh = [8, 32] } }",
        "surrogate.training=16",
        "surrogate.validation=4",
        "surrogate.degree=1",
        "sampler.use=metropolis",
        "sampler.start=prior",
        "sampler.steps=30",
        "validate.emulator_check=1",
    ];
    let folder = tempfile::tempdir().unwrap();
    let from = quick::root().join("configs/sns-helium");
    for path in studies(&from) {
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    quick::write_early(&from.join("strain.csv"), folder.path(), |_| true);
    let paths = studies(folder.path());
    assert_eq!(paths.len(), 3);
    for path in paths {
        let study = quick::load(&path, &short);
        assert_eq!(study.parameters.len(), 10);
        let out = folder.path().join(&study.name);
        quick::run(&path, &short, &out).unwrap_or_else(|stop| panic!("{}: {stop}", path.display()));
    }
}
