//! Calls that fail: the exact reason, and an answer to the next call.

use std::time::{Duration, Instant};

use super::{Case, LINES};

/// A function that fails at `a` = 2 and answers elsewhere.
fn wrong(line: &str) -> Option<Case> {
    let text = format!(
        "import os, sys, time\ndef simulate(a, b):\n    if a == 2:\n        {line}\n    return [b] * 6\n"
    );
    Case::new(&text, "timeout = 5")
}

#[test]
fn what_goes_wrong_costs_one_run() {
    let begin = "`simulate` in `model.py`: ";
    for (line, reason) in [
        (
            "raise ValueError('negative density')",
            "ValueError: negative density, in line 4: `raise ValueError('negative density')`",
        ),
        ("1 / 0", "ZeroDivisionError: division by zero, in line 4: `1 / 0`"),
        ("sys.exit(3)", "SystemExit: 3, in line 4: `sys.exit(3)`"),
        (
            "print('bye'); sys.stdout.flush(); os._exit(7)",
            "the worker ended with exit code 7; it said: bye",
        ),
        ("os.abort()", "the worker was ended by a signal"),
        ("os.close(1); os.close(2); return None", "expected values along `sensor`, found None"),
        ("return [1, 2, 3]", "the response has 3 values, expected 6"),
        ("return [[1, 2], [3, 4], [5, 6]]", "3 values along `sensor`, expected 2"),
        ("return [[1, 2, 3], [4, 5]]", "2 values along `time`, expected 3"),
        ("return {'B': [1, 2, 3], 'D': [1, 2, 3]}", "the response has no sensor `D`"),
        ("return {'B': [1, 2, 3]}", "no values of sensor `C`"),
        ("return 'six'", "expected values along `sensor`, found 'six'"),
        ("return [1, 2, 3, 4, 5, 1j]", "expected a number, found 1j"),
    ] {
        let Some(case) = wrong(line) else { return };
        let found = case.reason();
        assert!(found.starts_with(&format!("{begin}{reason}")), "{line}\n{found}");
        assert_eq!(case.at([1.0, 0.5]).unwrap(), [0.5; 6], "{line}");
    }
    let Some(case) = wrong("return [1, 2, float('nan'), 4, 5, 6]") else { return };
    assert_eq!(case.reason(), "the response is NaN at sensor `B`, time 3 s");
}

#[test]
fn a_function_that_hangs_is_stopped() {
    let text =
        "import time\ndef simulate(a, b):\n    time.sleep(60 if a == 2 else 0)\n    return [b] * 6";
    let Some(case) = Case::new(text, "timeout = 3") else { return };
    assert_eq!(case.at([1.0, 0.5]).unwrap(), [0.5; 6]);
    let begun = Instant::now();
    assert_eq!(case.reason(), "`simulate` in `model.py` was stopped after 3 s");
    assert!(begun.elapsed() < Duration::from_secs(40));
    assert_eq!(case.at([1.0, 0.5]).unwrap(), [0.5; 6]);
}

#[test]
fn what_no_run_can_mend_stops_the_study() {
    for (text, options, reason) in [
        ("def other(): pass", "", "`model.py`: there is no function `simulate`"),
        ("simulate = 3", "", "`model.py`: there is no function `simulate`"),
        ("def simulate(a): pass", "", "`model.py`: `simulate` has no argument for the input `b`"),
        (
            "def simulate(a, b, c): pass",
            "",
            "`model.py`: `simulate` requires the argument `c`, which is not an input of the study",
        ),
        (LINES, "gradient = 'slopes'", "`model.py`: there is no function `slopes`"),
        (
            "def simulate(:",
            "",
            "`model.py` cannot be loaded: SyntaxError: invalid syntax (model.py, line 1)",
        ),
        (
            "import no_such_module",
            "",
            "`model.py` cannot be loaded: ModuleNotFoundError: No module named 'no_such_module', in line 1: `import no_such_module`",
        ),
        ("import os; os._exit(4)", "", "the Python interpreter `PYTHON` ended with exit code 4"),
    ] {
        let Some(case) = Case::new(text, options) else { return };
        let python = super::interpreter().unwrap().display().to_string();
        assert_eq!(case.stop().replace(&python, "PYTHON"), reason, "{text}");
    }
    let Some(case) = Case::new(LINES, "") else { return };
    std::fs::remove_file(case.study.path().join("model.py")).unwrap();
    assert!(case.stop().starts_with("`model.py` cannot be loaded: FileNotFoundError: "));
}

#[test]
fn derivatives_that_are_none_are_refused() {
    for (line, reason) in [
        ("{'a': [0] * 6}", "`slopes` in `model.py`: no derivatives by `b`"),
        ("[0] * 6", "`slopes` in `model.py`: the response has 6 values, expected 12"),
        (
            "{'a': [0] * 6, 'b': [float('inf')] * 6}",
            "the derivative by `b` is inf at sensor `B`, time 1 s",
        ),
    ] {
        let text = format!("{LINES}\ndef slopes(a, b):\n    return {line}\n");
        let Some(case) = Case::new(&text, "gradient = 'slopes'") else { return };
        assert_eq!(case.jacobian().unwrap_err().to_string(), reason);
    }
}
