//! `lacuna campaign import` in studies with several scenarios.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::verbs::{campaign, made, printed};
use super::{run, study};
use crate::quick;

/// Two scenarios, with one common parameter and one parameter for each.
fn scenarios() -> (TempDir, PathBuf) {
    let script = "echo $1 >> \"$3/made\"; echo \"[$(awk \"BEGIN { print $2 + $4 * $5 }\")]\"";
    let (folder, path) = study(script, "use = \"local\"");
    quick::replace(&path, "\"{{ study }}\"]", "\"{{ study }}\", \"{{ b }}\", \"{{ t }}\"]");
    let further = "[[parameter]]\nname = \"b\"\nunit = \"m\"\nscenario = \"each\"\nprior = { uniform = [0, 1] }\n\
                   [[scenario]]\nname = \"cold\"\nvalues = { t = 1 }\n\
                   [[scenario]]\nname = \"hot\"\nvalues = { t = 2 }\n[response]";
    quick::replace(&path, "[response]", further);
    quick::replace(&path, "runs = 6", "runs = 12");
    let measured = "scenario,replicate,place,y\ncold,1,here,0.9\ncold,2,here,1.0\nhot,1,here,1.4\nhot,2,here,1.5\n";
    fs::write(folder.path().join("measured.csv"), measured).unwrap();
    (folder, path)
}

const HEADER: &str = "run,scenario,a,b[cold],b[hot] [cm],file\n";

#[test]
fn runs_of_all_scenarios_are_taken_in_together() {
    let (folder, path) = scenarios();
    let out = folder.path().join("run");
    let (code, text) = quick::said(&mut run(&path, &out, &[]));
    assert_eq!(code, Some(0), "{text}");
    let before = made(folder.path()).len();
    let hand = folder.path().join("hand");
    fs::create_dir(&hand).unwrap();
    for (file, y) in [("1c", 0.75), ("1h", 1.25), ("2c", 0.5), ("2h", 1.75)] {
        fs::write(hand.join(format!("{file}.csv")), format!("place,y\nhere,{y}\n")).unwrap();
    }
    let table = hand.join("runs.csv");
    let import = || campaign(&["import", table.to_str().unwrap(), "--reader", "csv"], &out);
    for (text, complaint) in wrong_tables() {
        fs::write(&table, &text).unwrap();
        let (code, said) = quick::said(&mut import());
        assert_eq!(code, Some(1), "{text}");
        assert!(said.contains(complaint), "{said}");
        assert!(!out.join("imports/1").exists(), "{text}");
    }
    // Lines in arbitrary order.
    let rows = "x,hot,0.25,0.5,50,1h.csv\ny,cold,0.25,0.25,75,2c.csv\nx,cold,0.25,0.5,50,1c.csv\ny,hot,0.25,0.25,75,2h.csv\n";
    fs::write(&table, format!("{HEADER}{rows}")).unwrap();
    assert!(printed(&mut import()).starts_with("2 runs imported into"));
    let (code, text) = quick::said(quick::command().arg("resume").arg(&out));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(made(folder.path()).len(), before, "no run is made again");
    assert_eq!(quick::summary(&out)["runs"]["used"], 14);
    for (scenario, x, y) in [("cold", 0.75, 0.5), ("hot", 1.25, 1.75)] {
        assert_eq!(responses(&out, scenario), [x, y], "{scenario}");
    }
    another_order_is_no_other_scenario(&path, &out);
}

fn wrong_tables() -> Vec<(String, &'static str)> {
    let rows = |rows: &str| format!("{HEADER}{rows}");
    vec![
        ("run,a,b[cold],b[hot],file\nx,0,0,0,1c.csv\n".to_owned(), "there is no column `scenario`"),
        (
            "scenario,a,b[cold],b[hot],file\ncold,0,0,0,1c.csv\n".to_owned(),
            "there is no column `run`, which says what lines",
        ),
        (
            rows("x,warm,0,0,0,1c.csv\n"),
            "line 2: expected the scenario `cold` or `hot`, found `warm`",
        ),
        (rows("x,cold,0,0,0,1c.csv\n"), "run `x` has no file for the scenario `hot`"),
        (
            rows("x,cold,0,0,0,1c.csv\nx,cold,0,0,0,2c.csv\n"),
            "line 3: there are two files for run `x` of the scenario `cold`",
        ),
        (
            rows("x,cold,0,0,0,1c.csv\nx,hot,0.5,0,0,1h.csv\n"),
            "line 3: run `x` has other parameters in another line",
        ),
    ]
}

/// Responses of two runs that were imported.
fn responses(out: &Path, scenario: &str) -> [f64; 2] {
    let text = fs::read_to_string(out.join("imports/1/asked.json")).unwrap();
    let roll: serde_json::Value = serde_json::from_str(&text).unwrap();
    let all = roll["scenarios"].as_array().unwrap();
    let own = all.iter().find(|pair| pair[0] == scenario).unwrap();
    let folder = out.join("imports/1").join(own[1].as_str().unwrap());
    ["x", "y"].map(|run| {
        let file = folder.join(format!("{run}.nc"));
        lacuna_run::arrays::read(&file, "y").unwrap().values[0]
    })
}

/// A study with the scenarios in reverse order assigns each run correctly, and one with other scenarios rejects them.
fn another_order_is_no_other_scenario(path: &Path, out: &Path) {
    let imports = |name: &str, swap: &[(&str, &str)]| {
        let other = path.with_file_name(name);
        fs::copy(path, &other).unwrap();
        for (old, new) in swap {
            quick::replace(&other, old, new);
        }
        let setting = format!("design.imports=[\"{}\"]", out.join("imports/1").display());
        let made = path.with_file_name(name.replace(".toml", ""));
        (quick::said(&mut run(&other, &made, &[&setting])), made)
    };
    let swap = [
        ("name = \"cold\"\nvalues = { t = 1 }", "name = \"x\"\nvalues = { t = 2 }"),
        ("name = \"hot\"\nvalues = { t = 2 }", "name = \"cold\"\nvalues = { t = 1 }"),
        ("name = \"x\"", "name = \"hot\""),
    ];
    let ((code, text), made) = imports("swapped.toml", &swap);
    assert_eq!(code, Some(0), "{text}");
    let roll = fs::read_to_string(made.join("2-simulate/asked.json")).unwrap();
    let roll: serde_json::Value = serde_json::from_str(&roll).unwrap();
    assert_eq!(roll["scenarios"][0][0], "hot");
    let folder = made.join("2-simulate").join(roll["scenarios"][0][1].as_str().unwrap());
    let y = lacuna_run::arrays::read(&folder.join("x.nc"), "y").unwrap().values[0];
    assert_eq!(y, 1.25);
    let measured = fs::read_to_string(path.with_file_name("measured.csv")).unwrap();
    fs::write(path.with_file_name("warm.csv"), measured.replace("hot", "warm")).unwrap();
    let other = [("name = \"hot\"", "name = \"warm\""), ("measured.csv", "warm.csv")];
    let ((code, text), _) = imports("other.toml", &other);
    assert_eq!(code, Some(1));
    assert!(text.contains("they are not of the scenario `warm`, but of `cold`, `hot`"), "{text}");
}
