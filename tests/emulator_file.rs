//! `lacuna convert RUN OUT.nc`: the emulator in a file, evaluated by the reader of `examples/emulator`, which shares no
//! code with the program.

use std::fs;
use std::path::Path;
use std::process::Command;

use lacuna::run::Silent;
use lacuna_engine::serve;
use lacuna_linalg::Matrix;
use lacuna_run::RunDirectory;

use crate::python::interpreter;
use crate::quick;

/// Evaluates the file at points of a JSON file.
const READ: &str = r"
import json, sys
sys.path.insert(0, sys.argv[1])
from emulator import Emulator
emulator = Emulator(sys.argv[2])
points = json.load(open(sys.argv[3]))
found = emulator.predict(points)
print(json.dumps({'parameters': emulator.parameters, 'shape': emulator.shape,
    'values': [[None if y != y else y for y in row.ravel().tolist()] for row in found]}))
";

/// Values of the file at points, with names of its parameters and the shape of its response.
fn read(file: &Path, points: &[Vec<f64>]) -> Option<serde_json::Value> {
    let python = interpreter("NumPy and SciPy")?;
    let at = file.with_extension("json");
    fs::write(&at, serde_json::to_string(points).unwrap()).unwrap();
    let reader = quick::root().join("examples/emulator");
    let output =
        Command::new(python).arg("-c").arg(READ).args([&reader, file, &at]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// Values of the run's emulator at points; a row of NaN outside of its region.
fn ours(study: &Path, out: &Path, points: &[Vec<f64>]) -> Matrix {
    let study = quick::load(study, &[]);
    let mut run = RunDirectory::open(out).unwrap();
    run.look();
    let points = Matrix::from_rows(points[0].len(), points);
    serve::functions(&study, Some(run), &Silent, |all| {
        let emulator = all.iter().find(|function| function.name() == "emulator").unwrap();
        emulator.batch(&points).unwrap()
    })
    .unwrap()
}

/// The surrogate of the study in `quick`.
const SECTION: &str = "use = \"polynomial_chaos\"\ndegree = { max = 4 }";

#[test]
fn the_reader_of_the_file_predicts_what_the_emulator_does() {
    let folder = quick::simulated();
    let study = folder.path().join("study.toml");
    let mut before = SECTION.to_owned();
    for (number, section) in [
        SECTION,
        "use = \"polynomial_chaos\"\nbasis = \"arbitrary\"\ndegree = { max = 3 }",
        "use = \"gaussian_process\"",
        "use = \"gaussian_process\"\nkernel = \"matern_3_2\"\ntrend = \"linear\"",
        "use = \"polynomial_chaos_kriging\"\nkernel = \"squared_exponential\"",
    ]
    .into_iter()
    .enumerate()
    {
        quick::replace(&study, &before, section);
        section.clone_into(&mut before);
        let out = folder.path().join(format!("run{number}"));
        quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
        let file = folder.path().join(format!("emulator{number}.nc"));
        let done = quick::command().arg("convert").args([&out, &file]).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));

        let parameters = quick::load(&study, &[]).parameters;
        let point = |k: usize| -> Vec<f64> {
            let share = |i: usize| 0.02 + 0.96 * ((k * (7 + 4 * i) + 3) % 20) as f64 / 19.0;
            parameters.iter().enumerate().map(|(i, p)| p.design.quantile(share(i))).collect()
        };
        let mut points: Vec<Vec<f64>> = (0..20).map(point).collect();
        points.push(parameters.iter().map(|p| p.design.support().1 * 1.5 + 1.0).collect());
        let truth = ours(&study, &out, &points);
        let Some(found) = read(&file, &points) else { return };
        let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(found["parameters"], serde_json::json!(names));
        let lengths: u64 =
            found["shape"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).product();
        assert_eq!(lengths as usize, truth.columns());
        let largest =
            truth.as_slice().iter().filter(|y| y.is_finite()).fold(0.0, |a: f64, y| a.max(y.abs()));
        assert!(largest > 0.0);
        for (i, row) in truth.iter_rows().enumerate() {
            for (j, y) in row.iter().enumerate() {
                let theirs = found["values"][i][j].as_f64();
                let same = match theirs {
                    // Weights of a process are large and of both signs: their sum keeps fewer digits.
                    Some(theirs) => (theirs - y).abs() < 1e-7 * largest,
                    None => y.is_nan(),
                };
                assert!(same, "{section}, point {i}, output {j}: {y} and {theirs:?}");
            }
        }
        assert!(truth.row(20).iter().all(|y| y.is_nan()), "beyond the region");
    }
}

#[test]
fn emulators_without_a_form_are_refused_with_the_reason() {
    let folder = quick::simulated();
    let study = folder.path().join("study.toml");
    let out = folder.path().join("run");
    quick::run(&study, &["surrogate.basis=hermite"], &out).unwrap_or_else(|stop| panic!("{stop}"));
    for (source, right, code) in [
        (out.as_path(), "hermite polynomials of a parameter with the design", 1),
        (study.as_path(), "is no run directory", 2),
    ] {
        let done =
            quick::command().arg("convert").arg(source).arg(out.join("e.nc")).output().unwrap();
        let text = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.code() == Some(code) && text.contains(right), "{text}");
        assert!(!out.join("e.nc").exists());
    }
}
