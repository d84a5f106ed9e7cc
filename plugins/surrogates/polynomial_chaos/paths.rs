//! Search along the paths of least-angle regression: each output goes through all sets of terms by itself, and the path
//! on a set begins with what it shares with the path on the set before.

use lacuna::run::{Progress, Stop};

use super::dictionary::{Dictionary, Subset};
use super::judge::best_along;
use super::least_angle::LeastAngle;
use super::output::Output;
use super::search::{Best, Search, State};

/// Number of outputs whose correlations with all terms are held at once.
const BLOCK: usize = 1024;

impl Search<'_> {
    /// Returns the best terms of each output. `None` for outputs that do not vary, or with which no basis function varies.
    pub fn along_paths(
        &self,
        outputs: &[Output],
        progress: &Progress<'_>,
    ) -> Result<Vec<Option<Best>>, Stop> {
        let vary: Vec<usize> = (0..outputs.len()).filter(|&o| outputs[o].variance > 0.0).collect();
        progress.add((outputs.len() - vary.len()) as u64);
        let all: Vec<usize> = (0..self.sets.terms.len()).collect();
        let dictionary = self.dictionary(&all, vary.len());
        let subsets: Vec<Subset> =
            self.sets.sets.iter().map(|set| dictionary.subset(&set.members)).collect();
        let mut found = vec![None; outputs.len()];
        for block in vary.chunks(BLOCK) {
            let centred = self.centred(outputs, block);
            let correlations = dictionary.correlations(&centred);
            let best = |i: usize| {
                let (centred, correlations) = (centred.row(i), correlations.row(i));
                Ok(self.along_sets(&dictionary, &subsets, centred, correlations))
            };
            let of_block = self.tasks.map(block.len(), &best, &|_| progress.add(1))?;
            block.iter().zip(of_block).for_each(|(&o, best)| found[o] = best);
        }
        Ok(found)
    }

    /// Returns the best terms of one output among all sets.
    fn along_sets(
        &self,
        dictionary: &Dictionary,
        subsets: &[Subset],
        centred: &[f64],
        correlations: &[f64],
    ) -> Option<Best> {
        let window = self.options.early_stop.window(self.points.rows());
        let mut path: Option<LeastAngle<'_>> = None;
        let mut state = State::default();
        let mut at = 0;
        for of_degree in self.sets.sets.chunk_by(|a, b| a.degree == b.degree) {
            for (set, open) in of_degree.iter().zip(&subsets[at..]) {
                if !state.tries_norms() {
                    break;
                }
                let next = match path.take() {
                    Some(before) => before.among(open),
                    None => LeastAngle::new(dictionary, open, correlations),
                };
                let own = path.insert(next);
                let most = dictionary.most_terms().min(open.count());
                let choice = best_along(own, centred, self.criterion, most, window);
                state.take_norm(choice.map(|c| Best::new(set, c.error, c.terms.into_iter())));
            }
            at += of_degree.len();
            state.take_degree(self.options.early_stop.degrees);
            if state.done {
                break;
            }
        }
        state.best
    }
}
