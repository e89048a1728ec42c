#!/usr/bin/env bash
# Measure everything that the pages quote; half an hour on a quiet machine.
#
#   pip install ".[bench,drake,bullet,crocoddyl,gym]"          the other engines, and gymnasium's robots
#   pip install --no-deps "example-robot-data>=6"              URDF files; crocoddyl asks for older ones, needs none
#   benchmarks/all.sh DIR            writes report.html, report.json, a JSON per benchmark, and figures to DIR
#   benchmarks/all.sh DIR --quick    a check that it runs, with a report per study in a folder of its own
#   python docs/figures.py --take DIR        puts the numbers into docs/measured and the pages
#
# Missing packages are skipped. Ends with 1 when a study failed, or a benchmark missed a bar; the others still run.
set -uo pipefail

out="$(mkdir -p "${1:?benchmarks/all.sh: where to? benchmarks/all.sh DIR [--quick]}" && cd "$1" && pwd)" || exit 2
quick="${2:-}"
case "$quick" in "" | --quick) ;; *) echo "benchmarks/all.sh: expected --quick, got $quick" >&2; exit 2 ;; esac
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
python="${PYTHON:-python}"
cd "$out" || exit 2
cores="$(nproc 2>/dev/null || echo 1)"
rm -f ./*.missed

measure() {  # NAME COMMAND...: write its output to NAME.txt; start as many quick runs at once as there are cores
    if [ -n "$quick" ]; then
        while [ "$(jobs -rp | wc -l)" -ge "$cores" ]; do wait -n || true; done
        timed "$@" &
    else
        timed "$@"
    fi
}

timed() {
    local name="$1" begin="$SECONDS"
    shift
    "$@" >"$name.txt" || touch "$name.missed"
    printf '== %s: %d s\n' "$name" "$((SECONDS - begin))"
}

if [ -n "$quick" ]; then  # study by study; only bars that do not depend on the clock are judged
    for study in contact mechanics gradients stability; do
        measure "study_$study" "$python" "$here/benchmarks/compare.py" "$study" --quick --strict --out "$out/$study"
    done
    for study in accuracy planning lean timing compile; do
        measure "study_$study" "$python" "$here/benchmarks/compare.py" "$study" --quick --out "$out/$study"
    done
else
    measure report "$python" "$here/benchmarks/compare.py" all --out "$out"
fi
measure source_statistics "$python" "$here/benchmarks/source_statistics.py" --out "$out"
measure chaos "$python" "$here/benchmarks/chaos.py" $quick --out "$out"  # on all cores: loops over them are a part
if [ "${NUMBA_NUM_THREADS:-$cores}" -ge 2 ]; then
    measure learning_scaling "$python" "$here/benchmarks/learning_scaling.py" $quick --out "$out"
fi
export NUMBA_NUM_THREADS=1  # one core from here on, as the tables say
measure cold_starts "$python" "$here/benchmarks/cold_starts.py" $quick --out "$out"
measure robustness "$python" "$here/benchmarks/robustness.py" $quick --out "$out"
measure attacks "$python" "$here/benchmarks/attacks.py" $quick --out "$out"
measure division "$python" "$here/benchmarks/division.py" $quick --out "$out"
measure error_control "$python" "$here/benchmarks/error_control.py" $quick --figure error_control.png --out "$out"
measure contact_costs "$python" "$here/benchmarks/contact_costs.py" $quick --out "$out"
measure learning_costs "$python" "$here/benchmarks/learning_costs.py" $quick --out "$out"
measure python_costs "$python" "$here/benchmarks/python_costs.py" $quick --out "$out"
measure start_strategies "$python" "$here/benchmarks/start_strategies.py" $quick --out "$out"
measure falls "$python" "$here/benchmarks/falls.py" $quick --out "$out"
measure gaits "$python" "$here/benchmarks/gaits.py" $quick --out "$out"
measure flips "$python" "$here/benchmarks/flips.py" $quick --out "$out"
measure replays "$python" "$here/benchmarks/replays.py" $quick --out "$out"
measure loops "$python" "$here/benchmarks/loops.py" $quick --out "$out"
measure collisions "$python" "$here/benchmarks/collisions.py" --motions 120 $quick --out "$out"
measure mpc "$python" "$here/benchmarks/mpc.py" $quick --out "$out"
measure adaptation "$python" "$here/benchmarks/adaptation.py" $quick --out "$out"
measure known_parameters "$python" "$here/benchmarks/known_parameters.py" $quick --out "$out"
measure dexterous "$python" "$here/benchmarks/dexterous.py" $quick --out "$out"
measure crisp "$python" "$here/benchmarks/crisp.py" $quick --out "$out"
measure mpc_suites "$python" "$here/benchmarks/mpc_suites.py" $quick spinner acrobot free_gait_disturbed free_gait_fast --out "$out"  # the others take minutes
measure humanoids "$python" "$here/benchmarks/humanoids.py" $quick --out "$out"
measure environments "$python" "$here/benchmarks/environments.py" $quick --out "$out"
if [ -z "$quick" ]; then  # needs gymnasium[mujoco]
    measure agreement "$python" "$here/benchmarks/agreement.py" --out "$out"
fi
measure parameter_derivatives "$python" "$here/benchmarks/parameter_derivatives.py" $quick --out "$out"
if "$python" -c 'import importlib.metadata as m; m.version("example-robot-data")' 2>/dev/null; then
    measure urdf_zoo "$python" "$here/benchmarks/urdf_zoo.py" $quick --out "$out"
    if [ -z "$quick" ] && "$python" -c "import pinocchio" 2>/dev/null; then
        measure urdf_kinematics "$python" "$here/benchmarks/urdf_kinematics.py" --out "$out"
    fi
    measure robots "$python" "$here/benchmarks/robots.py" $quick --out "$out"
    measure shapes "$python" "$here/benchmarks/shapes.py" $quick --out "$out"
else
    echo "== urdf_zoo, robots, shapes: left out, example-robot-data is not installed"
fi
measure hopper "$python" "$here/examples/hopper.py" $quick

wait
printf '%d s in all\n' "$SECONDS"
missed="$(for file in *.missed; do [ -e "$file" ] && printf ' %s' "${file%.missed}"; done)"
if [ -n "$missed" ]; then
    echo "failed, or missed a bar:$missed"
    exit 1
fi
