# docker build -t room2dgs .
# docker run --rm -v "$PWD:/data" room2dgs run scene.path=room out=runs/room
FROM python:3.11-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++
COPY . /src
RUN pip wheel --no-cache-dir --no-deps -w /wheels /src

FROM python:3.11-slim-bookworm
# open3d and torch link these (room2dgs/system_libraries.py)
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        libusb-1.0-0 libgl1 libegl1 libx11-6 libudev1 libidn2-0 libgomp1 \
    && rm -rf /var/lib/apt/lists/*
# PyTorch's own index of CPU builds, to do without several GB of CUDA
ARG PIP_EXTRA_INDEX_URL=""
COPY constraints.txt /
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir -c /constraints.txt "$(ls /wheels/*.whl)[export,view]" \
    && room2dgs doctor
WORKDIR /data
EXPOSE 8080
ENTRYPOINT ["room2dgs"]
CMD ["--help"]
