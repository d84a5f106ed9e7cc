//! The search: forward with a gate, with groups, deletions and pairs, until nothing is left or nothing helps.

use super::consistency::consistency;
use super::groups::grow;
use super::leaders::{Judged, Lead, judge, leads};
use super::look::{Found, Look, Options, Step, Visible};
use super::shares::shares;
use super::stability::stability;
use super::state::{Common, State, kinds};
use crate::gap::candidates::{Candidate, Suspect, sensors, suspects};
use crate::gap::experiment::Experiment;
use crate::gap::fit::fit_from;
use crate::gap::locate::{
    Bench, Directions, Nulls, Projection, Scan, Scores, differences, regions,
};
use crate::gap::noise::{Around, Noise};
use crate::gap::system::System;
use crate::gap::whitener::Whitener;
use crate::math::moments::{log_sum, mean, quantile, variance};
use crate::math::random::Stream;
use crate::plugin::effect::{On, Situation};

/// The normal quantile of 80 %.
const EIGHTY: f64 = 0.8416;

/// Suspects this much lighter than the heaviest, in logarithms, are no seeds of groups.
const RIVAL: f64 = 20.0;

/// What the first effect leaves may be its own form, a little wrong: a further one must outweigh its absence by 20 to 1, in
/// logarithms (strong evidence by Kass and Raftery, Journal of the American Statistical Association 90 (1995) 773).
const FURTHER: f64 = 3.0;

/// Leaders of each step that are tried in pairs.
const PAIRED: usize = 10;

/// Rounds in which effects that have better rivals are exchanged for them.
const EXCHANGES: usize = 10;

/// A search: what does not change on its path.
struct Search<'a> {
    experiment: &'a Experiment<'a>,
    candidates: &'a [Candidate],
    suspects: Vec<Suspect>,
    scan: Scan,
    means: Vec<f64>,
    sensors: usize,
    options: Options,
    stream: Stream,
}

