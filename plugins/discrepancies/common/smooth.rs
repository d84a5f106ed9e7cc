//! Options of a smooth bias, its unknowns and its series, for the discrepancies that have one.

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::Context;
use lacuna::plugin::discrepancy::{Hyperparameter, Known, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;

use super::{By, Groups, Noise, PerGroup, Quantity, Replicates, Series, Unknown, Variance, start};

/// Options of a smooth bias and of the noise about it, under the names that they have in a study.
#[derive(Clone, Copy)]
pub struct Smooth<'a> {
    /// Standard deviation of the bias.
    pub bias: &'a Quantity,
    /// Correlation length.
    pub correlation_length: &'a Quantity,
    /// Groups of series with a common bias.
    pub bias_by: &'a By,
    /// Axis along which the bias is smooth.
    pub along: Option<&'a str>,
    /// Variance of the noise.
    pub variance: &'a Variance,
    /// Groups of outputs with a common variance.
    pub by: &'a By,
}

/// The unknowns of a smooth bias for some data.
pub struct SmoothBias {
    /// Statistics of the data.
    pub replicates: Replicates,
    /// Series along the axis.
    pub series: Series,
    /// Groups of series.
    pub groups: Groups,
    /// Standard deviation in each group.
    pub sd: PerGroup,
    /// Correlation length in each group.
    pub length: PerGroup,
    /// Unknowns so far: those of the standard deviation and of the length.
    pub hyper: Vec<Hyperparameter>,
}

impl Smooth<'_> {
    /// Reports options that do not fit the layout. Returns the series of the bias and the number of its groups, if they are
    /// known.
    pub fn check(
        &self,
        context: &Context<'_>,
        complaints: &mut Complaints<'_>,
    ) -> Option<(Series, usize)> {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.variance.check(Groups::of(layout, self.by).ok().as_ref(), complaints);
        self.bias_by.check("bias_by", layout, complaints);
        let groups = Groups::of(layout, self.bias_by).map_or(1, |groups| groups.count());
        self.bias.check_positive("bias", groups, complaints);
        self.correlation_length.check_positive("correlation_length", groups, complaints);
        match Series::of(layout, self.along) {
            Err(text) => {
                complaints.at("along").say(text);
                None
            }
            Ok(series) => {
                if self.bias_by.divides(&series.axis) {
                    complaints
                        .at("bias_by")
                        .say("a bias applies to a whole series")
                        .expected(format!("another axis than `{}`", series.axis));
                }
                Some((series, groups))
            }
        }
    }

    /// The unknowns for these data. The search for the length starts at `share` of the axis.
    ///
    /// # Errors
    /// If the options do not fit the data.
    pub fn unknowns(&self, known: &Known<'_>, share: f64) -> Result<SmoothBias, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let series = Series::of(layout, self.along).map_err(Stop::new)?;
        let groups = Groups::of(layout, self.bias_by).map_err(Stop::new)?;
        let groups = groups.with_data(&replicates.measured);
        let mut hyper = Vec::new();
        let unit = vec![1.0; layout.len()];
        let name = Unknown { name: "bias", unit: layout.unit.difference() };
        let size = |g: usize| start(&groups, &replicates, &unit, g).sqrt();
        let sd = PerGroup::new(self.bias, &groups, &name, size, &mut hyper);
        let name = Unknown { name: "correlation_length", unit: series.unit.clone() };
        let reach = series.grid.last().zip(series.grid.first()).map_or(0.0, |(b, a)| b - a);
        let begin = |_| if reach > 0.0 { share * reach } else { 1.0 };
        let length = PerGroup::new(self.correlation_length, &groups, &name, begin, &mut hyper);
        Ok(SmoothBias { replicates, series, groups, sd, length, hyper })
    }

    /// The noise, with measured variances taken from the replicates of `shown`; adds its unknowns.
    ///
    /// # Errors
    /// If the options do not fit the data.
    pub fn noise(
        &self,
        known: &Known<'_>,
        shown: &Measurements,
        bias: &mut SmoothBias,
    ) -> Result<Noise, Stop> {
        Noise::new(known, shown, &bias.replicates, (self.variance, self.by), &mut bias.hyper)
    }

    /// Noise of the instruments, if the options state it.
    pub fn stated_noise(&self, layout: &Layout) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, self.by)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

/// Returns true if an output is measured in all data and not in this part of them.
pub fn loses_an_output(part: &Measurements, whole: &Measurements) -> bool {
    let all = whole.summaries();
    part.summaries().iter().zip(&all).any(|(a, b)| a.count == 0 && b.count > 0)
}

/// One series of outputs with its bias.
#[derive(Debug, Clone)]
pub struct Block {
    /// Indices of its outputs among the measured ones.
    pub rows: Vec<usize>,
    /// Values of the axis at these outputs.
    pub grid: Vec<f64>,
    /// Flat indices of all its outputs.
    pub outputs: Vec<usize>,
    /// Group of its standard deviation and correlation length; `None` if the group was never measured.
    pub group: Option<usize>,
    /// Index of an earlier series with the same grid and group, whose prior is reused.
    pub twin: Option<usize>,
}

impl Block {
    /// The blocks of all series. `place` is the index of each output among the measured ones.
    pub fn all(series: &Series, place: &[usize], groups: &Groups) -> Vec<Self> {
        let mut blocks: Vec<Self> = Vec::new();
        for outputs in &series.outputs {
            let kept: Vec<usize> =
                (0..outputs.len()).filter(|&j| place[outputs[j]] != usize::MAX).collect();
            let rows: Vec<usize> = kept.iter().map(|&j| place[outputs[j]]).collect();
            let grid: Vec<f64> = kept.iter().map(|&j| series.grid[j]).collect();
            let group = outputs.first().and_then(|&i| groups.of[i]);
            let twin = blocks.iter().position(|b: &Self| b.group == group && b.grid == grid);
            blocks.push(Self { rows, grid, outputs: outputs.clone(), group, twin });
        }
        blocks
    }

    /// The value of the series among those of the groups; the mean of all groups for a series never measured.
    pub fn value(&self, values: &[f64]) -> f64 {
        let mean = || values.iter().sum::<f64>() / values.len() as f64;
        self.group.map_or_else(mean, |group| values[group])
    }

    /// Standard deviation and correlation length of the series, among those of the groups.
    pub fn of(&self, (sd, length): (&[f64], &[f64])) -> (f64, f64) {
        (self.value(sd), self.value(length))
    }
}
