# `make run` sets up a fresh machine and runs the main job; `make test` and `make test-all` set up and run all checks.
VENV := .venv
BIN := $(VENV)/bin
OUT := results

CERTAIN := --set max_cycles=200 --set noise=0 --set 'perturbations=[]'

.PHONY: run docs test test-all test-slow test-doctests test-thorough test-studies test-site test-extras test-live test-soak test-ros2 test-clients setup format pictures costs edge-costs scale live-load better-model \
	leave-one-out leave-one-out-logs first-hand real equilibrium strategic defence defence-logs \
	benchmark known-attacks reruns findings attackers learners ladder universal zoo report archive clean

run: $(VENV)/.ready-run
	$(BIN)/roletrust figures --out $(OUT)/figures

# The site, in build/site/index.html, offline; tutorials run when their text changes, and pictures are drawn when code does.
docs: setup
	$(BIN)/sphinx-build -W --keep-going -j 2 -d build/doctrees docs build/site

# Minutes on two cores: lint, types and all tests that are not marked.
test: $(VENV)/.ready-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pytest -n 2

# All that `make test` leaves out, about half an hour; every marker has a target of its own.
test-all: setup
	$(MAKE) test-slow
	$(MAKE) test-doctests
	$(MAKE) test-thorough
	$(MAKE) test-studies
	$(MAKE) test-site
	$(MAKE) test-extras
	$(MAKE) test-live
	$(MAKE) test-soak
	$(MAKE) test-ros2

# Compilation, kill and resume, long trainings, and the site built quickly.
test-slow: setup
	$(BIN)/pytest -n 2 -m slow tests

# The examples in docstrings. What the extra `ray` alone has is no place for them.
test-doctests: setup
	$(BIN)/pytest -n 2 --doctest-modules --ignore=roletrust_env/benchmarking/cluster.py --ignore=roletrust_env/live/roletrust_nodes \
		roletrust_env agents baselines experiments

# Eight times the random examples of `make test`.
test-thorough: setup
	$(BIN)/pytest -n 2 --hypothesis-profile thorough -m hypothesis tests

# The pages of results.
test-studies: setup
	$(BIN)/pytest -n 2 tests/studies

# The whole site, in a browser.
test-site: docs
	$(BIN)/pytest -m site tests/docs

# The wheel with each extra alone, in fresh environments.
test-extras: setup
	$(BIN)/pytest -n 2 -m extras tests/extras tests/benchmarking

# Teams of processes on DDS, two at a time. They run in real time, so a test that a busy machine failed is repeated.
test-live: setup
	$(BIN)/pytest --reruns 2 -n 2 --dist loadfile -m live tests/live

# Minutes of a team: the longer of the demos, and strangers around it; the numbers are printed.
test-soak: setup
	$(BIN)/pytest --reruns 2 -s -m soak tests/live

# A peer of ROS 2 in an environment of its own, which is made first.
test-ros2: setup
	$(BIN)/pytest --reruns 2 -n 2 --dist loadfile -m ros2 tests/live

# Other libraries, each in an environment of its own: minutes, and gigabytes that go again.
test-clients: setup
	PYTHONPATH=tests $(BIN)/python -m clients $(CLIENTS)

setup: $(VENV)/.ready-dev

# One environment, which grows with what is asked of it; one constraints file pins everything that is installed.
$(VENV)/.ready-run: EXTRAS := cli,vision
$(VENV)/.ready-test: EXTRAS := test
$(VENV)/.ready-dev: EXTRAS := dev
$(VENV)/.ready-%: pyproject.toml constraints.txt
	test -x $(BIN)/python || python3 -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[$(EXTRAS)]'
	touch $@

# The pictures of the README and the guide.
pictures: setup
	$(BIN)/roletrust figures --out $(OUT)/figures
	$(BIN)/roletrust play --attack sr_2=bad-mouthing:start=70 --set max_cycles=110 --video --force --out $(OUT)/play
	cp $(OUT)/figures/figure3.png $(OUT)/figures/figure4.png $(OUT)/figures/montage.png docs/
	cp $(OUT)/play/play.png docs/render.png
	$(BIN)/python docs/_ext/moving_picture.py docs/game.gif
	$(BIN)/python -m studies.models --out $(OUT)/models
	cp $(OUT)/models/models.png docs/models.png
	$(MAKE) ladder

