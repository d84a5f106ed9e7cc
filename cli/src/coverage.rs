//! `coverage`: how often the intervals of a study hold the truth.

use std::path::Path;

use lacuna::diagnose::coverage::Noise;
use lacuna::report::coverage_text;
use lacuna::run::RunDirectory;
use lacuna::stage::coverage::{self, Asked, COUNT, FOLDER, QUICK};

use crate::progress::Terminal;
use crate::study::{Settings, folder, load};
use crate::{Failure, print};

/// What is counted.
#[derive(clap::Args)]
pub struct Manner {
    /// A first look: 40 truths, and chains of half their length where a sampler's steps are draws.
    #[arg(long)]
    quick: bool,
    /// The number of truths; 200 when left out.
    #[arg(long, value_name = "N")]
    count: Option<std::num::NonZeroUsize>,
    /// The noise of the data that are made. Left out: that of the replicates where every measured value has ten, else
    /// that of the posterior.
    #[arg(long, value_name = "WHOSE", value_enum)]
    noise: Option<Whose>,
    /// Take simulation runs as truths, held back from the emulator, although the model could be run.
    #[arg(long)]
    from_runs: bool,
}

/// Whose noise the data have that are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Whose {
    /// Residuals of the study's replicates about their mean: whole replicates, each with a random sign.
    Replicates,
    /// The discrepancy at draws of the study's own posterior.
    Posterior,
    /// The discrepancy with unknowns drawn from their priors.
    Prior,
}

/// `lacuna coverage STUDY`
pub fn coverage(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    manner: &Manner,
) -> Result<(), Failure> {
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    let usual = if manner.quick { QUICK } else { COUNT };
    let asked = Asked {
        count: manner.count.map_or(usual, std::num::NonZeroUsize::get),
        quick: manner.quick,
        noise: manner.noise.map(|whose| match whose {
            Whose::Replicates => Noise::Replicates,
            Whose::Posterior => Noise::Posterior,
            Whose::Prior => Noise::Prior,
        }),
        from_runs: manner.from_runs,
    };
    let found = coverage::coverage(&study, &asked, &mut run, &Terminal::new())?;
    print("");
    print(coverage_text(&found).trim_end());
    print("");
    print(&format!("page: {}", root.join(FOLDER).join("coverage.html").display()));
    Ok(())
}
