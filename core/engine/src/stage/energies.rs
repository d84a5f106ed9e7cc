//! Energies of a Hamiltonian sampler, for a figure: how well the momenta carry the chains between levels of energy.

use lacuna::data::Statistics;
use lacuna::math::moments::mean;

/// Name of the energy among the statistics of a sampler.
const ENERGY: &str = "energy";

/// Energies of the kept steps of all chains.
#[derive(Debug, Clone, PartialEq)]
pub struct Energies {
    /// Energy at each step less the mean of its chain.
    pub levels: Vec<f64>,
    /// Change of the energy from each step to the next of its chain.
    pub changes: Vec<f64>,
    /// Energy Bayesian fraction of missing information of each chain: the mean square of the changes over that of the
    /// levels (Betancourt, arXiv 1604.00695, equation 2). Of the order of one if fresh momenta cross the whole range of
    /// energies in one step, two for independent energies; below [`SMALLEST`] the chains diffuse through it.
    pub fractions: Vec<f64>,
}

/// Fraction below which the tails are explored too slowly (Betancourt, arXiv 1604.00695, section 3).
pub const SMALLEST: f64 = 0.3;

/// The energies after the first `burn_in` steps; `None` if the sampler has none.
pub fn energies(statistics: &Statistics, burn_in: usize) -> Option<Energies> {
    let place = statistics.names.iter().position(|(name, _)| name == ENERGY)?;
    let steps = statistics.steps.saturating_sub(burn_in);
    let all = statistics.from_step(place, burn_in);
    if steps < 3 || !all.iter().all(|energy| energy.is_finite()) {
        return None;
    }
    let mut found = Energies { levels: Vec::new(), changes: Vec::new(), fractions: Vec::new() };
    for chain in all.chunks_exact(steps) {
        let centre = mean(chain);
        let levels: Vec<f64> = chain.iter().map(|energy| energy - centre).collect();
        let changes: Vec<f64> = chain.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        found.fractions.push(square(&changes) / square(&levels));
        found.levels.extend(levels);
        found.changes.extend(changes);
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use lacuna::data::statistics::Kind;
    use lacuna::math::random::{Stream, normal};

    use super::*;

    fn of(chains: &[Vec<f64>]) -> Option<Energies> {
        let steps = chains[0].len();
        let names = vec![("lp".to_owned(), Kind::Number), (ENERGY.to_owned(), Kind::Number)];
        let own = chains.iter().flatten().copied();
        let values = vec![0.0; chains.len() * steps].into_iter().chain(own).collect();
        energies(&Statistics { names, chains: chains.len(), steps, values }, 2)
    }

    /// An autoregression of order one with coefficient `a` has changes of mean square `2 (1 - a)` times its variance.
    #[test]
    fn the_fraction_of_an_autoregression_is_known() {
        for coefficient in [0.0, 0.9] {
            let mut rng = Stream::root(7).generator();
            let mut energy = normal(&mut rng);
            let steps = 40_000;
            let chain: Vec<f64> = (0..steps)
                .map(|_| {
                    let scale = f64::sqrt(1.0 - coefficient * coefficient);
                    energy = coefficient * energy + scale * normal(&mut rng);
                    energy
                })
                .collect();
            let found = of(&[chain]).unwrap();
            let truth = 2.0 * (1.0 - coefficient);
            // The lag-one correlation of n values has the variance (1 - a²) / n (Bartlett).
            let error = 2.0 * f64::sqrt((1.0 - coefficient * coefficient) / f64::from(steps));
            assert!((found.fractions[0] - truth).abs() < 4.0 * error, "{:?}", found.fractions);
            assert_eq!((found.levels.len(), found.changes.len()), (39_998, 39_997));
        }
    }

    #[test]
    fn chains_are_centred_and_the_burn_in_is_left_out() {
        let found = of(&[vec![9.0, 9.0, 1.0, 2.0, 3.0], vec![0.0, 0.0, 11.0, 12.0, 13.0]]).unwrap();
        assert_eq!(found.levels, [-1.0, 0.0, 1.0, -1.0, 0.0, 1.0]);
        assert_eq!((found.changes, found.fractions), (vec![1.0; 4], vec![1.0; 2]));
        assert_eq!(of(&[vec![1.0, 2.0, f64::NAN, 3.0, 4.0]]), None);
        assert_eq!(of(&[vec![1.0, 2.0, 3.0, 4.0]]), None);
    }
}