# The table of what the trust models cost; on a quiet machine, up to 20 minutes, of which most is compiling.
costs: setup
	$(BIN)/python -m studies.costs --compiled --out $(OUT)/costs
	cp $(OUT)/costs/model-costs.md $(OUT)/costs/model-costs.csv docs/

# The table of what central models cost on lists of ratings; on a quiet machine, a quarter of an hour.
edge-costs: setup
	$(BIN)/python -m studies.costs --ratings 1000000 --ratings 10000000 --out $(OUT)/edge-costs
	cp $(OUT)/edge-costs/edge-costs.md $(OUT)/edge-costs/edge-costs.csv docs/

# What liars cost in cities of up to 10,000 agents, and what a round costs up to a million; some 20 minutes.
scale: setup
	$(BIN)/python -m studies.scale --seeds 20 --out $(OUT)/scale
	cp $(OUT)/scale/scale.md $(OUT)/scale/scale-harm.csv $(OUT)/scale/scale-costs.csv docs/

# The leaderboard and its report, of which the README has the table; an hour and a half on two cores. Git ignores the raw
# results beside the tables; `make archive` packs them.
benchmark: setup
	$(BIN)/roletrust benchmark --suite standard --out $(OUT)/standard
	$(BIN)/roletrust report $(OUT)/standard/results.sqlite --pages ../../reference/models \
		--out docs/leaderboards/standard

# Worse attacks than those that the suite standard knows; an hour on two cores.
SUITES := roletrust_env/benchmarking/suites
known-attacks: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/known-attacks.toml --known $(SUITES)/standard-known.json --out $(OUT)/known-attacks
	$(BIN)/roletrust submit $(OUT)/known-attacks/results.sqlite --attacks --out $(OUT)/known-attacks/known.json

# Whether runs with other seeds agree as often as they promise, and whether the places of agents matter; some 20 minutes on
# two cores.
reruns: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/reruns.toml --out $(OUT)/reruns
	$(BIN)/python -m studies.reruns $(OUT)/reruns/results.sqlite --out $(OUT)/reruns
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/reruns-shuffled.toml --out $(OUT)/reruns-shuffled
	$(BIN)/python -m studies.reruns $(OUT)/reruns/results.sqlite --shuffled $(OUT)/reruns-shuffled/results.sqlite --out $(OUT)/reruns
	cp $(OUT)/reruns/reruns.md $(OUT)/reruns/places.md docs/leaderboards/

# The tables of what the live system's manager takes, by team size and by trust model; on a quiet machine, 20 minutes.
live-load: setup
	$(BIN)/python -m studies.live_load --out $(OUT)/live-load
	$(BIN)/python -m studies.live_load --all-models --seconds 10 --out $(OUT)/live-load-models
	cp $(OUT)/live-load/live-load.md docs/
	cp $(OUT)/live-load-models/live-load.md docs/live-load-models.md

# The leaderboard of what the parts of wary role-trust are worth; a few minutes.
better-model: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/development.toml --force --out $(OUT)/better-model
	cp $(OUT)/better-model/leaderboard.csv docs/better-model.csv

# The tables of what trust models do on logs of real ratings, which are not in the repository: LOGS is a folder of them.
# Some five minutes; `make real LOGS=...` for another folder.
LOGS := logs
real: setup
	$(BIN)/roletrust real $(LOGS) --search 24 --out $(OUT)/real
	mkdir -p docs/real
	cp $(OUT)/real/real.md $(OUT)/real/real.csv docs/real/

# What the parts of leave-one-out are worth in the suite of its name; a quarter of an hour.
leave-one-out: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/leave-one-out.toml --force --out $(OUT)/leave-one-out
	cp $(OUT)/leave-one-out/leaderboard.csv docs/leave-one-out.csv

