# `make run` sets up a fresh machine and runs the main job; `make test` and `make test-all` set up and run all checks.
VENV := .venv
BIN := $(VENV)/bin
OUT := results
# Tests start hundreds of processes: each takes twice as long where Python may not keep what it compiles.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: run docs test test-all test-slow test-doctests test-thorough test-studies test-site test-extras test-live test-soak \
	test-ros2 test-clients setup format study studies benchmark archive dist cards notebooks clean

run: $(VENV)/.ready-run
	$(BIN)/roletrust figures --out $(OUT)/figures

# The site, in build/site/index.html, offline; tutorials run when their text changes, and pictures are drawn when code does.
docs: setup
	$(BIN)/sphinx-build -W --keep-going -j 2 -d build/doctrees docs build/site

# Minutes on two cores: lint, types, and beside them all tests that are not marked. A file stays in one process, as what its
# tests share is made once.
test: $(VENV)/.ready-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy & types=$$!; $(BIN)/pytest -n 2 --dist loadfile; tests=$$?; wait $$types && exit $$tests

# What `make test` leaves out, about half an hour; test-thorough and test-soak are for before a release.
test-all: setup
	$(MAKE) test-slow
	$(MAKE) test-doctests
	$(MAKE) test-studies
	$(MAKE) test-site
	$(MAKE) test-extras
	$(MAKE) test-live
	$(MAKE) test-ros2

# Compilation, kill and resume, long trainings, and what makes the site.
test-slow: setup
	$(BIN)/pytest -n 2 -m slow tests

# The examples in docstrings. `cluster.py` needs the extra `ray`.
test-doctests: setup
	$(BIN)/pytest -n 2 --doctest-modules --ignore=roletrust_env/benchmarking/cluster.py --ignore=experiments/roletrust_manager/dds/roletrust_nodes --ignore=roletrust_env/live.py --ignore=roletrust_env/service.py \
		roletrust_env agents baselines experiments docs/_ext

# Eight times the random examples of `make test`.
test-thorough: setup
	$(BIN)/pytest -n 2 --hypothesis-profile thorough -m hypothesis tests

# The pages of results.
test-studies: setup
	$(BIN)/pytest -n 2 -m "" tests/studies

# The whole site, in a browser, and the types of what makes it.
test-site: docs
	$(BIN)/mypy -p site_pages
	$(BIN)/pytest -n 2 -m site tests/docs

# The wheel with each extra alone, in fresh environments. A demo that found the machine too busy for it is repeated.
test-extras: setup
	$(BIN)/pytest --reruns 2 --only-rerun "too busy" -n 2 -m extras tests/extras tests/benchmarking

# Teams of processes on DDS, two at a time. They run in real time, so a test that a busy machine failed is repeated.
test-live: setup
	$(BIN)/pytest --reruns 2 -n 2 --dist loadfile -m live tests/manager/dds

# Minutes of a team: the longer of the demos, and strangers around it; the numbers are printed.
test-soak: setup
	$(BIN)/pytest --reruns 2 -s -m soak tests/manager/dds

# A peer of ROS 2 in an environment of its own, which is made first.
test-ros2: setup
	$(BIN)/pytest --reruns 2 -n 2 --dist loadfile -m ros2 tests/manager/dds

# Other libraries, each in an environment of its own: minutes, and gigabytes that go again.
test-clients: setup
	PYTHONPATH=tests $(BIN)/python -m clients $(CLIENTS)

setup: $(VENV)/.ready-dev

# All targets share one environment. constraints.txt pins every package in it, also pip: dependency groups need pip 25.1.
$(VENV)/.ready-run: PACKAGES := --editable '.[cli,vision]'
$(VENV)/.ready-test: PACKAGES := --editable '.[all]' --group test
$(VENV)/.ready-dev: PACKAGES := --editable '.[all,jax]' --group dev
$(VENV)/.ready-release: PACKAGES := --group release
$(VENV)/.ready-%: pyproject.toml constraints.txt
	test -x $(BIN)/python || python3 -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt pip
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt $(PACKAGES)
	touch $@

