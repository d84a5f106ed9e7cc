//! The gate of a companion: its errors on simulation runs that did not identify it.

use lacuna::data::Ensemble;
use lacuna::plugin::Forward;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use crate::gap::result::companion::IdentifiedCompanion;
use crate::stage::direct::ModelMap;
use crate::study::gap::companion::Companion;

/// The largest number of runs on which a companion is checked.
const CHECKED: usize = 24;

/// Runs by their purpose, as rows of the ensemble.
pub(super) struct Split {
    /// The runs that identify the constants.
    pub identify: Vec<usize>,
    /// The runs on which the companion is checked.
    pub check: Vec<usize>,
}

/// The response's root mean square about its mean over these runs and all outputs.
pub(super) fn scale(ensemble: &Ensemble, runs: &[usize]) -> f64 {
    let values = || runs.iter().flat_map(|&r| ensemble.responses.row(r));
    let count = values().count().max(1) as f64;
    let mean = values().sum::<f64>() / count;
    (values().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE)
}

/// Points of a companion: the study's parameters of a run, then the constants.
pub(super) fn points(ensemble: &Ensemble, runs: &[usize], constants: &[f64]) -> Matrix {
    let rows = runs.iter().map(|&r| [ensemble.points.row(r), constants].concat());
    Matrix::from_rows(ensemble.points.columns() + constants.len(), rows)
}

/// Divides valid runs: the first is the one nearest to the centre, each further one the farthest from those before, in
/// units of the standard deviations of the parameters.
pub(super) fn split(ensemble: &Ensemble, companion: &Companion) -> Result<Split, Stop> {
    let valid: Vec<usize> = (0..ensemble.runs.len()).filter(|&r| ensemble.valid[r]).collect();
    let wanted = companion.keys.runs.get();
    if valid.len() < wanted + 2 {
        return Err(Stop::new(format!(
            "the companion needs {} simulation runs, {wanted} to identify its constants and two to check it; there are {}",
            wanted + 2,
            valid.len()
        ))
        .help("lower `runs` of `[gap.companion]`, or make more runs"));
    }
    let rows: Vec<Vec<f64>> = standardised(ensemble, &valid);
    let distance =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
    let centre = vec![0.0; ensemble.points.columns()];
    let mut nearest: Vec<f64> = rows.iter().map(|row| distance(row, &centre)).collect();
    let first = (0..rows.len()).min_by(|&a, &b| nearest[a].total_cmp(&nearest[b])).unwrap_or(0);
    let mut order = vec![first];
    nearest = rows.iter().map(|row| distance(row, &rows[first])).collect();
    while order.len() < (wanted + CHECKED).min(rows.len()) {
        let next = (0..rows.len()).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b])).unwrap_or(0);
        order.push(next);
        for (least, row) in nearest.iter_mut().zip(&rows) {
            *least = least.min(distance(row, &rows[next]));
        }
    }
    let mut identify: Vec<usize> = order.iter().map(|&k| valid[k]).collect();
    let check = identify.split_off(wanted);
    Ok(Split { identify, check })
}

fn standardised(ensemble: &Ensemble, runs: &[usize]) -> Vec<Vec<f64>> {
    let n = runs.len() as f64;
    let column = |j: usize| {
        let values: Vec<f64> = runs.iter().map(|&r| ensemble.points[(r, j)]).collect();
        let mean = values.iter().sum::<f64>() / n;
        let sd = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        (mean, sd.max(f64::MIN_POSITIVE))
    };
    let columns: Vec<(f64, f64)> = (0..ensemble.points.columns()).map(column).collect();
    let row = |&r: &usize| {
        let values = ensemble.points.row(r).iter().zip(&columns);
        values.map(|(x, (mean, sd))| (x - mean) / sd).collect()
    };
    runs.iter().map(row).collect()
}

/// The errors of a companion with these constants on some runs.
pub(super) fn checked(
    map: &ModelMap<'_>,
    companion: &Companion,
    ensemble: &Ensemble,
    runs: &[usize],
    constants: &[f64],
) -> Result<IdentifiedCompanion, Stop> {
    let answers = map.mean(&points(ensemble, runs, constants));
    if let Some(fatal) = map.failure() {
        return Err(Stop::new(format!("the companion: {fatal}")));
    }
    let answered: Vec<usize> =
        (0..runs.len()).filter(|&k| answers.row(k).iter().all(|y| y.is_finite())).collect();
    if answered.len() < 2 {
        return Err(Stop::new(format!(
            "the companion has an answer to {} of {} simulation runs{}",
            answered.len(),
            runs.len(),
            map.tally().map_or(String::new(), |why| format!(": {why}"))
        )));
    }
    let error = |k: usize| -> Vec<f64> {
        let pairs = ensemble.responses.row(runs[k]).iter().zip(answers.row(k));
        pairs.map(|(y, c)| y - c).collect()
    };
    let errors: Vec<Vec<f64>> = answered.iter().map(|&k| error(k)).collect();
    let square = |rows: &[Vec<f64>]| {
        let count = rows.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        rows.iter().flatten().map(|e| e * e).sum::<f64>() / count
    };
    let used: Vec<usize> = answered.iter().map(|&k| runs[k]).collect();
    let own: Vec<Vec<f64>> = used.iter().map(|&r| ensemble.responses.row(r).to_vec()).collect();
    // Differences between successive runs, which lie far apart.
    let change = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let difference =
            |two: &[Vec<f64>]| two[1].iter().zip(&two[0]).map(|(a, b)| a - b).collect();
        rows.windows(2).map(difference).collect()
    };
    let of_the_changes = change(&errors);
    let of_changes = square(&of_the_changes) / square(&change(&own)).max(f64::MIN_POSITIVE);
    let error = square(&errors).sqrt() / scale(ensemble, &used);
    Ok(IdentifiedCompanion {
        constants: constants.to_vec(),
        runs: Vec::new(),
        checked: used.len(),
        error,
        of_changes: of_changes.sqrt(),
        admitted: error <= companion.keys.gate.get(),
        errors: Matrix::from_rows(answers.columns(), of_the_changes),
    })
}
