//! Command `coverage`: how often the intervals of a study contain the truth.

use std::path::Path;

use lacuna::diagnose::coverage::Noise;
use lacuna_engine::coverage::{self, Asked, COUNT, QUICK};
use lacuna_engine::report::coverage_text;
use lacuna_run::{RunDirectory, Stage};

use crate::interrupt::{self, Next};
use crate::study::{Settings, folder, load};
use crate::{print, progress, show};

/// Options of the count.
#[derive(clap::Args)]
pub struct Manner {
    /// Quick look: 40 truths, and chains of half length for samplers whose steps are draws
    #[arg(long)]
    quick: bool,
    /// Number of truths (default: 200)
    #[arg(long, value_name = "N")]
    count: Option<std::num::NonZeroUsize>,
    /// Noise of the generated data
    /// (default: that of the replicates if every measured value has ten, otherwise that of the posterior)
    #[arg(long, value_name = "WHOSE", value_enum)]
    noise: Option<Whose>,
    /// Use simulation runs held out from the emulator as truths, even if the model can be run
    #[arg(long)]
    from_runs: bool,
}

/// Source of the noise in the generated data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Whose {
    /// Residuals of the study's replicates about their mean: whole replicates, each with a random sign
    Replicates,
    /// The discrepancy at draws from the study's own posterior
    Posterior,
    /// The discrepancy with unknowns drawn from their priors
    Prior,
}

/// Runs `lacuna coverage STUDY`.
pub fn coverage(
    path: &Path,
    settings: &Settings,
    out: Option<&Path>,
    manner: &Manner,
) -> anyhow::Result<()> {
    let study = load(path, settings)?;
    let root = folder(&study, out);
    let mut run = RunDirectory::open(&root)?;
    interrupt::explain(&root, Next::Again);
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
    let found = coverage::coverage(&study, &asked, &mut run, &*progress::observer())?;
    print("");
    show(coverage_text(&found).trim_end());
    print("");
    print(&format!(
        "page: {}",
        root.join(Stage::Coverage.folder().name()).join("coverage.html").display()
    ));
    Ok(())
}
