//! Forward selection of effects, with groups of sensors, deletions, exchanges and pairs, as long as the tests reject
//! and the odds are for a further effect.

use lacuna::math::moments::{log_sum, mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::effect::{On, Situation};

use super::checks::{consistency, shares, stability};
use super::diagnostics::{Diagnostics, SearchOptions, SearchResult, SearchStep, detectability};
use super::refit::{Scored, Weighed, grow, most_promising, refit_all};
use super::state::{SearchSetting, SearchState, kinds};
use crate::gap::candidates::{Candidate, Placement, placements, sensors};
use crate::gap::experiment::Experiment;
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::fit_from;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::{DesignMatrix, Projection, Scan, Scores, TestSetting, differences, regions};

/// Placements whose log weight is lower than the largest by more than this are no seeds of groups.
const SEED: f64 = 20.0;

/// The smallest log posterior odds of a further effect: what the first one leaves may be an error of its own form, so
/// that a further effect needs odds of 20 to 1 (strong evidence by Kass and Raftery, Journal of the American
/// Statistical Association 90 (1995) 773).
const FURTHER: f64 = 3.0;

/// The number of placements of each step that are tried in pairs.
const PAIRED: usize = 10;

/// The largest number of rounds of exchanges.
const EXCHANGES: usize = 10;

/// The data, candidates and options of a search, which do not change on its path.
struct Search<'a> {
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    placements: Vec<Placement>,
    scan: Scan,
    means: Vec<f64>,
    sensors: usize,
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
    let search = Search {
        experiment,
        candidates,
        placements: placements(experiment, candidates),
        scan: Scan::new(experiment),
        means: experiment.means().1,
        sensors: sensors(experiment).len(),
        options,
        stream: stream.named("search"),
    };
    let mut state = search.base(starts)?;
    let mut path: Vec<SearchStep> = Vec::new();
    let last = loop {
        let round = path.len() as u64;
        let (diagnostics, design) = search.diagnose(&state, round);
        let Some(step) = search.step(&mut state, &diagnostics, &design, round) else {
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
    let consistency = consistency(&state.system, &state.fit, &state.whitener);
    let types = slots.iter().map(|weighed| shares(candidates, weighed)).collect();
    let SearchState { system, chosen, noise, whitener, .. } = state;
    let means = search.means;
    Some(SearchResult {
        path,
        system,
        chosen,
        last,
        types,
        consistency,
        stability,
        noise,
        whitener,
        means,
    })
}

impl<'a> Search<'a> {
    fn setting<'b>(&'b self) -> SearchSetting<'a, 'b> {
        SearchSetting {
            experiment: self.experiment,
            candidates: self.candidates,
            means: &self.means,
            sensors: self.sensors,
        }
    }

    /// The calibration without effects: noise around a first fit, then around the fit with that noise.
    fn base(&self, starts: &[Vec<f64>]) -> Option<SearchState<'a>> {
        let system = System::new(self.experiment, Vec::new());
        let mut starts = starts.to_vec();
        let mut state: Option<SearchState<'a>> = None;
        for _ in 0..2 {
            let around = system.around(&system.linearised(starts.first()?));
            let noise = Noise::of(self.experiment, &around, None);
            let whitener = Whitener::new(self.experiment, &noise, &around.response);
            let fit = fit_from(&system, &whitener, &self.means, &starts)?;
            starts = vec![fit.at.point.clone()];
            let system = system.clone();
            state = Some(SearchState { system, chosen: Vec::new(), fit, noise, whitener });
        }
        state
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
    ) -> Vec<Scored> {
        self.situated(state, |situation| {
            most_promising(&self.placements, self.candidates, design, scores, situation)
        })
    }

    fn diagnose(&self, state: &SearchState<'_>, round: u64) -> (Diagnostics, DesignMatrix) {
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
        let diagnostics =
            Diagnostics { fit, statistics, expected_energy, energy_sd, p, regions, visible };
        (diagnostics, design)
    }

    /// The next step; `None` if the search ends.
    fn step(
        &self,
        state: &mut SearchState<'a>,
        diagnostics: &Diagnostics,
        design: &DesignMatrix,
        round: u64,
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
        let weighed = self.weighed(state, design, &diagnostics.statistics.scores, &stream);
        // The weights of placements have neither the prior mass of their type nor that of the effects chosen before:
        // `nothing` is the weight of no further effect on that scale.
        let now = state.weight(&self.setting(), &stream);
        let nothing = now - state.prior(&self.setting()) + self.kinds();
        let log_odds = log_sum(weighed.iter().map(|j| j.log_weight)) - nothing;
        let outweighs = |best: &&Weighed| {
            // The gate of the tests already bounds false alarms of the first effect, so that odds above one suffice.
            // Further effects may describe the misfit of the first one's form: each must be strong by itself.
            let alone = state.chosen.is_empty() && log_odds > 0.0;
            alone || !state.chosen.is_empty() && best.log_weight > nothing + FURTHER
        };
        let alone = weighed.first().filter(|best| named && outweighs(best));
        let added = match alone {
            Some(best) => vec![best.placement.clone()],
            None if room >= 2 => self.pair(state, &weighed, now, &stream)?,
            None => return None,
        };
        for placement in &added {
            *state = state.with(&self.setting(), placement, &self.unknowns(placement, &weighed));
        }
        self.exchange(state, &stream);
        let dropped = self.drop_needless(state, &stream);
        Some(SearchStep { before: diagnostics.clone(), weighed, log_odds, added, dropped })
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
        stream: &Stream,
    ) -> Vec<Weighed> {
        let mut scored = self.most_promising(state, design, scores);
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
        let best = weighed.first().map_or(0.0, |j| j.log_weight);
        let mut seen: Vec<usize> = Vec::new();
        let mut grown: Vec<Weighed> = Vec::new();
        for (i, seed) in weighed.iter().enumerate() {
            let candidate = seed.placement.candidate;
            if seen.contains(&candidate)
                || seed.placement.on.is_empty()
                || seed.log_weight < best - SEED
            {
                continue;
            }
            seen.push(candidate);
            let same = scored.iter().filter(|scored| scored.placement.candidate == candidate);
            let others: Vec<On> = same.map(|scored| scored.placement.on.clone()).collect();
            let stream = stream.named("groups").at(i as u64);
            let group = grow(&setting, &state.fit, seed, &others, &stream);
            if group.placement.on != seed.placement.on {
                grown.push(group);
            }
        }
        weighed.extend(grown);
        weighed.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
        weighed
    }

    /// The fitted values of the unknowns of a placement, in their units; the absent values if it was not fitted.
    fn unknowns(&self, placement: &Placement, weighed: &[Weighed]) -> Vec<f64> {
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
    fn slot(
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
        let weighed = self.weighed(&smaller, &design, &scores, stream);
        (smaller, weighed)
    }

    /// Exchanges effects for placements of larger weight.
    fn exchange(&self, state: &mut SearchState<'a>, stream: &Stream) {
        if state.chosen.len() < 2 {
            return;
        }
        for round in 0..EXCHANGES {
            let mut exchanged = false;
            for i in 0..state.chosen.len() {
                let stream = stream.named("exchange").at(round as u64).at(i as u64);
                let (smaller, weighed) = self.slot(state, i, &stream);
                let Some(best) = weighed.first() else { continue };
                let chosen = &state.chosen[i];
                let same =
                    best.placement.candidate == chosen.candidate && best.placement.on == chosen.on;
                if same {
                    continue;
                }
                let own = self.unknowns(&best.placement, &weighed);
                let next = smaller.with(&self.setting(), &best.placement, &own);
                // The margin is above the error of the evidences: without it two states could alternate.
                if next.weight(&self.setting(), &stream)
                    > state.weight(&self.setting(), &stream) + 1.0
                {
                    *state = next;
                    exchanged = true;
                    break;
                }
            }
            if !exchanged {
                break;
            }
        }
    }

    /// Drops effects without which the weight is larger, and returns their names. The last one added stays.
    fn drop_needless(&self, state: &mut SearchState<'a>, stream: &Stream) -> Vec<String> {
        let common = self.setting();
        // The last effect was just found necessary beside the others; the others were not tested beside it.
        let mut dropped = Vec::new();
        while state.chosen.len() > 1 {
            let whole = state.weight(&common, stream);
            let needless = (0..state.chosen.len() - 1).find_map(|i| {
                let smaller = state.without(&common, i);
                (smaller.weight(&common, stream) >= whole).then_some((i, smaller))
            });
            let Some((i, smaller)) = needless else { break };
            dropped.push(state.system.effects[i].name.clone());
            *state = smaller;
        }
        dropped
    }

    /// The pair of placements of largest weight; `None` if the weight is not larger than that of the present system.
    fn pair(
        &self,
        state: &SearchState<'a>,
        weighed: &[Weighed],
        now: f64,
        stream: &Stream,
    ) -> Option<Vec<Placement>> {
        let common = self.setting();
        let promising: Vec<&Weighed> = weighed.iter().take(PAIRED).collect();
        let mut best: Option<(f64, Vec<Placement>)> = None;
        for (i, first) in promising.iter().enumerate() {
            let one =
                state.with(&common, &first.placement, &self.unknowns(&first.placement, weighed));
            for second in &promising[i + 1..] {
                let own = self.unknowns(&second.placement, weighed);
                let both = one.with(&common, &second.placement, &own);
                let weight = both.weight(&common, stream);
                if weight > now + FURTHER && best.as_ref().is_none_or(|(most, _)| weight > *most) {
                    best = Some((weight, vec![first.placement.clone(), second.placement.clone()]));
                }
            }
        }
        best.map(|(_, pair)| pair)
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