# First-hand trust beside the best other models, with five trainings of each attacker; half an hour.
first-hand: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/first-hand.toml --out $(OUT)/first-hand
	$(BIN)/roletrust report $(OUT)/first-hand/results.sqlite --out $(OUT)/first-hand/report
	mkdir -p docs/first-hand
	cp $(OUT)/first-hand/leaderboard.csv $(OUT)/first-hand/report/worst_cases.csv docs/first-hand/

# Leave-one-out on logs of real ratings, which are yours: `make leave-one-out-logs LOGS=...`; minutes.
PARTS := own=1 limit=0 modesty=0 power=0 keep=1 prior=0.001
OTHERS := wary-role-trust role-trust beta iterative-filtering two-way-mean fairness-goodness bias-deserve
leave-one-out-logs: setup
	$(BIN)/roletrust real $(LOGS) --model leave-one-out $(PARTS:%=--model leave-one-out:%) $(OTHERS:%=--model %) \
		--out $(OUT)/real-30
	$(BIN)/roletrust real $(LOGS) --model leave-one-out $(PARTS:%=--model leave-one-out:%) $(OTHERS:%=--model %) \
		--every 604800 --out $(OUT)/real-7
	cp $(OUT)/real-30/real.csv docs/leave-one-out-30.csv
	cp $(OUT)/real-7/real.csv docs/leave-one-out-7.csv

# The game that the suite standard has played; a minute, once `make benchmark` has run.
equilibrium: setup
	$(BIN)/python -m studies.equilibrium $(OUT)/standard/results.sqlite --out $(OUT)/equilibrium
	mkdir -p docs/equilibrium
	cp $(OUT)/equilibrium/equilibrium.* $(OUT)/equilibrium/attacks.csv docs/equilibrium/

# What providers and raters learn under some trust models, and what is left of honest service; some ten minutes on one
# core, and a repeat continues.
strategic: setup
	$(BIN)/python -m studies.strategic --workers 1 --out $(OUT)/strategic
	mkdir -p docs/strategic
	for kind in png md csv; do cp $(OUT)/strategic/strategic.$$kind docs/strategic/; done

# Trust models and attackers that are trained against each other, three times; half an hour of one core, and a repeat
# continues.
DEFENCES := leave-one-out first-hand network
JUDGES := travos own-experience first-hand
defence: setup
	$(BIN)/python -m studies.defend $(DEFENCES:%=--defence %) $(JUDGES:%=--beside %) --iterations 3 --runs 3 --out $(OUT)/defence
	mkdir -p docs/defence
	for file in defence.md defence.png iterations.csv comparison.csv leads.csv seed-0/leave-one-out.txt seed-0/first-hand.txt \
	  seed-0/network.json seed-0/network.safetensors; do cp $(OUT)/defence/$$file docs/defence/; done

# The learned models on logs of real ratings, which are yours: `make defence-logs LOGS=...`; a minute.
defence-logs: setup
	$(BIN)/roletrust real $(LOGS) --model leave-one-out --model "$$(cat docs/defence/leave-one-out.txt)" \
		--model roletrust_agents.learned.saved_defence:SavedTrust:path=docs/defence/network \
		$(OTHERS:%=--model %) --out $(OUT)/defence-logs
	cp $(OUT)/defence-logs/real.csv docs/defence/logs.csv

