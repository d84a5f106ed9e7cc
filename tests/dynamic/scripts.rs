//! Plugins in Python: the suites of the kinds, a study that uses all of them, and files that are wrong.
//!
//! `LACUNA_PYTHON` names an interpreter that has `numpy`; without it the tests report that they are skipped, unless
//! `LACUNA_REQUIRE_PYTHON=1` makes that a failure.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lacuna::data::{Axis, Layout, Measurements, Replicate, Unit};
use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::reader::MeasurementSource;
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::{Discrepancy, Effect, Library, Model, Quantity, Reader, Sampler, Surrogate};
use lacuna_engine::host::library;

use crate::contracts::{model, sound};
use crate::quick;

/// True if there is an interpreter.
pub fn has_python() -> bool {
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    let named = std::env::var_os("LACUNA_PYTHON").is_some();
    assert!(named || !required, "LACUNA_PYTHON names no interpreter");
    if !named {
        println!("skipped: LACUNA_PYTHON names no interpreter with numpy");
    }
    named
}

pub fn example() -> PathBuf {
    quick::root().join("examples/plugin_python")
}

pub fn plugins() -> &'static Library {
    static LOADED: OnceLock<&'static Library> = OnceLock::new();
    LOADED.get_or_init(|| {
        library::load(&example().join("plugins.py"), None).unwrap_or_else(|e| panic!("{e}"))
    })
}

/// Runs a plugin of the example through a suite.
fn judged<K: Kind + ?Sized>(
    name: &str,
    options: &str,
    suite: impl Fn(&str, &K) -> Result<(), Vec<String>>,
) {
    if !has_python() {
        return;
    }
    plugins();
    let built = registry::from_text::<K>(name, options).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(built.library, Some(plugins()));
    let breaches = suite(name, &*built.plugin).err().unwrap_or_default();
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
fn a_quantity_keeps_its_contract() {
    judged::<dyn Quantity>("overshoot", "level = 0.3", |name, plugin| {
        sound(plugin, lacuna_contract::quantity(name, plugin))
    });
}

#[test]
fn an_effect_keeps_its_contract() {
    judged::<dyn Effect>("warming", "", |name, plugin| {
        sound(plugin, lacuna_contract::effect(name, plugin))
    });
}

#[test]
fn a_discrepancy_keeps_its_contract() {
    judged::<dyn Discrepancy>("heavy_tails", "scale = 0.2", |name, plugin| {
        sound(plugin, lacuna_contract::discrepancy(name, plugin))
    });
}

#[test]
fn a_sampler_keeps_its_contract() {
    judged::<dyn Sampler>("jump_walk", "", |name, plugin| {
        sound(plugin, lacuna_contract::sampler(name, plugin))
    });
}

#[test]
fn a_surrogate_keeps_its_contract() {
    judged::<dyn Surrogate>("cubic", "", |name, plugin| {
        sound(plugin, lacuna_contract::surrogate(name, plugin))
    });
}

#[test]
fn a_model_keeps_its_contract() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rise.py");
    let text = "import lacuna\n@lacuna.model\nclass Rise:\n    def predict(self, inputs, layout):\n        \
                return inputs['a'][:, None] + inputs['b'][:, None] ** 2 * layout.grid\n    \
                def gradient(self, inputs, layout):\n        \
                return {'a': 1 + 0 * layout.grid, 'b': 2 * inputs['b'] * layout.grid}\n";
    std::fs::write(&file, text).unwrap();
    library::load(&file, None).unwrap_or_else(|e| panic!("{e}"));
    let built = registry::from_text::<dyn Model>("rise", "").unwrap_or_else(|e| panic!("{e}"));
    let breaches = sound(&*built.plugin, model("rise", &*built.plugin)).err().unwrap_or_default();
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
fn a_reader_reads_what_the_text_says() {
    judged::<dyn Reader>("columns", "path = \"table.csv\"", |_, plugin| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("table.csv"), "1,2\n3,\n5.5,-6e-3\n").unwrap();
        let axes = vec![Axis::grid("time", vec![1.0, 2.0, 3.0], Unit::parse("s").unwrap())];
        let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
        let source =
            MeasurementSource { directory: folder.path(), scenario: None, layout: &layout };
        let data = plugin.measurements(&source).unwrap_or_else(|error| panic!("{error}"));
        let values: Vec<_> = data.replicates.iter().map(|r| r.values.clone()).collect();
        assert_eq!(values, [[Some(1.0), Some(3.0), Some(5.5)], [Some(2.0), None, Some(-6e-3)]]);
        assert_eq!(plugin.files(Path::new("a"), None), [Path::new("a").join("table.csv")]);
        std::fs::write(folder.path().join("table.csv"), "1,2\n3,x\n").unwrap();
        let error = plugin.measurements(&source).err().unwrap().to_string();
        assert!(
            error.contains("could not convert string to float") && error.contains("line"),
            "{error}"
        );
        sound(plugin, Ok(()))
    });
}

