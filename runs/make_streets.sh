#!/bin/bash
# make_streets.sh PLACEMENT FIRST COUNT: streets with objects -> data/PLACEMENT/SEED; those that are there stay
cd /work/main/runs
for s in $(seq $2 $(($2 + $3 - 1))); do
    d=data/$1/$s
    [ -e $d/truth.sgrid ] && continue
    mkdir -p data/$1
    bin/semrover streets --seed $s --length 60 --end-margin 12 --spacing 2 --seen --placement $1 -o $d --quiet -y && rm -f $d/mesh.glb
done
echo "done $*"
