//! A straight line, measured with independent normal noise, and its posterior under normal priors in closed form.

use crate::noise::Source;

/// Times of the measured values, s.
pub const TIMES: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

/// Standard deviations of the priors of level and slope, with mean zero.
pub const PRIOR: [f64; 2] = [1.0, 0.5];

/// Replicates of a line, one vector of values each.
pub fn replicates(truth: [f64; 2], sd: f64, count: usize, random: &mut Source) -> Vec<Vec<f64>> {
    let mut one = || TIMES.iter().map(|t| truth[0] + truth[1] * t + sd * random.normal()).collect();
    (0..count).map(|_| one()).collect()
}

/// The replicates as a table in long form.
pub fn table(replicates: &[Vec<f64>]) -> String {
    let mut text = String::from("replicate,t [s],level [m]\n");
    for (r, values) in replicates.iter().enumerate() {
        for (t, y) in TIMES.iter().zip(values) {
            text.push_str(&format!("{},{t},{y}\n", r + 1));
        }
    }
    text
}

/// Runs of the line at points drawn from the priors: tables of their parameters and of their responses.
pub fn runs(count: usize, random: &mut Source) -> [String; 2] {
    let mut points = String::from("run,level0 [m],rise [m/s]\n");
    let mut responses = String::from("run,t [s],level [m]\n");
    for run in 1..=count {
        let [level, rise] = PRIOR.map(|sd| sd * random.normal());
        points.push_str(&format!("r{run},{level},{rise}\n"));
        for t in TIMES {
            responses.push_str(&format!("r{run},{t},{}\n", level + rise * t));
        }
    }
    [points, responses]
}

/// The posterior in closed form.
#[derive(Debug, Clone, Copy)]
pub struct Posterior {
    /// Means of level and slope.
    pub mean: [f64; 2],
    /// Covariance matrix of level and slope.
    pub covariance: [[f64; 2]; 2],
    /// Logarithm of the evidence.
    pub log_evidence: f64,
}

/// Posterior for replicates with noise of standard deviation `sd`: conjugate normal distributions.
pub fn posterior(replicates: &[Vec<f64>], sd: f64) -> Posterior {
    let precision = 1.0 / (sd * sd);
    let mut a = [[1.0 / (PRIOR[0] * PRIOR[0]), 0.0], [0.0, 1.0 / (PRIOR[1] * PRIOR[1])]];
    let (mut b, mut squares, mut count) = ([0.0; 2], 0.0, 0.0);
    for values in replicates {
        for (t, y) in TIMES.iter().zip(values) {
            a[0][0] += precision;
            a[0][1] += precision * t;
            a[1][1] += precision * t * t;
            b[0] += precision * y;
            b[1] += precision * t * y;
            squares += precision * y * y;
            count += 1.0;
        }
    }
    a[1][0] = a[0][1];
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let covariance = [
        [a[1][1] / determinant, -a[0][1] / determinant],
        [-a[1][0] / determinant, a[0][0] / determinant],
    ];
    let mean = [0, 1].map(|i: usize| covariance[i][0] * b[0] + covariance[i][1] * b[1]);
    // Normal density of the data, with the determinant of its covariance expressed by that of the posterior precision.
    let log_determinant =
        count * (sd * sd).ln() + determinant.ln() + 2.0 * PRIOR.iter().map(|s| s.ln()).sum::<f64>();
    let square = squares - mean[0] * b[0] - mean[1] * b[1];
    let log_evidence = -0.5 * (square + log_determinant + count * std::f64::consts::TAU.ln());
    Posterior { mean, covariance, log_evidence }
}
