//! Forward selection of effects, with groups of sensors, deletions, exchanges and pairs, as long as the tests reject
//! and the odds are for a further effect.

use std::sync::Arc;

use lacuna::math::moments::{log_sum, mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::effect::{On, Situation};

use super::checks::{consistency, shares, stability};
use super::diagnostics::{Diagnostics, SearchOptions, SearchResult, SearchStep, detectability};
use super::refit::{Scored, Weighed, most_promising, refit_all};
use super::state::{SearchSetting, SearchState, kinds};
use super::subsets::Screen;
use super::support::{misfit, supports};
use crate::gap::candidates::{Candidate, Placement, placements, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit_from};
use crate::gap::system::remainder::Remainder;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, Projection, Scan, Scores, TestSetting, differences, regions};

/// The smallest log posterior odds of a further effect: what the first one leaves may be an error of its own form, so
/// that a further effect needs odds of 20 to 1 (strong evidence by Kass and Raftery, Journal of the American
/// Statistical Association 90 (1995) 773).
pub(super) const FURTHER: f64 = 3.0;

/// The smallest share of the first gap that an effect has to close, if it does not close most of the misfit on its own
/// sensors.
const LEAST: f64 = 0.15;

/// That share of the misfit on its own sensors.
const MOST: f64 = 0.7;

/// The number of standard deviations of the sum of squares of noise from which the misfit of some sensors is significant.
const CLEAR: f64 = 4.0;

/// The data, candidates and options of a search, which do not change on its path.
pub(super) struct Search<'a> {
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    placements: Vec<Placement>,
    scan: Scan,
    means: Vec<f64>,
    sensors: Vec<On>,
    remainder: Remainder,
    options: SearchOptions,
    stream: Stream,
}

/// Searches for the effects that the forward map lacks, from starts of the parameters in their units; `None` if the
/// forward map has no response there.
pub fn search<'a>(
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    starts: &[Vec<f64>],
    options: SearchOptions,
    stream: &Stream,
) -> Option<SearchResult<'a>> {
    let means = experiment.means().1;
    let (mut state, remainder) = base(experiment, &means, starts)?;
    let search = Search {
        experiment,
        candidates,
        placements: placements(experiment, candidates),
        scan: Scan::new(experiment),
        means,
        sensors: sensors(experiment),
        remainder,
        options,
        stream: stream.named("search"),
    };
    let mut path: Vec<SearchStep> = Vec::new();
    let last = loop {
        let round = path.len() as u64;
        let (diagnostics, design, projection) = search.diagnose(&state, round);
        let first = path.first().map_or(&diagnostics, |step| &step.before).clone();
        let step = search.step(&mut state, &diagnostics, &design, &projection, round, &first);
        let Some(step) = step else {
            break diagnostics;
        };
        path.push(step);
    };
    let slots = search.slots(&state, &path);
    let stability = match slots.last() {
        Some(weighed) => {
            let smaller = state.without(&search.setting(), state.chosen.len() - 1);
            stability(experiment, &smaller.refit_setting(&search.setting()), weighed)
        }
        None => 1.0,
    };
    let first = path.first().map_or(last.tolerant.gap, |step| step.before.tolerant.gap);
    let stream = search.stream.named("support");
    let support = supports(&search.setting(), &state, &last.tolerant, first, &stream);
    let consistency = consistency(&state.system, &state.fit, &state.whitener);
    let types = slots.iter().map(|weighed| shares(candidates, weighed)).collect();
    let SearchState { system, chosen, noise, whitener, .. } = state;
    let (means, remainder) = (search.means, search.remainder);
    Some(SearchResult {
        path,
        system,
        chosen,
        last,
        types,
        slots,
        support,
        consistency,
        stability,
        noise,
        whitener,
        means,
        remainder,
    })
}

/// The calibration without effects: noise around a first fit, then around the fit with that noise; and the remainder
/// around it.
fn base<'a>(
    experiment: &'a Experiment<'a>,
    means: &[f64],
    starts: &[Vec<f64>],
) -> Option<(SearchState<'a>, Remainder)> {
    let system = System::new(experiment, Vec::new());
    let mut starts = starts.to_vec();
    let mut calibrated = None;
    for _ in 0..2 {
        let around = system.around(&system.linearised(starts.first()?));
        let noise = Noise::of(experiment, &around, None);
        let whitener = Whitener::new(experiment, &noise, &around.response);
        let fit = fit_from(&system, &whitener, means, &starts)?;
        starts = vec![fit.at.point.clone()];
        calibrated = Some((fit, noise, whitener));
    }
    let (fit, noise, whitener) = calibrated?;
    let remainder = Remainder::of(experiment, &noise, &system.around(&fit.at));
    let white = Arc::new(remainder.white(&whitener));
    Some((SearchState { system, chosen: Vec::new(), fit, noise, whitener, white }, remainder))
}

/// True when a fit removes as large a share of the squared misfit beyond noise as an effect has to close of the gap: a
/// free form does not see what is shorter than its lengths.
fn improves(first: &Diagnostics, now: &Fit, next: &Fit) -> bool {
    let removed = 2.0 * (next.log_density - now.log_density);
    let whole = first.excess().max(2.0 * (next.log_density - first.fit.log_density));
    removed >= LEAST * whole
}

impl<'a> Search<'a> {
    pub(super) fn setting<'b>(&'b self) -> SearchSetting<'a, 'b> {
        SearchSetting {
            experiment: self.experiment,
            candidates: self.candidates,
            means: &self.means,
            sensors: self.sensors.len(),
            remainder: &self.remainder,
        }
    }

    /// Calls `use_it` with the part of a state that candidates may see: response and noise.
    fn situated<T>(&self, state: &SearchState<'_>, use_it: impl FnOnce(&Situation<'_>) -> T) -> T {
        let response = &state.fit.at.response;
        let noise = state.noise.sd(self.experiment, response);
        use_it(&Situation { layouts: self.experiment.layouts, response, noise: &noise })
    }

    fn design(&self, state: &SearchState<'_>, projection: &Projection) -> DesignMatrix {
        let (whitener, placements) = (&state.whitener, &self.placements);
        self.situated(state, |situation| {
            let (system, fit, candidates) = (&state.system, &state.fit, self.candidates);
            DesignMatrix::of(system, fit, candidates, placements, situation, whitener, projection)
        })
    }

    fn most_promising(
        &self,
        state: &SearchState<'_>,
        design: &DesignMatrix,
        scores: &Scores,
        projection: &Projection,
    ) -> Vec<Scored> {
        let screen = Screen {
            experiment: self.experiment,
            candidates: self.candidates,
            placements: &self.placements,
            sensors: &self.sensors,
            whitener: &state.whitener,
            projection,
            residual: &projection.rest(&state.fit.residual),
        };
        let sets = screen.best(design);
        self.situated(state, |situation| {
            most_promising(&self.placements, self.candidates, design, scores, situation, sets)
        })
    }

    fn diagnose(
        &self,
        state: &SearchState<'_>,
        round: u64,
    ) -> (Diagnostics, DesignMatrix, Projection) {
        let projection = Projection::of(&state.system, &state.fit);
        let design = self.design(state, &projection);
        let setting = TestSetting {
            system: &state.system,
            fit: &state.fit,
            noise: &state.noise,
            whitener: &state.whitener,
            projection: &projection,
            design: &design,
            scan: &self.scan,
        };
        let statistics = setting.statistics();
        let stream = self.stream.named("null").at(round);
        let nulls = setting.nulls(&statistics, self.options.simulations, &stream);
        let p = [
            nulls.of_score(&statistics, &design),
            nulls.of_scan(&statistics),
            nulls.of_energy(&statistics),
        ];
        let level = self.options.naming + self.options.unlisted;
        let regions = regions(self.experiment, &self.scan, &statistics, &nulls, level);
        let expected_energy = mean(&nulls.energy);
        let energy_sd = variance(&nulls.energy).sqrt();
        let naming = self.options.naming;
        let visible = detectability(self.candidates, &self.placements, &design, &nulls, naming);
        let fit = state.fit.clone();
        let tolerant = state.tolerant(&self.setting(), &self.stream.named("remainder").at(round));
        let diagnostics = Diagnostics {
            fit,
            statistics,
            expected_energy,
            energy_sd,
            p,
            regions,
            visible,
            tolerant,
        };
        (diagnostics, design, projection)
    }

    /// The next step; `None` if the search ends.
    fn step(
        &self,
        state: &mut SearchState<'a>,
        diagnostics: &Diagnostics,
        design: &DesignMatrix,
        projection: &Projection,
        round: u64,
        first: &Diagnostics,
    ) -> Option<SearchStep> {
        let room = self.options.most.saturating_sub(state.chosen.len());
        let stream = self.stream.named("weigh").at(round);
        // A significant score leads to a single effect. Where only scan or energy reject, no single candidate shows in
        // its score: pairs alone are tried.
        let named = diagnostics.p[0] <= self.options.naming;
        let rest = diagnostics.p[1].min(diagnostics.p[2]) <= 0.5 * self.options.unlisted;
        if room == 0 || !(named || rest && room >= 2) {
            return None;
        }
        let scores = &diagnostics.statistics.scores;
        let weighed = self.weighed(state, design, scores, projection, &stream);
        // The weights of placements have neither the prior mass of their type nor that of the effects chosen before:
        // `nothing` is the weight of no further effect on that scale.
        let now = state.weight(&self.setting(), &stream);
        let nothing = now - state.prior(&self.setting()) + self.kinds();
        let log_odds = log_sum(weighed.iter().map(|j| j.log_weight)) - nothing;
        let gap = diagnostics.tolerant.gap;
        let least = LEAST * first.tolerant.gap;
        let shares = |j: &&Weighed| {
            gap - j.gap >= least || self.is_local(state, j) || improves(first, &state.fit, &j.fit)
        };
        let outweighs = |best: &&Weighed| {
            // The gate of the tests already bounds false alarms of the first effect, so that odds above one suffice.
            // Further effects may describe the misfit of the first one's form: each must be strong by itself.
            let alone = state.chosen.is_empty() && log_odds > 0.0;
            alone || !state.chosen.is_empty() && best.log_weight > nothing + FURTHER
        };
        let alone = weighed.iter().find(shares).filter(|best| named && outweighs(best));
        let added = match alone {
            Some(best) => vec![best.placement.clone()],
            None if room >= 2 => self.pair(state, &weighed, now, [gap, least], &stream)?,
            None => return None,
        };
        for placement in &added {
            *state = state.with(&self.setting(), placement, &self.unknowns(placement, &weighed));
        }
        self.exchange(state, &stream);
        let dropped = self.drop_needless(state, &stream);
        Some(SearchStep { before: diagnostics.clone(), weighed, log_odds, added, dropped })
    }

    /// True when a placement on some sensors closes most of the misfit there: what is small beside the whole gap may be
    /// all that one sensor shows.
    fn is_local(&self, state: &SearchState<'_>, weighed: &Weighed) -> bool {
        let placement = &weighed.placement;
        if placement.on.is_empty() {
            return false;
        }
        let acts = placement.placed(self.experiment, self.candidates, "").acts;
        let [before, after] = [&state.fit, &weighed.fit].map(|fit| misfit(fit, &acts));
        let values = acts.iter().filter(|acts| **acts).count() as f64;
        before > CLEAR * (2.0 * values).sqrt() && before - after >= MOST * before
    }

    /// The log of the number of types.
    fn kinds(&self) -> f64 {
        (kinds(self.candidates) as f64).ln()
    }

    /// The refitted placements with the groups grown from them, in decreasing order of weight.
    fn weighed(
        &self,
        state: &SearchState<'a>,
        design: &DesignMatrix,
        scores: &Scores,
        projection: &Projection,
        stream: &Stream,
    ) -> Vec<Weighed> {
        let mut scored = self.most_promising(state, design, scores, projection);
        // A second effect of the same type in the same place would not be identifiable.
        let is_there = |scored: &Scored| {
            let same = |chosen: &Placement| {
                chosen.candidate == scored.placement.candidate && chosen.on == scored.placement.on
            };
            state.chosen.iter().any(same)
        };
        scored.retain(|scored| !is_there(scored));
        let common = self.setting();
        let setting = state.refit_setting(&common);
        let mut weighed = refit_all(&setting, &state.fit, &scored, stream);
        weighed.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
        weighed
    }

    /// The fitted values of the unknowns of a placement, in their units; the absent values if it was not fitted.
    pub(super) fn unknowns(&self, placement: &Placement, weighed: &[Weighed]) -> Vec<f64> {
        let effect = &self.candidates[placement.candidate].effect;
        let absent = effect.absent(&self.experiment.layouts.blocks[0]);
        let same = |j: &&Weighed| {
            j.placement.candidate == placement.candidate && j.placement.on == placement.on
        };
        weighed.iter().find(same).map_or(absent.clone(), |j| {
            let point = &j.fit.at.point;
            point[point.len() - absent.len()..].to_vec()
        })
    }

    /// The placements that are weighed in place of one of the effects, in decreasing order of weight.
    pub(super) fn slot(
        &self,
        state: &SearchState<'a>,
        i: usize,
        stream: &Stream,
    ) -> (SearchState<'a>, Vec<Weighed>) {
        let smaller = state.without(&self.setting(), i);
        let projection = Projection::of(&smaller.system, &smaller.fit);
        let design = self.design(&smaller, &projection);
        let (rows, spread) = differences(self.experiment);
        let left = projection.rest(&smaller.fit.residual);
        let scores = design.scores_of(&left, &smaller.whitener.whiten_rows(&rows), &spread);
        let weighed = self.weighed(&smaller, &design, &scores, &projection, stream);
        (smaller, weighed)
    }

    /// The placements that are weighed in place of each effect at the end.
    fn slots(&self, state: &SearchState<'a>, path: &[SearchStep]) -> Vec<Vec<Weighed>> {
        if let ([step], 1) = (path, state.chosen.len())
            && step.added.len() == 1
        {
            return vec![step.weighed.clone()];
        }
        let stream = self.stream.named("types");
        let slot = |i: usize| self.slot(state, i, &stream.at(i as u64)).1;
        (0..state.chosen.len()).map(slot).collect()
    }
}
