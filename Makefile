# Every target that `make help` prints has a sentence behind ##.
.DEFAULT_GOAL := help

.PHONY: help
help: ## Print these targets.
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  \1\t\2/' | expand -t 16

.PHONY: install
install: ## Install the package, optimised, with what the tests and linters need.
	pip install '.[dev]'

.PHONY: develop
develop: ## Build the extension into the source tree, for working on it.
	maturin develop --release --extras dev

.PHONY: test
test: ## Run the tests of Python and Rust.
	pytest
	cargo test

.PHONY: lint
lint: ## Run all linters and type checks.
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	ruff check .
	ruff format --check .
	mypy
	python -m mypy.stubtest ldls._ldls
	lint-imports

.PHONY: format
format: ## Format Rust and Python.
	cargo fmt --all
	ruff check --fix .
	ruff format .

.PHONY: bench
bench: ## Compare with peers, then time every stage.
	python -m benches
	cargo bench

.PHONY: docs
docs: ## Build the documentation into site/, strictly: a dead link is an error.
	mkdocs build --strict

.PHONY: pictures
pictures: ## Make the pictures of the documentation anew, by the commands beside them.
	python docs/pictures.py

.PHONY: kills
kills: ## Kill 200 runs of `ldls run` and hold what they leave, resumed, against an undisturbed one.
	python tests/campaigns/kills.py

.PHONY: fuzz
fuzz: ## Hold fast paths of the core against slow ones on many random inputs.
	cargo run --release -p ldls-fuzz -- knn --count 10000
	cargo run --release -p ldls-fuzz -- rle --count 1500000
	cargo run --release -p ldls-fuzz -- polygon --count 100000
	cargo run --release -p ldls-fuzz -- diffusion --count 5000

.PHONY: fuzz-face
fuzz-face: ## Try the Python face on thousands of arrays, cameras and parameters at random.
	pytest --hypothesis-profile=fuzz -n auto --dist=load tests/test_face.py

.PHONY: same-bits
same-bits: ## Label 50 scenes with 1 to 16 threads, 20 times each, and compare every bit.
	python tests/campaigns/same_bits.py

.PHONY: soak
soak: ## Label 20,000 frames in one process and tell by how much its memory grows.
	python tests/campaigns/soak.py

.PHONY: fuzz-files
fuzz-files: ## Change a million files for each parser at random and read them: only errors of ldls may come of it.
	python tests/campaigns/parsers.py

.PHONY: ray-hosts
ray-hosts: ## Run on a Ray cluster of three hosts, of which one is cut off and one joins late; needs root.
	python tests/campaigns/ray_hosts.py

.PHONY: sample
sample: ## Make the frame of `ldls demo` anew, from its seed.
	python tests/simulation/make_sample.py
