//! Normal linear regressions: `blr` on two data sets, `kidscore_momhsiq`, `kidscore_interaction`, `kilpisjarvi`,
//! `logmesquite_logvash`, `nes`.

use lacuna::math::distribution::Distribution::{self, HalfNormal, Normal};

use super::{File, Model, Posterior, Real, file, half_cauchy, normal_prior, positive};

/// `y` is normal around a linear form of the rows with standard deviation sigma, the last coordinate.
struct Regression {
    y: Vec<f64>,
    rows: Vec<Vec<f64>>,
    /// Mean and standard deviation of each coefficient's normal prior; empty for flat priors.
    coefficients: Vec<(f64, f64)>,
    sigma: Sigma,
}

/// Prior of the standard deviation, on positive numbers.
enum Sigma {
    Flat,
    Normal(f64),
    Cauchy(f64),
}

impl Model for Regression {
    fn log_density<R: Real>(&self, point: &[R]) -> R {
        let Some((&sigma, beta)) = point.split_last() else { return R::from(0.0) };
        let mut squares = R::from(0.0);
        for (y, row) in self.y.iter().zip(&self.rows) {
            let line =
                row.iter().zip(beta).fold(R::from(0.0), |sum, (x, b)| sum + *b * R::from(*x));
            let rest = R::from(*y) - line;
            squares = squares + rest * rest;
        }
        let count = R::from(self.y.len() as f64);
        let mut sum =
            positive(sigma) - count * sigma.ln() - squares / (sigma * sigma * R::from(2.0));
        for ((mean, sd), b) in self.coefficients.iter().zip(beta) {
            sum = sum + normal_prior(*b, *mean, *sd);
        }
        match self.sigma {
            Sigma::Flat => sum,
            Sigma::Normal(sd) => sum + normal_prior(sigma, 0.0, sd),
            Sigma::Cauchy(scale) => sum + half_cauchy(sigma, scale),
        }
    }
}

/// Rows with a leading one and the elements of the columns.
fn with_intercept(columns: &[&[f64]]) -> Vec<Vec<f64>> {
    let row = |i: usize| std::iter::once(1.0).chain(columns.iter().map(|c| c[i])).collect();
    (0..columns[0].len()).map(row).collect()
}

const BETA: [&str; 9] =
    ["beta_1", "beta_2", "beta_3", "beta_4", "beta_5", "beta_6", "beta_7", "beta_8", "beta_9"];

/// Distributions of starting points: coefficients around zero with these widths, and sigma.
fn starts(widths: &[f64], sigma: f64) -> Vec<(&'static str, Distribution)> {
    let coefficients = BETA.iter().zip(widths).map(|(name, width)| (*name, Normal([0.0, *width])));
    coefficients.chain([("sigma", HalfNormal(sigma))]).collect()
}

pub(super) fn posteriors() -> Vec<Posterior> {
    vec![
        blr(file!("sblrc-blr")),
        blr(file!("sblri-blr")),
        children(file!("kidiq-kidscore_momhsiq"), false),
        children(file!("kidiq-kidscore_interaction"), true),
        summers(file!("kilpisjarvi_mod-kilpisjarvi")),
        mesquite(file!("mesquite-logmesquite_logvash")),
        elections(file!("nes1980-nes")),
    ]
}

fn blr(file: File) -> Posterior {
    let model = Regression {
        y: file.vector("y"),
        rows: file.rows("X"),
        coefficients: vec![(0.0, 10.0); 5],
        sigma: Sigma::Normal(10.0),
    };
    file.posterior(model, starts(&[10.0; 5], 10.0))
}

fn children(file: File, interaction: bool) -> Posterior {
    let (hs, iq) = (file.vector("mom_hs"), file.vector("mom_iq"));
    let both: Vec<f64> = hs.iter().zip(&iq).map(|(hs, iq)| hs * iq).collect();
    let columns = [&hs[..], &iq, &both];
    let columns = if interaction { &columns[..] } else { &columns[..2] };
    let model = Regression {
        y: file.vector("kid_score"),
        rows: with_intercept(columns),
        coefficients: Vec::new(),
        sigma: Sigma::Cauchy(2.5),
    };
    let widths = [50.0, 50.0, 1.0, 1.0];
    file.posterior(model, starts(&widths[..=columns.len()], 20.0))
}

fn summers(file: File) -> Posterior {
    let of = |key: &str| file.number(key);
    let coefficients = vec![(of("pmualpha"), of("psalpha")), (of("pmubeta"), of("psbeta"))];
    let x = file.vector("x");
    let model = Regression {
        y: file.vector("y"),
        rows: with_intercept(&[&x]),
        coefficients: coefficients.clone(),
        sigma: Sigma::Flat,
    };
    let start = |name, (mean, sd): (f64, f64)| (name, Normal([mean, sd]));
    let starts = vec![
        start("alpha", coefficients[0]),
        start("beta", coefficients[1]),
        ("sigma", HalfNormal(3.0)),
    ];
    file.posterior(model, starts)
}

fn mesquite(file: File) -> Posterior {
    let of = |key: &str| file.vector(key);
    let (first, second, height) = (of("diam1"), of("diam2"), of("canopy_height"));
    let logs = |f: &dyn Fn(usize) -> f64| (0..first.len()).map(|i| f(i).ln()).collect::<Vec<f64>>();
    let (weight, total) = (of("weight"), of("total_height"));
    let columns = [
        logs(&|i| first[i] * second[i] * height[i]),
        logs(&|i| first[i] * second[i]),
        logs(&|i| first[i] / second[i]),
        logs(&|i| total[i]),
        of("group"),
    ];
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let model = Regression {
        y: logs(&|i| weight[i]),
        rows: with_intercept(&columns),
        coefficients: Vec::new(),
        sigma: Sigma::Flat,
    };
    file.posterior(model, starts(&[5.0, 1.0, 1.0, 1.0, 1.0, 1.0], 1.0))
}

fn elections(file: File) -> Posterior {
    let of = |key: &str| file.vector(key);
    let age = of("age_discrete");
    let is =
        |group: f64| age.iter().map(|a| f64::from(u8::from(*a == group))).collect::<Vec<f64>>();
    let columns = [
        of("real_ideo"),
        of("race_adj"),
        is(2.0),
        is(3.0),
        is(4.0),
        of("educ1"),
        of("gender"),
        of("income"),
    ];
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let model = Regression {
        y: of("partyid7"),
        rows: with_intercept(&columns),
        coefficients: Vec::new(),
        sigma: Sigma::Flat,
    };
    file.posterior(model, starts(&[2.0; 9], 3.0))
}
