# Every target that `make help` prints has a sentence behind ##.
.DEFAULT_GOAL := help

.PHONY: help
help: ## Print these targets.
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  \1\t\2/' | expand -t 18

.PHONY: install
install: ## Install the package, optimised, with what the tests and linters need.
	pip install '.[dev]'

.PHONY: develop
develop: ## Build the extension into the source tree, for working on it.
	pip install --editable '.[dev]'

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
	mypy --platform win32
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

.PHONY: instructions
instructions: ## Count the instructions of each stage under Valgrind and hold them against those recorded.
	cargo run --release --locked -p ldls-bench

.PHONY: docs
docs: ## Build the documentation into site/, strictly: a dead link is an error.
	mkdocs build --strict

.PHONY: pictures
pictures: ## Make the pictures of the documentation anew, by the commands beside them.
	python docs/pictures.py

.PHONY: kills
kills: ## Kill 200 runs of `ldls run` and hold what they leave, resumed, against an undisturbed one.
	python tests/campaigns/kills.py

.PHONY: ctrl-c
ctrl-c: ## Press Ctrl-C at 20 moments of a call with ten million points and time its return.
	python tests/campaigns/stopping.py ctrl-c

.PHONY: memory
memory: ## Run six million points under 50 limits of memory: labels or MemoryError, never an abort.
	python tests/campaigns/stopping.py memory

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

# manylinux2014: any Linux with glibc 2.17, of 2012, or newer
# a thread that the interpreter ends is unwound by the system's library: zig's own, in its place, ends the process
SYSTEM_UNWINDER = $(shell gcc -print-file-name=libgcc_s.so.1)

.PHONY: release
release: ## Build wheel and sdist into dist/, check both, and build the sdist again.
	rm -rf dist build/from-sdist
	RUSTFLAGS="-C link-arg=$(SYSTEM_UNWINDER)" \
		maturin build --release --locked --zig --compatibility manylinux2014 --out dist
	maturin sdist --out dist
	twine check --strict dist/*
	auditwheel show dist/*.whl | grep '"manylinux_2_17_'
	pip wheel --no-deps --wheel-dir build/from-sdist dist/*.tar.gz

.PHONY: release-test
release-test: ## Test the wheel of dist/ as users have it: a fresh environment, no Rust.
	rm -rf build/fresh
	python -m venv build/fresh
	build/fresh/bin/pip install "$$(ls dist/*.whl)[test]"
	PATH="$(CURDIR)/build/fresh/bin:/usr/bin:/bin" pytest

.PHONY: check-windows
check-windows: ## Check that the Rust compiles for Windows.
	cargo check --workspace --locked --target x86_64-pc-windows-gnu

# sanitizers come with nightly Rust, for code that is compiled for a target named by itself
HOST = $(shell rustc -vV | sed -n 's/^host: //p')

.PHONY: asan
asan: ## Run the core's tests under AddressSanitizer.
	RUSTFLAGS=-Zsanitizer=address cargo +nightly test -p ldls-core --locked --tests --target $(HOST)

# the standard library too is compiled for it: locks that it cannot see look like races
.PHONY: tsan
tsan: ## Run the core's tests under ThreadSanitizer.
	PROPTEST_CASES=32 RUSTFLAGS=-Zsanitizer=thread cargo +nightly test -p ldls-core --locked --tests --target $(HOST) -Zbuild-std

# the tests that end within minutes there. Pools of threads end with the process, and so leak; crossbeam, below rayon, keeps
# the rules of tree borrows alone
.PHONY: miri
miri: ## Run part of the core's tests under Miri.
	MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-permissive-provenance -Zmiri-ignore-leaks -Zmiri-tree-borrows" \
		PROPTEST_CASES=4 RAYON_NUM_THREADS=2 cargo +nightly miri test -p ldls-core --locked --lib -- $(MIRI_TESTS)

MIRI_TESTS = diffusion::pass diffusion::tests::a_point diffusion::winners graph:: masks::compressed masks::polygon \
	masks::rle ring::

.PHONY: audit
audit: ## Look up known weaknesses of the libraries that are used.
	cargo audit
	pip-audit --strict .
