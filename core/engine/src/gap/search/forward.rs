//! Forward selection of effects, with groups of sensors, deletions, exchanges and pairs, as long as the tests reject
//! and the odds are for a further effect.

use std::sync::Arc;

use lacuna::math::moments::{log_sum, mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::effect::{On, Situation};

use super::diagnostics::{Diagnostics, SearchOptions, SearchResult, SearchStep, detectability};
use super::explained::misfit;
use super::pairs::Pair;
use super::refit::{Scored, Weighed, most_promising, refit_all};
use super::state::{SearchSetting, SearchState, kinds};
use super::subsets::Screen;
use super::visited::VisitedModel;
use crate::gap::candidates::{Candidate, Placement, place, placements, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit_from};
use crate::gap::system::remainder::Remainder;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, Projection, Scan, Scores, TestSetting, regions};

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

/// The mean square of a misfit on all sensors, in units of the noise, that is far above it: three standard deviations.
const LARGE: f64 = 9.0;

/// The data, candidates and options of a search, which do not change on its path.
pub(super) struct Search<'a> {
    pub(super) experiment: &'a Experiment<'a>,
    pub(super) candidates: &'a [Candidate],
    pub(super) placements: Vec<Placement>,
    scan: Scan,
    pub(super) means: Vec<f64>,
    pub(super) sensors: Vec<On>,
    pub(super) remainder: Remainder,
    pub(super) options: SearchOptions,
    pub(super) stream: Stream,
}

/// About the share of a search that is done after its first tests, after its first step, and before its result: between
/// those of six records of [known effects](../../../../../examples/known_records), which differ by a factor of two.
const FIRST_TESTS: f64 = 0.15;
const FIRST_STEP: f64 = 0.45;
const RESULT: f64 = 0.95;
/// The share of the rest that a further step takes.
const FURTHER_STEP: f64 = 0.25;

/// Searches for the effects that the forward map lacks, from starts of the parameters in their units; `None` if the
/// forward map has no response there.
pub fn search<'a>(
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    starts: &[Vec<f64>],
    options: SearchOptions,
    stream: &Stream,
) -> Option<SearchResult<'a>> {
    search_observed(experiment, candidates, starts, options, stream, &|_| {})
}

/// Like [`search`]; `done` is told about what share of it is done, now and then.
pub fn search_observed<'a>(
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    starts: &[Vec<f64>],
    options: SearchOptions,
    stream: &Stream,
    done: &dyn Fn(f64),
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
    let mut last = loop {
        let round = path.len() as u64;
        let (diagnostics, design, projection) = search.diagnose(&state, round);
        if round == 0 {
            done(FIRST_TESTS);
        }
        let first = path.first().map_or(&diagnostics, |step| &step.before).clone();
        let step = search.step(&mut state, &diagnostics, &design, &projection, round, &first);
        let Some(step) = step else {
            break diagnostics;
        };
        path.push(step);
        done(1.0 - (1.0 - FIRST_STEP) * (1.0 - FURTHER_STEP).powi(round as i32));
    };
    if search.simplify(&mut state, &path, &search.stream.named("simpler")) {
        last = search.diagnose(&state, path.len() as u64).0;
    }
    done(RESULT);
    let whole = search.finished(&state, path, last);
    Some(search.certain_part(whole, &state))
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
    let chosen = Vec::new();
    Some((SearchState { system, chosen, fit, noise, whitener, white, slots: None }, remainder))
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

    pub(super) fn design(&self, state: &SearchState<'_>, projection: &Projection) -> DesignMatrix {
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

    pub(super) fn diagnose(
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
        let least = self.options.naming.min(0.5 * self.options.unlisted);
        let nulls = setting.nulls(&statistics, self.options.simulations, least, &stream);
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
        // Both have the noise of this state, so that its determinant is in neither.
        let now = state.weight(&self.setting(), &stream);
        let nothing = state.tolerant(&self.setting(), &stream).value + self.kinds();
        let log_odds = log_sum(weighed.iter().map(|j| j.log_weight)) - nothing;
        let mut visited =
            VisitedModel::around(self.candidates, &state.chosen, &weighed, [now, nothing]);
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
            Some(best) => vec![(best.placement.clone(), self.unknowns(&best.placement, &weighed))],
            None if room >= 2 => {
                let pairs = self.pairs(state, &weighed, design, projection, &stream);
                visited.extend(pairs.iter().map(|pair| pair.visited(self, state, now - nothing)));
                let is_strong = |pair: &Pair| pair.log_weight > nothing + FURTHER;
                let best =
                    pairs.into_iter().find(|pair| gap - pair.gap >= least && is_strong(pair));
                Vec::from(best?.parts)
            }
            None => return None,
        };
        for (placement, own) in &added {
            *state = state.with(&self.setting(), placement, own);
        }
        self.exchange(state, &stream);
        self.merge(state, &stream);
        let dropped = self.drop_needless(state, &stream);
        let added = added.into_iter().map(|(placement, _)| placement).collect();
        let before = diagnostics.clone();
        Some(SearchStep { before, weighed, log_odds, added, dropped, visited })
    }

    /// True when a placement on some sensors closes most of the misfit there: what is small beside the whole gap may be
    /// all that one sensor shows. On all sensors the misfit has to be far above the noise: beside an effect that
    /// dominates the gap, that is more than an error of its form.
    fn is_local(&self, state: &SearchState<'_>, weighed: &Weighed) -> bool {
        let placement = &weighed.placement;
        let acts = placement.placed(self.experiment, self.candidates, "").acts;
        let [before, after] = [&state.fit, &weighed.fit].map(|fit| misfit(fit, &acts));
        let values = acts.iter().filter(|acts| **acts).count() as f64;
        let everywhere = placement.on.is_empty();
        let least = if everywhere { LARGE * values } else { CLEAR * (2.0 * values).sqrt() };
        before > least && before - after >= MOST * before
    }

    /// The outputs of a sensor.
    pub(super) fn outputs_of(&self, sensor: &On) -> impl Iterator<Item = usize> {
        let curves = self.experiment.curves.iter().filter(move |curve| place(curve) == *sensor);
        curves.flat_map(|curve| curve.measured.iter().copied())
    }

    /// The log of the number of types.
    pub(super) fn kinds(&self) -> f64 {
        (kinds(self.candidates) as f64).ln()
    }

    /// The refitted placements with the groups grown from them, in decreasing order of weight.
    pub(super) fn weighed(
        &self,
        state: &SearchState<'a>,
        design: &DesignMatrix,
        scores: &Scores,
        projection: &Projection,
        stream: &Stream,
    ) -> Vec<Weighed> {
        let mut scored = self.most_promising(state, design, scores, projection);
        // A second effect of the same type in the same place would not be identifiable.
        let is_there = |one: &Placement| state.chosen.iter().any(|chosen| chosen.is(one));
        scored.retain(|scored| !is_there(&scored.placement));
        let common = self.setting();
        let setting = state.refit_setting(&common);
        let mut weighed = refit_all(&setting, &state.fit, &scored, stream);
        self.move_places(state, &mut weighed, stream);
        weighed.retain(|weighed| !is_there(&weighed.placement));
        weighed
    }
}
