//! The fixed part of a search for a law, and the force of each rate.

use lacuna::data::Unit;
use lacuna::math::random::Stream;
use lacuna::plugin::Context;
use lacuna::plugin::amend::Amend;
use lacuna_linalg::vector::dot;

use super::force::{ForceSetting, Inferred, cosines, piece};
use super::model::Widened;
use super::sites::Site;
use crate::gap::experiment::Experiment;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::{Piece, Pieces, free};
use crate::gap::noise::Noise;
use crate::gap::system::fit::Fit;
use crate::study::Study;

/// The smallest log Bayes factor of a force, and of a further term after the price of its choice: 20 to 1 (Kass and Raftery,
/// Journal of the American Statistical Association 90 (1995) 773).
pub(super) const WORTH: f64 = 3.0;

/// The study and the data in which a law is sought.
pub struct LawSetting<'a, 'b> {
    /// The study, whose model has equations and is its own forward map.
    pub study: &'a Study,
    /// The data.
    pub experiment: &'b Experiment<'a>,
    /// The noise of these data.
    pub noise: &'b Noise,
    /// Starts of the study's parameters.
    pub starts: &'b [Vec<f64>],
    /// The random stream.
    pub stream: &'b Stream,
}

/// The fixed part of a search for a law.
pub(super) struct Finder<'a, 'b, 's> {
    pub(super) setting: &'s LawSetting<'a, 'b>,
    pub(super) amend: &'s dyn Amend,
    pub(super) context: Context<'s>,
    pub(super) sites: Vec<Site>,
    pub(super) means: Vec<f64>,
    pub(super) values: usize,
    pub(super) taken: Vec<String>,
    pub(super) time: (String, f64, f64, Unit),
}

/// A run along which forms are compared: pieces of the model, with the study's parameters and the inputs under each
/// condition.
pub(super) struct Run {
    pub(super) pieces: Vec<(Piece, Vec<FreeInput>)>,
    pub(super) parameters: Vec<f64>,
    pub(super) inputs: Vec<Vec<f64>>,
}

impl<'a> Finder<'a, '_, '_> {
    /// The rate that lacks a force and the force that it lacks: the one of largest evidence.
    pub(super) fn force(&self, base: &Fit, noise: &Noise) -> Option<(usize, Inferred)> {
        let each = (0..self.sites.len()).filter_map(|s| Some((s, self.force_of(s, base, noise)?)));
        let best = each.fold(None, |best: Option<(usize, Inferred)>, next| match best {
            Some(best) if best.1.log_evidence >= next.1.log_evidence => Some(best),
            _ => Some(next),
        });
        best.filter(|(_, found)| found.log_evidence > WORTH)
    }

    fn force_of(&self, site: usize, base: &Fit, noise: &Noise) -> Option<Inferred> {
        self.with_force(site, |setting| {
            let start = &base.at.point;
            let size = self.size(setting.model, &self.sites[site].state.rate, start)?;
            ForceSetting { size, ..*setting }.infer(start, noise)
        })?
    }

    /// The result of `use_it` with the model that has a force in a rate.
    pub(super) fn with_force<T>(
        &self,
        site: usize,
        use_it: impl FnOnce(&ForceSetting<'a, '_>) -> T,
    ) -> Option<T> {
        let LawSetting { study, experiment, .. } = *self.setting;
        let pieces = Pieces::alone(study, vec![self.force_piece(site)]).ok()??;
        let model = Widened::new(study, &pieces)?;
        let cosines = cosines(experiment);
        Some(use_it(&ForceSetting { experiment, model: &model, cosines, size: 1.0 }))
    }

    pub(super) fn force_piece(&self, site: usize) -> (Piece, Vec<FreeInput>) {
        let (time, from, to, unit) = &self.time;
        let prefix = free("latent_force_".to_owned(), &self.taken);
        let cosines = cosines(self.setting.experiment);
        piece(&self.sites[site], cosines, &prefix, (time, *from, *to, unit))
    }

    /// The root mean square of an expression without any force; `None` if it is zero.
    fn size(&self, model: &Widened<'_>, expression: &str, point: &[f64]) -> Option<f64> {
        let none = vec![vec![0.0; cosines(self.setting.experiment)]; model.conditions()];
        let (mut sum, mut count) = (0.0, 0.0);
        for c in 0..model.conditions() {
            let values = model.along(c, point, &none, &[expression.to_owned()])?.remove(0);
            sum += dot(&values, &values);
            count += values.len() as f64;
        }
        let size = (sum / f64::max(count, 1.0)).sqrt();
        (size.is_finite() && size > 0.0).then_some(size)
    }
}
