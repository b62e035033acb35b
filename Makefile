# One command for everything a user or developer does. Each target sets up first: seconds, once that has been done.
#   make map                     grasp map of the bottle, on 2 ranks
#   make map SCENE=jobs/x.toml RANKS=8
#   make PYTHON=python3 setup    another interpreter than /usr/bin/python3 (see setup.sh)

RANKS   = 2
SCENE   = jobs/bottle-rigid.toml
RESULT  = results/$(basename $(notdir $(SCENE))).hdf
PAGE    = $(RESULT:.hdf=.html)
FIGURES = results/figures
BIN     = .venv/bin
# Of the benchmark: any of kernels element contact getfem map users; all if empty.
PARTS   =
# Of the random scenes and spoiled meshes of `make objects`: the page of 0 is kept in docs, those of others beside their results.
SEED    = 0
# Exit code of a finished study with failed cases; the report lists them with their reasons.
SOME_FAILED = 6

# One thread per rank: the ranks share the cores, and sums must not depend on how many threads there are.
export OMP_NUM_THREADS := 1
# Containers often set it; pytest then rewrites the assertions of every file again in each of its processes.
unexport PYTHONDONTWRITEBYTECODE
# Open MPI refuses to run as root (the usual user in a container) unless told twice.
ifeq ($(shell id -u),0)
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
endif
# It also refuses to start more ranks than there are cores; asked for when the recipe runs, after the set-up.
AS_ROOT = OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
MPIRUN = mpirun -n $(RANKS)$(shell $(AS_ROOT) mpirun -n $(RANKS) true > /dev/null 2>&1 || echo ' --oversubscribe')
RUN = $(MPIRUN) $(BIN)/softjaw run $(SCENE) -o $(RESULT)

.DEFAULT_GOAL := help
.PHONY: help setup map figures effects test test-long bench hard-cases objects docs lint doctor

help:
	@echo 'make map        the grasp map of $(SCENE) on $(RANKS) ranks, with its report'
	@echo 'make figures    the figures of the paper, into $(FIGURES)'
	@echo 'make effects    indicators of the effects against true errors, into results/effects.csv and .png'
	@echo 'make test       the tests: on one rank, then on several what can depend on ranks; five minutes'
	@echo 'make test-long  all else: kernels of the BLAS, hard cases, fuzzing, kills, Slurm; STAGES=slurm for one stage'
	@echo 'make bench      what accuracy and speed cost; PARTS="kernels" for the part that takes a minute'
	@echo 'make hard-cases scenes at the edges of what can be simulated, into docs/hard-cases.md'
	@echo 'make objects    bad meshes of eleven kinds, scans and random scenes, into docs/objects.md; SEED=7 for others'
	@echo 'make docs       docs/ as a site, with reference pages from the program, into build/site'
	@echo 'make lint       ruff and mypy'
	@echo 'make doctor     does this machine have what it needs, with the cure'
	@echo 'make setup      only what each of the above does first: packages and .venv'

setup:
	@$(if $(filter-out undefined default,$(origin PYTHON)),PYTHON='$(PYTHON)') ./setup.sh

map: setup
	@mkdir -p $(dir $(RESULT))
	@echo '$(RUN)'
	@$(RUN) || [ $$? = $(SOME_FAILED) ]
	@$(BIN)/softjaw report $(RESULT) -o $(PAGE)
	@$(BIN)/softjaw show $(RESULT) --top 5
	@echo
	@echo 'result   $(RESULT)   every number, with units and definitions'
	@echo 'open     $(PAGE)   the object with both pads at the best grasp, the four numbers beside it, maps below'

figures: setup
	$(MPIRUN) $(BIN)/python -m mpi4py -m jobs.figures all -o $(FIGURES) || [ $$? = $(SOME_FAILED) ]

effects: setup
	$(BIN)/python jobs/effects.py results/effects.csv
	@$(BIN)/python jobs/effects.py results/effects.csv -o results/effects.png

# The stages of the tests, each with the time that it may take; the last lines of both targets list how they ended. STAGES
# names some of them: make test-long STAGES="slurm kernel-Zen"
PYTEST     = $(BIN)/python -m pytest -q
TESTS      = $(PYTEST) -n logical --maxprocesses 2 --dist loadfile
serial     = 20m $(TESTS) -m "not long and not ranks"
ranks      = 10m $(TESTS) -m "ranks and not long" $(shell grep -rl --include='test_*.py' mark.ranks tests)
long       = 180m $(TESTS) -m "long and not ranks" --durations 20
long-ranks = 60m $(PYTEST) -m "long and ranks" --durations 10
decisions  = 60m env TURNS=200 $(TESTS) -m "not ranks" $(wildcard tests/*/test_decisions.py)
kernel     = 20m env OPENBLAS_CORETYPE=$(1:kernel-%=%) $(TESTS) -m "not long and not ranks" $(NUMERICAL)
slurm      = 60m tests/slurm/cluster.sh results/slurm/cluster $(BIN)/python -m tests.slurm.time_limit
NUMERICAL  = tests/friction tests/lsfit tests/scoring tests/fem tests/test_stages.py
USABLE     = $(addprefix kernel-,$(shell $(BIN)/python -m tests.blas))
RUN_STAGE  = $(or $($(firstword $(subst kernel-,kernel ,$(1)))),$(error there is no stage '$(1)'))
# Exit code 77 is that of a program that lacks something, as in automake.
define STAGE
echo; echo '== $(1): $(RUN_STAGE)'; begun=$$(date +%s); code=0; \
timeout -k 30 $(RUN_STAGE) & stage=$$!; trap "kill -- -$$stage; exit 130" INT TERM; wait $$stage || code=$$?; trap - INT TERM; \
case $$code in 0) end=passed ;; 77) end='LEFT OUT' ;; 124 | 137) end='TOO LONG' ;; *) end=FAILED ;; esac; \
ends="$$ends$$(printf '%-9s %-16s %6d s' "$$end" $(1) $$(($$(date +%s) - begun)))\n"; all=$$((all | code)); \

endef

test:      STAGES = serial ranks
test-long: STAGES = long long-ranks decisions $(USABLE) slurm
test:      OTHERS = long tests, kernels of the BLAS, Slurm: run "make test-long"
test-long: OTHERS = the fast tests, and kernels of the BLAS that this CPU cannot run
test test-long: setup
	@all=0; $(foreach name,$(STAGES),$(call STAGE,$(name)))printf '\n%b' "$$ends"; \
	echo 'left out: $(OTHERS)'; exit $$all

# mkdocs lies outside of .venv: it brings colorama, which numba then uses to write to the output of every run.
docs: setup
	@[ -d build/mkdocs/material ] || $(BIN)/python -m pip install -qq --disable-pip-version-check --target build/mkdocs 'mkdocs-material>=9.6'
	@PYTHONPATH=build/mkdocs NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict
	@echo 'open build/site/index.html, or with search: python3 -m http.server --directory build/site'

hard-cases: setup
	$(BIN)/python -m pytest -q -n 2 tests/hard_cases -m "" --table docs/hard-cases.md

objects: setup
	$(BIN)/python -m tests.objects.survey --seed $(SEED)

bench: setup
	$(BIN)/python -m tests.benchmark.run $(PARTS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/python -m mypy -p softjaw -p jobs

doctor: setup
	@$(BIN)/softjaw doctor