/// Searches for what is missing, from starting points of the parameters; `None` when the forward map has no answer there.
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
        sensors: sensors(experiment).len(),
        options,
        stream: stream.named("search"),
    };
    let mut state = search.base(starts)?;
    let mut path: Vec<Step> = Vec::new();
    let last = loop {
        let round = path.len() as u64;
        let (look, directions) = search.look(&state, round);
        let Some(step) = search.step(&mut state, &look, &directions, round) else { break look };
        path.push(step);
    };
    let slots = search.slots(&state, &path);
    let stability = match slots.last() {
        Some(judged) => {
            let smaller = state.without(&search.common(), state.chosen.len() - 1);
            stability(experiment, &smaller.desk(&search.common()), judged)
        }
        None => 1.0,
    };
    let consistency = consistency(&state.system, &state.fit, &state.whitener);
    let types = slots.iter().map(|judged| shares(candidates, judged)).collect();
    let State { system, chosen, noise, whitener, .. } = state;
    let means = search.means;
    Some(Found {
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
    fn common<'b>(&'b self) -> Common<'a, 'b> {
        Common {
            experiment: self.experiment,
            candidates: self.candidates,
            means: &self.means,
            sensors: self.sensors,
        }
    }

    /// The calibration without effects: noise around a first fit, then around the fit with that noise.
    fn base(&self, starts: &[Vec<f64>]) -> Option<State<'a>> {
        let system = System::new(self.experiment, Vec::new());
        let mut starts = starts.to_vec();
        let mut state: Option<State<'a>> = None;
        for _ in 0..2 {
            let around = Around::fit(&system, &system.linearised(starts.first()?));
            let noise = Noise::of(self.experiment, &around, None);
            let whitener = Whitener::new(self.experiment, &noise, &around.response);
            let fit = fit_from(&system, &whitener, &self.means, &starts)?;
            starts = vec![fit.at.point.clone()];
            let system = system.clone();
            state = Some(State { system, chosen: Vec::new(), fit, noise, whitener });
        }
        state
    }

    /// What candidates may see of a state, handed to `use_it`.
    fn situated<T>(&self, state: &State<'_>, use_it: impl FnOnce(&Situation<'_>) -> T) -> T {
        let response = &state.fit.at.response;
        let noise = state.noise.sd(self.experiment, response);
        use_it(&Situation { layouts: self.experiment.layouts, response, noise: &noise })
    }

    fn directions(&self, state: &State<'_>, projection: &Projection) -> Directions {
        let (whitener, suspects) = (&state.whitener, &self.suspects);
        self.situated(state, |situation| {
            let (system, fit, candidates) = (&state.system, &state.fit, self.candidates);
            Directions::of(system, fit, candidates, suspects, situation, whitener, projection)
        })
    }

    fn leads(&self, state: &State<'_>, directions: &Directions, scores: &Scores) -> Vec<Lead> {
        self.situated(state, |situation| {
            leads(&self.suspects, self.candidates, directions, scores, situation)
        })
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
        let stream = self.stream.named("null").at(round);
        let nulls = bench.nulls(&statistics, self.options.simulations, &stream);
        let p = [
            nulls.of_score(&statistics, &directions),
            nulls.of_scan(&statistics),
            nulls.of_energy(&statistics),
        ];
        let level = self.options.naming + self.options.unlisted;
        let regions = regions(self.experiment, &self.scan, &statistics, &nulls, level);
        let expected_energy = mean(&nulls.energy);
        let energy_sd = variance(&nulls.energy).sqrt();
        let visible = self.visible(&directions, &nulls);
        let fit = state.fit.clone();
        let look = Look { fit, statistics, expected_energy, energy_sd, p, regions, visible };
        (look, directions)
    }

    fn visible(&self, directions: &Directions, nulls: &Nulls) -> Vec<Visible> {
        let mut null = nulls.score.clone();
        null.sort_by(f64::total_cmp);
        let threshold = quantile(&null, 1.0 - self.options.naming);
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
        let room = self.options.most.saturating_sub(state.chosen.len());
        let stream = self.stream.named("weigh").at(round);
        let named = look.p[0] <= self.options.naming;
        let rest = look.p[1].min(look.p[2]) <= 0.5 * self.options.unlisted;
        if room == 0 || !(named || rest && room >= 2) {
            return None;
        }
        let judged = self.judged(state, directions, &look.statistics.scores, &stream);
        let now = state.weight(&self.common(), &stream);
        let nothing = now - state.prior(&self.common()) + self.kinds();
        let log_odds = log_sum(judged.iter().map(|j| j.log_weight)) - nothing;
        let outweighs = |best: &&Judged| {
            // A rare score alone is what a rare noise makes as well. Further effects must each be clear.
            let alone = state.chosen.is_empty() && log_odds > 0.0;
            alone || !state.chosen.is_empty() && best.log_weight > nothing + FURTHER
        };
        let alone = judged.first().filter(|best| named && outweighs(best));
        let added = match alone {
            Some(best) => vec![best.suspect.clone()],
            None if room >= 2 => self.pair(state, &judged, now, &stream)?,
            None => return None,
        };
        for suspect in &added {
            *state = state.with(&self.common(), suspect, &self.unknowns(suspect, &judged));
        }
        self.exchange(state, &stream);
        let dropped = self.drop_needless(state, &stream);
        Some(Step { before: look.clone(), judged, log_odds, added, dropped })
    }

    /// The log of the number of types.
    fn kinds(&self) -> f64 {
        (kinds(self.candidates) as f64).ln()
    }

    /// The leaders with the groups grown from them, the heaviest first.
    fn judged(
        &self,
        state: &State<'a>,
        directions: &Directions,
        scores: &Scores,
        stream: &Stream,
    ) -> Vec<Judged> {
        let mut leads = self.leads(state, directions, scores);
        // What acts in a place already would act there twice.
        let is_there = |lead: &Lead| {
            let same = |chosen: &Suspect| {
                chosen.candidate == lead.suspect.candidate && chosen.on == lead.suspect.on
            };
            state.chosen.iter().any(same)
        };
        leads.retain(|lead| !is_there(lead));
        let common = self.common();
        let desk = state.desk(&common);
        let mut judged = judge(&desk, &state.fit, &leads, stream);
        let best = judged.first().map_or(0.0, |j| j.log_weight);
        let mut seen: Vec<usize> = Vec::new();
        let mut grown: Vec<Judged> = Vec::new();
        for (i, seed) in judged.iter().enumerate() {
            let candidate = seed.suspect.candidate;
            if seen.contains(&candidate)
                || seed.suspect.on.is_empty()
                || seed.log_weight < best - RIVAL
            {
                continue;
            }
            seen.push(candidate);
            let same = leads.iter().filter(|lead| lead.suspect.candidate == candidate);
            let others: Vec<On> = same.map(|lead| lead.suspect.on.clone()).collect();
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

    /// What was fitted for the unknowns of a suspect.
    fn unknowns(&self, suspect: &Suspect, judged: &[Judged]) -> Vec<f64> {
        let effect = &self.candidates[suspect.candidate].effect;
        let absent = effect.absent(&self.experiment.layouts.blocks[0]);
        let same =
            |j: &&Judged| j.suspect.candidate == suspect.candidate && j.suspect.on == suspect.on;
        judged.iter().find(same).map_or(absent.clone(), |j| {
            let point = &j.fit.at.point;
            point[point.len() - absent.len()..].to_vec()
        })
    }

    /// What is weighed in the place of one of the effects, the heaviest first.
    fn slot(&self, state: &State<'a>, i: usize, stream: &Stream) -> (State<'a>, Vec<Judged>) {
        let smaller = state.without(&self.common(), i);
        let projection = Projection::of(&smaller.system, &smaller.fit);
        let directions = self.directions(&smaller, &projection);
        let (rows, spread) = differences(self.experiment);
        let left = projection.rest(&smaller.fit.residual);
        let scores = directions.scores_of(&left, &smaller.whitener.whiten_rows(&rows), &spread);
        let judged = self.judged(&smaller, &directions, &scores, stream);
        (smaller, judged)
    }

    /// Exchanges effects for what outweighs them in their places.
    fn exchange(&self, state: &mut State<'a>, stream: &Stream) {
        if state.chosen.len() < 2 {
            return;
        }
        for round in 0..EXCHANGES {
            let mut exchanged = false;
            for i in 0..state.chosen.len() {
                let stream = stream.named("exchange").at(round as u64).at(i as u64);
                let (smaller, judged) = self.slot(state, i, &stream);
                let Some(best) = judged.first() else { continue };
                let chosen = &state.chosen[i];
                let same =
                    best.suspect.candidate == chosen.candidate && best.suspect.on == chosen.on;
                if same {
                    continue;
                }
                let own = self.unknowns(&best.suspect, &judged);
                let next = smaller.with(&self.common(), &best.suspect, &own);
                if next.weight(&self.common(), &stream)
                    > state.weight(&self.common(), &stream) + 1.0
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

    /// Drops effects whose absence weighs more than they do; their names. The last one added stays.
    fn drop_needless(&self, state: &mut State<'a>, stream: &Stream) -> Vec<String> {
        let common = self.common();
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

    /// The heaviest pair of leaders, where it outweighs the system as it is.
    fn pair(
        &self,
        state: &State<'a>,
        judged: &[Judged],
        now: f64,
        stream: &Stream,
    ) -> Option<Vec<Suspect>> {
        let common = self.common();
        let leaders: Vec<&Judged> = judged.iter().take(PAIRED).collect();
        let mut best: Option<(f64, Vec<Suspect>)> = None;
        for (i, first) in leaders.iter().enumerate() {
            let one = state.with(&common, &first.suspect, &self.unknowns(&first.suspect, judged));
            for second in &leaders[i + 1..] {
                let own = self.unknowns(&second.suspect, judged);
                let both = one.with(&common, &second.suspect, &own);
                let weight = both.weight(&common, stream);
                if weight > now + FURTHER && best.as_ref().is_none_or(|(most, _)| weight > *most) {
                    best = Some((weight, vec![first.suspect.clone(), second.suspect.clone()]));
                }
            }
        }
        best.map(|(_, pair)| pair)
    }

    /// What was weighed in the place of each effect at the end.
    fn slots(&self, state: &State<'a>, path: &[Step]) -> Vec<Vec<Judged>> {
        if let ([step], 1) = (path, state.chosen.len())
            && step.added.len() == 1
        {
            return vec![step.judged.clone()];
        }
        let stream = self.stream.named("types");
        let slot = |i: usize| self.slot(state, i, &stream.at(i as u64)).1;
        (0..state.chosen.len()).map(slot).collect()
    }
}
