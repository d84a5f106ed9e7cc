//! The search for a law: the rate that lacks a force, the forms that explain the data as it does, and what is said of
//! them.

use lacuna::data::Unit;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::Stream;
use lacuna::plugin::Context;
use lacuna::plugin::amend::{Addition, Amend};
use lacuna::plugin::effect::Description;
use lacuna::plugin::term::{Index, Summand};
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use super::choose::{Finalist, Screen};
use super::force::{ForceSetting, Inferred, Misfit, cosines, piece};
use super::forms::{Entry, Seen, entries};
use super::model::Widened;
use super::quantity::rounded;
use super::sites::{self, Site};
use super::term::pieces;
use super::trial::{Fitted, Trial};
use crate::gap::experiment::Experiment;
use crate::gap::experiment::wider::FreeInput;
use crate::gap::inside::{Piece, Pieces, coefficient_unit, free};
use crate::gap::noise::{Noise, ResponseTangents};
use crate::gap::result::law::{Force, ForceCurve, Law, LawTerm, LawUnknown};
use crate::gap::system::System;
use crate::gap::system::fit::{Fit, fit_from, precision};
use crate::gap::system::whitener::Whitener;
use crate::study::Study;

/// The largest number of terms of a law.
const TERMS: usize = 3;

/// The smallest log Bayes factor of a force, and of a further term after the price of its choice: 20 to 1 (Kass and Raftery,
/// Journal of the American Statistical Association 90 (1995) 773).
const WORTH: f64 = 3.0;

/// The share of the rate that a term contributes at one standard deviation of its coefficient.
const SHARE: f64 = 0.5;

/// The largest number of values of all responses to forms, which bounds the memory.
const NUMBERS: usize = 24_000_000;

/// The largest number of responses to forms that are computed at once.
const TOGETHER: usize = 48;

/// The largest number of times at which a force is kept.
const SHOWN: usize = 200;

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

/// A law that was found, with the responses that it is compared by: without it, with a free force, and with it.
pub struct Described {
    /// The law, not yet accepted.
    pub law: Law,
    /// The response without a law, with the free force, and with the law.
    pub responses: [Vec<f64>; 3],
    /// The study's parameters beside the law.
    pub parameters: Vec<f64>,
    /// The response with the law and the changes that the unknowns can make to it, in units of their priors' widths.
    pub around: ResponseTangents,
}

/// What is fixed while a law is sought.
struct Finder<'a, 'b, 's> {
    setting: &'s LawSetting<'a, 'b>,
    amend: &'s dyn Amend,
    context: Context<'s>,
    sites: Vec<Site>,
    means: Vec<f64>,
    values: usize,
    taken: Vec<String>,
    time: (String, f64, f64, Unit),
}

/// A run along which forms are compared: pieces of the model, with the study's parameters and the inputs under each
/// condition.
struct Run {
    pieces: Vec<(Piece, Vec<FreeInput>)>,
    parameters: Vec<f64>,
    inputs: Vec<Vec<f64>>,
}

/// Infers the force that a rate lacks and seeks its law; `None` if the model has no equations or no rate lacks a
/// force.
pub fn find(setting: &LawSetting<'_, '_>) -> Option<Described> {
    let LawSetting { study, experiment, noise, starts, .. } = *setting;
    let amend = study.model.as_ref()?.built.plugin.amend()?;
    let (layout, _) = study.layouts.of_scenario(&study.scenarios.first()?.name)?;
    let context = study.context_of(&layout);
    let sites = sites::all(amend, &context);
    let mut taken: Vec<String> = study.given.iter().map(|given| given.name.clone()).collect();
    taken.extend(amend.states(&context).into_iter().map(|state| state.name));
    let asked = &study.gap.inside.terms;
    taken.extend(asked.iter().map(|term| term.common.name(&term.built).to_owned()));
    let values = experiment.curves.iter().map(|curve| curve.measured.len()).sum();
    let (_, means) = experiment.means();
    let time = span(study)?;
    let finder = Finder { setting, amend, context, sites, means, values, taken, time };
    let whitener = Whitener::new(experiment, noise, &finder.means);
    let base = System::new(experiment, Vec::new());
    let base = fit_from(&base, &whitener, &finder.means, starts)?;
    let (site, found) = finder.force(&base, noise)?;
    Some(finder.described(site, &found, &base))
}

