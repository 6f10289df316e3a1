# The thin front: every target installs what it needs (only where it is missing) and hands over to CMake.
# To add a target: depend on `setup` (or on `build`, which does), keep it a few lines, name it under `help`.

.DEFAULT_GOAL := build
.PHONY: help setup build demo demo-perception test check-long bench format lint fuzz docs sanitize fusion figures figures-rgbd install clean

JOBS ?= $(shell nproc)
FUZZ_SECONDS ?= 60
PREFIX ?= /usr/local

help:
	@echo 'make build       the program, at build/bin/sherlog (default)'
	@echo 'make demo        the shipped models on their evidence'
	@echo 'make demo-perception  from frames to beliefs: a page with pictures of each stage, build/perception.html'
	@echo 'make test        all tests'
	@echo 'make check-long  the property tests on 2,000 random models'
	@echo 'make sanitize    a bounded part of the tests under address and undefined-behaviour sanitizers'
	@echo 'make bench       benchmarks'
	@echo 'make fuzz        fuzzes the parsers for FUZZ_SECONDS (60) each'
	@echo 'make format      clang-format over all sources'
	@echo 'make lint        clang-format --dry-run and clang-tidy'
	@echo 'make fusion      the information-fusion experiment on synthetic scenes, or on DATA=SCENES.db'
	@echo 'make figures     the four-table evaluation (Fig. 10) and the kitchen scenes (Fig. 11) in build/figures, about two minutes'
	@echo 'make figures-rgbd  the pictures of the depth and nearest-neighbour papers in build/figures/rgbd, about a minute'
	@echo 'make docs        docs/commands.md from --help, and a check of all links in the documents'
	@echo 'make install     to PREFIX (/usr/local)'

setup:
	@scripts/setup.sh build

# Configuring once is enough: the build runs CMake again where a list or a folder changed.
build/build.ninja: | setup
	cmake --preset release

build: setup build/build.ninja
	cmake --build --preset release -j $(JOBS) --target sherlog_cli

demo: build
	@scripts/demo.sh build/bin/sherlog

demo-perception: build
	cmake --build --preset release -j $(JOBS) --target example_perception_report
	build/examples/perception_report build/perception.html

test: build
	cmake --build --preset release -j $(JOBS)
	ctest --preset release -j $(JOBS)

check-long: build
	cmake --build --preset release -j $(JOBS)
	SHERLOG_RANDOM_MODELS=2000 ctest --preset release -j $(JOBS) -L property

sanitize: setup
	cmake --preset sanitize
	cmake --build --preset sanitize -j $(JOBS) --target sherlog_unit_tests sherlog_golden_tests sherlog_property_tests sherlog_rgbd_tests
	SHERLOG_RANDOM_MODELS=20 ctest --preset sanitize -j $(JOBS)

bench: setup
	cmake --preset bench
	cmake --build --preset bench -j $(JOBS)
	@for program in build/bench-build/bench/*; do [ -x "$$program" ] && [ -f "$$program" ] || continue; "$$program" || exit 1; done

format:
	@scripts/setup.sh format
	@scripts/sources.sh | xargs clang-format -i

lint:
	@scripts/setup.sh lint
	@scripts/lint.sh $(JOBS)

fuzz: setup
	@scripts/fuzz.sh $(FUZZ_SECONDS) $(JOBS)

docs: build
	@scripts/docs.sh build/bin/sherlog

# Ten seeds of five folds on recorded scenes take some minutes. Reports go to build/fusion.
fusion: build
	cmake --build --preset release -j $(JOBS) --target example_fusion_experiment
	@mkdir -p build/fusion
	build/examples/fusion_experiment $(if $(DATA),--data $(DATA),--scenes 40 --seeds 2 --folds 5) --out build/fusion

# Every number of docs/experiments/identity.md.
figures: build
	@mkdir -p build/figures
	build/bin/sherlog track evaluate --csv build/figures/four_tables.csv --svg build/figures/four_tables.svg \
	  --html build/figures/four_tables.html --json build/figures/four_tables.json | tee build/figures/four_tables.txt
	rm -f build/figures/kitchen.db*
	build/bin/sherlog scenes import build/figures/kitchen.db examples/scenes/figure11.jsonl
	build/bin/sherlog track show build/figures/kitchen.db --scene plates-after --against plates-before --svg build/figures/figure11a.svg
	build/bin/sherlog track show build/figures/kitchen.db --scene table-after --against table-before --svg build/figures/figure11b.svg

# Pictures of docs/experiments/depth.md and nearest.md.
figures-rgbd: setup
	cmake --preset bench
	cmake --build --preset bench -j $(JOBS) --target bench_depth_bench bench_nearest_bench
	@mkdir -p build/figures/rgbd
	build/bench-build/bench/depth_bench --pictures build/figures/rgbd
	build/bench-build/bench/nearest_bench --pictures build/figures/rgbd

install: build
	cmake --build --preset release -j $(JOBS)
	cmake --install build --prefix $(PREFIX)

clean:
	rm -rf build