# What the paper claims or leaves open, answered; minutes on two cores.
findings: setup
	$(BIN)/python -m studies.findings --out $(OUT)/findings
	mkdir -p docs/findings
	cp $(OUT)/findings/findings.md docs/
	cp $(OUT)/findings/findings/*.png docs/findings/

# What attackers of today find where those of the first suite searched, what a longer search finds, what five searches find
# in three conditions, and what carries over to other trust models; two hours on two cores, and a repeat continues.
FIVE_RUNS := $(BIN)/python -m studies.budget --way scripts --way 'agreed CMA-ES' --way evolution --way 'evolution strategy' --budget 2000000 --runs 5 \
	--model wary-role-trust --model beta --model role-trust --model qor
attackers: setup
	$(BIN)/roletrust benchmark --suite experiments/studies/suites/attackers.toml --out $(OUT)/attackers
	$(BIN)/roletrust report $(OUT)/attackers/results.sqlite --out $(OUT)/attackers/report
	$(BIN)/python -m studies.budget --out $(OUT)/budget
	$(FIVE_RUNS) --track raters --share 0.5 --out $(OUT)/crowd-raters
	$(FIVE_RUNS) --out $(OUT)/crowd-coalition
	$(FIVE_RUNS) --scenario market --track raters --out $(OUT)/market-raters
	$(BIN)/python -m studies.budget --way evolution --way 'coalition PPO' --way 'coalition PPO:start=random' --budget 100000 --runs 5 \
	  --track raters --share 0.5 $(FIVE) --out $(OUT)/ppo
	$(BIN)/python -m studies.transfer --games 50 --out $(OUT)/transfer
	$(BIN)/python -m studies.transfer --model beta --on studies.robustrep:RobustRep --games 40 --out $(OUT)/outside
	mkdir -p docs/attackers
	for name in budget transfer; do for kind in png md csv; do \
	  cp $(OUT)/$$name/$$name.$$kind docs/attackers/; done; done
	cp $(OUT)/budget/budget.json $(OUT)/attackers/report/games.csv.gz docs/attackers/
	cp $(OUT)/outside/transfer.md docs/attackers/outside.md
	for name in crowd-raters crowd-coalition market-raters ppo; do cp $(OUT)/$$name/budget.md docs/attackers/$$name.md; done

# Which learner finds coalitions with how many rounds, and how near learners come to a known optimum; some minutes on two
# cores.
learners: setup
	$(BIN)/roletrust benchmark --suite learners-coalitions --out $(OUT)/learners
	mkdir -p docs/attackers
	for kind in png md csv; do cp $(OUT)/learners/learners.$$kind docs/attackers/; done
	$(BIN)/roletrust benchmark --suite learners-optimum --out $(OUT)/optimum
	for kind in md csv; do cp $(OUT)/optimum/learners.$$kind docs/attackers/optimum.$$kind; done

# Three colluders: five trainings, and with them five ladders, about half an hour on two cores.
ladder: setup
	rm -rf $(OUT)/colluders
	$(BIN)/roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out $(OUT)/colluders
	$(BIN)/python -m studies.ladder CollusionAttack --stealth-weight 2 --runs 5 --learned $(OUT)/colluders --out $(OUT)/ladder
	cp $(OUT)/ladder/ladder.png docs/ladder.png

# Universal coalitions: one network each for liars, cheats, both, and both with identities in reserve, in the crowd and in
# the market of the suite two-worlds, trained against five trust models in turn; some minutes on two cores with
# `make -j 2`. What is in $(OUT)/universal is not trained again.
FIVE := --model wary-role-trust --model beta --model role-trust --model qor --model median
EVOLVE := $(BIN)/roletrust train CollusionAttack --learner evolution:start=random --steps 6000000 --objective mislead $(FIVE)
CROWD := --scenario crowd-10x10 --set max_cycles=50
MARKET := --scenario market --set max_cycles=50
SR_10 := {role="SR",count=10,noise=0.05}
SR_7_AND_3 := {role="SR",count=7,noise=0.05},{role="SR",count=3,noise=0.05,reserve=3}
ABLE := role="SP",ability=[0.3,1.0]
LIARS := --compromised sr_7 --compromised sr_8 --compromised sr_9
CHEATS := --compromised sp_7 --compromised sp_8 --compromised sp_9
CHEATS_OF_6 := --compromised sp_4 --compromised sp_5
UNIVERSAL := raters providers coalition identities raters-market coalition-market identities-market
$(OUT)/universal/raters/attacker.json: ARGS = $(CROWD) --set 'agents=[$(SR_10),{$(ABLE),count=10}]' --compromised sr_5 --compromised sr_6 $(LIARS)
$(OUT)/universal/providers/attacker.json: ARGS = $(CROWD) --set 'agents=[$(SR_10),{$(ABLE),count=10}]' $(CHEATS)
$(OUT)/universal/coalition/attacker.json: ARGS = $(CROWD) --set 'agents=[$(SR_10),{$(ABLE),count=10}]' $(LIARS) $(CHEATS)
$(OUT)/universal/identities/attacker.json: ARGS = $(CROWD) --set 'agents=[$(SR_7_AND_3),{$(ABLE),count=7},{$(ABLE),count=3,reserve=3}]' $(LIARS) $(CHEATS)
$(OUT)/universal/raters-market/attacker.json: ARGS = $(MARKET) --set 'agents=[$(SR_10),{$(ABLE),count=6}]' $(LIARS)
$(OUT)/universal/coalition-market/attacker.json: ARGS = $(MARKET) --set 'agents=[$(SR_10),{$(ABLE),count=6}]' $(LIARS) $(CHEATS_OF_6)
$(OUT)/universal/identities-market/attacker.json: ARGS = $(MARKET) --set 'agents=[$(SR_7_AND_3),{$(ABLE),count=4},{$(ABLE),count=2,reserve=3}]' $(LIARS) $(CHEATS_OF_6)
universal: setup $(UNIVERSAL:%=$(OUT)/universal/%/attacker.json)
	for name in $(UNIVERSAL); do for kind in json safetensors; do \
	  cp $(OUT)/universal/$$name/attacker.$$kind agents/roletrust_agents/zoo/universal-$$name.$$kind; done; done

$(OUT)/universal/%/attacker.json: | setup
	rm -rf $(@D)
	$(EVOLVE) $(ARGS) --out $(@D)

# The attackers that come with the project; a few minutes.
zoo: setup universal
	rm -rf $(OUT)/zoo
	$(BIN)/roletrust train ProviderAttack $(CERTAIN) --out $(OUT)/zoo/provider-3x3
	$(BIN)/roletrust train RaterAttack --stealth-weight 2 $(CERTAIN) --out $(OUT)/zoo/rater-3x3
	$(BIN)/roletrust train CollusionAttack --stealth-weight 2 --out $(OUT)/zoo/collusion-10x10
	for name in provider-3x3 rater-3x3 collusion-10x10; do for kind in json safetensors; do \
	  cp $(OUT)/zoo/$$name/attacker.$$kind agents/roletrust_agents/zoo/$$name.$$kind; done; done
	$(BIN)/roletrust list zoo --games 256

# The technical report in build/report/, from the results in docs/; seconds. Chromium prints the PDF, where there is one.
report: setup
	$(BIN)/python docs/_ext/article.py docs build/report

# The assets of a release, with checksums: the source and the tables of the last commit, the same bytes for the same commit,
# and the raw results beside the tables, as `make benchmark` and `make attackers` have written them.
ARCHIVE := build/archive
RESULTS := docs/leaderboards/standard docs/attackers
archive:
	rm -rf $(ARCHIVE)
	mkdir -p $(ARCHIVE)
	git archive --format=tar --prefix=roletrust/ HEAD > $(ARCHIVE)/roletrust.tar
	tar -x -f $(ARCHIVE)/roletrust.tar -C $(ARCHIVE)
	cd $(ARCHIVE) && find roletrust -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum > SHA256SUMS
	gzip -n -9 $(ARCHIVE)/roletrust.tar
	rm -rf $(ARCHIVE)/roletrust
	git ls-files -z --others --ignored --exclude-standard $(RESULTS) | LC_ALL=C sort -z > $(ARCHIVE)/raw
	[ -s $(ARCHIVE)/raw ] || echo 'There are no raw results: make benchmark and make attackers write them.'
	tar --null --files-from=$(ARCHIVE)/raw --mtime=@0 --owner=0 --group=0 --numeric-owner -c | gzip -n -9 > $(ARCHIVE)/roletrust-results.tar.gz
	rm $(ARCHIVE)/raw
	cd $(ARCHIVE) && sha256sum *.tar.gz SHA256SUMS | tee roletrust.sha256

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .hypothesis .mypy_cache .ruff_cache
