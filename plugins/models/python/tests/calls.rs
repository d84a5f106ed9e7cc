//! Calls with an answer.

use lacuna::plugin::model::EvalError;

use super::{Case, LINES};

const ANSWER: [f64; 6] = [2.5, 4.5, 6.5, -2.5, -4.5, -6.5];

#[test]
fn a_function_gets_its_inputs_by_name() {
    let Some(case) = Case::new(LINES, "") else { return };
    assert_eq!(case.run().unwrap(), ANSWER);
    assert_eq!(case.at([0.0, 1.0]).unwrap(), [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]);
    assert_eq!(
        case.at([f64::NAN, 1.0]),
        Err(EvalError::Rejected("the input `a` is NaN".to_owned()))
    );
}

#[test]
fn a_response_may_have_any_shape_that_says_what_it_means() {
    for result in [
        "up + down",
        "tuple(map(tuple, (up, down)))",
        "{'C': down, 'B': up}",
        "(y for row in (up, down) for y in row)",
        "[iter(up), iter(down)] and [up, down]",
    ] {
        let text = format!(
            "def simulate(*, a, b, other=3):\n    up = [a * t + b for t in (1, 2, 3)]\n    \
             down = [-y for y in up]\n    return {result}\n"
        );
        let Some(case) = Case::new(&text, "") else { return };
        assert_eq!(case.run().unwrap(), ANSWER, "{result}");
    }
}

#[test]
fn numbers_are_passed_exactly() {
    let text = "def simulate(a, b):\n    return [[a, b, a / b], [b / a, 5e-324, a * b]]";
    let Some(case) = Case::new(text, "") else { return };
    for (a, b) in [(0.1, 1.0 / 3.0), (1e-300, 2.0), (6.022_140_76e23, -7.3e-12), (5e-324, 5e-324)] {
        assert_eq!(case.at([a, b]).unwrap(), [a, b, a / b, b / a, 5e-324, a * b]);
    }
}

#[test]
fn layout_and_scenario_are_given_to_those_who_ask() {
    let text = "
def simulate(a, b, scenario, layout):
    sensors, times = layout['axes']
    assert (sensors['name'], sensors['labels'], times['unit']) == ('sensor', ['B', 'C'], 's')
    assert (layout['name'], layout['unit'], scenario['name']) == ('strain', '1', 'full')
    return {label: [scenario['values']['power'] * t for t in times['values']] for label in sensors['labels']}
";
    let Some(case) = Case::new(text, "") else { return };
    assert_eq!(case.run().unwrap(), [1.4, 2.8, 1.4 * 3.0, 1.4, 2.8, 1.4 * 3.0]);
}

#[test]
fn what_is_printed_and_read_disturbs_nothing() {
    let text = "
import os, subprocess, sys
print('loading')
def simulate(a, b):
    print('{\"count\": 1}', flush=True)
    os.write(1, b'raw' * 10000)
    subprocess.run(['echo', 'from a child'])
    assert sys.stdin.read() == ''
    sys.stdout = None
    return [a] * 6
";
    let Some(case) = Case::new(text, "") else { return };
    for _ in 0..3 {
        assert_eq!(case.run().unwrap(), [2.0; 6]);
    }
}

#[test]
fn the_file_is_loaded_once_a_worker_and_finds_its_neighbours() {
    let text = "
import neighbour
with open('loads', 'a') as file:
    file.write('x')
def simulate(**inputs):
    return [neighbour.double(inputs['a'])] * 6
";
    let Some(case) = Case::new(text, "") else { return };
    let neighbour = case.study.path().join("neighbour.py");
    std::fs::write(neighbour, "def double(x):\n    return 2 * x\n").unwrap();
    for i in 0..5 {
        assert_eq!(case.at([f64::from(i), 0.0]).unwrap(), [2.0 * f64::from(i); 6]);
    }
    let loads = || std::fs::read_to_string(case.study.path().join("loads")).unwrap().len();
    assert_eq!(loads(), 1);
    std::thread::scope(|scope| {
        let calls: Vec<_> = (0..4).map(|_| scope.spawn(|| case.run().unwrap())).collect();
        for call in calls {
            assert_eq!(call.join().unwrap(), [4.0; 6]);
        }
    });
    assert!((1..=4).contains(&loads()));
}

#[test]
fn a_vectorised_function_gets_many_runs_at_once() {
    let text = "
calls = 0
def simulate(a, b):
    global calls
    calls += 1
    if any(x > 90 for x in a):
        raise ValueError('too much')
    return [[[x, y, calls], [len(a), 0, 0]] for x, y in zip(a, b)]
";
    let Some(case) = Case::new(text, "vectorised = true\nbatch = 7") else { return };
    assert_eq!(case.model.batch(), 7);
    let found = case.batch(&[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]);
    let expected = |x, y, call, runs| Ok(vec![x, y, call, runs, 0.0, 0.0]);
    assert_eq!(found[1], expected(3.0, 4.0, 1.0, 3.0));
    assert_eq!(case.run(), expected(2.0, 0.5, 2.0, 1.0));
    // A run that fails does not affect the others.
    let found = case.batch(&[[1.0, 2.0], [99.0, 4.0], [f64::NAN, 1.0]]);
    assert_eq!(found[0], expected(1.0, 2.0, 3.0, 1.0));
    assert!(found[1].as_ref().is_err_and(|why| why.to_string().contains("too much")));
    let found = case.batch(&[[1.0, 2.0], [99.0, 4.0]]);
    assert_eq!((found[0].is_ok(), found[1].is_ok()), (true, false));
}

#[test]
fn derivatives_are_a_dict_by_input_or_an_axis_more() {
    let by_input = "
def slopes(a, b):
    return {'b': [[1, 1, 1], [-1, -1, -1]], 'a': [1, 2, 3, -1, -2, -3]}
";
    let by_axis = "
def slopes(a, b):
    return [[[s * t, s] for t in (1, 2, 3)] for s in (1, -1)]
";
    for slopes in [by_input, by_axis] {
        let Some(case) = Case::new(&format!("{LINES}{slopes}"), "gradient = 'slopes'") else {
            return;
        };
        let found = case.jacobian().unwrap();
        assert_eq!(found.column(0), [1.0, 2.0, 3.0, -1.0, -2.0, -3.0]);
        assert_eq!(found.column(1), [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]);
    }
    let Some(case) = Case::new(LINES, "") else { return };
    assert!(case.model.gradient().is_none());
}

/// Arrays have the same results as lists. Runs where the interpreter has `numpy`.
#[test]
fn arrays_are_answered_exactly() {
    let text = "
import numpy as np
def simulate(a, b):
    up = np.multiply.outer(a, np.arange(1, 4)) + np.asarray(b)[..., None]
    return np.stack([up, -up], axis=-2)
def one(a, b):
    return simulate(a, b).astype('float32') if a > 5 else simulate(a, b).T
";
    let Some(case) = Case::new(text, "vectorised = true") else { return };
    if case.run().is_err_and(|why| why.to_string().contains("No module named")) {
        println!("skipped: the interpreter has no NumPy");
        return;
    }
    assert_eq!(case.run().unwrap(), ANSWER);
    assert_eq!(case.batch(&[[2.0, 0.5], [4.0, 1.0]])[1].as_ref().unwrap()[..3], [5.0, 9.0, 13.0]);
    let one = Case::new(text, "function = 'one'").unwrap();
    assert_eq!(one.at([8.0, 0.5]).unwrap()[0], 8.5);
    let shape = "`one` in `model.py`: the response has the shape (3, 2), expected (2, 3)";
    assert_eq!(one.reason(), shape);
}
