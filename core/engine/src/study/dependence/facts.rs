//! The dependence of the priors in words, for the report.

use lacuna::data::Group;
use lacuna::math::dependence::Copula;
use lacuna::plugin::Fact;

use super::Earlier;
use crate::page::number::significant;
use crate::study::Study;

impl Study {
    /// Facts of the joint prior besides the priors of the parameters; empty if they are independent.
    pub fn prior_facts(&self) -> Vec<Fact> {
        let dependence = &self.dependence;
        let written = dependence.groups.iter().filter(|g| !matches!(g.copula, Copula::Mixture(_)));
        let mut facts: Vec<Fact> = written.map(|group| self.of_group(group)).collect();
        facts.extend(self.dependence_sections.earlier.iter().map(of_run));
        let constraints = dependence.constraints.iter();
        facts.extend(constraints.map(|c| Fact::new("constraint", &c.formula)));
        if let Some(share) = dependence.share {
            let probability = share.log().exp();
            let error = significant(probability * share.log_error(), 2);
            let text =
                format!("{} ± {error}, from {} draws", significant(probability, 4), share.draws);
            facts.push(Fact::new("probability of the constraints under the priors", text));
        }
        facts
    }

    fn of_group(&self, group: &Group) -> Fact {
        let names: Vec<&str> =
            group.members.iter().map(|&j| self.parameters[j].name.as_str()).collect();
        Fact::new(format!("dependence of {}", names.join(", ")), in_words(&group.copula))
    }
}

fn in_words(copula: &Copula) -> String {
    let matrix = |rows: &[Vec<f64>]| {
        if rows.len() == 2 {
            format!("correlation {}", significant(rows[0][1], 4))
        } else {
            let row = |row: &Vec<f64>| {
                let numbers: Vec<String> = row.iter().map(|r| significant(*r, 4)).collect();
                format!("[{}]", numbers.join(", "))
            };
            let rows: Vec<String> = rows.iter().map(row).collect();
            format!("correlation [{}]", rows.join(", "))
        }
    };
    match copula {
        Copula::Gaussian(correlation) => format!("Gaussian copula, {}", matrix(correlation.rows())),
        Copula::StudentT(correlation, dof) => {
            format!("Student t copula, {}, {dof} degrees of freedom", matrix(correlation.rows()))
        }
        Copula::Archimedean(family, theta) => format!(
            "{family:?} copula, theta {}, Kendall's tau {}",
            significant(*theta, 4),
            significant(family.kendall(*theta), 4)
        ),
        Copula::Dirichlet(concentrations) => {
            format!("Dirichlet, concentrations {concentrations:?}")
        }
        Copula::Mixture(mixture) => format!("{} normal components", mixture.count()),
    }
}

fn of_run(run: &Earlier) -> Fact {
    let (draws, effective) = run.draws;
    let joint = match &run.mixture {
        Some(mixture) if mixture.count() == 1 => {
            "one normal distribution of the normal scores".to_owned()
        }
        Some(mixture) => format!("{} normal distributions of the normal scores", mixture.count()),
        None => "quantiles".to_owned(),
    };
    let (divergence, energy) = (run.check.divergence, run.check.energy);
    let text = format!(
        "posterior of {}: {draws} draws, worth {effective:.0} independent ones, represented by {joint}; divergence from \
         held-out draws {} ± {} nats, energy coefficient {} (p {})",
        run.run.display(),
        significant(divergence.value, 2),
        significant(divergence.error, 2),
        significant(energy.coefficient, 2),
        significant(energy.probability, 2)
    );
    Fact::new(format!("prior of {}", run.parameters.join(", ")), text)
}
