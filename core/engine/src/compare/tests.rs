use serde_json::json;

use super::*;

fn finished(name: &str, log: f64, error: f64, hash: &str) -> Finished {
    Finished {
        directory: PathBuf::from(format!("runs/{name}")),
        summary: json!({
            "study": name,
            "title": name,
            "converged": true,
            "components": { "surrogate": "polynomial_chaos", "discrepancy": "gaussian" },
            "data": { "sha256": hash },
            "parameters": { "density": { "mean": 12107.3, "sd": 14.6, "unit": "kg/m3" } },
            "evidence": { "log": log, "error": error },
        }),
        left_out: None,
        curves_left_out: None,
        predicted: None,
    }
}

/// Two studies with log evidences that differ by log 3 have the probabilities 3/4 and 1/4 (Kass and Raftery, JASA 90
/// (1995) 773, equation 1).
#[test]
fn evidences_become_probabilities() {
    let ahead = finished("a", -10.0 + 3.0_f64.ln(), 0.03, "x");
    let compared = compare(&[finished("b", -10.0, 0.04, "x"), ahead]);
    let (b, a) = (&compared.runs[0], &compared.runs[1]);
    assert!((a.probability.unwrap() - 0.75).abs() < 1e-12);
    assert!((b.probability.unwrap() - 0.25).abs() < 1e-12);
    let [behind, error] = b.evidence_behind.unwrap();
    assert!((behind - 3.0_f64.ln()).abs() < 1e-12 && (error - 0.05).abs() < 1e-12);
    assert_eq!(a.evidence_behind, Some([0.0, 0.0]));
    assert!(compared.notes.is_empty());
}

#[test]
fn evidences_of_different_data_are_not_compared() {
    let compared = compare(&[finished("a", -1.0, 0.1, "x"), finished("b", -2.0, 0.1, "y")]);
    assert!(compared.runs.iter().all(|run| run.probability.is_none()));
    assert!(compared.notes[0].contains("do not have the same data"));
}

#[test]
fn the_text_has_a_column_for_each_run() {
    let text = text(&compare(&[finished("a", -1.0, 0.1, "x"), finished("b", -2.0, 0.1, "x")]));
    for words in ["(1) runs/a: a", "(2) runs/b: b", "12107 ± 15", "log evidence", "kg/m3"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}
