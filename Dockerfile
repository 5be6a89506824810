# The base of Evenlight: everything but sessions in a window. From the folder with the films:
#   docker build -t evenlight /path/to/the/checkout
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" evenlight optimize film.mp4 --budget 0.5 --out film-track
FROM python:3.12-slim

# Mesa draws scenes and ramps without a graphics card.
RUN apt-get update && \
    apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri && \
    rm -rf /var/lib/apt/lists/*

COPY . /source
RUN cd /source && \
    pip install --no-cache-dir --require-hashes --requirement requirements/base.txt && \
    pip install --no-cache-dir --no-deps --no-build-isolation . && \
    cd / && rm -rf /source

# Its loops, for whoever runs it: what is compiled lies in a folder that all may read.
ENV NUMBA_CACHE_DIR=/opt/evenlight-loops
RUN mkdir "$NUMBA_CACHE_DIR" && \
    python -m evenlight.compile_kernels && \
    chmod -R a+rwX "$NUMBA_CACHE_DIR"

ENV XDG_CACHE_HOME=/tmp MPLCONFIGDIR=/tmp/matplotlib HOME=/tmp
WORKDIR /data
ENTRYPOINT ["evenlight"]
CMD ["--help"]
