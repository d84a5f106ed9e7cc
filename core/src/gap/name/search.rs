//! The search: forward with a gate, with groups, deletions and pairs, until nothing is left or nothing helps.

use super::groups::grow;
use super::leaders::{Desk, Judged, judge, leads};
use crate::gap::candidates::{Candidate, Suspect, suspects};
use crate::gap::experiment::Experiment;
use crate::gap::fit::{Fit, fit, fit_from};
use crate::gap::locate::{Bench, Directions, Nulls, Projection, Region, Scan, Statistics, regions};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::math::random::Stream;
use crate::plugin::effect::{On, Situation};

/// How a search judges.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The probability of naming an effect where there is none.
    pub naming: f64,
    /// The probability of finding a gap without a name where there is none.
    pub unlisted: f64,
    /// Simulations of the nulls.
    pub simulations: usize,
    /// The most effects.
    pub most: usize,
}

/// A calibrated system as the tests see it.
#[derive(Clone)]
pub struct Look {
    /// The unknowns and the response.
    pub fit: Fit,
    /// The statistics.
    pub statistics: Statistics,
    /// The energy of the residual that noise and common errors alone have.
    pub expected_energy: f64,
    /// The probabilities of the largest score, of the best cell and of the energy when nothing is missing.
    pub p: [f64; 3],
    /// Where data and model disagree.
    pub regions: Vec<Region>,
    /// What can be seen of each suspect: the share that is absorbed, and the size found in 80 % of cases.
    pub visible: Vec<Visible>,
}

/// What an experiment can see of a suspect.
#[derive(Debug, Clone, PartialEq)]
pub struct Visible {
    /// The name of its plugin.
    pub kind: String,
    /// Where it acts.
    pub on: On,
    /// The share of it that the calibrated unknowns absorb, for the direction that shows best.
    pub absorbed: f64,
    /// The smallest change of its size that would be found in 80 % of cases, by linearisation.
    pub smallest: f64,
}

/// One step of the path.
#[derive(Clone)]
pub struct Step {
    /// The system before it.
    pub before: Look,
    /// What was weighed, the heaviest first.
    pub judged: Vec<Judged>,
    /// What was added.
    pub added: Vec<Suspect>,
    /// The names of effects that were dropped after it.
    pub dropped: Vec<String>,
}

/// What a search found.
#[derive(Clone)]
pub struct Found<'a> {
    /// The steps.
    pub path: Vec<Step>,
    /// The system at the end.
    pub system: System<'a>,
    /// Its effects as suspects.
    pub chosen: Vec<Suspect>,
    /// The system at the end as the tests see it.
    pub last: Look,
    /// The probability of each type for each effect, in the place of the one chosen, the most probable first.
    pub types: Vec<Vec<(String, f64)>>,
    /// The noise of the replicates.
    pub noise: Noise,
    /// Made of it.
    pub whitener: Whitener,
    /// The replicates' means.
    pub means: Vec<f64>,
}

/// The normal quantile of 80 %.
const EIGHTY: f64 = 0.8416;

/// Leaders of each step that are tried in pairs.
const PAIRED: usize = 10;

/// The state of a search.
struct Search<'a> {
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    suspects: Vec<Suspect>,
    scan: Scan,
    means: Vec<f64>,
    sensors: Vec<On>,
    options: Options,
    stream: Stream,
}

/// A system with its fit and what is made of it.
struct State<'a> {
    system: System<'a>,
    chosen: Vec<Suspect>,
    fit: Fit,
    noise: Noise,
    whitener: Whitener,
}

/// Searches for what is missing, from starting points of the parameters.
pub fn search<'a>(
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    starts: &[Vec<f64>],
    options: Options,
    stream: &Stream,
) -> Option<Found<'a>> {
    let search = Search {
        experiment,
        candidates,
        suspects: suspects(experiment, candidates),
        scan: Scan::new(experiment),
        means: experiment.means().1,
        sensors: crate::gap::candidates::sensors(experiment),
        options,
        stream: stream.named("search"),
    };
    let mut state = search.base(starts)?;
    let mut path = Vec::new();
    let last = loop {
        let round = path.len() as u64;
        let (look, directions) = search.look(&state, round);
        let Some(step) = search.step(&mut state, &look, &directions, round) else { break look };
        path.push(step);
    };
    let types = search.types(&state, &path);
    let State { system, chosen, noise, whitener, .. } = state;
    Some(Found { path, system, chosen, last, types, noise, whitener, means: search.means })
}

