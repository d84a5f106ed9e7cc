//! Weights of 30 young rats in five weeks: a line with a level and a slope of its own for each (Gelfand, Hills, Racine-Poon and
//! Smith, Journal of the American Statistical Association 85 (1990) 972). The published posterior is that of the BUGS project
//! (BUGS Examples, volume I, `Rats`): alpha0 106.6 ± 3.66, beta.c 6.186 ± 0.109, sigma 6.093 ± 0.464.

use std::fmt::Write as _;
use std::fs;

use super::{ERRORS, number, run};
use crate::quick;

const WEIGHTS: [[u16; 5]; 30] = [
    [151, 199, 246, 283, 320],
    [145, 199, 249, 293, 354],
    [147, 214, 263, 312, 328],
    [155, 200, 237, 272, 297],
    [135, 188, 230, 280, 323],
    [159, 210, 252, 298, 331],
    [141, 189, 231, 275, 305],
    [159, 201, 248, 297, 338],
    [177, 236, 285, 350, 376],
    [134, 182, 220, 260, 296],
    [160, 208, 261, 313, 352],
    [143, 188, 220, 273, 314],
    [154, 200, 244, 289, 325],
    [171, 221, 270, 326, 358],
    [163, 216, 242, 281, 312],
    [160, 207, 248, 288, 324],
    [142, 187, 234, 280, 316],
    [156, 203, 243, 283, 317],
    [157, 212, 259, 307, 336],
    [152, 203, 246, 286, 321],
    [154, 205, 253, 298, 334],
    [139, 190, 225, 267, 302],
    [146, 191, 229, 272, 302],
    [157, 211, 250, 285, 323],
    [132, 185, 237, 286, 331],
    [160, 207, 257, 303, 345],
    [169, 216, 261, 295, 333],
    [157, 205, 248, 289, 316],
    [137, 180, 219, 258, 291],
    [153, 200, 244, 286, 324],
];

/// ```sh
/// cargo test -p lacuna-tests --test all -- --ignored --nocapture the_rats_have_their_published_posterior
/// ```
#[test]
#[ignore = "65 unknowns take a minute"]
fn the_rats_have_their_published_posterior() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = "rat,age [d],weight [g]\n".to_owned();
    for (k, weights) in WEIGHTS.iter().enumerate() {
        for (week, weight) in weights.iter().enumerate() {
            writeln!(table, "r{},{},{weight}", k + 1, 8 + 7 * week).unwrap();
        }
    }
    fs::write(folder.path().join("rats.csv"), table).unwrap();
    let text = fs::read_to_string(quick::root().join("tests/hierarchy/rats.toml")).unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let ran = run(folder.path(), &[]);
    let summary = quick::summary(&folder.path().join("out"));
    let all = super::draws(&ran, &["level.mean", "slope.mean", "variance"]);
    let count = all.len() as f64;
    let moments = |value: &dyn Fn(&[f64]) -> f64| {
        let mean = all.iter().map(|p| value(p)).sum::<f64>() / count;
        let square = all.iter().map(|p| (value(p) - mean).powi(2)).sum::<f64>() / count;
        (mean, square.sqrt())
    };
    // The Monte Carlo error of a function is that of the least effective coordinate.
    let effective = ["level.mean", "slope.mean", "variance"]
        .iter()
        .map(|name| number(&summary["parameters"][*name], "/ess_bulk"))
        .fold(f64::INFINITY, f64::min)
        .min(count);
    let origin = moments(&|p| p[0] - 22.0 * p[1]);
    let slope = moments(&|p| p[1]);
    let sigma = moments(&|p| p[2].sqrt());
    eprintln!("alpha0 {origin:?}, beta.c {slope:?}, sigma {sigma:?}, effective {effective}");
    // Mean, standard deviation, and half of the last digit of the mean.
    for ((mean, sd), (published, its_sd, digit)) in [
        (origin, (106.6, 3.66, 0.05)),
        (slope, (6.186, 0.109, 0.0005)),
        (sigma, (6.093, 0.464, 0.0005)),
    ] {
        // BUGS made ten thousand correlated draws; a thousand independent ones is a cautious figure.
        let error = its_sd * (1.0 / effective + 1.0 / 1000.0).sqrt() + digit;
        assert!((mean - published).abs() < ERRORS * error, "{mean}, {published}, {error}");
        let bound = ERRORS * (0.5 / effective + 0.5 / 1000.0).sqrt();
        assert!((sd / its_sd - 1.0).abs() < bound, "{sd}, {its_sd}");
    }
}