/// The skeletons of `lacuna new plugin --language python`, each under a name of its own.
#[test]
fn the_skeletons_keep_their_contracts() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for kind in ["discrepancy", "effect", "model", "quantity", "reader", "sampler", "surrogate"] {
        let name = format!("of_{kind}");
        let said = quick::command()
            .args(["new", "plugin", kind, &name, "--language", "python"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
        let options: &[&str] =
            if kind == "reader" { &["--set", "reader.of_reader.path='sample.csv'"] } else { &[] };
        let tested = quick::command()
            .args(["plugins", "test", &format!("{name}.py")])
            .args(options)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&tested.stdout);
        // The suite of readers knows a table of three columns, which this reader does not read.
        assert!(tested.status.success() || kind == "reader", "{text}");
    }
}

/// `lacuna plugins test` finds a walker that is its own partner, a prediction that ignores an option, and a gradient with the
/// wrong sign, and ends with an error.
#[test]
fn faults_of_plugins_are_found() {
    if !has_python() {
        return;
    }
    let said = quick::command()
        .args(["plugins", "test"])
        .arg(quick::root().join("tests/dynamic/faulty.py"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&said.stdout);
    assert_eq!(said.status.code(), Some(1), "{text}");
    for found in [
        "sampler.self_partner  BREAKS",
        "`self_partner walkers = 6`, draws a normal law",
        "`ignores_its_scale`, has the law that it simulates",
        "`wrong_sign`, knows its derivatives",
        "quantity.sound  keeps its contract",
    ] {
        assert!(text.contains(found), "{found} is missing in\n{text}");
    }
}

/// The likelihood of Student's t errors against the closed form, computed here.
#[test]
fn the_likelihood_of_heavy_tails_is_that_of_the_formula() {
    judged::<dyn Discrepancy>("heavy_tails", "degrees = 5.0", |_, plugin| {
        let axes = vec![Axis::grid("time", vec![1.0, 2.0], Unit::parse("s").unwrap())];
        let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
        let values = [[0.5, 1.0], [0.2, 3.0]];
        let replicate = |row: [f64; 2]| Replicate::new("r", row.map(Some).to_vec());
        let data = Measurements::new(layout, values.map(replicate).to_vec());
        let made = plugin.likelihood(&Known::without_slopes(&data, &[])).unwrap();
        let density = |response: [f64; 2], scale: f64| -> f64 {
            let one = |y: f64, m: f64| {
                -scale.ln() - 3.0 * (1.0 + (y - m).powi(2) / (5.0 * scale * scale)).ln()
            };
            values.iter().map(|row| one(row[0], response[0]) + one(row[1], response[1])).sum()
        };
        for (response, scale) in [([0.0, 0.0], 0.3), ([0.4, 2.0], 1.7)] {
            let found = made.log_likelihood(&response, &[scale]);
            assert!((found - density(response, scale)).abs() < 1e-12 * found.abs(), "{found}");
        }
        sound(plugin, Ok(()))
    });
}

/// A study of which every part that can be a plugin in Python is one gives the same bits on one thread and on three, and
/// again after the workers have ended; the truths are those with which its data were made.
#[test]
fn a_study_of_python_parts_finds_the_truth_with_the_same_bits() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, threads: usize| {
        let out = folder.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let study = example().join("study.toml");
        pool.install(|| quick::run(&study, &["sampler.steps=400"], &out))
            .unwrap_or_else(|stop| panic!("{stop}"));
        quick::summary(&out)
    };
    let (one, three) = (run("one", 1), run("three", 3));
    assert_eq!(one["parameters"], three["parameters"]);
    assert_eq!(one["quantities"], three["quantities"]);
    for (name, truth) in [("amplitude", 2.0), ("rate", 0.7)] {
        let [mean, sd] = ["mean", "sd"].map(|key| one["parameters"][name][key].as_f64().unwrap());
        assert!((mean - truth).abs() < 4.0 * sd, "{name}: {mean} ± {sd}");
        assert!(sd < 0.02 * truth, "{name}: {sd}");
    }
}

/// Wrong files are told with the name of the plugin and the line.
#[test]
fn what_is_wrong_is_told_with_its_place() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let load = |text: &str| {
        let file = folder.path().join("wrong.py");
        std::fs::write(&file, text).unwrap();
        library::load(&file, None).err().unwrap_or_default()
    };
    assert_eq!(load("x = 1\ndef f(:\n"), "invalid syntax, in line 2");
    assert_eq!(
        load("import lacuna\nlacuna.nothing\n").split(", in").last(),
        Some(" line 2: `lacuna.nothing`")
    );
    let none = load("import lacuna\n");
    assert!(none.starts_with("it declares no plugin"), "{none}");
    let method = load("import lacuna\n@lacuna.sampler\nclass A:\n    pass\n");
    assert_eq!(method, "the class `A` has no method `step`");
    let ends = load("import os\nos._exit(3)\n");
    assert!(ends.ends_with("ended with exit code 3"), "{ends}");
    let taken =
        load("import lacuna\n@lacuna.quantity('at')\nclass A:\n    def value(self): pass\n");
    assert!(taken.contains("quantity `at` has a name that is taken"), "{taken}");
}