impl<'a> Search<'a> {
    /// The calibration without effects: noise around a first fit, then around the fit with that noise.
    fn base(&self, starts: &[Vec<f64>]) -> Option<State<'a>> {
        let system = System::new(self.experiment, Vec::new());
        let mut starts = starts.to_vec();
        let mut state: Option<State<'a>> = None;
        for _ in 0..2 {
            let response = system.response(starts.first()?);
            let noise = Noise::of(self.experiment, &response, None);
            let whitener = Whitener::new(self.experiment, &noise, &response);
            let fit = fit_from(&system, &whitener, &self.means, &starts)?;
            starts = vec![fit.at.point.clone()];
            let system = system.clone();
            state = Some(State { system, chosen: Vec::new(), fit, noise, whitener });
        }
        state
    }

    fn desk<'b>(&'b self, state: &'b State<'a>) -> Desk<'a, 'b> {
        Desk {
            system: &state.system,
            candidates: self.candidates,
            whitener: &state.whitener,
            means: &self.means,
            sensors: self.sensors.len(),
        }
    }

    fn directions(&self, state: &State<'_>, projection: &Projection) -> Directions {
        let response = &state.fit.at.response;
        let noise = state.noise.sd(self.experiment, response);
        let situation = Situation { layouts: self.experiment.layouts, response, noise: &noise };
        let (whitener, suspects) = (&state.whitener, &self.suspects);
        Directions::of(self.experiment, self.candidates, suspects, &situation, whitener, projection)
    }

    fn look(&self, state: &State<'_>, round: u64) -> (Look, Directions) {
        let projection = Projection::of(&state.system, &state.fit);
        let directions = self.directions(state, &projection);
        let bench = Bench {
            system: &state.system,
            fit: &state.fit,
            noise: &state.noise,
            whitener: &state.whitener,
            projection: &projection,
            directions: &directions,
            scan: &self.scan,
        };
        let statistics = bench.statistics();
        let nulls = bench.nulls(self.options.simulations, &self.stream.named("null").at(round));
        let p = [
            nulls.of_score(&statistics, &directions),
            nulls.of_scan(&statistics),
            nulls.of_energy(&statistics),
        ];
        let level = self.options.naming + self.options.unlisted;
        let regions = regions(self.experiment, &self.scan, &statistics.cells, &nulls, level);
        let expected = nulls.energy.iter().sum::<f64>() / nulls.energy.len().max(1) as f64;
        let visible = self.visible(&directions, &nulls);
        let fit = state.fit.clone();
        let look = Look { fit, statistics, expected_energy: expected, p, regions, visible };
        (look, directions)
    }

    fn visible(&self, directions: &Directions, nulls: &Nulls) -> Vec<Visible> {
        let mut null = nulls.score.clone();
        null.sort_by(f64::total_cmp);
        let threshold = crate::math::moments::quantile(&null, 1.0 - self.options.naming);
        let of = |(s, suspect): (usize, &Suspect)| {
            let own = directions.all.iter().filter(|d| d.suspect == s);
            let best = own.max_by(|a, b| a.length.total_cmp(&b.length));
            Visible {
                kind: self.candidates[suspect.candidate].kind.clone(),
                on: suspect.on.clone(),
                absorbed: best.map_or(1.0, |d| d.absorbed),
                smallest: best.map_or(f64::INFINITY, |d| (threshold + EIGHTY) / d.length),
            }
        };
        self.suspects.iter().enumerate().map(of).collect()
    }

    /// The next step, if there is one.
    fn step(
        &self,
        state: &mut State<'a>,
        look: &Look,
        directions: &Directions,
        round: u64,
    ) -> Option<Step> {
        if state.chosen.len() >= self.options.most {
            return None;
        }
        let stream = self.stream.named("weigh").at(round);
        let named = look.p[0] <= self.options.naming;
        let rest = look.p[1].min(look.p[2]) <= 0.5 * self.options.unlisted;
        if !named && !(rest && state.chosen.len() + 2 <= self.options.most) {
            return None;
        }
        let judged = self.judged(state, directions, look, &stream);
        let added = if named {
            vec![judged.first()?.suspect.clone()]
        } else {
            self.pair(state, &judged, &stream)?
        };
        for suspect in &added {
            self.add(state, suspect, &judged);
        }
        let dropped = self.drop_needless(state, &stream);
        Some(Step { before: look.clone(), judged, added, dropped })
    }

    /// The leaders with the groups grown from them, the heaviest first.
    fn judged(
        &self,
        state: &State<'a>,
        directions: &Directions,
        look: &Look,
        stream: &Stream,
    ) -> Vec<Judged> {
        let layout = &self.experiment.layouts.blocks[0];
        let scores = &look.statistics.scores;
        let leads = leads(layout, &self.suspects, self.candidates, directions, scores);
        let desk = self.desk(state);
        let mut judged = judge(&desk, &state.fit, &leads, stream);
        let mut grown: Vec<Judged> = Vec::new();
        let mut seen: Vec<usize> = Vec::new();
        let best = judged.first().map_or(0.0, |j| j.log_weight);
        for (i, seed) in judged.iter().enumerate() {
            let candidate = seed.suspect.candidate;
            if seen.contains(&candidate)
                || seed.suspect.on.is_empty()
                || seed.log_weight < best - 20.0
            {
                continue;
            }
            seen.push(candidate);
            let others: Vec<On> = leads
                .iter()
                .filter(|lead| lead.suspect.candidate == candidate)
                .map(|lead| lead.suspect.on.clone())
                .collect();
            let stream = stream.named("groups").at(i as u64);
            let group = grow(&desk, &state.fit, seed, &others, &stream);
            if group.suspect.on != seed.suspect.on {
                grown.push(group);
            }
        }
        judged.extend(grown);
        judged.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
        judged
    }

    fn add(&self, state: &mut State<'a>, suspect: &Suspect, judged: &[Judged]) {
        let system = self.desk(state).with(suspect);
        let same =
            |j: &&Judged| j.suspect.candidate == suspect.candidate && j.suspect.on == suspect.on;
        let known = judged.iter().find(same);
        let own = known.map_or_else(
            || self.candidates[suspect.candidate].effect.absent(&self.experiment.layouts.blocks[0]),
            |j| j.fit.at.point[j.fit.at.point.len() - count(&system)..].to_vec(),
        );
        let start: Vec<f64> = state.fit.at.point.iter().copied().chain(own).collect();
        state.chosen.push(suspect.clone());
        self.refit(state, system, &start);
    }

    /// The system fitted anew, with the noise around its response.
    fn refit(&self, state: &mut State<'a>, system: System<'a>, start: &[f64]) {
        let first = fit(&system, &state.whitener, &self.means, start);
        let response = &first.at.response;
        state.noise = Noise::of(self.experiment, response, Some(&state.noise));
        state.whitener = Whitener::new(self.experiment, &state.noise, response);
        state.fit = fit(&system, &state.whitener, &self.means, &first.at.point);
        state.system = system;
    }

    /// Drops earlier effects whose absence weighs more than they do; their names.
    fn drop_needless(&self, state: &mut State<'a>, stream: &Stream) -> Vec<String> {
        let mut dropped = Vec::new();
        while state.chosen.len() > 1 {
            let whole = self.weight(state, stream);
            let worst = (0..state.chosen.len() - 1).find_map(|i| {
                let (smaller, _) = self.without(state, i);
                (self.weight(&smaller, stream) >= whole).then_some((i, smaller))
            });
            let Some((i, smaller)) = worst else { break };
            dropped.push(state.system.effects[i].name.clone());
            *state = smaller;
        }
        dropped
    }

    /// The state without one of its effects, refitted with the same noise, and what that effect was.
    fn without(&self, state: &State<'a>, i: usize) -> (State<'a>, Suspect) {
        let mut chosen = state.chosen.clone();
        let taken = chosen.remove(i);
        let mut effects = state.system.effects.clone();
        let begin = self.experiment.parameters.len()
            + effects[..i].iter().map(|e| e.absent().len()).sum::<usize>();
        let end = begin + effects.remove(i).absent().len();
        let system = System::new(self.experiment, effects);
        let mut start = state.fit.at.point.clone();
        start.drain(begin..end);
        let fit = fit(&system, &state.whitener, &self.means, &start);
        let (noise, whitener) = (state.noise.clone(), state.whitener.clone());
        (State { system, chosen, fit, noise, whitener }, taken)
    }

    /// The log of evidence times the prior masses of the effects.
    fn weight(&self, state: &State<'a>, stream: &Stream) -> f64 {
        let weighed = super::weigh(&state.system, &state.whitener, &self.means, &state.fit, stream);
        let desk = self.desk(state);
        let kinds = (kinds(self.candidates) as f64).ln();
        let prior = state.chosen.iter().map(|s| desk.log_prior(s) - kinds).sum::<f64>();
        weighed.log_evidence + prior
    }

    /// The heaviest pair of leaders, where it outweighs the system as it is.
    fn pair(&self, state: &State<'a>, judged: &[Judged], stream: &Stream) -> Option<Vec<Suspect>> {
        let leaders: Vec<&Judged> = judged.iter().take(PAIRED).collect();
        let now = self.weight(state, stream);
        let mut best: Option<(f64, Vec<Suspect>)> = None;
        for (i, first) in leaders.iter().enumerate() {
            let mut one = State {
                system: state.system.clone(),
                chosen: state.chosen.clone(),
                fit: state.fit.clone(),
                noise: state.noise.clone(),
                whitener: state.whitener.clone(),
            };
            self.add(&mut one, &first.suspect, judged);
            for second in &leaders[i + 1..] {
                let system = self.desk(&one).with(&second.suspect);
                let own = &second.fit.at.point[second.fit.at.point.len() - count(&system)..];
                let start: Vec<f64> = one.fit.at.point.iter().chain(own).copied().collect();
                let fit = fit(&system, &one.whitener, &self.means, &start);
                let mut chosen = one.chosen.clone();
                chosen.push(second.suspect.clone());
                let (noise, whitener) = (one.noise.clone(), one.whitener.clone());
                let both = State { system, chosen, fit, noise, whitener };
                let weight = self.weight(&both, stream);
                if weight > now && best.as_ref().is_none_or(|(most, _)| weight > *most) {
                    best = Some((weight, vec![first.suspect.clone(), second.suspect.clone()]));
                }
            }
        }
        best.map(|(_, pair)| pair)
    }

    /// The probability of each type in the place of each effect.
    fn types(&self, state: &State<'a>, path: &[Step]) -> Vec<Vec<(String, f64)>> {
        let only = state.chosen.len() == 1 && path.len() == 1 && path[0].added.len() == 1;
        (0..state.chosen.len())
            .map(|i| {
                if only {
                    return self.shares(&path[0].judged);
                }
                let (smaller, _) = self.without(state, i);
                let projection = Projection::of(&smaller.system, &smaller.fit);
                let directions = self.directions(&smaller, &projection);
                let (rows, spread) = crate::gap::locate::differences(self.experiment);
                let left = projection.rest(&smaller.fit.residual);
                let white = smaller.whitener.whiten_rows(&rows);
                let scores = directions.scores(&left, &white, &spread);
                let layout = &self.experiment.layouts.blocks[0];
                let leads = leads(layout, &self.suspects, self.candidates, &directions, &scores);
                let stream = self.stream.named("types").at(i as u64);
                self.shares(&judge(&self.desk(&smaller), &smaller.fit, &leads, &stream))
            })
            .collect()
    }

    fn shares(&self, judged: &[Judged]) -> Vec<(String, f64)> {
        let best = judged.iter().map(|j| j.log_weight).fold(f64::NEG_INFINITY, f64::max);
        let mut shares: Vec<(String, f64)> = Vec::new();
        for j in judged {
            let kind = &self.candidates[j.suspect.candidate].kind;
            let weight = (j.log_weight - best).exp();
            match shares.iter_mut().find(|(other, _)| other == kind) {
                Some((_, sum)) => *sum += weight,
                None => shares.push((kind.clone(), weight)),
            }
        }
        let total: f64 = shares.iter().map(|(_, w)| w).sum();
        shares.iter_mut().for_each(|(_, w)| *w /= total);
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }
}

/// The number of unknowns of the last effect of a system.
fn count(system: &System<'_>) -> usize {
    system.effects.last().map_or(0, |effect| effect.absent().len())
}

/// The number of types of effects.
fn kinds(candidates: &[Candidate]) -> usize {
    let mut names: Vec<&str> = candidates.iter().map(|c| c.kind.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names.len().max(1)
}
