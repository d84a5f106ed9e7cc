#!/bin/sh
# Lacuna beside its peers, each job on one thread, and the table of ratios.
#
#   bench/peers.sh [JOB...]     JOB: problem polynomial_chaos ensemble evaluation gaussian_process evidence table
#
# Without a job all of them run, in this order: later ones read what `problem` and `polynomial_chaos` wrote to
# target/bench-peers. The peers are installed with pinned versions into target/bench-venv (Python 3.11).
set -eu
cd "$(dirname "$0")/.."
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 RAYON_NUM_THREADS=1

environment=target/bench-venv
folder=target/bench-peers
if [ ! -e "$environment/complete" ]; then
    python3 -m venv "$environment"
    "$environment/bin/pip" install --quiet numpy==2.4.6 scipy==1.17.1 scikit-learn==1.9.1 \
        openturns==1.27.post1 emcee==3.1.6 dynesty==3.1.0
    touch "$environment/complete"
fi
cargo build --release --quiet -p lacuna-bench --bin peers

lacuna() { echo "lacuna $1" && target/release/peers "$1" "$folder"; }
peer() { "$environment/bin/python" "bench/peers/$1.py" "$folder"; }

job() {
    case $1 in
    problem) lacuna problem ;;
    polynomial_chaos)
        lacuna polynomial_chaos
        peer polynomial_chaos_openturns
        peer polynomial_chaos_sklearn
        ;;
    ensemble) lacuna ensemble && peer ensemble_emcee ;;
    evaluation) lacuna evaluation && peer evaluation_numpy ;;
    gaussian_process) lacuna gaussian_process && peer gaussian_process_sklearn ;;
    evidence) lacuna evidence && peer evidence_dynesty ;;
    table) peer table ;;
    *)
        echo "there is no job \`$1\`" >&2
        exit 2
        ;;
    esac
}

[ $# -gt 0 ] || set -- problem polynomial_chaos ensemble evaluation gaussian_process evidence table
for name in "$@"; do job "$name"; done
