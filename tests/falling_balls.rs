//! Measured drops of eleven balls from a bridge, each with its own record: free fall with common gravity, compared with
//! linear least squares. The files are those of de Silva, Higdon, Brunton and Kutz, Frontiers in AI 3 (2020) 25.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use crate::quick;
use crate::worked::is_normal;

/// Times and heights of one drop.
type Drop = (Vec<f64>, Vec<f64>);

/// Mean and standard deviation of the priors of gravity, height and velocity, and the noise, in SI units.
const GRAVITY: [f64; 2] = [9.0, 2.0];
const HEIGHT: [f64; 2] = [40.0, 10.0];
const VELOCITY: [f64; 2] = [0.0, 3.0];
const NOISE: f64 = 0.3;

fn drops(text: &str) -> BTreeMap<String, Drop> {
    let mut drops = BTreeMap::<String, Drop>::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let drop = drops.entry(format!("{}-{}", cells[0], cells[1])).or_default();
        drop.0.push(cells[2].parse().unwrap());
        drop.1.push(cells[3].parse().unwrap());
    }
    drops
}

fn study(drops: &BTreeMap<String, Drop>) -> String {
    let normal = |[mean, sd]: [f64; 2]| format!("prior = {{ normal = [{mean:?}, {sd:?}] }}");
    let (gravity, height, velocity) = (normal(GRAVITY), normal(HEIGHT), normal(VELOCITY));
    let variance = NOISE * NOISE;
    let mut text = format!(
        r#"
        [study]
        title = "Balls dropped from a bridge"
        seed = 1590
        [[parameter]]
        name = "gravity"
        unit = "m/s2"
        {gravity}
        [[parameter]]
        name = "height"
        unit = "m"
        scenario = "each"
        {height}
        [[parameter]]
        name = "velocity"
        unit = "m/s"
        scenario = "each"
        {velocity}
        [response]
        name = "place"
        unit = "m"
        axes = {{ time = {{ measured = true, unit = "s" }} }}
        [model]
        use = "equations"
        state = {{ y = "height", v = "velocity" }}
        rate = {{ y = "v", v = "-gravity" }}
        observe = "y"
        [measurements]
        use = "csv"
        path = "{{scenario}}.csv"
        [discrepancy]
        use = "gaussian"
        variance = {{ known = {variance:?} }}
        [sampler]
        use = "no_u_turn"
        metric = "dense"
        warm_up = 300
        steps = 800
        "#
    );
    for name in drops.keys() {
        write!(text, "[[scenario]]\nname = \"{name}\"\n").unwrap();
    }
    text
}

/// Solves two equations in two unknowns with the symmetric matrix `[a, b; b, c]`.
fn solve([a, b, c]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    let determinant = a * c - b * b;
    [(c * x - b * y) / determinant, (a * y - b * x) / determinant]
}

/// Normal posterior of `y = h + v t - g t²/2 + e`: the precision of gravity after elimination of height and velocity of
/// each drop (Schur complement), then these given gravity.
fn closed_form(drops: &BTreeMap<String, Drop>) -> Vec<(String, f64, f64)> {
    let weight = NOISE.powi(-2);
    let precision = |[_, sd]: [f64; 2]| sd.powi(-2);
    let sum = |drop: &Drop, f: &dyn Fn(f64, f64) -> f64| -> f64 {
        weight * drop.0.iter().zip(&drop.1).map(|(t, y)| f(*t, *y)).sum::<f64>()
    };
    let parts = |drop: &Drop| {
        let count = sum(drop, &|_, _| 1.0) + precision(HEIGHT);
        let square = sum(drop, &|t, _| t * t) + precision(VELOCITY);
        let matrix = [count, sum(drop, &|t, _| t), square];
        let height = sum(drop, &|_, y| y) + precision(HEIGHT) * HEIGHT[0];
        let right = [height, sum(drop, &|t, y| t * y) + precision(VELOCITY) * VELOCITY[0]];
        let fall = [sum(drop, &|t, _| -0.5 * t * t), sum(drop, &|t, _| -0.5 * t * t * t)];
        (matrix, right, fall)
    };
    let (mut total, mut pull) = (precision(GRAVITY), precision(GRAVITY) * GRAVITY[0]);
    for drop in drops.values() {
        let (matrix, right, fall) = parts(drop);
        let shift = solve(matrix, fall);
        let own = sum(drop, &|t, _| 0.25 * t.powi(4));
        total += own - fall[0] * shift[0] - fall[1] * shift[1];
        let seen = sum(drop, &|t, y| -0.5 * t * t * y);
        pull += seen - shift[0] * right[0] - shift[1] * right[1];
    }
    let gravity = pull / total;
    let mut all = vec![("gravity".to_owned(), gravity, total.powf(-0.5))];
    for (name, drop) in drops {
        let (matrix, right, fall) = parts(drop);
        let shift = solve(matrix, fall);
        let free = solve(matrix, right);
        let own = [solve(matrix, [1.0, 0.0])[0], solve(matrix, [0.0, 1.0])[1]];
        for (k, of) in ["height", "velocity"].into_iter().enumerate() {
            let variance = own[k] + shift[k] * shift[k] / total;
            all.push((format!("{of}[{name}]"), free[k] - shift[k] * gravity, variance.sqrt()));
        }
    }
    all
}

#[test]
fn twenty_two_drops_share_one_gravity() {
    let table = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/reference/effect_data/falling_balls/ball_drops.csv"
    );
    let Ok(text) = std::fs::read_to_string(table) else {
        eprintln!("skipped: {table} is not there");
        return;
    };
    let drops = drops(&text);
    let folder = tempfile::tempdir().unwrap();
    for (name, (times, heights)) in &drops {
        let mut text = "replicate,time [s],place [m]\n".to_owned();
        for (time, height) in times.iter().zip(heights) {
            writeln!(text, "1,{time:?},{height:?}").unwrap();
        }
        std::fs::write(folder.path().join(format!("{name}.csv")), text).unwrap();
    }
    let path = folder.path().join("study.toml");
    std::fs::write(&path, study(&drops)).unwrap();
    let out = folder.path().join("run");
    quick::run(Path::new(&path), &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let found = quick::summary(&out);
    let exact = closed_form(&drops);
    assert_eq!(exact.len(), 45);
    let exact: Vec<(&str, f64, f64)> = exact.iter().map(|(n, m, s)| (n.as_str(), *m, *s)).collect();
    is_normal(&found, &exact);
    assert_eq!(found["data"]["count"], text.lines().count() - 1);
    assert!(found["surrogate"].is_null());
}
