#!/bin/sh
# Build sdist and wheel, install the wheel (made from the sdist) into a fresh environment, use it from another folder.
# usage: package.sh PYTHON, from the project's folder
set -eu
python=$1
project=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m build --outdir "$work/dist" "$project" >"$work/build.log" 2>&1 || { tail -n 30 "$work/build.log"; exit 1; }
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check \
    --constraint "$project/constraints.txt" "$work"/dist/*.whl
mkdir "$work/elsewhere"
cd "$work/elsewhere"
"$work/venv/bin/python" -m pipeline +experiment=traj3 'methods=[lsv,pmke]' hydra.run.dir=traj3
"$work/venv/bin/selfmotion" robot=planar3r 'methods=[lsv]' hydra.run.dir=short
"$work/venv/bin/python" -m pipeline.describe robot=planar4r
test -s traj3/summary.csv
test -s short/recording.rrd
test -s outputs/describe/planar4r/recording.rrd
"$work/venv/bin/python" -c 'import pipeline; assert "site-packages" in pipeline.__file__, pipeline.__file__'
echo "the installed package works from another folder"