/// A file that has changed is loaded anew: the plugins are those of the new text.
#[test]
fn a_changed_file_replaces_its_plugins() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("changing.py");
    let value = |text: &str| {
        let class = "import lacuna\n@lacuna.quantity\nclass Changing:\n    def value(self, curve):\n        return";
        std::fs::write(&file, format!("{class} {text}\n")).unwrap();
        library::load(&file, None).unwrap_or_else(|e| panic!("{e}"));
        let built = registry::from_text::<dyn Quantity>("changing", "").unwrap();
        let curve = lacuna::plugin::quantity::Curve {
            name: "y",
            unit: &Unit::dimensionless(),
            axis: "t",
            grid: &[0.0, 1.0],
            grid_unit: &Unit::dimensionless(),
        };
        let bound = built.plugin.bind(&lacuna::plugin::quantity::Arguments::Curve(curve));
        bound.ok().unwrap().value(&[3.0, 4.0])
    };
    assert_eq!([value("curve.max()"), value("curve.min()")], [4.0, 3.0]);
}

/// A model whose gradient has a wrong sign gets a warning that names the parameter, and no trusted result.
#[test]
fn a_wrong_gradient_is_told() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let study = copied(folder.path());
    quick::replace(&study, "[design]\nuse = \"latin_hypercube\"\nruns = 60\n", "");
    quick::replace(&study, "[surrogate]\nuse = \"cubic\"\n", "");
    let run = || {
        let output = quick::command()
            .args(["run", "study.toml", "--out", "run"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let told = "a derivative of the log density is wrong: by `rate`";
    let sound = run();
    assert!(!sound.contains("derivative"), "{sound}");
    let right = "\"rate\": -inputs[\"amplitude\"]";
    quick::replace(&folder.path().join("plugins.py"), right, "\"rate\": inputs[\"amplitude\"]");
    let wrong = run();
    assert!(wrong.contains(told), "{wrong}");
    let assessment = quick::summary(&folder.path().join("run"))["assessment"].clone();
    assert_ne!(assessment["level"], "trusted", "{assessment}");
}

/// Copies the example into a folder and shortens its chains; returns the study.
fn copied(folder: &Path) -> PathBuf {
    for name in ["plugins.py", "study.toml", "activity.csv"] {
        std::fs::copy(example().join(name), folder.join(name)).unwrap();
    }
    let study = folder.join("study.toml");
    let text = std::fs::read_to_string(&study).unwrap();
    std::fs::write(&study, text.replace("steps = 1000", "steps = 200")).unwrap();
    study
}

/// Output of a command, which must succeed.
fn said(arguments: &[&str], folder: &Path) -> String {
    let output = quick::command().args(arguments).current_dir(folder).output().unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(output.status.success(), "{text}");
    text
}

/// A finished run is reported and resumed when the file of its model, reader, sampler and quantity is gone: nothing of them
/// has to be computed. A discrepancy or a surrogate is needed for what the report says of the posterior.
#[test]
fn a_finished_run_needs_its_file_no_more() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let study = copied(folder.path());
    let text = std::fs::read_to_string(&study).unwrap();
    let text = text.replace("use = \"cubic\"", "use = \"polynomial_chaos\"").replace(
        "use = \"heavy_tails\"\nscale = 0.1",
        "use = \"gaussian\"\nvariance = { half_normal = 0.1 }",
    );
    std::fs::write(&study, text).unwrap();
    said(&["run", "study.toml", "--out", "run"], folder.path());
    let summary = quick::summary(&folder.path().join("run"));
    std::fs::remove_file(folder.path().join("plugins.py")).unwrap();
    for verb in ["report", "resume"] {
        said(&[verb, "run"], folder.path());
        let again = quick::summary(&folder.path().join("run"));
        assert_eq!(again["parameters"], summary["parameters"], "{verb}");
        assert_eq!(again["quantities"], summary["quantities"], "{verb}");
    }
}

/// Results that a changed file would compute from the same draws are computed again, though the draws have the same bits.
#[test]
fn what_follows_from_a_changed_file_is_computed_again() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path());
    said(&["run", "study.toml", "--out", "run"], folder.path());
    let record = |stage: &str| -> serde_json::Value {
        let file = folder.path().join("run").join(stage).join("stage.json");
        serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
    };
    let stages = ["5-calibrate", "6-evidence", "6-validate", "6-quantities"];
    let before = stages.map(record);
    let file = folder.path().join("plugins.py");
    let text = std::fs::read_to_string(&file).unwrap();
    let other = text
        .replace("self.degrees / (self.degrees - 2)}", "4 * self.degrees / (self.degrees - 2)}");
    assert_ne!(text, other);
    std::fs::write(&file, other).unwrap();
    said(&["run", "study.toml", "--out", "run"], folder.path());
    let after = stages.map(record);
    assert_eq!(before[0]["outputs"], after[0]["outputs"], "the draws are the same");
    for (stage, (old, new)) in stages.iter().zip(before.iter().zip(&after)) {
        assert_ne!(old["inputs"], new["inputs"], "{stage} was not computed again");
    }
    // The design and the runs do not depend on plugins that come after them but through the file of the model.
    assert_ne!(before[2]["outputs"], after[2]["outputs"], "the predictive variance has changed");
}
