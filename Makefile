# make demo    a room, its mesh, scores and pictures, in demo/; from photos alone, the room's exact depth is not used
# make test    the tests; those marked slow: make test-slow, both: make test-all
# make coverage   make test, and which branches of the code it takes
# make lint    style and types
# make docs    the documentation as a site, in site/
# make sanitize    the bindings and threads under AddressSanitizer, UndefinedBehaviorSanitizer and ThreadSanitizer
# make train-prior   trains the network for depth and normals, in build/prior; goes on where it was stopped
# make bench   how fast the rasterizer is on this machine
# make gpu-check   with an NVIDIA GPU: builds the CUDA kernels, checks them against the reference, times them (8 minutes)
# make gpu-sanitize   after gpu-check: the CUDA kernels under compute-sanitizer
# make clean   forget everything that was made here

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# The pinned versions exist for Python 3.11 and newer; 3.10 takes what pip finds.
PINS := $(shell $(PYTHON) -c 'import sys; print("-c constraints.txt" if sys.version_info >= (3, 11) else "")')
PIP := $(BIN)/python -m pip --disable-pip-version-check
SOURCES := $(shell find room2dgs -name '*.cpp' -o -name '*.h' -o -name '*.cu') CMakeLists.txt pyproject.toml constraints.txt
ROOM_OPTIONS ?=
DEMO_OPTIONS ?=
# on a GPU: PRIOR_OPTIONS='--device cuda --precision bf16 --batch 64 --workers 16 --minutes 10 --from ...'
PRIOR := build/prior
PRIOR_ROOMS ?= 848
PRIOR_OPTIONS ?= --from room2dgs/depth/network/room_prior.onnx
GPU_ARCHITECTURES ?= native
GPU_OPTIONS ?=
GPU_TESTS ?= $(wildcard tests/bindings/test_block_*.py) $(addprefix tests/,splat/test_blocks.py losses/test_blocks.py \
	train/test_block_multiview.py train/test_on_device.py stereo/test_patchmatch.py stereo/test_dense.py \
	mesh/test_device_volume.py commands/test_mesh_on_device.py)
TEST_OPTIONS ?= -n 2 --dist loadfile --durations=20 --durations-min=8

.PHONY: install demo test test-slow test-all coverage lint docs sanitize bench train-prior gpu-check gpu-sanitize clean
.DELETE_ON_ERROR:

install: $(READY)

$(READY): $(SOURCES)
	@$(PYTHON) room2dgs/system_libraries.py --install
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python .ci/requirements.py dev > $(VENV)/requirements.txt
	$(PIP) install -q $(PINS) -r $(VENV)/requirements.txt
	$(PIP) install -q --no-build-isolation --no-deps -e .
	$(BIN)/room2dgs doctor
	@touch $(READY)

demo: $(READY)
	@test -f demo/room/gt_mesh.ply || $(BIN)/room2dgs demo demo/room --overwrite $(ROOM_OPTIONS)
	@rm -rf demo/run
	$(BIN)/room2dgs run scene.path=demo/room out=demo/run prior=room_prior $(DEMO_OPTIONS)

test: $(READY)
	$(BIN)/python -m pytest $(TEST_OPTIONS) -m "not slow"

test-slow: $(READY)
	$(BIN)/python -m pytest $(TEST_OPTIONS) -m slow

test-all: test-slow test

# `make test`, slower by half: each line is noted as it runs.
coverage: $(READY)
	@rm -rf build/coverage && mkdir -p build/coverage
	COVERAGE_FILE=$(CURDIR)/build/coverage/data \
		$(BIN)/python -m pytest $(TEST_OPTIONS) -m "not slow" --cov --cov-config=pyproject.toml --cov-report=
	$(BIN)/python -m room2dgs.tools.branch_coverage build/coverage/data

# Types are checked in the package as it is installed, with the top-level folders inside.
lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@rm -rf build/typing && mkdir -p build/typing/room2dgs
	@ln -s $(CURDIR)/room2dgs/* $(CURDIR)/eval $(CURDIR)/tools build/typing/room2dgs
	@ln -s $(CURDIR)/tests build/typing
	cd build/typing && $(CURDIR)/$(BIN)/mypy --config-file $(CURDIR)/pyproject.toml --cache-dir ../mypy -p room2dgs

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict -q

sanitize: $(READY)
	$(BIN)/python tests/bindings/sanitize.py

train-prior: $(READY)
	$(BIN)/python -m room2dgs.tools.make_prior_data $(PRIOR)/data --rooms $(PRIOR_ROOMS) --workers $(shell nproc)
	$(BIN)/python -m room2dgs.tools.train_prior $(PRIOR)/data $(PRIOR)/run $(PRIOR_OPTIONS)
	$(BIN)/python -m room2dgs.tools.export_prior $(PRIOR)/run $(PRIOR)/room_prior.onnx

bench: $(READY)
	$(BIN)/room2dgs bench raster

# The environment must be there: on the way here nothing is fetched, so that it works without a network.
gpu-check:
	@test -x $(BIN)/room2dgs || { echo "make install comes first"; exit 2; }
	$(PIP) install -q --no-build-isolation --no-deps --no-index -C cmake.define.ROOM2DGS_CUDA=on \
		-C cmake.define.ROOM2DGS_CUDA_ARCHITECTURES=$(GPU_ARCHITECTURES) -e .
	@$(BIN)/room2dgs doctor | grep -E "CUDA|GPU"
	$(BIN)/python -m pytest -p tests.device.on_gpu $(GPU_TESTS)
	$(BIN)/python -m room2dgs.tools.gpu_check --json gpu_check.json $(GPU_OPTIONS)

# Each allocation apart: a cache of torch's would hide what reaches beyond one.
gpu-sanitize:
	for tool in memcheck racecheck initcheck synccheck; do PYTORCH_NO_CUDA_MEMORY_CACHING=1 \
		compute-sanitizer --tool $$tool --error-exitcode 9 \
		$(BIN)/python -m pytest -p tests.device.on_gpu $(wildcard tests/bindings/test_block_*.py) || exit 1; done

clean:
	rm -rf $(VENV) build demo site .pytest_cache .ruff_cache .hypothesis