# What made a page of results: `make study NAME=sybils`, or one of its recipes, `make study NAME="pages zoo"`; each says in
# its documentation how long it takes, and `make studies` lists all. PUBLISH=1 copies its files to docs/.
study: setup
	$(BIN)/python -m studies $(NAME) $(if $(PUBLISH),--publish)

studies: setup
	$(BIN)/python -m studies

# The moving picture of the README.
docs/game.gif: setup
	$(BIN)/python docs/_ext/moving_picture.py $@

# The leaderboard: every model with searches, in hours; its report, its entries, which the package carries, and its tables.
benchmark: setup
	$(BIN)/roletrust benchmark all --search --out $(OUT)/standard
	$(BIN)/python -c "from pathlib import Path; from roletrust_experiments.report.files import report; \
		report(Path('$(OUT)/standard/results.sqlite'), Path('docs/leaderboards/standard'), pages='../../reference/models')"
	$(BIN)/python -c "from roletrust_env.benchmarking.entries import pack_entry; \
		from roletrust_env.benchmarking.leaderboard import Leaderboard; results = '$(OUT)/standard/results.sqlite'; \
		packed = [pack_entry(results, model) for model in Leaderboard.read(results).suite.model_names]; \
		[entry.write('roletrust_env/benchmarking/published/' + entry.file_name) for entry in packed]"
	$(BIN)/python -m studies summaries --publish

# The files of a commit, whatever the settings of git are.
COMMIT := git -c tar.umask=0002 -c core.autocrlf=false archive

# The assets of a release, with checksums: the source and the tables of the last commit, the same bytes for the same commit,
# and the raw results beside the tables, as `make benchmark` has written them.
ARCHIVE := build/archive
RESULTS := docs/leaderboards/standard
archive:
	rm -rf $(ARCHIVE)
	mkdir -p $(ARCHIVE)
	$(COMMIT) --format=tar --prefix=roletrust/ HEAD > $(ARCHIVE)/roletrust.tar
	tar -x -f $(ARCHIVE)/roletrust.tar -C $(ARCHIVE)
	cd $(ARCHIVE) && find roletrust -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum > SHA256SUMS
	gzip -n -9 $(ARCHIVE)/roletrust.tar
	rm -rf $(ARCHIVE)/roletrust
	git ls-files -z --others --ignored --exclude-standard $(RESULTS) | LC_ALL=C sort -z > $(ARCHIVE)/raw
	[ -s $(ARCHIVE)/raw ] || echo 'There are no raw results: make benchmark writes them.'
	tar --null --files-from=$(ARCHIVE)/raw --mtime=@0 --owner=0 --group=0 --numeric-owner -c | gzip -n -9 > $(ARCHIVE)/roletrust-results.tar.gz
	rm $(ARCHIVE)/raw
	cd $(ARCHIVE) && sha256sum *.tar.gz SHA256SUMS | tee roletrust.sha256

# Wheel and sdist of the last commit, with checksums: the same bytes for the same commit. Their metadata are checked.
DIST := build/dist
dist: $(VENV)/.ready-release
	rm -rf $(DIST)
	mkdir -p $(DIST)/source
	$(COMMIT) HEAD | tar -x -C $(DIST)/source
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build --no-isolation --outdir $(DIST) $(DIST)/source
	rm -rf $(DIST)/source
	$(BIN)/python -m twine check --strict $(DIST)/*
	cd $(DIST) && sha256sum * | tee SHA256SUMS

# The published tables, and what they and the attackers of the zoo are, for those who use them elsewhere: in build/cards/.
cards: setup
	rm -rf build/cards
	mkdir -p build/cards
	$(BIN)/python docs/_ext/croissant.py build/cards
	$(BIN)/python docs/_ext/model_cards.py build/cards

# Three tutorials as notebooks, in build/notebooks/, which also run on a hosted machine: their first cell installs the package.
notebooks: setup
	$(BIN)/python docs/_ext/notebooks.py build/notebooks

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache
