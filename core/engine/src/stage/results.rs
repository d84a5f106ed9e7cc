//! The engine's own result files, written for models without a file format of their own.

use lacuna::data::{Ensemble, FailedRun, Unit};
use lacuna::plugin::reader::EnsembleSource;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_run::arrays::{self, Array};

use super::simulate::{TABLE, from_table};

/// Reads the runs of the simulate stage from the NetCDF files that [`lacuna_run::write_response`] wrote; at most
/// `allowed` may have failed.
pub fn ensemble(source: &EnsembleSource<'_>, allowed: usize) -> Result<Ensemble, Stop> {
    let ensemble = with_failed(source)?;
    let (runs, failed) = (&ensemble.runs, &ensemble.failed);
    let refused = |_: &&FailedRun| failed.len() > allowed || runs.is_empty();
    let Some(first) = failed.first().filter(refused) else { return Ok(ensemble) };
    let (count, all) = (failed.len(), failed.len() + runs.len());
    let message = format!("{count} of {all} runs failed, first `{}`: {}", first.run, first.reason);
    let folder = source.simulated.map(|folder| folder.display().to_string());
    Err(Stop::new(message)
        .saved(format!("the other runs in {}", folder.unwrap_or_default()))
        .help("`lacuna campaign status RUN` shows why each failed, `lacuna campaign retry RUN` repeats them; \
               `allow_failed` in `[design]` (in a study with `[simulations]` there) sets how many may fail"))
}

/// Like [`ensemble`], including failed runs, however many.
pub fn with_failed(source: &EnsembleSource<'_>) -> Result<Ensemble, Stop> {
    let folder = source.simulated.ok_or_else(|| {
        Stop::new("the study has no simulation runs").help("add `[simulations]` with their files")
    })?;
    let (records, parameters, simulated) = from_table(&folder.join(TABLE))?;
    let (mut runs, mut valid, mut failed) = (Vec::new(), Vec::new(), Vec::new());
    let mut points = Matrix::zeros(0, parameters.len());
    let mut responses = Matrix::zeros(0, source.layout.len());
    responses.reserve_rows(records.iter().filter(|record| record.file.is_some()).count());
    for (record, point) in records.iter().zip(simulated.iter_rows()) {
        match &record.file {
            Some(file) => {
                let stored = arrays::read(&folder.join(file), &source.layout.name)?;
                let response = in_unit(stored, &source.layout.unit, file)?;
                if response.len() != source.layout.len() {
                    let (n, m) = (response.len(), source.layout.len());
                    let message = format!("{file} holds {n} values, expected {m}");
                    return Err(Stop::new(message));
                }
                responses.push_row(&response);
                points.push_row(point);
                runs.push(record.run.clone());
                valid.push(record.valid);
            }
            None => failed.push(FailedRun {
                run: record.run.clone(),
                reason: record.reason.clone().unwrap_or_default(),
            }),
        }
    }
    Ok(Ensemble {
        parameters,
        units: source.parameters.iter().map(|p| p.unit.clone()).collect(),
        runs,
        points,
        layouts: source.layout.clone().into(),
        responses,
        valid,
        failed,
    })
}

/// Returns true if all results of the simulate stage are such files; the reader of a study is meant for the output of
/// the simulator itself.
pub fn are_own(source: &EnsembleSource<'_>) -> bool {
    let Some(folder) = source.simulated else { return false };
    let Ok((records, ..)) = from_table(&folder.join(TABLE)) else { return false };
    let mut files = records.iter().filter_map(|record| record.file.as_ref()).peekable();
    let is_own = |file: &String| {
        let path = folder.join(file);
        path.extension().is_some_and(|extension| extension == "nc")
            && arrays::read(&path, &source.layout.name)
                .is_ok_and(|array| array.values.len() == source.layout.len())
    };
    files.peek().is_some() && files.all(is_own)
}

/// Converts the values of a file from the model's unit to the study's.
fn in_unit(stored: Array<'_>, wanted: &Unit, file: &str) -> Result<Vec<f64>, Stop> {
    let Some(text) = &stored.unit else { return Ok(stored.into_values()) };
    let unit = Unit::parse(text).map_err(|error| Stop::new(format!("{file}: {error}")))?;
    let factor = unit.factor_to(wanted).ok_or_else(|| {
        Stop::new(format!("{file} holds values in `{unit}`, which do not convert to `{wanted}`"))
    })?;
    Ok(stored.values.iter().map(|value| value * factor).collect())
}
