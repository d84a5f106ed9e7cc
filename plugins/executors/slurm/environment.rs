//! Variables that `sbatch` must not inherit from the environment.

use super::Slurm;

/// Returns true for variables that would override the script in `sbatch`; `inside` if this process itself runs in a
/// job.
pub fn is_hidden(name: &str, options: &Slurm, inside: bool) -> bool {
    let said = match name {
        "SBATCH_ARRAY_INX" | "SBATCH_JOB_NAME" | "SBATCH_OUTPUT" | "SBATCH_REQUEUE"
        | "SBATCH_WAIT" => true,
        "SBATCH_PARTITION" => options.partition.is_some(),
        "SBATCH_ACCOUNT" => options.account.is_some(),
        "SBATCH_QOS" => options.qos.is_some(),
        "SBATCH_CONSTRAINT" => options.constraint.is_some(),
        "SBATCH_TIMELIMIT" => options.time.is_some(),
        "SBATCH_MEM_PER_NODE" | "SBATCH_MEM_PER_CPU" | "SBATCH_MEM_PER_GPU" => {
            options.memory.is_some()
        }
        _ => false,
    };
    // The sizes of the job in which this process runs do not apply to the jobs that it submits.
    let of_this_job =
        name.starts_with("SLURM_") && !["SLURM_CONF", "SLURM_CLUSTERS"].contains(&name);
    said || inside && of_this_job
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_study_says_goes_before_the_environment() {
        let options = Slurm { partition: Some("batch".to_owned()), ..Slurm::default() };
        for name in ["SBATCH_WAIT", "SBATCH_PARTITION"] {
            assert!(is_hidden(name, &options, false), "{name}");
        }
        for name in ["SBATCH_ACCOUNT", "SLURM_NTASKS", "PATH"] {
            assert!(!is_hidden(name, &options, false), "{name}");
        }
        assert!(is_hidden("SLURM_NTASKS", &options, true));
        assert!(!is_hidden("SLURM_CONF", &options, true));
    }
}