/// The name of the time with its first and last value over all conditions, in the unit of the model.
fn span(study: &Study) -> Option<(String, f64, f64, Unit)> {
    let simulator = crate::stage::simulator::Simulator::of(study).ok()??;
    let mut all: Option<(String, f64, f64, Unit)> = None;
    for setting in &simulator.settings {
        let (name, at, unit) = setting.asked.abscissa()?;
        let (first, last) = (*at.first()?, *at.last()?);
        let (from, to) =
            all.as_ref().map_or((first, last), |(_, a, b, _)| (first.min(*a), last.max(*b)));
        all = Some((name.to_owned(), from, to, unit.clone()));
    }
    all.filter(|(_, from, to, _)| to > from)
}

impl<'a> Finder<'a, '_, '_> {
    /// The rate that lacks a force and the force that it lacks: the one of largest evidence.
    fn force(&self, base: &Fit, noise: &Noise) -> Option<(usize, Inferred)> {
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

    /// What `use_it` makes of the model with a force in a rate.
    fn with_force<T>(
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

    fn force_piece(&self, site: usize) -> (Piece, Vec<FreeInput>) {
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

    /// The force of a rate with the law that describes it.
    fn described(&self, site: usize, found: &Inferred, base: &Fit) -> Described {
        let LawSetting { study, experiment, .. } = *self.setting;
        let trial = Trial { study, experiment, whitener: &found.whitener, means: &self.means };
        let starts = [base.at.point.clone(), found.parameters.clone()];
        let nothing = trial.fitted(&[], &starts);
        let (law, tried) = match &nothing {
            Some(nothing) => self.law(site, found, &trial, nothing),
            None => (None, 0),
        };
        let before = nothing.as_ref().map_or(base, |nothing| &nothing.fit);
        let energy = |response: &[f64]| {
            let misfit: Vec<f64> = self.means.iter().zip(response).map(|(y, m)| y - m).collect();
            let white = found.whitener.whiten(&misfit);
            dot(&white, &white)
        };
        let [first, with_force] = [&before.at.response, &found.response].map(|r| energy(r));
        let share = |after: f64, whole: f64| ((first - after) / whole.max(1.0)).clamp(0.0, 1.0);
        let after = law.as_ref().map_or(&before.at.response, |law| &law.fit.at.response);
        let explained = share(energy(after), first - with_force);
        let excess = first - (self.values as f64 - study.parameters.len() as f64);
        let force = self.shown(site, found, law.as_ref(), share(with_force, excess));
        let point = law.as_ref().map_or(&before.at.point, |law| &law.fit.at.point);
        let terms = law.as_ref().map(|law| &law.terms[..]).unwrap_or_default();
        let last = law.as_ref().map_or(before, |law| &law.fit);
        let around = trial.with(terms, |system| system.around(&last.at));
        let around = around.unwrap_or_else(|| ResponseTangents {
            response: after.clone(),
            slopes: Matrix::zeros(0, after.len()),
        });
        Described {
            responses: [before.at.response.clone(), found.response.clone(), after.clone()],
            parameters: point[..study.parameters.len()].to_vec(),
            around,
            law: Law {
                accepted: false,
                reason: None,
                explained,
                tried,
                force,
                terms: law.map(|law| law.terms).unwrap_or_default(),
                proof: None,
            },
        }
    }

    /// The law of the force with the number of forms that were tried: terms are added while they are worth their price.
    fn law(
        &self,
        site: usize,
        found: &Inferred,
        trial: &Trial<'a, '_>,
        nothing: &Fitted,
    ) -> (Option<Fitted>, usize) {
        let mut run = Run {
            pieces: vec![self.force_piece(site)],
            parameters: found.parameters.clone(),
            inputs: found.weights.clone(),
        };
        let mut misfit = self.with_force(site, |setting| setting.residual(found)).flatten();
        let (mut best, mut tried) = (nothing.clone(), 0);
        for step in 0..TERMS {
            let Some(known) = misfit.take() else { break };
            let stream = self.setting.stream.named("forms").at(step as u64);
            let Some((next, count)) = self.next(&run, known, trial, &best, &stream) else { break };
            tried = tried.max(count);
            if next.evidence - best.evidence < WORTH + (count as f64).ln() {
                break;
            }
            best = next;
            run = self.run_of(&best, run.inputs.len());
            misfit = self.left(trial, &best);
        }
        ((!best.terms.is_empty()).then_some(best), tried)
    }

    /// The run of a law.
    fn run_of(&self, law: &Fitted, conditions: usize) -> Run {
        let own = law.fit.at.point.split_at(self.setting.study.parameters.len());
        Run {
            pieces: pieces(&law.terms),
            parameters: own.0.to_vec(),
            inputs: vec![own.1.to_vec(); conditions],
        }
    }

    /// What a law leaves.
    fn left(&self, trial: &Trial<'a, '_>, law: &Fitted) -> Option<Misfit> {
        let priors = |system: &System<'_>| system.priors().iter().map(precision).collect();
        Some(Misfit {
            residual: law.fit.residual.clone(),
            slopes: law.fit.slopes.clone(),
            precisions: trial.with(&law.terms, priors)?,
        })
    }

    /// The law with the best further term, and the number of forms that were compared.
    fn next(
        &self,
        run: &Run,
        misfit: Misfit,
        trial: &Trial<'a, '_>,
        known: &Fitted,
        stream: &Stream,
    ) -> Option<(Fitted, usize)> {
        let study = self.setting.study;
        let alone = Pieces::alone(study, run.pieces.clone()).ok()??;
        let model = Widened::new(study, &alone)?;
        let all = self.dictionary(&model, run)?;
        let white = self.responses(run, &all, trial.whitener)?;
        let screen = Screen::new(&all, white, misfit, self.values)?;
        let finalists = screen.finalists(&stream.named("noise"));
        let fits = finalists.iter().filter_map(|finalist| {
            let fitted = self.refined(&model, run, finalist, trial, known, all.len())?;
            Some((finalist, fitted))
        });
        let best = fits.fold(None, |best: Option<(&Finalist, Fitted)>, next| match best {
            Some(best) if best.1.evidence >= next.1.evidence => Some(best),
            _ => Some(next),
        });
        let (finalist, mut fitted) = best?;
        let winner = &finalist.starts[0].0;
        let stability = screen.stability(self.setting.experiment, winner, &stream.named("halves"));
        fitted.terms.last_mut()?.stability = stability;
        Some((fitted, all.len()))
    }

    /// All forms along a run, as many as the memory allows: with fewer arguments if there are too many.
    fn dictionary(&self, model: &Widened<'_>, run: &Run) -> Option<Vec<Entry>> {
        let affordable = NUMBERS / self.setting.experiment.outputs().max(1);
        let most = self.sites.iter().map(|site| site.arguments.len()).max()?;
        for arguments in (1..=most).rev() {
            let mut all = Vec::new();
            for (index, site) in self.sites.iter().enumerate() {
                let own = &site.arguments[..arguments.min(site.arguments.len())];
                let texts: Vec<String> = own.iter().map(|a| a.text.clone()).collect();
                let values = self.along(model, run, &texts)?;
                let seen = own.iter().zip(values);
                let seen: Vec<Seen<'_>> =
                    seen.map(|(argument, values)| Seen { argument, values }).collect();
                all.extend(entries(index, site, &seen));
            }
            all.retain(|entry| self.unit(entry, &entry.shape(), &[]).is_ok());
            if all.len() <= affordable || arguments == 1 {
                return Some(all);
            }
        }
        None
    }

    /// The values of expressions along a run, over all conditions.
    fn along(&self, model: &Widened<'_>, run: &Run, texts: &[String]) -> Option<Vec<Vec<f64>>> {
        let mut all = vec![Vec::new(); texts.len()];
        for c in 0..model.conditions() {
            let own = model.along(c, &run.parameters, &run.inputs, texts)?;
            all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
        }
        Some(all)
    }

    /// The unit of the coefficient of a form.
    fn unit(&self, entry: &Entry, shape: &str, indices: &[Index]) -> Result<Unit, String> {
        let (shape, indices) = (shape.to_owned(), indices.to_vec());
        let summand = Summand { shape, indices, ..Summand::default() };
        let state = &self.sites[entry.site].state;
        coefficient_unit(self.amend, &self.context, state, &summand)
    }

    /// The whitened responses to forms along a run, `forms x outputs`; zero for one that has none.
    fn responses(&self, run: &Run, all: &[Entry], whitener: &Whitener) -> Option<Matrix> {
        let mut rows = Matrix::zeros(0, self.means.len());
        for part in all.chunks(TOGETHER) {
            let made = self.responses_together(run, part).or_else(|| {
                // One form without a response spoils that of the others.
                let mut each = Matrix::zeros(0, self.means.len());
                for entry in part {
                    let own = self.responses_together(run, std::slice::from_ref(entry));
                    each.push_row(own.as_ref().map_or(&vec![0.0; self.means.len()], |o| o.row(0)));
                }
                Some(each)
            })?;
            whitener.whiten_rows(&made).iter_rows().for_each(|row| rows.push_row(row));
        }
        Some(rows)
    }

    fn responses_together(&self, run: &Run, part: &[Entry]) -> Option<Matrix> {
        let study = self.setting.study;
        let begin = run.inputs.first()?.len();
        let mut pieces = run.pieces.clone();
        for (k, entry) in part.iter().enumerate() {
            pieces.push(self.form_piece(entry, &format!("latent_form_{k}"))?);
        }
        let pieces = Pieces::alone(study, pieces).ok()??;
        let model = Widened::new(study, &pieces)?;
        let longer = run
            .inputs
            .iter()
            .map(|own| [&own[..], &vec![0.0; part.len()]].concat())
            .collect::<Vec<_>>();
        let answer = model.answer(&run.parameters, &longer)?;
        let rows: Vec<usize> = (begin..begin + part.len()).collect();
        Some(answer.by_inputs.select_rows(&rows))
    }

    /// A form as a piece of the model, with its coefficient as input.
    fn form_piece(&self, entry: &Entry, name: &str) -> Option<(Piece, Vec<FreeInput>)> {
        let name = free(name.to_owned(), &self.taken);
        let shape = entry.shape();
        let unit = self.unit(entry, &shape, &[]).ok()?;
        let words = || String::new();
        let state = self.sites[entry.site].state.name.clone();
        let input = FreeInput::new(&name, unit, 0.0, Distribution::Normal([0.0, 1.0]));
        let piece = Piece {
            kind: name.clone(),
            description: Description { title: words(), formula: words(), source: words() },
            places: vec![0],
            addition: Some(Addition {
                summands: vec![(state, format!("{name} * ({shape})"))],
                states: Vec::new(),
            }),
            at: None,
            tried: 1,
        };
        Some((piece, vec![input]))
    }

    /// The law with the form of a finalist as a further term, at its best fit.
    fn refined(
        &self,
        model: &Widened<'_>,
        run: &Run,
        finalist: &Finalist,
        trial: &Trial<'a, '_>,
        known: &Fitted,
        tried: usize,
    ) -> Option<Fitted> {
        let (entry, coefficient) = &finalist.starts[0];
        let term = self.term(model, run, entry, *coefficient, (known.terms.len(), tried))?;
        let starts = finalist.starts.iter().flat_map(|(entry, coefficient)| {
            let own = term.index.as_ref().map(|_| entry.value);
            [&known.fit.at.point[..], &run.parameters[..]].map(|point| {
                let mut start = known.fit.at.point.clone();
                start[..run.parameters.len()].copy_from_slice(&point[..run.parameters.len()]);
                start.push(*coefficient);
                start.extend(own);
                start
            })
        });
        let starts: Vec<Vec<f64>> = starts.collect();
        let mut terms = known.terms.clone();
        terms.push(term);
        trial.fitted(&terms, &starts)
    }

    /// A form as a term of a law.
    fn term(
        &self,
        model: &Widened<'_>,
        run: &Run,
        entry: &Entry,
        coefficient: f64,
        (before, tried): (usize, usize),
    ) -> Option<LawTerm> {
        let state = &self.sites[entry.site].state;
        let name = format!("law_{}", state.name);
        let name = if before == 0 { name } else { format!("{name}_{}", before + 1) };
        let name = free(name, &self.taken);
        let index = entry.index().map(|(suffix, unit, prior)| LawUnknown {
            name: free(format!("{name}_{suffix}"), &self.taken),
            unit,
            value: entry.value,
            sd: 0.0,
            prior,
        });
        let shape = match &index {
            Some(index) => entry.shape_with(&index.name),
            None => entry.shape(),
        };
        let indices: Vec<Index> = index
            .iter()
            .map(|index| Index {
                name: index.name.clone(),
                unit: index.unit.clone(),
                prior: index.prior.clone(),
                starts: vec![index.value],
            })
            .collect();
        let unit = self.unit(entry, &shape, &indices).ok()?;
        let sizes = self.along(model, run, &[state.rate.clone(), entry.shape()])?;
        let [rate, size] = [0, 1]
            .map(|k: usize| (dot(&sizes[k], &sizes[k]) / sizes[k].len().max(1) as f64).sqrt());
        let sd = rounded((SHARE * rate / size).max(coefficient.abs()));
        let prior = Distribution::Normal([0.0, sd]);
        (sd.is_finite() && sd > 0.0).then(|| LawTerm {
            formula: entry.formula(&name, index.as_ref().map_or("", |index| &index.name)),
            title: entry.title(),
            of: entry.of.clone(),
            state: state.name.clone(),
            coefficient: LawUnknown {
                name: name.clone(),
                unit,
                value: coefficient,
                sd: 0.0,
                prior,
            },
            name,
            shape,
            index,
            tried,
            stability: 0.0,
        })
    }

    /// The force as it is shown, with the law along the same run.
    fn shown(&self, site: usize, found: &Inferred, law: Option<&Fitted>, explained: f64) -> Force {
        let (_, from, to, _) = &self.time;
        let own = &self.sites[site];
        let terms = law.map(|law| &law.terms[..]).unwrap_or_default();
        let of = terms.iter().find(|term| term.state == own.state.name).map(|term| term.of.clone());
        let curves = self.with_force(site, |setting| {
            let curve = |c: usize| {
                let (mean, sd) = setting.at(found, c, (*from, *to));
                let texts: Vec<String> = of
                    .iter()
                    .cloned()
                    .chain(of.iter().map(|_| plain(terms, &own.state.name)))
                    .collect();
                let model = setting.model;
                let along = model.along(c, &found.parameters, &found.weights, &texts);
                let mut along = along.unwrap_or_default().into_iter();
                let (of, law) =
                    (along.next().unwrap_or_default(), along.next().unwrap_or_default());
                let scenario = &self.setting.experiment.conditions[c].scenario;
                let at = model.times(c).to_vec();
                thinned(ForceCurve { scenario: scenario.clone(), at, mean, sd, law, of })
            };
            let measured = setting.measured().into_iter();
            measured.map(curve).collect::<Vec<_>>()
        });
        Force {
            state: own.state.name.clone(),
            unit: own.unit.clone(),
            log_evidence: found.log_evidence,
            explained,
            of,
            curves: curves.unwrap_or_default(),
        }
    }
}

/// The terms in the rate of a state with the values of their unknowns, as an expression.
fn plain(terms: &[LawTerm], state: &str) -> String {
    let own = terms.iter().filter(|term| term.state == state);
    let each: Vec<String> = own
        .map(|term| {
            let value =
                |unknown: &LawUnknown| super::quantity::quantity(unknown.value, &unknown.unit);
            let mut shape = term.shape.clone();
            if let Some(index) = &term.index {
                shape = shape.replace(&index.name, &format!("({})", value(index)));
            }
            format!("({}) * ({shape})", value(&term.coefficient))
        })
        .collect();
    each.join(" + ")
}

/// A curve with at most so many times as are shown.
fn thinned(curve: ForceCurve) -> ForceCurve {
    let step = curve.at.len().div_ceil(SHOWN).max(1);
    let some = |values: Vec<f64>| values.into_iter().step_by(step).collect::<Vec<f64>>();
    ForceCurve {
        scenario: curve.scenario,
        at: some(curve.at),
        mean: some(curve.mean),
        sd: some(curve.sd),
        law: some(curve.law),
        of: some(curve.of),
    }
}
